//! What is being built of a scene, for a user who waits for it.

use std::fmt;

/// A part of building a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuildStep<'a> {
    /// The files of other programs are read.
    Imports {
        /// How many there are.
        count: usize,
    },
    /// Leaded windows are planned and cut.
    Windows {
        /// How many are.
        done: usize,
        /// How many there are.
        count: usize,
    },
    /// The pictures of materials are decoded.
    Textures,
    /// The faces of panes are computed or decoded.
    Panes {
        /// How many are built.
        done: usize,
        /// How many panes there are.
        count: usize,
    },
    /// A mesh is decoded or computed.
    Mesh {
        /// Its name.
        name: &'a str,
        /// Its number, from 1.
        number: usize,
        /// How many meshes there are.
        count: usize,
    },
    /// Triangles and panes are sorted into a hierarchy.
    Hierarchy {
        /// How many triangles there are.
        triangles: usize,
    },
    /// What the integrator looks up over specular meshes is computed.
    SpecularMeshes,
}

impl BuildStep<'_> {
    /// The part of a step of many equal parts that is done; `None` for other steps.
    pub fn done(&self) -> Option<f64> {
        match self {
            Self::Panes { done, count } | Self::Windows { done, count } if *done > 0 => {
                Some(*done as f64 / *count as f64)
            }
            _ => None,
        }
    }
}

impl fmt::Display for BuildStep<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Imports { count } => write!(formatter, "Reading the imports, {count} in all"),
            Self::Windows { done: 0, count } => write!(formatter, "Glazing the windows, {count} in all"),
            Self::Windows { done, count } => write!(formatter, "Glazing the windows, {done} of {count}"),
            Self::Textures => write!(formatter, "Decoding the textures"),
            Self::Panes { done: 0, count } => write!(formatter, "Building the panes, {count} in all"),
            Self::Panes { done, count } => write!(formatter, "Building the panes, {done} of {count}"),
            Self::Mesh { name, number, count } => write!(formatter, "Building mesh {number} of {count}, {name:?}"),
            Self::Hierarchy { triangles } => {
                write!(formatter, "Sorting {triangles} triangles and the panes into a tree")
            }
            Self::SpecularMeshes => write!(formatter, "Preparing the specular meshes for the integrator"),
        }
    }
}
