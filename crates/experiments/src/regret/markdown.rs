//! The page of results, docs/results/regret.md: a table for each claim.

use std::fmt::Write;
use std::time::SystemTime;

use serde_json::Value;

use super::ratios::{Figure, Ratio};
use crate::machine::Machine;
use crate::session::Session;
use crate::table::{Table, rounded};

const INTRODUCTION: &str = "\
# `auto` against single methods

`tests/run regret` measures again and writes this page. It fails when a claim is missed or not known.

Each pair of a scene and its light is rendered by `auto` and by single methods. A render runs on one core, and its clock
counts the time of its thread alone. Figures are MSE and relMSE, less the noise of the reference, times core seconds
([film.md](../film.md) has the formulas). Ratios have intervals of 95 percent: the jackknife over the seeds, and
Student's t. The best single method is the one whose mean is least. `light` is light tracing.

A claim is met when the lower end of the interval is at most the limit. \"Below the reference\" means that the squared
error of the reference is more than a tenth of the least error that is compared with it.
";

const OF_MEAN: &str = "Its limit is 1.05, over all pairs of both tables.";

/// The page.
pub(super) fn markdown(session: &Session, ratios: &[Ratio], tables: &[Table]) -> String {
    let mut page = format!("{INTRODUCTION}\n{}\n", circumstances(session));
    let of = |figure: Figure| ratios.iter().filter(move |ratio| ratio.figure == figure).collect::<Vec<_>>();
    let best = ["MSE: best", "auto over it", "", "relMSE: best", "auto over it", ""];
    section(&mut page, "Required scenes", "The limit is 1.1 on each.", &of(Figure::Required), &best);
    section(&mut page, "Regret", "The limit is 1.25 on each further pair.", &of(Figure::Regret), &best);
    section(&mut page, "Geometric mean", OF_MEAN, &of(Figure::MeanRegret), &best);
    let text = "relMSE times core seconds of `auto` with panes over that of `auto` with the panes taken out.";
    add(
        &mut page,
        &format!("\n## Glass tax\n\n{text}\n\n| scene | glass | tax | limit | |\n| --- | --- | ---: | ---: | --- |\n"),
    );
    for ratio in of(Figure::GlassTax) {
        let limit = ratio.limit.unwrap_or_default();
        let cells = [&ratio.pair, &ratio.glass, &ratio.cell(), &limit.to_string(), ratio.verdict()];
        row(&mut page, cells);
    }
    let text = "`auto` over `light`. The goal is a third in the room and the chapel.";
    add(&mut page, &format!("\n## Light tracing\n\n{text}\n\n| pair | MSE | relMSE |\n| --- | ---: | ---: |\n"));
    for pair in of(Figure::OverLight).chunks(2) {
        let [mse, rel_mse] = pair else { continue };
        row(&mut page, [&mse.pair, &mse.cell(), &rel_mse.cell()]);
    }
    for (name, title) in [("methods", "All methods"), ("references", "References")] {
        if let Some(table) = tables.iter().find(|table| table.name == name) {
            plain(&mut page, title, table);
        }
    }
    page
}

/// A table of `auto` over the best single method: a row for each pair.
fn section(page: &mut String, title: &str, text: &str, ratios: &[&Ratio], best: &[&str]) {
    let names = ["pair", "light", "glass"].into_iter().chain(best.iter().copied()).collect::<Vec<_>>().join(" | ");
    let lines = " --- |".repeat(3 + best.len());
    add(page, &format!("\n## {title}\n\n{text}\n\n| {names} |\n|{lines}\n"));
    for pair in ratios.chunks(2) {
        let [mse, rel_mse] = pair else { continue };
        let of = |ratio: &Ratio| [ratio.against.clone(), ratio.cell(), ratio.verdict().to_owned()];
        let cells = [mse.pair.clone(), mse.light.clone(), mse.glass.clone()].into_iter().chain(of(mse));
        row(page, cells.chain(of(rel_mse)));
    }
}

/// A table of the report as it is.
fn plain(page: &mut String, title: &str, table: &Table) {
    let names: Vec<String> = table.columns().iter().map(|column| column.name.replace('_', " ")).collect();
    let lines = " --- |".repeat(names.len());
    add(page, &format!("\n## {title}\n\n| {} |\n|{lines}\n", names.join(" | ")));
    for cells in table.rows() {
        row(page, cells.iter().map(rounded));
    }
}

fn row(page: &mut String, cells: impl IntoIterator<Item = impl AsRef<str>>) {
    let cells: Vec<String> = cells.into_iter().map(|cell| cell.as_ref().replace('|', "\\|")).collect();
    add(page, &format!("| {} |\n", cells.join(" | ")));
}

fn add(page: &mut String, text: &str) {
    page.push_str(text);
}

/// The machine, the build, the settings and the date.
fn circumstances(session: &Session) -> String {
    let machine = serde_json::to_value(Machine::this(session.build)).unwrap_or_default();
    let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
    // Such as `Sat, 28 Nov 2026 04:38:58 GMT`.
    let now = httpdate::fmt_http_date(SystemTime::now());
    let settings = &session.settings;
    let mut line = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        line,
        "Clerestory {} on {}, {} renders at once, {}.\nPictures of at most {} x {} pixels, {} core seconds, {} seeds.",
        text(&machine["build"]),
        text(&machine["processor"]),
        settings.threads,
        now.get(5..16).unwrap_or(&now),
        settings.size[0],
        settings.size[1],
        settings.times.last().copied().unwrap_or(0.0),
        settings.seeds,
    );
    line
}
