//! A window pane: a slab between two height fields.
//!
//! In its own frame the glass fills `h1(x, y) <= z <= thickness + h2(x, y)` over the outline, a convex polygon. The
//! front face is towards -z, the back face towards +z. The side walls between them are the edge, which is opaque and
//! black: it sits in the lead or the frame.
//!
//! The height fields may be larger than the outline: a pane is cut from a sheet, and its frame is that of the sheet. So
//! panes of one sheet share its height fields, wherever they were cut and however they hang.
//!
//! The caller knows whether a ray is in the glass, and so on which side of a face it is. The module `crossing` rests on
//! this.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::crossing::{Crossing, Side, Start};
use super::height_field::{HeightField, JetBounds};
use super::outline::{Outline, prism};
use super::thickness::thin_spot;
use super::{Face, Frame, Ray};
use crate::math::{Interval, Rect, absorption};
use clerestory_film::counters::Counters;

/// What a pane is made of.
#[derive(Clone, Debug)]
pub struct PaneParts {
    /// What the scene calls it.
    pub name: String,
    /// Where it hangs: the frame of its height fields.
    pub frame: Frame,
    /// Where there is glass.
    pub outline: Outline,
    /// Distance between the faces where both are at height zero, in metres.
    pub thickness: f64,
    /// Index of refraction of the glass; that of air is 1.
    pub index_of_refraction: f64,
    /// Absorption coefficient of the glass by colour, in 1/metre.
    pub absorption: DVec3,
    /// Absorbance (natural logarithm) by colour of coloured layers on the front and the back face, for light that
    /// crosses them straight.
    pub layers: [DVec3; 2],
    /// Displacements h1 of the front face and h2 of the back face.
    pub faces: [Arc<HeightField>; 2],
}

/// A pane of glass.
#[derive(Clone, Debug)]
pub struct Pane {
    /// What the scene calls it.
    pub name: String,
    /// Where it hangs.
    pub frame: Frame,
    /// Where there is glass.
    pub outline: Outline,
    /// Distance between the faces where both are at height zero, in metres.
    pub thickness: f64,
    /// Index of refraction of the glass; that of air is 1.
    pub index_of_refraction: f64,
    /// Absorption coefficient of the glass by colour, in 1/metre.
    pub absorption: DVec3,
    /// Absorbance by colour of the layers on the front and the back face.
    layers: [DVec3; 2],
    /// Displacement h1 of the front face.
    pub front: Arc<HeightField>,
    /// Displacement h2 of the back face.
    pub back: Arc<HeightField>,
    /// Bounds of the front and the back face over the outline.
    bounds: [JetBounds; 2],
    /// How rays find the faces; [`FaceCrossing::Proven`] to begin with.
    pub crossing: FaceCrossing,
}

/// How rays find where they cross a face.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaceCrossing {
    /// By bounds on height and slope, which prove what is the first crossing.
    #[default]
    Proven,
    /// By sphere tracing (Hart 1996), as the FNEE paper has it: slower, and blind to what is thinner than a micrometre.
    SphereTracing,
}

/// Why there can be no such pane.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PaneError {
    /// The thickness is not a positive finite number.
    #[error("a pane of thickness {0} metres: the thickness must be positive and finite")]
    Thickness(f64),
    /// The index of refraction is not a finite number of at least 1.
    #[error("a pane of index of refraction {0}: the index must be finite and at least 1")]
    IndexOfRefraction(f64),
    /// An absorption coefficient or an absorbance is negative or not finite.
    #[error("a pane of absorption {0} per metre: absorption must be finite and not negative")]
    Absorption(f64),
    /// The outline reaches beyond a face.
    #[error(
        "a face of {} x {} metres, of which the pane has x from {} to {} and y from {} to {}: the pane must lie within \
         the face", face.x, face.y, pane.min.x, pane.max.x, pane.min.y, pane.max.y
    )]
    BeyondFace {
        /// Size of the face.
        face: DVec2,
        /// The rectangle around the outline.
        pane: Rect,
    },
    /// The faces touch or cross.
    #[error(
        "the faces of a pane of thickness {thickness} metres come as near as {gap} metres at x = {}, y = {}: the \
         thickness must exceed the depth of the relief", at.x, at.y
    )]
    TooThin {
        /// The pane's thickness.
        thickness: f64,
        /// Where the faces touch, in metres from the centre.
        at: DVec2,
        /// Lower bound of the distance between the faces there: not positive.
        gap: f64,
    },
}

/// Light along a face crosses its layer at no less than this cosine.
const GRAZING: f64 = 1e-9;

/// An outline may reach beyond a face by this part of its size, where the heights go on: places are rounded.
const BEYOND: f64 = 1e-9;

/// What bounds the glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaneBoundary {
    /// A refracting face.
    Face(Face),
    /// A side wall, opaque and black.
    Edge,
}

/// Where a ray meets the boundary of a pane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaneHit {
    /// Distance along the ray in metres.
    pub distance: f64,
    /// The point in the pane's frame; on a face, it is on the height field to the last digits.
    pub point: DVec3,
    /// What was met.
    pub boundary: PaneBoundary,
    /// Gradient of the face's height there; zero on the edge.
    pub gradient: DVec2,
    /// Whether the ray was in the glass.
    pub inside: bool,
}

impl Pane {
    /// The pane with the given parts.
    ///
    /// # Errors
    /// [`PaneError`] when a number is out of range, the outline reaches beyond a face, or the thickness of the glass
    /// cannot be proven to be positive everywhere.
    pub fn new(parts: PaneParts) -> Result<Self, PaneError> {
        let PaneParts { name, frame, outline, thickness, index_of_refraction, absorption, layers, faces } = parts;
        let [front, back] = faces;
        if !(thickness.is_finite() && thickness > 0.0) {
            return Err(PaneError::Thickness(thickness));
        }
        if !(index_of_refraction.is_finite() && index_of_refraction >= 1.0) {
            return Err(PaneError::IndexOfRefraction(index_of_refraction));
        }
        let all = [absorption, layers[0], layers[1]].into_iter().flat_map(|colour| colour.to_array());
        if let Some(bad) = all.into_iter().find(|a| !(a.is_finite() && *a >= 0.0)) {
            return Err(PaneError::Absorption(bad));
        }
        let pane = *outline.bounds();
        for face in [front.size(), back.size()] {
            let whole = Rect::new(-0.5 * face, 0.5 * face).grown(BEYOND * face.max_element());
            if !(whole.contains(pane.min) && whole.contains(pane.max)) {
                return Err(PaneError::BeyondFace { face, pane });
            }
        }
        if let Some((at, gap)) = thin_spot(&front, &back, thickness, &outline) {
            return Err(PaneError::TooThin { thickness, at, gap });
        }
        let bounds = [&front, &back].map(|face| face.bounds(&pane.grown(BEYOND * face.size().max_element())));
        let crossing = FaceCrossing::default();
        Ok(Self {
            name,
            frame,
            outline,
            thickness,
            index_of_refraction,
            absorption,
            layers,
            front,
            back,
            bounds,
            crossing,
        })
    }

    /// The width and the height of the rectangle around the outline, in metres.
    pub fn size(&self) -> DVec2 {
        let Rect { min, max } = *self.outline.bounds();
        max - min
    }

    /// What the layer on a face lets through of light that crosses it at this cosine to its normal, in the glass.
    #[inline]
    pub fn layer(&self, face: Face, cosine: f64) -> DVec3 {
        let layer = match face {
            Face::Front => self.layers[0],
            Face::Back => self.layers[1],
        };
        absorption(layer, 1.0 / cosine.abs().max(GRAZING))
    }

    /// The part of light by colour that the glass lets through straight, without what its faces reflect.
    pub fn tint(&self) -> DVec3 {
        absorption(self.absorption, self.thickness) * self.layer(Face::Front, 1.0) * self.layer(Face::Back, 1.0)
    }

    /// Bounds of a face over the outline.
    #[inline(always)]
    pub fn bounds(&self, face: Face) -> &JetBounds {
        match face {
            Face::Front => &self.bounds[0],
            Face::Back => &self.bounds[1],
        }
    }

    /// The height field of a face.
    pub fn surface(&self, face: Face) -> &HeightField {
        match face {
            Face::Front => &self.front,
            Face::Back => &self.back,
        }
    }

    /// The z of a face where its height is zero.
    pub fn base_height(&self, face: Face) -> f64 {
        match face {
            Face::Front => 0.0,
            Face::Back => self.thickness,
        }
    }

    /// The first boundary met by a ray that starts outside the glass, up to `max_distance`; the ray is in the pane's
    /// frame. A ray that leaves a face into the air says so by `start_face`; it may meet the same face again further
    /// on. A ray that starts between the faces nevertheless (say, from a triangle stuck into the glass) meets the edge
    /// at distance 0.
    pub fn intersect_outside(
        &self,
        ray: &Ray,
        max_distance: f64,
        start_face: Option<Face>,
        counters: &mut Counters,
    ) -> Option<PaneHit> {
        let within = self.outline.stretch(ray);
        if let Some(face) = start_face {
            // A start on the border of the outline may be rounded to beyond it; the ray's way out tells all the same.
            let range = Interval::new(0.0, within.max.min(max_distance));
            return self.cross(face, ray, range, outer_side(face), Start::OnSurface, false, counters);
        }
        let range = within.intersection(Interval::new(0.0, max_distance));
        if range.is_empty() || self.passes_by(ray, range) {
            return None;
        }
        let entry = ray.at(range.min);
        match self.side_of_glass(entry, counters) {
            Some(face) => self.cross(face, ray, range, outer_side(face), Start::Free, false, counters),
            None => Some(self.edge(range.min, entry, false)),
        }
    }

    /// The first boundary met by a ray that starts in the glass; the ray is in the pane's frame. A ray that starts on a
    /// face says so by `start_face`; it may meet the same face again further on.
    pub fn intersect_inside(&self, ray: &Ray, start_face: Option<Face>, counters: &mut Counters) -> Option<PaneHit> {
        let end = self.outline.stretch(ray).max.max(0.0);
        let nearest_first = if ray.direction.z < 0.0 { [Face::Front, Face::Back] } else { [Face::Back, Face::Front] };
        let mut nearest: Option<PaneHit> = None;
        for face in nearest_first {
            let start = if start_face == Some(face) { Start::OnSurface } else { Start::Free };
            let range = Interval::new(0.0, nearest.map_or(end, |hit| hit.distance));
            nearest = self.cross(face, ray, range, inner_side(face), start, true, counters).or(nearest);
        }
        nearest.or_else(|| end.is_finite().then(|| self.edge(end, ray.at(end), true)))
    }

    /// Corners of a box in the world that holds the pane.
    pub fn world_bounds(&self) -> [DVec3; 2] {
        let corners = prism(&self.outline, self.depth()).map(|corner| self.frame.point_to_world(corner));
        let (min, max) = corners
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), corner| (min.min(corner), max.max(corner)));
        let reach = self.outline.bounds().min.abs().max(self.outline.bounds().max.abs()).max_element();
        let slack = 8.0 * f64::EPSILON * (min.abs().max(max.abs()).max_element() + 2.0 * reach);
        [min - slack, max + slack]
    }

    /// Corners of a box in the pane's frame that holds the glass.
    pub fn local_bounds(&self) -> [DVec3; 2] {
        let (bounds, depth) = (self.outline.bounds(), self.depth());
        [bounds.min.extend(depth.min), bounds.max.extend(depth.max)]
    }

    /// Bounds of z over the glass.
    pub(crate) fn depth(&self) -> Interval {
        Interval::new(self.bounds[0].height.min, self.thickness + self.bounds[1].height.max)
    }

    /// Whether the ray stays in front of all glass, or behind it.
    fn passes_by(&self, ray: &Ray, range: Interval) -> bool {
        let depth = self.depth();
        if ray.direction.z == 0.0 {
            return ray.origin.z < depth.min || ray.origin.z > depth.max;
        }
        let z = [range.min, range.max].map(|t| ray.origin.z + ray.direction.z * t);
        let slack = 4.0 * f64::EPSILON * (ray.origin.z.abs() + depth.magnitude());
        z[0].max(z[1]) < depth.min - slack || z[0].min(z[1]) > depth.max + slack
    }

    /// The face on whose outer side a point over the outline is; `None` in the glass.
    fn side_of_glass(&self, point: DVec3, counters: &mut Counters) -> Option<Face> {
        let depth = self.depth();
        if point.z <= depth.min {
            return Some(Face::Front);
        }
        if point.z >= depth.max {
            return Some(Face::Back);
        }
        counters.height_evaluations += 2;
        if point.z <= self.front.height(point.truncate()) {
            Some(Face::Front)
        } else if point.z - self.thickness >= self.back.height(point.truncate()) {
            Some(Face::Back)
        } else {
            None
        }
    }

    #[expect(clippy::too_many_arguments, reason = "the one place where both kinds of rays meet a face")]
    fn cross(
        &self,
        face: Face,
        ray: &Ray,
        range: Interval,
        side: Side,
        start: Start,
        inside: bool,
        counters: &mut Counters,
    ) -> Option<PaneHit> {
        let base = self.base_height(face);
        let (surface, bounds) = (self.surface(face), self.bounds(face));
        let Crossing { distance, point, gradient } = match self.crossing {
            FaceCrossing::Proven => surface.first_crossing(bounds, base, ray, range, side, start, counters),
            FaceCrossing::SphereTracing => surface.sphere_traced(bounds, base, ray, range, side, start, counters),
        }?;
        let within = self.outline.bounds();
        let point = point.truncate().clamp(within.min, within.max).extend(point.z);
        Some(PaneHit { distance, point, boundary: PaneBoundary::Face(face), gradient, inside })
    }

    fn edge(&self, distance: f64, point: DVec3, inside: bool) -> PaneHit {
        PaneHit { distance, point, boundary: PaneBoundary::Edge, gradient: DVec2::ZERO, inside }
    }
}

/// The side of a face on which the air is.
fn outer_side(face: Face) -> Side {
    match face {
        Face::Front => Side::Below,
        Face::Back => Side::Above,
    }
}

/// The side of a face on which the glass is.
fn inner_side(face: Face) -> Side {
    match face {
        Face::Front => Side::Above,
        Face::Back => Side::Below,
    }
}

#[cfg(test)]
mod tests;
