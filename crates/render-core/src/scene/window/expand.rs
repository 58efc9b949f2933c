//! From a window of a scene file to panes, sheets, meshes and materials.

use std::collections::BTreeMap;

use clerestory_glazing::{MeshPart, Piece, PlanMesh, WindowPlan};
use glam::{DMat2, DQuat, DVec2, DVec3};

use super::colour::COLOURS;
use super::description::{OuterGlazing, WindowDescription, of_design};
use super::glass::{Cutting, GlassDescription};
use super::painter::{OUTER, Painter};
use crate::bsdf::{DiffuseMaterial, MaterialDescription};
use crate::geometry::FaceCrossing;
use crate::math::hash::mix;
use crate::scene::description::{
    LayersDescription, MeshDescription, MeshSource, PaneDescription, SheetCut, SheetDescription,
};
use crate::scene::mesh::is_degenerate;
use crate::settings::check::Quoted;
use crate::settings::limits::PANE_EDGES;
use crate::settings::{JsonPath, SceneError, Triple};
use crate::texture::ColourDescription;

/// What a window is made of, as things of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowExpansion {
    /// Materials of lead, iron and stone, by name. The scene's own of these names take their place.
    pub materials: BTreeMap<String, MaterialDescription>,
    /// Lead, solder, iron and stone.
    pub meshes: Vec<MeshDescription>,
    /// The sheets from which the panes are cut, by name.
    pub sheets: BTreeMap<String, SheetDescription>,
    /// The pieces of glass.
    pub panes: Vec<PaneDescription>,
}

/// The materials of what holds the glass, by their names, with their colours.
const MATERIALS: [(MeshPart, &str, Triple); 5] = [
    (MeshPart::Lead, "lead came", [0.16, 0.16, 0.17]),
    (MeshPart::Solder, "solder", [0.3, 0.3, 0.31]),
    (MeshPart::Iron, "wrought iron", [0.06, 0.055, 0.05]),
    (MeshPart::Stone, "tracery stone", [0.55, 0.5, 0.42]),
    (MeshPart::Wall, "limewashed wall", [0.72, 0.68, 0.6]),
];

/// Plans a window in its plane.
///
/// # Errors
///
/// The member of the design that makes no window, below `path`.
pub fn plan(window: &WindowDescription, path: &JsonPath<'_>) -> Result<WindowPlan, SceneError> {
    window.design.plan().map_err(|error| of_design(error, path))
}

/// What a window is made of.
///
/// # Errors
///
/// As [`plan`]; or a kind of glass that is not known, or a piece that is larger than its sheet.
pub fn expand(window: &WindowDescription, path: &JsonPath<'_>) -> Result<WindowExpansion, SceneError> {
    let plan = plan(window, path)?;
    let mut expansion = WindowExpansion::default();
    let glazier = Glazier { window, path };
    let mut painter = Painter::new(window, &plan);
    for piece in &plan.pieces {
        glazier.add_piece(piece, &plan, &mut painter, &mut expansion)?;
    }
    if let Some(outer) = &window.outer {
        glazier.add_outer(outer, &plan, &mut painter, &mut expansion)?;
    }
    for (mesh, material) in painter.finish() {
        expansion.materials.insert(mesh.material.clone(), material);
        expansion.meshes.push(mesh);
    }
    for mesh in plan.meshes() {
        glazier.add_mesh(mesh, &mut expansion);
    }
    Ok(expansion)
}

/// Cuts pieces from sheets and hangs them.
struct Glazier<'a> {
    window: &'a WindowDescription,
    path: &'a JsonPath<'a>,
}

impl Glazier<'_> {
    fn add_piece(
        &self,
        piece: &Piece,
        plan: &WindowPlan,
        painter: &mut Painter<'_>,
        expansion: &mut WindowExpansion,
    ) -> Result<(), SceneError> {
        let Some(outline) = LocalOutline::of(&piece.outline) else { return Ok(()) };
        let kind = self.kind(&piece.glass)?;
        let cut = self.cut(&piece.glass, &kind, &outline, piece, plan, expansion)?;
        let [x, y, z] = self.window.axes();
        let [about_x, about_y] = piece.tilt.map(f64::to_radians);
        let turn = rotation_about(x, about_x) * rotation_about(y, about_y);
        let thickness = kind.thickness() * piece.thickness_factor;
        let middle = DVec3::from(self.window.sill) + x * outline.middle.x + y * outline.middle.y;
        let pane = PaneDescription {
            name: format!("{} {}", self.window.name, piece.place),
            centre: (middle - turn * z * (0.5 * thickness)).to_array(),
            x_axis: (turn * x).to_array(),
            y_axis: (turn * y).to_array(),
            ..self.pane(&kind, &outline, thickness, &self.path.member("glass").member(&piece.glass))?
        };
        if let Some(sheet) = expansion.sheets.get(&cut.name) {
            painter.add_piece(&piece.glass, &kind, (&pane, sheet), outline.middle);
        }
        expansion.panes.push(PaneDescription { sheet: Some(cut), ..pane });
        Ok(())
    }

    /// A pane of a kind of glass, at the origin.
    fn pane(
        &self,
        kind: &GlassDescription,
        outline: &LocalOutline,
        thickness: f64,
        path: &JsonPath<'_>,
    ) -> Result<PaneDescription, SceneError> {
        let Some(tint) = kind.colour.tint() else {
            let found = format!("{:?}", kind.colour);
            return Err(SceneError::value(&path.member("colour"), found, "a colour"));
        };
        // Seen from inside, both are on the outer face.
        let front = DVec3::from(tint.flash) + DVec3::from(tint.stain);
        let size = 2.0 * outline.corners.iter().fold(DVec2::ZERO, |reach, corner| reach.max(corner.abs()));
        Ok(PaneDescription {
            name: String::new(),
            centre: [0.0; 3],
            x_axis: [1.0, 0.0, 0.0],
            y_axis: [0.0, 1.0, 0.0],
            width: size.x.max(PANE_EDGES[0]),
            height: size.y.max(PANE_EDGES[0]),
            outline: outline.corners.iter().map(|corner| corner.to_array()).collect(),
            sheet: None,
            thickness,
            index_of_refraction: kind.index_of_refraction,
            absorption: tint.body,
            layers: LayersDescription { front: front.to_array(), back: [0.0; 3] },
            paint: None,
            front: Default::default(),
            back: Default::default(),
            crossing: FaceCrossing::default(),
            priority: 0,
        })
    }

    /// The kind of glass of this name.
    fn kind(&self, name: &str) -> Result<GlassDescription, SceneError> {
        if let Some(kind) = self.window.kind(name) {
            return Ok(kind);
        }
        let colours: Vec<&str> = COLOURS.iter().map(|colour| colour.name).collect();
        let found = format!("no kind {}, which the design uses", Quoted(name));
        let expected = format!("that kind, or the design has to name one of the colours {}", colours.join(", "));
        Err(SceneError::value(&self.path.member("glass"), found, expected))
    }

    /// Where a piece is cut from the sheet of its kind.
    fn cut(
        &self,
        name: &str,
        kind: &GlassDescription,
        outline: &LocalOutline,
        piece: &Piece,
        plan: &WindowPlan,
        expansion: &mut WindowExpansion,
    ) -> Result<SheetCut, SceneError> {
        let sheet_name = format!("{} glass {name}", self.window.name);
        let seed = text_seed(name) ^ mix(self.window.design.seed);
        let sheet = expansion.sheets.entry(sheet_name.clone()).or_insert_with(|| kind.sheet.description(seed % SEEDS));
        let place = match kind.cutting {
            _ if !kind.sheet.has_relief() => Some((DVec2::ZERO, 0.0)),
            Cutting::InPlace => {
                let [low, high] = bounds(&plan.outline);
                Some((outline.middle - 0.5 * (low + high), 0.0))
            }
            Cutting::Centred => sheet.place_for(&outline.corners, DVec2::splat(0.5), piece.cut.rotation.to_degrees()),
            Cutting::Scattered => {
                let random = DVec2::new(piece.cut.u, piece.cut.v);
                sheet.place_for(&outline.corners, random, piece.cut.rotation.to_degrees())
            }
        };
        let Some((at, rotation)) = place else {
            let [low, high] = bounds(&outline.corners);
            let found = format!(
                "a sheet of {} x {} m, from which {} is to be cut, which measures {:.3} x {:.3} m",
                sheet.width,
                sheet.height,
                Quoted(&piece.place.to_string()),
                high.x - low.x,
                high.y - low.y
            );
            let path = self.path.member("glass");
            let expected =
                "smaller pieces (quarries, or a `ground` beside drawn ones), or a larger sheet: flat, or own";
            return Err(SceneError::value(&path.member(name).member("sheet"), found, expected));
        };
        Ok(SheetCut { name: sheet_name, at: at.to_array(), rotation })
    }

    /// A protective pane over the opening: as its outline, or over all of it where that is not convex.
    fn add_outer(
        &self,
        outer: &OuterGlazing,
        plan: &WindowPlan,
        painter: &mut Painter<'_>,
        expansion: &mut WindowExpansion,
    ) -> Result<(), SceneError> {
        let [low, high] = bounds(&plan.outline);
        let rectangle = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
        let corners = if is_convex(&plan.outline) { &plan.outline[..] } else { &rectangle };
        let Some(outline) = LocalOutline::of(corners) else { return Ok(()) };
        let [x, y, z] = self.window.axes();
        let (kind, thickness) = (&outer.glass, outer.glass.thickness());
        let path = self.path.member("outer");
        let middle = DVec3::from(self.window.sill) + x * outline.middle.x + y * outline.middle.y;
        let name = format!("{} outer", self.window.name);
        let sheet = kind.sheet.description(text_seed(&name) % SEEDS);
        let Some((at, rotation)) = sheet.place_for(&outline.corners, DVec2::splat(0.5), 0.0) else {
            let found = format!("a sheet of {} x {} m", sheet.width, sheet.height);
            let expected = format!("one of at least {:.3} x {:.3} m", high.x - low.x, high.y - low.y);
            return Err(SceneError::value(&path.member("glass").member("sheet"), found, expected));
        };
        let pane = PaneDescription {
            centre: (middle - z * (outer.distance + thickness)).to_array(),
            x_axis: x.to_array(),
            y_axis: y.to_array(),
            sheet: Some(SheetCut { name: name.clone(), at: at.to_array(), rotation }),
            ..self.pane(kind, &outline, thickness, &path.member("glass"))?
        };
        painter.add_layer(OUTER, kind.paint.as_deref(), (&pane, &sheet));
        expansion.sheets.insert(name.clone(), sheet);
        expansion.panes.push(PaneDescription { name, ..pane });
        Ok(())
    }

    fn add_mesh(&self, mut mesh: PlanMesh, expansion: &mut WindowExpansion) {
        let corner = |vertex: u32| DVec3::from(mesh.positions[vertex as usize]);
        // Stone has corners on straight edges, and so triangles without an area.
        mesh.triangles.retain(|triangle| !is_degenerate(triangle.map(corner)));
        let Some((_, material, colour)) = MATERIALS.into_iter().find(|(part, ..)| *part == mesh.part) else { return };
        let reflectance = ColourDescription::Colour(colour);
        expansion
            .materials
            .entry(material.to_owned())
            .or_insert(MaterialDescription::Diffuse(DiffuseMaterial { reflectance }));
        let [x, y, z] = self.window.axes();
        let sill = self.window.sill;
        let row = |axis: usize| [x[axis], y[axis], z[axis], sill[axis]];
        expansion.meshes.push(MeshDescription {
            name: format!("{} {material}", self.window.name),
            material: material.to_owned(),
            source: MeshSource::Inline {
                positions: mesh.positions,
                triangles: mesh.triangles,
                texture_coordinates: Vec::new(),
                normals: Vec::new(),
            },
            matrix: Some([row(0), row(1), row(2)]),
            scale: 1.0,
            rotate: [0.0; 3],
            translate: [0.0; 3],
        });
    }
}

/// The rotation about a unit vector, radians.
fn rotation_about(axis: DVec3, angle: f64) -> DQuat {
    let (sine, cosine) = libm::sincos(0.5 * angle);
    let [x, y, z] = (axis * sine).to_array();
    DQuat::from_xyzw(x, y, z, cosine)
}

/// Numbers below this are seeds that JSON keeps.
const SEEDS: u64 = 1 << 32;

/// A seed from a name (FNV-1a), so that kinds differ and their order does not matter.
fn text_seed(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

/// The outline of a piece about its middle.
struct LocalOutline {
    middle: DVec2,
    corners: Vec<DVec2>,
}

impl LocalOutline {
    /// `None` for glass that is too narrow for a pane.
    fn of(corners: &[DVec2]) -> Option<Self> {
        let [low, high] = bounds(corners);
        let middle = 0.5 * (low + high);
        let corners = corners.iter().map(|corner| *corner - middle).collect();
        ((high - low).min_element() >= PANE_EDGES[0]).then_some(Self { middle, corners })
    }
}

fn bounds(corners: &[DVec2]) -> [DVec2; 2] {
    corners
        .iter()
        .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[min, max], corner| [min.min(*corner), max.max(*corner)])
}

fn is_convex(corners: &[DVec2]) -> bool {
    let count = corners.len();
    count <= crate::geometry::MOST_CORNERS
        && (0..count).all(|index| {
            let [a, b, c] = [0, 1, 2].map(|step| corners[(index + step) % count]);
            DMat2::from_cols(b - a, c - b).determinant() > 0.0
        })
}
