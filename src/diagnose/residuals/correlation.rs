//! Correlations of series at a lag.

/// Less the mean.
pub(in crate::diagnose) fn centred(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|v| v - mean).collect()
}

/// Correlation of a(k) with b(k − lag), both centred.
pub(in crate::diagnose) fn correlation(a: &[f64], b: &[f64], lag: usize) -> f64 {
    if lag >= a.len() {
        return 0.0;
    }
    let dot: f64 = a[lag..].iter().zip(b).map(|(a, b)| a * b).sum();
    let norm = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>();
    let scale = (norm(a) * norm(b)).sqrt();
    if scale > 0.0 { dot / scale } else { 0.0 }
}
