//! Options that say when a scene is: at one moment, or at many, which are its frames.

use std::collections::BTreeMap;
use std::str::FromStr;

use clap::Args;
use clerestory_render_core::document::{FrameDescription, MomentDescription, SceneDescription};

use crate::failure::Failure;

/// Minutes of a day.
const DAY: u32 = 24 * 60;

/// When a scene is.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct MomentOptions {
    /// The moment of the scene: a date or a feast, and an hour, such as 1250-christmasTterce.
    #[arg(long, value_name = "MOMENT", allow_hyphen_values = true, conflicts_with = "times")]
    at: Option<String>,
    /// Frames at many hours of a day, the first, the last and the step between: 1250-12-25T06:00..18:00/30min.
    #[arg(long, value_name = "RANGE")]
    times: Option<TimeRange>,
    /// Calendar of the date: gregorian, julian, rome, france, britain, russia, or the first Gregorian day of one that
    /// changed.
    #[arg(long)]
    calendar: Option<String>,
    /// Kind of time of hours without a zone: utc, mean, apparent, seasonal, italian or babylonian.
    #[arg(long = "time-kind", value_name = "KIND")]
    kind: Option<String>,
}

/// Hours of a day.
#[derive(Clone, Debug, PartialEq, Eq)]
struct TimeRange {
    date: String,
    first: u32,
    last: u32,
    /// Minutes.
    step: u32,
}

impl FromStr for TimeRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = || {
            let (date, hours) = text.split_once(['T', ' '])?;
            let (hours, step) = hours.split_once('/')?;
            let (first, last) = hours.split_once("..")?;
            let step = step.strip_suffix("min")?.parse().ok()?;
            Some(Self { date: date.to_owned(), first: minutes(first)?, last: minutes(last)?, step })
        };
        let is_right = |range: &Self| range.first <= range.last && range.step > 0;
        let expected =
            "expected a date, the first and the last hour, and the step, such as 1250-12-25T06:00..18:00/30min";
        parsed().filter(is_right).ok_or_else(|| expected.to_owned())
    }
}

/// Minutes since midnight of `06:30`.
fn minutes(text: &str) -> Option<u32> {
    let (hours, minutes) = text.split_once(':')?;
    let (hours, minutes): (u32, u32) = (hours.parse().ok()?, minutes.parse().ok()?);
    let total = hours.checked_mul(60)?.checked_add(minutes)?;
    (minutes < 60 && total <= DAY).then_some(total)
}

impl TimeRange {
    /// The hours, as a moment has them.
    fn hours(&self) -> impl Iterator<Item = String> {
        let count = (self.last - self.first) / self.step + 1;
        let hour = |minutes: u32| format!("{:02}:{:02}", minutes / 60, minutes % 60);
        (0..count).map(move |number| hour(self.first + number * self.step))
    }
}

impl MomentOptions {
    /// Changes the moment of a scene, or gives it a timeline.
    pub(crate) fn apply(&self, scene: &mut SceneDescription) -> Result<(), Failure> {
        let Self { at, times, calendar, kind } = self;
        let first = times.as_ref().map(|range| format!("{}T{}", range.date, range.hours().next().unwrap_or_default()));
        let at = at.clone().or(first).or_else(|| scene.moment.as_ref().map(|moment| moment.at.clone()));
        let Some(at) = at else {
            if calendar.is_none() && kind.is_none() {
                return Ok(());
            }
            let expected = "--calendar and --time-kind are for a moment: expected --at or --times, or a scene with one";
            return Err(Failure::Usage(expected.to_owned()));
        };
        if self.is_given() {
            let before = scene.moment.take();
            let of = |own: &Option<String>, before: Option<String>| own.clone().or(before);
            scene.moment = Some(MomentDescription {
                at,
                calendar: of(calendar, before.as_ref().and_then(|moment| moment.calendar.clone())),
                time: of(kind, before.as_ref().and_then(|moment| moment.time.clone())),
                hour_reading: before.and_then(|moment| moment.hour_reading),
            });
        }
        if let Some(range) = times {
            if !scene.timeline.is_empty() {
                let found = scene.timeline.len();
                return Err(Failure::Usage(format!(
                    "--times: the scene has a timeline of {found} frames already: expected a scene without one"
                )));
            }
            let frame = |hour: String| FrameDescription {
                set: BTreeMap::from([("moment.at".to_owned(), format!("{}T{hour}", range.date).into())]),
                name: hour,
            };
            scene.timeline = range.hours().map(frame).collect();
        }
        Ok(())
    }

    fn is_given(&self) -> bool {
        self.at.is_some() || self.times.is_some() || self.calendar.is_some() || self.kind.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_of_times_has_a_frame_for_each_step() {
        let range: TimeRange = "1250-12-25T06:00..18:00/30min".parse().unwrap();
        let hours: Vec<String> = range.hours().collect();
        assert_eq!((hours.len(), hours[0].as_str(), hours[24].as_str()), (25, "06:00", "18:00"));
        let uneven: TimeRange = "1250-easter 9:05..10:00/20min".parse().unwrap();
        assert_eq!(uneven.hours().collect::<Vec<_>>(), ["09:05", "09:25", "09:45"]);
        for text in [
            "",
            "1250-12-25",
            "1250-12-25T06:00..18:00",
            "1250-12-25T18:00..06:00/30min",
            "1250-12-25T06:00..18:00/0min",
            "1250-12-25T06:00..25:00/30min",
            "1250-12-25T06:00..18:00/30",
        ] {
            assert!(text.parse::<TimeRange>().is_err_and(|message| message.contains("30min")), "{text}");
        }
    }
}
