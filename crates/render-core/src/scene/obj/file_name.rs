//! Names of files in OBJ and MTL files, as programs on any system write them.

use crate::settings::check::is_asset_name;

/// The name of a file relative to the file that names it. Of a path that leads elsewhere, such as that of another
/// machine, the last part is taken: such files usually lie beside it. `None` when there is no such name.
pub(super) fn file_beside(name: &str) -> Option<String> {
    let name = name.replace('\\', "/");
    let parts: Vec<&str> = name.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
    let leads_elsewhere = name.starts_with('/') || parts.iter().any(|part| *part == ".." || part.contains(':'));
    let file = if leads_elsewhere { parts.last()?.to_string() } else { parts.join("/") };
    is_asset_name(&file).then_some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_relative_on_every_system() {
        for (name, file) in [
            ("wood.mtl", "wood.mtl"),
            (".\\maps\\wood grain.png", "maps/wood grain.png"),
            ("./maps//wood.png", "maps/wood.png"),
            ("C:\\Users\\me\\wood.png", "wood.png"),
            ("/home/me/wood.png", "wood.png"),
            ("../../etc/passwd", "passwd"),
        ] {
            assert_eq!(file_beside(name).as_deref(), Some(file), "{name}");
        }
        for name in ["", ".", "..", "/", "a/..", "C:", "a\0b"] {
            assert_eq!(file_beside(name), None, "{name}");
        }
        assert_eq!(file_beside(&"x".repeat(201)), None);
    }
}
