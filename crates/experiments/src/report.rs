//! The report of an experiment: variants, references, statements, figures, tables and pictures.

use clerestory_film::{FrameImage, encode_png, preview};
use clerestory_render_core::document::SceneBundle;
use serde_json::{Value, json};

use crate::basin_figure::LOOK;
use crate::comparison::Comparison;
use crate::error::ExperimentError;
use crate::figure::Figure;
use crate::reference::{Reference, ReferenceRecord};
use crate::table::Table;
use crate::variant::{Variant, file_name};

/// The report of an experiment.
#[derive(Default)]
pub(crate) struct Report {
    pub(crate) variants: Vec<Variant>,
    pub(crate) references: Vec<ReferenceRecord>,
    pub(crate) scenes: Vec<Value>,
    /// Statements on the results, beside those of the paper.
    pub(crate) statements: Vec<String>,
    /// Figures, as SVG.
    pub(crate) figures: Vec<String>,
    pub(crate) tables: Vec<Table>,
    pub(crate) pictures: Vec<Picture>,
    /// Whether each claim of the experiment is met.
    pub(crate) claims: Vec<bool>,
    /// Further files: their names and contents.
    pub(crate) files: Vec<(String, Vec<u8>)>,
}

/// A picture in the report.
pub(crate) struct Picture {
    pub(crate) title: String,
    /// Its file, if it is written anew.
    pub(crate) file: Option<String>,
    pub(crate) image: FrameImage,
    /// Exposure, in stops.
    pub(crate) stops: f64,
}

impl Report {
    /// Adds a scene and what its variants are measured against, with its picture.
    pub(crate) fn add_scene(&mut self, name: &str, bundle: &SceneBundle, reference: &Reference) {
        self.note_scene(name, bundle);
        self.references.push(reference.record.clone());
        let stops = preview::automatic_stops(&reference.image);
        let title = format!("{name}: reference");
        self.pictures.push(Picture { title, file: None, image: reference.image.clone(), stops });
    }

    /// Adds a scene without a reference.
    pub(crate) fn note_scene(&mut self, name: &str, bundle: &SceneBundle) {
        let film = bundle.description().film;
        self.scenes.push(json!({
            "name": name,
            "description": bundle.description().name,
            "hash": bundle.scene_hash().to_string(),
            "integrator": bundle.description().integrator,
            "width": film.width,
            "height": film.height,
        }));
    }

    /// Adds the pictures of a comparison on a scene, as bright as its reference, and takes them from the comparison.
    pub(crate) fn add_pictures(&mut self, scene: &str, reference: &Reference, comparison: &mut Comparison) {
        let stops = preview::automatic_stops(&reference.image);
        for picture in comparison.pictures.extract_if(.., |picture| picture.scene == scene) {
            self.add_picture(format!("{scene}: {}", picture.variant.name), picture.image, stops);
        }
    }

    /// Adds a picture, which becomes a file of the same name.
    pub(crate) fn add_picture(&mut self, title: String, image: FrameImage, stops: f64) {
        let file = format!("{}.exr", file_name(&title));
        self.pictures.push(Picture { title, file: Some(file), image, stops });
    }

    /// Adds a figure, unless it has no points.
    pub(crate) fn add_figure(&mut self, figure: &Figure) -> Result<(), ExperimentError> {
        self.figures.extend(figure.svg()?);
        Ok(())
    }

    /// Adds an OpenEXR image and a PNG of what a figure shows, whose colours are meant as they are.
    pub(crate) fn add_files(&mut self, title: &str, image: &FrameImage) -> Result<(), ExperimentError> {
        let name = file_name(title);
        let exr = image.encode().map_err(|error| ExperimentError::BadImage(error.into()))?;
        self.files.push((format!("{name}.exr"), exr));
        self.files.push((format!("{name}.png"), encode_png(image, &LOOK).map_err(ExperimentError::Preview)?));
        Ok(())
    }
}
