//! A scene with all that rendering it takes: its things, its settings, and its method.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::OnceLock;

use clerestory_film::Sampling;

use super::allocation::Allocation;
use super::light_subpaths::Starts;
use crate::document::{PathFilter, SamplingDescription, SceneBundle, SceneDescription};
use crate::scene::{BuildStep, ContentHash, Obstacles, Scene, SceneHash};
use crate::settings::{JsonPath, SceneError};
use crate::specular::SpecularMethod;
use crate::specular::cache::MethodCache;
use crate::specular::double_glazing::with_double_glazing;
use crate::specular::environment::with_environment;
use crate::texture::TextureDescription;

/// A scene file that is ready to be rendered. It does not change any more.
pub struct PreparedScene {
    hash: SceneHash,
    /// The scene as its file has it.
    file: SceneDescription,
    /// The same with the things of its imports among its own.
    description: SceneDescription,
    import_notes: Vec<String>,
    /// The contents that the description names.
    assets: BTreeMap<String, ContentHash>,
    scene: Scene,
    path_filter: Option<PathFilter>,
    sampling: Sampling,
    cache: MethodCache,
    method: Option<Box<dyn SpecularMethod>>,
    starts: Option<Starts>,
    allocation: OnceLock<Allocation>,
}

impl PreparedScene {
    /// Builds the scene and its method.
    ///
    /// # Errors
    ///
    /// As [`Scene::build`].
    pub fn build(bundle: &SceneBundle) -> Result<Self, SceneError> {
        Self::build_step_by_step(bundle, &mut |_| ())
    }

    /// Builds the scene and its method, and tells of each step before it begins.
    ///
    /// # Errors
    ///
    /// As [`Scene::build`].
    pub fn build_step_by_step(bundle: &SceneBundle, begin: &mut dyn FnMut(BuildStep<'_>)) -> Result<Self, SceneError> {
        let file = bundle.description();
        let path_filter = file.compiled_path_filter()?;
        let sampling = sampling(file)?;
        let (description, import_notes) = file.expanded_step_by_step(bundle.assets(), begin)?;
        let is_whole = file.imports.is_empty() && file.windows.is_empty();
        let name = |error| if is_whole { error } else { description.named(error) };
        let scene = Scene::build(description.parts(), bundle.assets(), begin).map_err(name)?;
        begin(BuildStep::SpecularMeshes);
        let cache = MethodCache::default();
        Ok(Self {
            hash: bundle.scene_hash(),
            file: file.clone(),
            description: description.clone().into_owned(),
            import_notes,
            assets: asset_hashes(bundle),
            method: method(&description, &scene, &cache),
            starts: starts(&description, &scene),
            scene,
            path_filter,
            sampling,
            cache,
            allocation: OnceLock::new(),
        })
    }

    /// The scene of `bundle`. Where nothing but the camera, the film, the lights, the daylight, the integrator, the
    /// seed and the sampling differ, all that takes time to build is kept. Whether the camera and the lights may stand
    /// where they do then, [`Obstacles::check`] tells.
    ///
    /// # Errors
    ///
    /// As [`Self::build`].
    pub fn changed(self, bundle: &SceneBundle) -> Result<Self, SceneError> {
        let file = bundle.description();
        let kept = SceneDescription {
            camera: self.file.camera.clone(),
            film: self.file.film,
            lights: self.file.lights.clone(),
            site: self.file.site.clone(),
            moment: self.file.moment.clone(),
            daylight: self.file.daylight.clone(),
            integrator: self.file.integrator.clone(),
            seed: self.file.seed,
            sampling: self.file.sampling,
            ..file.clone()
        };
        let same_pictures = light_pictures(file).eq(light_pictures(&self.file));
        let same_surfaces = light_surfaces(file).eq(light_surfaces(&self.file));
        if kept != self.file || !same_pictures || !same_surfaces || asset_hashes(bundle) != self.assets {
            return Self::build(bundle);
        }
        let description = file.expanded(bundle.assets())?;
        let is_lit_alike = description.lights == self.description.lights;
        let is_seen_alike = file.camera == self.file.camera && file.film == self.file.film;
        let mut scene = self.scene.with_view(description.parts());
        if !is_lit_alike {
            scene = scene.with_lights(description.parts());
        }
        let is_found_alike = is_lit_alike && description.integrator == self.description.integrator;
        let (method, starts) = if is_found_alike {
            (self.method, self.starts)
        } else {
            let starts = starts(&description, &scene);
            (method(&description, &scene, &self.cache), starts)
        };
        // A pilot knows no seed.
        let allocation = if is_seen_alike && is_found_alike { self.allocation } else { OnceLock::new() };
        Ok(Self {
            hash: bundle.scene_hash(),
            sampling: sampling(file)?,
            file: file.clone(),
            description: description.into_owned(),
            starts,
            method,
            scene,
            allocation,
            ..self
        })
    }

    /// The same without a pilot, for pictures that have to come at once. They are those of another allocation of
    /// effort, with other noise.
    #[must_use]
    pub fn without_pilot(self) -> Self {
        Self { allocation: OnceLock::from(Allocation::USUAL), ..self }
    }

    /// The identity of the scene.
    pub fn hash(&self) -> SceneHash {
        self.hash
    }

    /// What it was built from, with the things of imports: settings of integrator and film, and the names of things.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    /// The things in the scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The method for light by way of specular surfaces; `None` for path tracing alone.
    pub fn method(&self) -> Option<&dyn SpecularMethod> {
        self.method.as_deref()
    }

    /// Where light subpaths begin, if the integrator has any.
    pub(super) fn starts(&self) -> Option<&Starts> {
        self.starts.as_ref()
    }

    /// How much effort goes into light subpaths, once that has been chosen.
    pub(super) fn kept_allocation(&self) -> &OnceLock<Allocation> {
        &self.allocation
    }

    /// The light path expression to which rendering is restricted.
    pub fn path_filter(&self) -> Option<&PathFilter> {
        self.path_filter.as_ref()
    }

    /// How samples are grouped.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// What the camera and the lights must keep out of.
    pub fn obstacles(&self) -> Obstacles {
        self.scene.obstacles()
    }

    /// What is in the files of imports and not in the scene, or differs, in words: at most 100 sentences of 300
    /// characters.
    pub fn import_notes(&self) -> &[String] {
        &self.import_notes
    }

    /// The light of small lights and of the environment that an image leaves to chance, in words, for its metadata.
    pub fn left_to_chance(&self) -> Vec<String> {
        self.description.left_to_chance(&self.scene)
    }
}

impl fmt::Debug for PreparedScene {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("PreparedScene").field("hash", &self.hash).finish_non_exhaustive()
    }
}

/// The method that the settings name, with the light of an environment.
fn method(description: &SceneDescription, scene: &Scene, cache: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
    let method = description.integrator.build(scene, cache)?;
    Some(with_double_glazing(with_environment(method, scene, cache), scene, cache))
}

/// The starts of light subpaths, if the scene has any.
fn starts(description: &SceneDescription, scene: &Scene) -> Option<Starts> {
    if description.has_light_subpaths() { Starts::new(scene) } else { None }
}

/// The pictures of lights.
fn light_pictures(description: &SceneDescription) -> impl Iterator<Item = &str> {
    description.lights.iter().filter_map(|light| light.picture().map(|(_, file)| file))
}

/// The meshes that are lights, with the pictures over them.
fn light_surfaces(description: &SceneDescription) -> impl Iterator<Item = (&str, Option<&TextureDescription>)> {
    let lights = description.lights.iter();
    lights.filter_map(|light| Some((light.mesh()?, light.texture().map(|texture| texture.texture))))
}

fn asset_hashes(bundle: &SceneBundle) -> BTreeMap<String, ContentHash> {
    bundle.assets().iter().map(|(name, asset)| (name.clone(), asset.hash())).collect()
}

/// How samples are grouped.
fn sampling(description: &SceneDescription) -> Result<Sampling, SceneError> {
    let SamplingDescription { samples_per_pass, samples_per_block } = description.sampling;
    Sampling::new(samples_per_pass, samples_per_block).map_err(|error| {
        SceneError::value(&JsonPath::Root.member("sampling"), format_args!("{error}"), "numbers that fit")
    })
}
