//! Posterior draws in files.

use super::failure::Failure;
use crate::estimator::bank::file::archive;
use crate::fit::Posterior;
use crate::report::posterior_svg;
use crate::storage::NewFolder;
use crate::study::Study;
use clap::Args;
use ndarray::Array2;

/// Most draws: a file of a hundred megabytes.
const MOST: usize = 1_000_000;

/// The number of posterior draws that a verb writes.
#[derive(Debug, Args)]
pub(super) struct PosteriorDraws {
    /// Posterior draws of parameters, noise levels and starts for posterior.csv, posterior.npz and posterior.svg in the folder of
    /// --out.
    #[arg(long, value_name = "N", requires = "out")]
    draws: Option<usize>,
}

impl PosteriorDraws {
    /// Number of draws, 0 for none.
    pub fn count(&self) -> Result<usize, Failure> {
        match self.draws {
            Some(draws) if !(1..=MOST).contains(&draws) => Err(Failure::user(format!(
                "--draws {draws}: choose a number from 1 to {MOST}"
            ))),
            draws => Ok(draws.unwrap_or(0)),
        }
    }
}

/// Writes `posterior.csv`, `posterior.npz` (arrays `draws` and `mode`) and `posterior.svg`, one draw a row.
pub(super) fn write(
    folder: &NewFolder,
    study: &Study,
    posterior: &Posterior,
) -> Result<(), Failure> {
    let mut csv = csv::Writer::from_writer(vec![]);
    // A parameter may have that name.
    let is_taken = posterior.names.iter().any(|name| name == "mode");
    let last = if is_taken { "mode (posterior)" } else { "mode" };
    let head = posterior.names.iter().map(String::as_str).chain([last]);
    csv.write_record(head).map_err(Failure::internal)?;
    for (row, mode) in posterior.values.rows().into_iter().zip(&posterior.modes) {
        let cells = row.iter().map(f64::to_string).chain([mode.to_string()]);
        csv.write_record(cells).map_err(Failure::internal)?;
    }
    let bytes = csv.into_inner().map_err(Failure::internal)?;
    folder.write("posterior.csv", bytes)?;
    let modes = Array2::from_shape_fn((posterior.modes.len(), 1), |(i, _)| {
        posterior.modes[i] as f64
    });
    let matrices = [("draws", &posterior.values), ("mode", &modes)];
    let bytes = archive(&matrices).map_err(Failure::internal)?;
    folder.write("posterior.npz", bytes)?;
    Ok(folder.write("posterior.svg", posterior_svg(study, posterior))?)
}
