//! Starts of records: known, unknown, or known and not those of these records.
//!
//! A start is known if the twin's code or the study says it. A start that nobody says is unknown; so is one for which a record shows that it began
//! elsewhere, at an operating point, say:
//!
//! ```text
//! |y(0) − g(x_0, θ)| > 5·s   for all θ within the bounds, effects off     s: declared noise of the output, or what its second differences show
//! ```

use super::level::{Beliefs, MEASURED, StartElsewhere};
use crate::likelihood::kalman::{FilterError, FilterSettings, Kalman, recoverable};
use crate::math::median;
use crate::record::Record;
use crate::twin::{Acting, Composed, Now, Role, is_memory};

/// Median absolute second difference of white noise, in its standard deviations: 0.6745·√6.
const SECOND_DIFFERENCE: f64 = 1.652;

/// The better of two results where records contradict a start that the twin's code says: the one with that start given up, or the one of `again`
/// with it held; and whether it is held. What is missing may bend the reading of a start, as an offset does. Where
/// effects of the twin itself may, as `bends` says, the odds are the other way round.
pub(crate) fn with_better_start<R, E>(
    (given_up, bends): (R, bool),
    nats: impl Fn(&R) -> Option<f64>,
    again: impl FnOnce() -> Result<R, E>,
) -> Result<(R, bool), E> {
    let held = again()?;
    let least = if bends {
        -MEASURED.stands
    } else {
        MEASURED.stands
    };
    let stands =
        (nats(&held).zip(nats(&given_up))).is_some_and(|(held, other)| held - other > least);
    Ok((if stands { held } else { given_up }, stands))
}

/// Starts of a twin in these records.
pub(super) struct Starts {
    /// `true` where the start of the state is unknown.
    pub unknown: Vec<bool>,
    /// Contradiction of a start that was said.
    pub elsewhere: Option<StartElsewhere>,
}

impl Starts {
    pub fn of(twin: &Composed, records: &[Record], beliefs: &Beliefs, theta: &[f64]) -> Self {
        let names: Vec<String> = (twin.outline().states.into_iter())
            .map(|state| state.name)
            .collect();
        let drive = records[0].drive();
        let now = Now::new(drive.first_time(), drive.dt(), drive.input(0), theta);
        let written = twin.written_starts(&now);
        let is_declared = |name: &String| beliefs.starts.contains(name);
        let mut unknown: Vec<bool> = (names.iter().zip(&written))
            .map(|(name, written)| {
                let is_said = *written && !beliefs.estimated.contains(name);
                !(is_declared(name) || is_memory(name) || is_said)
            })
            .collect();
        let mut elsewhere = None;
        for (r, record) in (records.iter().enumerate()).filter(|_| !beliefs.trusts_code) {
            // Of records that begin at 0, the study's own word stands; at another time, it may be that of a start before the record.
            let stands = record.drive().first_time() == 0.0 || twin.begins().is_some();
            let Some(found) = contradiction((twin, &unknown), &[], record, theta) else {
                continue;
            };
            let (held, given_up): (Vec<usize>, Vec<usize>) = (0..names.len())
                .filter(|&i| !unknown[i] && !is_memory(&names[i]))
                .partition(|&i| {
                    is_declared(&names[i]) && (stands || beliefs.wide.contains(&names[i]))
                });
            // States that the output does not show are not to blame.
            let is_shown = |i: &&usize| found.shows[**i];
            let is_held = !given_up.iter().any(|i| is_shown(&i));
            let states: Vec<usize> = match is_held {
                true => held.iter().filter(is_shown).copied().collect(),
                false => given_up,
            };
            if !is_held {
                states.iter().for_each(|&i| unknown[i] = true);
            }
            let is_news = |last: &StartElsewhere| last.is_held && !is_held;
            if !states.is_empty() && elsewhere.as_ref().is_none_or(is_news) {
                elsewhere = Some(StartElsewhere {
                    record: r,
                    output: twin.outline().outputs[found.output].clone(),
                    value: found.value,
                    expected: found.expected,
                    states: states.iter().map(|&i| names[i].clone()).collect(),
                    is_held,
                });
            }
        }
        Self { unknown, elsewhere }
    }

    /// Returns whether unknown starts of these widths explain the first rows.
    pub fn explain(
        &self,
        twin: &Composed,
        records: &[Record],
        theta: &[f64],
        widths: &[f64],
    ) -> bool {
        let known = vec![false; self.unknown.len()];
        let unknown = self.unknown.iter().zip(widths);
        let widths: Vec<f64> = unknown
            .map(|(is, width)| if *is { *width } else { 0.0 })
            .collect();
        let mut first = records.iter();
        first.all(|record| contradiction((twin, &known), &widths, record, theta).is_none())
    }
}

/// A value in the first row at which no θ within the bounds starts.
struct Contradiction {
    output: usize,
    value: f64,
    /// The nearest one that is possible.
    expected: f64,
    /// States that the output shows.
    shows: Vec<bool>,
}

/// The first one, of states whose starts are `unknown`, or wider than the twin says by `widths`, where these are given.
fn contradiction(
    (twin, unknown): (&Composed, &[bool]),
    widths: &[f64],
    record: &Record,
    theta: &[f64],
) -> Option<Contradiction> {
    let outline = twin.outline();
    let (n, p) = (outline.states.len(), outline.outputs.len());
    if twin.begins().is_some() {
        // The equations lead to the first row: what they say depends on θ.
        return None;
    }
    let mut range = vec![(f64::INFINITY, f64::NEG_INFINITY); p];
    let mut noise = vec![0.0; p];
    let mut shows = vec![vec![false; n]; p];
    let mut look = |theta: &[f64]| {
        // A twin that does not work there says nothing.
        let Ok(acting) = Acting::of(twin, theta, record.drive()) else {
            return;
        };
        let now = acting.start();
        let (mut x, mut y) = (vec![0.0; n], vec![0.0; p]);
        let (mut q, mut r) = (vec![0.0; n], vec![0.0; p]);
        twin.start(&now, &mut x);
        twin.observe(&now, &x, &mut y);
        twin.readout(&now, &mut y);
        twin.noise(&now, &x, &mut q, &mut r);
        let mut std = vec![0.0; n];
        twin.start_deviation(&now, &mut std);
        for j in 0..p {
            range[j] = (range[j].0.min(y[j]), range[j].1.max(y[j]));
            noise[j] = f64::max(noise[j], r[j]);
        }
        for i in 0..n {
            let read = |reach: f64| {
                let (mut moved, mut there) = (x.clone(), vec![0.0; p]);
                moved[i] += reach;
                twin.observe(&now, &moved, &mut there);
                twin.readout(&now, &mut there);
                there
            };
            let reach = MEASURED.elsewhere * std[i].hypot(widths.get(i).copied().unwrap_or(0.0));
            for (reach, is_likely) in [(reach, true), (-reach, true), (1.0, false), (-1.0, false)] {
                let there = read(reach);
                for j in 0..p {
                    if is_likely {
                        range[j] = (range[j].0.min(there[j]), range[j].1.max(there[j]));
                    }
                    shows[j][i] |= there[j] != y[j];
                    // An unknown state may be anywhere.
                    if unknown[i] && there[j] != y[j] {
                        noise[j] = f64::INFINITY;
                    }
                }
            }
        }
    };
    look(theta);
    // Effects stay off: with one that bends readings a fit would hold what a diagnosis without it gives up.
    let own = (outline.parameters.iter().enumerate()).filter(|(_, p)| p.role == Role::Parameter);
    for (j, parameter) in own {
        for (bound, prior) in [
            (parameter.bounds.low(), parameter.prior.low()),
            (parameter.bounds.high(), parameter.prior.high()),
        ] {
            let mut moved = theta.to_vec();
            moved[j] = if bound.is_finite() { bound } else { prior };
            look(&moved);
        }
    }
    let rows = (0..record.samples()).take_while(|&k| k == 0 || record.drive().is_repeated(k - 1));
    for k in rows {
        for j in 0..p {
            let (low, high) = range[j];
            let value = record.outputs()[[k, j]];
            let expected = value.max(low).min(high);
            let values = record.outputs().column(j).to_vec();
            let reach = MEASURED.elsewhere
                * noise[j]
                    .max(roughness(&values))
                    .max(record.cells()[j].sqrt());
            if (value - expected).abs() > reach {
                return Some(Contradiction {
                    output: j,
                    value,
                    expected,
                    shows: shows.swap_remove(j),
                });
            }
        }
    }
    None
}

/// Deviation of white noise with second differences like those of a signal: an upper bound of its noise.
fn roughness(values: &[f64]) -> f64 {
    let second: Vec<f64> = (values.windows(3))
        .map(|v| (v[2] - 2.0 * v[1] + v[0]).abs())
        .filter(|d| d.is_finite())
        .collect();
    median(&second).unwrap_or(f64::INFINITY) / SECOND_DIFFERENCE
}

/// Largest distance of each state in a first row from its start, as a smoother with loud noise sees it beyond its own uncertainty; `None` where it
/// cannot.
pub(super) fn distances(
    twin: &Composed,
    records: &[Record],
    theta: &[f64],
) -> Result<Option<Vec<f64>>, FilterError> {
    let settings = FilterSettings::default();
    let n = twin.outline().states.len();
    let mut all = vec![0.0; n];
    for record in records {
        let first = Kalman::new(twin, record, &settings)?.first_state(theta);
        let Some(first) = recoverable(first)? else {
            return Ok(None);
        };
        let mut start = vec![0.0; n];
        let Ok(acting) = Acting::of(twin, theta, record.drive()) else {
            continue;
        };
        twin.run_to_first_row(&acting, &mut twin.workspace(), &mut start);
        for (i, distance) in all.iter_mut().enumerate() {
            let off = first.mean[i] - start[i];
            let beyond = off * off - first.cov[i * n + i];
            if beyond.is_finite() {
                *distance = f64::max(*distance, beyond.max(0.0).sqrt());
            }
        }
    }
    Ok(Some(all))
}
