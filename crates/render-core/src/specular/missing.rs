//! Classes of paths that a method leaves out, in words and as path expressions.

use std::collections::BTreeSet;

use super::selection::PaneSelection;
use super::side::GRAZING_COSINE;

/// Paths over any specular vertices to a surface.
pub(super) const ANY: &str = ".*D[RT]+L";

/// Paths by way of a reflection to a surface.
const OFF_ANY: &str = ".*D[RT]*R[RT]*L";

/// Those, and paths that are transmitted more than once.
const OVER_SEVERAL_OR_OFF_ANY: &str = ".*D([RT]*R[RT]*|TT+)L";

/// Paths over other specular vertices than those of one pane that is passed through.
const OTHER_THAN_TT: &str = ".*D([RT]|[RT]*R[RT]*|TTT+)L";

/// Paths in through one face of a pane and out through the other.
pub(super) const THROUGH_ONE_PANE: &str = ".*DTTL";

/// A class of paths.
#[derive(Clone, Debug, PartialEq)]
pub struct PathClass {
    /// In words.
    pub(crate) text: String,
    /// A path expression that all of them match.
    pub(crate) paths: String,
    /// At most about this part of all light comes by them where panes are flat.
    pub(crate) estimate: f64,
}

/// Light that comes late is announced if more than this part of all light may be among it.
pub(crate) const ANNOUNCED: f64 = 0.0005;

impl PathClass {
    pub(super) fn new(text: impl Into<String>, paths: impl Into<String>) -> Self {
        Self { text: text.into(), paths: paths.into(), estimate: 1.0 }
    }

    /// What light subpaths leave of paths over panes to a surface. They find a path by an edge between two surfaces, or
    /// between one and the camera, on which there is no glass.
    pub(crate) fn seen_over_glass(self) -> Self {
        let text = format!("{}, which the camera sees through or off glass", self.text);
        let paths = self.paths.replacen(".*D", "[RT]+(D[RT]+)*D", 1);
        Self { text, paths, ..self }
    }
}

/// Lights of which some do not reach some surfaces, or do so by chance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightGroup {
    /// What they are called.
    pub(crate) name: String,
    /// Whether a path may meet them by chance.
    pub(crate) can_be_met: bool,
}

impl LightGroup {
    /// All of their light that comes over specular vertices.
    pub(super) fn all(&self) -> String {
        format!("light of {} that comes through or off a pane or a specular mesh to a surface", self.name)
    }

    /// Their light that thin walls mirror, which no method searches. Behind glass that bends light, `contents` may have
    /// any, methods take thin walls for opaque.
    pub(crate) fn over_thin_walls(&self, contents: Contents) -> PathClass {
        if contents.panes + contents.meshes == 0 {
            return PathClass::new(format!("light of {} off a thin wall to a surface", self.name), OFF_ANY);
        }
        let text = format!(
            "light of {} off a thin wall, or through both a thin wall and other glass, to a surface",
            self.name
        );
        PathClass::new(text, OVER_SEVERAL_OR_OFF_ANY)
    }
}

/// What a scene has that decides which light is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contents {
    /// Panes.
    pub(crate) panes: usize,
    /// Specular meshes.
    pub(crate) meshes: usize,
    /// Whether one of its lights is a point.
    pub(crate) has_points: bool,
}

/// Paths over one of these chains of specular vertices.
pub(super) fn over(chains: &[String]) -> String {
    format!(".*D({})L", chains.join("|"))
}

/// Paths over any other chain than these.
pub(super) fn other_than(chains: &[String]) -> String {
    // At each place where a chain may differ: another letter, an end, or more letters.
    let others = chains.iter().flat_map(|chain| (0..=chain.len()).map(move |end| &chain[..end]));
    let starts: BTreeSet<&str> = others.chain([""]).collect();
    let differing = starts.iter().flat_map(|start| {
        let go_on = ["R", "T"].map(|letter| format!("{start}{letter}"));
        let fresh = go_on.into_iter().filter(|word| !starts.contains(word.as_str())).map(|word| format!("{word}[RT]*"));
        let ends_here = (!start.is_empty() && !chains.iter().any(|chain| chain == start)).then(|| (*start).to_owned());
        fresh.chain(ends_here)
    });
    format!(".*D({})L", differing.collect::<Vec<_>>().join("|"))
}

/// Light through panes that no method owns: at less than this angle [degrees], and too near to them.
pub(super) fn between_the_faces(of: &str, grazing: Option<f64>) -> PathClass {
    let grazing = grazing.map_or(String::new(), |degrees| format!(" at less than {degrees:.2} degrees to it, or"));
    let text = format!(
        "light of {of} through a pane{grazing} to a surface that lies between the pane's highest and lowest point"
    );
    // Between the faces of a flat pane is no place, and of even light so much comes at less than that angle.
    PathClass { estimate: GRAZING_COSINE * GRAZING_COSINE, ..PathClass::new(text, ".*D[RT]*T[RT]*L") }
}

/// What a selection of panes loses.
pub(super) fn unselected(of: &str, selection: PaneSelection) -> Option<PathClass> {
    let lost = match selection {
        PaneSelection::All | PaneSelection::Random => return None,
        PaneSelection::Sharp => "any pane but the one that the straight line to the light meets first",
        PaneSelection::Bleed => "a pane to a surface from which nothing blocks the straight line to the light",
    };
    Some(PathClass::new(format!("light of {of} through {lost}"), ".*D[RT]*T[RT]*L"))
}

/// What is lost where only some things are marked.
pub(super) fn unmarked(of: &str, casters: Option<&[String]>, receivers: Option<&[String]>) -> Vec<PathClass> {
    let other = |names: &[String], place| {
        let names = names.join(", ");
        PathClass::new(format!("light of {of} over specular vertices {place} other than {names}"), ANY)
    };
    let casters = casters.map(|names| other(names, "of which the first is on a pane or a mesh"));
    let receivers = receivers.map(|names| other(names, "to a mesh"));
    casters.into_iter().chain(receivers).collect()
}

/// What a search by chance loses. A path that a seed finds with probability p is weighted by the number of seeds until
/// the next success, cut off at N: on average by (1 - (1 - p)^N) / p instead of 1 / p.
pub(super) fn cut_off(max_trials: u32) -> String {
    format!("finds with a small probability p, by up to the part (1 - p)^{max_trials} of their light (max_trials)")
}

/// Light over other chains than these.
pub(super) fn over_other(of: &str, chains: &[String]) -> PathClass {
    let text = format!("light of {of} over other specular vertices than {} (chains)", chains.join(", "));
    PathClass::new(text, other_than(chains))
}

/// Light of an environment that is left to chance. `finds` says whether a method looks for what comes through one pane.
pub(crate) fn unowned_of_environment(lights: &LightGroup, contents: Contents, finds: bool) -> Vec<PathClass> {
    if finds {
        return unowned_by_panes(&lights.name, contents, PaneSelection::All, false);
    }
    vec![PathClass::new(lights.all(), ANY)]
}

/// Light over bodies that touch, overlap or hold one another, which no method searches. Chance never meets a point.
pub(crate) fn immersed_bodies(names: &str, has_points: bool) -> PathClass {
    let points = if has_points { ", and of point lights none of it is there" } else { "" };
    let text = format!("light through or off bodies that meet others or hold a light ({names}){points}");
    PathClass::new(text, ".*[RT].*L")
}

/// Light that a method leaves out which looks for light through one pane.
pub(super) fn unowned_by_panes(
    of: &str,
    contents: Contents,
    selection: PaneSelection,
    reflected: bool,
) -> Vec<PathClass> {
    let mut classes = Vec::new();
    if contents.panes > 0 {
        let outside = if reflected { "" } else { "on its outside or " };
        let text = format!(
            "light of {of} that a pane reflects, {outside}between its faces, or that passes through more than one \
             pane, on its way to a surface"
        );
        classes.push(PathClass::new(text, OTHER_THAN_TT));
        classes.push(between_the_faces(of, Some(libm::asin(GRAZING_COSINE).to_degrees())));
    }
    if contents.meshes > 0 {
        classes.push(PathClass::new(format!("light of {of} that comes by way of a specular mesh to a surface"), ANY));
    }
    if contents.panes > 0 {
        classes.extend(unselected(of, selection));
    }
    classes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::PathFilter;

    #[test]
    fn other_chains_are_all_but_those_that_are_named() {
        let chains = ["TT", "R", "TRT"].map(str::to_owned);
        let other = PathFilter::parse(&other_than(&chains)).unwrap();
        for (chain, expected) in [
            ("TT", false),
            ("R", false),
            ("TRT", false),
            ("T", true),
            ("RR", true),
            ("TR", true),
            ("TTT", true),
            ("TRTR", true),
        ] {
            assert_eq!(other.shares_a_path(&PathFilter::parse(&format!("D{chain}L")).unwrap()), expected, "{chain}");
        }
    }
}
