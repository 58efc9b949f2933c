//! Which kind of glass a piece is cut from. The kinds are names, whose meaning is the caller's.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{GlazingError, check, join};
use crate::random::Random;

/// How kinds of glass are spread over the pieces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GlassPattern {
    /// One kind for all pieces.
    Uniform(UniformGlass),
    /// Kinds that follow each other along rows and from row to row, as on a chequerboard.
    Checker(GlassCycle),
    /// A kind for each row, over and over from below.
    Rows(GlassCycle),
    /// A kind for each light, over and over: first those on the sill, from the left, then those above them.
    Lights(GlassCycle),
    /// Kinds at random, by weight.
    Mixed(MixedGlass),
}

/// One kind for all pieces.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UniformGlass {
    /// The kind of glass.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
}

/// Kinds in an order.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlassCycle {
    /// The kinds of glass, 1 to 100.
    #[schemars(length(min = 1, max = 100))]
    pub names: Vec<String>,
}

/// Kinds with weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MixedGlass {
    /// The kinds of glass, 1 to 100. A kind with twice the weight has twice as many pieces.
    #[schemars(length(min = 1, max = 100))]
    pub kinds: Vec<WeightedGlass>,
}

/// A kind of glass with its weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WeightedGlass {
    /// The kind of glass.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Its share among the weights of all kinds, 0.001 to 1000.
    #[serde(default = "one")]
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub weight: f64,
}

fn one() -> f64 {
    1.0
}

/// Where a piece is in a pattern.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatternPlace {
    /// Number of its light.
    pub(crate) light: i64,
    /// Its row.
    pub(crate) row: i64,
    /// Its number along rows and from row to row.
    pub(crate) checker: i64,
}

impl Default for GlassPattern {
    fn default() -> Self {
        Self::Uniform(UniformGlass { name: "clear".to_owned() })
    }
}

impl GlassPattern {
    /// Checks names and weights.
    pub(crate) fn validate(&self, path: &str) -> Result<(), GlazingError> {
        let cycle = |name: &str, cycle: &GlassCycle| {
            let path = format!("{}.names", join(path, name));
            check_length(&path, cycle.names.len())?;
            (cycle.names.iter().enumerate()).try_for_each(|(index, name)| check_name(&format!("{path}[{index}]"), name))
        };
        match self {
            Self::Uniform(uniform) => check_name(&join(path, "uniform.name"), &uniform.name),
            Self::Checker(names) => cycle("checker", names),
            Self::Rows(names) => cycle("rows", names),
            Self::Lights(names) => cycle("lights", names),
            Self::Mixed(mixed) => {
                let path = join(path, "mixed.kinds");
                check_length(&path, mixed.kinds.len())?;
                (mixed.kinds.iter().enumerate()).try_for_each(|(index, kind)| {
                    let path = format!("{path}[{index}]");
                    check_name(&join(&path, "name"), &kind.name)?;
                    check(&path, "weight", kind.weight, 0.001..=1000.0, "")
                })
            }
        }
    }

    /// The names of all kinds.
    pub(crate) fn names(&self) -> Vec<&str> {
        match self {
            Self::Uniform(uniform) => vec![&uniform.name],
            Self::Checker(cycle) | Self::Rows(cycle) | Self::Lights(cycle) => {
                cycle.names.iter().map(String::as_str).collect()
            }
            Self::Mixed(mixed) => mixed.kinds.iter().map(|kind| kind.name.as_str()).collect(),
        }
    }

    /// The kind of a piece, by its place.
    pub(crate) fn pick(&self, place: PatternPlace, random: &mut Random) -> &str {
        let cycle = |names: &[String], number: i64| number.rem_euclid(names.len().max(1) as i64) as usize;
        match self {
            Self::Uniform(uniform) => &uniform.name,
            Self::Checker(GlassCycle { names }) => names.get(cycle(names, place.checker)).map_or("", String::as_str),
            Self::Rows(GlassCycle { names }) => names.get(cycle(names, place.row)).map_or("", String::as_str),
            Self::Lights(GlassCycle { names }) => names.get(cycle(names, place.light)).map_or("", String::as_str),
            Self::Mixed(MixedGlass { kinds }) => {
                let total: f64 = kinds.iter().map(|kind| kind.weight).sum();
                let mut left = random.unit() * total;
                let chosen = kinds.iter().find(|kind| {
                    left -= kind.weight;
                    left < 0.0
                });
                chosen.or(kinds.last()).map_or("", |kind| &kind.name)
            }
        }
    }
}

/// Refuses names that are empty or too long.
pub(crate) fn check_name(path: &str, name: &str) -> Result<(), GlazingError> {
    if (1..=200).contains(&name.chars().count()) {
        return Ok(());
    }
    Err(GlazingError::new(path, format!("\"{name}\""), "the name of a kind of glass, 1 to 200 characters"))
}

fn check_length(path: &str, length: usize) -> Result<(), GlazingError> {
    if (1..=100).contains(&length) {
        return Ok(());
    }
    Err(GlazingError::new(path, format!("{length} kinds"), "1 to 100 kinds of glass"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random() -> Random {
        Random::new(1, &[])
    }

    #[test]
    fn cycles_repeat() {
        let names = || GlassCycle { names: vec!["red".into(), "blue".into()] };
        let place = PatternPlace { light: 3, row: -2, checker: -1 };
        assert_eq!(GlassPattern::Checker(names()).pick(place, &mut random()), "blue");
        assert_eq!(GlassPattern::Rows(names()).pick(place, &mut random()), "red");
        assert_eq!(GlassPattern::Lights(names()).pick(place, &mut random()), "blue");
    }

    #[test]
    fn mixed_kinds_come_by_their_weights() {
        let kind = |name: &str, weight| WeightedGlass { name: name.into(), weight };
        let mixed = GlassPattern::Mixed(MixedGlass { kinds: vec![kind("red", 3.0), kind("blue", 1.0)] });
        let mut random = random();
        let reds = (0..10_000)
            .filter(|_| mixed.pick(PatternPlace { light: 0, row: 0, checker: 0 }, &mut random) == "red")
            .count();
        assert!((7300..7700).contains(&reds), "{reds}");
    }

    #[test]
    fn wrong_patterns_are_refused_at_their_member() {
        let path = |pattern: GlassPattern| pattern.validate("glass").unwrap_err().path;
        assert_eq!(path(GlassPattern::Uniform(UniformGlass { name: String::new() })), "glass.uniform.name");
        assert_eq!(path(GlassPattern::Rows(GlassCycle { names: Vec::new() })), "glass.rows.names");
        let kinds = vec![WeightedGlass { name: "red".into(), weight: f64::NAN }];
        assert_eq!(path(GlassPattern::Mixed(MixedGlass { kinds })), "glass.mixed.kinds[0].weight");
    }
}
