//! How `fnee` searches.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How Fermat next event estimation searches for stationary paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FneeSolver {
    /// Enumerates the paths in the deflection window: minima, saddles and maxima alike.
    #[default]
    Complete,
    /// Huan et al. 2023, Algorithm 1, with uniform seeds over both faces: finds minima almost exclusively.
    Published,
}
