//! Patterns of names.

/// Whether a name matches a pattern in which `*` stands for any text.
pub(crate) fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else { return false };
    let Some(last) = parts.next_back() else { return rest.is_empty() };
    for part in parts {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_any_text() {
        for (pattern, name) in [("*", ""), ("*", "north"), ("n*h", "north"), ("pane *", "pane 1"), ("*o*h", "north")] {
            assert!(matches(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [("north", "north 2"), ("n*x", "north"), ("*a*", "north"), ("nn*", "n")] {
            assert!(!matches(pattern, name), "{pattern} {name}");
        }
    }
}
