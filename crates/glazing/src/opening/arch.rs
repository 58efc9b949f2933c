//! Openings with a sill, two jambs and a head.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::head::Head;
use super::{ArchForm, OpeningForm, OpeningShape, SIZES};
use crate::curve::Curve;
use crate::error::{GlazingError, check, join};
use crate::outline::{Corner, Outline, Side};

/// Upright jambs on a level sill, and a head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Arch {
    /// From jamb to jamb, metres; 0.05 to 30.
    #[schemars(range(min = 0.05, max = 30.0))]
    pub width: f64,
    /// From the sill to the highest point of the head, metres; 0.05 to 30, and no less than the head is high.
    #[schemars(range(min = 0.05, max = 30.0))]
    pub height: f64,
    /// What closes the opening above.
    #[serde(default)]
    pub head: Head,
}

/// Jambs shorter than this are left out: the head stands on the sill, metres.
const SHORTEST_JAMB: f64 = 1e-6;

impl OpeningShape for Arch {
    fn form(&self, path: &str) -> Result<OpeningForm, GlazingError> {
        check(path, "width", self.width, SIZES, "metres")?;
        check(path, "height", self.height, SIZES, "metres")?;
        let head = self.head.form(self.width, &join(path, "head"))?;
        let springing = self.height - head.rise;
        if springing < -1e-9 {
            let expected = format!("{} metres, the height of the head, or more", head.rise);
            return Err(GlazingError::new(join(path, "height"), self.height, expected));
        }
        let (half, springing) = (0.5 * self.width, springing.max(0.0));
        let mut sides = vec![Side::convex(Curve::line(DVec2::new(-half, 0.0), DVec2::new(half, 0.0)))];
        let has_jambs = springing > SHORTEST_JAMB;
        if has_jambs {
            let curve = Curve::line(DVec2::new(half, 0.0), DVec2::new(half, springing));
            sides.push(Side { curve, corner: head.first_corner });
        }
        sides.extend(
            head.sides.iter().map(|side| Side { curve: side.curve.moved(DVec2::new(0.0, springing)), ..*side }),
        );
        if has_jambs {
            sides.push(Side::convex(Curve::line(DVec2::new(-half, springing), DVec2::new(-half, 0.0))));
        } else if let Some(last) = sides.last_mut() {
            last.corner = Corner::Convex;
        }
        let outline = Outline::new(sides)
            .ok_or_else(|| GlazingError::new(join(path, "head"), self.head.name(), "a head that closes"))?;
        let (two_centred, is_level) = (head.two_centred, head.rise == 0.0);
        Ok(OpeningForm { outline, arch: Some(ArchForm { span: self.width, springing, two_centred, is_level }) })
    }
}
