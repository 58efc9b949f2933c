//! A pass of the light plane: light subpaths whose splats are summed over the whole frame.
//!
//! Subpaths are traced on all cores, and their splats are added in the order of the subpaths. So the sums do not depend
//! on the number of threads, and a frame has one buffer.

use std::sync::atomic::{AtomicBool, Ordering};

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, Tile};
use glam::DVec3;
use rayon::prelude::*;

use super::path::PathTracer;

/// Subpaths that one thread traces at a time.
const GROUP: u64 = 1 << 10;

/// Groups whose splats are in memory before they are added.
const GROUPS: u64 = 64;

/// What a pass of the light plane is traced with.
pub(super) struct LightPass<'a> {
    pub(super) tracer: &'a PathTracer<'a>,
    pub(super) seed: u64,
    /// The whole frame.
    pub(super) tile: Tile,
    pub(super) cancelled: &'a AtomicBool,
}

impl LightPass<'_> {
    /// The sums of the splats of a number of light subpaths, for each pixel of the frame.
    pub(super) fn splats(&self, frame: u32, pass: u32, subpaths: u64) -> (Vec<DVec3>, Counters) {
        let mut sums = vec![DVec3::ZERO; self.tile.pixels()];
        let mut counters = Counters::default();
        let groups = subpaths.div_ceil(GROUP);
        for first in (0..groups).step_by(GROUPS as usize) {
            let some = (first..groups.min(first + GROUPS)).into_par_iter();
            let traced: Vec<_> = some.map(|group| self.group(frame, pass, group, subpaths)).collect();
            for (splats, of_group) in traced {
                counters += of_group;
                for (pixel, radiance) in splats {
                    sums[pixel as usize] += radiance;
                }
            }
        }
        (sums, counters)
    }

    /// The splats of a group, each with the number of its pixel.
    fn group(&self, frame: u32, pass: u32, group: u64, subpaths: u64) -> (Vec<(u32, DVec3)>, Counters) {
        let (mut splats, mut counters) = (Vec::new(), Counters::default());
        for number in group * GROUP..subpaths.min((group + 1) * GROUP) {
            if self.cancelled.load(Ordering::Relaxed) {
                break;
            }
            let mut stream = SampleStream::of_light(self.seed, frame, pass, number);
            self.tracer.splat(&mut stream, &mut counters, |splat| {
                let [x, y] = splat.pixel;
                splats.push((y * self.tile.width + x, splat.radiance));
            });
        }
        (splats, counters)
    }
}
