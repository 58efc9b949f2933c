//! What an image of a scene will lack: classes of paths of point lights that no sampling can find.

use super::description::{IntegratorDescription, LightDescription, PaneSelection, SceneDescription};

impl SceneDescription {
    /// The light that the chosen integrator cannot see, in words, for the image's metadata.
    pub fn missing_light(&self) -> Vec<String> {
        if self.panes.is_empty() {
            return Vec::new();
        }
        let points = self.lights.iter().filter(|light| matches!(light, LightDescription::Point { .. }));
        let other = "reflections at panes, internal reflections and paths through more than one pane";
        points
            .map(|light| match self.integrator {
                IntegratorDescription::Path { .. } | IntegratorDescription::Cone { .. } => {
                    format!("point light {:?}: all paths through or off panes", light.name())
                }
                IntegratorDescription::Fnee { selection, .. } => match selection {
                    PaneSelection::All => format!("point light {:?}: {other}", light.name()),
                    PaneSelection::Sharp | PaneSelection::Bleed => {
                        format!("point light {:?}: paths that bleed past the selected panes; {other}", light.name())
                    }
                },
            })
            .collect()
    }
}
