//! Numbered pieces of work, kept in a folder.

use super::thread_groups::thread_groups;
use super::{Share, WorkFolder};
use crate::progress::{Cancelled, Stage};
use crate::storage::StorageError;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Result of a piece of work.
pub(crate) trait Piece: Serialize + DeserializeOwned + Send {
    /// Its number, from 0.
    fn number(&self) -> usize;
}

/// Pieces 0 … `count` − 1 of a part.
pub(crate) struct Pieces<'a> {
    /// Folder that keeps them.
    pub folder: Option<&'a WorkFolder>,
    /// Part of the folder.
    pub part: &'static str,
    /// Number of pieces.
    pub count: usize,
    /// Pieces to be made by this process.
    pub share: Share,
}

impl Pieces<'_> {
    /// Returns the kept pieces, in order.
    pub fn kept<T: Piece>(
        &self,
        fits: impl Fn(&T) -> Result<(), &'static str>,
    ) -> Result<Vec<T>, StorageError> {
        let Some(folder) = self.folder else {
            return Ok(vec![]);
        };
        (0..self.count)
            .filter_map(|number| {
                let fits = |piece: &T| match piece.number() {
                    same if same == number => fits(piece),
                    _ => Err("it holds another number"),
                };
                folder.kept(self.part, number, fits).transpose()
            })
            .collect()
    }

    /// Makes and keeps the missing pieces of the share, in parallel, each on its part of the current threads; returns all kept
    /// pieces, in order. One tick for each.
    pub fn all<T: Piece, E>(
        &self,
        stage: &Stage,
        fits: impl Fn(&T) -> Result<(), &'static str>,
        make: impl Fn(usize) -> Result<T, E> + Sync,
    ) -> Result<Vec<T>, E>
    where
        E: From<StorageError> + From<Cancelled> + Send,
    {
        let mut all = self.kept(fits)?;
        for _ in &all {
            stage.tick()?;
        }
        let known: std::collections::HashSet<usize> = all.iter().map(Piece::number).collect();
        let missing: Vec<usize> = (0..self.count)
            .filter(|number| self.share.takes(*number) && !known.contains(number))
            .collect();
        all.extend(thread_groups(&missing, |number| {
            let made = make(number)?;
            if let Some(folder) = self.folder {
                folder.keep(self.part, number, &made)?;
            }
            stage.tick()?;
            Ok::<T, E>(made)
        })?);
        all.sort_by_key(Piece::number);
        if let Some(folder) = self.folder
            && all.len() == self.count
        {
            folder.sweep();
        }
        Ok(all)
    }
}
