//! Places in a scene file, written as `panes[2].front.crown.wavelength`.

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
            JsonPath::Member(JsonPath::Root, name) => formatter.write_str(name),
            JsonPath::Member(parent, name) => write!(formatter, "{parent}.{name}"),
            JsonPath::Element(parent, index) => write!(formatter, "{parent}[{index}]"),
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
}
