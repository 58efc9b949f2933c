//! Parameters of Mitsuba that several things have.

use clerestory_render_core::settings::Triple;
use glam::DMat4;

use super::xml::Element;

pub(super) fn rgb(name: &str, colour: Triple) -> Element {
    Element::value("rgb", name, numbers(colour))
}

pub(super) fn float(name: &str, value: f64) -> Element {
    Element::value("float", name, value)
}

pub(super) fn point(name: &str, [x, y, z]: Triple) -> Element {
    let coordinates = [("x", x), ("y", y), ("z", z)];
    coordinates
        .into_iter()
        .fold(Element::new("point").with("name", name), |element, (axis, value)| element.with(axis, &value.to_string()))
}

/// A placement, by the rows of its matrix.
pub(super) fn matrix(to_world: DMat4) -> Element {
    let rows = to_world.transpose().to_cols_array().map(|value| value.to_string()).join(" ");
    Element::transform().containing(Element::new("matrix").with("value", &rows))
}

/// A placement that looks from a point to another.
pub(super) fn look_at(origin: Triple, target: Triple, up: Triple) -> Element {
    let attributes = [("origin", origin), ("target", target), ("up", up)];
    attributes.into_iter().fold(Element::new("lookat"), |look, (name, triple)| look.with(name, &numbers(triple)))
}

pub(super) fn numbers(triple: Triple) -> String {
    triple.map(|number| number.to_string()).join(", ")
}
