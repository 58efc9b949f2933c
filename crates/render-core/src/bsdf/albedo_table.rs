//! The directional albedo of microfacets that reflect all light, and the part of it that Schlick's Fresnel term weighs.
//!
//! Light that a facet reflects onto another facet is missing where single facets scatter. The albedo says how much that
//! is, so that `glossy` adds it (Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks").
//!
//! The values are a file, so that they are the same on every machine. A test computes them.

use std::sync::LazyLock;

/// Entries along the cosine, whose square root is evenly spaced.
const COSINES: usize = 64;

/// Entries along the roughness, the square root of alpha, which is evenly spaced.
const ROUGHNESSES: usize = 64;

/// For each roughness and each cosine two numbers of 32 bits: those of an [`Albedo`].
static FILE: &[u8; 8 * COSINES * ROUGHNESSES] = include_bytes!("albedo_table.bin");

static TABLE: LazyLock<AlbedoTable> = LazyLock::new(AlbedoTable::read);

/// What microfacets reflect of the light from one direction, or of the light from all directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Albedo {
    /// E: the part that a surface reflects whose facets reflect all light.
    pub(super) total: f64,
    /// The same with each facet reflecting `(1 - cos)^5`: Schlick's weight.
    pub(super) grazing: f64,
}

impl Albedo {
    fn blend(self, other: Self, weight: f64) -> Self {
        Self {
            total: self.total + (other.total - self.total) * weight,
            grazing: self.grazing + (other.grazing - self.grazing) * weight,
        }
    }
}

struct AlbedoTable {
    /// By roughness, then by cosine.
    directional: Vec<Albedo>,
    /// By roughness: the average over all directions, weighted by their cosines.
    average: Vec<Albedo>,
}

impl AlbedoTable {
    fn read() -> Self {
        let (values, _) = FILE.as_chunks::<4>();
        let (pairs, _) = values.as_chunks::<2>();
        let number = |bytes: [u8; 4]| f64::from(f32::from_le_bytes(bytes));
        let entry = |pair: &[[u8; 4]; 2]| Albedo { total: number(pair[0]), grazing: number(pair[1]) };
        let directional: Vec<Albedo> = pairs.iter().map(entry).collect();
        let average = directional.chunks_exact(COSINES).map(average).collect();
        Self { directional, average }
    }
}

/// `2 int E(mu) mu dmu`, exact for the interpolation between the entries of a row.
fn average(row: &[Albedo]) -> Albedo {
    // With mu = x^2 this is 4 int E(x) x^3 dx, and E is linear in x between entries.
    const STEP: f64 = 1.0 / (COSINES - 1) as f64;
    let power = |x: f64, exponent: i32| (0..exponent).fold(1.0, |product, _| product * x);
    let mut sum = Albedo::default();
    for (index, pair) in row.windows(2).enumerate() {
        let [low, high] = [index as f64 * STEP, (index + 1) as f64 * STEP];
        // Integrals of x^3 and of x^3 times the part of the way from low to high.
        let whole = (power(high, 4) - power(low, 4)) / 4.0;
        let rising = ((power(high, 5) - power(low, 5)) / 5.0 - low * whole) / STEP;
        sum.total += 4.0 * (pair[0].total * (whole - rising) + pair[1].total * rising);
        sum.grazing += 4.0 * (pair[0].grazing * (whole - rising) + pair[1].grazing * rising);
    }
    sum
}

/// The albedos of one roughness.
#[derive(Clone, Copy, Debug)]
pub(super) struct AlbedoRow {
    row: usize,
    weight: f64,
    /// The average over all directions, weighted by their cosines.
    pub(super) average: Albedo,
}

impl AlbedoRow {
    /// The albedos of microfacets of a width.
    pub(super) fn new(alpha: f64) -> Self {
        let (row, weight) = place(alpha, ROUGHNESSES);
        let average = TABLE.average[row].blend(TABLE.average[row + 1], weight);
        Self { row, weight, average }
    }

    /// The albedo for light from a direction with this cosine to the normal.
    pub(super) fn at(self, cosine: f64) -> Albedo {
        let (column, weight) = place(cosine, COSINES);
        let of_row = |row: usize| {
            let start = row * COSINES + column;
            TABLE.directional[start].blend(TABLE.directional[start + 1], weight)
        };
        of_row(self.row).blend(of_row(self.row + 1), self.weight)
    }
}

/// The entry before the square root of a number from 0 to 1, and how far it is on the way to the next one.
fn place(number: f64, entries: usize) -> (usize, f64) {
    let scaled = number.clamp(0.0, 1.0).sqrt() * (entries - 1) as f64;
    let index = (scaled as usize).min(entries - 2);
    (index, scaled - index as f64)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::{DVec2, DVec3};
    use rayon::prelude::*;

    use super::super::fresnel::{reflect, schlick_weight};
    use super::super::microfacet::Ggx;
    use super::*;

    /// The smallest cosine of an entry; at 0 there is nothing to integrate.
    const SMALLEST: f64 = 1e-7;

    /// The albedo by a rule of `resolution^2` points over the visible facets.
    fn integrated(cosine: f64, alpha: f64, resolution: u32) -> Albedo {
        if alpha == 0.0 {
            return Albedo { total: 1.0, grazing: schlick_weight(cosine) };
        }
        let (cosine, ggx) = (cosine.max(SMALLEST), Ggx { alpha });
        let view = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let mut sum = Albedo::default();
        let middle = |index: u32| (f64::from(index) + 0.5) / f64::from(resolution);
        for (i, j) in (0..resolution).flat_map(|i| (0..resolution).map(move |j| (i, j))) {
            // Denser where few facets are, which graze the surface. Both halves of the circle are alike.
            let first = 1.0 - (1.0 - middle(i)) * (1.0 - middle(i));
            let density = 2.0 * (1.0 - middle(i));
            let facet = ggx.sample_visible(view, DVec2::new(first, 0.5 * middle(j)));
            let light = -reflect(view, facet);
            if light.z > 0.0 {
                // G2 over G1.
                let weight = 4.0 * light.z * ggx.visibility(view, light) / ggx.masking_over_cosine(view) * density;
                sum.total += weight;
                sum.grazing += weight * schlick_weight(view.dot(facet));
            }
        }
        let count = f64::from(resolution * resolution);
        Albedo { total: sum.total / count, grazing: sum.grazing / count }
    }

    fn entry(index: usize, entries: usize) -> f64 {
        let root = index as f64 / (entries - 1) as f64;
        root * root
    }

    #[test]
    fn the_file_has_the_albedos_of_the_microfacets() {
        if std::env::var_os("UPDATE_ALBEDO_TABLE").is_some() {
            let bytes: Vec<u8> = (0..COSINES * ROUGHNESSES)
                .into_par_iter()
                .flat_map_iter(|index| {
                    let (row, column) = (index / COSINES, index % COSINES);
                    let Albedo { total, grazing } = integrated(entry(column, COSINES), entry(row, ROUGHNESSES), 400);
                    [total, grazing].into_iter().flat_map(|number| (number as f32).to_le_bytes())
                })
                .collect();
            std::fs::write(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/bsdf/albedo_table.bin"), bytes).unwrap();
            return;
        }
        let mut largest: f64 = 0.0;
        for row in (1..ROUGHNESSES).step_by(7) {
            for column in (0..COSINES).step_by(9) {
                let expected = integrated(entry(column, COSINES), entry(row, ROUGHNESSES), 101);
                let found = TABLE.directional[row * COSINES + column];
                let difference = [found.total - expected.total, found.grazing - expected.grazing];
                largest = difference.iter().fold(largest, |largest, difference| largest.max(difference.abs()));
            }
        }
        println!("largest difference of an entry: {largest:.1e}");
        assert!(largest < 2e-4);
    }

    #[test]
    fn between_entries_the_albedo_is_right_to_a_thousandth() {
        let mut largest: f64 = 0.0;
        for alpha in [0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 0.95] {
            for cosine in [0.03, 0.05, 0.11, 0.3, 0.6, 0.97] {
                let (expected, found) = (integrated(cosine, alpha, 128), AlbedoRow::new(alpha).at(cosine));
                largest = largest.max((found.total - expected.total).abs());
                largest = largest.max((found.grazing - expected.grazing).abs());
            }
        }
        println!("largest difference between entries: {largest:.1e}");
        assert!(largest < 1e-3);
    }

    #[test]
    fn averages_are_those_that_are_known() {
        // E_avg at alpha 0.25, 0.5 and 1, computed from the same G elsewhere.
        for (alpha, expected) in [(0.25, 0.882), (0.5, 0.700), (1.0, 0.41)] {
            let average = AlbedoRow::new(alpha).average;
            assert!((average.total - expected).abs() < 0.003, "{alpha}: {average:?}");
        }
        // Of a mirror: all light, and int 2 mu (1 - mu)^5 = 1/21.
        let mirror = AlbedoRow::new(0.0).average;
        assert!((mirror.total - 1.0).abs() < 1e-6 && (mirror.grazing - 1.0 / 21.0).abs() < 1e-4, "{mirror:?}");
        let row = AlbedoRow::new(0.3);
        let by_sum: f64 =
            (0..4000).map(|k| (f64::from(k) + 0.5) / 4000.0).map(|mu| row.at(mu).total * mu / 2000.0).sum();
        assert!((by_sum - row.average.total).abs() < 1e-6);
    }
}
