//! Text for people: printable, with units, in the right number.

use std::borrow::Cow;
use std::time::Duration;

use clerestory_api::is_printable;

/// Text from outside as part of a line. Escapes replace characters that would steer the terminal or begin another line.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, is_printable)
}

/// Text of several lines. Escapes replace characters that would steer the terminal.
pub(crate) fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |character| matches!(character, '\n' | '\t') || is_printable(character))
}

fn escaped(text: &str, is_kept: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text.chars().all(&is_kept) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        if is_kept(character) { escaped.push(character) } else { escaped.extend(character.escape_unicode()) }
    }
    Cow::Owned(escaped)
}

/// One line of JSON that does not steer the terminal. Such characters occur in strings only, where an escape is equal.
pub(crate) fn printable_json(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for character in json.chars() {
        match is_printable(character) {
            true => text.push(character),
            false => text.push_str(&format!("\\u{:04x}", u32::from(character))),
        }
    }
    text
}

/// A duration in the largest fitting units: `0.4 s`, `3 min 20 s`, `2 h 05 min`.
pub(crate) fn duration_text(duration: Duration) -> String {
    let seconds = duration.as_secs();
    match seconds {
        0..60 => format!("{:.1} s", duration.as_secs_f64()),
        60..3600 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds / 60 % 60),
    }
}

/// A number of things, in the right one of two words.
pub(crate) fn counted(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// A number with a decimal prefix: `12.3 k`, `4.56 M`.
pub(crate) fn with_prefix(value: f64) -> String {
    let prefixes = [(1e9, " G"), (1e6, " M"), (1e3, " k")];
    match prefixes.into_iter().find(|(factor, _)| value >= *factor) {
        Some((factor, prefix)) => format!("{:.2}{prefix}", value / factor),
        None => format!("{value:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_that_steer_a_terminal_are_escaped_and_all_scripts_are_shown() {
        assert_eq!(
            printable("rose \u{1b}[31m\r\n\u{9b}2J\u{202e}txt"),
            "rose \\u{1b}[31m\\u{d}\\u{a}\\u{9b}2J\\u{202e}txt"
        );
        assert_eq!(printable_lines("first\n\tsecond\u{7f}"), "first\n\tsecond\\u{7f}");
        let name = "rose \u{1b}\u{9b}2J\u{202e}txt\u{2028}";
        let json = printable_json(&serde_json::to_string(name).unwrap());
        assert_eq!(json, r#""rose \u001b\u009b2J\u202etxt\u2028""#);
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), name);
        for name in ["Rosenfenster, süd", "حافظ", "窓 🪟"] {
            assert!(matches!(printable(name), Cow::Borrowed(shown) if shown == name));
        }
    }

    #[test]
    fn durations_and_rates_have_the_largest_fitting_unit() {
        let text = |seconds| duration_text(Duration::from_secs_f64(seconds));
        assert_eq!((text(0.44), text(200.0), text(7500.0)), ("0.4 s".into(), "3 min 20 s".into(), "2 h 05 min".into()));
        assert_eq!((with_prefix(1_234_567.0), with_prefix(7.4)), ("1.23 M".into(), "7".into()));
    }
}
