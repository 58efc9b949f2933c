use super::perception::{BLUE_YELLOW, EDGE_WIDTH, FEATURE_RADIUS, PIXELS_PER_DEGREE};
use super::*;
use crate::exposure::MeanLuminance;
use crate::image_layers::ImageLayers;
use crate::preview::{Exposure, PreviewSettings, encode_png};
use crate::sampler::{SampleStream, SamplerSettings};

type Pixels = Vec<[f32; 3]>;

/// Pixels of noise, each channel from 0 to 1.
fn noise(pixels: usize, seed: u64) -> Pixels {
    let mut trials = SampleStream::new(&SamplerSettings { seed, samples_per_block: 1 }, 0, [0, 0], 0).trials();
    (0..pixels).map(|_| [0; 3].map(|_| trials.next_f64() as f32)).collect()
}

fn frame(width: u32, mean: Pixels) -> FrameImage {
    let height = mean.len() as u32 / width;
    FrameImage::new(width, height, ImageLayers { mean, ..ImageLayers::default() }, None).unwrap()
}

/// The mean FLIP of images of which a value of 1 is white.
fn flip(width: u32, image: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    let mut comparison = FlipComparison::new(width, 0.0, ToneCurve::Srgb);
    comparison.add(image, reference).unwrap();
    comparison.finish().unwrap()
}

#[test]
fn identical_images_do_not_differ() {
    let image = noise(40 * 45, 1);
    assert_eq!(flip(40, &image, &image), 0.0);
    assert_eq!(mean_flip(&frame(40, image.clone()), &frame(40, image), ToneCurve::Filmic), Ok(0.0));
}

#[test]
fn black_against_white_is_almost_the_largest_difference() {
    // L* differs by 100. Green and blue, (87.7, -75.6, 73.0) and (32.3, 25.6, -34.8) with the Hunt effect, are 203.3
    // apart. There are no edges; so 0.95 + 0.05 ((100 / 203.3)^0.7 - 0.4) / 0.6 = 0.9674.
    let found = flip(30, &[[0.0; 3]; 900], &[[1.0; 3]; 900]);
    assert!((found - 0.9674).abs() < 1e-4, "{found}");
    // The farthest colors that there are.
    let found = flip(30, &[[0.0, 1.0, 0.0]; 900], &[[0.0, 0.0, 1.0]; 900]);
    assert!((found - 1.0).abs() < 1e-9, "{found}");
}

#[test]
fn either_image_may_be_the_reference() {
    let [image, reference] = [1, 2].map(|seed| noise(31 * 29, seed));
    let found = [flip(31, &image, &reference), flip(31, &reference, &image)];
    assert_eq!(found[0].to_bits(), found[1].to_bits());
    assert!(found[0] > 0.0 && found[0] < 1.0, "{found:?}");
}

#[test]
fn one_pixel_makes_a_small_difference_that_grows_with_its_contrast() {
    let reference = vec![[0.2; 3]; 64 * 64];
    let of_value = |value: f32| {
        let mut image = reference.clone();
        image[32 * 64 + 32] = [value; 3];
        flip(64, &image, &reference)
    };
    let found = [0.2, 0.21, 0.3, 0.5, 1.0].map(of_value);
    assert!(found[0] == 0.0 && found.windows(2).all(|pair| pair[0] < pair[1]) && found[4] < 0.02, "{found:?}");
}

#[test]
fn strips_and_threads_change_no_bit() {
    let (width, height) = (9, 83);
    let [image, reference] = [3, 4].map(|seed| noise(width * height, seed));
    let in_strips = |rows: usize| {
        let mut comparison = FlipComparison::new(width as u32, -0.5, ToneCurve::Filmic);
        for (image, reference) in image.chunks(rows * width).zip(reference.chunks(rows * width)) {
            comparison.add(image, reference).unwrap();
        }
        comparison.finish().unwrap().to_bits()
    };
    let found = [height, 1, 7, 32, 50].map(in_strips);
    assert!(found.iter().all(|bits| *bits == found[0]), "{found:x?}");
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one_thread.install(|| in_strips(7)), found[0]);
}

#[test]
fn what_is_kept_is_bounded_by_the_width() {
    let mut comparison = FlipComparison::new(8, 0.0, ToneCurve::Srgb);
    let rows = noise(8 * 200, 5);
    comparison.add(&rows, &rows).unwrap();
    assert_eq!((comparison.done, comparison.image.end()), (200 - RADIUS, 200));
    assert_eq!(FlipComparison::bytes(8), 2 * 52 * 8 * 7 * 8);
}

#[test]
fn values_that_are_no_numbers_are_shown_as_black_or_white() {
    let reference = noise(12 * 12, 6);
    let with = |value: f32| {
        let mut image = reference.clone();
        image[50] = [value, value, value];
        image
    };
    for (odd, shown) in [(f32::NAN, 0.0), (f32::NEG_INFINITY, 0.0), (-3.0, 0.0), (f32::INFINITY, 1.0), (f32::MAX, 1.0)]
    {
        assert_eq!(flip(12, &with(odd), &with(shown)), 0.0, "{odd}");
        assert_eq!(flip(12, &reference, &with(odd)), flip(12, &reference, &with(shown)), "{odd}");
    }
    for stops in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut comparison = FlipComparison::new(12, stops, ToneCurve::Filmic);
        comparison.add(&reference, &with(1.0)).unwrap();
        let found = comparison.finish().unwrap();
        assert!((0.0..=1.0).contains(&found), "{stops}: {found}");
    }
}

#[test]
fn rows_that_are_not_whole_or_not_as_many_are_refused() {
    let mut comparison = FlipComparison::new(4, 0.0, ToneCurve::Srgb);
    let pixels = noise(8, 7);
    let error = comparison.add(&pixels, &pixels[..4]).unwrap_err();
    assert_eq!(error, FlipError { image: 8, reference: 4, width: 4 });
    assert!(comparison.add(&pixels[..6], &pixels[..6]).is_err());
    assert_eq!(comparison.finish(), None);
    let error = mean_flip(&frame(4, pixels.clone()), &frame(2, pixels), ToneCurve::Filmic).unwrap_err();
    assert_eq!(error, CompareError::DifferentSizes { image: [4, 2], reference: [2, 4] });
}

#[test]
fn the_exposure_is_that_of_a_preview_to_the_last_bit() {
    let mut pixels = noise(10 * 30, 8);
    pixels[..50].fill([0.0; 3]);
    pixels[50..60].fill([1e-7; 3]);
    for pixels in [pixels, vec![[0.0; 3]; 300]] {
        for strip in [1, 70, 300] {
            let mut mean = MeanLuminance::new();
            pixels.chunks(strip).for_each(|pixels| mean.add(pixels));
            let mut exposure = mean.finish();
            pixels.chunks(strip).for_each(|pixels| exposure.add(pixels));
            let expected = automatic_stops(&frame(10, pixels.clone()));
            assert_eq!(exposure.finish().to_bits(), expected.to_bits());
        }
    }
}

#[test]
fn what_is_compared_is_what_a_preview_shows() {
    let pixels: Pixels = (0..64_u8).map(|step| [f32::from(step) * 0.05, f32::from(step) * 0.003, -1.0]).collect();
    for curve in [ToneCurve::Srgb, ToneCurve::Filmic] {
        let observer = Observer::new(0.7, curve);
        let settings = PreviewSettings { exposure: Exposure::Stops(0.7), curve };
        let png = encode_png(&frame(8, pixels.clone()), &settings).unwrap();
        let codes = pixels.iter().map(|pixel| {
            pixel.map(|radiance| {
                let linear = observer.shown(radiance);
                let is_dark = linear <= 0.003_130_8;
                let encoded = if is_dark { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
                (255.0 * encoded).round() as u8
            })
        });
        let shown = image::load_from_memory(&png).unwrap().into_rgb8();
        assert!(shown.pixels().map(|pixel| pixel.0).eq(codes), "{curve:?}");
    }
}

#[test]
fn filters_reach_three_standard_deviations() {
    assert!((PIXELS_PER_DEGREE - 67.020_643).abs() < 1e-6);
    let pi = std::f64::consts::PI;
    let widest = BLUE_YELLOW.map(|(_, spread)| (spread / (2.0 * pi * pi)).sqrt()).into_iter().fold(0.0, f64::max);
    assert_eq!((3.0 * widest * PIXELS_PER_DEGREE).ceil(), RADIUS as f64);
    assert_eq!((1.5 * EDGE_WIDTH * PIXELS_PER_DEGREE).ceil(), FEATURE_RADIUS as f64);
}

#[test]
fn rows_and_columns_in_turn_give_what_the_whole_filters_give() {
    for (number, (width, height)) in [(17, 13), (1, 9), (12, 1), (25, 30)].into_iter().enumerate() {
        let reference = noise(width * height, 20 + number as u64);
        let mut similar = reference.clone();
        similar.iter_mut().step_by(5).for_each(|pixel| pixel[1] = 1.0 - pixel[1]);
        for image in [similar, noise(width * height, 30 + number as u64), vec![[0.5, 0.1, 0.9]; width * height]] {
            let found = flip(width as u32, &image, &reference);
            let expected = direct::mean_flip(&image, &reference, [width as i64, height as i64]);
            assert!((found - expected).abs() < 1e-6, "{width} x {height}: {found} for {expected}");
            assert!((0.0..=1.0).contains(&found));
        }
    }
}

#[test]
fn the_program_of_the_authors_finds_the_same() {
    // By flip-evaluator 1.7 (PyPI), in single precision: `evaluate(reference, image, "LDR", inputsRGB=False)`.
    let places = || (0..40_u16).flat_map(|y| (0..48_u16).map(move |x| (x, y)));
    let part = |number: u16, whole: u16| f32::from(number) / f32::from(whole);
    let pattern = |(x, y): (u16, u16)| {
        [part((7 * x + 13 * y) % 17, 16), part((x * x + y) % 23, 22), part((x / 6 + y / 5) % 4, 3)]
    };
    let changed = |(x, y): (u16, u16)| {
        let [red, green, blue] = pattern((x, y));
        let green = if (x + y).is_multiple_of(5) { 1.0 - green } else { green };
        let blue = if (10..30).contains(&x) && (10..20).contains(&y) { 0.5 * blue } else { blue };
        [red, green, blue]
    };
    let slope = |(x, y): (u16, u16)| [part(x, 47), part(y, 39), part(x + y, 86)];
    let found = flip(48, &places().map(changed).collect::<Pixels>(), &places().map(pattern).collect::<Pixels>());
    assert!((found - 0.308_297_4).abs() < 1e-6, "{found}");
    let darker = |place: (u16, u16)| slope(place).map(|value| 0.9 * value);
    let found = flip(48, &places().map(darker).collect::<Pixels>(), &places().map(slope).collect::<Pixels>());
    assert!((found - 0.198_294_8).abs() < 1e-6, "{found}");
}

/// The paper's formulas as they stand: filters of the plane, whole images, and numbers of their own.
mod direct {
    use std::f64::consts::PI;

    type Plane = Vec<f64>;
    type Filter = Vec<(i64, i64, f64)>;

    fn filter(radius: i64, weight: impl Fn(f64, f64) -> f64) -> Filter {
        let places = (-radius..=radius).flat_map(|y| (-radius..=radius).map(move |x| (x, y)));
        let weights: Filter = places.map(|(x, y)| (x, y, weight(x as f64, y as f64))).collect();
        let positive: f64 = weights.iter().map(|(_, _, weight)| weight.max(0.0)).sum();
        let negative: f64 = weights.iter().map(|(_, _, weight)| weight.min(0.0)).sum();
        let normalize = |weight: f64| if weight < 0.0 { -weight / negative } else { weight / positive };
        weights.into_iter().map(|(x, y, weight)| (x, y, normalize(weight))).collect()
    }

    fn filtered(plane: &[f64], [width, height]: [i64; 2], filter: &[(i64, i64, f64)]) -> Plane {
        let value = |x: i64, y: i64| plane[(y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as usize];
        let at = |x: i64, y: i64| filter.iter().map(|(dx, dy, weight)| weight * value(x + dx, y + dy)).sum::<f64>();
        (0..width * height).map(|place| at(place % width, place / width)).collect()
    }

    fn xyz([r, g, b]: [f64; 3]) -> [f64; 3] {
        [
            (10135552.0 * r + 8788810.0 * g + 4435075.0 * b) / 24577794.0,
            (2613072.0 * r + 8788810.0 * g + 887015.0 * b) / 12288897.0,
            (1425312.0 * r + 8788810.0 * g + 70074185.0 * b) / 73733382.0,
        ]
    }

    /// The inverse, to nine digits.
    fn rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
        [
            3.241003275 * x - 1.537398934 * y - 0.498615861 * z,
            -0.969224334 * x + 1.875930071 * y + 0.041554224 * z,
            0.055639423 * x - 0.204011202 * y + 1.057148933 * z,
        ]
    }

    const WHITE: [f64; 3] = [0.950428545, 1.0, 1.088900371];

    fn lab(rgb: [f64; 3]) -> [f64; 3] {
        let xyz = xyz(rgb);
        let [x, y, z]: [f64; 3] = std::array::from_fn(|channel| {
            let t = xyz[channel] / WHITE[channel];
            if t > 216.0 / 24389.0 { libm::cbrt(t) } else { 841.0 / 108.0 * t + 4.0 / 29.0 }
        });
        let lightness = 116.0 * y - 16.0;
        [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
    }

    fn hyab(first: [f64; 3], second: [f64; 3]) -> f64 {
        (first[0] - second[0]).abs() + libm::hypot(first[1] - second[1], first[2] - second[2])
    }

    /// Color, edge and point of each pixel.
    fn seen(image: &[[f32; 3]], size: [i64; 2]) -> Vec<([f64; 3], f64, f64)> {
        let pixels_per_degree = 3840.0 * PI / 180.0;
        let opponents: Vec<[f64; 3]> = image
            .iter()
            .map(|pixel| {
                let xyz = xyz(pixel.map(f64::from));
                let [x, y, z]: [f64; 3] = std::array::from_fn(|channel| xyz[channel] / WHITE[channel]);
                [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
            })
            .collect();
        let plane = |channel: usize| opponents.iter().map(|pixel| pixel[channel]).collect::<Plane>();
        let contrast = |parts: &[(f64, f64)]| {
            filter(10, |x, y| {
                let square = (x * x + y * y) / (pixels_per_degree * pixels_per_degree);
                parts.iter().map(|(a, b)| a * (PI / b).sqrt() * libm::exp(-PI * PI * square / b)).sum()
            })
        };
        let y = filtered(&plane(0), size, &contrast(&[(1.0, 0.0047)]));
        let cx = filtered(&plane(1), size, &contrast(&[(1.0, 0.0053)]));
        let cz = filtered(&plane(2), size, &contrast(&[(34.1, 0.04), (13.5, 0.025)]));
        let achromatic: Plane = plane(0).iter().map(|y| (y + 16.0) / 116.0).collect();
        let deviation = 0.5 * 0.082 * pixels_per_degree;
        let gaussian = |x: f64, y: f64| libm::exp(-(x * x + y * y) / (2.0 * deviation * deviation));
        let edge = |along: f64, across: f64| -along * gaussian(along, across);
        let point = |along: f64, across: f64| (along * along / (deviation * deviation) - 1.0) * gaussian(along, across);
        let edges = [filter(9, edge), filter(9, |x, y| edge(y, x))];
        let points = [filter(9, point), filter(9, |x, y| point(y, x))];
        let [edges, points] = [edges, points].map(|filters| {
            let [x, y] = filters.map(|filter| filtered(&achromatic, size, &filter));
            x.iter().zip(&y).map(|(x, y)| libm::hypot(*x, *y)).collect::<Plane>()
        });
        (0..image.len())
            .map(|pixel| {
                let middle = (y[pixel] + 16.0) / 116.0;
                let relative = [middle + cx[pixel] / 500.0, middle, middle - cz[pixel] / 200.0];
                let linear = rgb(std::array::from_fn(|channel| relative[channel] * WHITE[channel]));
                (lab(linear.map(|value| value.clamp(0.0, 1.0))), edges[pixel], points[pixel])
            })
            .collect()
    }

    pub(super) fn mean_flip(image: &[[f32; 3]], reference: &[[f32; 3]], size: [i64; 2]) -> f64 {
        let largest = libm::pow(hyab(lab([0.0, 1.0, 0.0]), lab([0.0, 0.0, 1.0])), 0.7);
        let pixels = seen(image, size).into_iter().zip(seen(reference, size));
        let differences = pixels.map(|(image, reference)| {
            let distance = libm::pow(hyab(image.0, reference.0), 0.7);
            let knee = 0.4 * largest;
            let color = if distance < knee {
                0.95 / knee * distance
            } else {
                0.95 + (distance - knee) / (largest - knee) * 0.05
            };
            let feature = (image.1 - reference.1).abs().max((image.2 - reference.2).abs());
            libm::pow(color, 1.0 - (feature / 2.0_f64.sqrt()).sqrt())
        });
        differences.sum::<f64>() / image.len() as f64
    }
}
