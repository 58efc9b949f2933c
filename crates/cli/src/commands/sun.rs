//! `clerestory sun`: where the sun stands at a place and a moment, and what clocks of all kinds show then.

use clap::Args;
use clerestory_render_core::site::{
    Calendar, Civil, Day, HourReading, KindOfTime, Moment, NamedHour, Place, ShownTimes, SiteError, SunPosition,
    UniversalTime, sun_position,
};
use serde::Serialize;

use crate::failure::Failure;
use crate::output::{print_json, print_line};
use crate::progress::Progress;

/// Options of `clerestory sun`.
#[derive(Debug, Args)]
#[command(
    after_help = "A moment is a date or a feast, and an hour: 2003-10-17T12:30:30-07:00, 1250-12-25T08:30 with --time \
                  apparent, 1250-christmasTterce. docs/daylight.md has the feasts, hours, calendars and kinds of time."
)]
pub(crate) struct SunArguments {
    /// Latitude of the place, degrees; north is positive.
    #[arg(long, value_name = "DEGREES")]
    latitude: f64,
    /// Longitude of the place, degrees; east is positive.
    #[arg(long, value_name = "DEGREES")]
    longitude: f64,
    /// Elevation above sea level, m.
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    elevation: f64,
    /// Pressure of the air, hPa, for the refraction [default: that of the standard atmosphere].
    #[arg(long, value_name = "HPA")]
    pressure: Option<f64>,
    /// Temperature of the air, degrees Celsius, for the refraction [default: that of the standard atmosphere].
    #[arg(long, value_name = "DEGREES")]
    temperature: Option<f64>,
    /// The moment: a date or a feast, T, and an hour.
    #[arg(long, value_name = "MOMENT", allow_hyphen_values = true)]
    at: String,
    /// Calendar of the date: gregorian, julian, rome, france, britain, russia, or the first Gregorian day of one that
    /// changed.
    #[arg(long)]
    calendar: Option<Calendar>,
    /// Kind of time of the hour, if it names no zone: utc, mean, apparent, seasonal, italian or babylonian.
    #[arg(long, alias = "time-kind", value_name = "KIND")]
    time: Option<KindOfTime>,
    /// When a canonical hour is: at the beginning, in the middle or at the end of its twelfth of the day.
    #[arg(long, value_name = "PART", default_value_t)]
    hour_reading: HourReading,
    /// Write everything as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &SunArguments) -> Result<(), Failure> {
    let usage = |error: SiteError| Failure::Usage(error.to_string());
    let moment =
        Moment::parse(&arguments.at, arguments.calendar, arguments.time, arguments.hour_reading).map_err(usage)?;
    for remark in moment.remarks() {
        Progress::new().note(&remark.to_string());
    }
    let place = arguments.place().map_err(usage)?;
    let account = Account::of(&place, &moment, arguments.hour_reading).map_err(usage)?;
    if arguments.json {
        return print_json(&account);
    }
    account.rows().iter().try_for_each(|[name, value]| print_line(&format!("{name:<26} {value}")))
}

impl SunArguments {
    fn place(&self) -> Result<Place, SiteError> {
        let mut place = Place::new(self.latitude, self.longitude, self.elevation)?;
        if let Some(pressure) = self.pressure {
            place = place.with_pressure(pressure)?;
        }
        if let Some(temperature) = self.temperature {
            place = place.with_temperature(temperature)?;
        }
        Ok(place)
    }
}

/// The sun and the clocks at a place and a moment. Angles are in degrees, hours are decimal.
#[derive(Serialize)]
struct Account {
    latitude: f64,
    longitude: f64,
    elevation: f64,
    pressure: f64,
    temperature: f64,
    /// Of the centre of the sun, without refraction.
    altitude: f64,
    altitude_refracted: f64,
    /// From north by east.
    azimuth: f64,
    declination: f64,
    hour_angle: f64,
    angular_radius: f64,
    /// Of the sun, astronomical units.
    distance: f64,
    julian_date: f64,
    /// Terrestrial time less universal time, s.
    delta_t: f64,
    weekday: &'static str,
    gregorian_date: String,
    julian_calendar_date: String,
    universal_time: String,
    local_mean_time: String,
    local_apparent_time: String,
    is_day: Option<bool>,
    seasonal_hours: Option<f64>,
    italian_hours: Option<f64>,
    babylonian_hours: Option<f64>,
    hour_reading: String,
    day: Vec<Event>,
}

/// A time of the day: sunrise, noon, sunset or a canonical hour.
#[derive(Serialize)]
struct Event {
    name: &'static str,
    /// `null` if the sun does not rise or set.
    universal_time: Option<String>,
    local_mean_time: Option<String>,
    local_apparent_time: Option<String>,
    altitude: Option<f64>,
    azimuth: Option<f64>,
}

impl Account {
    fn of(place: &Place, moment: &Moment, reading: HourReading) -> Result<Self, SiteError> {
        let time = moment.universal(place)?;
        let SunPosition { altitude, altitude_refracted, azimuth, declination, hour_angle, distance, angular_radius } =
            sun_position(place, time)?;
        let clocks = ShownTimes::at(place, time)?;
        let date = clocks.mean.date;
        Ok(Self {
            latitude: place.latitude(),
            longitude: place.longitude(),
            elevation: place.elevation(),
            pressure: place.pressure(),
            temperature: place.temperature(),
            altitude,
            altitude_refracted,
            azimuth,
            declination,
            hour_angle,
            angular_radius,
            distance,
            julian_date: time.julian_date(),
            delta_t: time.delta_t()?,
            weekday: date.weekday().name(),
            gregorian_date: date.to_string(),
            julian_calendar_date: Calendar::JULIAN.date_of(date.julian_day_number()).to_string(),
            universal_time: stamp(clocks.universal),
            local_mean_time: stamp(clocks.mean),
            local_apparent_time: stamp(clocks.apparent),
            is_day: clocks.is_day,
            seasonal_hours: clocks.seasonal,
            italian_hours: clocks.italian,
            babylonian_hours: clocks.babylonian,
            hour_reading: reading.to_string(),
            day: events(place, date.julian_day_number(), reading)?,
        })
    }

    fn rows(&self) -> Vec<[String; 2]> {
        let row = |name: &str, value: String| [name.to_owned(), value];
        let hours = |hours: Option<f64>, more: &str| {
            hours.map_or_else(|| "-".to_owned(), |hours| format!("{}{more}", clock_text(hours)))
        };
        let half = match self.is_day {
            Some(true) => " of the day",
            Some(false) => " of the night",
            None => "",
        };
        let mut rows = vec![
            row("place", format!("latitude {}, longitude {}, {} m", self.latitude, self.longitude, self.elevation)),
            row("altitude of the sun", format!("{:.4} degrees", self.altitude)),
            row(
                "  with refraction",
                format!("{:.4} degrees ({:.0} hPa, {:.0} C)", self.altitude_refracted, self.pressure, self.temperature),
            ),
            row("azimuth, north by east", format!("{:.4} degrees", self.azimuth)),
            row("radius of the disc", format!("{:.4} degrees, at {:.5} au", self.angular_radius, self.distance)),
            row("date, Gregorian", format!("{}, {}", self.gregorian_date, self.weekday)),
            row("date, Julian", self.julian_calendar_date.clone()),
            row("universal time", format!("{} (Delta T {:.0} s)", self.universal_time, self.delta_t)),
            row("local mean time", self.local_mean_time.clone()),
            row("local apparent time", self.local_apparent_time.clone()),
            row("seasonal hours", hours(self.seasonal_hours, half)),
            row("Italian hours", hours(self.italian_hours, " since sunset")),
            row("Babylonian hours", hours(self.babylonian_hours, " since sunrise")),
            row("the day", format!("universal, local mean and apparent time; an hour is at its {}", self.hour_reading)),
        ];
        rows.extend(self.day.iter().map(|event| {
            let text = match (&event.universal_time, &event.local_mean_time, &event.local_apparent_time) {
                (Some(universal), Some(mean), Some(apparent)) => {
                    let time = |stamp: &String| stamp.split('T').next_back().unwrap_or_default().to_owned();
                    let angles = event.altitude.zip(event.azimuth).map_or_else(String::new, |(altitude, azimuth)| {
                        format!("  altitude {altitude:5.1}, azimuth {azimuth:5.1}")
                    });
                    format!("{}  {}  {}{angles}", time(universal), time(mean), time(apparent))
                }
                _ => "-".to_owned(),
            };
            row(&format!("  {}", event.name), text)
        }));
        rows
    }
}

/// Sunrise, the canonical hours, noon and sunset of a day by its Julian day number.
fn events(place: &Place, day: i32, reading: HourReading) -> Result<Vec<Event>, SiteError> {
    let date = Calendar::GREGORIAN.date_of(day);
    let Day { noon, rise, set } = Day::of(place, day)?;
    let mut times = vec![("sunrise", rise)];
    for (name, hour) in NamedHour::CANONICAL {
        let NamedHour::Seasonal(number) = hour else { continue };
        let time = rise.zip(set).map(|_| KindOfTime::Seasonal.universal(place, date, reading.twelfths(number)));
        times.push((name, time.transpose()?));
    }
    times.insert(times.len() / 2 + 1, ("noon", Some(noon)));
    times.push(("sunset", set));
    times.into_iter().map(|(name, time)| event(place, name, time)).collect()
}

fn event(place: &Place, name: &'static str, time: Option<UniversalTime>) -> Result<Event, SiteError> {
    let at = |time| Ok::<_, SiteError>((ShownTimes::at(place, time)?, sun_position(place, time)?));
    let found = time.map(at).transpose()?;
    let (clocks, sun) = found.unzip();
    Ok(Event {
        name,
        universal_time: clocks.map(|clocks: ShownTimes| stamp(clocks.universal)),
        local_mean_time: clocks.map(|clocks| stamp(clocks.mean)),
        local_apparent_time: clocks.map(|clocks| stamp(clocks.apparent)),
        altitude: sun.map(|sun: SunPosition| sun.altitude),
        azimuth: sun.map(|sun| sun.azimuth),
    })
}

/// A date and a time of day as in ISO 8601.
fn stamp(civil: Civil) -> String {
    format!("{}T{}", civil.date, civil.time_of_day())
}

/// Hours as a clock shows them: `3:07`.
fn clock_text(hours: f64) -> String {
    let minutes = (hours * 60.0).round() as u32;
    format!("{}:{:02}", minutes / 60, minutes % 60)
}
