//! Directions in parameter space, oriented and in words.

/// The direction with the sign under which its first leading part is positive: a direction has no sign of its own, and
/// results must repeat. Parts within 1 % of the largest lead.
pub fn oriented(direction: &[f64]) -> Vec<f64> {
    let largest = direction.iter().fold(0.0f64, |a, v| a.max(v.abs()));
    let leading = direction.iter().find(|v| v.abs() >= 0.99 * largest);
    let sign = leading.map_or(1.0, |v| v.signum());
    direction.iter().map(|v| sign * v).collect()
}

/// A direction in words: `0.71·k1 − 0.71·k2`, parts under a twentieth of the largest left out.
pub fn combination(names: &[&str], direction: &[f64]) -> String {
    if let [name] = names {
        return (*name).to_owned();
    }
    let direction = oriented(direction);
    let largest = direction.iter().fold(0.0f64, |a, v| a.max(v.abs()));
    let mut text = String::new();
    for (name, value) in names.iter().zip(&direction) {
        if value.abs() > 0.05 * largest {
            text.push_str(match (text.is_empty(), *value < 0.0) {
                (true, true) => "−",
                (true, false) => "",
                (false, true) => " − ",
                (false, false) => " + ",
            });
            text.push_str(&format!("{:.2}·{name}", value.abs()));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_small_parts() {
        let names = ["a", "b", "c"];
        assert_eq!(
            combination(&names, &[-0.7, 0.7000001, 0.01]),
            "0.70·a − 0.70·b"
        );
        assert_eq!(combination(&names, &[-0.3, 0.9, 0.0]), "−0.30·a + 0.90·b");
        assert_eq!(combination(&["nu"], &[1.0]), "nu");
    }
}
