//! Light of environments through panes: unbiased, and with as little noise through many panes as through one.

use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::Asset;
use clerestory_tests::bias::{BLOCK, compare};
use clerestory_tests::comparisons::pictures;
use clerestory_tests::daylit_room::daylit_room;
use clerestory_tests::estimate::check_agreement;
use clerestory_tests::pane_scene::{PaneScene, pane};
use clerestory_tests::reference::Reference;
use clerestory_tests::rendering::{Rendering, block_means};
use serde_json::{Value, json};

/// A sky that is brighter in some directions, 16 x 8 texels, in a Radiance file.
fn sky() -> Asset {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n".to_vec();
    for texel in 0..128_u32 {
        let level = 40 + (texel * 37 % 101 + texel / 16 * 8) as u8;
        bytes.extend([level, level / 2 + 30, 90, 129]);
    }
    Asset::new(bytes)
}

/// A receiver near a pane of this relief, under the sky.
fn behind(relief: &Value) -> PaneScene {
    let glass = pane("glass", [0.0; 3], [0.3, 0.24], 0.003, [relief.clone(), relief.clone()]);
    let sky_light = json!({"environment": {
        "name": "sky", "radiance": {"picture": {"file": "sky.hdr"}}, "rotate": [20, 0, 35]}});
    let mut scene = PaneScene::new(vec![glass], sky_light);
    scene.assets.insert("sky.hdr".to_owned(), sky());
    PaneScene { distance: 0.15, centre: [0.03, -0.02], edge: 0.4, pixels: 32, ..scene }
}

fn crown() -> Value {
    json!({"crown": {"centre": [0.2, 0.3], "wavelength": 0.02, "amplitude": 1e-4}})
}

fn hammered() -> Value {
    json!({"hammered": {"wavelength": 0.03, "amplitude": 1e-4}})
}

/// Compares `cone` with this many samples of path tracing in each of 32 pictures.
#[track_caller]
fn check_bias(relief: &Value, samples: u32) {
    let scene = behind(relief);
    let by_chance = pictures(&scene.bundle(&json!({"path": {}}), 1), samples, 1000, &|_| 1).0;
    let reference = Reference::from_batches(&by_chance);
    let found = pictures(&scene.bundle(&json!({"cone": {}}), 1), samples / 8, 1, &|_| 1).0;
    let report = compare(&found, &reference, &[], BLOCK);
    println!("{relief}: {report}");
    assert!(report.agrees(), "{relief}: {report}");
    // What a missing Fresnel factor would take away is noticed.
    let darker = compare(&found, &reference.scaled(1.0 / 0.96), &[], BLOCK);
    assert!(!darker.agrees(), "{relief}: {darker}");
}

#[test]
fn light_of_an_environment_through_old_glass_is_unbiased() {
    check_bias(&hammered(), 32);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn light_of_an_environment_through_old_glass_is_unbiased_in_every_block() {
    check_bias(&crown(), 256);
    check_bias(&hammered(), 256);
}

#[test]
fn every_method_finds_the_light_of_an_environment() {
    let scene = behind(&hammered());
    let irradiance = |integrator: &str, samples: u32| {
        let seed = if integrator == "path" { 1 } else { 2 };
        PaneScene { seed, ..scene.clone() }.irradiance(&json!({integrator: {}}), samples, 32, 2)
    };
    let chance = irradiance("path", 16);
    for integrator in ["auto", "fnee", "sms", "mnee", "conic"] {
        check_agreement(integrator, &irradiance(integrator, 4), &chance, 0.03);
    }
}

#[test]
fn all_light_in_a_daylit_room_is_that_of_path_tracing() {
    let means = |integrator: &str, panes: [u32; 2], passes: u32, seed: u64| {
        block_means(&daylit_room(panes, integrator, 16, seed), passes, 2)
    };
    for (panes, integrator) in [([1, 1], "cone"), ([3, 2], "auto")] {
        let chance = means("path", panes, 80, 1);
        check_agreement(integrator, &means(integrator, panes, 24, 2), &chance, 0.04);
    }
}

/// Mean over the picture of the variance of a sample over the square of its value.
fn relative_error(scene: &PreparedScene, passes: u32) -> f64 {
    let mut rendering = Rendering::new(scene);
    let (mut before, mut sums) = (Vec::new(), Vec::new());
    for _ in 0..passes {
        rendering.render_pass().expect("finite samples");
        let image = rendering.image();
        let scale = f64::from(rendering.passes());
        let now: Vec<f64> = image.pixels.iter().map(|pixel| pixel.x * scale).collect();
        sums.resize(now.len(), [0.0; 2]);
        before.resize(now.len(), 0.0);
        for ((sum, now), before) in sums.iter_mut().zip(&now).zip(&before) {
            let pass: f64 = now - before;
            *sum = [sum[0] + pass, sum[1] + pass * pass];
        }
        before = now;
    }
    let count = f64::from(passes);
    let error = |[sum, squares]: &[f64; 2]| {
        let mean = sum / count;
        (squares / count - mean * mean) / (mean * mean)
    };
    sums.iter().map(error).sum::<f64>() / sums.len() as f64
}

#[test]
fn a_window_of_many_panes_has_hardly_more_noise_than_one_of_one_pane() {
    let [one, many] = [[1, 1], [20, 15]].map(|panes| relative_error(&daylit_room(panes, "cone", 4, 7), 64));
    let by_chance = relative_error(&daylit_room([1, 1], "path", 4, 7), 64);
    println!("relMSE of 4 samples: {one} of one pane, {many} of 300, {by_chance} by chance");
    assert!(many < 1.25 * one, "{many} of 300 panes, {one} of one");
    assert!(one < 0.5 * by_chance, "{one} of one pane, {by_chance} by chance");
}
