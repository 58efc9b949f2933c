//! Arrays in large pages.
//!
//! Random accesses over many megabytes miss the processor's table of pages (TLB) nearly every time. To find a page anew
//! takes longer than the access itself. Two megabytes to a page, nearly all are in the table. The kernel is asked for
//! them; where it has none, the pages are small, and nothing else differs.

use std::alloc::{Layout, handle_alloc_error};
use std::marker::PhantomData;
use std::mem::size_of;
use std::ops::{Deref, DerefMut};

use bytemuck::Pod;
use memmap2::MmapMut;

/// An array of a fixed length that is written before it is shared.
#[derive(Debug)]
pub(crate) struct LargePages<T> {
    map: MmapMut,
    length: usize,
    of: PhantomData<T>,
}

impl<T: Pod> LargePages<T> {
    /// So many zeros.
    pub(crate) fn zeroed(length: usize) -> Self {
        // An allocation that fails ends the process, as everywhere.
        let layout = Layout::array::<T>(length).unwrap_or(Layout::new::<T>());
        let Ok(map) = MmapMut::map_anon(layout.size().max(1)) else { handle_alloc_error(layout) };
        // Whether it is heeded changes nothing but speed.
        #[cfg(target_os = "linux")]
        let _ = map.advise(memmap2::Advice::HugePage);
        Self { map, length, of: PhantomData }
    }
}

impl<T: Pod> Deref for LargePages<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        bytemuck::cast_slice(&self.map[..self.length * size_of::<T>()])
    }
}

impl<T: Pod> DerefMut for LargePages<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(&mut self.map[..self.length * size_of::<T>()])
    }
}
