//! Places in a twin: their names, as the library of effects names its targets, and those that mean the same by the structure of the equations.
//!
//! | where | means the same as |
//! |---|---|
//! | a parameter or an actuator that enters the rate of one state alone | that state |
//! | a parameter or an actuator that enters one output alone | that sensor |
//! | a parameter by which one input alone is multiplied | that actuator, and the reverse |
//!
//! A law missing at the first place is as well a law missing at the second: no record tells which.

use super::draft::index;
use super::law::DeparturePlace;
use super::scene::{Scene, SignalExtent};
use crate::effect::{TargetKind, targets};
use crate::evaluate::trials::numbers::TRIAL;
use crate::twin::{Composed, Now, Role, Source, Twin, is_memory};

/// Places of a twin and their names.
#[derive(Debug, Clone)]
pub(super) struct TwinPlaces {
    /// In the order of their kinds.
    named: Vec<(DeparturePlace, String)>,
    /// Names of the states.
    pub states: Vec<String>,
}

impl TwinPlaces {
    /// Sensors, actuators, states that are neither memory nor defined by another state, and parameters of a twin.
    pub fn new(twin: &Twin) -> Self {
        let (outline, signals) = (twin.outline(), twin.signals());
        let states: Vec<String> = (outline.iter())
            .flat_map(|o| o.states.iter().map(|s| s.name.clone()))
            .collect();
        let defined = twin.defined_states();
        let mut named = Vec::new();
        let signals_of = |kind| targets(kind, None, &signals);
        let is_defined =
            |place| matches!(place, DeparturePlace::State(i) if defined.get(i) == Some(&true));
        let mut add = |names: Vec<String>, place: fn(usize) -> DeparturePlace| {
            for (i, name) in names.into_iter().enumerate() {
                if !is_memory(&name) && !is_defined(place(i)) {
                    named.push((place(i), name));
                }
            }
        };
        add(signals_of(TargetKind::Sensor), DeparturePlace::Sensor);
        add(signals_of(TargetKind::Actuator), DeparturePlace::Actuator);
        add(states.clone(), DeparturePlace::State);
        let parameters = twin.parameters();
        for (i, parameter) in parameters.iter().enumerate() {
            if parameter.role == Role::Parameter {
                named.push((DeparturePlace::Parameter(i), parameter.name.clone()));
            }
        }
        Self { named, states }
    }

    /// The place with this name that suits an effect of this id, whose first word is its kind of place.
    pub fn find(&self, id: &str, target: &str) -> Option<DeparturePlace> {
        let word = id.split('-').next();
        let kinds = [
            TargetKind::Sensor,
            TargetKind::Actuator,
            TargetKind::Parameter,
        ];
        let kind = kinds.into_iter().find(|kind| word == Some(kind.name()));
        let kind = kind.unwrap_or(TargetKind::State);
        (self.named.iter())
            .find(|(place, name)| place.kind() == kind && name == target)
            .map(|(place, _)| *place)
    }

    /// The name of a place.
    pub fn name(&self, place: DeparturePlace) -> &str {
        (self.named.iter())
            .find(|(known, _)| *known == place)
            .map_or("", |(_, name)| name)
    }

    /// Draws a kind of place, then a place: a twin of many parameters has sensors all the same.
    pub fn draw(&self, source: &mut Source) -> Option<DeparturePlace> {
        let by_kind = self.named.chunk_by(|(a, _), (b, _)| a.kind() == b.kind());
        let groups: Vec<_> = by_kind.collect();
        if groups.is_empty() {
            return None;
        }
        let group = groups[index(source, groups.len())];
        Some(group[index(source, group.len())].0)
    }

    /// All places.
    pub fn all(&self) -> impl Iterator<Item = DeparturePlace> + '_ {
        self.named.iter().map(|(place, _)| *place)
    }
}

/// States and sensors that something enters.
type Entries = Vec<DeparturePlace>;

/// The state or sensor, where it is the only one.
fn only(entries: &Entries) -> Option<DeparturePlace> {
    match entries[..] {
        [place] => Some(place),
        _ => None,
    }
}

/// Entries of a twin's parameters and inputs into its equations.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Structure {
    parameters: Vec<Entries>,
    inputs: Vec<Entries>,
    /// Input that each parameter is the gain of.
    gains: Vec<Option<usize>>,
}

/// One moment of a record: time, step, states, inputs, parameters.
#[derive(Debug, Clone)]
struct At {
    t: f64,
    dt: f64,
    x: Vec<f64>,
    u: Vec<f64>,
    theta: Vec<f64>,
}

impl At {
    /// Rates of the states, then outputs.
    fn values(&self, twin: &Composed, outputs: usize) -> Vec<f64> {
        let now = Now::new(self.t, self.dt, &self.u, &self.theta);
        let (mut rates, mut y) = (vec![0.0; self.x.len()], vec![0.0; outputs]);
        twin.drift(&now, &self.x, &mut rates);
        twin.observe(&now, &self.x, &mut y);
        [rates, y].concat()
    }

    fn changed(&self, change: &dyn Fn(&mut Self)) -> Self {
        let mut at = self.clone();
        change(&mut at);
        at
    }
}

impl Structure {
    /// Compares the equations of a twin at some moments of a record at θ. What does not enter leaves every digit as it is.
    pub fn of(twin: &Composed, theta: &[f64], scene: &Scene) -> Self {
        let outline = twin.outline();
        let (states, outputs) = (outline.states.len(), outline.outputs.len());
        let (run, samples) = (&scene.run, scene.run.drive.samples());
        let moments: Vec<At> = (0..TRIAL.structure_moments.min(samples))
            .map(|m| (2 * m + 1) * samples / (2 * TRIAL.structure_moments))
            .map(|k| At {
                t: run.drive.time(k),
                dt: scene.dt,
                x: run.states.row(k).to_vec(),
                u: run.drive.input(k).to_vec(),
                theta: theta.to_vec(),
            })
            .collect();
        let values = |at: &At| at.values(twin, outputs);
        let place = |k: usize| match k < states {
            true => DeparturePlace::State(k),
            false => DeparturePlace::Sensor(k - states),
        };
        let entered = |change: &dyn Fn(&mut At)| {
            let pairs = moments
                .iter()
                .map(|at| (values(at), values(&at.changed(change))));
            let pairs: Vec<_> = pairs.collect();
            let is_changed = |k: &usize| {
                let differs =
                    |(own, there): &(Vec<f64>, Vec<f64>)| own[*k].to_bits() != there[*k].to_bits();
                pairs.iter().any(differs)
            };
            (0..states + outputs)
                .filter(is_changed)
                .map(place)
                .collect::<Entries>()
        };
        let steps: Vec<f64> = (outline.parameters.iter())
            .map(|p| TRIAL.structure_step * p.prior.width())
            .collect();
        let parameters: Vec<Entries> = (steps.iter().enumerate())
            .map(|(p, step)| entered(&|at: &mut At| at.theta[p] += step))
            .collect();
        let inputs: Vec<Entries> = (scene.inputs.iter().enumerate())
            .map(|(j, size)| entered(&|at: &mut At| at.u[j] += TRIAL.structure_range * size.span()))
            .collect();
        let is_state = |place: &DeparturePlace| matches!(place, DeparturePlace::State(_));
        let gains = (steps.iter().zip(&parameters).enumerate())
            .map(|(p, (step, entries))| {
                if entries.is_empty() || !entries.iter().all(is_state) {
                    return None;
                }
                let gain = gain(&values, scene, &moments, (p, *step))?;
                (inputs[gain] == *entries).then_some(gain)
            })
            .collect();
        Self {
            parameters,
            inputs,
            gains,
        }
    }

    /// Returns the other places that mean the same as this one.
    pub fn same_as(&self, place: DeparturePlace) -> Vec<DeparturePlace> {
        match place {
            DeparturePlace::Parameter(p) => {
                let gain = self.gains.get(p).copied().flatten();
                let only = self.parameters.get(p).and_then(only);
                only.into_iter()
                    .chain(gain.map(DeparturePlace::Actuator))
                    .collect()
            }
            DeparturePlace::Actuator(j) => {
                let only = self.inputs.get(j).and_then(only);
                let gains = (self.gains.iter().enumerate())
                    .filter(|(_, gain)| **gain == Some(j))
                    .map(|(p, _)| DeparturePlace::Parameter(p));
                only.into_iter().chain(gains).collect()
            }
            DeparturePlace::State(_) | DeparturePlace::Sensor(_) => vec![],
        }
    }
}

/// Input that alone decides the slope of the rates in a parameter; none where a state or the time does, too.
fn gain(
    values: &dyn Fn(&At) -> Vec<f64>,
    scene: &Scene,
    moments: &[At],
    (p, step): (usize, f64),
) -> Option<usize> {
    let slope = |at: &At| -> Vec<f64> {
        let [low, high] = [-step, step].map(|by| values(&at.changed(&|at| at.theta[p] += by)));
        high.iter().zip(low).map(|(high, low)| high - low).collect()
    };
    let slopes: Vec<Vec<f64>> = moments.iter().map(slope).collect();
    let most = (slopes.iter().flatten()).fold(0.0_f64, |most, s| most.max(s.abs()));
    let decides = |change: &dyn Fn(&mut At)| {
        moments.iter().zip(&slopes).any(|(at, own)| {
            let there = slope(&at.changed(change));
            // A slope that is no number is nobody's gain.
            !(own.iter().zip(there))
                .all(|(own, there)| (own - there).abs() <= TRIAL.structure_rounding * most)
        })
    };
    let step_of = |size: &SignalExtent| TRIAL.structure_range * size.span();
    let mut states = scene.states.iter().enumerate();
    if decides(&|at: &mut At| at.t += TRIAL.structure_range * scene.duration)
        || states.any(|(i, size)| decides(&|at: &mut At| at.x[i] += step_of(size)))
    {
        return None;
    }
    let mut deciding = (scene.inputs.iter().enumerate())
        .filter(|(j, size)| decides(&|at: &mut At| at.u[*j] += step_of(size)))
        .map(|(j, _)| j);
    deciding.next().filter(|_| deciding.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::trials::world::{RecordNoise, equations};
    use crate::record::Drive;
    use crate::twin::{Noise, Outline, Parameter, StateSpace};
    use crate::twins::{CascadedTanks, VanDerPol};

    fn structure(twin: Twin, theta: &[f64]) -> Structure {
        let inputs = twin.signals().inputs.len();
        let levels = crate::record::Signal::from_shape_fn((80, inputs), |(k, _)| {
            1.0 + (0.2 * k as f64).sin()
        });
        let drive = Drive::new(0.1, levels).unwrap();
        let scene =
            Scene::new(&twin, theta, &drive, RecordNoise::of(Noise::new(1, "s", 0))).unwrap();
        Structure::of(equations(&twin).unwrap(), theta, &scene)
    }

    /// k4 multiplies the pump's input, which enters the upper tank alone; k1 is that tank's, k2 and k3 the lower one's.
    #[test]
    fn tanks_have_one_gain_and_parameters_of_one_tank_each() {
        let tanks = structure(Twin::new(CascadedTanks), &[0.6, 0.5, 0.55, 1.0]);
        let [upper, lower] = [0, 1].map(DeparturePlace::State);
        let pump = DeparturePlace::Actuator(0);
        assert_eq!(tanks.same_as(DeparturePlace::Parameter(0)), [upper]);
        assert_eq!(tanks.same_as(DeparturePlace::Parameter(1)), [lower]);
        assert_eq!(tanks.same_as(DeparturePlace::Parameter(2)), [lower]);
        assert_eq!(tanks.same_as(DeparturePlace::Parameter(3)), [upper, pump]);
        assert_eq!(tanks.same_as(pump), [upper, DeparturePlace::Parameter(3)]);
        assert_eq!(tanks.same_as(upper), []);
        assert_eq!(tanks.same_as(DeparturePlace::Sensor(0)), []);
        let oscillator = structure(Twin::new(VanDerPol), &[1.5]);
        assert_eq!(
            oscillator.same_as(DeparturePlace::Parameter(0)),
            [DeparturePlace::State(1)]
        );
    }

    /// ẋ₁ = −a·x₁ + b·u·x₂ + u, ẋ₂ = −a·x₂, y = c·x₁: a enters two rates, b·u depends on a state, c is the sensor's.
    struct Mixed;
    impl StateSpace for Mixed {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("a", "1/s", 0.2, 2.0))
                .parameter(Parameter::new("b", "1/s", 0.2, 2.0))
                .parameter(Parameter::new("c", "1", 0.2, 2.0))
                .state("x1", "m")
                .state("x2", "m")
                .input("u", "m/s")
                .output("y", "m")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = -now.theta[0] * x[0] + now.theta[1] * now.u[0] * x[1] + now.u[0];
            dx[1] = -now.theta[0] * x[1];
        }
        fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = now.theta[2] * x[0];
        }
        fn start(&self, _: &Now<'_>, x: &mut [f64]) {
            x.fill(1.0);
        }
    }

    #[test]
    fn parameters_of_several_rates_or_of_a_state_are_no_gains() {
        let mixed = structure(Twin::new(Mixed), &[0.7, 0.8, 0.9]);
        assert_eq!(mixed.same_as(DeparturePlace::Parameter(0)), []);
        assert_eq!(
            mixed.same_as(DeparturePlace::Parameter(1)),
            [DeparturePlace::State(0)]
        );
        assert_eq!(
            mixed.same_as(DeparturePlace::Parameter(2)),
            [DeparturePlace::Sensor(0)]
        );
        assert_eq!(
            mixed.same_as(DeparturePlace::Actuator(0)),
            [DeparturePlace::State(0)]
        );
    }
}
