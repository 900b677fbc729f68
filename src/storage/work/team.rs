//! The processes that work together: alone, or the ranks of an MPI launch.

use super::Share;

/// What launchers set for each rank: how many there are.
const SIZES: [&str; 4] = [
    "OMPI_COMM_WORLD_SIZE",
    "PMI_SIZE",
    "MV2_COMM_WORLD_SIZE",
    "MPI_LOCALNRANKS",
];

/// This process among those that were launched with it.
///
/// Ranks do not talk: each does its [`Share`] of numbered work, all keep pieces in one folder of a shared file system, and
/// they [`wait`](Self::wait) for each other between steps. What a rank has kept outlives it.
///
/// Alone unless the process was started by an MPI launcher (`mpirun`, `srun --mpi=…`), and then only in a build with the
/// feature `mpi`.
///
/// ```
/// use truetwin::storage::work::Team;
///
/// let team = Team::alone();
/// assert!(team.is_alone() && team.leads() && team.share().takes(7));
/// ```
pub struct Team {
    share: Share,
    leads: bool,
    #[cfg(feature = "mpi")]
    universe: Option<mpi::environment::Universe>,
}

debug_by_name!(Team);

/// Why the ranks cannot work together.
///
/// ```
/// use truetwin::storage::work::TeamError;
///
/// let error = TeamError::NoMpi { ranks: 4 };
/// assert!(error.to_string().contains("--features mpi"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TeamError {
    /// Ranks of a build that knows nothing of each other would all do the same.
    #[error(
        "started as {ranks} ranks, and this build knows no MPI: install it with `--features mpi`, or use --shard i/n in a job array"
    )]
    NoMpi {
        /// How many.
        ranks: usize,
    },
    /// The MPI library does not start.
    #[error(
        "MPI does not start; check the launcher and the library that this build is linked with"
    )]
    Start,
}

impl Team {
    /// One process.
    pub fn alone() -> Self {
        Self {
            share: Share::WHOLE,
            leads: true,
            #[cfg(feature = "mpi")]
            universe: None,
        }
    }

    /// The team that this process was launched in; to be called once, before any work.
    ///
    /// # Errors
    ///
    /// [`TeamError`]: several ranks without the feature `mpi`, a library that does not start.
    pub fn join() -> Result<Self, TeamError> {
        let size = |name| std::env::var(name).ok()?.parse().ok();
        match SIZES.into_iter().find_map(size) {
            None => Ok(Self::alone()),
            Some(ranks) => Self::of_launch(ranks),
        }
    }

    #[cfg(not(feature = "mpi"))]
    fn of_launch(ranks: usize) -> Result<Self, TeamError> {
        match ranks {
            0 | 1 => Ok(Self::alone()),
            ranks => Err(TeamError::NoMpi { ranks }),
        }
    }

    #[cfg(feature = "mpi")]
    fn of_launch(_: usize) -> Result<Self, TeamError> {
        use mpi::traits::Communicator;
        // Work runs in thread pools; of all threads, one at a time speaks to MPI.
        let (universe, _) =
            mpi::initialize_with_threading(mpi::Threading::Serialized).ok_or(TeamError::Start)?;
        let world = universe.world();
        let (rank, size) = (world.rank() as usize, world.size() as usize);
        Ok(Self {
            share: Share::new(rank, size).map_err(|_| TeamError::Start)?,
            leads: rank == 0,
            universe: Some(universe),
        })
    }

    /// What this process does of numbered work.
    pub fn share(&self) -> Share {
        self.share
    }

    /// Whether there are others.
    pub fn is_alone(&self) -> bool {
        self.share.is_whole()
    }

    /// Whether this process speaks for all: one does.
    pub fn leads(&self) -> bool {
        self.leads
    }

    /// Returns once every process is here.
    pub fn wait(&self) {
        #[cfg(feature = "mpi")]
        if let Some(universe) = &self.universe {
            use mpi::traits::CommunicatorCollectives;
            universe.world().barrier();
        }
    }

    /// Ends all processes: where one has failed, the others would wait for ever. Returns where this one is alone.
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
    fn who_is_alone_does_everything_and_waits_for_nobody() {
        let team = Team::alone();
        assert!(team.leads() && team.is_alone() && team.share().takes(5));
        team.wait();
        team.abandon(2);
    }

    #[cfg(not(feature = "mpi"))]
    #[test]
    fn ranks_without_mpi_are_told_what_to_do() {
        assert!(Team::of_launch(1).is_ok_and(|team| team.is_alone()));
        let error = Team::of_launch(4).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("--features mpi"), "{error}");
    }
}
