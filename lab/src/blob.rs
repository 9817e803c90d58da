//! Blobs in files: grids, with their mesh (packed) or without it.

use std::io::Read as _;
use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};
use hgrid_core::{BlobInfo, Block, Error, Member, Object};

use crate::file;

/// The bytes of a file, aligned so that a grid can be opened in them.
#[derive(Debug)]
pub struct Blob {
    memory: Vec<Block>,
    length: usize,
}

impl Blob {
    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, is no blob of this version, or is cut off.
    pub fn read(path: &Path) -> Result<Self> {
        let mut file = file::open(path)?;
        let length = usize::try_from(file.metadata()?.len()).context("it is too large")?;
        ensure!(length > 0, "it is empty");
        let mut memory = vec![Block::ZERO; Block::count_for(length)];
        let bytes = &mut Block::bytes_mut(&mut memory)[..length];
        file.read_exact(bytes).context("cannot read it")?;
        let needed = match BlobInfo::peek(bytes) {
            Err(Error::Truncated { needed_bytes, .. }) => {
                bail!("it is cut off: it has {length} bytes, but its header takes {needed_bytes}")
            }
            info => info.context("it is not a blob that this version reads")?.total_bytes,
        };
        ensure!(length as u64 >= needed, "it is cut off: it has {length} bytes of {needed}");
        Ok(Self { memory, length })
    }

    /// Returns room for the views with which a packed scene is opened.
    ///
    /// # Errors
    /// If the header asks for more views than the bytes can hold.
    pub fn views<'a>(&self, info: &BlobInfo) -> Result<(Vec<Member<'a>>, Vec<Object<'a>>)> {
        let is_sound = info.vertex_count <= info.total_bytes / 4
            && u64::from(info.triangle_count) <= info.total_bytes / 128;
        ensure!(is_sound && info.total_bytes <= self.length as u64, "it is truncated or damaged");
        let objects = vec![Object::Nothing; usize::try_from(info.vertex_count)?];
        Ok((vec![Member::EMPTY; info.triangle_count as usize], objects))
    }

    /// Makes room for a blob.
    #[must_use]
    pub fn zeroed(length: usize) -> Self {
        Self { memory: vec![Block::ZERO; Block::count_for(length)], length }
    }

    /// Returns the bytes, aligned so that a grid can be opened in them.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &Block::bytes(&self.memory)[..self.length]
    }

    /// Returns the bytes for writing.
    #[must_use]
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut Block::bytes_mut(&mut self.memory)[..self.length]
    }
}
