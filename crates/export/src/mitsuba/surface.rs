//! Materials. Those of Mitsuba have one side unless they are wrapped in `twosided`.

use clerestory_render_core::exchange::{ColourModel, CoverModel, SurfaceModel, TextureModel, ValueModel};
use clerestory_render_core::settings::Triple;
use clerestory_render_core::texture::{Filter, Wrap};

use super::element::{float, rgb};
use super::xml::Element;

/// The least width of the distribution of microfacets.
const MIN_ALPHA: f64 = 1e-3;

/// What a coat may reflect along the normal, for `principled` to have an index of refraction for it.
const COATS: std::ops::Range<f64> = 1e-6..0.9;

/// By what part `principled` reflects more light than a base and its coat do, averaged over all directions. It adds a
/// coat to a base that loses nothing to it. Its white would otherwise reflect more light than arrives. (`roughplastic`
/// is darker than both by up to a half where it is rough.)
const DIMMED: f64 = 0.064;

/// A matt base and its coat.
struct Coated<'a> {
    colour: &'a ColourModel<String>,
    roughness: &'a ValueModel<String>,
    coat: f64,
    coat_colour: &'a ColourModel<String>,
    coat_strength: &'a ValueModel<String>,
}

/// A texture that several materials may have.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SharedTexture {
    model: TextureModel<String>,
    /// Whether it has numbers instead of colours.
    is_data: bool,
}

/// Writes one material.
pub(super) struct Surfaces<'a> {
    /// Textures that are named by their numbers.
    textures: &'a mut Vec<SharedTexture>,
    /// What stands for the material, and how it differs.
    pub(super) differences: Vec<(&'static str, &'static str)>,
}

impl<'a> Surfaces<'a> {
    pub(super) fn new(textures: &'a mut Vec<SharedTexture>) -> Self {
        Self { textures, differences: Vec::new() }
    }

    pub(super) fn differ(&mut self, by: &'static str, difference: &'static str) {
        if !self.differences.contains(&(by, difference)) {
            self.differences.push((by, difference));
        }
    }

    /// The material of a model, with what lies over it.
    pub(super) fn covered(&mut self, model: &SurfaceModel<String>, cover: &CoverModel<String>) -> Element {
        let mut bsdf = self.bsdf(model);
        if let Some(normals) = &cover.normals {
            bsdf = Element::plugin("bsdf", "normalmap")
                .containing(self.texture("normalmap", normals, true))
                .containing(Element::value("boolean", "use_shadowing_function", false))
                .containing(bsdf);
        }
        let Some(opacity) = &cover.opacity else { return bsdf };
        Element::plugin("bsdf", "mask").containing(self.value("opacity", opacity)).containing(bsdf)
    }

    /// The material of a model.
    fn bsdf(&mut self, model: &SurfaceModel<String>) -> Element {
        match model {
            SurfaceModel::Diffuse { reflectance } => two_sided(self.diffuse(reflectance)),
            SurfaceModel::DiffuseTransmission { reflectance, transmittance } => {
                self.diffuse_transmission(reflectance, transmittance)
            }
            SurfaceModel::Mirror { reflectance } => two_sided(mirror(*reflectance)),
            SurfaceModel::Metal { reflectance, roughness } => two_sided(self.metal(reflectance, roughness)),
            SurfaceModel::Coated { colour, metallic, roughness, coat, coat_colour, coat_strength } => {
                let base = self.coated(&Coated { colour, roughness, coat: *coat, coat_colour, coat_strength });
                if *metallic == ValueModel::Value(0.0) {
                    return two_sided(base);
                }
                let metal = self.metal(colour, roughness);
                two_sided(self.blend(metallic, base, metal))
            }
            SurfaceModel::Dielectric { index_of_refraction } => dielectric(*index_of_refraction),
            SurfaceModel::RoughDielectric { index_of_refraction, roughness } => {
                self.differ("`roughdielectric`", "its facets shade light that comes and light that goes independently");
                refracting("roughdielectric", *index_of_refraction)
                    .containing(ggx())
                    .containing(float("alpha", roughness * roughness))
            }
            SurfaceModel::ThinSheet { index_of_refraction, tint } => {
                let sheet = refracting("thindielectric", *index_of_refraction);
                sheet.containing(self.colour("specular_transmittance", tint))
            }
        }
    }

    fn diffuse(&mut self, reflectance: &ColourModel<String>) -> Element {
        diffuse(self.colour("reflectance", reflectance))
    }

    /// A mixture of what scatters all light back and what scatters all to the other side.
    fn diffuse_transmission(
        &mut self,
        reflectance: &ColourModel<String>,
        transmittance: &ColourModel<String>,
    ) -> Element {
        let (ColourModel::Colour(back), ColourModel::Colour(through)) = (reflectance, transmittance) else {
            self.differ("`diffuse`", "it lets no light through: pictures of what is transmitted are left out");
            return two_sided(self.diffuse(reflectance));
        };
        let [most_back, most_through] = [back, through].map(|colour| colour.iter().fold(0.0, |a: f64, b| a.max(*b)));
        if most_through == 0.0 {
            return two_sided(self.diffuse(reflectance));
        }
        if most_back + most_through > 1.0 {
            self.differ("`diffuse` and `principledthin`", "a channel of the one or the other is too dark");
        }
        let weight = most_through / (most_back + most_through);
        let part = |colour: &Triple, share: f64| {
            colour.map(|channel| if share > 0.0 { (channel / share).min(1.0) } else { 0.0 })
        };
        let reflecting = two_sided(diffuse(rgb("reflectance", part(back, 1.0 - weight))));
        let transmitting = Element::plugin("bsdf", "principledthin")
            .containing(rgb("base_color", part(through, weight)))
            .containing(float("diff_trans", 2.0));
        self.blend(&ValueModel::Value(weight), reflecting, transmitting)
    }

    fn metal(&mut self, reflectance: &ColourModel<String>, roughness: &ValueModel<String>) -> Element {
        let is_polished = matches!(roughness, ValueModel::Value(roughness) if roughness * roughness < MIN_ALPHA);
        if is_polished && *reflectance == ColourModel::Colour([1.0; 3]) {
            return mirror([1.0; 3]);
        }
        self.differ(
            "`principled`",
            "its facets shade light that comes and light that goes independently, and light that several facets \
             reflect is lost",
        );
        Element::plugin("bsdf", "principled")
            .containing(self.colour("base_color", reflectance))
            .containing(self.value("roughness", roughness))
            .containing(float("metallic", 1.0))
    }

    /// The base and its coat, without metal.
    fn coated(&mut self, coated: &Coated<'_>) -> Element {
        let Coated { colour, roughness, coat, coat_colour, coat_strength } = *coated;
        if *coat_strength == ValueModel::Value(0.0) {
            return self.diffuse(colour);
        }
        if coat >= COATS.end {
            let metal = self.metal(coat_colour, roughness);
            let base = self.diffuse(colour);
            return self.blend(coat_strength, base, metal);
        }
        if coat < COATS.start {
            self.differ("`diffuse`", "its coat reflects nothing");
            return self.diffuse(colour);
        }
        self.differ("`principled`", "its base is Disney's, dimmed by 6 % so that both reflect about as much light");
        if *coat_colour != ColourModel::Colour([1.0; 3]) {
            self.differ("`principled`", "its coat has no colour");
        }
        // What dims the base dims the coat, too.
        let root = (coat / (1.0 - DIMMED)).sqrt();
        let plain = Element::plugin("bsdf", "principled")
            .containing(self.colour("base_color", colour))
            .containing(self.value("roughness", roughness))
            .containing(float("eta", (1.0 + root) / (1.0 - root)));
        let black = diffuse(rgb("reflectance", [0.0; 3]));
        let dimmed = self.blend(&ValueModel::Value(DIMMED), plain, black);
        match coat_strength {
            ValueModel::Value(1.0) => dimmed,
            strength => {
                let base = self.diffuse(colour);
                self.blend(strength, base, dimmed)
            }
        }
    }

    /// The first material where `weight` is 0, the second where it is 1.
    fn blend(&mut self, weight: &ValueModel<String>, first: Element, second: Element) -> Element {
        Element::plugin("bsdf", "blendbsdf")
            .containing(self.value("weight", weight))
            .containing(first)
            .containing(second)
    }

    pub(super) fn colour(&mut self, name: &str, colour: &ColourModel<String>) -> Element {
        match colour {
            ColourModel::Colour(colour) => rgb(name, *colour),
            ColourModel::Texture(texture) => self.texture(name, texture, false),
        }
    }

    fn value(&mut self, name: &str, value: &ValueModel<String>) -> Element {
        match value {
            ValueModel::Value(value) => float(name, *value),
            ValueModel::Texture(texture) => self.texture(name, texture, true),
        }
    }

    /// A texture, which is written once.
    fn texture(&mut self, name: &str, model: &TextureModel<String>, is_data: bool) -> Element {
        if model.wrap[0] != model.wrap[1] {
            self.differ("one wrap mode", "its pictures go on along v as along u");
        }
        let texture = SharedTexture { model: model.clone(), is_data };
        let known = self.textures.iter().position(|other| *other == texture);
        let number = known.unwrap_or_else(|| {
            self.textures.push(texture);
            self.textures.len() - 1
        });
        Element::new("ref").with("name", name).with("id", &texture_id(number))
    }
}

fn texture_id(number: usize) -> String {
    format!("texture-{number:04}")
}

/// A texture, of which materials know the number.
pub(super) fn bitmap(number: usize, SharedTexture { model, is_data }: &SharedTexture) -> Element {
    let wrap = match model.wrap[0] {
        Wrap::Repeat => "repeat",
        Wrap::Mirror => "mirror",
        Wrap::Clamp => "clamp",
    };
    let filter = match model.filter {
        Filter::Linear => "bilinear",
        Filter::Nearest => "nearest",
    };
    let mut bitmap = Element::plugin("texture", "bitmap")
        .with("id", &texture_id(number))
        .containing(Element::value("string", "filename", &model.file))
        .containing(Element::value("string", "filter_type", filter))
        .containing(Element::value("string", "wrap_mode", wrap));
    if *is_data {
        bitmap.add(Element::value("boolean", "raw", true));
    }
    let [[a, b, c], [d, e, f]] = model.transform;
    if model.transform != [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        // Of a transformation in space, of which z is left out.
        let rows = format!("{a} {b} 0 {c} {d} {e} 0 {f} 0 0 1 0 0 0 0 1");
        let matrix = Element::new("matrix").with("value", &rows);
        bitmap.add(Element::new("transform").with("name", "to_uv").containing(matrix));
    }
    bitmap
}

pub(super) fn diffuse(reflectance: Element) -> Element {
    Element::plugin("bsdf", "diffuse").containing(reflectance)
}

pub(super) fn two_sided(bsdf: Element) -> Element {
    Element::plugin("bsdf", "twosided").containing(bsdf)
}

pub(super) fn dielectric(index_of_refraction: f64) -> Element {
    refracting("dielectric", index_of_refraction)
}

fn refracting(kind: &str, index_of_refraction: f64) -> Element {
    Element::plugin("bsdf", kind).containing(float("int_ior", index_of_refraction)).containing(float("ext_ior", 1.0))
}

fn mirror(reflectance: Triple) -> Element {
    Element::plugin("bsdf", "conductor")
        .containing(Element::value("string", "material", "none"))
        .containing(rgb("specular_reflectance", reflectance))
}

fn ggx() -> Element {
    Element::value("string", "distribution", "ggx")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layer_that_scatters_to_both_sides_keeps_its_fractions() {
        let [reflectance, transmittance] = [[0.25, 0.125, 0.0], [0.125, 0.25, 0.0]].map(ColourModel::Colour);
        let model = SurfaceModel::DiffuseTransmission { reflectance, transmittance };
        let cover = CoverModel { opacity: Some(ValueModel::Value(0.75)), normals: None };
        let mut textures = Vec::new();
        let mut surfaces = Surfaces::new(&mut textures);
        let text = surfaces.covered(&model, &cover).text();
        let expected = [
            "\"mask\"",
            "\"opacity\" value=\"0.75\"",
            "\"blendbsdf\"",
            "\"weight\" value=\"0.5\"",
            "\"reflectance\" value=\"0.5, 0.25, 0\"",
            "\"base_color\" value=\"0.25, 0.5, 0\"",
            "\"diff_trans\" value=\"2\"",
        ];
        let places: Vec<Option<usize>> = expected.iter().map(|part| text.find(part)).collect();
        assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{places:?} of {expected:?} in\n{text}");
        assert!(surfaces.differences.is_empty(), "{:?}", surfaces.differences);
    }
}
