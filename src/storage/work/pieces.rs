//! Numbered pieces: kept, or made and kept.

use super::{Share, WorkError, WorkFolder, share_out};
use crate::progress::{Cancelled, Stage};
use rayon::ThreadPoolBuildError;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// What a piece of work gives.
pub(crate) trait Piece: Serialize + DeserializeOwned + Send {
    /// Its number, from 0.
    fn number(&self) -> usize;
}

/// Pieces 0 … `count` − 1 of a part.
pub(crate) struct Pieces<'a> {
    /// Where they are kept, if anywhere.
    pub folder: Option<&'a WorkFolder>,
    /// The part of the folder.
    pub part: &'static str,
    /// How many there are.
    pub count: usize,
    /// Which of them are made here.
    pub share: Share,
}

impl Pieces<'_> {
    /// Those that are kept, in order.
    pub fn kept<T: Piece>(
        &self,
        fits: impl Fn(&T) -> Result<(), &'static str>,
    ) -> Result<Vec<T>, WorkError> {
        let Some(folder) = self.folder else {
            return Ok(vec![]);
        };
        (0..self.count)
            .filter_map(|number| {
                let fits = |piece: &T| match piece.number() == number {
                    true => fits(piece),
                    false => Err("its number is another"),
                };
                folder.kept(self.part, number, fits).transpose()
            })
            .collect()
    }

    /// Makes and keeps those of the share that are not kept, in parallel, each on its share of the current threads; returns
    /// all that are there then, in order. A tick for each.
    pub fn all<T: Piece, E>(
        &self,
        stage: &Stage,
        fits: impl Fn(&T) -> Result<(), &'static str>,
        make: impl Fn(usize) -> Result<T, E> + Sync,
    ) -> Result<Vec<T>, E>
    where
        E: From<WorkError> + From<Cancelled> + From<ThreadPoolBuildError> + Send,
    {
        let mut all = self.kept(fits)?;
        for _ in &all {
            stage.tick()?;
        }
        let known: std::collections::HashSet<usize> = all.iter().map(Piece::number).collect();
        let missing: Vec<usize> = (0..self.count)
            .filter(|number| self.share.takes(*number) && !known.contains(number))
            .collect();
        all.extend(share_out(&missing, |number| {
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
            folder.sweep(self.part)?;
        }
        Ok(all)
    }
}
