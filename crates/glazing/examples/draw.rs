//! Draws the design in a JSON file: `cargo run -p clerestory-glazing --example draw -- window.json > window.svg`.

use std::collections::BTreeMap;
use std::error::Error;

use clerestory_glazing::{DrawingStyle, WindowDesign, svg};

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("the first argument must be the JSON file of a design")?;
    let design: WindowDesign = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    // Names of glass that are colours of CSS are drawn in them.
    let colours: BTreeMap<String, String> = (design.glass_names().into_iter())
        .filter(|name| *name != "clear")
        .map(|name| (name.to_owned(), name.to_owned()))
        .collect();
    let plan = design.plan()?;
    println!("{}", svg(&plan, &DrawingStyle { colours, ..DrawingStyle::default() }));
    let triangles: usize = plan.meshes().iter().map(|mesh| mesh.triangles.len()).sum();
    eprintln!(
        "{} lights, {} pieces, {} cames, {triangles} triangles",
        plan.lights.len(),
        plan.pieces.len(),
        plan.cames.len()
    );
    Ok(())
}
