//! Characters that are not shown but change how others are.

/// Whether a character is harmless in a line of text. Those that are not move the cursor of a terminal or start a
/// command to it (control characters), begin another line (separators), or turn the direction of the text around.
pub fn is_printable(character: char) -> bool {
    let is_separator = matches!(character, '\u{2028}' | '\u{2029}');
    let is_directional = matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    !character.is_control() && !is_separator && !is_directional
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_all_scripts_are_printable_and_what_steers_a_terminal_is_not() {
        for name in ["Rosenfenster, süd (2. Feld)", "حافظ", "חלון", "窓 1/2", "nave\u{200f}", "🪟"] {
            assert!(name.chars().all(is_printable), "{name}");
        }
        for character in "\0\t\n\r\u{1b}\u{7f}\u{80}\u{9b}\u{2028}\u{2029}\u{202a}\u{202e}\u{2066}\u{2069}".chars() {
            assert!(!is_printable(character), "{character:?}");
        }
    }
}
