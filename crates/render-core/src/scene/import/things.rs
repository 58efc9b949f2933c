//! Things of a file of another program, before and after the rules of an import.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_glazing::inset_convex;
use glam::{DAffine3, DMat3, DVec3};

use super::description::{GlazeRule, ImportDescription, UpAxis};
use super::glazing::{PaneFit, Piece, pieces};
use super::windows::{Candidate, Window, Windows, is_called_window, sheet_for};
use crate::bsdf::MaterialDescription;
use crate::geometry::rotation::rotation;
use crate::light::{LightDescription, MeshLight};
use crate::scene::description::{
    CameraDescription, LayersDescription, MeshDescription, MeshSource, PaneDescription, ProfileDescription,
};
use crate::scene::mesh::is_degenerate;
use crate::scene::profile::shortest_wavelength;
use crate::scene::window::WindowExpansion;
use crate::settings::AssetProblem;
use crate::settings::JsonPath;
use crate::settings::Triple;
use crate::settings::check::Quoted;
use crate::settings::limits::{MAX_IMPORTED_THINGS, MAX_NAME_BYTES, MAX_PANES, PANE_EDGES};
use crate::settings::pattern::matches;
use crate::texture::TextureDescription;

/// What a file adds to a scene.
#[derive(Clone, Debug, Default)]
pub struct Expansion {
    /// Materials by their names.
    pub materials: BTreeMap<String, MaterialDescription>,
    /// Meshes, in the order of the file.
    pub meshes: Vec<MeshDescription>,
    /// Panes, where rules make some.
    pub panes: Vec<PaneDescription>,
    /// What leaded windows are made of, where rules make some.
    pub leaded: WindowExpansion,
    /// How many leaded windows there are.
    pub leaded_windows: usize,
    /// Lights, if they shine.
    pub lights: Vec<LightDescription>,
    /// Cameras, which a scene takes by hand.
    pub cameras: Vec<ImportedCamera>,
    /// What is in the file and not in the scene, or differs, one sentence each.
    pub notes: Vec<String>,
    /// Names that a rule makes panes of and that are none, with the reason.
    pub unglazed: Vec<(String, String)>,
    /// Windows without a rule, by what they are called or made of.
    pub windows: Vec<Window>,
}

impl Expansion {
    /// What is in the file and not in the scene, or differs, and what a rule would make a pane of and is none: one
    /// sentence each.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        let alike = self.unglazed.chunk_by(|first, second| first == second);
        let unglazed = alike.flat_map(|pieces| {
            let (name, reason) = pieces.first()?;
            Some(match pieces.len() {
                1 => format!("{name} is no pane: {reason}"),
                count => format!("{count} pieces of {name} are no panes: {reason}"),
            })
        });
        self.notes.iter().cloned().chain(unglazed)
    }
}

/// A camera of a file.
#[derive(Clone, Debug)]
pub struct ImportedCamera {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: CameraDescription,
    /// Width over height, if the file says.
    pub aspect: Option<f64>,
}

/// A mesh of a file, before rules.
pub(super) struct Thing {
    /// What it is called: the node, else the mesh.
    pub(super) name: String,
    /// What its mesh is called.
    pub(super) mesh: Option<String>,
    /// What its material is called in the file.
    pub(super) material_in_file: Option<String>,
    /// From the coordinates of the file to those of the scene.
    pub(super) to_scene: DAffine3,
    pub(super) source: MeshSource,
    /// Name of its material among [`Expansion::materials`].
    pub(super) material: String,
    /// Whether its material lets light through.
    pub(super) is_transparent: bool,
    /// The light of its material, if it emits any.
    pub(super) emission: Option<Emission>,
    /// What the program that wrote the file says of glazing, if anything.
    pub(super) pane: Option<GlazeRule>,
    /// What a modeller has written on it, as `key:value`.
    pub(super) tags: Vec<String>,
}

/// Light that a material emits.
#[derive(Clone, Debug)]
pub(super) struct Emission {
    /// W/(m2 sr).
    pub(super) radiance: Triple,
    /// By what radiance is multiplied.
    pub(super) texture: Option<TextureDescription>,
}

/// The corners of a thing: positions in the file, and triangles.
pub(super) type Corners = (Vec<DVec3>, Vec<[u32; 3]>);

impl ImportDescription {
    /// From the coordinates of the file to those of the scene.
    pub(super) fn to_scene(&self) -> DAffine3 {
        let upright = match self.up {
            UpAxis::Z => DMat3::IDENTITY,
            UpAxis::Y => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        };
        let linear = rotation(self.rotate) * upright * self.metres_per_unit;
        DAffine3 { matrix3: linear, translation: DVec3::from(self.translate) }
    }
}

/// Names of the scene that are taken.
#[derive(Debug, Default)]
pub(super) struct Names {
    taken: BTreeSet<String>,
    /// How often each was asked for.
    asked: BTreeMap<String, usize>,
}

impl Names {
    /// The name of a thing of the file in the scene.
    pub(super) fn name(&mut self, import: &ImportDescription, name: &str) -> String {
        let plain: String = name.chars().filter(|character| !character.is_control()).collect();
        let mut long = format!("{}/{}", import.name, if plain.is_empty() { "unnamed" } else { &plain });
        // Room for a number.
        long.truncate(long.floor_char_boundary(MAX_NAME_BYTES - 12));
        let asked = self.asked.entry(long.clone()).or_default();
        loop {
            *asked += 1;
            let unique = if *asked == 1 { long.clone() } else { format!("{long} {asked}") };
            if self.taken.insert(unique.clone()) {
                return unique;
            }
        }
    }
}

/// Three rows of a placement.
pub(super) fn rows(affine: DAffine3) -> [[f64; 4]; 3] {
    let [x, y, z] = [affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis];
    [0, 1, 2].map(|row| [x[row], y[row], z[row], affine.translation[row]])
}

impl Thing {
    /// Its names in the file.
    fn names(&self) -> impl Iterator<Item = &String> {
        [&self.name].into_iter().chain(&self.mesh).chain(&self.material_in_file)
    }

    /// Whether its material is that of a window.
    fn is_glass(&self) -> bool {
        self.is_transparent || self.material_in_file.as_deref().is_some_and(is_called_window)
    }

    /// Its pieces, in the coordinates of the scene.
    fn pieces(&self, (positions, triangles): Corners) -> Vec<Piece> {
        let placed: Vec<DVec3> = positions.iter().map(|at| self.to_scene.transform_point3(*at)).collect();
        pieces(&placed, &triangles)
    }

    /// Whether none of its triangles has an area.
    fn is_empty(&self, (positions, triangles): &Corners) -> bool {
        let corner = |vertex: u32| positions.get(vertex as usize).map(|at| self.to_scene.transform_point3(*at));
        let mut placed = triangles.iter().filter_map(|[a, b, c]| Some([corner(*a)?, corner(*b)?, corner(*c)?]));
        placed.all(is_degenerate)
    }
}

/// The patterns of rules. Most are plain names, which are looked up: a file may have a rule for each of its windows.
struct Patterns<'a> {
    /// Plain names, with the first rule that has each.
    names: BTreeMap<&'a str, usize>,
    /// The others, in their order.
    patterns: Vec<(usize, &'a str)>,
}

impl<'a> Patterns<'a> {
    fn new(rules: impl Iterator<Item = &'a String>) -> Self {
        let (mut names, mut patterns) = (BTreeMap::new(), Vec::new());
        for (index, pattern) in rules.enumerate() {
            if pattern.contains('*') {
                patterns.push((index, pattern.as_str()));
            } else {
                names.entry(pattern.as_str()).or_insert(index);
            }
        }
        Self { names, patterns }
    }

    /// The first rule that fits one of the names of a thing, or what is written on it.
    fn first(&self, thing: &Thing) -> Option<usize> {
        let names = || thing.names().chain(&thing.tags);
        let plain = names().filter_map(|name| self.names.get(name.as_str()).copied()).min();
        let fits = |(_, pattern): &&(usize, &str)| names().any(|name| matches(pattern, name));
        let pattern = self.patterns.iter().find(fits).map(|(index, _)| *index);
        plain.into_iter().chain(pattern).min()
    }
}

/// What a file adds to a scene, thing by thing.
pub(super) struct Assembly<'a> {
    import: &'a ImportDescription,
    /// What there is so far.
    pub(super) expansion: Expansion,
    names: Names,
    windows: Windows,
    materials: Patterns<'a>,
    glaze: Patterns<'a>,
    lead: Patterns<'a>,
    /// The sheets of leaded windows, by the number of their rule and their kind of glass.
    stock: BTreeMap<(usize, String), String>,
    /// The rules that have fitted something: of materials, of glazing and of leading.
    used: [BTreeSet<usize>; 3],
}

impl<'a> Assembly<'a> {
    /// Nothing yet.
    pub(super) fn new(import: &'a ImportDescription) -> Self {
        Self {
            import,
            expansion: Expansion::default(),
            names: Names::default(),
            windows: Windows::default(),
            materials: Patterns::new(import.materials.iter().map(|rule| &rule.pattern)),
            glaze: Patterns::new(import.glaze.iter().map(|rule| &rule.pattern)),
            lead: Patterns::new(import.lead.iter().map(|rule| &rule.pattern)),
            stock: BTreeMap::new(),
            used: <[BTreeSet<usize>; 3]>::default(),
        }
    }

    /// The name of a thing of the file in the scene.
    pub(super) fn name(&mut self, name: &str) -> String {
        self.names.name(self.import, name)
    }

    /// Adds a thing to the scene: as a mesh, or as panes where a rule says so. What a rule fits and what is no pane
    /// stays a mesh.
    ///
    /// # Errors
    ///
    /// When its corners make no sense, or there are too many things.
    pub(super) fn add(
        &mut self,
        mut thing: Thing,
        mut corners: impl FnMut() -> Result<Corners, AssetProblem>,
    ) -> Result<(), AssetProblem> {
        let leaded = self.expansion.leaded.meshes.len() + self.expansion.leaded.panes.len();
        if self.expansion.meshes.len() + self.expansion.panes.len() + leaded >= MAX_IMPORTED_THINGS {
            let limit = format!("{MAX_IMPORTED_THINGS} of them: join what has one material");
            return Err(AssetProblem::TooLarge { found: "more meshes and panes".to_owned(), limit });
        }
        if thing.emission.is_some() && thing.is_empty(&corners()?) {
            self.expansion.notes.push(format!("{}: it emits no light, since it has no area", thing.name));
            thing.emission = None;
        }
        let leading = self.lead.first(&thing);
        self.used[2].extend(leading);
        if let Some(index) = leading {
            return self.add_pieces(thing, corners()?, &mut |assembly, name, fit| assembly.lead_in(index, name, fit));
        }
        let index = self.glaze.first(&thing);
        self.used[1].extend(index);
        let Some(rule) = index.map(|index| &self.import.glaze[index]).or(thing.pane.as_ref()).cloned() else {
            self.note_window(&thing, &mut corners)?;
            self.add_mesh(thing);
            return Ok(());
        };
        self.add_pieces(thing, corners()?, &mut |assembly, name, fit| {
            let pane = rule.pane(String::new(), fit, assembly.expansion.panes.len() as u64)?;
            check_size(&pane).and_then(|()| check_resolved(&pane))?;
            let name = assembly.name(name);
            assembly.expansion.panes.push(PaneDescription { name, ..pane });
            Ok(())
        })
    }

    /// Glazes the pieces of a thing that are rectangles, each by itself, or says why it cannot be. The others stay a
    /// mesh.
    fn add_pieces(
        &mut self,
        thing: Thing,
        corners: Corners,
        glaze: &mut dyn FnMut(&mut Self, &str, &PaneFit) -> Result<(), String>,
    ) -> Result<(), AssetProblem> {
        if thing.emission.is_some() && self.import.lights {
            self.expansion.notes.push(format!("{}: glass emits no light, though its material does", thing.name));
        }
        let (mut rest, mut is_glazed) = (Vec::new(), false);
        for piece in thing.pieces(corners) {
            match piece.fit.as_ref().map_err(String::clone).and_then(|fit| glaze(self, &thing.name, fit)) {
                Ok(()) => is_glazed = true,
                Err(reason) => {
                    self.expansion.unglazed.push((thing.name.clone(), reason));
                    rest.push(piece);
                }
            }
        }
        if !is_glazed {
            // Such as the textured frame of a window, which is called like one.
            self.add_mesh(thing);
        } else if !rest.is_empty() {
            let source = inline(&rest);
            let to_scene = DAffine3::IDENTITY;
            // These have no texture coordinates.
            let emission = thing.emission.filter(|emission| emission.texture.is_none());
            self.add_mesh(Thing { source, to_scene, emission, ..thing });
        }
        Ok(())
    }

    /// Puts a leaded window into a rectangle.
    fn lead_in(&mut self, rule: usize, name: &str, fit: &PaneFit) -> Result<(), String> {
        let root = JsonPath::Root;
        let rules = root.member("lead");
        let (number, name) = (self.expansion.leaded_windows as u64, self.name(name));
        let window = self.import.lead[rule].window_in(name.clone(), fit, number, &rules.element(rule));
        let WindowExpansion { materials, meshes, sheets, mut panes } = window?;
        let leaded = &mut self.expansion.leaded;
        if leaded.panes.len() + panes.len() > MAX_PANES {
            return Err(format!("with its {} pieces a scene would have more than {MAX_PANES}", panes.len()));
        }
        leaded.materials.extend(materials);
        leaded.meshes.extend(meshes);
        // All windows of a rule are cut from the same sheets, which take longest to build.
        for (own, sheet) in sheets {
            let kind = own.strip_prefix(&name).unwrap_or(&own).to_owned();
            let shared = self.stock.entry((rule, kind)).or_insert_with(|| own.clone());
            if *shared == own {
                leaded.sheets.insert(own.clone(), sheet);
            }
            for cut in panes.iter_mut().filter_map(|pane| pane.sheet.as_mut()).filter(|cut| cut.name == own) {
                cut.name.clone_from(shared);
            }
        }
        leaded.panes.extend(panes);
        self.expansion.leaded_windows += 1;
        Ok(())
    }

    /// Remembers what could be glazed, and what could not.
    fn note_window(
        &mut self,
        thing: &Thing,
        corners: &mut impl FnMut() -> Result<Corners, AssetProblem>,
    ) -> Result<(), AssetProblem> {
        let is_glass = thing.is_glass();
        if is_glass || [&thing.name].into_iter().chain(&thing.mesh).any(|name| is_called_window(name)) {
            let pieces = thing.pieces(corners()?);
            let fits = pieces.iter().filter_map(|piece| piece.fit.as_ref().ok());
            let fits: Vec<&PaneFit> = fits.filter(|fit| fit.size[0].max(fit.size[1]) <= PANE_EDGES[1]).collect();
            if let Some(first) = fits.first() {
                let has_rule = self.materials.first(thing).is_some();
                let material = self.expansion.materials.get(&thing.material).filter(|_| !has_rule);
                let thickness = first.thickness.unwrap_or(FLAT_THICKNESS);
                self.windows.add(Candidate {
                    names: [&thing.name].into_iter().chain(&thing.mesh).cloned().collect(),
                    material: thing.material_in_file.clone(),
                    is_glass,
                    panes: fits.len(),
                    sheet: material.and_then(|material| sheet_for(material, thickness)),
                });
                return Ok(());
            }
        }
        if !is_glass {
            self.windows.add_other(thing.names().cloned());
        }
        Ok(())
    }

    /// Adds a thing as a mesh of the scene. It shines if its material does and no material of the scene takes its
    /// place.
    fn add_mesh(&mut self, thing: Thing) {
        let name = self.name(&thing.name);
        let index = self.materials.first(&thing);
        self.used[0].extend(index);
        if index.is_none()
            && self.import.lights
            && let Some(Emission { radiance, texture }) = thing.emission
        {
            let (texture, mesh) = (texture.map(Box::new), name.clone());
            let light = MeshLight { name: name.clone(), mesh, radiance, texture };
            self.expansion.lights.push(LightDescription::Mesh(light));
        }
        self.expansion.meshes.push(MeshDescription {
            name,
            material: index.map_or(thing.material, |index| self.import.materials[index].material.clone()),
            source: thing.source,
            matrix: Some(rows(thing.to_scene)),
            scale: 1.0,
            rotate: [0.0; 3],
            translate: [0.0; 3],
        });
    }

    /// All of it.
    pub(super) fn finish(self) -> Expansion {
        let Self { import, mut expansion, windows, used: [materials, glaze, lead], .. } = self;
        let of_materials = import.materials.iter().map(|rule| &rule.pattern).enumerate();
        let of_glaze = import.glaze.iter().map(|rule| &rule.pattern).enumerate();
        let of_lead = import.lead.iter().map(|rule| &rule.pattern).enumerate();
        let idle = of_materials
            .filter(|(index, _)| !materials.contains(index))
            .chain(of_glaze.filter(|(index, _)| !glaze.contains(index)))
            .chain(of_lead.filter(|(index, _)| !lead.contains(index)));
        let notes = idle.map(|(_, pattern)| {
            format!("the rule for {} does nothing: no name fits it that none before it fits", Quoted(pattern))
        });
        expansion.notes.extend(notes);
        expansion.windows = windows.settle();
        expansion
    }
}

/// Pieces as triangles in the scene.
fn inline(pieces: &[Piece]) -> MeshSource {
    let corners = pieces.iter().flat_map(|piece| piece.triangles.iter().flatten());
    let positions: Vec<[f64; 3]> = corners.map(|corner| corner.to_array()).collect();
    let triangles = (0..positions.len() as u32 / 3).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]);
    MeshSource::Inline {
        triangles: triangles.collect(),
        // A material may have a texture, of which what is beside a pane has one texel.
        texture_coordinates: vec![[0.0; 2]; positions.len()],
        positions,
        normals: Vec::new(),
    }
}

/// Thickness of glass that is modelled as a flat rectangle, metres, where a rule has none.
pub const FLAT_THICKNESS: f64 = 0.002;

impl GlazeRule {
    /// The pane in a shape; `number` makes its relief another than that of others.
    fn pane(&self, name: String, fit: &PaneFit, number: u64) -> Result<PaneDescription, String> {
        let thickness = self.thickness.or(fit.thickness).unwrap_or(FLAT_THICKNESS);
        let [width, height] = fit.size.map(|edge| edge - 2.0 * self.inset);
        let outline = inset_convex(fit.convex_outline()?, self.inset);
        if fit.outline.is_some() && outline.is_empty() {
            return Err(format!("nothing is left of it {} m from its edges", self.inset));
        }
        let [x_axis, y_axis] = fit.axes.map(|axis| axis.to_array());
        Ok(PaneDescription {
            name,
            centre: fit.front(thickness).to_array(),
            x_axis,
            y_axis,
            width,
            height,
            outline: outline.iter().map(|corner| corner.to_array()).collect(),
            sheet: None,
            thickness,
            index_of_refraction: self.index_of_refraction,
            absorption: self.absorption,
            layers: LayersDescription::default(),
            paint: None,
            front: with_seed(&self.front, 2 * number),
            back: with_seed(&self.back, 2 * number + 1),
            crossing: crate::geometry::FaceCrossing::default(),
            priority: 0,
        })
    }
}

/// Refuses a pane that is too small or too large for a scene.
fn check_size(pane: &PaneDescription) -> Result<(), String> {
    let [least, most] = PANE_EDGES;
    let [short, long] = [pane.width.min(pane.height), pane.width.max(pane.height)];
    if short < least {
        return Err(format!("it is too narrow: {:.1} mm are left of it in its frame", 1000.0 * short.max(0.0)));
    }
    if long > most {
        return Err(format!(
            "it measures {long:.2} m, and panes at most {most} m: is the file in centimetres (--unit cm)?"
        ));
    }
    Ok(())
}

/// Refuses a pane that is too large for its relief.
fn check_resolved(pane: &PaneDescription) -> Result<(), String> {
    let edge = pane.width.max(pane.height);
    for profile in [&pane.front, &pane.back] {
        let (ProfileDescription::Crown { wavelength, .. }
        | ProfileDescription::Cylinder { wavelength, .. }
        | ProfileDescription::Hammered { wavelength, .. }) = profile
        else {
            continue;
        };
        let shortest = shortest_wavelength(profile, edge);
        if *wavelength < shortest {
            let (kind, longest) = (profile.name(), edge * wavelength / shortest);
            return Err(format!(
                "it measures {edge:.2} m, and panes of {kind} glass with waves of {wavelength} m at most {longest:.2} \
                 m: divide it into lights, or glaze it flat"
            ));
        }
    }
    Ok(())
}

/// The same profile with another seed, where it has one.
fn with_seed(profile: &ProfileDescription, more: u64) -> ProfileDescription {
    let mut profile = profile.clone();
    if let ProfileDescription::Crown { seed, .. }
    | ProfileDescription::Cylinder { seed, .. }
    | ProfileDescription::Hammered { seed, .. } = &mut profile
    {
        *seed = seed.wrapping_add(more);
    }
    profile
}
