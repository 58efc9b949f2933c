//! Light path expressions: which paths are rendered.
//!
//! A path is a word over D (diffuse reflection), R (specular reflection), T (specular transmission) and L (light), from
//! the camera to the light. An expression is a regular expression over these letters with `.`, `*`, `+`, `?`, `|`,
//! `( )` and `[ ]`; spaces are ignored. `D TT L` is light that comes through one pane to a surface that the camera
//! sees.

use std::collections::{BTreeMap, BTreeSet};

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
    /// What may happen before the path meets the light.
    const BEFORE_LIGHT: [Self; 3] = [Self::Diffuse, Self::Reflection, Self::Transmission];

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

    /// Whether a path matches both expressions: one that ends at its only light.
    pub fn shares_a_path(&self, other: &Self) -> bool {
        let mut seen = BTreeSet::from([(self.start, other.start)]);
        let mut open = vec![(self.start, other.start)];
        while let Some((own, others)) = open.pop() {
            if self.accepts(FilterState(own), &[PathEvent::Light])
                && other.accepts(FilterState(others), &[PathEvent::Light])
            {
                return true;
            }
            for event in PathEvent::BEFORE_LIGHT {
                let next = [(self, own), (other, others)].map(|(filter, state)| filter.step(FilterState(state), event));
                let is_alive = !self.is_dead(next[0]) && !other.is_dead(next[1]);
                if is_alive && seen.insert((next[0].0, next[1].0)) {
                    open.push((next[0].0, next[1].0));
                }
            }
        }
        false
    }

    /// The most vertices before the light that a path which matches may have: `None` when there is no limit, 0 also
    /// when no path matches.
    pub fn most_vertices(&self) -> Option<usize> {
        // In the order of their last visit, states come before those that lead to them, unless they lie on a circle.
        let mut most: BTreeMap<StateID, Option<usize>> = BTreeMap::new();
        let mut ways = vec![(self.start, 0)];
        let mut open = BTreeSet::from([self.start]);
        let mut circles = Vec::new();
        while let Some(&mut (state, ref mut tried)) = ways.last_mut() {
            if let Some(event) = PathEvent::BEFORE_LIGHT.get(*tried) {
                *tried += 1;
                let next = self.step(FilterState(state), *event);
                if open.contains(&next.0) {
                    circles.push(next.0);
                } else if !self.is_dead(next) && !most.contains_key(&next.0) {
                    open.insert(next.0);
                    ways.push((next.0, 0));
                }
            } else {
                let behind = PathEvent::BEFORE_LIGHT
                    .iter()
                    .filter_map(|event| most.get(&self.step(FilterState(state), *event).0).copied().flatten());
                let here = self.accepts(FilterState(state), &[PathEvent::Light]).then_some(0);
                most.insert(state, behind.map(|vertices| vertices + 1).chain(here).max());
                open.remove(&state);
                ways.pop();
            }
        }
        let leads_to_light = |state: &StateID| most.get(state).is_some_and(Option::is_some);
        // From a circle that leads to a light, paths of any length do.
        if circles.iter().any(leads_to_light) {
            return None;
        }
        Some(most.get(&self.start).copied().flatten().unwrap_or(0))
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
    fn paths_of_a_bounded_expression_are_as_long_as_its_longest_word() {
        let most = |expression: &str| PathFilter::parse(expression).unwrap().most_vertices();
        assert_eq!(most("D TT L"), Some(3));
        assert_eq!(most("D? (TT|R)? D L"), Some(4));
        assert_eq!(most("L"), Some(0));
        assert_eq!(most("D* TT L"), None);
        assert_eq!(most("(TT)+ L"), None);
        assert_eq!(most(".*"), None);
        // No path: one ends at the first light.
        assert_eq!(most("D* T"), Some(0));
        assert_eq!(most("L D+ L"), Some(0));
    }

    #[test]
    fn expressions_share_a_path_or_none() {
        let share = |one: &str, other: &str| {
            let [one, other] = [one, other].map(|expression| PathFilter::parse(expression).unwrap());
            assert_eq!(one.shares_a_path(&other), other.shares_a_path(&one));
            one.shares_a_path(&other)
        };
        assert!(share("D TT L", ".*D[RT]+L"));
        assert!(share("D* L", "[DRT]*DL"));
        assert!(!share("D TT L", ".*D[RT]*R[RT]*L"));
        assert!(!share("D* L", ".*D[RT]+L"));
        assert!(!share("D+ T", "D+ T"), "without a light");
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
