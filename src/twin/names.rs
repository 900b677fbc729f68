//! Names that files, the command line and effects can tell apart.

use super::parameter::check_unique;
use crate::record::{Drive, Quantity, Signal};
use crate::twin::{Outline, Parameter, Role, Twin, TwinError};

/// Characters with a meaning in names that are put together: `start.h1`, `id@target.magnitude`, `disturbance/0`.
const RESERVED: [char; 3] = ['/', '@', '.'];

/// Checks the names, priors and bounds of a twin of one's own.
///
/// Parameters of a black box may hold a dot, as the variables of most FMUs do: no effect targets them.
pub(crate) fn check_twin(twin: &Twin) -> Result<(), TwinError> {
    let parameters = twin.parameters();
    parameters.check()?;
    match twin.outline() {
        Some(outline) => {
            check_outline(&outline)?;
            check_noise(twin, &outline)
        }
        None => {
            let signals = twin.signals();
            check_unique("input", names(&signals.inputs))?;
            check_unique("output", names(&signals.outputs))?;
            parameters.iter().try_for_each(check_composed)
        }
    }
}

/// Checks the noise levels of a twin at the centre of its prior and its start.
fn check_noise(twin: &Twin, outline: &Outline) -> Result<(), TwinError> {
    let centre = outline.parameters.centre();
    // Levels may ask for the inputs: a few samples of zeros.
    let inputs = Signal::zeros((2, outline.inputs.len()));
    let levels = (Drive::new(1.0, inputs).ok()).and_then(|drive| twin.first_noise(&centre, &drive));
    let [process, measurement] = levels.unwrap_or_default();
    let of_states = names(&outline.states).zip(process);
    let of_outputs = names(&outline.outputs).zip(measurement);
    // A level that is not a number at once may be one along a run.
    match of_states.chain(of_outputs).find(|(_, level)| *level < 0.0) {
        None => Ok(()),
        Some((name, value)) => Err(TwinError::Value {
            table: "noise",
            name: name.into(),
            value,
            remedy: "a noise level is a standard deviation: 0 or above",
        }),
    }
}

fn check_outline(outline: &Outline) -> Result<(), TwinError> {
    let parameters: Vec<&str> = outline.parameters.names();
    let states: Vec<&str> = names(&outline.states).collect();
    for (kind, all) in [
        ("parameter", &parameters),
        ("state", &states),
        ("input", &names(&outline.inputs).collect()),
        ("output", &names(&outline.outputs).collect()),
    ] {
        check_unique(kind, all.iter().copied())?;
        for name in all {
            let problem = if name.is_empty() {
                "is empty; give it one"
            } else if name.contains(RESERVED) {
                "holds one of / @ .; use letters, digits, _ and - instead"
            } else if matches!(kind, "parameter" | "state") && is_channel(name) {
                "is what effects call a channel; rename it"
            } else if kind == "output" && states.contains(name) {
                "is a state's name too; rename one, since noise levels go by both"
            } else {
                continue;
            };
            return Err(named(kind, name, problem));
        }
    }
    Ok(())
}

/// Refuses a black box's parameter that reads like one of another role.
fn check_composed(parameter: &Parameter) -> Result<(), TwinError> {
    let (name, role) = (&parameter.name, parameter.role);
    let problem = if name.contains('@') {
        "holds an @, which stands in names of magnitudes; use _ instead"
    } else if name.starts_with("start.") && role != Role::Start {
        "begins as an unknown start does; rename it"
    } else if name.starts_with("noise.") && role != Role::Noise {
        "begins as an unknown noise level does; rename it"
    } else {
        return Ok(());
    };
    Err(named("parameter", name, problem))
}

/// Tells whether effects call a channel by this name: `sensor`, `actuator2`.
fn is_channel(name: &str) -> bool {
    let number = name
        .strip_prefix("sensor")
        .or(name.strip_prefix("actuator"));
    number.is_some_and(|digits| digits.chars().all(|c| c.is_ascii_digit()))
}

/// Tells whether a state is the memory of an effect or a disturbance, not the twin's own: no state of a twin holds a slash.
pub(crate) fn is_memory(state: &str) -> bool {
    state.contains('/')
}

fn names(quantities: &[Quantity]) -> impl Iterator<Item = &str> {
    quantities.iter().map(|quantity| quantity.name.as_str())
}

fn named(kind: &str, name: &str, problem: &str) -> TwinError {
    TwinError::Declaration(format!("{kind} name \"{name}\" {problem}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::{Now, StateSpace};

    fn problem(outline: Outline) -> String {
        check_outline(&outline).unwrap_err().to_string()
    }

    #[test]
    fn names_that_cannot_be_told_apart_are_refused() {
        let tank = || {
            Outline::new()
                .parameter(Parameter::new("k", "", 0.0, 1.0))
                .state("h", "m")
                .input("u", "")
                .output("y", "m")
        };
        assert_eq!(check_outline(&tank()), Ok(()));
        for (outline, text) in [
            (
                tank().state("dp/dt", ""),
                "state name \"dp/dt\" holds one of / @ .",
            ),
            (tank().input("pump.speed", ""), "input name \"pump.speed\""),
            (tank().state("h", "m"), "duplicate state name h; rename one"),
            (tank().output("y", "m"), "duplicate output name y"),
            (tank().output("h", "m"), "is a state's name too; rename one"),
            (
                tank().state("sensor2", ""),
                "is what effects call a channel",
            ),
            (tank().output("", "m"), "output name \"\" is empty"),
        ] {
            let error = problem(outline);
            assert!(error.contains(text), "{error}");
        }
    }

    /// A clock whose noise has this level.
    struct Clock(f64);

    impl StateSpace for Clock {
        fn outline(&self) -> Outline {
            let outline = Outline::new().parameter(Parameter::new("k", "", 0.0, 1.0));
            outline.state("x", "s").output("y", "s")
        }
        fn drift(&self, now: &Now<'_>, _: &[f64], dx: &mut [f64]) {
            dx[0] = now.theta[0];
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0];
        }
        fn noise(&self, _: &Now<'_>, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
            measurement[0] = self.0;
        }
    }

    #[test]
    fn a_negative_noise_is_refused() {
        assert_eq!(check_twin(&Twin::new(Clock(0.0))), Ok(()));
        let error = check_twin(&Twin::new(Clock(-0.1))).unwrap_err().to_string();
        assert!(
            error.contains("noise y = -0.1; a noise level is"),
            "{error}"
        );
    }

    #[test]
    fn variables_of_fmus_keep_their_dots() {
        let parameter = |name| Parameter::new(name, "", 0.0, 1.0);
        assert_eq!(check_composed(&parameter("body.mass")), Ok(()));
        for bad in ["gain@u", "start.h1", "noise.y"] {
            assert!(check_composed(&parameter(bad)).is_err(), "{bad}");
        }
        let start = parameter("start.h1").with_role(Role::Start);
        assert_eq!(check_composed(&start), Ok(()));
    }
}
