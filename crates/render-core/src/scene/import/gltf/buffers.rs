//! Buffers and their views: the bytes that accessors and pictures lie in.

use std::borrow::Cow;

use super::fault::{fault, lookup};
use super::schema::{BufferView, Document};
use super::uri::Resource;
use crate::settings::AssetProblem;

/// The bytes of all buffers.
pub(super) struct Buffers<'a> {
    /// `None` for a buffer that has no bytes of its own: extensions fill it.
    buffers: Vec<Option<Cow<'a, [u8]>>>,
}

impl<'a> Buffers<'a> {
    /// Finds the bytes of all buffers and checks that they are as many as the file says.
    pub(super) fn open(
        document: &Document<'a>,
        binary: Option<&'a [u8]>,
        beside: &dyn Fn(&str) -> Option<&'a [u8]>,
    ) -> Result<Self, AssetProblem> {
        let mut buffers = Vec::with_capacity(document.buffers.len());
        for (index, buffer) in document.buffers.iter().enumerate() {
            let place = || format!("buffers[{index}].uri");
            let bytes = match &buffer.uri {
                Some(uri) => match Resource::of(&uri.0, place())? {
                    Resource::Data(bytes) => Some(Cow::Owned(bytes)),
                    Resource::File(name) => match beside(&name) {
                        Some(bytes) => Some(Cow::Borrowed(bytes)),
                        None => {
                            let message = format!("file \"{name}\" is missing: it must be supplied with the scene");
                            return Err(fault(place(), message));
                        }
                    },
                },
                None if index == 0 => binary.map(Cow::Borrowed),
                None => None,
            };
            if let Some(found) = bytes.as_deref().map(<[u8]>::len)
                && found < buffer.byte_length
            {
                let message = format!("says {} bytes, but there are {found}: it was cut off", buffer.byte_length);
                return Err(fault(format_args!("buffers[{index}].byteLength"), message));
            }
            buffers.push(bytes);
        }
        Ok(Self { buffers })
    }

    /// The bytes of the view that `place` names.
    pub(super) fn view<'b>(
        &'b self,
        document: &'b Document<'_>,
        index: usize,
        place: &str,
    ) -> Result<View<'b>, AssetProblem> {
        let view = lookup(&document.buffer_views, index, "bufferViews", place)?;
        let place = format!("bufferViews[{index}]");
        let Some(bytes) = lookup(&self.buffers, view.buffer, "buffers", format_args!("{place}.buffer"))? else {
            let message = match view.extensions.keys().next() {
                Some(name) => format!("its bytes need the extension {name}: export the scene without it"),
                None => format!("buffers[{}] has no bytes", view.buffer),
            };
            return Err(fault(place, message));
        };
        let end = view.byte_offset.checked_add(view.byte_length);
        let Some(bytes) = end.and_then(|end| bytes.get(view.byte_offset..end)) else {
            let BufferView { byte_offset, byte_length, .. } = view;
            let message = format!("has {byte_length} bytes from byte {byte_offset} on, its buffer has {}", bytes.len());
            return Err(fault(place, message));
        };
        Ok(View { bytes, offset: view.byte_offset, stride: view.byte_stride })
    }
}

/// A part of a buffer.
#[derive(Clone, Copy)]
pub(super) struct View<'b> {
    pub(super) bytes: &'b [u8],
    /// Where it begins in its buffer.
    pub(super) offset: usize,
    /// Bytes from one element to the next, if the file says so.
    pub(super) stride: Option<usize>,
}
