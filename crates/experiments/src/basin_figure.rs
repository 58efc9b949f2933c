//! The picture of convergence basins with axes and the paths, as SVG.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use clerestory_film::{Exposure, FrameImage, PreviewSettings, ToneCurve, encode_png};
use clerestory_render_core::math::Rect;
use glam::DVec2;

use crate::error::ExperimentError;
use crate::text::escaped;

/// Colours of the paths, in linear light, by number; they come again when there are more paths.
pub(crate) const COLOURS: [[f32; 3]; 12] = [
    [0.80, 0.03, 0.03],
    [0.03, 0.12, 0.80],
    [0.03, 0.50, 0.05],
    [0.90, 0.50, 0.01],
    [0.35, 0.05, 0.55],
    [0.02, 0.55, 0.65],
    [0.80, 0.12, 0.45],
    [0.40, 0.60, 0.05],
    [0.30, 0.12, 0.04],
    [0.12, 0.35, 0.90],
    [0.90, 0.75, 0.25],
    [0.20, 0.75, 0.45],
];

/// What converges to something that is no path of light.
pub(crate) const OTHER: [f32; 3] = [0.30, 0.30, 0.30];

/// What does not converge.
pub(crate) const NOWHERE: [f32; 3] = [0.0, 0.0, 0.0];

/// Pixels of the picture in the figure, and of the margins left, right, above and below it.
const EDGE: f64 = 420.0;
const MARGIN: f64 = 60.0;

/// How basins look.
pub(crate) const LOOK: PreviewSettings = PreviewSettings { exposure: Exposure::Stops(0.0), curve: ToneCurve::Srgb };

/// A picture of basins over a part of a pane.
pub(crate) struct BasinFigure<'a> {
    pub(crate) title: &'a str,
    pub(crate) image: &'a FrameImage,
    /// The part, in the pane's tangential coordinates, metres.
    pub(crate) part: Rect,
    /// Where the paths cross the near face.
    pub(crate) paths: &'a [DVec2],
}

impl BasinFigure<'_> {
    /// The figure as an SVG element.
    pub(crate) fn svg(&self) -> Result<String, ExperimentError> {
        let png = STANDARD.encode(encode_png(self.image, &LOOK).map_err(ExperimentError::Preview)?);
        let size = EDGE + 2.0 * MARGIN;
        let extent = self.part.max - self.part.min;
        let place = |point: DVec2| {
            let relative = (point - self.part.min) / extent;
            (MARGIN + relative.x * EDGE, MARGIN + (1.0 - relative.y) * EDGE)
        };
        let is_shown = |point: &&DVec2| point.cmpge(self.part.min).all() && point.cmple(self.part.max).all();
        let marks: String = self
            .paths
            .iter()
            .filter(is_shown)
            .map(|point| {
                let (x, y) = place(*point);
                format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"white\" stroke=\"black\"/>\n")
            })
            .collect();
        let millimetres = |metres: f64| format!("{:.1}", metres * 1e3);
        let (bottom, middle) = (MARGIN + EDGE, MARGIN + 0.5 * EDGE);
        let [left, right] = [self.part.min.x, self.part.max.x].map(millimetres);
        let [low, high] = [self.part.min.y, self.part.max.y].map(millimetres);
        Ok(format!(
            "<svg width=\"{size}\" height=\"{size}\" viewBox=\"0 0 {size} {size}\" \
             xmlns=\"http://www.w3.org/2000/svg\" \
             font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"{size}\" height=\"{size}\" fill=\"white\"/>\n\
             <text x=\"{middle}\" y=\"30\" text-anchor=\"middle\" font-size=\"17\">{title}</text>\n\
             <image x=\"{MARGIN}\" y=\"{MARGIN}\" width=\"{EDGE}\" height=\"{EDGE}\" preserveAspectRatio=\"none\" \
             image-rendering=\"pixelated\" href=\"data:image/png;base64,{png}\"/>\n{marks}\
             <rect x=\"{MARGIN}\" y=\"{MARGIN}\" width=\"{EDGE}\" height=\"{EDGE}\" fill=\"none\" stroke=\"black\"/>\n\
             <text x=\"{MARGIN}\" y=\"{below}\" text-anchor=\"middle\">{left}</text>\n\
             <text x=\"{bottom}\" y=\"{below}\" text-anchor=\"middle\">{right}</text>\n\
             <text x=\"{middle}\" y=\"{below}\" text-anchor=\"middle\">x in the pane, mm</text>\n\
             <text x=\"{beside}\" y=\"{bottom}\" text-anchor=\"end\">{low}</text>\n\
             <text x=\"{beside}\" y=\"{MARGIN}\" text-anchor=\"end\">{high}</text>\n\
             <text transform=\"translate(20 {middle}) rotate(-90)\" text-anchor=\"middle\">y in the pane, mm</text>\n\
             </svg>\n",
            title = escaped(self.title),
            below = bottom + 22.0,
            beside = MARGIN - 6.0,
        ))
    }
}
