//! Paint on the pieces of a window.

use std::collections::BTreeMap;

use clerestory_glazing::WindowPlan;
use glam::DVec2;

use super::description::WindowDescription;
use super::glass::GlassDescription;
use crate::bsdf::MaterialDescription;
use crate::geometry::Face;
use crate::scene::description::{MeshDescription, PaneDescription, SheetDescription};
use crate::scene::paint::PaintDescription;
use crate::scene::painting::PaintLayer;

/// What the paint of a protective pane is called. No kind of glass has an empty name, so that this is none of them.
pub(super) const OUTER: &str = "";

/// Paints pieces as they are hung: each kind of glass with its own paint, and all with that of the window.
pub(super) struct Painter<'a> {
    window: &'a WindowDescription,
    /// The lower left corner of the opening, and its size, metres.
    opening: [DVec2; 2],
    /// By the name of the kind.
    kinds: BTreeMap<String, PaintLayer>,
    /// That of the window on pieces without other paint, and on others.
    whole: [Option<PaintLayer>; 2],
}

impl<'a> Painter<'a> {
    /// A painter of a window.
    pub(super) fn new(window: &'a WindowDescription, plan: &WindowPlan) -> Self {
        let corners = plan.outline.iter();
        let [low, high] = corners
            .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], corner| [low.min(*corner), high.max(*corner)]);
        let whole = [0, 1].map(|coats| window.paint.as_ref().map(|paint| PaintLayer::new(paint, coats)));
        Self { window, opening: [low, high - low], kinds: BTreeMap::new(), whole }
    }

    /// Paints a piece of a kind, whose middle is at a place of the window's plane.
    pub(super) fn add_piece(
        &mut self,
        name: &str,
        kind: &GlassDescription,
        (pane, sheet): (&PaneDescription, &SheetDescription),
        middle: DVec2,
    ) {
        self.add_layer(name, kind.paint.as_deref(), (pane, sheet));
        let [low, size] = self.opening;
        if let Some(layer) = &mut self.whole[usize::from(kind.paint.is_some())] {
            layer.add(pane, |face| reach(sheet, face), |at| (middle + at - low) / size);
        }
    }

    /// Paints a pane, with the mask over its rectangle.
    pub(super) fn add_layer(
        &mut self,
        name: &str,
        paint: Option<&PaintDescription>,
        (pane, sheet): (&PaneDescription, &SheetDescription),
    ) {
        let Some(paint) = paint else { return };
        let layer = self.kinds.entry(name.to_owned()).or_insert_with(|| PaintLayer::new(paint, 0));
        let size = DVec2::new(pane.width, pane.height);
        layer.add(pane, |face| reach(sheet, face), |at| at / size + 0.5);
    }

    /// The meshes with their materials.
    pub(super) fn finish(self) -> Vec<(MeshDescription, MaterialDescription)> {
        let window = &self.window.name;
        let of_kinds = self.kinds.into_iter().map(|(name, layer)| {
            let what = if name == OUTER { "outer paint".to_owned() } else { format!("paint on {name}") };
            (format!("{window} {what}"), layer)
        });
        let [plain, over] = self.whole;
        let names = [format!("{window} paint"), format!("{window} paint over paint")];
        let of_window = names.into_iter().zip([plain, over]).filter_map(|(name, layer)| Some((name, layer?)));
        of_kinds.chain(of_window).filter_map(|(name, layer)| layer.finish(&name)).collect()
    }
}

fn reach(sheet: &SheetDescription, face: Face) -> f64 {
    if face == Face::Front { sheet.front.reach() } else { sheet.back.reach() }
}
