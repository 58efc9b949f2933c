//! Files of other programs, as a scene file names them.

use super::leading::LeadingRule;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::description::ProfileDescription;
use crate::settings::check::{Names, check_above, check_asset_name, check_name, check_range, check_triple};
use crate::settings::limits::MAX_COORDINATE;
use crate::settings::{Check, JsonPath, Triple, is_default};

/// A file of another program. Its meshes and their materials are in the scene, and its lights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportDescription {
    /// A short name, with which the names of its things begin; no two imports share one.
    #[schemars(length(min = 1, max = 100))]
    pub name: String,
    /// The file.
    pub source: ImportSource,
    /// Metres of a unit of the file, for files that do not say: 0.01 for centimetres.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub metres_per_unit: f64,
    /// The axis of the file that points up. The scene's is z.
    #[serde(default, skip_serializing_if = "is_default")]
    pub up: UpAxis,
    /// Rotation about the fixed axes x, then y, then z, degrees, applied after all this.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rotate: Triple,
    /// Translation, metres, applied last.
    #[serde(default, skip_serializing_if = "is_default")]
    pub translate: Triple,
    /// Whether the lights of the file shine.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub lights: bool,
    /// Materials of the scene in place of those of the file. The first rule that fits counts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<MaterialRule>,
    /// What becomes window panes. The first rule that fits counts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub glaze: Vec<GlazeRule>,
    /// What becomes leaded windows. The first rule that fits counts, before all of `glaze`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lead: Vec<LeadingRule>,
}

fn one() -> f64 {
    1.0
}

fn is_one(number: &f64) -> bool {
    *number == 1.0
}

fn yes() -> bool {
    true
}

fn is_yes(answer: &bool) -> bool {
    *answer
}

/// The file, and the files that it refers to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ImportSource {
    /// A glTF file, .gltf or .glb.
    Gltf(ImportFiles),
    /// A Wavefront OBJ file.
    Obj(ImportFiles),
}

/// A file, and the files that it refers to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportFiles {
    /// The file, relative to the scene file.
    pub file: String,
    /// Files that it refers to, such as buffers, material libraries and pictures, relative to the scene file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<String>,
}

impl ImportDescription {
    /// A file as it is.
    pub fn of(name: String, source: ImportSource) -> Self {
        Self {
            name,
            source,
            metres_per_unit: one(),
            up: UpAxis::default(),
            rotate: [0.0; 3],
            translate: [0.0; 3],
            lights: yes(),
            materials: Vec::new(),
            glaze: Vec::new(),
            lead: Vec::new(),
        }
    }
}

impl ImportSource {
    /// The files, to be changed.
    pub fn files_mut(&mut self) -> &mut ImportFiles {
        match self {
            Self::Gltf(files) | Self::Obj(files) => files,
        }
    }

    /// The files.
    pub fn files(&self) -> &ImportFiles {
        match self {
            Self::Gltf(files) | Self::Obj(files) => files,
        }
    }

    /// Whether the file is nothing without the files that it refers to. An OBJ file has its shapes without materials.
    pub(crate) fn needs_all_files(&self) -> bool {
        matches!(self, Self::Gltf(_))
    }

    /// The name of its format, as scene files have it.
    pub fn format(&self) -> &'static str {
        match self {
            Self::Gltf(_) => "gltf",
            Self::Obj(_) => "obj",
        }
    }
}

/// The axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// y, as in glTF files.
    #[default]
    Y,
    /// z.
    Z,
}

/// Gives meshes of an import another material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialRule {
    /// Which: a pattern of the names of meshes and materials, in which `*` stands for any characters.
    #[serde(rename = "match")]
    pub pattern: String,
    /// Name of a material of the scene.
    pub material: String,
}

/// Makes window panes of flat rectangles and of thin closed boxes of an import.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlazeRule {
    /// Which: a pattern of the names of meshes and materials, in which `*` stands for any characters.
    #[serde(rename = "match")]
    pub pattern: String,
    /// Thickness of the glass, metres; that of a box is its own where none is given, and that of a flat rectangle
    /// 2 mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f64>,
    /// Index of refraction of the glass, 1 to 3.
    #[serde(default = "crate::bsdf::crown_glass", skip_serializing_if = "is_crown_glass")]
    #[schemars(range(min = 1.0, max = 3.0))]
    pub index_of_refraction: f64,
    /// Absorption coefficient of red, green and blue light, per metre.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(inner(range(min = 0.0)))]
    pub absorption: Triple,
    /// Profile of the front faces. Each pane has a seed of its own.
    #[serde(default, skip_serializing_if = "is_default")]
    pub front: ProfileDescription,
    /// Profile of the back faces.
    #[serde(default, skip_serializing_if = "is_default")]
    pub back: ProfileDescription,
    /// How far a pane stays away from each edge of its rectangle, metres, so that it touches no other.
    #[serde(default = "inset", skip_serializing_if = "is_inset")]
    #[schemars(range(min = 0.0, max = 0.1))]
    pub inset: f64,
}

fn is_crown_glass(index: &f64) -> bool {
    *index == crate::bsdf::crown_glass()
}

fn inset() -> f64 {
    0.001
}

fn is_inset(distance: &f64) -> bool {
    *distance == inset()
}

/// Bytes of the name of an import: names of its things are longer.
const MAX_IMPORT_NAME_BYTES: usize = 100;

/// Checks imports, as far as they can be checked without their files. `is_material` knows the materials of the scene.
pub(crate) fn check_imports(
    imports: &[ImportDescription],
    is_material: &dyn Fn(&str) -> bool,
    path: &JsonPath<'_>,
) -> Check {
    let mut names = Names::default();
    for (index, import) in imports.iter().enumerate() {
        let place = path.element(index);
        import.check(is_material, &place)?;
        names.add(&import.name, &place)?;
    }
    Ok(())
}

impl ImportDescription {
    fn check(&self, is_material: &dyn Fn(&str) -> bool, path: &JsonPath<'_>) -> Check {
        let name = path.member("name");
        check_name(&self.name, &name)?;
        check_range(self.name.len(), 1, MAX_IMPORT_NAME_BYTES, &name)?;
        let source = path.member("source");
        let source = source.member(self.source.format());
        let ImportFiles { file, files } = self.source.files();
        check_asset_name(file, &source.member("file"))?;
        let list = source.member("files");
        files.iter().enumerate().try_for_each(|(index, file)| check_asset_name(file, &list.element(index)))?;
        check_above(self.metres_per_unit, 0.0, MAX_COORDINATE, &path.member("metres_per_unit"))?;
        check_triple(self.rotate, -36_000.0, 36_000.0, &path.member("rotate"))?;
        check_triple(self.translate, -MAX_COORDINATE, MAX_COORDINATE, &path.member("translate"))?;
        let rules = path.member("materials");
        for (index, rule) in self.materials.iter().enumerate() {
            let place = rules.element(index);
            if !is_material(&rule.material) {
                let found = crate::settings::check::Quoted(&rule.material);
                let expected = "the name of one of the materials of the scene";
                return Err(crate::settings::SceneError::value(&place.member("material"), found, expected));
            }
        }
        let rules = path.member("glaze");
        self.glaze.iter().enumerate().try_for_each(|(index, rule)| rule.check(&rules.element(index)))?;
        let rules = path.member("lead");
        self.lead.iter().enumerate().try_for_each(|(index, rule)| rule.check(&rules.element(index)))
    }
}

impl ImportFiles {
    /// The name of a file that is beside this one.
    pub(super) fn beside(&self, name: &str) -> String {
        let folder = self.file.rfind('/').map_or("", |end| &self.file[..=end]);
        format!("{folder}{name}")
    }
}

impl GlazeRule {
    /// Clear flat glass.
    pub fn flat(pattern: &str) -> Self {
        Self {
            pattern: pattern.to_owned(),
            thickness: None,
            index_of_refraction: crate::bsdf::crown_glass(),
            absorption: [0.0; 3],
            front: ProfileDescription::default(),
            back: ProfileDescription::default(),
            inset: inset(),
        }
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        if let Some(thickness) = self.thickness {
            check_above(thickness, 0.0, 1.0, &path.member("thickness"))?;
        }
        check_range(self.index_of_refraction, 1.0, 3.0, &path.member("index_of_refraction"))?;
        check_triple(self.absorption, 0.0, 1e9, &path.member("absorption"))?;
        check_range(self.inset, 0.0, 0.1, &path.member("inset"))
    }
}
