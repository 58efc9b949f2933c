//! What a program has no twin for, and what stands there instead.

use serde::Serialize;

/// Something that is not quite what it is in the scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Approximation {
    /// Its place in the scene file.
    pub(crate) place: String,
    /// What stands there instead.
    pub(crate) by: &'static str,
    /// How the two differ.
    pub(crate) difference: &'static str,
}

/// Places that a sentence names.
const NAMED: usize = 4;

/// A sentence for each difference, with the places that have it.
pub(crate) fn sentences(approximations: &[Approximation]) -> Vec<String> {
    let mut kinds: Vec<(&str, &str, Vec<&str>)> = Vec::new();
    for Approximation { place, by, difference } in approximations {
        match kinds.iter_mut().find(|kind| (kind.0, kind.1) == (*by, *difference)) {
            Some((_, _, places)) => places.push(place),
            None => kinds.push((by, difference, vec![place])),
        }
    }
    let sentence = |(by, difference, places): (&str, &str, Vec<&str>)| {
        let mut named = places[..places.len().min(NAMED)].join(", ");
        if places.len() > NAMED {
            named += &format!(" and {} more", places.len() - NAMED);
        }
        let verb = if places.len() == 1 { "is" } else { "are" };
        format!("{named} {verb} approximated by {by}: {difference}")
    };
    kinds.into_iter().map(sentence).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_difference_is_one_sentence_that_names_a_few_places() {
        let of = |place: usize, by| Approximation { place: format!("m{place}"), by, difference: "it differs" };
        let all: Vec<Approximation> = (0..6).map(|place| of(place, if place == 2 { "`b`" } else { "`a`" })).collect();
        assert_eq!(
            sentences(&all),
            ["m0, m1, m3, m4 and 1 more are approximated by `a`: it differs", "m2 is approximated by `b`: it differs"]
        );
    }
}
