//! What the numbers of a picture mean.

/// What the numbers of a picture mean, and so how they are decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// Colours: sRGB in files of 8 or 16 bits, linear in EXR files.
    Colour,
    /// Numbers of any meaning, 0 to 1, as they stand in the file.
    Data,
    /// How opaque each texel is, which is all that counts; 1 where the file does not say.
    Opacity,
}
