//! The materials of a scene as others have them.

use clerestory_render_core::exchange::{ColourModel, SurfaceModel, TextureModel, ValueModel};
use clerestory_render_core::texture::{Bitmaps, Filter};

use crate::approximation::Approximation;
use crate::contents::Material;
use crate::error::ExportError;
use crate::file_name::file_name;
use crate::source::Source;
use crate::texture::Pictures;

/// Materials that meshes have, and what is not quite as in the scene.
pub(crate) fn materials(
    source: &Source<'_>,
    bitmaps: &Bitmaps<'_>,
    pictures: &mut Pictures,
) -> Result<(Vec<Material>, Vec<Approximation>), ExportError> {
    let mut approximations = Vec::new();
    let mut materials = Vec::new();
    for (index, (name, material)) in source.parts.materials.iter().enumerate() {
        if !source.parts.meshes.iter().any(|mesh| mesh.material == *name) {
            continue;
        }
        let place = format!("materials.{name}");
        let mut approximate = |by, difference| {
            let approximation = Approximation { place: place.clone(), by, difference };
            if !approximations.contains(&approximation) {
                approximations.push(approximation);
            }
        };
        let model = material.model(bitmaps).unwrap_or_else(|| {
            approximate("`diffuse`", "no model describes this kind of material, so it is grey");
            SurfaceModel::Diffuse { reflectance: ColourModel::Colour([0.5; 3]) }
        });
        for what in material.beyond_model() {
            approximate("a simpler material", what);
        }
        let cover = material.cover(bitmaps);
        if let Some(ValueModel::Texture(texture)) = &cover.opacity
            && texture.file.threshold.is_some()
            && texture.filter == Filter::Linear
        {
            approximate("a picture of zeros and ones", "its opacity is cut at texels, not between them");
        }
        // A mesh has one set of texture coordinates in its file.
        let mut coordinates = None;
        let mut write = |texture: TextureModel| {
            if *coordinates.get_or_insert(texture.coordinates) != texture.coordinates {
                approximate("one set of texture coordinates", "its pictures use two, of which the first is written");
            }
            pictures.texture(texture)
        };
        let model = model.try_map_textures(&mut write)?;
        let cover = cover.try_map_textures(&mut write)?;
        materials.push(Material { name: name.clone(), id: file_name(index, name), coordinates, model, cover });
    }
    Ok((materials, approximations))
}
