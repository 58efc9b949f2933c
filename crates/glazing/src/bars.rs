//! Iron bars that carry the weight of the glass. They are on the inside, at positive z.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{GlazingError, check, join};
use crate::polygon;

/// Iron bars on the inside of the glass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Bars {
    /// No bars.
    None,
    /// Level bars to which the panels are tied.
    Saddle(SaddleBars),
    /// A grid of flat bars that carries the panels.
    Ferramenta(Ferramenta),
}

/// Level bars to which the panels are tied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SaddleBars {
    /// Distance between bars, metres; 0.05 to 10. It is adjusted to a whole number of equal distances.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub spacing: f64,
    /// Thickness of a bar, metres; 0.003 to 0.1.
    #[schemars(range(min = 0.003, max = 0.1))]
    pub diameter: f64,
    /// Section of a bar.
    pub section: BarSection,
}

/// Section of a bar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BarSection {
    /// A circle.
    #[default]
    Round,
    /// A square.
    Square,
}

/// A grid of flat bars that carries the panels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ferramenta {
    /// Distances between upright bars and between level bars, metres; 0.05 to 10. They are adjusted to whole numbers of
    /// equal distances.
    #[schemars(inner(range(min = 0.05, max = 10.0)))]
    pub spacing: [f64; 2],
    /// Width of a bar, seen from the front, metres; 0.003 to 0.2.
    #[schemars(range(min = 0.003, max = 0.2))]
    pub width: f64,
    /// Depth of a bar across the glass, metres; 0.003 to 0.2.
    #[schemars(range(min = 0.003, max = 0.2))]
    pub depth: f64,
}

impl Default for Bars {
    fn default() -> Self {
        Self::Saddle(SaddleBars::default())
    }
}

impl Default for SaddleBars {
    fn default() -> Self {
        Self { spacing: 0.38, diameter: 0.012, section: BarSection::Round }
    }
}

impl Default for Ferramenta {
    fn default() -> Self {
        Self { spacing: [0.6, 0.6], width: 0.03, depth: 0.01 }
    }
}

/// A straight bar on the inside of the glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    /// Both ends of its middle line, metres.
    pub ends: [DVec2; 2],
    /// Width, seen from the front, metres.
    pub width: f64,
    /// Depth across the glass, metres.
    pub depth: f64,
    /// Section.
    pub section: BarSection,
    /// Distance of its nearest side from the middle of the glass, metres.
    pub offset: f64,
}

/// Bars reach this far into the stone, metres.
const REACH: f64 = 0.02;

/// Most bars of a window in one direction.
const MAX_BARS: f64 = 1000.0;

impl Bars {
    /// Checks the settings.
    pub(crate) fn validate(&self, path: &str) -> Result<(), GlazingError> {
        match self {
            Self::None => Ok(()),
            Self::Saddle(saddle) => {
                let path = join(path, "saddle");
                check(&path, "spacing", saddle.spacing, 0.05..=10.0, "metres")?;
                check(&path, "diameter", saddle.diameter, 0.003..=0.1, "metres")
            }
            Self::Ferramenta(grid) => {
                let path = join(path, "ferramenta");
                for (index, spacing) in grid.spacing.into_iter().enumerate() {
                    check(&path, &format!("spacing[{index}]"), spacing, 0.05..=10.0, "metres")?;
                }
                check(&path, "width", grid.width, 0.003..=0.2, "metres")?;
                check(&path, "depth", grid.depth, 0.003..=0.2, "metres")
            }
        }
    }

    /// The bars across the lights of an opening. `offset` is the distance of the lead's face from the middle of the
    /// glass.
    pub(crate) fn place(&self, opening: &[DVec2], lights: &[Vec<DVec2>], offset: f64) -> Vec<Bar> {
        match self {
            Self::None => Vec::new(),
            Self::Saddle(SaddleBars { spacing, diameter, section }) => {
                let bar = Bar { ends: [DVec2::ZERO; 2], width: *diameter, depth: *diameter, section: *section, offset };
                across(opening, lights, DVec2::X, *spacing, bar)
            }
            Self::Ferramenta(Ferramenta { spacing, width, depth }) => {
                let section = BarSection::Square;
                let bar = Bar { ends: [DVec2::ZERO; 2], width: *width, depth: *depth, section, offset };
                let mut bars = across(opening, lights, DVec2::Y, spacing[0], bar);
                bars.extend(across(opening, lights, DVec2::X, spacing[1], bar));
                bars
            }
        }
    }
}

/// Bars along a direction at equal distances across the opening, cut to each light.
fn across(opening: &[DVec2], lights: &[Vec<DVec2>], along: DVec2, spacing: f64, bar: Bar) -> Vec<Bar> {
    let [low, high] = polygon::bounds(opening);
    let apart = DVec2::new(along.y, along.x);
    let extent = (high - low).dot(apart);
    let spaces = (extent / spacing).round().clamp(1.0, MAX_BARS) as u32;
    let mut bars = Vec::new();
    for index in 1..spaces {
        let through = low + apart * (extent * f64::from(index) / f64::from(spaces));
        for light in lights {
            for span in polygon::crossings(light, through, along).chunks_exact(2) {
                let ends = [span[0] - REACH, span[1] + REACH].map(|part| through + along * part);
                bars.push(Bar { ends, ..bar });
            }
        }
    }
    bars
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saddle_bars_cross_each_light_at_equal_distances() {
        let light =
            |left: f64| [[left, 0.0], [left + 1.0, 0.0], [left + 1.0, 2.0], [left, 2.0]].map(DVec2::from).to_vec();
        let opening = [[0.0, 0.0], [2.5, 0.0], [2.5, 2.0], [0.0, 2.0]].map(DVec2::from);
        let bars = Bars::default().place(&opening, &[light(0.0), light(1.5)], 0.004);
        assert_eq!(bars.len(), 8);
        assert!(bars.iter().all(|bar| (bar.ends[0].distance(bar.ends[1]) - 1.04).abs() < 1e-12));
        assert!((bars[0].ends[0].y - 0.4).abs() < 1e-12);
    }
}
