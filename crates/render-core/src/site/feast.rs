//! Feast days by their names.

use julian::Date;

use super::{Calendar, SiteError};

/// When a feast is.
#[derive(Clone, Copy, Debug)]
enum Rule {
    /// Month and day.
    On(u32, u32),
    /// Days after Easter.
    Easter(i32),
    /// The fourth Sunday before Christmas.
    Advent,
}

/// Feasts of the Western church that many sources date by.
const FEASTS: [(&str, Rule); 33] = [
    ("circumcision", Rule::On(1, 1)),
    ("epiphany", Rule::On(1, 6)),
    ("candlemas", Rule::On(2, 2)),
    ("annunciation", Rule::On(3, 25)),
    ("saint-george", Rule::On(4, 23)),
    ("saint-john", Rule::On(6, 24)),
    ("saints-peter-and-paul", Rule::On(6, 29)),
    ("saint-mary-magdalene", Rule::On(7, 22)),
    ("saint-james", Rule::On(7, 25)),
    ("transfiguration", Rule::On(8, 6)),
    ("saint-lawrence", Rule::On(8, 10)),
    ("assumption", Rule::On(8, 15)),
    ("nativity-of-mary", Rule::On(9, 8)),
    ("exaltation-of-the-cross", Rule::On(9, 14)),
    ("michaelmas", Rule::On(9, 29)),
    ("all-saints", Rule::On(11, 1)),
    ("all-souls", Rule::On(11, 2)),
    ("saint-martin", Rule::On(11, 11)),
    ("saint-nicholas", Rule::On(12, 6)),
    ("christmas", Rule::On(12, 25)),
    ("saint-stephen", Rule::On(12, 26)),
    ("holy-innocents", Rule::On(12, 28)),
    ("septuagesima", Rule::Easter(-63)),
    ("ash-wednesday", Rule::Easter(-46)),
    ("palm-sunday", Rule::Easter(-7)),
    ("maundy-thursday", Rule::Easter(-3)),
    ("good-friday", Rule::Easter(-2)),
    ("easter", Rule::Easter(0)),
    ("ascension", Rule::Easter(39)),
    ("pentecost", Rule::Easter(49)),
    ("trinity", Rule::Easter(56)),
    ("corpus-christi", Rule::Easter(60)),
    ("advent", Rule::Advent),
];

/// The date of a feast in a year of a calendar.
pub(super) fn date(year: i32, name: &str, calendar: Calendar) -> Result<Date, SiteError> {
    let unknown = || SiteError::Text {
        field: "feast",
        value: name.to_owned(),
        expected: format!("one of {}", FEASTS.map(|(name, _)| name).join(", ")),
    };
    let rule = FEASTS.iter().find(|(known, _)| *known == name).map(|(_, rule)| *rule).ok_or_else(unknown)?;
    let fixed = |month, day| {
        calendar.date_by_numbers(year, month, day).ok_or_else(|| SiteError::Text {
            field: "feast",
            value: format!("{year}-{name}"),
            expected: format!("a day that the {calendar} calendar does not skip"),
        })
    };
    match rule {
        Rule::On(month, day) => fixed(month, day),
        Rule::Easter(after) => Ok(calendar.date_of(easter(year, calendar)? + after)),
        Rule::Advent => {
            let christmas = fixed(12, 25)?;
            // Christmas itself is no Sunday of Advent.
            let last = match christmas.weekday().number() % 7 {
                0 => 7,
                days => days as i32,
            };
            Ok(calendar.date_of(christmas.julian_day_number() - last - 21))
        }
    }
}

/// The Julian day number of Easter in a year of a calendar. A calendar that changed has the Gregorian Easter once
/// that date is Gregorian.
fn easter(year: i32, calendar: Calendar) -> Result<i32, SiteError> {
    let day = |calendar: Calendar, month, day| {
        calendar.date_by_numbers(year, month, day).map(|date| date.julian_day_number())
    };
    let gregorian = computus::gregorian(year).ok().and_then(|date| day(Calendar::GREGORIAN, date.month, date.day));
    let [month, day_of_month] = julian_easter(year);
    let by_julian_rule = day(Calendar::JULIAN, month, day_of_month);
    let is_gregorian = |day: &i32| calendar.date_of(*day).is_gregorian();
    let is_julian = |day: &i32| calendar.date_of(*day).is_julian();
    gregorian.filter(is_gregorian).or_else(|| by_julian_rule.filter(is_julian)).ok_or_else(|| SiteError::Text {
        field: "feast",
        value: format!("Easter of {year} in the {calendar} calendar"),
        expected: "a year from 1583 on, or the julian calendar, by which Easter was found before".to_owned(),
    })
}

/// Month and day of Easter in the Julian calendar (Meeus, Astronomical Algorithms, chapter 8).
fn julian_easter(year: i32) -> [u32; 2] {
    let c = year.rem_euclid(19);
    let d = (19 * c + 15) % 30;
    let e = (2 * year.rem_euclid(4) + 4 * year.rem_euclid(7) - d + 34) % 7;
    let f = d + e + 114;
    [(f / 31) as u32, (f % 31 + 1) as u32]
}
