//! Names of places in a twin, as the library of effects names its targets.

use super::draft::index;
use super::law::DeparturePlace;
use crate::effect::{TargetKind, targets};
use crate::twin::{Role, Source, Twin, is_memory};

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
