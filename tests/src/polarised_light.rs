//! What two faces of glass transmit of unpolarised light, by the fields of two waves that swing across each other.
//!
//! The renderer carries the intensity and linear polarisation of light. Here a wave is a vector in space. At a face,
//! its parts across and in the plane of incidence shrink by the roots of what the face transmits of each. The mean of
//! both waves is what unpolarised light keeps.

use glam::DVec3;

/// What two faces transmit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoFaces {
    /// Each face of light that is unpolarised before it.
    pub each: [f64; 2],
    /// Both of light that is unpolarised before the first.
    pub both: f64,
}

impl TwoFaces {
    /// From unit directions before, between and behind the faces, their unit normals, and the index of refraction of
    /// what lies between them.
    pub fn new(directions: [DVec3; 3], normals: [DVec3; 2], index: f64) -> Self {
        let [before, inside, behind] = directions;
        let first = Face::new(before, inside, normals[0], [1.0, index]);
        let second = Face::new(inside, behind, normals[1], [index, 1.0]);
        let (one, other) = before.any_orthonormal_pair();
        let kept = [one, other].map(|wave| second.transmit(first.transmit(wave)).length_squared());
        Self { each: [first, second].map(|face| 0.5 * (face.across.1 + face.along.1)), both: 0.5 * (kept[0] + kept[1]) }
    }

    /// What both transmit over what they would if each met unpolarised light.
    pub fn over_averages(&self) -> f64 {
        self.both / (self.each[0] * self.each[1])
    }
}

/// A face: the axis across the plane of incidence, and those in it before and behind the face, with what is transmitted
/// of light that swings along each.
#[derive(Clone, Copy, Debug)]
struct Face {
    across: (DVec3, f64),
    along: (DVec3, f64),
    along_behind: DVec3,
}

impl Face {
    fn new(before: DVec3, behind: DVec3, normal: DVec3, [from, to]: [f64; 2]) -> Self {
        let (ci, ct) = (before.dot(normal).abs(), behind.dot(normal).abs());
        let transmitted = |a: f64, b: f64| 4.0 * a * b / ((a + b) * (a + b));
        // Along the normal, any axis will do.
        let across = before.cross(normal).try_normalize().unwrap_or_else(|| before.any_orthonormal_vector());
        Self {
            across: (across, transmitted(from * ci, to * ct)),
            along: (before.cross(across), transmitted(from * ct, to * ci)),
            along_behind: behind.cross(across),
        }
    }

    fn transmit(&self, wave: DVec3) -> DVec3 {
        let [across, along] = [self.across, self.along].map(|(axis, part)| wave.dot(axis) * part.sqrt());
        self.across.0 * across + self.along_behind * along
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light at an angle of incidence through a plane sheet, and through two faces whose planes of incidence are across
    /// each other.
    #[test]
    fn a_sheet_transmits_the_mean_of_both_polarisations() {
        let index = 1.5_f64;
        for degrees in [0.0, 30.0, 60.0, 80.0_f64] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let inner = (1.0 - (sine / index).powi(2)).sqrt();
            let s = ((cosine - index * inner) / (cosine + index * inner)).powi(2);
            let p = ((index * cosine - inner) / (index * cosine + inner)).powi(2);
            let [outside, inside] = [DVec3::new(sine, 0.0, cosine), DVec3::new(sine / index, 0.0, inner)];
            let sheet = TwoFaces::new([outside, inside, outside], [DVec3::Z; 2], index);
            assert!((sheet.both - 0.5 * ((1.0 - s).powi(2) + (1.0 - p).powi(2))).abs() < 1e-14, "{degrees}");
            assert!(sheet.each.iter().all(|each| (each - 1.0 + 0.5 * (s + p)).abs() < 1e-14), "{degrees}");
            // The second face is turned about the ray in the glass by a right angle.
            let turned = |vector: DVec3| inside * inside.dot(vector) + inside.cross(vector);
            let across = TwoFaces::new([outside, inside, turned(outside)], [DVec3::Z, turned(DVec3::Z)], index);
            assert!((across.both - (1.0 - s) * (1.0 - p)).abs() < 1e-14, "{degrees}");
        }
    }
}
