//! The design of a window, and how it becomes a plan.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bars::Bars;
use crate::convex::CutTests;
use crate::error::{GlazingError, check};
use crate::filling::{Filling, MAX_PIECES};
use crate::glass::GlassPattern;
use crate::glaze::Glazier;
use crate::lead::{Cames, Lead};
use crate::opening::Opening;
use crate::outline::Outline;
use crate::plan::WindowPlan;
use crate::polygon;
use crate::stone::{StoneFrame, StoneHole, StoneSection};
use crate::tracery::Tracery;
use crate::wall::Wall;

/// A leaded window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WindowDesign {
    /// The opening in the wall.
    pub opening: Opening,
    /// How stone divides the opening into lights.
    #[serde(default)]
    pub tracery: Tracery,
    /// The section of the tracery; not used where there is none.
    #[serde(default)]
    pub stone: StoneSection,
    /// How each light is divided into pieces.
    #[serde(default)]
    pub filling: Filling,
    /// Which kinds of glass the pieces are cut from, where the filling does not say it.
    #[serde(default)]
    pub glass: GlassPattern,
    /// What holds the pieces.
    #[serde(default)]
    pub lead: Lead,
    /// Iron bars on the inside of the glass.
    #[serde(default)]
    pub bars: Bars,
    /// The wall around the opening. Default: none, for a building that has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall: Option<Wall>,
    /// Standard deviation of the rotation of pieces about x and y, degrees; 0 to 5. None exceeds three of them.
    #[serde(default = "tilt")]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub tilt: f64,
    /// Standard deviation of the thickness of pieces, as a part of it; 0 to 0.3. None exceeds three of them.
    #[serde(default = "thickness_variation")]
    #[schemars(range(min = 0.0, max = 0.3))]
    pub thickness_variation: f64,
    /// Seed of everything that differs from piece to piece.
    #[serde(default)]
    pub seed: u64,
}

fn tilt() -> f64 {
    0.3
}

fn thickness_variation() -> f64 {
    0.1
}

/// Distance of bars from the middle of the glass where there is no lead, metres.
const CLEARANCE: f64 = 0.005;

impl WindowDesign {
    /// A window with the default settings in an opening.
    pub fn new(opening: Opening) -> Self {
        Self {
            opening,
            tracery: Tracery::default(),
            stone: StoneSection::default(),
            filling: Filling::default(),
            glass: GlassPattern::default(),
            lead: Lead::default(),
            bars: Bars::default(),
            wall: None,
            tilt: tilt(),
            thickness_variation: thickness_variation(),
            seed: 0,
        }
    }

    /// The kinds of glass that pieces may be cut from, sorted.
    pub fn glass_names(&self) -> Vec<&str> {
        let mut names = self.glass.names();
        names.extend(self.filling.glass_names());
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Checks every member by itself, which takes no time. [`plan`](Self::plan) also finds members that do not fit each
    /// other.
    ///
    /// # Errors
    ///
    /// The first member that is out of its range.
    pub fn validate(&self) -> Result<(), GlazingError> {
        self.opening.form("opening")?;
        self.stone.validate("stone")?;
        self.filling.validate("filling")?;
        self.glass.validate("glass")?;
        self.lead.validate("lead")?;
        self.bars.validate("bars")?;
        self.wall.as_ref().map_or(Ok(()), |wall| wall.validate("wall"))?;
        check("", "tilt", self.tilt, 0.0..=5.0, "degrees")?;
        check("", "thickness_variation", self.thickness_variation, 0.0..=0.3, "")
    }

    /// Plans the window. The same design gives the same plan, to the last bit.
    ///
    /// # Errors
    ///
    /// The first member that is out of its range, or that does not fit the others.
    pub fn plan(&self) -> Result<WindowPlan, GlazingError> {
        self.validate()?;
        let form = self.opening.form("opening")?;
        let outline = form.outline.polygon();
        let [low, high] = polygon::bounds(&outline);
        let lights = self.tracery.lights(&form, self.stone.width, "tracery")?;
        let upper_left = glam::DVec2::new(low.x, high.y);
        self.filling.check_fit(&lights, upper_left, "filling")?;
        let glazier = Glazier {
            filling: &self.filling,
            glass: &self.glass,
            cames: self.lead.cames(),
            tilt: self.tilt,
            thickness_variation: self.thickness_variation,
            seed: self.seed,
            upper_left,
        };
        let (mut pieces, mut cames, mut joints) = (Vec::new(), Vec::new(), Vec::new());
        let mut tests = CutTests::default();
        for (index, light) in lights.iter().enumerate() {
            let glazed = glazier.glaze(index, light, &mut tests)?;
            pieces.extend(glazed.pieces);
            cames.extend(glazed.cames);
            joints.extend(glazed.joints);
            if pieces.len() > MAX_PIECES {
                let found = format!("more than {MAX_PIECES} pieces");
                return Err(GlazingError::new("filling", found, format!("at most {MAX_PIECES} pieces")));
            }
        }
        if let (true, Some(cames)) = (pieces.is_empty(), self.lead.cames()) {
            let expected = "narrow enough to leave glass between the flanges";
            return Err(GlazingError::new("lead.cames.flange_width", cames.flange_width, expected));
        }
        let stone = (self.tracery != Tracery::None).then(|| self.stone_frame(&outline, &lights));
        let lights: Vec<_> = lights.iter().map(Outline::polygon).collect();
        let bars = self.bars.place(&outline, &lights, self.lead.cames().map_or(CLEARANCE, Cames::half_depth));
        let lead = self.lead.cames().cloned();
        let frame_depth = stone.as_ref().map_or(0.0, |stone: &StoneFrame| stone.depth);
        let wall = self.wall.as_ref().map(|wall| wall.plan(&form.outline, frame_depth, "wall")).transpose()?;
        Ok(WindowPlan { outline, lights, stone, wall, pieces, cames, lead, joints, bars })
    }

    /// The tracery around the lights.
    fn stone_frame(&self, outline: &[glam::DVec2], lights: &[Outline]) -> StoneFrame {
        let StoneSection { depth, chamfer, .. } = self.stone;
        let chamfer_depth = chamfer.min(0.4 * depth);
        let hole = |light: &Outline| {
            let segments = light.segments(crate::outline::SAGITTA);
            let outline = light.polygon_with(&segments);
            let face = light.inset(-chamfer).map(|face| face.polygon_with(&segments));
            StoneHole { face_outline: face.unwrap_or_else(|| outline.clone()), outline }
        };
        StoneFrame { outline: outline.to_vec(), holes: lights.iter().map(hole).collect(), depth, chamfer_depth }
    }
}
