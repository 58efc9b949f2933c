//! A pane as the forward tracer sees it: an outline, two splines and where they lie on a sheet.

use clerestory_render_core::scene::description::PaneDescription;
use glam::{DVec2, DVec3};

use crate::spline::Spline;

/// A pane in its own frame: the front face near `z = 0`, the back face near `z = thickness`.
#[derive(Clone, Debug)]
pub struct TracedPane {
    /// Centre of the undisplaced front face.
    pub origin: DVec3,
    /// The pane's x, y and z axes.
    pub axes: [DVec3; 3],
    /// Extent along x and y, metres.
    pub size: DVec2,
    /// Corners of a convex polygon, counterclockwise; none for the whole rectangle.
    pub outline: Vec<DVec2>,
    /// Where it is cut from the sheet that its splines span.
    pub cut: TracedCut,
    /// Distance between the undisplaced faces, metres.
    pub thickness: f64,
    /// Index of refraction of the glass.
    pub index_of_refraction: f64,
    /// Absorption coefficient, per metre.
    pub absorption: DVec3,
    /// Absorbance of the layers on the front and the back face, along the normal.
    pub layers: [DVec3; 2],
    /// The front face.
    pub front: Spline,
    /// The back face.
    pub back: Spline,
}

/// A place on a sheet.
#[derive(Clone, Copy, Debug)]
pub struct TracedCut {
    /// What becomes the pane's centre, metres from the middle of the sheet.
    pub at: DVec2,
    /// Cosine and sine of the direction of the pane's x axis on the sheet.
    pub turn: DVec2,
    /// Extent of the sheet, metres.
    pub sheet: DVec2,
}

impl TracedPane {
    /// A pane of a scene file between two faces, on a sheet of this size if it is cut from one.
    pub fn new(description: &PaneDescription, sheet: Option<DVec2>, front: Spline, back: Spline) -> Self {
        let x = DVec3::from(description.x_axis).normalize();
        let y = DVec3::from(description.y_axis);
        let y = (y - x * x.dot(y)).normalize();
        let size = DVec2::new(description.width, description.height);
        let cut = match (&description.sheet, sheet) {
            (Some(cut), Some(sheet)) => {
                let (sine, cosine) = libm::sincos(cut.rotation.to_radians());
                TracedCut { at: DVec2::from(cut.at), turn: DVec2::new(cosine, sine), sheet }
            }
            _ => TracedCut { at: DVec2::ZERO, turn: DVec2::X, sheet: size },
        };
        Self {
            origin: DVec3::from(description.centre),
            axes: [x, y, x.cross(y)],
            size,
            outline: description.outline.iter().map(|corner| DVec2::from(*corner)).collect(),
            cut,
            thickness: description.thickness,
            index_of_refraction: description.index_of_refraction,
            absorption: DVec3::from(description.absorption),
            layers: [description.layers.front, description.layers.back].map(DVec3::from),
            front,
            back,
        }
    }

    /// A world direction in the pane's frame.
    pub fn vector_to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.axes[0].dot(v), self.axes[1].dot(v), self.axes[2].dot(v))
    }

    /// A direction of the pane's frame in the world.
    pub fn vector_to_world(&self, v: DVec3) -> DVec3 {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }

    /// Height and slope of a face at a place of the pane.
    pub fn surface(&self, face: &Spline, place: DVec2) -> (f64, DVec2) {
        let TracedCut { at, turn, sheet } = self.cut;
        let on_sheet = (at + turn.rotate(place)) / sheet + 0.5;
        let value = face.value(on_sheet.x, on_sheet.y);
        let slope = DVec2::new(value.du, value.dv) / sheet;
        (value.height, DVec2::new(turn.x, -turn.y).rotate(slope))
    }

    /// Whether a place is within the outline.
    pub fn contains(&self, place: DVec2) -> bool {
        let corners = &self.outline;
        let is_left = |index: usize| {
            let (from, to) = (corners[index], corners[(index + 1) % corners.len()]);
            (to - from).perp_dot(place - from) >= 0.0
        };
        place.abs().cmple(0.5 * self.size).all() && (0..corners.len()).all(is_left)
    }

    /// Whether the segment from `start` to `start + reach * direction` meets the prism around the pane.
    pub fn prism_meets(&self, start: DVec3, direction: DVec3, reach: f64) -> bool {
        let (o, d) = (self.vector_to_local(start - self.origin), self.vector_to_local(direction));
        let half = self.size / 2.0;
        let low = DVec3::new(-half.x, -half.y, self.front.bounds()[0]);
        let high = DVec3::new(half.x, half.y, self.thickness + self.back.bounds()[1]);
        let (a, b) = ((low - o) / d, (high - o) / d);
        let mut enter = a.min(b).max_element().max(0.0);
        let mut leave = a.max(b).min_element().min(reach);
        for (index, from) in self.outline.iter().enumerate() {
            let edge = self.outline[(index + 1) % self.outline.len()] - *from;
            let (inside, change) = (edge.perp_dot(o.truncate() - *from), edge.perp_dot(d.truncate()));
            let at = -inside / change;
            if change > 0.0 {
                enter = enter.max(at);
            } else if change < 0.0 {
                leave = leave.min(at);
            } else if inside < 0.0 {
                return false;
            }
        }
        enter < leave
    }
}
