//! What the types of a scene file cannot say of the file as a whole.

use super::{PathFilter, SamplingDescription, SceneDescription};
use crate::settings::check::{Quoted, check_name, check_range};
use crate::settings::{Check, JsonPath, SceneError, is_readable};

/// A path filter names a few events.
const MAX_PATH_FILTER_BYTES: usize = 1000;

/// Most samples that share one scramble: the sequence has no more points.
const MAX_SAMPLES_PER_BLOCK: u32 = 1 << 16;

/// Most frames of a timeline.
const MOST_FRAMES: usize = 1 << 16;

impl SceneDescription {
    /// Checks everything that can be checked without the assets.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong, with its place, what stands there and what would be right.
    pub fn validate(&self) -> Result<(), SceneError> {
        let root = JsonPath::Root;
        if !is_readable(self.version.into()) {
            return Err(SceneError::UnsupportedVersion { found: self.version.to_string() });
        }
        check_name(&self.name, &root.member("name"))?;
        self.parts().check_view()?;
        self.check_integrator(&root.member("integrator"))?;
        self.compiled_path_filter()?;
        check_sampling(self.sampling, &root.member("sampling"))?;
        self.check_timeline(&root.member("timeline"))?;
        self.check_daylight()?;
        self.parts().check_things()?;
        // The names of imported things, and of those of windows and paints, are known once they are expanded.
        if self.is_expanded() { self.check_integrator_names(&root.member("integrator")) } else { Ok(()) }
    }

    /// Whether there are not too many frames. What they set is checked with the files that they name.
    fn check_timeline(&self, path: &JsonPath<'_>) -> Check {
        let frames = self.timeline.len();
        if frames > MOST_FRAMES {
            return Err(SceneError::value(
                path,
                format_args!("{frames} frames"),
                format_args!("at most {MOST_FRAMES}"),
            ));
        }
        let named = self.timeline.iter().enumerate().filter(|(_, frame)| !frame.name.is_empty());
        for (number, frame) in named {
            check_name(&frame.name, &path.element(number).member("name"))?;
        }
        Ok(())
    }

    /// The path filter, if there is one, ready for use.
    pub(crate) fn compiled_path_filter(&self) -> Result<Option<PathFilter>, SceneError> {
        let Some(expression) = &self.path_filter else { return Ok(None) };
        let root = JsonPath::Root;
        let error = |expected: String| SceneError::value(&root.member("path_filter"), Quoted(expression), expected);
        if expression.len() > MAX_PATH_FILTER_BYTES {
            return Err(error(format!("at most {MAX_PATH_FILTER_BYTES} bytes")));
        }
        let compiled = PathFilter::parse(expression);
        compiled.map(Some).map_err(|reason| error(format!("a light path expression such as \"D TT L\": {reason}")))
    }
}

fn check_sampling(sampling: SamplingDescription, path: &JsonPath<'_>) -> Check {
    let SamplingDescription { samples_per_pass, samples_per_block } = sampling;
    check_range(samples_per_pass, 1, MAX_SAMPLES_PER_BLOCK, &path.member("samples_per_pass"))?;
    check_range(samples_per_block, 1, MAX_SAMPLES_PER_BLOCK, &path.member("samples_per_block"))?;
    let passes = samples_per_block / samples_per_pass;
    if !samples_per_block.is_multiple_of(samples_per_pass) || !passes.is_power_of_two() {
        let expected = format!("a power of two times samples_per_pass ({samples_per_pass})");
        return Err(SceneError::value(&path.member("samples_per_block"), samples_per_block, expected));
    }
    Ok(())
}
