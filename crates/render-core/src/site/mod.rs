//! A place on earth and an hour of its light: calendars, kinds of time, feasts, the sun and the sky.
//!
//! A [`Moment`] is what a source says: a date of a [`Calendar`] and an hour in a [kind of time](KindOfTime). At a
//! [`Place`] it becomes a [`UniversalTime`], and [`sun_position`] says where the sun stands then. [`ShownTimes`] says a
//! time in all kinds.
//!
//! The astronomy is that of the crate `solar-positioning` (Reda and Andreas 2004, NREL TP-560-34302). Its
//! transcendental functions are those of `libm`, so that every machine computes the same bits.

mod calendar;
mod day;
mod error;
mod feast;
mod hour;
mod kind_of_time;
mod moment;
mod place;
mod shown_times;
mod sky;
mod sun_position;
mod sunlight;
mod universal_time;

#[cfg(test)]
mod tests;

pub use calendar::Calendar;
pub use day::Day;
pub use error::SiteError;
pub use hour::{HourReading, NamedHour};
pub use kind_of_time::KindOfTime;
pub use moment::{Moment, Remark};
pub use place::Place;
pub use shown_times::ShownTimes;
pub use sky::{PerezSky, SkyDistribution};
pub use sun_position::{SunPosition, sun_position};
pub use sunlight::{LUMINOUS_EFFICACY, clear_skylight, clear_sunlight, sunlight_colour};
pub use universal_time::{Civil, UniversalTime};
