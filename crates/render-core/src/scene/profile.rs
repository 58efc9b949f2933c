//! Procedural profiles: what crown, cylinder-blown and hammered glass look like, as coefficients of the spline.
//!
//! Wavelengths and amplitudes are the author's to choose; the patterns are ours, after descriptions of how the glass
//! was made. `docs/scene-format.md` gives the formulas. All are smooth: sums of waves no shorter than a good part of
//! the stated wavelength, over a grid that resolves them. Random numbers come from a counter hash of the seed and the
//! face.

use std::f64::consts::TAU;

use glam::DVec2;

use super::description::ProfileDescription;
use super::random::Random;
use crate::geometry::Face;
use crate::texture::height_map::CoefficientGrid;

/// Most coefficients along an edge of a pane.
pub(super) const MAX_COEFFICIENTS_PER_AXIS: usize = 1024;

/// Fewest coefficients along an edge of a pane.
const MIN_COEFFICIENTS_PER_AXIS: usize = 8;

/// Coefficients for each wavelength (for a bump: for each standard deviation). Cylinder glass has waves down to 0.8 and
/// hammered glass down to 0.375 of the wavelength.
fn coefficients_per_wavelength(description: &ProfileDescription) -> f64 {
    match description {
        ProfileDescription::Flat | ProfileDescription::HeightMap { .. } | ProfileDescription::Crown { .. } => 12.0,
        ProfileDescription::Cylinder { .. } => 16.0,
        ProfileDescription::Hammered { .. } => 24.0,
        ProfileDescription::Bump { .. } => 8.0,
    }
}

/// The shortest wavelength (for a bump: standard deviation) that can be resolved along an edge of a pane, metres.
pub(super) fn shortest_wavelength(description: &ProfileDescription, edge: f64) -> f64 {
    edge * coefficients_per_wavelength(description) / MAX_COEFFICIENTS_PER_AXIS as f64
}

/// Columns and rows of a procedural profile on a pane of this size; `None` for a flat face and for a height map.
pub(super) fn procedural_grid(description: &ProfileDescription, size: DVec2) -> Option<[usize; 2]> {
    let wavelength = match *description {
        ProfileDescription::Flat | ProfileDescription::HeightMap { .. } => return None,
        ProfileDescription::Crown { wavelength, .. }
        | ProfileDescription::Cylinder { wavelength, .. }
        | ProfileDescription::Hammered { wavelength, .. } => wavelength,
        ProfileDescription::Bump { radius: [first, second], .. } => first.min(second),
    };
    let spacing = wavelength / coefficients_per_wavelength(description);
    let count = |extent: f64| {
        let wanted = (extent / spacing).ceil() as usize;
        wanted.clamp(MIN_COEFFICIENTS_PER_AXIS, MAX_COEFFICIENTS_PER_AXIS)
    };
    Some([count(size.x), count(size.y)])
}

/// The coefficients of a procedural profile for a face of a pane; `None` for a flat face and for a height map.
pub(super) fn procedural_coefficients(
    description: &ProfileDescription,
    face: Face,
    size: DVec2,
) -> Option<CoefficientGrid> {
    let grid = Grid::new(size, procedural_grid(description, size)?);
    let stream = match face {
        Face::Front => 0,
        Face::Back => 1,
    };
    let random = |seed: u64| Random::new(seed, stream);
    match *description {
        ProfileDescription::Flat | ProfileDescription::HeightMap { .. } => None,
        ProfileDescription::Crown { centre, wavelength, amplitude, seed } => {
            Some(crown(&grid, DVec2::from(centre), wavelength, amplitude, random(seed)))
        }
        ProfileDescription::Cylinder { axis, wavelength, amplitude, seed } => {
            Some(cylinder(&grid, axis.to_radians(), wavelength, amplitude, random(seed)))
        }
        ProfileDescription::Bump { centre, radius, rotation, amplitude } => {
            Some(bump(&grid, DVec2::from(centre), DVec2::from(radius), rotation.to_radians(), amplitude))
        }
        ProfileDescription::Hammered { wavelength, amplitude, seed } => {
            Some(hammered(&grid, wavelength, amplitude, random(seed)))
        }
    }
}

impl ProfileDescription {
    /// A bound on the distance of the face from its plane, metres. That of a measured face is in its file: it has 0.
    pub(super) fn reach(&self) -> f64 {
        // The largest sum of so many waves with a mean square of 1.
        let largest_noise = |waves: f64| (2.0 * waves).sqrt();
        match *self {
            Self::Flat | Self::HeightMap { .. } => 0.0,
            Self::Crown { amplitude, .. } => amplitude.abs() * (0.65 + 0.23 * largest_noise(12.0)),
            Self::Cylinder { amplitude, .. } => amplitude.abs() * (8_f64.sqrt() + 0.1 * 4_f64.sqrt()),
            Self::Bump { amplitude, .. } => amplitude.abs(),
            Self::Hammered { amplitude, .. } => {
                let height = largest_noise(24.0);
                amplitude.abs() * (height + 0.35 * (height * height - 1.0))
            }
        }
    }
}

/// Rings about a centre, slightly elliptical, warped and of varying strength.
fn crown(grid: &Grid, centre: DVec2, wavelength: f64, amplitude: f64, mut random: Random) -> CoefficientGrid {
    let phase = random.phase();
    let warp = grid.sum(&isotropic_noise(&mut random, 12, [3.0 * wavelength, 6.0 * wavelength]));
    let strength = grid.sum(&isotropic_noise(&mut random, 12, [4.0 * wavelength, 8.0 * wavelength]));
    grid.coefficients(|index, point| {
        let offset = point - centre;
        // Rounded at the centre, where rings of any radius would otherwise meet in a point.
        let radius = (1.06 * offset.x * offset.x + 0.94 * offset.y * offset.y + wavelength * wavelength / 16.0).sqrt();
        let rings = libm::cos(TAU * (radius / wavelength + 0.12 * warp[index]) + phase);
        amplitude * (0.65 + 0.23 * strength[index]) * rings
    })
}

/// Ripples along the axis, irregularly spaced, with a weak ripple across.
fn cylinder(grid: &Grid, axis: f64, wavelength: f64, amplitude: f64, mut random: Random) -> CoefficientGrid {
    let tilt = 4_f64.to_radians();
    let mut waves = Vec::new();
    for _ in 0..8 {
        let direction = axis + TAU / 4.0 + random.between(-tilt, tilt);
        let length = wavelength * random.between(0.8, 1.5);
        // Together as strong as one wave of the stated amplitude.
        waves.push(Wave::new(direction, length, random.phase(), amplitude / 8_f64.sqrt()));
    }
    for _ in 0..4 {
        let direction = axis + random.between(-tilt, tilt);
        let length = wavelength * random.between(2.0, 4.0);
        waves.push(Wave::new(direction, length, random.phase(), 0.1 * amplitude / 4_f64.sqrt()));
    }
    let heights = grid.sum(&waves);
    grid.coefficients(|index, _| heights[index])
}

/// One Gaussian.
fn bump(grid: &Grid, centre: DVec2, radius: DVec2, rotation: f64, amplitude: f64) -> CoefficientGrid {
    let (sine, cosine) = libm::sincos(rotation);
    grid.coefficients(|_, point| {
        let offset = point - centre;
        let along = DVec2::new(cosine * offset.x + sine * offset.y, cosine * offset.y - sine * offset.x) / radius;
        amplitude * libm::exp(-0.5 * along.length_squared())
    })
}

/// Dimples without a preferred direction, with tops sharper than their valleys.
fn hammered(grid: &Grid, wavelength: f64, amplitude: f64, mut random: Random) -> CoefficientGrid {
    let noise = grid.sum(&isotropic_noise(&mut random, 24, [0.75 * wavelength, 1.4 * wavelength]));
    grid.coefficients(|index, _| {
        let height = noise[index];
        amplitude * (height + 0.35 * (height * height - 1.0))
    })
}

/// Waves in all directions whose sum has a mean square of 1.
fn isotropic_noise(random: &mut Random, count: u32, [shortest, longest]: [f64; 2]) -> Vec<Wave> {
    let amplitude = (2.0 / f64::from(count)).sqrt();
    let wave = |_| {
        let direction = random.phase();
        let length = random.between(shortest, longest);
        Wave::new(direction, length, random.phase(), amplitude)
    };
    (0..count).map(wave).collect()
}

/// `amplitude * cos(k . p + phase)`.
struct Wave {
    k: DVec2,
    phase: f64,
    amplitude: f64,
}

impl Wave {
    fn new(direction: f64, length: f64, phase: f64, amplitude: f64) -> Self {
        let (sine, cosine) = libm::sincos(direction);
        Self { k: DVec2::new(cosine, sine) * (TAU / length), phase, amplitude }
    }
}

/// Where the coefficients of a face stand.
struct Grid {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Grid {
    /// A grid of these columns and rows over a pane.
    fn new(size: DVec2, [columns, rows]: [usize; 2]) -> Self {
        let axis = |count: usize, extent: f64| {
            (0..count).map(|index| ((index as f64 + 0.5) / count as f64 - 0.5) * extent).collect()
        };
        Self { x: axis(columns, size.x), y: axis(rows, size.y) }
    }

    /// The height at every place, from the index of the coefficient and the place.
    fn coefficients(&self, height: impl Fn(usize, DVec2) -> f64) -> CoefficientGrid {
        let columns = self.x.len();
        let coefficients = (self.y.iter().enumerate())
            .flat_map(|(row, &y)| (self.x.iter().enumerate()).map(move |(column, &x)| (row * columns + column, x, y)))
            .map(|(index, x, y)| height(index, DVec2::new(x, y)) as f32)
            .collect();
        CoefficientGrid { columns, rows: self.y.len(), coefficients }
    }

    /// The sum of waves at every place. A wave is a product of a function of x and one of y, so sines and cosines are
    /// needed only along the edges.
    fn sum(&self, waves: &[Wave]) -> Vec<f64> {
        let mut sum = vec![0.0; self.x.len() * self.y.len()];
        for wave in waves {
            let along_x: Vec<(f64, f64)> = self.x.iter().map(|x| libm::sincos(wave.k.x * x)).collect();
            for (row, y) in sum.chunks_exact_mut(self.x.len()).zip(&self.y) {
                let (sine_y, cosine_y) = libm::sincos(wave.k.y * y + wave.phase);
                for (height, (sine_x, cosine_x)) in row.iter_mut().zip(&along_x) {
                    *height += wave.amplitude * (cosine_x * cosine_y - sine_x * sine_y);
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: DVec2 = DVec2::new(0.3, 0.4);

    fn all() -> [ProfileDescription; 4] {
        let (wavelength, amplitude, seed) = (0.02, 2e-5, 3);
        [
            ProfileDescription::Crown { centre: [0.1, 0.25], wavelength, amplitude, seed },
            ProfileDescription::Cylinder { axis: 20.0, wavelength, amplitude, seed },
            ProfileDescription::Hammered { wavelength, amplitude, seed },
            ProfileDescription::Bump { centre: [0.02, -0.1], radius: [0.03, 0.05], rotation: 30.0, amplitude },
        ]
    }

    fn heights(profile: &ProfileDescription, face: Face) -> CoefficientGrid {
        procedural_coefficients(profile, face, SIZE).unwrap()
    }

    #[test]
    fn ripples_are_as_strong_as_asked_for() {
        let root_mean_square = |profile: &ProfileDescription| {
            let grid = heights(profile, Face::Front);
            let squares: f64 = grid.coefficients.iter().map(|&height| f64::from(height).powi(2)).sum();
            (squares / grid.coefficients.len() as f64).sqrt() / 2e-5
        };
        let [crown, cylinder, hammered, _] = all();
        // A cosine of amplitude 1 has 0.71; noise of unit variance plus its square has 1.12.
        assert!((0.35..0.8).contains(&root_mean_square(&crown)), "{}", root_mean_square(&crown));
        assert!((0.5..0.95).contains(&root_mean_square(&cylinder)), "{}", root_mean_square(&cylinder));
        assert!((0.8..1.4).contains(&root_mean_square(&hammered)), "{}", root_mean_square(&hammered));
    }

    #[test]
    fn neighbouring_coefficients_resolve_the_pattern() {
        for profile in all() {
            let grid = heights(&profile, Face::Front);
            let largest = grid.coefficients.iter().fold(0_f32, |largest, height| largest.max(height.abs()));
            let second_difference = |triple: &[f32]| (triple[0] - 2.0 * triple[1] + triple[2]).abs();
            let roughest = grid
                .coefficients
                .chunks_exact(grid.columns)
                .flat_map(|row| row.windows(3).map(second_difference))
                .fold(0_f32, f32::max);
            // A wave with n samples has second differences of (2 pi / n)^2 of its height: a quarter for n = 12.
            assert!(roughest < 0.5 * largest, "{profile:?}: {roughest} of {largest}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_face_and_other_seeds_and_faces_differ() {
        for profile in &all()[..3] {
            assert_eq!(heights(profile, Face::Front), heights(profile, Face::Front));
            assert_ne!(heights(profile, Face::Front), heights(profile, Face::Back));
        }
        let hammered = |seed| ProfileDescription::Hammered { wavelength: 0.02, amplitude: 1e-5, seed };
        assert_ne!(heights(&hammered(1), Face::Front), heights(&hammered(2), Face::Front));
    }

    #[test]
    fn no_face_reaches_farther_than_it_says() {
        for (profile, number) in all().iter().zip(0_u16..) {
            let largest =
                heights(profile, Face::Back).coefficients.iter().fold(0_f32, |most, height| most.max(height.abs()));
            let reach = profile.reach();
            assert!(f64::from(largest) <= reach && reach < 4e-3, "profile {number}: {largest} of {reach}");
        }
    }

    #[test]
    fn ripples_of_a_cylinder_run_along_its_axis() {
        let profile = ProfileDescription::Cylinder { axis: 90.0, wavelength: 0.02, amplitude: 1e-5, seed: 5 };
        let grid = heights(&profile, Face::Front);
        let mean_change = |pairs: &mut dyn Iterator<Item = (f32, f32)>| {
            let changes: Vec<f64> = pairs.map(|(a, b)| f64::from((a - b).abs())).collect();
            changes.iter().sum::<f64>() / changes.len() as f64
        };
        let rows: Vec<&[f32]> = grid.coefficients.chunks_exact(grid.columns).collect();
        let along_x = mean_change(&mut rows.iter().flat_map(|row| row.windows(2).map(|pair| (pair[0], pair[1]))));
        let along_y =
            mean_change(&mut rows.windows(2).flat_map(|pair| pair[0].iter().copied().zip(pair[1].iter().copied())));
        assert!(along_x > 5.0 * along_y, "{along_x} {along_y}");
    }

    #[test]
    fn a_bump_is_a_turned_gaussian() {
        let (centre, radius) = ([0.0, 0.0], [0.05, 0.02]);
        let profile = ProfileDescription::Bump { centre, radius, rotation: 90.0, amplitude: 1e-4 };
        let grid = heights(&profile, Face::Back);
        for (index, &height) in grid.coefficients.iter().enumerate() {
            let x = (((index % grid.columns) as f64 + 0.5) / grid.columns as f64 - 0.5) * SIZE.x;
            let y = (((index / grid.columns) as f64 + 0.5) / grid.rows as f64 - 0.5) * SIZE.y;
            let expected = 1e-4 * libm::exp(-0.5 * ((y / 0.05).powi(2) + (x / 0.02).powi(2)));
            assert!((f64::from(height) - expected).abs() < 1e-10);
        }
    }

    #[test]
    fn grids_stay_within_their_bounds() {
        let flat_bump = |radius: f64| ProfileDescription::Bump {
            centre: [0.0; 2],
            radius: [radius; 2],
            rotation: 0.0,
            amplitude: 1e-5,
        };
        let wide = heights(&flat_bump(1e6), Face::Front);
        assert_eq!((wide.columns, wide.rows), (8, 8));
        let shortest = shortest_wavelength(&flat_bump(1.0), SIZE.y);
        let narrow = heights(&flat_bump(shortest), Face::Front);
        assert_eq!((narrow.columns, narrow.rows), (768, 1024));
    }
}
