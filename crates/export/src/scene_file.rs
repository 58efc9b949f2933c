//! `scene.json`: everything in plain members, for programs that know no Mitsuba.

use serde::Serialize;

use crate::contents::Contents;

/// What the file says of itself.
#[derive(Serialize)]
struct SceneFile<'a> {
    format: &'static str,
    version: u32,
    units: Units,
    #[serde(flatten)]
    contents: &'a Contents,
}

/// Units of all numbers.
#[derive(Serialize)]
struct Units {
    length: &'static str,
    angle: &'static str,
    radiance: &'static str,
    intensity: &'static str,
    absorption: &'static str,
    colour: &'static str,
    index_of_air: f64,
}

/// The text of the file.
pub(crate) fn text(contents: &Contents) -> String {
    let units = Units {
        length: "m",
        angle: "degree",
        radiance: "W/(m2 sr)",
        intensity: "W/sr",
        absorption: "1/m",
        colour: "linear Rec. 709",
        index_of_air: 1.0,
    };
    let file = SceneFile { format: "clerestory-export", version: 1, units, contents };
    let text = serde_json::to_string_pretty(&file).expect("numbers and texts have a form in JSON");
    text + "\n"
}
