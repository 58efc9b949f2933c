//! The layers of an image, and the channels that hold them in a file.

pub(super) const RGB: [&str; 3] = ["R", "G", "B"];
pub(super) const STANDARD_ERROR: [&str; 3] = ["stderr.R", "stderr.G", "stderr.B"];
pub(super) const CAUSTIC: [&str; 3] = ["caustic.R", "caustic.G", "caustic.B"];
pub(super) const SAMPLES: &str = "samples";
pub(super) const ALBEDO: [&str; 3] = ["albedo.R", "albedo.G", "albedo.B"];
pub(super) const NORMAL: [&str; 3] = ["normal.X", "normal.Y", "normal.Z"];
pub(super) const DEPTH: &str = "depth.Z";
pub(super) const HALF_A: [&str; 3] = ["half_a.R", "half_a.G", "half_a.B"];
pub(super) const HALF_B: [&str; 3] = ["half_b.R", "half_b.G", "half_b.B"];

/// The layers of an image, one entry for each pixel in rows from the top left. All values are finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageLayers {
    /// Mean radiance of the samples, W/(m2 sr); zero where there is none.
    pub mean: Vec<[f32; 3]>,
    /// Standard error of the mean, `sqrt(M / (n (n - 1)))` with the second moment M of n block means. Zero at pixels
    /// of fewer than two blocks, for which it is not known; absent when that is all of them.
    pub standard_error: Option<Vec<[f32; 3]>>,
    /// The part of the mean that is caustic: light whose last specular vertices before a light are of glass or water.
    /// Absent where the scene has neither.
    pub caustic: Option<Vec<[f32; 3]>>,
    /// Samples.
    pub samples: Option<Vec<u32>>,
    /// Mean diffuse reflectance of what camera rays meet first.
    pub albedo: Option<Vec<[f32; 3]>>,
    /// Mean normal in world space of what camera rays meet first.
    pub normal: Option<Vec<[f32; 3]>>,
    /// Mean distance to what camera rays meet first, metres.
    pub depth: Option<Vec<f32>>,
    /// Means of two disjoint, independent halves of the samples.
    pub halves: Option<[Vec<[f32; 3]>; 2]>,
}
