//! Whole-system tests, and the ground truth and statistics that the renderer is held against.
//!
//! Nothing here shares code with the renderer's geometry, optics or specular solvers, so that a fault in one of them
//! cannot hide in both:
//!
//! - [`spline`], [`traced_scene`] and [`forward_tracer`]: light traced forward from the lights, in double precision;
//!   [`polarised_light`]: what two faces transmit of it;
//! - [`mod@reference`]: images with independent halves and a standard error, as OpenEXR;
//! - [`bias`]: whether a renderer's replicates agree with a reference, and with what power;
//! - [`methods`]: the integrators and settings that are tested;
//! - [`comparisons`]: which method is held against which reference, and [`allocation`]: with how many samples where;
//! - [`farm`]: a farm of real processes, [`made_images`]: what it makes, [`small_blocks`]: a scene for it, and
//!   [`browser`]: what a user sees of it;
//! - [`chaos`]: such a farm while its processes, disks, clocks and connections fail, these in a [`proxy`] that knows
//!   where `requests` end;
//! - [`system_calls`]: what such a process did, call by call, and whether what it acknowledged was on disk;
//! - [`large_frame`]: frames that are larger than a coordinator's memory, and [`cgroup`]: limits on that;
//! - [`peak_memory`]: the most that a process has had;
//! - [`malformed_scenes`], [`malformed_calls`] and [`malformed_partials`]: what a farm must refuse and how, as tables;
//!   [`calls`] sends them, [`exr_files`] makes the images, [`hand_worker`] brings the partials;
//! - [`connections`]: fixed problems, to compare the paths that methods find and the time that they take;
//! - [`single_connections`]: the light that a method finds between two points, against what is there, which
//!   `known_paths` knows;
//! - [`sheet_connections`]: the same through waves of water, which `conic` knows;
//! - [`rendering`]: scenes rendered in this process, and [`estimate`]: whether two ways to render one agree;
//! - [`pixel_digests`]: pixels in short, and tables of what they were; [`stored_farm`]: what older builds left of
//!   farms;
//! - [`pane_scene`]: small scenes for tests of laws, [`closed_room`]: a room for tests of all light, [`daylit_room`]:
//!   one with a window of any number of panes;
//! - [`found_paths`]: paths of light as methods are asked about them;
//! - [`solution_lists`]: all paths to points of a receiver, found by brute force;
//! - [`parity`]: whether Mitsuba renders the same pictures of exported scenes;
//! - [`fuzz`]: files as strangers could have made them;
//! - [`slab`]: the faces of a slab whose caustic has no folds;
//! - [`pool`]: water whose caustic folds;
//! - [`two_interfaces`]: all paths through two interfaces, by curves; [`pane_mesh`]: a pane as a mesh;
//! - [`folds`]: where the caustic of a point light is singular;
//! - [`waiting`]: until something can be seen;
//! - [`pair_references`]: references of the pairs of scenes and lights that `auto` is compared on;
//! - [`sun_scene`]: scenes whose sun is made larger or smaller, and references of them.

pub mod allocation;
pub mod bias;
pub mod browser;
pub mod calls;
pub mod cgroup;
pub mod chaos;
pub mod closed_room;
pub mod comparisons;
pub mod connections;
pub mod cut_sheet;
pub mod daylit_room;
pub mod estimate;
pub mod exr_files;
pub mod farm;
pub mod folds;
pub mod forward_tracer;
pub mod found_paths;
pub mod fuzz;
pub mod hand_worker;
mod known_paths;
pub mod large_frame;
pub mod load_page;
pub mod luxcore;
pub mod made_images;
pub mod malformed_calls;
pub mod malformed_partials;
pub mod malformed_scenes;
pub mod mesh_tracer;
pub mod methods;
pub mod pair_references;
pub mod pane_mesh;
pub mod pane_scene;
pub mod parity;
pub mod peak_memory;
pub mod pixel_digests;
pub mod polarised_light;
pub mod pool;
pub mod proxy;
pub mod random;
pub mod reference;
pub mod rendering;
mod requests;
pub mod sheet_connections;
pub mod single_connections;
pub mod slab;
pub mod small_blocks;
pub mod solution_lists;
pub mod spline;
pub mod stored_farm;
pub mod sun_scene;
pub mod system_calls;
pub mod traced_pane;
pub mod traced_scene;
pub mod triangle_tree;
pub mod two_interfaces;
pub mod waiting;
