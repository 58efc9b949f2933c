//! Places in a scene file, written as `panes[2].front.crown.wavelength`: `--set` reads paths of this form.

use std::fmt;

/// A place in a scene file. It borrows its parents, so that it costs nothing until an error needs its text.
#[derive(Clone, Copy, Debug)]
pub enum JsonPath<'a> {
    /// The scene itself.
    Root,
    /// A member of an object.
    Member(&'a JsonPath<'a>, &'a str),
    /// An element of an array.
    Element(&'a JsonPath<'a>, usize),
}

impl<'a> JsonPath<'a> {
    /// The member `name` of this object.
    pub fn member(&'a self, name: &'a str) -> JsonPath<'a> {
        JsonPath::Member(self, name)
    }

    /// Element `index` of this array.
    pub fn element(&'a self, index: usize) -> JsonPath<'a> {
        JsonPath::Element(self, index)
    }
}

impl fmt::Display for JsonPath<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            JsonPath::Root => formatter.write_str(ROOT),
            JsonPath::Member(JsonPath::Root, name) => write!(formatter, "{}", MemberStep { name, is_first: true }),
            JsonPath::Member(parent, name) => write!(formatter, "{parent}{}", MemberStep { name, is_first: false }),
            JsonPath::Element(parent, index) => write!(formatter, "{parent}[{index}]"),
        }
    }
}

/// A member as a step of a path: its name behind a dot, or in brackets where the name is not plain.
pub(crate) struct MemberStep<'a> {
    /// The member's name.
    pub(crate) name: &'a str,
    /// Whether the path begins with it, so that it needs no dot.
    pub(crate) is_first: bool,
}

impl fmt::Display for MemberStep<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.name;
        let is_plain = |sign: char| sign.is_alphanumeric() || matches!(sign, '_' | '-');
        // Brackets end at the first closing bracket, so that they cannot hold a name with one.
        let has_dot = (!name.is_empty() && name.chars().all(is_plain)) || name.contains(']');
        match (has_dot, self.is_first) {
            (false, _) => write!(formatter, "[{name}]"),
            (true, true) => formatter.write_str(name),
            (true, false) => write!(formatter, ".{name}"),
        }
    }
}

/// How the scene itself is written.
pub(crate) const ROOT: &str = "$";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_written_as_in_javascript() {
        let root = JsonPath::Root;
        let panes = root.member("panes");
        let pane = panes.element(2);
        assert_eq!(pane.member("front").to_string(), "panes[2].front");
        assert_eq!(root.to_string(), "$");
    }

    #[test]
    fn names_that_are_not_plain_stand_in_brackets() {
        let root = JsonPath::Root;
        let materials = root.member("materials");
        for (name, expected) in [
            ("stone", "materials.stone"),
            ("old_stone-2", "materials.old_stone-2"),
            ("old.stone", "materials[old.stone]"),
            ("old stone", "materials[old stone]"),
            ("a[0", "materials[a[0]"),
            ("", "materials[]"),
            ("a]", "materials.a]"),
        ] {
            assert_eq!(materials.member(name).to_string(), expected);
        }
        assert_eq!(root.member("old.stone").to_string(), "[old.stone]");
        assert_eq!(root.member("old.stone").member("diffuse").to_string(), "[old.stone].diffuse");
    }
}
