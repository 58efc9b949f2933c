//! Polarisation of light along a chain of smooth surfaces.
//!
//! A surface treats light differently that swings across the plane of incidence (s) and in it (p). With Ts and Tp the
//! parts that it transmits, light of intensity I and linear polarisation Q and U leaves with
//!
//! ```text
//! I' = A I + D Q     A = (Ts + Tp) / 2
//! Q' = D I + A Q     D = (Ts - Tp) / 2
//! U' = C U           C = sqrt(Ts Tp)
//! ```
//!
//! and the same holds of the reflected parts Rs and Rp, with C = rs rp of the amplitudes. Q and U belong to the plane
//! of incidence. From one plane to another at the angle phi,
//!
//! ```text
//! Q' =  Q cos 2phi + U sin 2phi
//! U' = -Q sin 2phi + U cos 2phi
//! ```
//!
//! So a pane transmits `T = A1 A2 + D1 D2 cos 2phi` of unpolarised light. Sources: Born and Wolf 1999, section 1.5, and
//! Collett 2005, chapters 5 and 8.
//!
//! The state is carried from the eye to the light, because each surface is reciprocal: unpolarised light loses the same
//! part both ways. It begins unpolarised at the camera and at each vertex that scatters into a solid angle.
//!
//! Circular polarisation (V) and the phases at total reflection are left out: V is 0, and total reflection keeps U.

use glam::DVec3;

/// What a surface does to I, Q and U in its plane of incidence: a Mueller matrix without its last row and column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mueller {
    /// A: the part of unpolarised light that goes on.
    pub mean: f64,
    /// D: half the difference between the parts for s and p.
    pub difference: f64,
    /// C: what remains of U.
    pub diagonal: f64,
}

/// The amplitudes that a smooth face reflects. The axes of s and p and the ray are right-handed before and behind it.
/// So `s` and `p` have opposite signs along the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fresnel {
    s: f64,
    p: f64,
}

impl Fresnel {
    /// Total reflection, without its phases.
    pub const TOTAL: Self = Self { s: 1.0, p: 1.0 };

    /// A perfect mirror, which turns no phase but the sign.
    pub const MIRROR: Self = Self { s: -1.0, p: 1.0 };

    /// A face between media of these indices of refraction, from the cosines on both sides.
    #[inline(always)]
    pub fn of_face(index_in: f64, index_out: f64, cos_in: f64, cos_out: f64) -> Self {
        Self {
            s: (index_in * cos_in - index_out * cos_out) / (index_in * cos_in + index_out * cos_out),
            p: (index_out * cos_in - index_in * cos_out) / (index_out * cos_in + index_in * cos_out),
        }
    }

    /// The part of unpolarised light that is transmitted.
    #[inline(always)]
    pub fn transmittance(&self) -> f64 {
        1.0 - 0.5 * (self.s * self.s + self.p * self.p)
    }

    /// The part of unpolarised light that is reflected.
    #[inline(always)]
    pub fn reflectance(&self) -> f64 {
        1.0 - self.transmittance()
    }

    /// What transmission does.
    #[inline(always)]
    pub fn transmission(&self) -> Mueller {
        let [s, p] = [self.s * self.s, self.p * self.p];
        Mueller {
            mean: self.transmittance(),
            difference: 0.5 * (p - s),
            diagonal: ((1.0 - s) * (1.0 - p)).max(0.0).sqrt(),
        }
    }

    /// What reflection does.
    #[inline(always)]
    pub fn reflection(&self) -> Mueller {
        Mueller {
            mean: self.reflectance(),
            difference: 0.5 * (self.s * self.s - self.p * self.p),
            diagonal: self.s * self.p,
        }
    }

    /// What this face and a second one behind it do, which are parallel, with a thin film between them: transmission
    /// and reflection. Light that is reflected within the film any number of times is summed, as in [`Self::sheet`].
    pub fn film(&self, second: &Self) -> [Mueller; 2] {
        let through = |first: f64, second: f64| {
            let [first, second] = [first * first, second * second];
            let rest = 1.0 - first * second;
            if rest > 0.0 { (1.0 - first) * (1.0 - second) / rest } else { 0.0 }
        };
        let [through_s, through_p] = [through(self.s, second.s), through(self.p, second.p)];
        let (mean, difference) = (0.5 * (through_s + through_p), 0.5 * (through_s - through_p));
        let [first, behind] = [self, second].map(|face| face.transmission().diagonal);
        let [before, beyond] = [self, second].map(|face| face.s * face.p);
        let rest = 1.0 - before * beyond;
        let returning = if rest > 0.0 { first / rest } else { 0.0 };
        [
            Mueller { mean, difference, diagonal: returning * behind },
            Mueller { mean: 1.0 - mean, difference: -difference, diagonal: before + first * returning * beyond },
        ]
    }

    /// What a sheet with two such faces does, which are parallel: transmission and reflection. Light that is reflected
    /// between the faces any number of times is summed, for s and p each by itself.
    pub fn sheet(&self) -> [Mueller; 2] {
        let [s, p] = [self.s * self.s, self.p * self.p];
        let [through_s, through_p] = [s, p].map(|reflected| (1.0 - reflected) / (1.0 + reflected));
        let rest = 1.0 - s * p;
        let diagonal = if rest > 0.0 { (1.0 - s) * (1.0 - p) / rest } else { 0.0 };
        let (mean, difference) = (0.5 * (through_s + through_p), 0.5 * (through_s - through_p));
        [
            Mueller { mean, difference, diagonal },
            Mueller { mean: 1.0 - mean, difference: -difference, diagonal: self.s * self.p * (1.0 + diagonal) },
        ]
    }
}

/// The linear polarisation of light on its way: Q and U over I.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polarisation {
    /// Across the direction of the light, of any length: light that swings along it counts for Q.
    axis: DVec3,
    q: f64,
    u: f64,
}

/// Squared sine of the angle of incidence below which a surface has no plane of incidence. D is smaller still.
const ALONG_NORMAL: f64 = 1e-24;

impl Polarisation {
    /// That of unpolarised light.
    pub const NONE: Self = Self { axis: DVec3::ZERO, q: 0.0, u: 0.0 };

    /// The same light, described in the plane of incidence of a surface with this normal, of either orientation.
    /// Directions and normals are unit vectors.
    #[inline]
    pub fn incident(self, direction: DVec3, normal: DVec3) -> Self {
        let axis = normal.cross(direction);
        if axis.length_squared() < ALONG_NORMAL {
            return self;
        }
        let (cos, sin) = (self.axis.dot(axis), direction.cross(self.axis).dot(axis));
        let squares = cos * cos + sin * sin;
        // Without an axis, light is unpolarised.
        if squares == 0.0 {
            return Self { axis, ..Self::NONE };
        }
        let (cos, sin) = ((cos * cos - sin * sin) / squares, 2.0 * cos * sin / squares);
        Self { axis, q: self.q * cos + self.u * sin, u: self.u * cos - self.q * sin }
    }

    /// The same light in another frame, to which vectors are brought like this.
    pub(crate) fn turned(self, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { axis: vector(self.axis), ..self }
    }

    /// The part of the light that goes on, and its polarisation then. It has to be described in the plane of incidence
    /// ([`Self::incident`]).
    #[inline]
    pub fn after(self, surface: Mueller) -> (f64, Self) {
        let Mueller { mean, difference, diagonal } = surface;
        let part = mean + difference * self.q;
        // Rounding may leave less than nothing of light that is wholly polarised.
        if part <= 0.0 {
            return (0.0, Self::NONE);
        }
        let (q, u) = ((difference + mean * self.q) / part, diagonal * self.u / part);
        (part, Self { axis: self.axis, q, u })
    }
}

#[cfg(test)]
mod tests {
    use clerestory_film::TrialStream;
    use glam::DVec2;

    use super::*;
    use crate::bsdf::fresnel::{reflect, refract};
    use crate::specular::testing::{between, random};

    const GLASS: f64 = 1.5;

    fn at_angle(degrees: f64) -> Fresnel {
        let cos = libm::cos(degrees.to_radians());
        Fresnel::of_face(1.0, GLASS, cos, (1.0 - (1.0 - cos * cos) / (GLASS * GLASS)).sqrt())
    }

    fn turned(degrees: f64) -> DVec2 {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        DVec2::new(cos, sin)
    }

    #[test]
    fn two_faces_transmit_by_the_angle_between_their_planes() {
        for (first, second) in [(60.0, 60.0), (30.0, 75.0), (85.0, 10.0), (0.0, 70.0), (70.0, 0.0)] {
            for phi in [0.0, 20.0, 45.0, 80.0, 90.0] {
                let [a, b] = [first, second].map(|degrees| at_angle(degrees).transmission());
                let normal = |degrees: f64, turn: f64| {
                    let DVec2 { x: cos, y: sin } = turned(degrees);
                    (turned(turn) * sin).extend(-cos)
                };
                let (one, state) = Polarisation::NONE.incident(DVec3::Z, normal(first, 0.0)).after(a);
                let (two, _) = state.incident(DVec3::Z, normal(second, phi)).after(b);
                let expected = a.mean * b.mean + a.difference * b.difference * turned(2.0 * phi).x;
                assert!((one * two - expected).abs() < 1e-15, "{first}, {second}, {phi}: {}", one * two);
            }
        }
    }

    #[test]
    fn light_of_any_polarisation_is_split_without_loss() {
        let mut random = random(31);
        for _ in 0..10_000 {
            let face = at_angle(between(&mut random, 0.0, 89.9));
            let turn = turned(between(&mut random, 0.0, 360.0)) * between(&mut random, 0.0, 1.0);
            let state = Polarisation { axis: DVec3::X, q: turn.x, u: turn.y };
            let second = at_angle(between(&mut random, 0.0, 89.9));
            for [through, back] in [[face.transmission(), face.reflection()], face.sheet(), face.film(&second)] {
                let [(transmitted, behind), (reflected, before)] = [through, back].map(|surface| state.after(surface));
                assert!((transmitted + reflected - 1.0).abs() < 1e-14);
                for Polarisation { q, u, .. } in [behind, before] {
                    assert!(q * q + u * u < 1.0 + 1e-9, "{face:?}, {state:?}: {q} {u}");
                }
            }
        }
        let state = Polarisation { axis: DVec3::X, q: -0.6, u: 0.8 };
        assert_eq!(state.after(Fresnel::TOTAL.transmission()).0, 0.0);
        assert_eq!(state.after(Fresnel::TOTAL.reflection()), (1.0, state));
        assert_eq!(state.after(Fresnel::MIRROR.reflection()), (1.0, Polarisation { u: -0.8, ..state }));
    }

    #[test]
    fn a_film_between_equal_faces_is_a_sheet() {
        for degrees in [0.0, 30.0, 56.0, 80.0] {
            let face = at_angle(degrees);
            for (film, sheet) in face.film(&face).into_iter().zip(face.sheet()) {
                assert!((film.mean - sheet.mean).abs() < 1e-15 && (film.difference - sheet.difference).abs() < 1e-15);
                assert!((film.diagonal - sheet.diagonal).abs() < 1e-15, "{degrees}: {film:?} {sheet:?}");
            }
        }
        assert_eq!(Fresnel::TOTAL.film(&at_angle(20.0))[0].mean, 0.0);
    }

    /// A vertex of a chain: the ray before it, the normal, and what is reflected.
    struct Vertex {
        direction: DVec3,
        normal: DVec3,
        fresnel: Fresnel,
        is_reflected: bool,
    }

    /// A chain of random faces of glass and of mirrors, without total reflection, and the ray behind it.
    fn chain(random: &mut TrialStream) -> (Vec<Vertex>, DVec3) {
        let mut any = || DVec3::from([(); 3].map(|()| between(random, -1.0, 1.0))).normalize();
        let (mut direction, mut vertices, mut inside) = (any(), Vec::new(), false);
        while vertices.len() < 6 {
            let normal = any();
            let choice = any().x;
            let [before, behind] = if inside { [GLASS, 1.0] } else { [1.0, GLASS] };
            let Some(refraction) = refract(direction, normal, before, behind) else { continue };
            let is_reflected = choice > 0.0;
            let fresnel = if choice > 0.6 { Fresnel::MIRROR } else { refraction.fresnel };
            vertices.push(Vertex { direction, normal, fresnel, is_reflected });
            inside ^= !is_reflected;
            direction = if is_reflected { reflect(direction, normal) } else { refraction.direction };
        }
        (vertices, direction)
    }

    /// What is left of unpolarised light behind a chain, by the fields of two waves across each other.
    fn by_fields(vertices: &[Vertex], last: DVec3) -> f64 {
        let (first, second) = vertices[0].direction.any_orthonormal_pair();
        let wave = |mut field: DVec3| {
            for (index, Vertex { direction, normal, fresnel, is_reflected }) in vertices.iter().enumerate() {
                let next = vertices.get(index + 1).map_or(last, |vertex| vertex.direction);
                let s = normal.cross(*direction).normalize();
                let part = |amplitude: f64| {
                    if *is_reflected { amplitude } else { (1.0 - amplitude * amplitude).sqrt() }
                };
                let [along_s, along_p] = [field.dot(s), field.dot(direction.cross(s))];
                field = s * (along_s * part(fresnel.s)) + next.cross(s) * (along_p * part(fresnel.p));
            }
            field.length_squared()
        };
        0.5 * (wave(first) + wave(second))
    }

    fn by_states(vertices: &[Vertex]) -> f64 {
        let mut state = Polarisation::NONE;
        vertices.iter().fold(1.0, |product, Vertex { direction, normal, fresnel, is_reflected }| {
            let surface = if *is_reflected { fresnel.reflection() } else { fresnel.transmission() };
            let (part, next) = state.incident(*direction, *normal).after(surface);
            state = next;
            product * part
        })
    }

    #[test]
    fn a_chain_transmits_what_its_fields_say_and_as_much_backwards() {
        let mut random = random(32);
        let mut largest: f64 = 0.0;
        for _ in 0..3000 {
            let (vertices, last) = chain(&mut random);
            let expected = by_fields(&vertices, last);
            let found = by_states(&vertices);
            assert!((found / expected - 1.0).abs() < 1e-9, "{found}, not {expected}");
            let nexts = vertices[1..].iter().map(|vertex| vertex.direction).chain([last]);
            let turned = vertices.iter().zip(nexts).map(|(vertex, next)| Vertex { direction: -next, ..*vertex });
            let mut backwards: Vec<Vertex> = turned.collect();
            backwards.reverse();
            assert!((by_states(&backwards) / found - 1.0).abs() < 1e-9, "{found} is not the same backwards");
            let averaged: f64 = vertices.iter().fold(1.0, |product, vertex| {
                let fresnel = vertex.fresnel;
                product * if vertex.is_reflected { fresnel.reflectance() } else { fresnel.transmittance() }
            });
            largest = largest.max((averaged / found - 1.0).abs());
        }
        assert!(largest > 1.0, "no power: {largest}");
    }

    #[test]
    fn a_sheet_is_the_sum_over_its_inner_reflections() {
        for degrees in [0.0, 30.0, 56.3, 80.0] {
            let face = at_angle(degrees);
            let (through, back) = (face.transmission(), face.reflection());
            for state in [(0.0, 0.0), (0.5, 0.7), (-0.9, 0.3)].map(|(q, u)| Polarisation { axis: DVec3::X, q, u }) {
                let mut inside = state.after(through);
                let (mut light, mut crossed) = (0.0, [0.0; 2]);
                for _ in 0..200 {
                    let (part, out) = inside.1.after(through);
                    light += inside.0 * part;
                    crossed = [crossed[0] + inside.0 * part * out.q, crossed[1] + inside.0 * part * out.u];
                    for _ in 0..2 {
                        let (part, next) = inside.1.after(back);
                        inside = (inside.0 * part, next);
                    }
                }
                let (part, Polarisation { q, u, .. }) = state.after(face.sheet()[0]);
                let errors = [light - part, crossed[0] - part * q, crossed[1] - part * u];
                assert!(errors.iter().all(|error| error.abs() < 1e-12), "{degrees}, {state:?}: {errors:?}");
            }
        }
    }
}
