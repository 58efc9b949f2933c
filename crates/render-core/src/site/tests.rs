//! Published positions of the sun, calendars beside each other, and hours that come back.

use super::*;

fn place(latitude: f64, longitude: f64) -> Place {
    Place::new(latitude, longitude, 0.0).unwrap()
}

fn chartres() -> Place {
    place(48.4476, 1.4878)
}

/// A moment in a calendar and a kind of time.
fn moment(text: &str, calendar: &str, kind: Option<&str>) -> Result<Moment, SiteError> {
    let kind = kind.map(|kind| kind.parse().unwrap());
    Moment::parse(text, Some(calendar.parse().unwrap()), kind, HourReading::End)
}

/// Where the sun stands at a moment of universal time.
fn sun(place: &Place, text: &str) -> SunPosition {
    let moment = moment(text, "gregorian", Some("utc")).unwrap();
    sun_position(place, moment.universal(place).unwrap()).unwrap()
}

#[test]
fn the_sun_stands_where_the_published_example_has_it() {
    // Reda and Andreas, NREL TP-560-34302, revised 2008, table A5.1.
    let place = Place::new(39.742476, -105.1786, 1830.14).unwrap();
    let place = place.with_pressure(820.0).unwrap().with_temperature(11.0).unwrap();
    let moment = moment("2003-10-17T12:30:30-07:00", "gregorian", None).unwrap();
    let time = moment.universal(&place).unwrap();
    assert!((time.julian_date() - 2_452_930.312_847).abs() < 1e-6, "{time:?}");
    let sun = sun_position(&place, time).unwrap();
    assert!((sun.altitude_refracted - (90.0 - 50.11162)).abs() < 1e-4, "{sun:?}");
    assert!((sun.altitude - (90.0 - 50.127_954)).abs() < 1e-4, "{sun:?}");
    assert!((sun.azimuth - 194.34024).abs() < 1e-4, "{sun:?}");
    assert!((sun.distance - 0.996_542_297_4).abs() < 1e-6 && (sun.declination + 9.31434).abs() < 1e-4, "{sun:?}");
    assert!((sun.angular_radius - 0.2675).abs() < 1e-4, "{sun:?}");
}

#[test]
fn the_sun_stands_over_three_cities_as_tables_have_it() {
    let dates = [
        "2023-03-20 09:00",
        "2023-06-21 09:00",
        "2023-06-21 12:00",
        "2023-12-21 12:00",
        "2023-12-21 15:00",
        "1250-06-21 09:00",
    ];
    let rows = [
        (
            chartres(),
            [
                [27.5821, 126.5479],
                [47.3742, 109.8988],
                [64.9761, 182.2649],
                [18.0909, 181.9344],
                [6.7445, 222.4983],
                [47.7231, 110.2490],
            ],
        ),
        (
            place(51.5, 0.0),
            [
                [24.9988, 126.3406],
                [45.4013, 111.4037],
                [61.9352, 179.1344],
                [15.0595, 180.4906],
                [5.1061, 221.0733],
                [45.7346, 111.7725],
            ],
        ),
        (
            place(41.0086, 28.9802),
            [
                [45.6988, 153.8770],
                [67.6651, 136.8443],
                [60.3690, 242.4413],
                [19.9740, 208.7292],
                [f64::NEG_INFINITY; 2],
                [67.9737, 137.6048],
            ],
        ),
    ];
    for (place, row) in rows {
        for (date, [altitude, azimuth]) in dates.iter().zip(row) {
            let sun = sun(&place, date);
            if altitude.is_finite() {
                let errors = [sun.altitude - altitude, sun.azimuth - azimuth];
                assert!(errors.iter().all(|error| error.abs() < 1e-4), "{date} at {place:?}: {sun:?}");
            } else {
                assert!(sun.altitude < 0.0, "{date} at {place:?}: {sun:?}");
            }
        }
    }
}

#[test]
fn the_sun_declines_by_the_calendar_of_the_date() {
    for (text, calendar, declination) in [
        ("1250-12-25T12:00", "julian", -23.055),
        ("1250-06-24T12:00", "julian", 23.213),
        ("1250-03-21T12:00", "julian", 3.118),
        ("2023-12-25T12:00", "gregorian", -23.394),
        ("2023-saint-johnT12:00", "gregorian", 23.410),
    ] {
        let place = chartres();
        let moment = moment(text, calendar, Some("utc")).unwrap();
        let sun = sun_position(&place, moment.universal(&place).unwrap()).unwrap();
        assert!((sun.declination - declination).abs() < 1e-3, "{text}: {sun:?}");
    }
}

#[test]
fn calendars_name_the_same_days() {
    for (julian, day, gregorian) in [
        ("1066-10-14", 2_110_701, "1066-10-20"),
        ("1194-06-10", 2_157_327, "1194-06-17"),
        ("1250-06-13", 2_177_784, "1250-06-20"),
        ("1500-03-11", 2_269_003, "1500-03-21"),
    ] {
        assert_eq!(Calendar::JULIAN.date(julian).unwrap().julian_day_number(), day);
        assert_eq!(Calendar::GREGORIAN.date_of(day).to_string(), gregorian);
    }
    for (name, last, first) in [
        ("rome", "1582-10-04", "1582-10-15"),
        ("france", "1582-12-09", "1582-12-20"),
        ("britain", "1752-09-02", "1752-09-14"),
        ("russia", "1918-01-31", "1918-02-14"),
        ("1700-03-01", "1700-02-18", "1700-03-01"),
    ] {
        let calendar: Calendar = name.parse().unwrap();
        let day = calendar.date(last).unwrap().julian_day_number();
        assert_eq!((calendar.date_of(day + 1).to_string().as_str(), calendar.to_string()), (first, name.to_owned()));
    }
    let skipped = moment("1752-09-05T12:00", "britain", Some("mean")).unwrap_err().to_string();
    assert!(skipped.contains("skipped") && skipped.contains("1752-09-05"), "{skipped}");
}

#[test]
fn feasts_are_on_their_days() {
    let date = |text: &str, calendar: &str| moment(&format!("{text} noon"), calendar, None).unwrap().date().to_string();
    for (year, easter) in [(532, "04-11"), (1066, "04-16"), (1194, "04-10"), (1250, "03-27"), (1453, "04-01")] {
        assert_eq!(date(&format!("{year}-easter"), "julian"), format!("{year:04}-{easter}"));
    }
    assert_eq!(
        (date("1500-easter", "julian"), date("2025-easter", "julian")),
        ("1500-04-19".into(), "2025-04-07".into())
    );
    assert_eq!(date("2025-easter", "gregorian"), "2025-04-20");
    // England kept the Julian Easter until 1752, and France had the Gregorian one from 1583 on.
    assert_eq!(
        (date("1700-easter", "britain"), date("1700-easter", "france")),
        ("1700-03-31".into(), "1700-04-11".into())
    );
    assert_eq!(
        (date("1250-palm-sunday", "julian"), date("1250-pentecost", "julian")),
        ("1250-03-20".into(), "1250-05-15".into())
    );
    assert_eq!(date("1250-corpus-christi", "julian"), "1250-05-26");
    // 25 December was a Sunday in 1250 and in 2022.
    assert_eq!(
        (date("1250-advent", "julian"), date("2022-advent", "gregorian")),
        ("1250-11-27".into(), "2022-11-27".into())
    );
    assert_eq!(date("1250-christmas", "julian"), "1250-12-25");
    let too_early = moment("1250-easter noon", "gregorian", None).unwrap_err().to_string();
    assert!(too_early.contains("1583") && too_early.contains("julian"), "{too_early}");
}

#[test]
fn a_sundial_shows_noon_when_the_sun_is_in_the_south() {
    let place = chartres();
    for (text, hour_angle) in [("1250-02-11T12:00", 0.0), ("1250-06-21T15:00", 45.0), ("1250-11-03T09:00", -45.0)] {
        let time = moment(text, "gregorian", Some("apparent")).unwrap().universal(&place).unwrap();
        let sun = sun_position(&place, time).unwrap();
        assert!((sun.hour_angle - hour_angle).abs() < 1e-5, "{text}: {sun:?}");
        assert!(hour_angle != 0.0 || (sun.azimuth - 180.0).abs() < 1e-4, "{text}: {sun:?}");
    }
    // A sundial is most ahead of mean time at the beginning of November, by 16.4 minutes, and most behind in February.
    for (text, ahead) in [("2023-11-03T12:00", 16.4), ("2023-02-11T12:00", -14.2)] {
        let [mean, apparent] = ["mean", "apparent"]
            .map(|kind| moment(text, "gregorian", Some(kind)).unwrap().universal(&place).unwrap().julian_date());
        assert!(((mean - apparent) * 1440.0 - ahead).abs() < 0.1, "{text}");
    }
}

#[test]
fn the_day_has_twelve_hours_in_summer_and_in_winter() {
    let place = chartres();
    for date in ["1250-06-13", "1250-12-13"] {
        let day = Day::of(&place, Calendar::JULIAN.date(date).unwrap().julian_day_number()).unwrap();
        let (rise, set) = (day.rise.unwrap().julian_date(), day.set.unwrap().julian_date());
        let at = |hour: &str, reading| {
            let moment = Moment::parse(&format!("{date} {hour}"), Some(Calendar::JULIAN), None, reading).unwrap();
            let time = moment.universal(&place).unwrap().julian_date();
            12.0 * (time - rise) / (set - rise)
        };
        for (hour, number) in [("prime", 1.0), ("terce", 3.0), ("sext", 6.0), ("none", 9.0), ("vespers", 11.0)] {
            assert!((at(hour, HourReading::End) - number).abs() < 1e-6, "{hour}");
            assert!((at(hour, HourReading::Beginning) - (number - 1.0)).abs() < 1e-6, "{hour}");
        }
        assert!((at("noon", HourReading::End) - 6.0).abs() < 0.02 && at("sunset", HourReading::End) == 12.0);
        let altitude = sun_position(&place, day.rise.unwrap()).unwrap().altitude;
        assert!((altitude + 50.0 / 60.0).abs() < 0.01, "{altitude}");
    }
}

#[test]
fn clocks_show_the_hour_that_a_moment_was_made_of() {
    let place = chartres();
    let hours = |civil: Civil| f64::from(civil.second) / 3600.0;
    for date in ["1250-03-21", "1250-06-13", "1250-12-25"] {
        for hour in [3.5, 9.25, 15.75, 20.5] {
            let text = format!("{date} {:02}:{:02}", hour as u32, (hour % 1.0 * 60.0) as u32);
            for kind in ["utc", "mean", "apparent", "seasonal", "italian", "babylonian"] {
                let time = moment(&text, "julian", Some(kind)).unwrap().universal(&place).unwrap();
                let clocks = ShownTimes::at(&place, time).unwrap();
                let seasonal = clocks.seasonal.unwrap() + if clocks.is_day.unwrap() { 0.0 } else { 12.0 };
                let shown = match kind {
                    "utc" => hours(clocks.universal),
                    "mean" => hours(clocks.mean),
                    "apparent" => hours(clocks.apparent),
                    "seasonal" => seasonal,
                    "italian" => clocks.italian.unwrap(),
                    _ => clocks.babylonian.unwrap(),
                };
                assert!((shown - hour).abs() < 2e-4, "{text} {kind}: {clocks:?}");
            }
        }
    }
}

#[test]
fn where_the_sun_does_not_set_there_are_no_hours_from_sunset() {
    let place = place(69.65, 18.96);
    let error = moment("2023-06-21 terce", "gregorian", None).unwrap().universal(&place).unwrap_err().to_string();
    assert!(error.contains("does not rise on 2023-06-21") && error.contains("69.65"), "{error}");
    let noon = moment("2023-06-21 noon", "gregorian", None).unwrap().universal(&place).unwrap();
    let clocks = ShownTimes::at(&place, noon).unwrap();
    assert_eq!((clocks.seasonal, clocks.italian), (None, None));
    assert!((sun_position(&place, noon).unwrap().altitude - 43.8).abs() < 0.1);
}

#[test]
fn what_is_no_moment_is_refused_with_its_field_and_what_would_be_right() {
    let refused = |text: &str, kind: Option<&str>, parts: &[&str]| {
        let message = moment(text, "gregorian", kind).unwrap_err().to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{text}: {message}");
    };
    refused("1250-12-25", None, &["moment", "1250-12-25T08:30"]);
    refused("1250-12-25T08:30", None, &["time", "08:30", "apparent (sundial)"]);
    refused("1250-12-25T08:30Z", Some("mean"), &["time: found mean", "zone Z"]);
    refused("1250-02-30T08:30Z", None, &["date", "1250-02-30"]);
    refused("1250-yuleT08:30Z", None, &["feast", "yule", "christmas"]);
    refused("christmas-1250 noon", None, &["date", "YEAR-FEAST"]);
    refused("1250-12-25T25:00Z", None, &["hour", "25:00", "24:00"]);
    refused("1250-12-25T8:30Z", None, &["hour", "8:30", "HH:MM"]);
    refused("1250-12-25T08:30+19:00", None, &["zone", "+19:00", "15 hours"]);
    refused("1250-12-25 matins", None, &["hour", "matins", "terce"]);
    let far = moment("9999-12-25 noon", "gregorian", None).unwrap().universal(&chartres()).unwrap_err().to_string();
    assert!(far.contains("10000") || far.contains("9999"), "{far}");
    assert!(Place::new(91.0, 0.0, 0.0).unwrap_err().to_string().contains("latitude: found 91"));
    assert!(Place::new(f64::NAN, 0.0, 0.0).is_err());
}

#[test]
fn a_reader_is_told_what_a_date_may_also_mean() {
    let read = |text: &str, calendar: Option<Calendar>| {
        let remarks = Moment::parse(text, calendar, None, HourReading::End).unwrap().remarks();
        remarks.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    };
    assert!(read("1250-12-25T12:00Z", None).contains("1250-12-18"), "the same day in the Julian calendar");
    assert!(read("1250-12-25T12:00Z", None).contains("universal time"));
    assert_eq!(read("1250-12-25 terce", Some(Calendar::JULIAN)), "");
    assert!(read("1250-02-02 terce", Some(Calendar::JULIAN)).contains("1249"));
    assert_eq!(read("2003-10-17T12:30:30-07:00", None), "");
}
