//! The files of a report: JSON with everything, CSV, OpenEXR images, and a page to read.

use std::path::PathBuf;

use serde_json::{Map, Value, json};

use crate::error::ExperimentError;
use crate::farm;
use crate::machine::Machine;
use crate::page::{self, Heading};
use crate::report::Report;
use crate::session::Session;
use crate::table::Table;

/// Writes a report into the folder of the session. Returns the page and the JSON file.
pub(crate) fn write(
    report: &Report,
    heading: &Heading,
    session: &mut Session,
) -> Result<[PathBuf; 2], ExperimentError> {
    let folder = session.folder.clone();
    let host = &session.host;
    for table in &report.tables {
        host.write(&folder.join(format!("{}.csv", table.name)), &table.csv()?)?;
    }
    for picture in &report.pictures {
        if let Some(file) = &picture.file {
            let bytes = picture.image.encode().map_err(|error| ExperimentError::BadImage(error.into()))?;
            host.write(&folder.join(file), &bytes)?;
        }
    }
    for (name, content) in &report.files {
        host.write(&folder.join(name), content)?;
    }
    for (index, figure) in report.figures.iter().enumerate() {
        host.write(&folder.join(format!("figure-{}.svg", index + 1)), figure.as_bytes())?;
    }
    let mut everything = json(report, heading, session);
    if let Some(farm) = farm::record(session)? {
        everything["farm"] = farm;
    }
    let json = folder.join(format!("{}.json", heading.name));
    let text = serde_json::to_vec_pretty(&everything).expect("a value has a form in JSON");
    session.host.write(&json, &text)?;
    let page = folder.join("index.html");
    session.host.write(&page, page::html(heading, report, &everything)?.as_bytes())?;
    Ok([page, json])
}

fn json(report: &Report, heading: &Heading, session: &Session) -> Value {
    let definitions = |table: &Table| {
        let columns = table.columns().iter();
        let meanings: Map<_, _> = columns.map(|column| (column.name.to_owned(), json!(column.meaning))).collect();
        (table.name.to_owned(), Value::Object(meanings))
    };
    let images: Map<_, _> = report
        .pictures
        .iter()
        .filter_map(|picture| Some((picture.title.clone(), json!(picture.file.as_ref()?))))
        .collect();
    json!({
        "experiment": heading.name,
        "title": heading.title,
        "question": heading.question,
        "settings": session.settings,
        "machine": Machine::this(session.build),
        "scenes": report.scenes,
        "variants": report.variants,
        "references": report.references,
        "statements": report.statements,
        "images": images,
        "definitions": report.tables.iter().map(definitions).collect::<Map<_, _>>(),
        "tables": report.tables.iter().map(|table| (table.name.to_owned(), table.json())).collect::<Map<_, _>>(),
    })
}
