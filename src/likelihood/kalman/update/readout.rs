//! A sensor that bends its signal behind the noise.

use super::readings::Ranged;
use super::{MeasuredRow, Update};
use crate::likelihood::kalman::number::FilterNumber;
use crate::likelihood::kalman::size::{Buffer, Size};
use crate::math::Condition;
use crate::twin::Interval;

/// Nodes and weights of the Gauss–Hermite rule with five points, for a standard normal.
const NODES: [(f64, f64); 5] = [
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (1.355_626_179_974_265_8, 0.222_075_922_005_612_65),
    (-1.355_626_179_974_265_8, 0.222_075_922_005_612_65),
    (0.0, 8.0 / 15.0),
];
/// Values of an output that are read: the nodes, behind the least and the greatest value that counts.
pub(super) const PROBES: usize = 2 + NODES.len();
/// Shares of a range at which it is looked whether the sensor leaves its signal alone there; no multiples of a common step.
const WITHIN: [f64; 3] = [0.23, 0.5, 0.81];
/// A reading so many jitters from an end is not at it.
const BESIDE: f64 = 5.0;
/// Difference of readings that is rounding, as a share of their jitter.
const SAME: f64 = 1e-3;

impl<S: Size, N: FilterNumber> Update<S, N> {
    /// Reads the least and the greatest value that counts of each output: those of the outermost nodes, or just beyond the reading; the
    /// nodes, too, where these are bent. Returns the lanes in which they are.
    #[inline(always)]
    pub(super) fn read_probes(&mut self, row: &MeasuredRow<'_, '_, N>) -> N::Condition {
        let p = self.size.outputs();
        let covariance = self.covariance.numbers();
        let (outermost, nodes) = self.read.split_at_mut(2 * p);
        let (least, greatest) = outermost.split_at_mut(p);
        for j in 0..p {
            let reach = covariance[j * p + j].sqrt() * NODES[0].0;
            let beside = row.jitter[j] * BESIDE;
            least[j] = (row.predicted[j] - reach).min(row.y[j] - beside);
            greatest[j] = (row.predicted[j] + reach).max(row.y[j] + beside);
        }
        // Where these are not bent, nothing between them is.
        let bent = N::readout(row.at, outermost);
        if bent.any() {
            for (read, (node, _)) in nodes.chunks_exact_mut(p).zip(NODES) {
                for (j, read) in read.iter_mut().enumerate() {
                    *read = row.predicted[j] + covariance[j * p + j].sqrt() * node;
                }
            }
            N::readout(row.at, nodes);
        }
        bent
    }

    /// Finds the ranges of sensors that have one and leave their signal alone within it. Any other is replaced by the line that is best for
    /// N(ȳ, S); what the line misses joins the noise. The noise itself is never taken off: such a sensor may say little, but not with
    /// certainty.
    #[cold]
    pub(super) fn apply_readout(
        &mut self,
        row: &MeasuredRow<'_, '_, N>,
        bent: N::Condition,
        outputs: &mut [N],
    ) -> Vec<Ranged> {
        let p = self.size.outputs();
        let bent = bent.select(N::all(1.0), N::ZERO);
        let mut ranges = vec![];
        for lane in (0..row.at.1.whole().len()).filter(|lane| bent.lane(*lane) != 0.0) {
            for j in 0..p {
                match self.ends(row, lane, j) {
                    Some(ends) => ranges.push(Ranged {
                        lane,
                        output: j,
                        ends,
                    }),
                    None => self.linearise(row, lane, j, outputs),
                }
            }
        }
        ranges
    }

    /// The range of output j, the others as they were read; `None` where the sensor does anything else than stop at its ends.
    fn ends(&self, row: &MeasuredRow<'_, '_, N>, lane: usize, j: usize) -> Option<Interval> {
        let p = self.size.outputs();
        let (twin, now) = row.at;
        let mut all: Vec<f64> = row.y.iter().map(|y| y.lane(lane)).collect();
        let reading = all.clone();
        let mut read = |value: f64| {
            all.copy_from_slice(&reading);
            all[j] = value;
            twin.readout(&now.whole()[lane], &mut all);
            all[j]
        };
        let [y, predicted, jitter] = [row.y, row.predicted, row.jitter].map(|of| of[j].lane(lane));
        let reach = self.covariance.numbers()[j * p + j].lane(lane).sqrt() * NODES[0].0;
        let beside = jitter * BESIDE;
        let (least, greatest) = (
            (predicted - reach).min(y - beside),
            (predicted + reach).max(y + beside),
        );
        let near = |a: f64, b: f64| (a - b).abs() <= SAME * jitter;
        let (low, high) = (read(least), read(greatest));
        let is_wide = high - low > jitter;
        let mut stays = |value: f64| near(read(value), value);
        let is_free = WITHIN.iter().all(|share| stays(low + share * (high - low)));
        if !(is_wide && is_free && stays(low) && stays(high)) {
            return None;
        }
        // The end goes on to the outermost value.
        let mut is_end = |end: f64, outermost: f64| near(read(0.5 * (end + outermost)), end);
        let low = match near(low, least) {
            true => f64::NEG_INFINITY,
            false if is_end(low, least) => low,
            false => return None,
        };
        let high = match near(high, greatest) {
            true => f64::INFINITY,
            false if is_end(high, greatest) => high,
            false => return None,
        };
        Some(Interval::unchecked(low, high))
    }

    fn linearise(
        &mut self,
        row: &MeasuredRow<'_, '_, N>,
        lane: usize,
        j: usize,
        outputs: &mut [N],
    ) {
        let p = self.size.outputs();
        let (twin, now) = row.at;
        let mut again: Vec<f64> = row.y.iter().map(|y| y.lane(lane)).collect();
        twin.readout(&now.whole()[lane], &mut again);
        let nodes: [f64; NODES.len()] =
            std::array::from_fn(|i| self.read[(2 + i) * p + j].lane(lane));
        let y = row.y[j].lane(lane);
        let noise = self.noise.numbers_mut()[j].lane_mut(lane);
        let innovation = self.innovation.numbers_mut()[j].lane_mut(lane);
        let miss = y - nodes[0];
        let near = |a: f64, b: f64| (a - b) * (a - b) <= *noise;
        if nodes.iter().all(|v| *v == nodes[0]) && !near(y, nodes[0]) && near(again[j], y) {
            // A step wider than what was expected, and another one was read: the signal is beside an edge. What the
            // sensor cannot read is not excused so.
            *innovation = miss;
            *noise += miss * miss;
            return;
        }
        let values = || nodes.iter().zip(NODES);
        let mean: f64 = values().map(|(v, (_, weight))| weight * v).sum();
        let slope: f64 = values().map(|(v, (node, weight))| weight * node * v).sum();
        let variance: f64 = values()
            .map(|(v, (_, weight))| weight * (v - mean).powi(2))
            .sum();
        *innovation = y - mean;
        *noise += (variance - slope * slope).max(0.0);
        let slope = slope / self.covariance.numbers()[j * p + j].lane(lane).sqrt();
        for output in outputs.iter_mut().skip(j).step_by(p) {
            *output.lane_mut(lane) *= slope;
        }
    }
}
