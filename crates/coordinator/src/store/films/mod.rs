//! What the database keeps of films: nodes, rounds, shares of passes, and which coordinator works on a film.

pub(in crate::store) mod film_leases;
pub(in crate::store) mod nodes;
pub(in crate::store) mod rounds;
pub(in crate::store) mod shares;
