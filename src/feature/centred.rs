//! A map centred on a record, and where the record puts θ.

use super::FeatureMap;
use nalgebra::DMatrix;
use std::sync::Arc;

/// A map centred on a record, and where the record puts θ.
#[derive(Clone)]
pub struct Centred {
    /// Features about the new reference; as many as before.
    pub map: Arc<dyn FeatureMap>,
    /// The reference.
    pub theta: Vec<f64>,
    /// Columns: principal axes of θ's uncertainty, one standard deviation long, in parameter units.
    pub axes: DMatrix<f64>,
}

debug_by_name!(Centred);
