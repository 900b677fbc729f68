//! A twin whose delay registers are cut to what a diagnosis looks at.

use crate::twin::{
    DigitalTwin, Integrator, Interval, Now, Outline, Signal, SimulationError, StateSpace,
};
use smallvec::SmallVec;
use std::sync::Arc;

/// Effects with more memory values than this are delays, whose registers are cut.
pub(super) const LONG: usize = 8;

/// The twin with at most `kept` memory values of each effect (`id@target`), for filters: a delay keeps 64 past samples, and
/// a filter's cost grows with the square of the states. Delays of up to kept − 1 steps are exact.
///
/// Memories are the states named `id@target/k`, newest first.
pub(super) fn shorten(
    twin: Arc<dyn DigitalTwin>,
    kept: &[(String, usize)],
) -> Arc<dyn DigitalTwin> {
    let Some(outline) = twin.state_space().map(StateSpace::outline) else {
        return twin;
    };
    let most = |effect: &str| kept.iter().find(|(key, _)| key == effect).map(|(_, k)| *k);
    let beyond = |name: &str| -> Option<bool> {
        let (effect, index) = name.rsplit_once('/')?;
        Some(index.parse::<usize>().ok()? >= most(effect)?)
    };
    let kept: Vec<usize> = (0..outline.states.len())
        .filter(|&i| {
            let name = &outline.states[i].name;
            !beyond(name).unwrap_or(false)
        })
        .collect();
    if kept.len() == outline.states.len() {
        return twin;
    }
    // A state that is cut repeats the nearest one before it that is kept.
    let source = (0..outline.states.len())
        .map(|i| kept.partition_point(|&k| k <= i).saturating_sub(1))
        .collect();
    Arc::new(Shortened {
        base: twin,
        kept,
        source,
        outline,
    })
}

struct Shortened {
    base: Arc<dyn DigitalTwin>,
    kept: Vec<usize>,
    /// For each state of the base twin, the state here that stands for it.
    source: Vec<usize>,
    /// Of the base twin.
    outline: Outline,
}

impl Shortened {
    fn inner(&self) -> &dyn StateSpace {
        self.base
            .state_space()
            .expect("only twins with equations are shortened")
    }

    fn long(&self, x: &[f64]) -> SmallVec<[f64; 96]> {
        self.source.iter().map(|&i| x[i]).collect()
    }

    fn through(&self, x: &mut [f64], with: impl FnOnce(&mut [f64])) {
        let mut long = self.long(x);
        with(&mut long);
        self.cut(&long, x);
    }

    fn cut(&self, long: &[f64], x: &mut [f64]) {
        for (to, &i) in x.iter_mut().zip(&self.kept) {
            *to = long[i];
        }
    }
}

impl StateSpace for Shortened {
    fn outline(&self) -> Outline {
        let states = self.kept.iter().map(|&i| self.outline.states[i].clone());
        Outline {
            states: states.collect(),
            ..self.outline.clone()
        }
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let mut long = self.long(x);
        let x: SmallVec<[f64; 96]> = long.clone();
        self.inner().drift(now, &x, &mut long);
        self.cut(&long, dx);
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.inner().observe(now, &self.long(x), y);
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.through(x, |x| self.inner().start(now, x));
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        let mut long: SmallVec<[f64; 96]> = SmallVec::from_elem(0.0, self.source.len());
        self.inner().noise(now, &mut long, measurement);
        self.cut(&long, process);
    }
    fn limits(&self) -> Vec<Interval> {
        let all = self.inner().limits();
        self.kept.iter().map(|&i| all[i]).collect()
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.through(x, |x| self.inner().constrain(now, x));
    }
    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        self.through(x, |x| self.inner().update(now, x));
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.inner().readout(now, y);
    }
    fn admit(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.inner().admit(theta, dt)
    }
    fn strike(&self, theta: &[f64], noise: crate::twin::Noise, outputs: &mut Signal) {
        self.inner().strike(theta, noise, outputs);
    }
    fn integrator(&self) -> Integrator {
        self.inner().integrator()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::parse_effects;
    use crate::twin::{Drive, Noise, augment};
    use crate::twins::CascadedTanks;

    #[test]
    fn short_delays_are_exact() {
        let text = "[[effect]]\nid = 'sensor-delay'\ntarget = 'sensor'\n";
        let long = augment(Arc::new(CascadedTanks), parse_effects(text).unwrap()).unwrap();
        let short = shorten(long.clone(), &[("sensor-delay@sensor".into(), 5)]);
        let states =
            |twin: &Arc<dyn DigitalTwin>| twin.state_space().unwrap().outline().states.len();
        assert_eq!((states(&long), states(&short)), (2 + 64, 2 + 5));
        let u = Signal::from_shape_fn((80, 1), |(k, _)| (k % 17) as f64 / 6.0);
        let drive = Drive::new(0.5, u).unwrap();
        for delay in [0.0, 0.7, 2.0] {
            let theta = [0.6, 0.5, 0.55, 1.0, delay];
            let noise = Noise::new(1, "t", 0);
            let run = |twin: &Arc<dyn DigitalTwin>| twin.simulate(&theta, &drive, noise).unwrap();
            assert_eq!(run(&long), run(&short));
        }
    }
}
