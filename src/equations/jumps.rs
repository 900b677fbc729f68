//! Times at which the rates of a text jump, whatever the states: where a condition of time, inputs and parameters changes, and where the whole
//! part in `floor` and `mod` does. Steps end there.

use super::expression::{Binary, Unary};
use super::graph::{Graph, Id, Node};
use super::tape::OperationTape;
use crate::twin::Now;
use smallvec::{SmallVec, smallvec};

/// Parts of a way at whose ends conditions are compared: of two changes in one part none is seen. Half misses a pulse that lasts a fifth of the
/// way, twice as many cost twice.
const PARTS: usize = 8;

/// Values that are the same but where rates jump.
#[derive(Debug)]
pub(super) struct Jumps {
    values: OperationTape,
    count: usize,
    /// `false` where all follow inputs alone, which may be held.
    by_time: bool,
}

impl Jumps {
    /// Creates those of these rates; `None` where they jump nowhere by time and inputs alone.
    pub fn of(graph: &mut Graph, rates: &[Id]) -> Option<Self> {
        let (needed, timed) = (graph.needed(rates), timed(graph));
        let mut values = vec![];
        for id in (0..needed.len()).filter(|id| needed[*id] && timed[*id] == Some(true)) {
            match graph.get(id).0 {
                Node::Two(Binary::Less | Binary::LessEqual, ..)
                | Node::One(Unary::Sign | Unary::Floor, _) => values.push(id),
                Node::Two(Binary::Mod, a, b) => {
                    let share = graph.two(Binary::Div, a, b);
                    values.push(graph.one(Unary::Floor, share));
                }
                _ => {}
            }
        }
        let needed = graph.needed(&values);
        let mut needed = (0..needed.len()).filter(|id| needed[*id]);
        (!values.is_empty()).then(|| Self {
            values: OperationTape::new(graph, &values),
            count: values.len(),
            by_time: needed.any(|id| graph.get(id).0 == Node::Time),
        })
    }

    /// Returns the times of a step at which rates jump, none where there are too many; `None` where nothing moves.
    pub fn times(&self, now: &Now<'_>) -> Option<Vec<f64>> {
        if !self.by_time && now.between.is_none() {
            return None;
        }
        let (mut all, mut first) = (vec![], self.at(now, 0.0));
        for part in 1..=PARTS {
            let from = (part - 1) as f64 / PARTS as f64;
            let end = part as f64 / PARTS as f64;
            let last = self.at(now, end);
            for i in 0..self.count {
                let (mut low, mut value) = (from, first[i]);
                while value != last[i] && !value.is_nan() && !last[i].is_nan() {
                    // Of more, steps of one length do.
                    if all.len() == 4 * PARTS {
                        return Some(vec![]);
                    }
                    let mut high = end;
                    while high - low > f64::EPSILON {
                        let middle = 0.5 * (low + high);
                        match self.at(now, middle)[i] == value {
                            true => low = middle,
                            false => high = middle,
                        }
                    }
                    all.push(now.t + high * now.dt);
                    (low, value) = (high, self.at(now, high)[i]);
                }
            }
            first = last;
        }
        Some(all)
    }

    /// The values at a share of the way.
    fn at(&self, now: &Now<'_>, share: f64) -> SmallVec<[f64; 4]> {
        let mut inputs = SmallVec::<[f64; 4]>::from_slice(now.u);
        if let Some(between) = now.between {
            between.inputs_at(share, share, now.u, &mut inputs);
        }
        let at = Now {
            t: now.t + share * now.dt,
            u: &inputs,
            ..*now
        };
        let mut values: SmallVec<[f64; 4]> = smallvec![0.0; self.count];
        self.values.point(&at, &[], &mut values);
        values
    }
}

/// Returns which values follow no state, `true` where they follow time or inputs.
fn timed(graph: &Graph) -> Vec<Option<bool>> {
    let mut all: Vec<Option<bool>> = vec![];
    for id in 0..graph.len() {
        let node = graph.get(id).0;
        let is_timed = match node {
            Node::State(_) => None,
            Node::Time | Node::Input(_) => Some(true),
            _ => {
                let (of, count) = node.operands();
                let operands: Option<Vec<bool>> = of[..count].iter().map(|id| all[*id]).collect();
                operands.map(|all| all.contains(&true))
            }
        };
        all.push(is_timed);
    }
    all
}

#[cfg(test)]
mod tests {
    use crate::effect::{Catalogue, augment};
    use crate::equations::Equations;
    use crate::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score};
    use crate::record::{Drive, Record, Signal};
    use crate::twin::{DigitalTwin, Noise, Twin};
    use std::sync::Arc;

    fn text(rate: &str, record: &str) -> Twin {
        let text = format!(
            "[parameters]\nat = {{ prior = [1.0, 4.0] }}\n[states]\nx = {{ rate = \"{rate}\", start = 0.0 }}\n\
             [outputs]\ny = {{ value = \"x\", noise = 0.05 }}\n[record]\n{record}\n"
        );
        Twin::from(Arc::new(Equations::parse(&text).unwrap()))
    }

    /// Integrals of what jumps within long steps, in closed form.
    #[test]
    fn steps_end_where_rates_jump() {
        let drive = Drive::autonomous(2.0, 4).unwrap();
        let at = 2.7_f64;
        let after = |t: f64| (t - at).max(0.0);
        let teeth = |t: f64| {
            let whole = (t / 0.7).floor();
            whole * 0.245 + 0.5 * (t - 0.7 * whole).powi(2)
        };
        let stairs = |t: f64| {
            (0..8)
                .map(|k| (t - 1.0 - f64::from(k)).max(0.0))
                .sum::<f64>()
        };
        let pulse = |t: f64| (t - at).clamp(0.0, 0.3);
        let cases: [(&str, &dyn Fn(f64) -> f64); 6] = [
            ("if(t > at, 1, 0)", &after),
            ("if(at <= t, t, 0)", &|t| 0.5 * (t * t - at * at).max(0.0)),
            ("0.5 + 0.5*sign(t - at)", &after),
            ("mod(t, 0.7)", &teeth),
            ("floor(t)", &stairs),
            ("if(t > at and t < at + 0.3, 1, 0)", &pulse),
        ];
        for (rate, expected) in cases {
            // Stiff steps take differences of time.
            for (record, close) in [("", 1e-9), ("integrator = 'stiff'", 1e-7)] {
                let run = text(rate, record).free_run(&[at], &drive).unwrap();
                for (k, y) in run.iter().enumerate() {
                    let expected = expected(2.0 * k as f64);
                    assert!(
                        (y - expected).abs() < close,
                        "{rate}, {record}, row {k}: {y}, {expected}"
                    );
                }
            }
        }
    }

    /// An input on a line that passes a threshold, twice in one step.
    #[test]
    fn inputs_pass_thresholds_within_steps() {
        let text = "[parameters]\nhigh = { prior = [0.1, 2.0] }\n[inputs]\nu = { hold = 'linear' }\n\
                    [states]\nx = { rate = \"if(u > high, 1, 0) + if(u > 0.2 and u < 0.3, 10, 0)\", start = 0.0 }\n\
                    [outputs]\ny = { value = \"x\", noise = 0.05 }";
        let twin = Arc::new(Equations::parse(text).unwrap());
        let u = Signal::from_shape_vec((3, 1), vec![0.0, 2.0, 0.0]).unwrap();
        let run = twin.free_run(&[1.7], &Drive::new(4.0, u).unwrap()).unwrap();
        // Of each way up or down, 0.3 of 2 are above, and 0.1 between.
        for (k, y) in run.iter().enumerate() {
            let expected = k as f64 * 4.0 * (0.15 + 10.0 * 0.05);
            assert!((y - expected).abs() < 1e-9, "row {k}: {y}, {expected}");
        }
    }

    /// The likelihood follows the time of a switch smoothly, to the slope of its closed form, one filter or several side by side, with an effect
    /// on the motion, too.
    #[test]
    fn a_switch_time_has_a_slope() {
        let drive = Drive::autonomous(2.0, 4).unwrap();
        let twin = text("if(t > at, 1, 0)", "");
        let noise = Noise::new(1, "switch", 0);
        let outputs = twin.simulate(&[2.7], &drive, noise).unwrap();
        let record = Record::new(drive, outputs.clone()).unwrap();
        let force = Catalogue::default()
            .effect("constant-forcing", "x")
            .unwrap();
        let forced = augment(twin.clone(), vec![force]).unwrap();
        for (twin, force) in [(twin, None), (forced, Some(0.02))] {
            let (equations, settings) = (twin.equations().unwrap(), FilterSettings::default());
            let kalman = Kalman::new(equations, &record, &settings).unwrap();
            let coordinates = Coordinates::new(&twin.parameters());
            let theta = |at: f64| -> Vec<f64> { [at].into_iter().chain(force).collect() };
            let closed = |at: f64| {
                let mean = |t: f64| (t - at).max(0.0) + force.unwrap_or(0.0) * t;
                let of = |(k, y): (usize, &f64)| ((y - mean(2.0 * k as f64)) / 0.05).powi(2);
                -0.5 * outputs.iter().enumerate().map(of).sum::<f64>()
            };
            for at in [2.2, 2.5, 2.7, 3.1] {
                let h = 1e-5;
                let of = |at: f64| kalman.log_likelihood(&theta(at)).unwrap();
                let slope = (of(at + h) - of(at - h)) / (2.0 * h);
                let expected = (closed(at + h) - closed(at - h)) / (2.0 * h);
                // Coordinates are logarithms.
                let score = Score::forward(&kalman, &theta(at), &coordinates).unwrap();
                let beside = score.gradient[0] / at;
                let allowed = 1e-3 * (1.0 + expected.abs());
                assert!(
                    (slope - expected).abs() < allowed
                        && (beside - expected).abs() < 10.0 * allowed,
                    "{at}, {force:?}: {slope}, {beside}, {expected}"
                );
            }
        }
    }
}
