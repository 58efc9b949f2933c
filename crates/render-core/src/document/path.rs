//! Paths of places in a scene file: `integrator.sms.estimator.unbiased.max_trials`, `lights[sun].direction`,
//! `panes[*].thickness`.
//!
//! A member follows a dot. An element of a list stands in brackets, by its index from 0 or by its name, in which `*`
//! stands for any text. Brackets also name a member whose name has dots.

use std::fmt;

/// One step of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// A member of an object.
    Member(String),
    /// Elements of a list, or members of an object, by index or name.
    Element(String),
}

impl fmt::Display for Step {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Member(name) => write!(formatter, ".{name}"),
            Self::Element(name) => write!(formatter, "[{name}]"),
        }
    }
}

/// Most steps of a path; no scene goes so deep.
const MOST_STEPS: usize = 64;

/// The steps of a path; an error says what is wrong with it.
pub(super) fn parse(path: &str) -> Result<Vec<Step>, String> {
    let mut steps = Vec::new();
    let mut rest = path;
    let mut is_first = true;
    while !rest.is_empty() {
        if let Some(inside) = rest.strip_prefix('[') {
            let (name, behind) = inside.split_once(']').ok_or("a bracket that is closed")?;
            if name.is_empty() {
                return Err("an index or a name between the brackets".to_owned());
            }
            steps.push(Step::Element(name.to_owned()));
            rest = behind;
        } else {
            let member = if is_first { rest } else { rest.strip_prefix('.').ok_or("a dot before each member")? };
            let end = member.find(['.', '[']).unwrap_or(member.len());
            if end == 0 {
                return Err("a name before and behind each dot".to_owned());
            }
            steps.push(Step::Member(member[..end].to_owned()));
            rest = &member[end..];
        }
        is_first = false;
    }
    match steps.len() {
        0 => Err("the path of a member".to_owned()),
        1..=MOST_STEPS => Ok(steps),
        _ => Err(format!("a path of at most {MOST_STEPS} steps")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_members_and_elements() {
        let text = |path: &str| parse(path).map(|steps| steps.iter().map(ToString::to_string).collect::<String>());
        assert_eq!(text("film.width"), Ok(".film.width".to_owned()));
        assert_eq!(text("lights[sun].direction[2]"), Ok(".lights[sun].direction[2]".to_owned()));
        assert_eq!(text("materials[old.stone].diffuse"), Ok(".materials[old.stone].diffuse".to_owned()));
        // A closing bracket that nothing opens belongs to the name.
        assert_eq!(text("materials.a].diffuse"), Ok(".materials.a].diffuse".to_owned()));
        for wrong in ["", ".film", "film.", "film..width", "lights[", "lights[]", "lights[0]direction", "lights[0]]"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
