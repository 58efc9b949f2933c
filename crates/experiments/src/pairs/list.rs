//! The pairs, from the scenes that ship.

use clerestory_render_core::document::SceneBundle;

use super::changes::{Change, chapel, embedded, of_glassware};
use super::glassware::{ball, bowl};
use super::{Pair, Tax};
use crate::error::ExperimentError;
use crate::scenes::{FOUR_PANES, FOUR_PANES_POINT, NAVE_16, NAVE_DIAMONDS, POOL, ROOM, SLAB};

/// Single methods where light comes through panes.
const THROUGH_PANES: &[&str] = &["light", "cone", "fnee", "sms"];

/// Single methods for a point of light, which `cone` never meets.
const OF_POINTS: &[&str] = &["light", "fnee", "sms"];

/// Single methods where light comes over meshes of water or glass.
const OVER_MESHES: &[&str] = &["light", "conic", "sms"];

/// Single methods where no specular method has a part.
const WITHOUT_GLASS: &[&str] = &["light", "path"];

/// Halves where light subpaths find the light.
const LIT_FORWARD: [&str; 2] = ["auto", "light"];

/// A pair like most others.
const USUAL: Pair = Pair {
    name: "",
    light: "sun",
    glass: "panes",
    methods: THROUGH_PANES,
    halves: LIT_FORWARD,
    is_required: false,
    is_square: false,
    build: || embedded(&ROOM, &[]),
};

/// A scene that ships, with changes.
macro_rules! changed {
    ($scene:expr $(, $change:expr)*) => { || embedded(&$scene, &[$($change),*]) };
}

/// A sun of the real one's size behind the window of four panes.
const SUN_BEHIND: Change = Change::Set(
    r#"lights=[{"sun": {"name": "sun", "direction": [0.1, 0.05, 1], "angular_radius": 0.27,
    "radiance": [20000, 20000, 20000]}}]"#,
);

/// A candle near the window of four panes.
const CANDLE_BEHIND: Change = Change::Set(
    r#"lights=[{"sphere": {"name": "candle", "centre": [0.05, -0.1, 0.6], "radius": 0.006,
    "radiance": [20000, 20000, 20000]}}]"#,
);

/// The light of the sky alone, where the sun was.
const SKY: Change = Change::Set(r#"lights=[{"environment": {"name": "sky", "radiance": {"colour": [0.8, 1, 1.3]}}}]"#);

/// A candle in the room.
const CANDLE: Change = Change::Set(
    r#"lights=[{"sphere": {"name": "candle", "centre": [1.6, 2.2, 0.9], "radius": 0.012,
    "radiance": [3000, 1700, 700]}}]"#,
);

/// The lamp of the room alone.
const LAMP: Change = Change::Set(
    r#"lights=[{"sphere": {"name": "lamp", "centre": [0.7, 4.3, 2.4], "radius": 0.1, "radiance": [62, 51, 36]}}]"#,
);

/// A point of light before the window of the room.
const POINT: Change = Change::Set(
    r#"lights=[{"point": {"name": "lantern", "position": [1.88, -2.5, 3.23], "intensity": [300, 280, 240]}}]"#,
);

/// Sun, sky, lamp and a candle.
const ALL_LIGHTS: Change = Change::Set(
    r#"lights=[
    {"sun": {"name": "sun", "direction": [-0.3411, -0.7662, 0.5446], "angular_radius": 0.27,
        "radiance": [41000, 37000, 31000]}},
    {"environment": {"name": "sky", "radiance": {"colour": [0.8, 1, 1.3]}}},
    {"sphere": {"name": "lamp", "centre": [0.7, 4.3, 2.4], "radius": 0.1, "radiance": [62, 51, 36]}},
    {"sphere": {"name": "candle", "centre": [1.6, 2.2, 0.9], "radius": 0.012, "radiance": [3000, 1700, 700]}}]"#,
);

/// A flat pane in the outer reveal of the room's window.
const PROTECTIVE: Change = Change::AddPane(
    r#"{"name": "protective", "centre": [2.9, -0.25, 1.6], "x_axis": [1, 0, 0], "y_axis": [0, 0, 1], "width": 0.69,
    "height": 0.89, "thickness": 0.004}"#,
);

/// Dimples by which the caustic folds.
const HAMMERED: Change = Change::Relief(r#"{"hammered": {"wavelength": 0.03, "amplitude": 8e-5}}"#);

/// Fine dimples.
const FINE: Change = Change::Relief(r#"{"hammered": {"wavelength": 0.01, "amplitude": 1.5e-5}}"#);

/// The same for glass that is eleven metres from what it lights.
const HAMMERED_FAR: Change = Change::Relief(r#"{"hammered": {"wavelength": 0.08, "amplitude": 1e-4}}"#);

/// Fine dimples there: finer ones are more than the grid of so large a pane resolves.
const FINE_FAR: Change = Change::Relief(r#"{"hammered": {"wavelength": 0.03, "amplitude": 3e-5}}"#);

/// Four times the relief of the slab: its caustic folds.
const FOLDED: &[Change] = &[
    Change::Set(r#"panes[*].front={"height_map": {"file": "slab/front.exr", "scale": 4}}"#),
    Change::Set(r#"panes[*].back={"height_map": {"file": "slab/back.exr", "scale": 4}}"#),
];

/// The chapel seen from the altar: walls that the windows light, and no window.
const AWAY: Change = Change::Set(
    r#"camera={"perspective": {"position": [4.8, 8.5, 2], "look_at": [0, 4.5, 1.4], "up": [0, 0, 1],
    "vertical_field_of_view": 60}}"#,
);

/// All pairs.
pub const ALL: &[Pair] = &[
    Pair { name: "room", light: "sun, lamp", is_required: true, ..USUAL },
    Pair {
        name: "chapel",
        light: "sun, sky, candles",
        glass: "leaded, protective",
        is_required: true,
        methods: &["light", "cone", "fnee"],
        build: || chapel(&[]),
        ..USUAL
    },
    Pair {
        name: "chapel, no window in view",
        light: "sun, sky, candles",
        glass: "leaded, protective",
        is_required: true,
        methods: &["light", "cone", "fnee"],
        build: || chapel(&[AWAY]),
        ..USUAL
    },
    Pair { name: "nave", is_required: true, halves: ["light", "auto"], build: changed!(NAVE_16), ..USUAL },
    Pair {
        name: "four panes",
        light: "small lamp",
        glass: "folded, fine",
        is_required: true,
        is_square: true,
        build: changed!(FOUR_PANES),
        ..USUAL
    },
    Pair {
        name: "slab",
        light: "small lamp",
        glass: "smooth",
        is_required: true,
        is_square: true,
        halves: ["auto", "sms"],
        build: changed!(SLAB),
        ..USUAL
    },
    Pair {
        name: "slab, folded",
        light: "small lamp",
        glass: "folded",
        is_required: true,
        is_square: true,
        build: || embedded(&SLAB, FOLDED),
        ..USUAL
    },
    Pair {
        name: "pool",
        light: "lamp",
        glass: "water",
        is_required: true,
        is_square: true,
        methods: OVER_MESHES,
        halves: ["auto", "sms"],
        build: changed!(POOL),
    },
    Pair {
        name: "four panes, sun",
        glass: "folded, fine",
        is_square: true,
        build: changed!(FOUR_PANES, SUN_BEHIND),
        ..USUAL
    },
    Pair {
        name: "four panes, candle",
        light: "candle",
        glass: "folded, fine",
        is_square: true,
        build: changed!(FOUR_PANES, CANDLE_BEHIND),
        ..USUAL
    },
    Pair {
        name: "four panes, point",
        light: "point",
        glass: "folded, fine",
        is_square: true,
        methods: OF_POINTS,
        build: changed!(FOUR_PANES_POINT),
        ..USUAL
    },
    Pair {
        name: "room, flat glass",
        light: "sun, lamp",
        glass: "smooth",
        build: changed!(ROOM, Change::Relief(r#""flat""#)),
        ..USUAL
    },
    Pair { name: "room, hammered", light: "sun, lamp", glass: "folded", build: changed!(ROOM, HAMMERED), ..USUAL },
    Pair { name: "room, fine", light: "sun, lamp", glass: "fine", build: changed!(ROOM, FINE), ..USUAL },
    Pair {
        name: "room, sky",
        light: "uniform sky",
        methods: &["light", "cone", "path"],
        halves: ["auto", "path"],
        build: changed!(ROOM, SKY),
        ..USUAL
    },
    Pair {
        name: "room, lamp",
        light: "lamp inside",
        methods: &["light", "cone", "path"],
        build: changed!(ROOM, LAMP),
        ..USUAL
    },
    Pair {
        name: "room, candle",
        light: "candle inside",
        methods: &["light", "cone", "path"],
        build: changed!(ROOM, CANDLE),
        ..USUAL
    },
    Pair { name: "room, point", light: "point", methods: OF_POINTS, build: changed!(ROOM, POINT), ..USUAL },
    Pair {
        name: "room, protective pane",
        light: "sun, lamp",
        glass: "protective pane before it",
        methods: &["light", "cone", "fnee"],
        build: changed!(ROOM, PROTECTIVE),
        ..USUAL
    },
    Pair {
        name: "room, all lights",
        light: "sun, sky, lamp, candle",
        methods: &["light", "cone", "fnee"],
        build: changed!(ROOM, ALL_LIGHTS),
        ..USUAL
    },
    Pair {
        name: "room, no glass",
        light: "sun, lamp",
        glass: "none",
        methods: WITHOUT_GLASS,
        build: changed!(ROOM, Change::NoPanes),
        ..USUAL
    },
    Pair {
        name: "nave, diamonds",
        glass: "leaded",
        methods: &["light", "cone", "fnee"],
        build: changed!(NAVE_DIAMONDS),
        ..USUAL
    },
    Pair {
        name: "bowl",
        light: "lamp",
        glass: "vessel",
        methods: OVER_MESHES,
        halves: ["auto", "sms"],
        build: || of_glassware(&[bowl()], &[]),
        ..USUAL
    },
    Pair {
        name: "ball",
        light: "lamp",
        glass: "closed mesh",
        methods: OVER_MESHES,
        halves: ["auto", "sms"],
        build: || of_glassware(&[ball()], &[]),
        ..USUAL
    },
    Pair {
        name: "ball behind a pane",
        light: "lamp, sky",
        glass: "pane, closed mesh",
        methods: &["light", "cone", "sms"],
        halves: ["auto", "cone"],
        build: several,
        ..USUAL
    },
    // For the cost of glass alone:
    Pair { name: "nave, no glass", glass: "none", methods: &[], build: changed!(NAVE_16, Change::NoPanes), ..USUAL },
    Pair { name: "nave, hammered", glass: "folded", methods: &[], build: changed!(NAVE_16, HAMMERED_FAR), ..USUAL },
    Pair { name: "nave, fine", glass: "fine", methods: &[], build: changed!(NAVE_16, FINE_FAR), ..USUAL },
    Pair {
        name: "chapel, no glass",
        light: "sun, sky, candles",
        glass: "none",
        methods: &[],
        build: || chapel(&[Change::NoPanes]),
        ..USUAL
    },
    Pair {
        name: "chapel, hammered",
        light: "sun, sky, candles",
        glass: "folded",
        methods: &[],
        build: || chapel(&[HAMMERED]),
        ..USUAL
    },
    Pair {
        name: "chapel, fine",
        light: "sun, sky, candles",
        glass: "fine",
        methods: &[],
        build: || chapel(&[FINE]),
        ..USUAL
    },
];

/// What glass costs, and at most may cost.
pub const TAXES: &[Tax] = &[
    Tax { scene: "room", glass: "as it ships", glazed: "room", bare: "room, no glass", limit: 2.0 },
    Tax { scene: "nave", glass: "as it ships", glazed: "nave", bare: "nave, no glass", limit: 3.0 },
    Tax { scene: "chapel", glass: "as it ships", glazed: "chapel", bare: "chapel, no glass", limit: 3.0 },
    Tax { scene: "room", glass: "hammered", glazed: "room, hammered", bare: "room, no glass", limit: 4.0 },
    Tax { scene: "room", glass: "fine", glazed: "room, fine", bare: "room, no glass", limit: 4.0 },
    Tax { scene: "nave", glass: "hammered", glazed: "nave, hammered", bare: "nave, no glass", limit: 4.0 },
    Tax { scene: "nave", glass: "fine", glazed: "nave, fine", bare: "nave, no glass", limit: 4.0 },
    Tax { scene: "chapel", glass: "hammered", glazed: "chapel, hammered", bare: "chapel, no glass", limit: 4.0 },
    Tax { scene: "chapel", glass: "fine", glazed: "chapel, fine", bare: "chapel, no glass", limit: 4.0 },
];

/// A ball of glass on a table, a pane of old glass between it and the lamp, and the sky.
fn several() -> Result<SceneBundle, ExperimentError> {
    let pane = Change::AddPane(
        r#"{"name": "pane", "centre": [0.12, -0.1, 0.55], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 0.4,
        "height": 0.4, "thickness": 0.002, "front": {"hammered": {"wavelength": 0.05, "amplitude": 9e-5}}}"#,
    );
    let sky = Change::AddLight(r#"{"environment": {"name": "sky", "radiance": {"colour": [0.1, 0.12, 0.15]}}}"#);
    of_glassware(&[ball()], &[pane, sky])
}
