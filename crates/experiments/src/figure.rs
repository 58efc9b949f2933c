//! Figures: curves on logarithmic axes, as SVG.

use std::ops::Range;

use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::prelude::{
    ChartBuilder, Circle, Color, DrawingAreaErrorKind, IntoDrawingArea, IntoFont, LineSeries, PathElement, RGBColor,
    SVGBackend, SeriesLabelPosition, WHITE,
};

use crate::error::ExperimentError;

/// A curve.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    pub(crate) label: String,
    pub(crate) points: Vec<Point>,
    /// Number of its colour: the same variant has the same in all figures.
    pub(crate) colour: usize,
}

/// A point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Standard error of y; zero where it is not known.
    pub(crate) error: f64,
}

/// Curves under one caption. Both axes are logarithmic, so what is not positive is left out.
#[derive(Clone, Debug)]
pub(crate) struct Figure {
    pub(crate) title: String,
    /// What the axes are, with their units.
    pub(crate) axes: [&'static str; 2],
    pub(crate) curves: Vec<Curve>,
}

/// Width and height of a figure, in CSS pixels.
const SIZE: (u32, u32) = (620, 440);

/// Colours that differ under any kind of colour vision (Okabe and Ito 2008), and four more of other lightness.
const COLOURS: [RGBColor; 12] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
    RGBColor(140, 120, 0),
    RGBColor(150, 150, 150),
    RGBColor(60, 20, 130),
    RGBColor(120, 20, 50),
    RGBColor(0, 75, 50),
];

/// Space around the points, as a factor.
const MARGIN: f64 = 1.3;

/// Space for the legend to the right of the points: a part of their range on the logarithmic axis, and a least factor.
const LEGEND: (f64, f64) = (0.42, 1.5);

impl Figure {
    /// The figure as an SVG element; `None` without points.
    pub(crate) fn svg(&self) -> Result<Option<String>, ExperimentError> {
        let Some([x, y]) = self.ranges() else { return Ok(None) };
        let mut svg = String::new();
        self.draw(&mut svg, x, y).map_err(|error| ExperimentError::Figure(error.to_string()))?;
        Ok(Some(svg))
    }

    /// The points that a logarithmic axis can show.
    fn shown(curve: &Curve) -> impl Iterator<Item = &Point> {
        curve.points.iter().filter(|point| point.x > 0.0 && point.y > 0.0 && point.x.is_finite() && point.y.is_finite())
    }

    fn ranges(&self) -> Option<[Range<f64>; 2]> {
        let points: Vec<&Point> = self.curves.iter().flat_map(Self::shown).collect();
        let range = |values: Vec<f64>| {
            let least = values.iter().copied().reduce(f64::min)?;
            let most = values.iter().copied().reduce(f64::max)?;
            Some(least / MARGIN..most * MARGIN)
        };
        let x = range(points.iter().map(|point| point.x).collect())?;
        let x = x.start..x.end * (x.end / x.start).powf(LEGEND.0).max(LEGEND.1);
        let y = range(points.iter().map(|point| point.y).collect())?;
        Some([x, y])
    }

    fn draw(&self, svg: &mut String, x: Range<f64>, y: Range<f64>) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 17).into_font())
            .margin(10)
            .x_label_area_size(42)
            .y_label_area_size(72)
            .build_cartesian_2d(
                x.clone().log_scale().with_key_points(ticks(&x)),
                y.clone().log_scale().with_key_points(ticks(&y)),
            )?;
        let label = |value: &f64| tick(*value);
        chart
            .configure_mesh()
            .x_desc(self.axes[0])
            .y_desc(self.axes[1])
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .label_style(("sans-serif", 13))
            .bold_line_style(RGBColor(210, 210, 210))
            .draw()?;
        for curve in &self.curves {
            let colour = COLOURS[curve.colour % COLOURS.len()];
            let line = Self::shown(curve).map(|point| (point.x, point.y));
            chart
                .draw_series(LineSeries::new(line, colour.stroke_width(2)))?
                .label(&curve.label)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3)));
            chart.draw_series(Self::shown(curve).map(|point| Circle::new((point.x, point.y), 3, colour.filled())))?;
            let bars = Self::shown(curve).filter(|point| point.error > 0.0).map(|point| {
                let least = (point.y - point.error).max(y.start);
                PathElement::new([(point.x, least), (point.x, (point.y + point.error).min(y.end))], colour)
            });
            chart.draw_series(bars)?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(190, 190, 190))
            .label_font(("sans-serif", 13))
            .draw()?;
        drop(chart);
        area.present()
    }
}

/// Round numbers in a range, about as many as fit beside an axis.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let decades = (range.end / range.start).log10();
    let steps: &[f64] = match decades {
        ..0.7 => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        0.7..3.0 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let [first, last] = [range.start.log10().floor(), range.end.log10().ceil()].map(|exponent| exponent as i32);
    let in_decade = |exponent: i32| steps.iter().map(move |step| step * 10f64.powi(exponent));
    (first..=last).flat_map(in_decade).filter(|tick| range.contains(tick)).collect()
}

/// A number at an axis.
fn tick(value: f64) -> String {
    if (1e-2..1e5).contains(&value) {
        // Without the noise of the last bits.
        ((value * 1e6).round() / 1e6).to_string()
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_numbers_at_any_range() {
        assert_eq!(ticks(&(0.65..1.3)).len(), 5, "0.7, 0.8, 0.9, 1 and 1.2");
        assert_eq!(ticks(&(0.9..60.0)), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0]);
        assert_eq!(ticks(&(2e-6..3e-1)).len(), 5);
        assert_eq!([0.30000000000000004, 2000.0, 1e-4].map(tick), ["0.3", "2000", "1e-4"]);
    }

    #[test]
    fn a_figure_names_its_curves_and_axes_and_leaves_out_what_has_no_logarithm() {
        let point = |x, y| Point { x, y, error: 0.1 };
        let curve = Curve {
            label: "fnee <default>".to_owned(),
            points: vec![point(1.0, 1e-3), point(2.0, -1.0), point(4.0, f64::NAN), point(8.0, 1e-5)],
            colour: 0,
        };
        let figure = Figure { title: "crown".to_owned(), axes: ["time, s", "MSE"], curves: vec![curve] };
        let svg = figure.svg().unwrap().unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        for text in ["crown", "time, s", "MSE", "fnee &lt;default&gt;"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        assert_eq!(svg.matches("r=\"3\"").count(), 2, "two points can be shown: {svg}");
        let empty = Figure { title: String::new(), axes: ["", ""], curves: Vec::new() };
        assert_eq!(empty.svg().unwrap(), None);
    }
}
