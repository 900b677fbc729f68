//! Variables of a model description, and what is declared about them.

use crate::record::Quantity;
use crate::twin::Parameter;
use roxmltree::Node;
use std::collections::BTreeMap;

/// Values beyond this mean "no limit": tools write 1e60 or the largest number.
const ENDLESS: f64 = 1e60;

/// Version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

/// A real scalar.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FmuVariable {
    pub name: String,
    pub unit: String,
    pub description: String,
    pub reference: u32,
    pub start: f64,
    pub min: Option<f64>,
    pub max: Option<f64>,
}

/// Declared types by name.
pub(super) type Types<'a> = BTreeMap<&'a str, Reals>;

/// Attributes of a real variable or of its declared type.
#[derive(Default, Clone)]
pub(super) struct Reals {
    unit: Option<String>,
    min: Option<f64>,
    max: Option<f64>,
}

impl Reals {
    fn of(node: Node<'_, '_>) -> Result<Self, String> {
        let limit = |name| Ok::<_, String>(number(node, name)?.filter(|v| v.abs() < ENDLESS));
        Ok(Self {
            unit: node.attribute("unit").map(str::to_owned),
            min: limit("min")?,
            max: limit("max")?,
        })
    }
}

pub(super) fn number(node: Node<'_, '_>, name: &str) -> Result<Option<f64>, String> {
    let Some(text) = node.attribute(name) else {
        return Ok(None);
    };
    let of = || node.attribute("name").unwrap_or(node.tag_name().name());
    match text.trim().parse::<f64>() {
        Ok(value) if !value.is_nan() => Ok(Some(value)),
        _ => Err(format!("{name} = \"{text}\" of {} is no number", of())),
    }
}

pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.has_tag_name(name))
}

pub(super) fn attribute<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str, String> {
    let tag = node.tag_name().name().to_owned();
    (node.attribute(name)).ok_or_else(|| format!("<{tag}> has no attribute {name}"))
}

/// All variables, in order.
pub(super) fn variables<'a, 'i>(root: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    let all = child(root, "ModelVariables").into_iter();
    all.flat_map(|n| n.children()).filter(Node::is_element)
}

/// Attributes of a real scalar; `None` for other variables.
pub(super) fn real<'a, 'i>(node: Node<'a, 'i>, version: Version) -> Option<Node<'a, 'i>> {
    match version {
        Version::Two => child(node, "Real"),
        // Arrays have dimensions; they are left at their start.
        Version::Three => {
            Some(node).filter(|n| n.has_tag_name("Float64") && child(*n, "Dimension").is_none())
        }
    }
}

pub(super) fn declared<'a>(root: Node<'a, '_>, version: Version) -> Result<Types<'a>, String> {
    let mut types = BTreeMap::new();
    for node in child(root, "TypeDefinitions")
        .iter()
        .flat_map(|n| n.children())
    {
        let reals = match version {
            Version::Two => child(node, "Real"),
            Version::Three => Some(node).filter(|n| n.has_tag_name("Float64Type")),
        };
        if let (Some(reals), Some(name)) = (reals, node.attribute("name")) {
            types.insert(name, Reals::of(reals)?);
        }
    }
    Ok(types)
}

impl FmuVariable {
    /// Reads a variable; `None` of one that is no real scalar.
    pub fn read(
        node: Node<'_, '_>,
        version: Version,
        types: &Types<'_>,
    ) -> Result<Option<Self>, String> {
        let Some(reals) = real(node, version) else {
            return Ok(None);
        };
        let own = Reals::of(reals)?;
        let declared = reals.attribute("declaredType");
        let general = declared.and_then(|name| types.get(name)).cloned();
        let general = general.unwrap_or_default();
        let reference = attribute(node, "valueReference")?;
        Ok(Some(Self {
            name: attribute(node, "name")?.into(),
            unit: own.unit.or(general.unit).unwrap_or_default(),
            description: node.attribute("description").unwrap_or_default().into(),
            reference: (reference.parse())
                .map_err(|_| format!("valueReference = \"{reference}\" is no number"))?,
            start: number(reals, "start")?.unwrap_or(0.0),
            min: own.min.or(general.min),
            max: own.max.or(general.max),
        }))
    }

    /// As a quantity.
    pub fn quantity(&self) -> Quantity {
        Quantity::new(&self.name, &self.unit)
    }

    /// Prior and bounds from `min` and `max`; without both, around `start`.
    pub fn parameter(&self) -> Parameter {
        let Self {
            name,
            unit,
            start,
            min,
            max,
            ..
        } = self;
        if let (Some(min), Some(max)) = (min, max) {
            return Parameter::new(name, unit, *min, *max);
        }
        let clip = |value: f64| {
            let raised = min.map_or(value, |min| value.max(min));
            max.map_or(raised, |max| raised.min(max))
        };
        let (near, far) = match *start {
            0.0 => ((-1.0, 1.0), (-10.0, 10.0)),
            s if s > 0.0 => ((0.5 * s, 1.5 * s), (0.1 * s, 10.0 * s)),
            s => ((1.5 * s, 0.5 * s), (10.0 * s, 0.1 * s)),
        };
        let bounds = (min.unwrap_or(far.0), max.unwrap_or(far.1));
        Parameter::new(name, unit, clip(near.0), clip(near.1)).within(bounds.0, bounds.1)
    }
}
