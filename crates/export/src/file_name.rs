//! Names of files, and of things in XML, from the names of things in a scene, which may have any characters.

/// Most characters of the name of a thing that are kept.
const MOST_CHARACTERS: usize = 40;

/// A name of ASCII letters, digits, `-` and `_`. Its number makes it unique.
pub(crate) fn file_name(number: usize, name: &str) -> String {
    let kept = name.chars().take(MOST_CHARACTERS).map(|character| match character {
        character if character.is_ascii_alphanumeric() || matches!(character, '-' | '_') => character,
        _ => '-',
    });
    format!("{number:04}-{}", kept.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_safe_on_every_system_and_in_xml() {
        assert_eq!(file_name(3, "floor"), "0003-floor");
        assert_eq!(file_name(12_345, "../süd & \"x\""), "12345----s-d----x-");
        assert_eq!(file_name(0, &"a".repeat(300)).len(), 45);
    }
}
