//! Light against independent ground truth, closed forms and laws of physics: the tests that draw random numbers and
//! weigh them.

mod auto;
mod bias;
mod both_ends;
mod chapel;
mod connections;
mod environments;
mod laws;
mod laws_energy;
mod laws_index;
mod laws_invariance;
mod manifold;
mod many_lights;
mod partition;
mod partition_of_a_room;
mod pixels;
mod polarisation;
mod references;
mod reflected_caustics;
mod room;
mod scenes;
mod smooth_meshes;
mod solutions;
mod spots;
mod two_interfaces;
mod water_caustics;
mod windows;
