//! Equations against the runs of a simulator that the twin has beside them.

use super::Study;
use crate::math::{deviation, three_digits};
use crate::record::{Drive, Signal};
use crate::setting::number;
use crate::twin::conformance::Finding;
use crate::twin::{Noise, SimulationError};

/// Largest difference, as a share of an output's deviation: solvers agree to a tenth of it at their usual tolerances, and twice of it would pass
/// a step that a filter is told to halve.
const SHARE: f64 = 5e-3;
/// Parameters drawn from the prior beside its centre: one that acts nowhere at the centre seldom does so at three more.
const DRAWS: u64 = 3;

impl Study {
    /// Compares runs of the twin's own simulator with those of its equations, without noise; `None` of a twin without both.
    pub(crate) fn check_own_runs(&self, drive: &Drive, seed: u64) -> Option<Finding> {
        let own = self.own_runs.as_ref()?;
        let check = "simulate";
        let compared = (0..=DRAWS).try_for_each(|draw| {
            let space = own.parameters();
            let theta = match draw {
                0 => space.centre(),
                _ => space.draw_prior(Noise::new(seed, "own runs", draw)),
            };
            self.same_run(&theta, drive)
        });
        Some(match compared {
            Ok(()) => Finding::pass(check, "the program's runs are those of its equations"),
            Err(problem) => Finding::warning(check, problem),
        })
    }

    /// Compares one run; the error says where each output differs first, and where most.
    fn same_run(&self, theta: &[f64], drive: &Drive) -> Result<(), String> {
        let Some(own) = &self.own_runs else {
            return Ok(());
        };
        let space = own.parameters();
        let values = space.iter().zip(theta);
        let at: Vec<String> = values
            .map(|(p, value)| format!("{} = {}", p.name, number(*value)))
            .collect();
        let at = at.join(", ");
        let twin = (self.stepped(&self.file.record)).map_err(|error| error.to_string())?;
        let run = |ran: Result<Signal, SimulationError>, whose: &str| {
            ran.map_err(|error| format!("{whose} at {at}: {error}"))
        };
        let equations = run(twin.free_run(theta, drive), "the equations")?;
        let own_run = run(own.simulate(theta, drive, Noise::OFF), "the program's run")?;
        let mut wrong = vec![];
        for (j, output) in own.signals().outputs.iter().enumerate() {
            let (one, other) = (own_run.column(j), equations.column(j));
            let scale = deviation(&other.to_vec());
            let off = |k: usize| (one[k] - other[k]).abs();
            let Some(first) = (0..drive.samples()).find(|k| off(*k) > SHARE * scale) else {
                continue;
            };
            let most = (first..drive.samples()).max_by(|a, b| off(*a).total_cmp(&off(*b)));
            let place = |k: usize| {
                format!(
                    "at t = {} s simulate answers {}, the equations give {} ({:+} {})",
                    number(drive.time(k)),
                    three_digits(one[k]),
                    three_digits(other[k]),
                    three_digits(one[k] - other[k]),
                    output.unit
                )
                .replace(" )", ")")
            };
            let name = &output.name;
            let most = most.filter(|k| *k != first);
            let most = most.map_or(String::new(), |k| format!("; most {}", place(k)));
            wrong.push(format!(
                "{name} differs from {} s on: {}{most}",
                number(drive.time(first)),
                place(first)
            ));
        }
        match wrong.is_empty() {
            true => Ok(()),
            false => Err(format!("{} ({at}); change one of them", wrong.join("; "))),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::record::{Drive, Signal};
    use crate::study::{Study, StudyFile};
    use crate::twin::conformance::Severity;
    use crate::twins::CascadedTanks;
    use std::sync::Arc;

    #[test]
    fn a_simulator_that_is_another_model_is_told_where() {
        let text = |k1: &str| {
            format!(
                "[twin]\nname = 'tanks'\n[parameters]\nk1 = {{ prior = [0.4, 0.8] }}\nk2 = {{ prior = [0.4, 0.8] }}\n\
                 k3 = {{ prior = [0.4, 0.8] }}\nk4 = {{ prior = [0.8, 1.2] }}\n[states]\n\
                 h1 = {{ rate = '-{k1}*sqrt(h1) + k4*u', limits = [0, 10], start = 0 }}\n\
                 h2 = {{ rate = 'k2*sqrt(h1) - k3*sqrt(h2)', limits = [0, 10], start = 0 }}\n\
                 [inputs]\nu = {{}}\n[outputs]\ny = {{ unit = 'V', value = 'h2' }}\n[record]\nintegrator = 'euler'\n"
            )
        };
        let pump = Signal::from_shape_fn((80, 1), |(k, _)| 1.0 + ((k / 20) % 2) as f64);
        let drive = Drive::new(0.5, pump).unwrap();
        let finding = |k1: &str| {
            let file = StudyFile::parse(&text(k1), "s.toml".as_ref()).unwrap();
            let study = Study::of_file(&file).unwrap();
            assert!(study.check_own_runs(&drive, 1).is_none());
            study
                .with_own_runs(Arc::new(CascadedTanks))
                .check_own_runs(&drive, 1)
                .unwrap()
        };
        let same = finding("k1");
        assert_eq!(same.severity, Severity::Pass, "{}", same.message);
        let other = finding("1.1*k1");
        assert_eq!(other.severity, Severity::Warning);
        for part in ["y differs from", "simulate answers", "k1 = 0.6"] {
            assert!(other.message.contains(part), "{}", other.message);
        }
    }

    #[test]
    fn each_output_that_differs_is_told() {
        let text = |y: &str, z: &str| {
            format!(
                "[twin]\nname = 'two'\n[parameters]\nk = {{ prior = [0.4, 0.8] }}\n[states]\nh = {{ rate = '-k*h', start = 1 }}\n\
                 [outputs]\ny = {{ value = '{y}' }}\nz = {{ value = '{z}' }}\n"
            )
        };
        let file = |text: String| StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
        let study = Study::of_file(&file(text("h", "h"))).unwrap();
        let own = file(text("1.1*h", "1.2*h"));
        let own = Arc::new(own.own_equations().unwrap().clone());
        let found = study.with_own_runs(own);
        let found = found.check_own_runs(&Drive::autonomous(0.5, 20).unwrap(), 1);
        let message = found.unwrap().message;
        assert!(
            message.contains("y differs") && message.contains("; z differs"),
            "{message}"
        );
    }
}
