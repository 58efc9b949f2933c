//! A pass of the light plane: light subpaths whose splats are summed over the frame, or over some of its rows.
//!
//! Subpaths are traced on all cores, and their splats are added in the order of the subpaths. So the sums do not depend
//! on the number of threads nor on the rows, and there is one buffer.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;
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
    /// Pixels across the frame.
    pub(super) width: u32,
    /// Rows whose splats are summed; others are dropped.
    pub(super) rows: Range<u32>,
    pub(super) has_caustic: bool,
    pub(super) cancelled: &'a AtomicBool,
}

/// The sums of the splats of a pass, for each pixel of the rows.
pub(super) struct SplatSums {
    /// Of all splats.
    pub(super) all: Vec<DVec3>,
    /// Of those that are caustic, where the film has that layer.
    pub(super) caustic: Option<Vec<DVec3>>,
}

/// A splat with the number of its pixel in the rows.
struct PlacedSplat {
    pixel: u32,
    is_caustic: bool,
    radiance: DVec3,
}

impl LightPass<'_> {
    /// The sums of the splats of a number of light subpaths.
    pub(super) fn splats(&self, frame: u32, pass: u32, subpaths: u64) -> (SplatSums, Counters) {
        let black = || vec![DVec3::ZERO; self.width as usize * self.rows.len()];
        let mut sums = SplatSums { all: black(), caustic: self.has_caustic.then(black) };
        let mut counters = Counters::default();
        let groups = subpaths.div_ceil(GROUP);
        for first in (0..groups).step_by(GROUPS as usize) {
            let some = (first..groups.min(first + GROUPS)).into_par_iter();
            let traced: Vec<_> = some.map(|group| self.group(frame, pass, group, subpaths)).collect();
            for (splats, of_group) in traced {
                counters += of_group;
                for PlacedSplat { pixel, is_caustic, radiance } in splats {
                    sums.all[pixel as usize] += radiance;
                    if let Some(caustic) = sums.caustic.as_mut().filter(|_| is_caustic) {
                        caustic[pixel as usize] += radiance;
                    }
                }
            }
        }
        (sums, counters)
    }

    /// The splats of a group.
    fn group(&self, frame: u32, pass: u32, group: u64, subpaths: u64) -> (Vec<PlacedSplat>, Counters) {
        let (mut splats, mut counters) = (Vec::new(), Counters::default());
        for number in group * GROUP..subpaths.min((group + 1) * GROUP) {
            if self.cancelled.load(Ordering::Relaxed) {
                break;
            }
            let mut stream = SampleStream::of_light(self.seed, frame, pass, number);
            self.tracer.splat(&mut stream, &mut counters, |splat| {
                let [x, y] = splat.pixel;
                if self.rows.contains(&y) {
                    let (is_caustic, radiance) = (splat.is_caustic, splat.radiance);
                    splats.push(PlacedSplat { pixel: (y - self.rows.start) * self.width + x, is_caustic, radiance });
                }
            });
        }
        (splats, counters)
    }
}
