//! The nodes of the scene, each with its place in the world.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::fault::{fault, lookup};
use super::schema::{Document, Node};
use crate::settings::AssetProblem;

/// Nodes from a root down to a leaf.
const MAX_DEPTH: usize = 64;

/// Programs write rotations and matrices with rounding errors up to this.
const TOLERANCE: f64 = 1e-3;

/// A node of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// Its number in the file.
    pub(super) node: usize,
    /// From its coordinates to those of the scene, metres. A negative determinant turns triangles inside out.
    pub(super) world: DAffine3,
}

/// All nodes of the default scene, each before its children. Without a default scene they are those of the first one,
/// and without any scene all nodes.
pub(super) fn flatten(document: &Document<'_>) -> Result<Vec<Placed>, AssetProblem> {
    let nodes = &document.nodes;
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for (number, &child) in node.children.iter().enumerate() {
            let place = format!("nodes[{index}].children[{number}]");
            lookup(nodes, child, "nodes", &place)?;
            if let Some(other) = parents[child].replace(index) {
                let message = format!("names nodes[{child}], which is a child of nodes[{other}] already");
                return Err(fault(place, message));
            }
        }
    }
    check_depths(&parents)?;
    let mut open: Vec<Open> = Vec::new();
    for (place, root) in roots(document, &parents)? {
        if let Some(parent) = parents[root] {
            return Err(fault(place, format_args!("nodes[{root}] is a child of nodes[{parent}], must be a root")));
        }
        open.push(Open { node: root, parent: DAffine3::IDENTITY });
    }
    open.reverse();
    let mut placed = Vec::new();
    let mut visited = vec![false; nodes.len()];
    while let Some(Open { node, parent }) = open.pop() {
        let place = format!("nodes[{node}]");
        if std::mem::replace(&mut visited[node], true) {
            return Err(fault(place, "is a root of the scene twice"));
        }
        let world = parent * local(&nodes[node], &place)?;
        if !world.is_finite() {
            return Err(fault(place, "its place in the world is not finite"));
        }
        placed.push(Placed { node, world });
        let children = nodes[node].children.iter().rev();
        open.extend(children.map(|&child| Open { node: child, parent: world }));
    }
    Ok(placed)
}

/// Checks that no node is its own ancestor, or too far from its root.
fn check_depths(parents: &[Option<usize>]) -> Result<(), AssetProblem> {
    for node in 0..parents.len() {
        let (mut ancestor, mut depth) = (node, 1);
        while let Some(parent) = parents[ancestor] {
            if parent == node {
                return Err(fault(format_args!("nodes[{node}]"), "is its own ancestor: nodes must form a tree"));
            }
            if depth == MAX_DEPTH {
                return Err(fault(
                    format_args!("nodes[{node}]"),
                    format_args!("lies more than {MAX_DEPTH} nodes deep"),
                ));
            }
            (ancestor, depth) = (parent, depth + 1);
        }
    }
    Ok(())
}

/// A node that is not visited yet.
struct Open {
    node: usize,
    parent: DAffine3,
}

/// The roots of the scene, each with the place that names it.
fn roots(document: &Document<'_>, parents: &[Option<usize>]) -> Result<Vec<(String, usize)>, AssetProblem> {
    let scene = match document.scene {
        Some(scene) => Some((scene, lookup(&document.scenes, scene, "scenes", "scene")?)),
        None => document.scenes.first().map(|scene| (0, scene)),
    };
    let Some((index, scene)) = scene else {
        let is_root = |node: &usize| parents[*node].is_none();
        return Ok((0..parents.len()).filter(is_root).map(|node| (format!("nodes[{node}]"), node)).collect());
    };
    let mut roots = Vec::with_capacity(scene.nodes.len());
    for (number, &node) in scene.nodes.iter().enumerate() {
        let place = format!("scenes[{index}].nodes[{number}]");
        lookup(&document.nodes, node, "nodes", &place)?;
        roots.push((place, node));
    }
    Ok(roots)
}

/// The placement of a node in its parent.
fn local(node: &Node, place: &str) -> Result<DAffine3, AssetProblem> {
    let Node { matrix, translation, rotation, scale, .. } = node;
    if let Some(matrix) = matrix {
        if translation.is_some() || rotation.is_some() || scale.is_some() {
            return Err(fault(place, "has a matrix, so it must have no translation, rotation and scale"));
        }
        return affine(*matrix).ok_or_else(|| {
            let [x, y, z, w] = [matrix[3], matrix[7], matrix[11], matrix[15]];
            let message = format!("has the last row {x}, {y}, {z}, {w}, must have 0, 0, 0, 1");
            fault(format_args!("{place}.matrix"), message)
        });
    }
    let rotation = rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let quaternion = DQuat::from_array(rotation);
    let length = quaternion.length();
    if !length.is_finite() || (length - 1.0).abs() > TOLERANCE {
        let message = format!("is a quaternion of length {length:.6}, must be 1");
        return Err(fault(format_args!("{place}.rotation"), message));
    }
    let scale = DVec3::from(scale.unwrap_or([1.0; 3]));
    let translation = DVec3::from(translation.unwrap_or_default());
    Ok(DAffine3::from_scale_rotation_translation(scale, quaternion * length.recip(), translation))
}

/// A matrix in the order of its columns, when it keeps parallel lines parallel.
fn affine(matrix: [f64; 16]) -> Option<DAffine3> {
    let column = |start: usize| DVec3::new(matrix[start], matrix[start + 1], matrix[start + 2]);
    let last_row = [matrix[3], matrix[7], matrix[11], matrix[15] - 1.0];
    if last_row.iter().any(|number| number.abs() > TOLERANCE) {
        return None;
    }
    let linear = DMat3::from_cols(column(0), column(4), column(8));
    Some(DAffine3 { matrix3: linear, translation: column(12) })
}
