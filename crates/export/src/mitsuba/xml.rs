//! Elements of XML as text.

use std::fmt::Display;

/// An element with attributes and other elements in it.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    contained: Vec<Element>,
}

impl Element {
    /// An element without anything in it.
    pub(crate) fn new(name: &'static str) -> Self {
        Self { name, attributes: Vec::new(), contained: Vec::new() }
    }

    /// An element of Mitsuba with a type.
    pub(crate) fn plugin(name: &'static str, kind: &str) -> Self {
        Self::new(name).with("type", kind)
    }

    /// A parameter of Mitsuba.
    pub(crate) fn value(kind: &'static str, name: &str, value: impl Display) -> Self {
        Self::new(kind).with("name", name).with("value", &value.to_string())
    }

    /// A placement in the world.
    pub(crate) fn transform() -> Self {
        Self::new("transform").with("name", "to_world")
    }

    /// The element with another attribute.
    pub(crate) fn with(mut self, name: &'static str, value: &str) -> Self {
        self.attributes.push((name, value.to_owned()));
        self
    }

    /// The element with another one in it.
    pub(crate) fn containing(mut self, element: Self) -> Self {
        self.contained.push(element);
        self
    }

    /// Puts another element in it.
    pub(crate) fn add(&mut self, element: Self) {
        self.contained.push(element);
    }

    /// The text of the element.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        self.append(&mut text, 0);
        text
    }

    fn append(&self, text: &mut String, depth: usize) {
        let indent = "    ".repeat(depth);
        text.push_str(&format!("{indent}<{}", self.name));
        for (name, value) in &self.attributes {
            text.push_str(&format!(" {name}=\"{}\"", escaped(value)));
        }
        if self.contained.is_empty() {
            text.push_str("/>\n");
            return;
        }
        text.push_str(">\n");
        self.contained.iter().for_each(|element| element.append(text, depth + 1));
        text.push_str(&format!("{indent}</{}>\n", self.name));
    }
}

fn escaped(value: &str) -> String {
    value.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_nested_and_values_escaped() {
        let element = Element::plugin("shape", "ply").containing(Element::value("string", "filename", "a<\"&\">.ply"));
        assert_eq!(
            element.text(),
            "<shape type=\"ply\">\n    <string name=\"filename\" value=\"a&lt;&quot;&amp;&quot;&gt;.ply\"/>\n</shape>\n"
        );
    }
}
