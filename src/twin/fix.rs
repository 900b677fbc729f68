//! A twin with some parameters held at known values.

use crate::twin::{ParameterSpace, Twin, TwinError};
use std::collections::BTreeMap;

/// Holds the named parameters of a twin; θ is shorter by them.
///
/// Refuses unknown names. All parameters may be held. Values are not checked: a magnitude may be held at infinity.
pub(crate) fn fix(
    base: impl Into<Twin>,
    values: &BTreeMap<String, f64>,
) -> Result<Twin, TwinError> {
    let base = base.into();
    if values.is_empty() {
        return Ok(base);
    }
    let all = base.parameters();
    for name in values.keys() {
        all.position(name)?;
    }
    let free = all.iter().filter(|p| !values.contains_key(&p.name));
    let free = ParameterSpace::new(free.cloned());
    if !free.is_empty() {
        free.check()?;
    }
    Ok(base.holding(values, free))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;
    use crate::twin::Noise;
    use crate::twin::fixture::AtOnce;

    #[test]
    fn held_parameters_leave_theta() {
        let sum = || AtOnce::<2>(|theta, _| theta[0] + 10.0 * theta[1]);
        let values = |pairs: &[(&str, f64)]| pairs.iter().map(|&(n, v)| (n.into(), v)).collect();
        let twin = fix(Twin::new(sum()), &values(&[("a", 3.0)])).unwrap();
        assert_eq!(twin.parameters().names(), ["b"]);
        let drive = Drive::autonomous(1.0, 1).unwrap();
        assert_eq!(
            twin.simulate(&[2.0], &drive, Noise::OFF).unwrap()[[0, 0]],
            23.0
        );
        let whole = fix(Twin::new(sum()), &values(&[("a", 1.0), ("b", 2.0)])).unwrap();
        assert!(whole.parameters().is_empty());
        let run = whole.simulate(&[], &drive, Noise::OFF).unwrap();
        assert_eq!(run[[0, 0]], 21.0);
        assert!(fix(Twin::new(sum()), &values(&[("c", 1.0)])).is_err());
    }
}
