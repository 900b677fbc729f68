//! A listed effect that worlds can have.

use crate::evaluate::trials::law::DeparturePlace;
use crate::evaluate::trials::listed::ListedLaw;
use crate::evaluate::trials::places::TwinPlaces;
use crate::study::Study;

/// An effect of the study's library, as a law of the world.
pub(super) struct Listed {
    pub key: String,
    pub id: String,
    pub place: DeparturePlace,
    /// The other state of a law between two.
    pub other: Option<usize>,
}

impl Listed {
    /// Returns the effects that the study may name and that worlds can have.
    pub fn all(study: &Study, places: &TwinPlaces) -> Vec<Self> {
        let state = |name: &str| places.states.iter().position(|s| s == name);
        (study.candidates().iter())
            .filter(|effect| ListedLaw::named(effect.id()).is_some())
            .filter_map(|effect| {
                Some(Self {
                    key: effect.key().to_string(),
                    id: effect.id().into(),
                    place: places.find(effect.id(), effect.target())?,
                    other: effect.other().and_then(state),
                })
            })
            .collect()
    }
}
