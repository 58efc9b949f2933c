//! The long bias test: every method on every reference, with full power, and against planted faults.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_tests::allocation::{MARGIN, passes};
use clerestory_tests::bias::{BLOCK, BLOCK_POWER, BiasReport, MEAN_POWER, REGION, compare};
use clerestory_tests::comparisons::{Comparison, REPLICATES, comparison};
use clerestory_tests::forward_tracer::Fault;
use clerestory_tests::reference::{Image, ReferenceError};
use clerestory_tests::sheet_connections::SheetConnections;
use clerestory_tests::single_connections::{Connections, RelativeLight, connections_name};
use indicatif::{ProgressBar, ProgressStyle};

/// Renders every reference scene with every suitable method, until a bias of the stated size would be noticed. Then
/// tests for bias, and whether planted faults are noticed.
#[derive(Parser)]
struct Arguments {
    /// Only comparisons whose name, such as `fnee crown-point`, contains this.
    #[arg(default_value = "")]
    filter: String,
    /// Most samples for each pixel in each of the 32 replicates.
    #[arg(long, default_value_t = 65536)]
    max_samples: u32,
    /// Standard error of the image mean that is aimed at, relative; a verdict asks for a mean within 2.5 of them. What
    /// has more than 0.001 has no power.
    #[arg(long, default_value_t = 0.0002)]
    mean_error: f64,
    /// Edge of the blocks that are compared one by one, pixels: 4, 8, 16 or 32. What needs 1 percent of each block
    /// needs a quarter of the samples with twice the edge.
    #[arg(long, default_value_t = BLOCK, value_parser = edge)]
    block: usize,
    /// Photons of references that are traced for the purpose.
    #[arg(long, default_value_t = 30_000_000)]
    photons: u64,
}

/// Methods without bias, and the lights that they find.
const UNBIASED: [(&str, &str); 18] = [
    ("fnee", "point"),
    ("fnee", "sphere"),
    ("cone", "sphere"),
    ("cone", "sun"),
    ("cone", "distant-500000"),
    ("fnee", "sun"),
    ("cone", "near"),
    ("path", "near"),
    ("fnee", "near"),
    ("fnee, sharp", "near"),
    ("fnee, bleed", "near"),
    ("sms", "point"),
    ("sms", "sphere"),
    ("sms", "sun"),
    ("sms", "near"),
    ("sms, half vector", "point"),
    ("sms, half vector", "near"),
    ("mnee", "near"),
];

/// Methods without bias, and the suns under which they find the light in the room. Light that is left to chance, with
/// `path` all of it, needs a large sun. The choice `bleed` is that of `random` there, bit for bit
/// (`tests/tests/statistics/bias.rs`), and that is held to single connections.
const UNBIASED_IN_THE_ROOM: [(&str, &str); 5] =
    [("fnee", "sun"), ("cone", "sun"), ("fnee, sharp", "sun-40"), ("mnee", "sun-40"), ("path", "sun-40")];

/// Methods whose weights by random estimates have tails beside those of folds, which are held to what is there
/// connection by connection: behind single panes.
const OF_SINGLE_CONNECTIONS: [&str; 4] = ["sms", "sms, half vector", "sms, published", "fnee, published"];

/// And in the room, where folds of points of the sun are everywhere in a picture.
const OF_SINGLE_CONNECTIONS_IN_THE_ROOM: [&str; 8] = [
    "fnee, sharp",
    "fnee, random",
    "fnee, 16 trials",
    "sms",
    "sms, half vector",
    "sms, 4 trials",
    "sms, sharp",
    "sms, random",
];

/// And below water, by the waves.
const OF_SINGLE_CONNECTIONS_UNDER_WAVES: [(&str, &str); 3] =
    [("gentle", "sms"), ("steep", "sms"), ("gentle", "sms, half vector")];

/// Methods that lack light where there are several paths.
const DARK: [(&str, &str); 5] = [
    ("fnee, 4 trials", "point"),
    ("sms, 1 walks", "point"),
    ("sms, 4 walks", "point"),
    ("mnee, dropped", "point"),
    ("sms, 4 walks", "sphere"),
];

/// Largest deviation of the mean, in standard errors that are aimed at.
const MEAN_LIMIT: f64 = 2.5;

/// A fault that every test with power notices, relative.
const FAULT: f64 = 0.005;

/// Most connections.
const MOST_CONNECTIONS: u32 = 1_000_000_000;

/// Connections from which the necessary number is estimated.
const PILOT_CONNECTIONS: u32 = 200_000;

/// Samples for each pixel in each replicate from which the necessary number is estimated.
const PILOT: u32 = 8;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let behind_panes = ["flat", "bump", "crown", "cathedral"].into_iter().flat_map(|case| {
        let unbiased = UNBIASED.into_iter().filter(move |(method, light)| is_picture(case, light, method));
        let unbiased = unbiased.map(move |(method, light)| (case, light, method, false));
        // One path leads through a flat pane, which every walk finds.
        let dark = if case == "flat" { &[] } else { DARK.as_slice() };
        unbiased.into_iter().chain(dark.iter().map(move |&(method, light)| (case, light, method, true)))
    });
    let in_the_room = UNBIASED_IN_THE_ROOM.map(|(method, light)| ("room", light, method, false));
    let chosen: Vec<(Comparison, bool)> = behind_panes
        .chain(in_the_room)
        .filter(|(case, light, method, _)| format!("{method} {case}-{light}").contains(&arguments.filter))
        .map(|(case, light, method, dark)| (comparison(case, light, method), dark))
        .collect();
    let behind_panes = ["flat", "bump", "crown", "cathedral"].into_iter().flat_map(|case| {
        ["point", "sphere", "sun"]
            .into_iter()
            .flat_map(move |light| OF_SINGLE_CONNECTIONS.map(|method| (case, light, method)))
            // These find some paths there so seldom that no mean settles: they are held to what their trials find.
            .map(|(case, light, method)| match (case, method) {
                ("cathedral", "fnee, published") => (case, light, "fnee, 16 trials"),
                ("cathedral", "sms, published") => (case, light, "sms, 4 trials"),
                _ => (case, light, method),
            })
    });
    let in_the_room = OF_SINGLE_CONNECTIONS_IN_THE_ROOM.map(|method| ("room", "sun", method));
    // One path at the pane's border, which few walks find, outweighs all others in a picture.
    let at_the_border = [("flat", "near", "sms")];
    let connections: Vec<Connections> = behind_panes
        .chain(at_the_border)
        .chain(in_the_room)
        .filter(|(case, light, method)| connections_name(case, light, method).contains(&arguments.filter))
        .map(|(case, light, method)| Connections::new(case, light, method))
        .collect();
    let under_waves: Vec<SheetConnections> = OF_SINGLE_CONNECTIONS_UNDER_WAVES
        .into_iter()
        .filter(|(waves, method)| SheetConnections::name(waves, method).contains(&arguments.filter))
        .map(|(waves, method)| SheetConnections::new(waves, method))
        .collect();
    let style = ProgressStyle::with_template("{spinner} {pos}/{len} {msg} {elapsed} (about {eta} left)")
        .expect("the template is valid");
    let count = chosen.len() + connections.len() + under_waves.len();
    let progress = ProgressBar::new(count as u64).with_style(style);
    progress.enable_steady_tick(Duration::from_millis(200));
    let mut failures = 0;
    for (comparison, dark) in &chosen {
        progress.set_message(comparison.name.clone());
        let verdict = if *dark {
            examine_dark(comparison, &arguments, &progress)
        } else {
            examine(comparison, &arguments, &progress)
        };
        match verdict {
            Ok(true) => {}
            Ok(false) => failures += 1,
            Err(error) => {
                progress.suspend(|| eprintln!("error: {}: {error}", comparison.name));
                failures += 1;
            }
        }
        progress.inc(1);
    }
    let behind_panes = connections.iter().map(|connections| {
        let light: RelativeLightOf<'_> = Box::new(|count, seed| connections.relative_light(count, seed));
        (&connections.name, light, connections.must_reach_all())
    });
    let below_waves = under_waves.iter().map(|connections| {
        let light: RelativeLightOf<'_> = Box::new(|count, seed| connections.relative_light(count, seed));
        (&connections.name, light, false)
    });
    for (name, light, must_reach_all) in behind_panes.chain(below_waves) {
        progress.set_message(name.clone());
        failures += usize::from(!examine_connections(name, &light, must_reach_all, &arguments, &progress));
        progress.inc(1);
    }
    progress.finish_and_clear();
    println!("{} comparisons, {failures} without the right verdict", count);
    if failures == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The light of about this many single connections, drawn with a seed.
type RelativeLightOf<'a> = Box<dyn Fn(u32, u64) -> RelativeLight + 'a>;

/// Whether a method finds the light of single connections, with power, and next to none along other paths. Where it
/// must, many trials have to reach all of it.
fn examine_connections(
    name: &str,
    relative_light: &RelativeLightOf<'_>,
    must_reach_all: bool,
    arguments: &Arguments,
    progress: &ProgressBar,
) -> bool {
    let start = Instant::now();
    let (_, error) = relative_light(PILOT_CONNECTIONS, 1).ratio();
    let seconds = start.elapsed().as_secs_f64();
    let necessary = f64::from(PILOT_CONNECTIONS) * MARGIN * (error / arguments.mean_error).powi(2);
    let count = necessary.clamp(f64::from(PILOT_CONNECTIONS), f64::from(MOST_CONNECTIONS)) as u32;
    progress.suspend(|| {
        println!(
            "{name}: known to {:.3} % after {PILOT_CONNECTIONS} connections; {count} take about {:.0} s",
            error * 100.0,
            seconds * f64::from(count) / f64::from(PILOT_CONNECTIONS),
        );
    });
    let start = Instant::now();
    // Other connections than in the pilot and in a run of another length: what chose their number must not be part of
    // the result.
    let light = relative_light(count, u64::from(count));
    let (ratio, error) = light.ratio();
    let near = (ratio - 1.0).abs() <= MEAN_LIMIT * arguments.mean_error;
    let good = light.agrees()
        && near
        && error <= MEAN_POWER
        && (light.most_unreached() <= MEAN_POWER || !must_reach_all)
        && light.elsewhere <= FAULT
        && light.would_notice(FAULT);
    let seconds = start.elapsed().as_secs_f64();
    progress.suspend(|| {
        println!(
            "{} {name}: {light}; {count} connections (and seed), {seconds:.0} s",
            if good { "ok  " } else { "FAIL" },
        );
    });
    good
}

/// Whether a method that draws one point of a light is held to a picture, and not only to single connections.
fn is_picture(case: &str, light: &str, method: &str) -> bool {
    let weighs = ["crown", "cathedral"].contains(&case) && ["point", "sphere"].contains(&light)
        || light == "sun" && case != "flat"
        || light == "near" && case == "flat" && method == "sms";
    !(method.starts_with("sms") && weighs)
}

fn edge(words: &str) -> Result<usize, String> {
    match words.parse() {
        Ok(edge) if edge % BLOCK == 0 && REGION.is_multiple_of(edge) && edge > 0 => Ok(edge),
        _ => Err("a block has an edge of 4, 8, 16 or 32 pixels".to_owned()),
    }
}

/// Whether one method lacks light, as it must.
fn examine_dark(
    comparison: &Comparison,
    arguments: &Arguments,
    progress: &ProgressBar,
) -> Result<bool, ReferenceError> {
    let reference = comparison.reference(arguments.photons, Fault::None)?;
    let (replicates, _) = comparison.replicates(PILOT, 1);
    let report = compare(&replicates, &reference, &comparison.folds(), arguments.block);
    let good = !report.agrees() && report.mean_ratio.iter().all(|ratio| *ratio < 1.0);
    progress.suspend(|| {
        println!("{} {}, which lacks light: {report}", if good { "ok  " } else { "FAIL" }, comparison.name)
    });
    Ok(good)
}

/// Whether one method agrees with its reference, with power, and differs from faulty references.
fn examine(comparison: &Comparison, arguments: &Arguments, progress: &ProgressBar) -> Result<bool, ReferenceError> {
    let reference = comparison.reference(arguments.photons, Fault::None)?;
    let folds = comparison.folds();
    let start = Instant::now();
    let (pilot, _) = comparison.replicates(PILOT, 1);
    let seconds = start.elapsed().as_secs_f64();
    let report = compare(&pilot, &reference, &folds, arguments.block);
    let passes = necessary_passes(&pilot, &report, arguments);
    let mean = passes.iter().map(|passes| f64::from(*passes)).sum::<f64>() / passes.len() as f64;
    let samples = format!(
        "{} to {} samples a pixel, {:.0} on average",
        PILOT * passes.iter().min().copied().unwrap_or(0),
        PILOT * passes.iter().max().copied().unwrap_or(0),
        f64::from(PILOT) * mean,
    );
    progress.suspend(|| {
        println!(
            "{}: mean known to {:.3} %, blocks to {:.2} % with {PILOT} samples a pixel; {samples}, take about {:.0} s",
            comparison.name,
            report.mean_error * 100.0,
            report.block_error * 100.0,
            seconds * mean,
        );
    });
    let start = Instant::now();
    // Other seeds: what chose the number of samples must not be part of the result.
    let (replicates, counters) = comparison.replicates_with(PILOT, 1 + REPLICATES, &|tile| passes[tile]);
    let seconds = start.elapsed().as_secs_f64();
    let report = compare(&replicates, &reference, &folds, arguments.block);
    let good = report.agrees() && report.has_power() && report.mean_deviation() <= MEAN_LIMIT * arguments.mean_error;
    progress.suspend(|| {
        println!("{} {}: {report}", if good { "ok  " } else { "FAIL" }, comparison.name);
        println!(
            "     {REPLICATES} pictures, {samples}, {seconds:.0} s, {} of {} probabilities cut off",
            counters.truncated, counters.unique_solutions
        );
    });
    let mut all_noticed = true;
    for fault in comparison.faults() {
        // Half a percent is noticed only against a reference as good as the right one.
        let photons = if fault == Fault::Scaled { arguments.photons } else { arguments.photons / 10 };
        let report = compare(&replicates, &comparison.reference(photons, fault)?, &folds, arguments.block);
        let noticed = !report.agrees();
        all_noticed &= noticed;
        progress.suspend(|| println!("{}   against {fault:?}: {report}", if noticed { "ok  " } else { "FAIL" }));
    }
    Ok(good && all_noticed)
}

/// The passes of [`PILOT`] samples for each tile.
fn necessary_passes(pilot: &[Image], report: &BiasReport, arguments: &Arguments) -> Vec<u32> {
    let most = (arguments.max_samples / PILOT).max(1);
    let of_blocks = (MARGIN * (report.block_error / BLOCK_POWER).powi(2)).ceil().clamp(1.0, f64::from(most)) as u32;
    passes(pilot, arguments.mean_error, of_blocks, most)
}
