//! Triangles of everything that is not glass, in window coordinates.

mod bar;
mod came;
mod solder;
mod stone;
mod sweep;
mod triangles;
mod triangulate;
mod wall;

use self::triangles::Triangles;
use crate::plan::WindowPlan;

/// The triangles of a part of a window. Seen from outside of the material they run counterclockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanMesh {
    /// What it is made of.
    pub part: MeshPart,
    /// Vertices, metres.
    pub positions: Vec<[f64; 3]>,
    /// Numbers of vertices from 0, three for each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// A part of a window that is not glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MeshPart {
    /// Cames: closed strips that overlap where they meet.
    Lead,
    /// Joints of cames: a closed drop on either side of each.
    Solder,
    /// Bars: closed prisms.
    Iron,
    /// Tracery: one closed surface.
    Stone,
    /// The wall around the opening: one closed surface.
    Wall,
}

impl WindowPlan {
    /// The triangles of lead, solder, iron, stone and wall; only of parts that the window has. Every edge of a mesh
    /// belongs to two triangles.
    pub fn meshes(&self) -> Vec<PlanMesh> {
        let mesh = |part, add: fn(&Self, &mut Triangles)| {
            let mut triangles = Triangles::default();
            add(self, &mut triangles);
            PlanMesh { part, positions: triangles.positions, triangles: triangles.triangles }
        };
        let parts = [
            mesh(MeshPart::Lead, came::add_cames),
            mesh(MeshPart::Solder, solder::add_solder),
            mesh(MeshPart::Iron, bar::add_bars),
            mesh(MeshPart::Stone, stone::add_stone),
            mesh(MeshPart::Wall, wall::add_wall),
        ];
        parts.into_iter().filter(|mesh| !mesh.triangles.is_empty()).collect()
    }
}

#[cfg(test)]
pub(crate) mod tests;
