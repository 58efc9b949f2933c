//! What an experiment leaves behind: JSON with everything, CSV, OpenEXR images, and a page to read.

use std::path::PathBuf;

use clerestory_film::{FrameImage, encode_png, preview};
use clerestory_render_core::scene::SceneBundle;
use serde_json::{Map, Value, json};

use super::Experiment;
use super::basin_figure::LOOK;
use super::comparison::Comparison;
use super::figure::Figure;
use super::machine::Machine;
use super::page;
use super::reference::{Reference, ReferenceRecord};
use super::session::Session;
use super::table::Table;
use super::variant::{Variant, file_name};
use crate::failure::Failure;
use crate::output_file::write;

/// What came out of an experiment.
#[derive(Default)]
pub(crate) struct Report {
    pub(super) variants: Vec<Variant>,
    pub(super) references: Vec<ReferenceRecord>,
    scenes: Vec<Value>,
    /// What the figures say, in sentences, beside the paper.
    pub(super) statements: Vec<String>,
    /// Figures, as SVG.
    pub(super) figures: Vec<String>,
    pub(super) tables: Vec<Table>,
    pub(super) pictures: Vec<Picture>,
    /// Further files: their names and contents.
    files: Vec<(String, Vec<u8>)>,
}

/// A picture in the report.
pub(super) struct Picture {
    pub(super) title: String,
    /// Its file, if it is written anew.
    file: Option<String>,
    pub(super) image: FrameImage,
    /// Exposure, in stops.
    pub(super) stops: f64,
}

impl Report {
    /// Adds a scene and what its variants are measured against, with its picture.
    pub(super) fn add_scene(&mut self, name: &str, bundle: &SceneBundle, reference: &Reference) {
        self.note_scene(name, bundle);
        self.references.push(reference.record.clone());
        let stops = preview::automatic_stops(&reference.image);
        let title = format!("{name}: reference");
        self.pictures.push(Picture { title, file: None, image: reference.image.clone(), stops });
    }

    /// Adds a scene without a reference.
    pub(super) fn note_scene(&mut self, name: &str, bundle: &SceneBundle) {
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
    pub(super) fn add_pictures(&mut self, scene: &str, reference: &Reference, comparison: &mut Comparison) {
        let stops = preview::automatic_stops(&reference.image);
        for picture in comparison.pictures.extract_if(.., |picture| picture.scene == scene) {
            self.add_picture(format!("{scene}: {}", picture.variant.name), picture.image, stops);
        }
    }

    /// Adds a picture, which becomes a file of the same name.
    pub(super) fn add_picture(&mut self, title: String, image: FrameImage, stops: f64) {
        let file = format!("{}.exr", file_name(&title));
        self.pictures.push(Picture { title, file: Some(file), image, stops });
    }

    /// Adds a figure, unless it has no points.
    pub(super) fn add_figure(&mut self, figure: &Figure) -> Result<(), Failure> {
        self.figures.extend(figure.svg()?);
        Ok(())
    }

    /// Adds an OpenEXR image and a PNG of what a figure shows, whose colours are meant as they are.
    pub(super) fn add_files(&mut self, title: &str, image: &FrameImage) -> Result<(), Failure> {
        let name = file_name(title);
        let exr = image.encode().map_err(|error| Failure::BadImage(error.into()))?;
        self.files.push((format!("{name}.exr"), exr));
        self.files.push((format!("{name}.png"), encode_png(image, &LOOK).map_err(Failure::Preview)?));
        Ok(())
    }

    /// Writes everything into the folder of the session; returns the names of the page and the JSON file.
    pub(crate) fn write(&self, experiment: &Experiment, session: &Session) -> Result<[PathBuf; 2], Failure> {
        let folder = &session.folder;
        for table in &self.tables {
            write(&folder.join(format!("{}.csv", table.name)), &table.csv()?)?;
        }
        for picture in &self.pictures {
            if let Some(file) = &picture.file {
                let bytes = picture.image.encode().map_err(|error| Failure::BadImage(error.into()))?;
                write(&folder.join(file), &bytes)?;
            }
        }
        for (name, content) in &self.files {
            write(&folder.join(name), content)?;
        }
        for (index, figure) in self.figures.iter().enumerate() {
            write(&folder.join(format!("figure-{}.svg", index + 1)), figure.as_bytes())?;
        }
        let mut everything = self.json(experiment, session);
        if let Some(farm) = &session.farm {
            everything["farm"] = farm.record()?;
        }
        let json = folder.join(format!("{}.json", experiment.name));
        let text = serde_json::to_vec_pretty(&everything).expect("a value has a form in JSON");
        write(&json, &text)?;
        let page = folder.join("index.html");
        write(&page, page::html(experiment, self, &everything)?.as_bytes())?;
        Ok([page, json])
    }

    fn json(&self, experiment: &Experiment, session: &Session) -> Value {
        let definitions = |table: &Table| {
            let columns = table.columns().iter();
            let meanings: Map<_, _> = columns.map(|column| (column.name.to_owned(), json!(column.meaning))).collect();
            (table.name.to_owned(), Value::Object(meanings))
        };
        let images: Map<_, _> = self
            .pictures
            .iter()
            .filter_map(|picture| Some((picture.title.clone(), json!(picture.file.as_ref()?))))
            .collect();
        json!({
            "experiment": experiment.name,
            "title": experiment.title,
            "question": experiment.question,
            "settings": session.settings,
            "machine": Machine::this(),
            "scenes": self.scenes,
            "variants": self.variants,
            "references": self.references,
            "statements": self.statements,
            "images": images,
            "definitions": self.tables.iter().map(definitions).collect::<Map<_, _>>(),
            "tables": self.tables.iter().map(|table| (table.name.to_owned(), table.json())).collect::<Map<_, _>>(),
        })
    }
}
