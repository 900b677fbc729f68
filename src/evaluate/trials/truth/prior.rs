//! θ and the conditions of a record.

use crate::evaluate::trials::draft::index;
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::trials::scene::Scene;
use crate::evaluate::trials::world::{Conditions, Feedback};
use crate::evaluate::trials::{Kind, NuisanceKind};
use crate::twin::{Parameter, ParameterSpace, Role, Source};

/// Lags in samples at which an output may answer an input, for the sign of a feedback.
const LAGS: [usize; 6] = [0, 1, 3, 8, 20, 50];

fn between(source: &mut Source, low: f64, high: f64) -> f64 {
    low + (high - low) * source.uniform()
}

/// Room of a parameter below and above its prior, inside the bounds; none for unknown starts, levels and magnitudes.
fn room(p: &Parameter) -> [f64; 2] {
    if p.role != Role::Parameter {
        return [0.0; 2];
    }
    [
        p.prior.low() - p.bounds.low(),
        p.bounds.high() - p.prior.high(),
    ]
}

/// Returns true if some parameter can lie outside its prior.
pub(super) fn has_room(space: &ParameterSpace) -> bool {
    space.iter().any(|p| room(p).iter().any(|room| *room > 0.0))
}

/// Draws θ: in the prior, or with at least one parameter outside it, by up to the prior's width.
pub(super) fn theta(
    kind: Kind,
    space: &ParameterSpace,
    prior: Vec<f64>,
    source: &mut Source,
) -> Vec<f64> {
    let mut theta = prior;
    if !kind.is_outside() {
        return theta;
    }
    let movable: Vec<usize> = (space.iter().enumerate())
        .filter(|(_, p)| room(p).iter().any(|room| *room > 0.0))
        .map(|(j, _)| j)
        .collect();
    if movable.is_empty() {
        return theta;
    }
    let first = movable[index(source, movable.len())];
    for j in movable {
        if j != first && !source.happens(0.3) {
            continue;
        }
        let p = &space[j];
        let [below, above] = room(p);
        // The end of the bounds itself is nobody's system.
        let part = between(source, 0.1, 0.8);
        theta[j] = if source.uniform() * (below + above) < below {
            p.prior.low() - part * below.min(p.prior.width())
        } else {
            p.prior.high() + part * above.min(p.prior.width())
        };
    }
    theta
}

/// Kinds of nuisance that a twin can have.
pub(super) fn nuisances(scene: &Scene, is_noisy: bool) -> Vec<NuisanceKind> {
    let has_states = !scene.states.is_empty();
    let mut all = vec![NuisanceKind::Gaps];
    if is_noisy {
        all.extend([
            NuisanceKind::Level,
            NuisanceKind::Coloured,
            NuisanceKind::HeavyTailed,
            NuisanceKind::ProportionalNoise,
        ]);
    }
    if has_states {
        all.extend([NuisanceKind::Start, NuisanceKind::OperatingPoint]);
        if !scene.inputs.is_empty() {
            all.extend([NuisanceKind::ClosedLoop, NuisanceKind::SampledInput]);
        }
    }
    all
}

/// Draws the conditions of a record. `is_silent`: the twin declares no noise, and its sensors are given some.
pub(super) fn conditions(
    scene: &Scene,
    is_silent: bool,
    (allowed, probability): (&[NuisanceKind], f64),
    source: &mut Source,
) -> Conditions {
    let mut conditions = Conditions::declared();
    if is_silent {
        let levels = scene
            .outputs
            .iter()
            .map(|size| TRIAL.silent_noise * size.deviation);
        conditions.added = levels.collect();
    }
    // Both draws are made whatever comes of them.
    let (happens, choice) = (source.happens(probability), source.uniform());
    if !happens {
        return conditions;
    }
    let choice = (choice * allowed.len() as f64) as usize;
    conditions.nuisance = allowed[choice.min(allowed.len() - 1)];
    match conditions.nuisance {
        NuisanceKind::None => {}
        NuisanceKind::Level => {
            let mut factor = || TRIAL.noise_factor.powf(between(source, -1.0, 1.0));
            (conditions.process, conditions.measurement) = (factor(), factor());
        }
        NuisanceKind::Coloured => conditions.colour = between(source, 0.3, 0.9),
        NuisanceKind::HeavyTailed => conditions.freedom = Some(3 + index(source, 3) as u32),
        NuisanceKind::ProportionalNoise => conditions.proportional = between(source, 0.02, 0.08),
        NuisanceKind::OperatingPoint => {
            let share = between(source, 0.2, 0.8);
            conditions.lead = (share * scene.run.drive.samples() as f64).ceil() as usize;
        }
        NuisanceKind::SampledInput => conditions.sampled = true,
        NuisanceKind::Start => {
            conditions.start = (scene.states.iter())
                .map(|size| 0.3 * size.deviation * source.normal())
                .collect();
        }
        NuisanceKind::ClosedLoop => conditions.feedback = feedback(scene, source),
        NuisanceKind::Gaps => conditions.gaps = between(source, 0.05, 0.2),
    }
    conditions
}

/// Negative feedback: its sign is that by which the first output answers the first input.
fn feedback(scene: &Scene, source: &mut Source) -> Option<Feedback> {
    let (u, y) = (scene.inputs.first()?, scene.outputs.first()?);
    let (inputs, outputs) = (scene.run.drive.inputs(), &scene.run.outputs);
    let mean = |signal: &crate::record::Signal| {
        signal.column(0).iter().sum::<f64>() / signal.nrows().max(1) as f64
    };
    let (mean_u, mean_y) = (mean(inputs), mean(outputs));
    let answer = |lag: usize| -> f64 {
        (lag..outputs.nrows())
            .map(|k| (inputs[[k - lag, 0]] - mean_u) * (outputs[[k, 0]] - mean_y))
            .sum()
    };
    let strongest = (LAGS.map(answer).into_iter())
        .max_by(|a, b| a.abs().total_cmp(&b.abs()))
        .filter(|answer| *answer != 0.0)?;
    let gain = between(source, 0.2, 0.7) * strongest.signum() * u.span() / y.span();
    Some(Feedback {
        gain,
        setpoint: mean_y,
        low: u.low,
        high: u.high,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    #[test]
    fn theta_outside_the_prior_stays_inside_the_bounds() {
        let space = ParameterSpace::new([
            Parameter::new("a", "1", 1.0, 2.0).within(0.1, 9.0),
            Parameter::new("b", "1", 0.0, 1.0),
        ]);
        assert!(has_room(&space));
        for i in 0..50 {
            let noise = Noise::new(1, "theta", i);
            let prior = space.draw_prior(noise);
            let mut source = noise.source("truth");
            let theta = theta(Kind::Outside, &space, prior, &mut source);
            space.check_point(&theta).unwrap();
            assert!(!space[0].prior.contains(theta[0]), "{theta:?}");
            assert!(space[1].prior.contains(theta[1]));
        }
        let tight = ParameterSpace::new([Parameter::new("a", "1", 1.0, 2.0)]);
        assert!(!has_room(&tight));
    }
}
