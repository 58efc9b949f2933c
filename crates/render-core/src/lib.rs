//! Specular light transport through old glass: from a scene to a node of the [film](clerestory_film).
//!
//! Light and data travel through the modules in this order:
//!
//! - [`math`]: intervals, Bernstein polynomials, and several numbers side by side;
//! - [`geometry`]: height-field panes, triangles and the hierarchy over both;
//! - [`settings`]: what the settings of all things in a scene file share;
//! - [`texture`]: pictures and colours over surfaces;
//! - [`exchange`]: what things are in words that other programs know;
//! - [`bsdf`]: materials, one file for each kind;
//! - [`site`]: a place on earth, its kinds of time, and where the sun stands;
//! - [`light`]: lights, one file for each kind;
//! - [`scene`]: the things of a scene, their checks, and the immutable [`scene::Scene`] built from them;
//! - [`specular`]: how light from a light reaches a shading point through glass, one folder for each method;
//! - [`document`]: the scene file as a whole, with its settings, canonical form and hash;
//! - [`integrator`]: the prepared scene, and the path tracer, which asks [`specular`] for the light that next event
//!   estimation cannot see.
//!
//! [`probe`] renders a small scene with each method, to tell machines and builds apart that compute other bits.
//!
//! # Invariants
//!
//! - A sample is a pure function of (scene, frame, pixel, sample index). No state is carried from sample to sample.
//! - Nothing here reads a clock, the environment, the network or a database; only [`document::load`] reads files.
//! - Transcendental functions come from `libm`, so that every machine computes the same bits.

pub mod bsdf;
pub mod document;
pub mod exchange;
pub mod geometry;
pub mod integrator;
pub mod light;
pub mod math;
pub mod probe;
pub mod scene;
pub mod settings;
pub mod site;
pub mod specular;
pub mod texture;
