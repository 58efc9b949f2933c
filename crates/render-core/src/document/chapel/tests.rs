//! The chapel can be built, and is what it says.

use crate::document::SceneBundle;
use crate::scene::Asset;

use super::*;

#[test]
fn the_chapel_is_valid_and_names_the_files_that_come_with_it() {
    let Chapel { scene, files } = chapel().unwrap();
    scene.validate().unwrap();
    let assets = files.into_iter().map(|(name, bytes)| (name, Asset::new(bytes))).collect();
    let bundle = SceneBundle::from_parts(scene, assets).unwrap();
    let named: Vec<_> = bundle.assets().keys().cloned().collect();
    assert_eq!(named, Texture::ALL.map(Texture::file));
}
