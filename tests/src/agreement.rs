//! Whether two ways to render the same light agree, in pictures of 8 x 8 pixels.

use clerestory_render_core::scene::Scene;

use crate::rendering::Rendering;

/// Pixels along the edge of a block.
const BLOCK: usize = 2;

/// Pixels along the edge of the picture.
const EDGE: usize = 8;

/// The mean of each block of pixels over all passes, and the variance of that mean.
pub fn render_blocks(scene: &Scene, passes: u32) -> Vec<(f64, f64)> {
    let mut rendering = Rendering::new(scene);
    let mut sums = vec![(0.0, 0.0); EDGE * EDGE / (BLOCK * BLOCK)];
    let mut before = vec![0.0; sums.len()];
    for _ in 0..passes {
        rendering.render_pass().expect("finite samples");
        let image = rendering.image();
        let mut total = vec![0.0; sums.len()];
        for (index, pixel) in image.pixels.iter().enumerate() {
            total[index / EDGE / BLOCK * (EDGE / BLOCK) + index % EDGE / BLOCK] +=
                pixel.x * f64::from(rendering.passes());
        }
        for ((sum, before), total) in sums.iter_mut().zip(&mut before).zip(total) {
            let value = total - *before;
            *before = total;
            *sum = (sum.0 + value, sum.1 + value * value);
        }
    }
    let count = f64::from(passes);
    let mean = |&(sum, squares): &(f64, f64)| {
        let mean = sum / count;
        (mean, (squares / count - mean * mean).max(0.0) / (count - 1.0))
    };
    sums.iter().map(mean).collect()
}

/// Of 16 deviates the largest exceeds this by chance once in 4 000 times.
const LARGEST_DEVIATE: f64 = 4.2;

/// Checks that two ways to render the same light agree in every block and on the whole, and that the whole would not agree
/// if one of them were scaled by `1 + fault`.
#[track_caller]
pub fn check_agreement(name: &str, ours: &[(f64, f64)], theirs: &[(f64, f64)], fault: f64) {
    let deviate = |(mean, variance): (f64, f64), (other, other_variance): (f64, f64)| {
        (mean - other) / (variance + other_variance).sqrt()
    };
    let total = |pixels: &[(f64, f64)]| pixels.iter().fold((0.0, 0.0), |sum, pixel| (sum.0 + pixel.0, sum.1 + pixel.1));
    let whole = deviate(total(ours), total(theirs));
    let largest = ours
        .iter()
        .zip(theirs)
        .map(|(a, b)| deviate(*a, *b))
        .filter(|z| z.is_finite())
        .fold(0.0, |l: f64, z| l.max(z.abs()));
    let (sum, variance) = total(ours);
    println!(
        "{name}: {:.4} of the path tracer's light, standard error {:.4}; {whole:.2} deviates, blocks {largest:.2}",
        sum / total(theirs).0,
        ((variance + total(theirs).1).sqrt()) / sum
    );
    assert!(whole.abs() < LARGEST_DEVIATE && largest < LARGEST_DEVIATE, "{name}");
    let scaled: Vec<_> = ours.iter().map(|(mean, variance)| (mean * (1.0 + fault), *variance)).collect();
    assert!(
        deviate(total(&scaled), total(theirs)).abs() > LARGEST_DEVIATE,
        "{name}: a fault of {fault} is not noticed"
    );
}
