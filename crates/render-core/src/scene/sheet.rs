//! Sheets of glass, and the pieces that are cut from them.
//!
//! A glazier cuts many quarries from one crown disc or one opened cylinder, so they share its rings or its ripples. A
//! sheet has the relief once; a pane says where it was cut. The frame of such a pane is that of its sheet
//! ([`crate::geometry::Pane`]).

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::description::{PaneDescription, ProfileDescription, SheetCut, SheetDescription};
use super::parts::SceneParts;
use crate::geometry::{Face, Frame, Outline};
use crate::settings::check::{Quoted, check_pair, check_range};
use crate::settings::limits::MAX_COORDINATE;
use crate::settings::{Check, JsonPath, SceneError};

/// A piece may reach beyond its sheet by this much, metres: decimal numbers round.
const BEYOND: f64 = 1e-9;

impl SheetDescription {
    /// Width and height, metres.
    pub(super) fn size(&self) -> DVec2 {
        DVec2::new(self.width, self.height)
    }

    /// Its faces.
    pub(super) fn faces(&self) -> [(Face, &ProfileDescription); 2] {
        [(Face::Front, &self.front), (Face::Back, &self.back)]
    }
}

impl SheetCut {
    /// Cosine and sine of the rotation; exact for quarter turns.
    fn turn(&self) -> DVec2 {
        let quarters = self.rotation / 90.0;
        if quarters.fract() == 0.0 {
            return match quarters.rem_euclid(4.0) as u8 {
                0 => DVec2::X,
                1 => DVec2::Y,
                2 => DVec2::NEG_X,
                _ => DVec2::NEG_Y,
            };
        }
        let (sine, cosine) = libm::sincos(self.rotation.to_radians());
        DVec2::new(cosine, sine)
    }
}

/// The profiles of a scene's sheets and of the panes that are of no sheet, with their places and the sizes of their
/// faces, metres.
pub(crate) fn profile_uses<'a>(
    parts: &SceneParts<'a>,
) -> impl Iterator<Item = (String, &'a ProfileDescription, DVec2)> + use<'a> {
    let of_sheets = parts.sheets.iter().flat_map(|(name, sheet)| {
        let root = JsonPath::Root;
        let place = root.member("sheets").member(name).to_string();
        sheet.faces().map(|(face, profile)| (format!("{place}.{}", face_name(face)), profile, sheet.size()))
    });
    let own = parts.panes.iter().enumerate().filter(|(_, pane)| pane.sheet.is_none());
    let of_panes = own.flat_map(|(index, pane)| {
        let size = DVec2::new(pane.width, pane.height);
        [(Face::Front, &pane.front), (Face::Back, &pane.back)]
            .map(|(face, profile)| (format!("panes[{index}].{}", face_name(face)), profile, size))
    });
    of_panes.chain(of_sheets)
}

/// A face, as written in the scene file.
pub(super) fn face_name(face: Face) -> &'static str {
    match face {
        Face::Front => "front",
        Face::Back => "back",
    }
}

impl PaneDescription {
    /// The corners of the pane in its own frame, counterclockwise.
    pub(super) fn corners(&self) -> Vec<DVec2> {
        let half = 0.5 * DVec2::new(self.width, self.height);
        if self.outline.is_empty() {
            return vec![-half, DVec2::new(half.x, -half.y), half, DVec2::new(-half.x, half.y)];
        }
        self.outline.iter().map(|corner| DVec2::from(*corner)).collect()
    }

    /// The pane's frame: x and y as described, z across the glass.
    pub(super) fn hanging(&self) -> Frame {
        let x = DVec3::from(self.x_axis).normalize();
        let z = x.cross(DVec3::from(self.y_axis).normalize()).normalize();
        Frame::new(DVec3::from(self.centre), x, z.cross(x))
    }

    /// The outline in the frame of the height fields, and that frame, for a valid pane.
    pub(super) fn placed(&self) -> Option<(Outline, Frame)> {
        let hanging = self.hanging();
        let Some(cut) = &self.sheet else {
            if self.outline.is_empty() {
                return Some((Outline::centred(DVec2::new(self.width, self.height)), hanging));
            }
            return Some((Outline::polygon(self.corners()).ok()?, hanging));
        };
        let (turn, at) = (cut.turn(), DVec2::from(cut.at));
        let corners = self.corners().into_iter().map(|corner| at + turn.rotate(corner)).collect();
        // The sheet's axes in the frame of the pane are turned the other way.
        let [x, y] = [hanging.axes.x_axis, hanging.axes.y_axis];
        let (along, up) = (x * turn.x - y * turn.y, x * turn.y + y * turn.x);
        let origin = hanging.origin - along * at.x - up * at.y;
        Some((Outline::polygon(corners).ok()?, Frame::new(origin, along, up)))
    }

    /// Checks outline and sheet.
    pub(super) fn check_cut(&self, sheets: &BTreeMap<String, SheetDescription>, path: &JsonPath<'_>) -> Check {
        let half = 0.5 * DVec2::new(self.width, self.height) + BEYOND;
        let outline = path.member("outline");
        for (index, corner) in self.outline.iter().enumerate() {
            let place = outline.element(index);
            check_range(corner[0], -half.x, half.x, &place.element(0))?;
            check_range(corner[1], -half.y, half.y, &place.element(1))?;
        }
        if !self.outline.is_empty()
            && let Err(error) = Outline::polygon(self.corners())
        {
            return Err(SceneError::Structure { path: outline.to_string(), message: error.to_string() });
        }
        let Some(cut) = &self.sheet else { return Ok(()) };
        for (member, profile) in [("front", &self.front), ("back", &self.back)] {
            if *profile != ProfileDescription::Flat {
                let expected = "no profile of its own: the pane has the relief of its sheet";
                return Err(SceneError::value(&path.member(member), profile.name(), expected));
            }
        }
        let place = path.member("sheet");
        check_pair(cut.at, -MAX_COORDINATE, MAX_COORDINATE, &place.member("at"))?;
        check_range(cut.rotation, -360.0, 360.0, &place.member("rotation"))?;
        let Some(sheet) = sheets.get(&cut.name) else {
            let known = sheets.keys().map(|name| Quoted(name).to_string()).collect::<Vec<_>>().join(", ");
            let expected = if known.is_empty() { "the name of one of sheets".to_owned() } else { known };
            return Err(SceneError::value(&place.member("name"), Quoted(&cut.name), expected));
        };
        let half = 0.5 * sheet.size() + BEYOND;
        let (turn, at) = (cut.turn(), DVec2::from(cut.at));
        let beyond = |corner: &DVec2| (at + turn.rotate(*corner)).abs().cmpgt(half).any();
        if let Some(corner) = self.corners().iter().find(|corner| beyond(corner)) {
            let on_sheet = at + turn.rotate(*corner);
            let found = format!("a cut whose corner is at [{}, {}] of the sheet", on_sheet.x, on_sheet.y);
            let expected = format!("a piece of its {} x {} m", sheet.width, sheet.height);
            return Err(SceneError::value(&place.member("at"), found, expected));
        }
        Ok(())
    }
}
