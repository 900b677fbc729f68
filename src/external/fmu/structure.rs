//! Continuous states and event indicators of a model's equations, as its structure lists them.

use super::variable::{FmuVariable, Types, Version, attribute, child, real, variables};
use roxmltree::Node;

/// Most event indicators: each is asked at every step.
const MOST_INDICATORS: usize = 10_000;

/// The states, in the order of the state vector: that of the listed derivatives, each of which names its state.
pub(super) fn states(
    root: Node<'_, '_>,
    version: Version,
    types: &Types<'_>,
) -> Result<Vec<FmuVariable>, String> {
    let all: Vec<_> = variables(root).collect();
    // By its place among all variables, counted from 1, or by its reference.
    let named = |text: &str| match version {
        Version::Two => {
            let index = text.parse::<usize>().ok()?;
            all.get(index.checked_sub(1)?).copied()
        }
        Version::Three => {
            let is_it = |node: &&Node<'_, '_>| node.attribute("valueReference") == Some(text);
            all.iter().find(is_it).copied()
        }
    };
    let structure = child(root, "ModelStructure");
    let (list, tag, key) = match version {
        Version::Two => (
            structure.and_then(|n| child(n, "Derivatives")),
            "Unknown",
            "index",
        ),
        Version::Three => (structure, "ContinuousStateDerivative", "valueReference"),
    };
    let mut states = Vec::new();
    for node in list.iter().flat_map(|n| n.children()) {
        if !node.has_tag_name(tag) {
            continue;
        }
        let of = attribute(node, key)?;
        let derivative = named(of).and_then(|node| real(node, version));
        let state = derivative
            .and_then(|node| node.attribute("derivative"))
            .and_then(named);
        let state = state.map(|node| FmuVariable::read(node, version, types));
        let is_listed = |of: &FmuVariable| states.iter().any(|s: &FmuVariable| s.name == of.name);
        match state.transpose()?.flatten() {
            Some(state) if is_listed(&state) => {
                return Err(format!("<{tag} {key}=\"{of}\"> is listed twice"));
            }
            Some(state) => states.push(state),
            None => {
                return Err(format!(
                    "<{tag} {key}=\"{of}\"> is no derivative of a real scalar"
                ));
            }
        }
    }
    Ok(states)
}

/// The number of event indicators.
pub(super) fn indicators(root: Node<'_, '_>, version: Version) -> Result<usize, String> {
    let count = match version {
        Version::Two => match root.attribute("numberOfEventIndicators") {
            Some(text) => (text.trim().parse())
                .map_err(|_| format!("numberOfEventIndicators = \"{text}\" is no number"))?,
            None => 0,
        },
        Version::Three => child(root, "ModelStructure").map_or(0, |n| {
            (n.children().filter(|n| n.has_tag_name("EventIndicator"))).count()
        }),
    };
    match count {
        0..=MOST_INDICATORS => Ok(count),
        _ => Err(format!(
            "{count} event indicators, at most {MOST_INDICATORS} are asked"
        )),
    }
}
