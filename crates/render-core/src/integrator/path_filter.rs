//! Light path expressions: which paths are rendered.
//!
//! A path is a word over D (diffuse reflection), R (specular reflection), T (specular transmission) and L (light), from
//! the camera to the light. An expression is a regular expression over these letters with `.`, `*`, `+`, `?`, `|`,
//! `( )` and `[ ]`; spaces are ignored. `D TT L` is light that comes through one pane to a surface that the camera sees.

use regex_automata::{
    Anchored,
    dfa::{Automaton, StartKind, dense},
    util::{primitives::StateID, start},
};
use thiserror::Error;

use crate::specular::SpecularEvent;

/// What light does at a vertex of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathEvent {
    /// Diffuse reflection.
    Diffuse,
    /// Specular reflection.
    Reflection,
    /// Specular transmission.
    Transmission,
    /// Emission.
    Light,
}

/// A compiled light path expression.
#[derive(Clone, Debug)]
pub struct PathFilter {
    automaton: dense::DFA<Vec<u32>>,
    start: StateID,
}

/// How much of a path an expression has read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilterState(StateID);

/// An expression that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PathFilterError {
    /// A letter or sign that means nothing.
    #[error("path filter {expression:?} contains {found:?}; it may contain D, R, T, L, . * + ? | ( ) [ ] and spaces")]
    UnknownSign {
        /// The expression.
        expression: String,
        /// The sign.
        found: char,
    },
    /// Not a regular expression, or too large a one.
    #[error("path filter {expression:?} cannot be read: {reason}")]
    Malformed {
        /// The expression.
        expression: String,
        /// What is wrong.
        reason: String,
    },
}

/// Bound on the compiled size, against hostile scenes, bytes.
const SIZE_LIMIT: usize = 1 << 20;

impl From<SpecularEvent> for PathEvent {
    fn from(event: SpecularEvent) -> Self {
        match event {
            SpecularEvent::Reflection => Self::Reflection,
            SpecularEvent::Transmission => Self::Transmission,
        }
    }
}

impl PathEvent {
    fn letter(self) -> u8 {
        match self {
            Self::Diffuse => b'D',
            Self::Reflection => b'R',
            Self::Transmission => b'T',
            Self::Light => b'L',
        }
    }
}

impl PathFilter {
    /// Compiles an expression.
    ///
    /// # Errors
    ///
    /// When it contains other signs, is no regular expression, or compiles to more than a mebibyte.
    pub fn parse(expression: &str) -> Result<Self, PathFilterError> {
        let letters: String = expression.chars().filter(|letter| !letter.is_whitespace()).collect();
        if let Some(found) = letters.chars().find(|&letter| !"DRTL.*+?|()[]".contains(letter)) {
            return Err(PathFilterError::UnknownSign { expression: expression.into(), found });
        }
        let malformed = |reason: String| PathFilterError::Malformed { expression: expression.into(), reason };
        let config = dense::Config::new()
            .start_kind(StartKind::Anchored)
            .dfa_size_limit(Some(SIZE_LIMIT))
            .determinize_size_limit(Some(SIZE_LIMIT));
        let automaton = dense::Builder::new()
            .configure(config)
            .build(&format!("^(?:{letters})$"))
            .map_err(|error| malformed(error.to_string()))?;
        let start = automaton
            .start_state(&start::Config::new().anchored(Anchored::Yes))
            .map_err(|error| malformed(error.to_string()))?;
        Ok(Self { automaton, start })
    }

    /// Nothing read yet.
    pub fn start(&self) -> FilterState {
        FilterState(self.start)
    }

    /// Reads one event.
    pub fn step(&self, state: FilterState, event: PathEvent) -> FilterState {
        FilterState(self.automaton.next_state(state.0, event.letter()))
    }

    /// Whether no continuation can match any more.
    pub fn is_dead(&self, state: FilterState) -> bool {
        self.automaton.is_dead_state(state.0)
    }

    /// Whether the path read so far, followed by `events`, matches.
    pub fn accepts(&self, state: FilterState, events: &[PathEvent]) -> bool {
        let end = events.iter().fold(state, |state, &event| self.step(state, event));
        self.automaton.is_match_state(self.automaton.next_eoi_state(end.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(expression: &str, path: &str, expected: bool) {
        let filter = PathFilter::parse(expression).unwrap();
        let events: Vec<PathEvent> = path
            .chars()
            .map(|letter| match letter {
                'D' => PathEvent::Diffuse,
                'R' => PathEvent::Reflection,
                'T' => PathEvent::Transmission,
                _ => PathEvent::Light,
            })
            .collect();
        assert_eq!(filter.accepts(filter.start(), &events), expected, "{expression} {path}");
    }

    #[test]
    fn expressions_match_whole_paths_only() {
        check("D TT L", "DTTL", true);
        check("D TT L", "DTL", false);
        check("D TT L", "DTTTTL", false);
        check("D TT L", "DDTTL", false);
        check("D* (TT)+ L", "DDTTTTL", true);
        check("[DT]*L", "TTDL", true);
        check("[DT]*L", "TRDL", false);
        check(".*L|D", "L", true);
    }

    #[test]
    fn a_path_that_cannot_match_any_more_is_dead() {
        let filter = PathFilter::parse("D TT L").unwrap();
        let diffuse = filter.step(filter.start(), PathEvent::Diffuse);
        assert!(!filter.is_dead(diffuse));
        assert!(filter.is_dead(filter.step(diffuse, PathEvent::Reflection)));
        assert!(filter.is_dead(filter.step(filter.start(), PathEvent::Transmission)));
    }

    #[test]
    fn bad_expressions_are_refused_with_a_reason() {
        assert!(matches!(PathFilter::parse("D X L"), Err(PathFilterError::UnknownSign { found: 'X', .. })));
        assert!(matches!(PathFilter::parse("D(T"), Err(PathFilterError::Malformed { .. })));
        assert!(matches!(PathFilter::parse("D{9}"), Err(PathFilterError::UnknownSign { found: '{', .. })));
        let nested = "(".repeat(5000) + "D" + &")*".repeat(5000);
        assert!(matches!(PathFilter::parse(&nested), Err(PathFilterError::Malformed { .. })));
    }
}
