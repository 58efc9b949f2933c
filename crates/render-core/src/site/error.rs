//! What cannot be used of a place or a moment.

/// What cannot be used of a place or a moment, and what would be right.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SiteError {
    /// A number is out of its range.
    #[error("{field}: found {value}, expected {expected}")]
    Range {
        /// What the number is.
        field: &'static str,
        /// The number.
        value: f64,
        /// The range with its unit.
        expected: &'static str,
    },
    /// A word or a text is not one that is known.
    #[error("{field}: found \"{value}\", expected {expected}")]
    Text {
        /// What the text is.
        field: &'static str,
        /// The text.
        value: String,
        /// What would be right.
        expected: String,
    },
    /// A moment has two kinds of time.
    #[error("time: found {found}, but the moment names the zone {zone}; expected one of them")]
    TwoKinds {
        /// The kind beside the moment.
        found: String,
        /// The zone in the moment.
        zone: String,
    },
    /// A clock time without its kind.
    #[error("time: the hour \"{hour}\" has no kind; expected a zone behind it, such as Z or +01:00, or one of {kinds}")]
    NoKind {
        /// The hour.
        hour: String,
        /// The kinds that there are.
        kinds: &'static str,
    },
    /// The sun does not rise or does not set on that day, so hours cannot be counted from there.
    #[error("hours are counted from {event}, and at latitude {latitude} the sun does not {verb} on {date}")]
    NoEvent {
        /// Sunrise or sunset.
        event: &'static str,
        /// Rise or set.
        verb: &'static str,
        /// Of the place, degrees.
        latitude: f64,
        /// The date.
        date: String,
    },
    /// The astronomy does not reach so far.
    #[error("the year {0} is out of range; expected -500 to 3000")]
    Year(i64),
    /// The position of the sun cannot be computed.
    #[error("the position of the sun cannot be computed: {0}")]
    Astronomy(#[from] solar_positioning::Error),
}

impl SiteError {
    /// The thing that a word stands for, or an error that says which words there are.
    pub(super) fn look_up<T: Copy>(
        field: &'static str,
        word: &str,
        words: &[(&str, T)],
        expected: &str,
    ) -> Result<T, Self> {
        let found = words.iter().find(|(known, _)| *known == word).map(|(_, thing)| *thing);
        found.ok_or_else(|| Self::Text { field, value: word.to_owned(), expected: expected.to_owned() })
    }
}
