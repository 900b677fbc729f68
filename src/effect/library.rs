//! All effects of the library, and where in a twin each can stand.

use super::*;
use crate::effect::{Effects, Law, Magnitude, targets};
use crate::twin::{Noise, Now, Outline, ParameterSpace, Role, StateSpace, Twin};

/// What an effect is, for people and tables.
///
/// ```
/// use truetwin::effect::{Description, library};
///
/// let lag: Description = library().into_iter().find(|d| d.id == "sensor-lag").ok_or("it is listed")?;
/// assert_eq!((lag.law.target(), lag.magnitudes[0].name), ("sensor", "tau"));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Description {
    /// Id, as in files.
    pub id: &'static str,
    /// The law that it bends; [`Law::target`] names the kind of target.
    pub law: Law,
    /// The key of the other state in files: `from` or `to`.
    pub other: Option<&'static str>,
    /// Magnitudes in the order of θ.
    pub magnitudes: Vec<Magnitude>,
    /// The law in one line.
    pub formula: &'static str,
}

/// An effect that is not of the library, as far as it describes itself.
pub fn described(effect: &dyn UnmodelledEffect) -> Description {
    Description {
        id: effect.typetag_name(),
        law: effect.law(),
        other: None,
        magnitudes: effect.magnitudes(),
        formula: "an effect of this program",
    }
}

/// Every effect of the library, in the order of its table.
///
/// ```
/// assert!(truetwin::effect::library().iter().any(|description| description.id == "state-ceiling"));
/// ```
pub fn library() -> Vec<Description> {
    (members().into_iter())
        .map(|member| {
            let effect = (member.make)("", "");
            Description {
                id: effect.typetag_name(),
                law: effect.law(),
                other: member.other,
                magnitudes: effect.magnitudes(),
                formula: member.formula,
            }
        })
        .collect()
}

/// Every effect of the library that this twin may lack, once for each target and other state, all magnitudes free.
///
/// Targets are the twin's own states and parameters, not the memories and magnitudes of effects already added.
/// `cubic-stiffness` is offered where a state is the rate of another, which is found by probing the drift.
///
/// ```
/// use truetwin::effect::applicable;
/// use truetwin::twin::Twin;
/// use truetwin::twins::VanDerPol;
///
/// let possible = applicable(&Twin::new(VanDerPol));
/// assert!(possible.iter().any(|effect| effect.target() == "x2"));
/// assert!(possible.iter().all(|effect| effect.target() != "actuator")); // the oscillator has no input
/// ```
pub fn applicable(twin: &Twin) -> Effects {
    let signals = twin.signals();
    let outline = twin.outline().map(own);
    let rates = match twin {
        Twin::Equations(equations) => rates(equations.as_ref()),
        Twin::BlackBox(_) => vec![],
    };
    let mut effects = Effects::new();
    for Member { make, other, .. } in members() {
        let law = make("", "").law();
        let known = targets(law, outline.as_ref(), &signals);
        for target in &known {
            let others = match (make("", "").typetag_name(), other) {
                (_, None) => vec![""],
                ("cubic-stiffness", _) => (rates.iter())
                    .filter(|(rate, _)| rate == target)
                    .map(|(_, of)| of.as_str())
                    .collect(),
                // What a single vessel spills is lost.
                (_, Some("to")) if known.len() == 1 => vec![target.as_str()],
                _ => (known.iter().filter(|name| *name != target))
                    .map(String::as_str)
                    .collect(),
            };
            effects.extend(others.into_iter().map(|other| make(target, other)));
        }
    }
    effects
}

/// The outline without what effects and unknown levels have added. Names of added states hold a slash.
fn own(mut outline: Outline) -> Outline {
    outline.states.retain(|state| !state.name.contains('/'));
    outline.parameters = ParameterSpace::new(
        (outline.parameters.iter())
            .filter(|p| p.role == Role::Physical)
            .cloned(),
    );
    outline
}

/// Pairs (rate, of): the drift of the second state is the first state, at every one of a few random points.
fn rates(twin: &dyn StateSpace) -> Vec<(String, String)> {
    const POINTS: u64 = 5;
    let (outline, limits) = (twin.outline(), twin.limits());
    let states = &outline.states;
    let mut pairs: Vec<(usize, usize)> = (0..states.len())
        .flat_map(|i| (0..states.len()).map(move |j| (i, j)))
        .filter(|(i, j)| i != j)
        .collect();
    for point in 0..POINTS {
        let mut source = Noise::new(0, "rates", point).source("point");
        let x: Vec<f64> = (limits.iter())
            .map(|limit| {
                if limit.is_finite() {
                    limit.low() + source.uniform() * limit.width()
                } else {
                    limit.clamp(source.normal())
                }
            })
            .collect();
        let u: Vec<f64> = outline.inputs.iter().map(|_| source.uniform()).collect();
        let theta = outline.parameters.draw_prior(Noise::new(0, "rates", point));
        let now = Now {
            t: 0.0,
            dt: 1.0,
            u: &u,
            theta: &theta,
        };
        let mut dx = vec![0.0; x.len()];
        twin.drift(&now, &x, &mut dx);
        pairs.retain(|&(i, j)| dx[j] == x[i]);
    }
    let name = |i: usize| states[i].name.clone();
    pairs.into_iter().map(|(i, j)| (name(i), name(j))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table that people read says what the code does.
    #[test]
    fn the_table_of_the_docs_is_the_library() {
        let rows: Vec<_> = (include_str!("mod.rs").lines())
            .filter(|line| line.starts_with("//! | `"))
            .collect();
        let written: Vec<String> = (library().into_iter())
            .map(|member| {
                let magnitudes: Vec<_> = (member.magnitudes.iter())
                    .map(|m| {
                        let shape = if m.off.is_none() { "shape " } else { "" };
                        let off = match m.off {
                            Some(f64::INFINITY) => ", off ∞",
                            Some(f64::NEG_INFINITY) => ", off −∞",
                            _ => "",
                        };
                        format!("{shape}`{}` ({}{off})", m.name, m.unit)
                    })
                    .collect();
                let other = (member.other).map_or(String::new(), |other| format!(", `{other}`"));
                format!(
                    "//! | `{}` | {}{other} | {} | {} |",
                    member.id,
                    member.law.target(),
                    magnitudes.join(", "),
                    member.formula
                )
            })
            .collect();
        assert_eq!(rows, written);
    }
}
