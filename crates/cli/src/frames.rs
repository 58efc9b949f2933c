//! The frames of a scene with a timeline: which of them a command renders, and the names of their files.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use clerestory_render_core::document::SceneDescription;

use crate::failure::Failure;

/// Which frames.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct FrameArguments {
    /// The one frame of the scene's timeline to render, from 0.
    #[arg(long, value_name = "N", conflicts_with = "frames")]
    frame: Option<u32>,
    /// The first and the last frame to render, such as 0..23 [default: all of the scene's timeline].
    #[arg(long, value_name = "FIRST..LAST")]
    frames: Option<FrameRange>,
}

/// Some frames one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct FrameRange {
    first: u32,
    last: u32,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once("..").and_then(|(first, last)| Some((first.parse().ok()?, last.parse().ok()?)));
        let range = numbers.filter(|(first, last)| first <= last).map(|(first, last)| Self { first, last });
        range.ok_or_else(|| "expected the first and the last frame, such as 0..23".to_owned())
    }
}

impl FrameArguments {
    /// The frames of a scene.
    pub(crate) fn chosen(self, scene: &SceneDescription) -> Result<RangeInclusive<u32>, Failure> {
        let last = scene.frames() - 1;
        let (option, chosen) = match (self.frame, self.frames) {
            (Some(frame), _) => ("--frame", frame..=frame),
            (None, Some(FrameRange { first, last })) => ("--frames", first..=last),
            (None, None) => return Ok(0..=last),
        };
        if *chosen.end() <= last {
            return Ok(chosen);
        }
        let expected = match scene.timeline.is_empty() {
            true => "0, because the scene has no timeline".to_owned(),
            false => format!("at most {last}, the last frame of the scene's timeline"),
        };
        Err(Failure::Usage(format!("{option}: found {}, expected {expected}", chosen.end())))
    }
}

/// The file of a frame. The last run of `#` in a name is where its number goes, with a digit for each of them at least.
pub(crate) fn file_of_frame(pattern: &Path, frame: u32) -> PathBuf {
    let Some((before, width, behind)) = divided(pattern) else { return pattern.to_owned() };
    pattern.with_file_name(format!("{before}{frame:0width$}{behind}"))
}

/// Refuses a name that several frames would share. Each name comes with its option.
pub(crate) fn check_names(names: &[(&str, Option<&Path>)]) -> Result<(), Failure> {
    let shared =
        names.iter().find_map(|(option, name)| Some((*option, (*name)?)).filter(|(_, name)| divided(name).is_none()));
    match shared {
        Some((option, name)) => Err(Failure::Usage(format!(
            "{option}: found {} for several frames, expected a name with #### in the place of their numbers",
            name.display()
        ))),
        None => Ok(()),
    }
}

/// A file name before and behind its last run of `#`, and the length of that.
fn divided(pattern: &Path) -> Option<(&str, usize, &str)> {
    let name = pattern.file_name()?.to_str()?;
    let end = name.rfind('#')? + 1;
    let before = name[..end].trim_end_matches('#');
    Some((before, end - before.len(), &name[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_a_frame_is_in_the_place_of_its_signs() {
        let file = |pattern: &str, frame| file_of_frame(Path::new(pattern), frame).to_str().unwrap().to_owned();
        assert_eq!(file("out/day-####.exr", 7), "out/day-0007.exr");
        assert_eq!(file("day-##.exr", 123), "day-123.exr");
        assert_eq!(file("#1/a#b##.exr", 5), "#1/a#b05.exr");
        assert_eq!(file("day.exr", 5), "day.exr");
        let error =
            check_names(&[("--png", None), ("--output", Some(Path::new("#/day.exr")))]).unwrap_err().to_string();
        assert!(error.contains("--output") && error.contains("day.exr") && error.contains("####"), "{error}");
        assert!(check_names(&[("--output", Some(Path::new("day#.exr")))]).is_ok());
    }

    #[test]
    fn frames_are_a_first_and_a_last_one() {
        assert_eq!("0..23".parse(), Ok(FrameRange { first: 0, last: 23 }));
        for text in ["5", "..", "5..", "..5", "5..4", "a..b", "1..2..3", ""] {
            assert!(text.parse::<FrameRange>().is_err_and(|message| message.contains("0..23")), "{text}");
        }
    }
}
