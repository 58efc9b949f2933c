//! Which method finds which light: the one place that decides it.
//!
//! Rays towards a light are best until it is tiny, and a search takes over there; a point can only be searched for. One
//! vertex on a mesh is found without noise, whatever the light is. Manifold walks search bodies of glass. They also
//! search several things in a row, for lights that chance seldom meets. Each walk begins on one thing: so where there
//! are many things, light over several is left to chance (docs/decisions/0037-auto.md). Of the light of an environment,
//! only that through one pane is looked for.

use glam::DVec3;

use super::super::caster::Caster;
use crate::geometry::Pane;
use crate::light::{Light, SELDOM_MET};
use crate::scene::Scene;

/// A light through panes is searched for where its solid angle is below this from every pane, steradians.
const TINY: f64 = 1e-7;

/// Of more panes and specular meshes than this, light over several in a row is left to chance.
const MOST_IN_A_ROW: usize = 8;

/// At most so many names are listed.
const MOST_NAMES: usize = 3;

/// The methods among which is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Best {
    /// Rays towards the light, and a search where no point of it is on a fold.
    Rays,
    /// A search through and off panes.
    Fnee,
    /// All paths over one mesh.
    Conic,
    /// Manifold walks.
    Sms,
}

/// A method, and the paths that it finds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choice {
    pub(crate) method: Best,
    /// For each light of the scene, whether it is found.
    pub(crate) lights: Vec<bool>,
    /// What happens from the surface to the light, as words of R and T.
    pub(crate) chains: Vec<&'static str>,
    /// The first things that paths meet; empty where the method looks at all panes.
    pub(crate) casters: Vec<Caster>,
}

/// The methods for a scene. No path is looked for by two of them.
pub(crate) fn choose(scene: &Scene) -> Vec<Choice> {
    let (lights, panes, meshes) = (scene.lights(), scene.panes(), scene.meshes());
    let mut choices = Vec::new();
    if !panes.is_empty() {
        let boxes: Vec<_> = panes.iter().map(Pane::world_bounds).collect();
        // A light at infinity fills as much of the view from everywhere.
        let is_tiny = |light: &Light| light.bounding_box().is_some() && is_below(TINY, light, &boxes);
        let is_searched: Vec<bool> = lights.iter().map(|light| light.is_delta() || is_tiny(light)).collect();
        let is_met = lights.iter().zip(&is_searched).map(|(light, searched)| !searched && !light.is_environment());
        let is_met = is_met.collect();
        let is_seldom_met = lights.iter().map(|light| is_below(SELDOM_MET, light, &boxes)).collect();
        let mut add = |method, lights, chain| {
            choices.push(Choice { method, lights, chains: vec![chain], casters: Vec::new() });
        };
        add(Best::Rays, is_met, "TT");
        add(Best::Fnee, is_searched, "TT");
        add(Best::Fnee, is_seldom_met, "R");
    }
    let mut add = |method, lights: &[bool], chains: &[&'static str], casters: &[Caster]| {
        let (lights, chains, casters) = (lights.to_vec(), chains.to_vec(), casters.to_vec());
        choices.push(Choice { method, lights, chains, casters });
    };
    let all: Vec<bool> = lights.iter().map(|light| !light.is_environment()).collect();
    // What meets other bodies is left to chance.
    let is_apart = |index: u32| !scene.media().is_immersed_mesh(index);
    let specular = (0u32..).zip(meshes).filter(|(index, mesh)| mesh.is_specular() && is_apart(*index));
    let (glass, mirrors): (Vec<_>, Vec<_>) = specular.partition(|(_, mesh)| mesh.is_dielectric());
    let (closed, open): (Vec<_>, Vec<_>) = glass.into_iter().partition(|(index, _)| scene.is_closed(*index));
    let [closed, open, mirrors]: [Vec<Caster>; 3] =
        [closed, open, mirrors].map(|meshes| meshes.into_iter().map(|(index, _)| Caster::Mesh(index)).collect());
    // One vertex on a body leads to or from what is inside it.
    let (filled, hollow): (Vec<_>, Vec<_>) = closed.iter().copied().partition(|body| holds_something(scene, *body));
    add(Best::Conic, &all, &["T", "R"], &[&open[..], &filled].concat());
    add(Best::Conic, &all, &["R"], &[&hollow[..], &mirrors].concat());
    add(Best::Sms, &all, &["TT"], &closed);

    let panes = (0..panes.len() as u32).map(Caster::Pane).filter(|pane| !pane.is_immersed(scene));
    let panes: Vec<Caster> = panes.collect();
    if panes.len() + closed.len() + open.len() + mirrors.len() <= MOST_IN_A_ROW {
        let bodies: Vec<Caster> = panes.into_iter().chain(closed).collect();
        let things: Vec<_> =
            [&bodies[..], &open, &mirrors].concat().into_iter().map(|thing| around(scene, thing)).collect();
        let seldom: Vec<bool> = lights.iter().map(|light| is_below(SELDOM_MET, light, &things)).collect();
        let faces = [&open[..], &mirrors].concat();
        let goes_on = |first: &&Caster| bodies.iter().any(|next| is_in_a_row(scene, **first, *next));
        let (first, last): (Vec<Caster>, Vec<Caster>) = bodies.iter().partition(goes_on);
        let behind_a_body: &[&str] = match (open.is_empty(), faces.is_empty()) {
            (false, _) => &["TTT", "TTR"],
            (true, false) => &["TTR"],
            (true, true) => &[],
        };
        add(Best::Sms, &seldom, &[&["TTTT", "RTT"], behind_a_body].concat(), &first);
        add(Best::Sms, &seldom, behind_a_body, &last);
        add(Best::Sms, &seldom, if bodies.is_empty() { &["TT"] } else { &["TT", "TTT", "RTT"] }, &open);
        add(Best::Sms, &seldom, if bodies.is_empty() { &[] } else { &["RTT"] }, &mirrors);
    }
    choices.retain(|choice| {
        let has_things = !choice.casters.is_empty() || matches!(choice.method, Best::Rays | Best::Fnee);
        has_things && !choice.chains.is_empty() && choice.lights.contains(&true)
    });
    choices
}

/// Whether a light's solid angle is below a limit from everywhere in all boxes; that of a point is.
fn is_below(limit: f64, light: &Light, boxes: &[[DVec3; 2]]) -> bool {
    boxes.iter().all(|bounds| light.largest_solid_angle(*bounds).is_none_or(|angle| angle < limit))
}

/// Whether light may go through one body and then through another: not where they lie beside each other in one plane. A
/// mesh may be hollow, and light may go through both of its walls, unless it is convex.
fn is_in_a_row(scene: &Scene, first: Caster, next: Caster) -> bool {
    if first == next {
        return matches!(first, Caster::Mesh(mesh) if !scene.is_convex(mesh));
    }
    let is_beside = |one: Caster, other: Caster| {
        let Caster::Pane(pane) = one else { return false };
        let pane = &scene.panes()[pane as usize];
        let [low, high] = pane.local_bounds();
        let corners = corners(scene, other).map(|corner| pane.frame.point_to_local(corner));
        let [other_low, other_high] = around_points(&corners);
        // What the rounding of a window's description may come to.
        let slack = pane.thickness.min(other_high.z - other_low.z);
        let is_in_plane = other_low.z >= low.z - slack && other_high.z <= high.z + slack;
        let is_apart =
            other_low.truncate().cmpge(high.truncate()).any() || other_high.truncate().cmple(low.truncate()).any();
        is_in_plane && is_apart
    };
    !is_beside(first, next) && !is_beside(next, first)
}

/// Whether a light or a surface that scatters light may be in a body.
fn holds_something(scene: &Scene, body: Caster) -> bool {
    let (lights, meshes) = (scene.lights(), scene.meshes());
    let [low, high] = around(scene, body);
    let overlaps = |[other_low, other_high]: [DVec3; 2]| other_low.cmplt(high).all() && other_high.cmpgt(low).all();
    let mut scattering = (0u32..).zip(meshes).filter(|(_, mesh)| !mesh.is_specular());
    scattering.any(|(index, _)| overlaps(scene.mesh_bounds(index)))
        || lights.iter().filter_map(|light| light.bounding_box()).any(overlaps)
}

fn around_points(points: &[DVec3]) -> [DVec3; 2] {
    let empty = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    points.iter().fold(empty, |[low, high], point| [low.min(*point), high.max(*point)])
}

/// A box around a thing.
fn around(scene: &Scene, thing: Caster) -> [DVec3; 2] {
    match thing {
        Caster::Pane(pane) => scene.panes()[pane as usize].world_bounds(),
        Caster::Mesh(mesh) => scene.mesh_bounds(mesh),
    }
}

/// Corners of a box around a body.
fn corners(scene: &Scene, body: Caster) -> [DVec3; 8] {
    let of = |[low, high]: [DVec3; 2]| {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|bits: usize| {
            DVec3::from([0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { low[axis] } else { high[axis] }))
        })
    };
    match body {
        Caster::Pane(pane) => {
            let pane = &scene.panes()[pane as usize];
            of(pane.local_bounds()).map(|corner| pane.frame.point_to_world(corner))
        }
        Caster::Mesh(mesh) => of(scene.mesh_bounds(mesh)),
    }
}

impl Choice {
    /// In words, for the image's metadata.
    pub(super) fn describe(&self, scene: &Scene) -> String {
        let lit = scene.lights().iter().zip(&self.lights).filter(|(_, found)| **found);
        let lights: Vec<&str> = lit.map(|(light, _)| light.name.as_str()).collect();
        let lights = list(&lights, scene.lights().len(), "lights");
        let (method, over) = match self.method {
            Best::Rays => ("cone", "through panes, and fnee where no fold is".to_owned()),
            Best::Fnee if self.chains == ["R"] => ("fnee", "off the outside of panes".to_owned()),
            Best::Fnee => ("fnee", "through panes".to_owned()),
            Best::Conic => ("conic", self.over(scene)),
            Best::Sms => ("sms", self.over(scene)),
        };
        format!("{method} finds light of {lights} {over}")
    }

    fn over(&self, scene: &Scene) -> String {
        let (panes, meshes) = (scene.panes(), scene.meshes());
        let names: Vec<&str> = (self.casters.iter())
            .map(|caster| match *caster {
                Caster::Pane(pane) => panes[pane as usize].name.as_str(),
                Caster::Mesh(mesh) => meshes[mesh as usize].name(),
            })
            .collect();
        format!("over {} ({})", list(&names, usize::MAX, "things"), self.chains.join(", "))
    }
}

/// Names, or their number where they are many, of `count` things in all.
fn list(names: &[&str], count: usize, kind: &str) -> String {
    if names.len() == count && count > 1 {
        format!("all {kind}")
    } else if names.len() > MOST_NAMES {
        format!("{} {kind}", names.len())
    } else {
        names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use serde_json::{Value, json};

    use super::*;
    use crate::document::{SceneBundle, SceneDescription};
    use crate::scene::Scene;

    /// Some panes, a closed box, a sheet of water and a mirror, under lights of all sizes.
    fn scene(panes: &[Value]) -> Scene {
        changed(panes, |_| {})
    }

    fn changed(panes: &[Value], change: impl FnOnce(&mut Value)) -> Scene {
        let corners: Vec<[f64; 3]> =
            (0..8).map(|bits| [0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { -0.1 } else { 0.1 })).collect();
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        let sheet = json!({"inline": {
            "positions": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "triangles": [[0, 1, 2], [0, 2, 3]]
        }});
        let sphere = |name: &str, radius: f64| {
            let radiance = [1, 1, 1];
            json!({"sphere": {"name": name, "centre": [0, 0, 4], "radius": radius, "radiance": radiance}})
        };
        let mut scene = json!({
            "version": 1, "name": "things", "film": {"width": 4, "height": 4},
            "camera": {"orthographic": {"position": [0, 0, 0.5], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1}},
            "lights": [
                sphere("globe", 1.0), sphere("candle", 0.005), sphere("spark", 1e-4),
                {"sun": {"name": "sun", "direction": [0, 0, 1], "angular_radius": 0.27, "radiance": [1, 1, 1]}},
                {"point": {"name": "point", "position": [0, 0, 3], "intensity": [1, 1, 1]}}
            ],
            "materials": {
                "glass": {"dielectric": {"index_of_refraction": 1.5}},
                "silver": {"mirror": {"reflectance": [0.9, 0.9, 0.9]}}
            },
            "meshes": [
                {"name": "box", "material": "glass", "translate": [0, 0, 0.3],
                    "source": {"inline": {"positions": corners, "triangles": triangles}}},
                {"name": "water", "material": "glass", "translate": [0.5, 0.5, 0.1], "source": sheet},
                {"name": "mirror", "material": "silver", "translate": [0.5, -1.5, 0.1], "source": sheet}
            ],
            "panes": panes
        });
        change(&mut scene);
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap()
    }

    fn pane(name: &str, [x, z]: [f64; 2]) -> Value {
        json!({
            "name": name, "centre": [x, 0, z], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 0.5, "height": 0.5,
            "thickness": 0.003, "index_of_refraction": 1.5, "front": "flat", "back": "flat"
        })
    }

    /// The methods that look for a chain from a thing to a light.
    fn methods(scene: &Scene, light: usize, thing: Caster, chain: &str) -> Vec<Best> {
        let looks = |choice: &&Choice| {
            let begins = match (choice.casters.is_empty(), thing) {
                (true, Caster::Pane(_)) => true,
                (true, Caster::Mesh(_)) => false,
                (false, _) => choice.casters.contains(&thing),
            };
            begins && choice.lights[light] && choice.chains.contains(&chain)
        };
        choose(scene).iter().filter(looks).map(|choice| choice.method).collect()
    }

    const GLOBE: usize = 0;
    const CANDLE: usize = 1;
    const SPARK: usize = 2;
    const SUN: usize = 3;
    const POINT: usize = 4;

    #[test]
    fn no_path_is_looked_for_twice_and_each_has_the_method_that_is_best() {
        let scene = scene(&[pane("left", [0.0, 1.0]), pane("right", [0.6, 1.0]), pane("behind", [0.0, 1.5])]);
        let things = (0..3).map(Caster::Pane).chain((0..3).map(Caster::Mesh));
        for thing in things {
            for light in [GLOBE, CANDLE, SPARK, SUN, POINT] {
                for chain in ["T", "R", "TT", "TTT", "TTR", "RTT", "TTTT"] {
                    assert!(methods(&scene, light, thing, chain).len() <= 1, "{light}, {thing:?}, {chain}");
                }
            }
        }
        let [pane, closed, water, mirror] = [Caster::Pane(0), Caster::Mesh(0), Caster::Mesh(1), Caster::Mesh(2)];
        let through = |light| methods(&scene, light, pane, "TT");
        assert_eq!([GLOBE, CANDLE, SUN].map(through), [[Best::Rays]; 3]);
        assert_eq!([SPARK, POINT].map(through), [[Best::Fnee]; 2]);
        for light in [GLOBE, CANDLE, SPARK, SUN, POINT] {
            assert_eq!(methods(&scene, light, water, "T"), [Best::Conic]);
            assert_eq!([closed, water, mirror].map(|thing| methods(&scene, light, thing, "R")), [[Best::Conic]; 3]);
            assert_eq!(methods(&scene, light, closed, "TT"), [Best::Sms]);
            let several = if light == GLOBE { &[][..] } else { &[Best::Sms] };
            for (thing, chain) in [(pane, "TTTT"), (closed, "TTTT"), (water, "TTT"), (pane, "TTR"), (mirror, "RTT")] {
                assert_eq!(methods(&scene, light, thing, chain), several, "{light}, {thing:?}, {chain}");
            }
        }
    }

    #[test]
    fn panes_in_one_plane_are_not_in_a_row_and_many_things_are_left_to_chance() {
        let two = [pane("left", [0.0, 1.0]), pane("right", [0.6, 1.0])];
        let beside = scene(&two);
        assert!(!is_in_a_row(&beside, Caster::Pane(0), Caster::Pane(1)));
        assert!(is_in_a_row(&beside, Caster::Pane(0), Caster::Mesh(0)));
        let many: Vec<Value> =
            (0..6).map(|number| pane(&number.to_string(), [0.0, 1.0 + 0.1 * f64::from(number)])).collect();
        assert!(methods(&scene(&many[..5]), POINT, Caster::Pane(0), "TTTT") == [Best::Sms]);
        assert!(methods(&scene(&many), POINT, Caster::Pane(0), "TTTT").is_empty());
    }

    #[test]
    fn light_through_one_wall_of_a_body_is_looked_for_where_something_is_in_it() {
        let closed = Caster::Mesh(0);
        let lamp_at = |z: f64| {
            changed(&[], |scene| {
                scene["lights"] = json!([{"point": {"name": "lamp", "position": [0, 0, z], "intensity": [1, 1, 1]}}]);
            })
        };
        assert_eq!(methods(&lamp_at(0.3), 0, closed, "T"), [Best::Conic]);
        assert!(methods(&lamp_at(3.0), 0, closed, "T").is_empty());
    }

    #[test]
    fn light_goes_through_both_walls_of_a_hollow_body_and_through_panes_behind_each_other() {
        let body = |corner: f64| {
            changed(&[], |scene| {
                scene["meshes"].as_array_mut().unwrap().truncate(1);
                scene["meshes"][0]["source"]["inline"]["positions"][7] = json!([corner, corner, corner]);
                scene["lights"] = json!([{"point": {"name": "lamp", "position": [0, 0, 3], "intensity": [1, 1, 1]}}]);
            })
        };
        let [dented, convex] = [body(0.02), body(0.1)];
        assert_eq!(methods(&dented, 0, Caster::Mesh(0), "TTTT"), [Best::Sms]);
        assert!(methods(&convex, 0, Caster::Mesh(0), "TTTT").is_empty());
        let glazing = scene(&[pane("outer", [0.0, 1.0]), pane("inner", [0.0, 1.02])]);
        for pane in [0, 1] {
            assert_eq!(methods(&glazing, SUN, Caster::Pane(pane), "TTTT"), [Best::Sms]);
            assert_eq!(methods(&glazing, SUN, Caster::Pane(pane), "R"), [Best::Fnee]);
        }
    }

    #[test]
    fn the_probe_reaches_every_method_and_chain() {
        let description = SceneDescription::parse(include_bytes!("probe.json")).unwrap();
        let probe = SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap();
        let chosen = |choices: &[Choice]| {
            let mut chosen = BTreeSet::new();
            for choice in choices {
                chosen.extend(choice.chains.iter().map(|chain| format!("{:?} {chain}", choice.method)));
            }
            chosen
        };
        let all = scene(&[pane("left", [0.0, 1.0]), pane("behind", [0.0, 1.5])]);
        assert_eq!(chosen(&choose(&probe)), chosen(&choose(&all)));
    }

    #[test]
    fn what_is_chosen_is_told_with_names() {
        let scene = scene(&[pane("left", [0.0, 1.0])]);
        let told: Vec<String> = choose(&scene).iter().map(|choice| choice.describe(&scene)).collect();
        assert_eq!(
            told[0],
            "cone finds light of \"globe\", \"candle\", \"sun\" through panes, and fnee where no fold is"
        );
        assert_eq!(told[1], "fnee finds light of \"spark\", \"point\" through panes");
        assert_eq!(told[2], "fnee finds light of 4 lights off the outside of panes");
        assert!(told.contains(&"conic finds light of all lights over \"water\" (T, R)".to_owned()), "{told:#?}");
        assert!(told.contains(&"sms finds light of all lights over \"box\" (TT)".to_owned()), "{told:#?}");
    }
}
