//! Openings: triangles that light goes straight through, such as window sheets without a thickness.
//!
//! A tree chooses one for a point of a surface, as it chooses lights. Points are uniform over its area.

use glam::{DVec2, DVec3};

use crate::geometry::{Accelerator, Ray};
use crate::light::{Chosen, Cluster, EmissionCone, LightTree, Receiver};

/// The openings of a scene.
#[derive(Debug)]
pub(super) struct Openings {
    tree: LightTree,
    /// The triangles by their numbers in the tree, in ascending order.
    triangles: Vec<u32>,
}

impl Openings {
    /// The triangles with these numbers, which ascend; `None` where there are none.
    pub(super) fn new(accelerator: &Accelerator, triangles: Vec<u32>) -> Option<Self> {
        let cluster = |triangle: &u32| {
            let [a, b, c] = *accelerator.corners(*triangle);
            let (min, max) = (a.min(b).min(c), a.max(b).max(c));
            Cluster {
                min,
                max,
                power: area(&[a, b, c]),
                cone: EmissionCone::EVERYWHERE,
                radius: 0.5 * (max - min).length(),
                can_be_met: true,
            }
        };
        let tree = LightTree::over(triangles.iter().map(|triangle| Some(cluster(triangle))));
        (!triangles.is_empty()).then_some(Self { tree, triangles })
    }

    /// The triangles, in ascending order.
    pub(super) fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// A direction through an opening, drawn at random.
    pub(super) fn sample(
        &self,
        accelerator: &Accelerator,
        receiver: &Receiver,
        choice: f64,
        random: DVec2,
    ) -> Option<DVec3> {
        let Chosen { light: opening, .. } = self.tree.choose(receiver, choice)?;
        let place = place(accelerator.corners(self.triangles[opening as usize]), random);
        (place - receiver.position).try_normalize()
    }

    /// The density of [`Self::sample`] per solid angle, over all openings in the direction.
    pub(super) fn pdf(&self, accelerator: &Accelerator, receiver: &Receiver, direction: DVec3) -> f64 {
        let ray = Ray::new(receiver.position, direction);
        let mut sum = 0.0;
        self.tree.on_ray(&ray, f64::INFINITY, &mut |opening| {
            let triangle = self.triangles[opening as usize];
            if let Some(distance) = accelerator.distance_to_triangle(&ray, triangle) {
                let seen = seen_area(accelerator.corners(triangle), direction);
                if seen > 0.0 {
                    sum += self.tree.probability(opening, receiver) * distance * distance / seen;
                }
            }
            false
        });
        sum
    }
}

/// The area of an opening.
pub(crate) fn area([a, b, c]: &[DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// The area of an opening as it is seen along a direction.
pub(crate) fn seen_area([a, b, c]: &[DVec3; 3], direction: DVec3) -> f64 {
    0.5 * (b - a).cross(c - a).dot(direction).abs()
}

/// A place of an opening for a pair of numbers in [0, 1): uniform over the area.
pub(crate) fn place([a, b, c]: &[DVec3; 3], random: DVec2) -> DVec3 {
    let root = random.x.sqrt();
    a * (1.0 - root) + b * (root * (1.0 - random.y)) + c * (root * random.y)
}
