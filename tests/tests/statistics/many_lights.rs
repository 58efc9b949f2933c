//! Many lights: a vertex that asks one of them brings the light that all of them would.

use std::path::Path;

use clerestory_render_core::document::load;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::{LightDescription, MOST_ASKED, PointLight, RectangleLight, SphereLight, SunLight};
use clerestory_tests::estimate::{Estimate, check_agreement};
use clerestory_tests::rendering::block_means;

/// The room with its four panes, under other lights.
fn lit_by(lights: &[LightDescription]) -> PreparedScene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let bundle = load(&folder.join("room.json")).expect("the room ships");
    let description = bundle.description().clone().with_integrator_named("fnee").expect("an integrator");
    let mut description = description.with_size(16, 16).expect("a size");
    description.lights = lights.to_vec();
    PreparedScene::build(&bundle.with_description(description).expect("valid lights")).expect("the room can be built")
}

/// Points, globes and panels in the room, and suns: none of them stands in another's light by more than is noticed.
fn lights() -> Vec<LightDescription> {
    let lamp = |number: usize| {
        let (column, row) = (number % 4, number / 4);
        let name = format!("lamp {number}");
        let position = [0.5 + 0.8 * column as f64, 1.2 + 1.5 * row as f64, 0.9 + 0.2 * column as f64];
        let intensity = [0.3 + 0.4 * row as f64, 0.6, 0.2];
        let radiance = |area: f64| intensity.map(|intensity| intensity / area);
        match column {
            0 | 1 => LightDescription::Point(PointLight { name, position, intensity }),
            2 => {
                let radius = 0.04;
                let area = std::f64::consts::PI * radius * radius;
                LightDescription::Sphere(SphereLight { name, centre: position, radius, radiance: radiance(area) })
            }
            _ => {
                let [edge_u, edge_v] = [[0.1, 0.0, 0.0], [0.0, -0.1, 0.0]];
                let radiance = radiance(0.01);
                LightDescription::Rectangle(RectangleLight { name, centre: position, edge_u, edge_v, radiance })
            }
        }
    };
    let sun = |number: usize| {
        LightDescription::Sun(SunLight {
            name: format!("sun {number}"),
            direction: [-0.34 + 0.1 * number as f64, -0.77, 0.54 - 0.05 * number as f64],
            angular_radius: 1.0,
            radiance: [300.0 + 200.0 * number as f64, 300.0, 100.0],
        })
    };
    (0..8).map(lamp).chain((0..4).map(sun)).collect()
}

#[test]
fn a_room_with_many_lights_is_the_sum_of_rooms_in_which_all_lights_are_asked() {
    check_parts_of_the_picture(2, 12);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn each_part_of_a_room_with_many_lights_is_the_sum_of_those_in_which_all_lights_are_asked() {
    check_parts_of_the_picture(4, 48);
}

/// Checks so many parts along each edge of the picture. The smaller they are, the more passes they need.
fn check_parts_of_the_picture(along: usize, passes: u32) {
    let lights = lights();
    assert!(lights.len() > 2 * MOST_ASKED);
    let many = block_means(&lit_by(&lights), 5 * passes, along);
    let sum = lights.chunks(MOST_ASKED).map(|few| block_means(&lit_by(few), passes, along));
    let sum = sum.reduce(|a, b| a.iter().zip(&b).map(|(a, b)| a.plus(b)).collect::<Vec<Estimate>>());
    check_agreement("many lights", &many, &sum.expect("lights"), 0.03);
}
