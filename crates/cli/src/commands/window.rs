//! `clerestory scene window`: a leaded window as a scene and as a drawing.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use clerestory_glazing::{Arch, DrawingStyle, Head, Intersecting, Mullions, Opening, Tracery, Wall, WindowDesign, svg};
use clerestory_render_core::document::window_scene::{window_of, window_scene};
use clerestory_render_core::document::{Override, SceneDescription, apply};
use clerestory_render_core::scene::SceneError;
use clerestory_render_core::scene::window::{GlassDescription, OuterGlazing, WindowDescription, expand, plan};
use clerestory_render_core::settings::JsonPath;

use crate::failure::Failure;
use crate::leading_options::{FILLINGS, Quarry, SHEETS, check_quarry, colours, filling, kinds, mixed};
use crate::numbers::whole;
use crate::output::print_line;
use crate::output_file::{check_outputs, write};
use crate::scene_text::scene_text;

/// Options of `clerestory scene window`.
#[derive(Debug, Args)]
pub(super) struct WindowArguments {
    /// From jamb to jamb, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.7)]
    width: f64,
    /// From the sill to the highest point, metres.
    #[arg(long, value_name = "METRES", default_value_t = 1.9)]
    height: f64,
    /// What closes the opening above, in usual proportions.
    #[arg(long, value_name = "HEAD", default_value = "lancet", value_parser = PossibleValuesParser::new(Head::NAMES))]
    head: String,
    /// Lights side by side; more than one are divided by stone.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=12))]
    lights: u32,
    /// How the mullions of several lights end: straight up to the head, or in arcs that cross.
    #[arg(long, value_name = "TRACERY", default_value = "mullions", value_parser = ["mullions", "intersecting"])]
    tracery: String,
    /// How each light is divided into pieces.
    #[arg(
        long, value_name = "FILLING", default_value = "diamonds",
        value_parser = PossibleValuesParser::new(FILLINGS)
    )]
    filling: String,
    /// Width and height of a quarry, or the diameter of a roundel, metres.
    #[arg(long, value_name = "WxH")]
    quarry: Option<Quarry>,
    /// Historical colours, mixed at random; a wrong name shows the list.
    #[arg(long, value_name = "COLOUR,...", default_value = "greenish", value_parser = colour_list)]
    glass: ColourList,
    /// How the sheets were made that pieces are cut from [default: crown, and flat with `--filling plain`].
    #[arg(long, value_name = "SHEET", value_parser = PossibleValuesParser::new(SHEETS))]
    sheet: Option<String>,
    /// A flat protective pane outside.
    #[arg(long)]
    outer: bool,
    /// Seed of everything that differs from piece to piece.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole(0..=u64::MAX))]
    seed: u64,
    /// Another value for a member of the window, by its path: `design.lead.cames.flange_width=0.012`,
    /// `design.opening.arch.head={"ogee":{"rise":0.8}}`, `outer={"distance":0.1}`. Can be given several times.
    #[arg(long, value_name = "PATH=VALUE", value_parser = change)]
    set: Vec<Override>,
    /// The scene file to write [default: standard output, where there is no drawing].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// The drawing to write, an SVG file.
    #[arg(long, value_name = "FILE")]
    drawing: Option<PathBuf>,
}

/// Names of colours.
#[derive(Clone, Debug)]
struct ColourList(Vec<String>);

fn colour_list(text: &str) -> Result<ColourList, String> {
    colours(text).map(ColourList)
}

/// The place of the window in its scene, before which paths start.
const WINDOW: &str = "windows[window].";

fn change(text: &str) -> Result<Override, String> {
    format!("{WINDOW}{text}")
        .parse()
        .map_err(|error: clerestory_render_core::document::OverrideError| error.to_string())
}

impl WindowArguments {
    pub(super) fn run(&self) -> Result<(), Failure> {
        let outputs = [("--output", self.output.as_deref()), ("--drawing", self.drawing.as_deref())];
        check_outputs(&outputs, &[])?;
        if self.lights == 1 && self.tracery != "mullions" {
            let message = "--tracery: a single light has none; expected --lights 2 or more beside it";
            return Err(Failure::Usage(message.to_owned()));
        }
        check_quarry(&self.filling, self.quarry).map_err(|error| Failure::Usage(format!("--quarry: {error}")))?;
        let usual = window_scene(self.window()).map_err(unusable)?;
        let scene = apply(&self.set, &usual).map_err(|error| Failure::Usage(format!("--set {error}")))?;
        // The room follows the window as it has become.
        let Some(window) = scene.windows.into_iter().next() else { return Ok(()) };
        check_used(&window, &usual)?;
        let scene = window_scene(window).map_err(unusable)?;
        scene.validate().map_err(unusable)?;
        // Says what is wrong with the glass, which a drawing does not need.
        let root = JsonPath::Root;
        let windows = root.member("windows");
        for (index, window) in scene.windows.iter().enumerate() {
            expand(window, &windows.element(index)).map_err(unusable)?;
        }
        if let Some(file) = &self.drawing {
            write(file, drawing(&scene)?.as_bytes())?;
        }
        let text = scene_text(&scene);
        match &self.output {
            Some(file) => write(file, format!("{text}\n").as_bytes()),
            None if self.drawing.is_some() => Ok(()),
            None => print_line(&text),
        }
    }

    /// The window that the options describe.
    fn window(&self) -> WindowDescription {
        let head = Head::usual(&self.head, self.width).unwrap_or_default();
        let opening = Opening::Arch(Arch { width: self.width, height: self.height, head });
        let mut design = WindowDesign::new(opening);
        design.tracery = match (self.lights, self.tracery.as_str()) {
            (1, _) => Tracery::None,
            (2, "intersecting") => Tracery::Y,
            (lights, "intersecting") => Tracery::Intersecting(Intersecting { lights }),
            (lights, _) => Tracery::Mullions(Mullions { lights, head: None }),
        };
        design.filling = filling(&self.filling, self.quarry).unwrap_or_default();
        design.glass = mixed(&self.glass.0);
        design.seed = self.seed;
        design.wall = Some(Wall::default());
        let mut window = window_of(design, self.kinds());
        window.outer = self.outer.then(|| OuterGlazing { distance: 0.06, glass: GlassDescription::float() });
        window
    }

    /// The kinds of glass. Undivided lights are larger than sheets of old glass were.
    fn kinds(&self) -> BTreeMap<String, GlassDescription> {
        let usual = if self.filling == "plain" { "flat" } else { "crown" };
        kinds(&self.glass.0, self.sheet.as_deref().unwrap_or(usual))
    }
}

/// Refuses a new kind of glass that no piece is of: what was said of it would be for nothing.
fn check_used(window: &WindowDescription, usual: &SceneDescription) -> Result<(), Failure> {
    let used = window.design.glass_names();
    let is_new = |name: &str| usual.windows.iter().all(|window| !window.glass.contains_key(name));
    match window.glass.keys().find(|name| is_new(name) && !used.contains(&name.as_str())) {
        Some(name) => {
            let used = used.join(", ");
            Err(Failure::Usage(format!("--set glass: the design has no glass {name:?}, but {used}")))
        }
        None => Ok(()),
    }
}

fn unusable(error: SceneError) -> Failure {
    Failure::Usage(format!("this is no window: {error}"))
}

/// The elevation of a scene's window.
fn drawing(scene: &SceneDescription) -> Result<String, Failure> {
    let root = JsonPath::Root;
    let windows = root.member("windows");
    let Some(window) = scene.windows.first() else { return Ok(String::new()) };
    let path = windows.element(0);
    let plan = plan(window, &path).map_err(unusable)?;
    let colours = window.design.glass_names().into_iter().map(|name| (name.to_owned(), window.css_colour(name)));
    Ok(svg(&plan, &DrawingStyle { colours: colours.collect(), ..DrawingStyle::default() }))
}
