//! The page of a report: one HTML file that needs nothing else.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use clerestory_film::{Exposure, PreviewSettings, ToneCurve, encode_png};
use serde_json::Value;

use crate::error::ExperimentError;
use crate::report::{Picture, Report};
use crate::table::{Table, rounded};
use crate::text::{counted, escaped};

const STYLE: &str = "\
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 1300px; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.6rem } h2 { font-size: 1.2rem; margin-top: 2rem }
.flow { display: flex; flex-wrap: wrap; gap: 1rem } figure { margin: 0 }
figcaption { font-size: .9rem; color: #555; max-width: 256px }
svg { max-width: 100%; height: auto } img { width: 256px; image-rendering: pixelated }
.wide { overflow-x: auto } table { border-collapse: collapse; font-size: .85rem }
th, td { padding: .15rem .6rem; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap }
th { text-align: left; font-weight: 600 } td.text { text-align: left }
dt { font-weight: 600 } dd { margin: 0 0 .3rem 1.5rem }";

/// What a report is about.
pub(crate) struct Heading {
    /// The experiment.
    pub(crate) name: &'static str,
    /// What it is, in a line.
    pub(crate) title: &'static str,
    /// What is measured.
    pub(crate) question: &'static str,
}

/// The page of a report. `everything` is its JSON.
pub(crate) fn html(experiment: &Heading, report: &Report, everything: &Value) -> Result<String, ExperimentError> {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n<h1>{title}</h1>\n<p>{question}</p>\n<p>{circumstances}</p>\n",
        title = escaped(experiment.title),
        question = escaped(experiment.question),
        circumstances = escaped(&circumstances(everything)),
    );
    if !report.statements.is_empty() {
        let items: String = report.statements.iter().map(|text| format!("<li>{}</li>\n", escaped(text))).collect();
        add(&mut page, &format!("<h2>What came out</h2>\n<ul>\n{items}</ul>\n"));
    }
    if !report.figures.is_empty() {
        add(&mut page, "<h2>Figures</h2>\n<div class=\"flow\">\n");
        for svg in &report.figures {
            add(&mut page, &format!("<figure>{svg}</figure>\n"));
        }
        add(&mut page, "</div>\n");
    }
    if !report.pictures.is_empty() {
        add(&mut page, "<h2>Pictures</h2>\n<div class=\"flow\">\n");
        for picture in &report.pictures {
            let source = data_url(picture)?;
            let title = escaped(&picture.title);
            let figure =
                format!("<figure><img alt=\"{title}\" src=\"{source}\"><figcaption>{title}</figcaption></figure>\n");
            add(&mut page, &figure);
        }
        add(&mut page, "</div>\n");
    }
    for table in report.tables.iter().filter(|table| table.is_on_page) {
        add_table(&mut page, table);
    }
    add_definitions(&mut page, report);
    add(&mut page, &format!("<p>All numbers: {}.json and the CSV files beside it.</p>\n</html>\n", experiment.name));
    Ok(page)
}

fn add(page: &mut String, text: &str) {
    page.push_str(text);
}

/// Settings and machine in a sentence.
fn circumstances(everything: &Value) -> String {
    let machine = &everything["machine"];
    let settings = &everything["settings"];
    let farm = match everything["farm"]["workers"].as_array() {
        Some(workers) => format!(", rendered by {} of a farm", counted(workers.len() as u64, "worker", "workers")),
        None => String::new(),
    };
    let mut text = format!(
        "Clerestory {} on {}, {} of {} cores{farm}, pictures of {} x {} pixels",
        plain(&machine["build"]),
        [&machine["system"], &machine["processor"]].map(plain).join(", "),
        settings["threads"],
        machine["cores"],
        settings["size"][0],
        settings["size"][1],
    );
    for reference in everything["references"].as_array().into_iter().flatten() {
        let noise = reference["noise"].as_f64().map_or_else(
            || "of unknown noise".to_owned(),
            |noise| {
                let mean = reference["mean"].as_f64().unwrap_or(f64::NAN);
                format!("with a noise of {:.2e} of its squared mean", noise / (mean * mean))
            },
        );
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            ". Reference of {}: {} samples a pixel by {}, {noise}",
            plain(&reference["scene"]),
            reference["samples_per_pixel"],
            plain(&reference["integrator"]),
        );
    }
    text + "."
}

fn plain(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

fn add_table(page: &mut String, table: &Table) {
    let caption = escaped(&table.caption);
    let names: String =
        table.columns().iter().map(|column| format!("<th>{}</th>", escaped(&column.name.replace('_', " ")))).collect();
    add(page, &format!("<h2>{caption}</h2>\n<div class=\"wide\"><table>\n<tr>{names}</tr>\n"));
    for row in table.rows() {
        let cell = |value: &Value| {
            let class = if value.is_string() { " class=\"text\"" } else { "" };
            format!("<td{class}>{}</td>", escaped(&rounded(value)))
        };
        let cells: String = row.iter().map(cell).collect();
        add(page, &format!("<tr>{cells}</tr>\n"));
    }
    add(page, "</table></div>\n");
}

/// What the columns mean, each once.
fn add_definitions(page: &mut String, report: &Report) {
    let mut known = Vec::new();
    let mut list = String::new();
    for column in report.tables.iter().filter(|table| table.is_on_page).flat_map(Table::columns) {
        if !known.contains(&column.meaning) {
            known.push(column.meaning);
            let (name, meaning) = (escaped(&column.name.replace('_', " ")), escaped(column.meaning));
            list.push_str(&format!("<dt>{name}</dt><dd>{meaning}</dd>\n"));
        }
    }
    for variant in &report.variants {
        let settings = serde_json::to_string(&variant.integrator).expect("settings have a form in JSON");
        list.push_str(&format!("<dt>{}</dt><dd>{}</dd>\n", escaped(&variant.name), escaped(&settings)));
    }
    add(page, &format!("<h2>Definitions</h2>\n<dl>\n{list}</dl>\n"));
}

/// A picture as part of the page.
fn data_url(picture: &Picture) -> Result<String, ExperimentError> {
    let settings = PreviewSettings { exposure: Exposure::Stops(picture.stops), curve: ToneCurve::Filmic };
    let png = encode_png(&picture.image, &settings).map_err(ExperimentError::Preview)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}
