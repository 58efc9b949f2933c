//! Names that people see in lists and logs.

use clerestory_api::is_printable;

/// A name has a character that changes how a line is shown.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the name has the character U+{:04X}, which is not shown", u32::from(*.character))]
pub(crate) struct UnprintableName {
    /// The field that it came in.
    pub(crate) field: &'static str,
    /// The name.
    pub(crate) name: String,
    /// The first such character.
    character: char,
}

/// Refuses a name with control characters, line breaks or overrides of the direction of text.
pub(crate) fn check_name(field: &'static str, name: &str) -> Result<(), UnprintableName> {
    match name.chars().find(|character| !is_printable(*character)) {
        None => Ok(()),
        Some(character) => Err(UnprintableName { field, name: name.to_owned(), character }),
    }
}
