//! Sizes of effects: the prior deviations that count, from what is just visible to what is as large as the twin's own terms.

use crate::fit::axis::EvidencePrior;
use crate::fit::problem::Problem;
use nalgebra::DMatrix;

/// Values of τ.
const SIZES: usize = 6;

/// Sizes from what is just visible, where a size of one has the information `most`, to the largest.
pub(super) fn sizes(most: f64, largest: f64) -> impl Iterator<Item = f64> {
    let visible = 1.0 / most.sqrt();
    let largest = largest.max(2.0 * visible);
    let ratio = (largest / visible).ln() / (SIZES - 1) as f64;
    (0..SIZES).map(move |i| visible * (ratio * i as f64).exp())
}

/// Magnitudes that share one prior, and the deviations that it may give each of them.
pub(super) struct SizePrior {
    pub(super) entries: Vec<usize>,
    pub(super) options: Vec<Vec<f64>>,
}

impl SizePrior {
    /// Deviation that an option gives an entry, if it is one of these.
    pub(super) fn deviation(&self, option: usize, entry: usize) -> Option<f64> {
        let at = self.entries.iter().position(|j| *j == entry)?;
        Some(self.options[option][at])
    }

    /// Magnitudes among the free entries, with the sizes that count.
    pub(super) fn all(problem: &Problem, free: &[usize], information: &DMatrix<f64>) -> Vec<Self> {
        let alone = (free.iter()).filter_map(|&entry| match problem.axes[entry].evidence {
            EvidencePrior::Magnitude { largest } => Some((vec![entry], vec![vec![1.0]], largest)),
            _ => None,
        });
        let families = problem.families.iter().filter_map(|family| {
            let present: Vec<usize> = (0..family.entries.len())
                .filter(|&a| free.contains(&family.entries[a]))
                .collect();
            let weights = (family.weights.iter())
                .map(|weights| present.iter().map(|&a| weights[a]).collect())
                .collect();
            let entries = present.iter().map(|&a| family.entries[a]).collect();
            (!present.is_empty()).then_some((entries, weights, family.largest))
        });
        alone
            .chain(families)
            .map(
                |(entries, weights, largest): (Vec<usize>, Vec<Vec<f64>>, f64)| {
                    let own = own_information(problem, free, information, &entries);
                    let options = (weights.iter())
                        .flat_map(|weights| {
                            let roots: Vec<f64> = weights.iter().map(|w| w.sqrt()).collect();
                            let scaled = DMatrix::from_fn(entries.len(), entries.len(), |a, b| {
                                roots[a] * own[(a, b)] * roots[b]
                            });
                            let most = scaled.symmetric_eigenvalues().max().max(1e-300);
                            sizes(most, largest)
                                .map(move |size| roots.iter().map(|root| size * root).collect())
                        })
                        .collect();
                    Self { entries, options }
                },
            )
            .collect()
    }
}

/// Information about some entries that no other can imitate.
fn own_information(
    problem: &Problem,
    free: &[usize],
    information: &DMatrix<f64>,
    entries: &[usize],
) -> DMatrix<f64> {
    let others: Vec<usize> = (free.iter().copied())
        .filter(|j| !entries.contains(j))
        .collect();
    let part =
        |rows: &[usize], columns: &[usize]| information.select_rows(rows).select_columns(columns);
    let total = part(entries, entries);
    let precisions: Vec<f64> = problem.prior_terms().map(|(_, p)| p).collect();
    let mut matrix = part(&others, &others);
    for (a, &j) in others.iter().enumerate() {
        matrix[(a, a)] += precisions[j].max(1e-12);
    }
    let cross = part(&others, entries);
    let mut own = match matrix.cholesky() {
        Some(factor) => &total - cross.tr_mul(&factor.solve(&cross)),
        None => total.clone(),
    };
    for a in 0..entries.len() {
        own[(a, a)] = own[(a, a)].max(1e-12 * total[(a, a)]).max(1e-300);
    }
    own
}
