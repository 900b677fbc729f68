//! The processes that share work: one alone, or the ranks of an MPI launch.

use super::Share;
use crate::storage::StorageError;

/// Environment variables in which launchers give each rank the number of ranks.
const SIZES: [&str; 4] = [
    "OMPI_COMM_WORLD_SIZE",
    "PMI_SIZE",
    "MV2_COMM_WORLD_SIZE",
    "MPI_LOCALNRANKS",
];

/// This process among those launched with it.
///
/// Ranks do not communicate: each does its [`Share`] of numbered work, all keep pieces in one folder of a shared file system,
/// and they [`wait`](Self::wait) for each other between steps. Pieces of a rank outlive it.
///
/// Alone unless an MPI launcher (`mpirun`, `srun --mpi=…`) started the process, and then only in a build with the feature `mpi`.
pub(crate) struct Ranks {
    share: Share,
    is_root: bool,
    #[cfg(feature = "mpi")]
    universe: Option<mpi::environment::Universe>,
}

debug_by_name!(Ranks);

impl Ranks {
    /// One process.
    pub fn alone() -> Self {
        Self {
            share: Share::WHOLE,
            is_root: true,
            #[cfg(feature = "mpi")]
            universe: None,
        }
    }

    /// Joins the ranks that this process was launched with; to be called once, before any work.
    pub fn join() -> Result<Self, StorageError> {
        let size = |name| std::env::var(name).ok()?.parse().ok();
        match SIZES.into_iter().find_map(size) {
            None => Ok(Self::alone()),
            Some(ranks) => Self::of_launch(ranks),
        }
    }

    #[cfg(not(feature = "mpi"))]
    fn of_launch(ranks: usize) -> Result<Self, StorageError> {
        match ranks {
            0 | 1 => Ok(Self::alone()),
            ranks => Err(StorageError::NoMpi(ranks)),
        }
    }

    #[cfg(feature = "mpi")]
    fn of_launch(_: usize) -> Result<Self, StorageError> {
        use mpi::traits::Communicator;
        // Work runs in thread pools; of all threads, one at a time speaks to MPI.
        let (universe, _) = mpi::initialize_with_threading(mpi::Threading::Serialized)
            .ok_or(StorageError::MpiStart)?;
        let world = universe.world();
        let (rank, size) = (world.rank() as usize, world.size() as usize);
        Ok(Self {
            share: Share::new(rank, size).map_err(|_| StorageError::MpiStart)?,
            is_root: rank == 0,
            universe: Some(universe),
        })
    }

    /// Share of numbered work of this process.
    pub fn share(&self) -> Share {
        self.share
    }

    /// Tells whether there are no other processes.
    pub fn is_alone(&self) -> bool {
        self.share.is_whole()
    }

    /// Tells whether this process writes the result: one does.
    pub fn is_root(&self) -> bool {
        self.is_root
    }

    /// Waits for all processes.
    pub fn wait(&self) {
        #[cfg(feature = "mpi")]
        if let Some(universe) = &self.universe {
            use mpi::traits::CommunicatorCollectives;
            universe.world().barrier();
        }
    }

    /// Ends all processes, since the others would wait for ever for one that failed. Returns if this one is alone.
    pub fn abandon(&self, code: u8) {
        #[cfg(feature = "mpi")]
        if let Some(universe) = &self.universe {
            use mpi::traits::Communicator;
            universe.world().abort(code.into());
        }
        let _ = code;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_process_does_everything_and_waits_for_nobody() {
        let ranks = Ranks::alone();
        assert!(ranks.is_root() && ranks.is_alone() && ranks.share().takes(5));
        ranks.wait();
        ranks.abandon(2);
    }

    #[cfg(not(feature = "mpi"))]
    #[test]
    fn ranks_without_mpi_are_told_what_to_do() {
        assert!(Ranks::of_launch(1).is_ok_and(|ranks| ranks.is_alone()));
        let error = Ranks::of_launch(4).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("feature mpi"), "{error}");
    }
}
