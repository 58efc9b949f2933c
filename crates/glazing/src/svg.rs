//! A plan as a drawing: the elevation of the window, as SVG.

use std::collections::BTreeMap;
use std::fmt::Write;

use glam::DVec2;

use crate::plan::WindowPlan;
use crate::polygon;

/// How a plan is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawingStyle {
    /// Colours by kinds of glass, as CSS has them. Kinds without one are drawn in a light grey green.
    pub colours: BTreeMap<String, String>,
    /// Size of a metre on the drawing, pixels.
    pub pixels_per_metre: f64,
    /// Whether there is a scale bar below the window.
    pub has_scale_bar: bool,
    /// Whether iron bars are drawn over the glass.
    pub has_bars: bool,
}

impl Default for DrawingStyle {
    fn default() -> Self {
        Self { colours: BTreeMap::new(), pixels_per_metre: 400.0, has_scale_bar: true, has_bars: true }
    }
}

/// Glass without a colour.
const GLASS: &str = "#d9e4dd";
const LEAD: &str = "#3a3d40";
const SOLDER: &str = "#5a5e62";
const STONE: &str = "#d8cdb8";
const OUTLINE: &str = "#4f4636";
const IRON: &str = "#1d1a18";

/// Space around the window, metres.
const MARGIN: f64 = 0.08;

/// Space for the scale bar, metres.
const SCALE_BAR: f64 = 0.16;

/// Draws the elevation of a window, seen from inside of the building.
pub fn svg(plan: &WindowPlan, style: &DrawingStyle) -> String {
    let [low, high] = polygon::bounds(&plan.outline);
    let width = high.x - low.x + 2.0 * MARGIN;
    let below = if style.has_scale_bar { SCALE_BAR } else { 0.0 };
    let height = high.y - low.y + 2.0 * MARGIN + below;
    let mut text = String::new();
    let pixels = [width, height].map(|extent| (extent * style.pixels_per_metre).ceil());
    // Units are millimetres.
    let _ = writeln!(
        text,
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{}" height="{}" viewBox="{:.2} {:.2} {:.2} {:.2}">"#,
        pixels[0],
        pixels[1],
        1000.0 * (low.x - MARGIN),
        -1000.0 * (high.y + MARGIN),
        1000.0 * width,
        1000.0 * height
    );
    let _ = writeln!(text, r#"<rect x="-50%" y="-100%" width="200%" height="300%" fill="white"/>"#);
    if let Some(stone) = &plan.stone {
        let holes = stone.holes.iter().map(|hole| closed(&hole.outline));
        let faces = stone.holes.iter().map(|hole| closed(&hole.face_outline));
        let slab: String = [closed(&stone.outline)].into_iter().chain(holes).collect();
        let _ = writeln!(
            text,
            r#"<path d="{slab}" fill="{STONE}" fill-rule="evenodd" stroke="{OUTLINE}" stroke-width="2"/>"#
        );
        let arrises: String = faces.collect();
        let _ = writeln!(text, r#"<path d="{arrises}" fill="none" stroke="{OUTLINE}" stroke-width="1"/>"#);
    }
    let _ = writeln!(text, r#"<g stroke="none">"#);
    for piece in &plan.pieces {
        let colour = style.colours.get(&piece.glass).map_or(GLASS, String::as_str);
        let _ = writeln!(
            text,
            r#"<path d="{}" fill="{}"><title>{} ({})</title></path>"#,
            closed(&piece.outline),
            escaped(colour),
            piece.place,
            escaped(&piece.glass)
        );
    }
    let _ = writeln!(text, "</g>");
    if plan.lead.is_none() {
        let edges: String = plan.pieces.iter().map(|piece| closed(&piece.outline)).collect();
        let _ = writeln!(text, r#"<path d="{edges}" fill="none" stroke="{OUTLINE}" stroke-width="0.6"/>"#);
    }
    // What lies on or in the stone cannot be seen.
    let lights: String = plan.lights.iter().map(|light| closed(light)).collect();
    let _ = writeln!(text, r#"<clipPath id="lights"><path d="{lights}"/></clipPath>"#);
    add_lead(&mut text, plan);
    if style.has_bars {
        add_bars(&mut text, plan);
    }
    if plan.stone.is_none() {
        let outline = closed(&plan.outline);
        let _ = writeln!(text, r#"<path d="{outline}" fill="none" stroke="{OUTLINE}" stroke-width="2"/>"#);
    }
    if style.has_scale_bar {
        add_scale_bar(&mut text, low - MARGIN, width);
    }
    text.push_str("</svg>\n");
    text
}

/// Cames in their width.
fn add_lead(text: &mut String, plan: &WindowPlan) {
    let _ = writeln!(text, r#"<g clip-path="url(#lights)">"#);
    for came in &plan.cames {
        let path = if came.is_closed { closed(&came.path) } else { line(&came.path) };
        let _ = writeln!(
            text,
            r#"<path d="{path}" fill="none" stroke="{LEAD}" stroke-width="{:.2}" stroke-linejoin="round"/>"#,
            1000.0 * came.flange_width
        );
    }
    for joint in &plan.joints {
        let DVec2 { x, y } = millimetres(joint.at);
        let radius = 1000.0 * joint.radius;
        let _ = writeln!(text, r#"<circle cx="{x:.2}" cy="{y:.2}" r="{radius:.2}" fill="{SOLDER}"/>"#);
    }
    let _ = writeln!(text, "</g>");
}

/// Bars in their width.
fn add_bars(text: &mut String, plan: &WindowPlan) {
    let _ = writeln!(text, r#"<g clip-path="url(#lights)">"#);
    for bar in &plan.bars {
        let path = line(&bar.ends);
        let width = 1000.0 * bar.width;
        let _ = writeln!(text, r#"<path d="{path}" stroke="{IRON}" stroke-width="{width:.2}" stroke-opacity="0.85"/>"#);
    }
    let _ = writeln!(text, "</g>");
}

/// A bar of a round length, with its length.
fn add_scale_bar(text: &mut String, low: DVec2, width: f64) {
    let lengths = [10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05];
    let length = lengths.into_iter().find(|&length| length <= 0.6 * width).unwrap_or(0.05);
    let DVec2 { x, y } = millimetres(low + DVec2::new(MARGIN, -0.06));
    for part in 0..4 {
        let fill = if part % 2 == 0 { OUTLINE } else { "white" };
        let step = 250.0 * length;
        let _ = writeln!(
            text,
            r#"<rect x="{:.2}" y="{y:.2}" width="{step:.2}" height="12" fill="{fill}" stroke="{OUTLINE}"/>"#,
            x + f64::from(part) * step
        );
    }
    let label = if length < 1.0 { format!("{:.0} cm", 100.0 * length) } else { format!("{length:.0} m") };
    let (x, y) = (x + 1000.0 * length + 12.0, y + 14.0);
    let _ = writeln!(
        text,
        r#"<text x="{x:.2}" y="{y:.2}" font-family="sans-serif" font-size="32" fill="{OUTLINE}">{label}</text>"#
    );
}

/// Window coordinates on the drawing, where y points down.
fn millimetres(point: DVec2) -> DVec2 {
    DVec2::new(1000.0 * point.x, -1000.0 * point.y)
}

/// A closed path.
fn closed(corners: &[DVec2]) -> String {
    line(corners) + "Z"
}

/// An open path.
fn line(corners: &[DVec2]) -> String {
    let mut path = String::new();
    for (index, &corner) in corners.iter().enumerate() {
        let DVec2 { x, y } = millimetres(corner);
        let command = if index == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{command}{x:.2} {y:.2}");
    }
    path
}

/// Text that means nothing to an XML reader.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Arch, Head, Opening, WindowDesign};

    #[test]
    fn a_drawing_has_every_piece_and_came_and_no_raw_names() {
        let mut plan =
            WindowDesign::new(Opening::Arch(Arch { width: 0.6, height: 1.4, head: Head::Round })).plan().unwrap();
        plan.pieces[0].glass = "<script>".to_owned();
        let drawing = svg(&plan, &DrawingStyle::default());
        assert_eq!(drawing.matches("<title>").count(), plan.pieces.len());
        assert_eq!(drawing.matches("stroke-linejoin").count(), plan.cames.len());
        assert!(!drawing.contains("<script>"));
        assert!(drawing.contains("20 cm") || drawing.contains("cm</text>"));
    }
}
