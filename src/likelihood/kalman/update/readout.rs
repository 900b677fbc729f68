//! A sensor that bends its signal behind the noise.

use super::readings::Ranged;
use super::{MeasuredRow, Update};
use crate::likelihood::kalman::number::FilterNumber;
use crate::likelihood::kalman::size::{Buffer, Size};
use crate::math::{Condition, Number};
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
/// Shares of a range at which it is looked whether the sensor leaves its signal alone there, and of the way beyond an end whether it shows the
/// end: sensors that repeat themselves, such as those that round or wrap around, show other values at one of them.
const WITHIN: [f64; 3] = [0.2287, 0.5131, 0.8093];
/// A reading so many jitters from an end is not at it, and a range is wider than two of these.
const BESIDE: f64 = 5.0;
/// Difference of readings that is rounding, as a share of their jitter.
const SAME: f64 = 1e-3;

impl<S: Size, N: FilterNumber> Update<S, N> {
    /// Reads the least and the greatest value that counts of each output, and the nodes where these are bent. Returns the lanes in which they are.
    #[inline(always)]
    pub(super) fn read_probes(&mut self, row: &MeasuredRow<'_, '_, N>) -> N::Condition {
        let p = self.size.outputs();
        let covariance = self.covariance.numbers();
        let (outermost, nodes) = self.read.split_at_mut(2 * p);
        let (least, greatest) = outermost.split_at_mut(p);
        for j in 0..p {
            [least[j], greatest[j]] = counting(
                (row.predicted[j], covariance[j * p + j]),
                (row.y[j], row.jitter[j]),
            );
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
                match self.range(row, lane, j) {
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
    fn range(&self, row: &MeasuredRow<'_, '_, N>, lane: usize, j: usize) -> Option<Interval> {
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
        let variance = self.covariance.numbers()[j * p + j].lane(lane);
        let outermost = counting((predicted, variance), (y, jitter));
        ends(&mut read, outermost, jitter)
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

/// The least and the greatest value of an output that counts: those of the outermost nodes, or just beyond the reading.
#[inline(always)]
fn counting<N: Number>((predicted, variance): (N, N), (y, jitter): (N, N)) -> [N; 2] {
    let (reach, beside) = (variance.sqrt() * NODES[0].0, jitter * BESIDE);
    [
        (predicted - reach).min(y - beside),
        (predicted + reach).max(y + beside),
    ]
}

/// Ends of a clamp between its least and greatest value that counts, infinite where they are not met; `None` for anything else.
fn ends(
    read: &mut impl FnMut(f64) -> f64,
    [least, greatest]: [f64; 2],
    jitter: f64,
) -> Option<Interval> {
    let beside = jitter * BESIDE;
    let [low, high] = [least, greatest].map(&mut *read);
    let near = |a: f64, b: f64| (a - b).abs() <= SAME * jitter;
    let mut shows = |value: f64, shown: f64| near(read(value), shown);
    // An end goes on to the outermost value, and just inside of it is the signal.
    let mut is_end = |end: f64, outermost: f64, inwards: f64| {
        let way = outermost - end;
        shows(end, end)
            && shows(end + inwards, end + inwards)
            && WITHIN.iter().all(|share| shows(end + share * way, end))
    };
    let (open_low, open_high) = (f64::NEG_INFINITY, f64::INFINITY);
    if near(low, high) {
        // All that counts is beyond one end.
        return match high < least {
            true => is_end(high, greatest, -beside).then(|| Interval::unchecked(open_low, high)),
            false => is_end(low, least, beside).then(|| Interval::unchecked(low, open_high)),
        };
    }
    let (has_low, has_high) = (!near(low, least), !near(high, greatest));
    let is_wide = !(has_low && has_high) || high - low > 2.0 * beside;
    let stands = is_wide
        && (!has_low || is_end(low, least, beside))
        && (!has_high || is_end(high, greatest, -beside));
    let mut inside = WITHIN.iter().map(|share| low + share * (high - low));
    let is_clamp = stands && inside.all(|value| shows(value, value));
    let low = if has_low { low } else { open_low };
    let high = if has_high { high } else { open_high };
    is_clamp.then(|| Interval::unchecked(low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_clamps_have_ends() {
        let of = |readout: &dyn Fn(f64) -> f64, outermost| {
            ends(&mut |value| readout(value), outermost, 1e-3).map(|ends| (ends.low(), ends.high()))
        };
        let clamp = |value: f64| value.clamp(0.0, 1.0);
        let (below, above) = (f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(of(&clamp, [-0.5, 0.7]), Some((0.0, above)));
        assert_eq!(of(&clamp, [0.2, 40.0]), Some((below, 1.0)));
        assert_eq!(of(&clamp, [-0.5, 1.7]), Some((0.0, 1.0)));
        assert_eq!(of(&clamp, [0.995, 3.0]), Some((below, 1.0)));
        assert_eq!(of(&clamp, [1.2, 1.7]), Some((below, 1.0)));
        assert_eq!(of(&clamp, [-1.2, -0.3]), Some((0.0, above)));
        assert_eq!(of(&clamp, [0.2, 0.7]), Some((below, above)));
        let others: [(&str, &dyn Fn(f64) -> f64); 9] = [
            ("rounding", &|v| (v / 0.1).round() * 0.1),
            ("fine rounding", &|v| (v / 0.01).round() * 0.01),
            ("rectifier", &f64::abs),
            ("cut-off", &|v| if v > 0.05 { v } else { 0.0 }),
            ("dead zone", &|v| v - v.clamp(-0.2, 0.2)),
            ("gain", &|v| 1.1 * v),
            ("soft", &f64::tanh),
            ("wrap", &|v| v.rem_euclid(1.0)),
            ("fault", &|v| if v > 1.0 { 99.0 } else { v }),
        ];
        for (name, readout) in others {
            for width in [0.3, 1.3, 2.2, 2.7, 8.0] {
                for centre in [0.0, 0.2, 0.5, 1.1] {
                    let outermost = [centre - width, centre + width];
                    let found = of(readout, outermost);
                    let is_free = outermost.iter().all(|v| readout(*v) == *v);
                    assert!(
                        found.is_none() || is_free,
                        "{name} {outermost:?}: {found:?}"
                    );
                }
            }
        }
    }
}
