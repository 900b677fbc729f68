//! Orders by a number: one stable sort for all types, since each sort by an own closure is compiled anew.

/// Sorts from the smallest key to the largest; equal ones stay as they stand.
pub(crate) fn ascending<T>(all: &mut [T], key: impl Fn(&T) -> f64) {
    let keys: Vec<f64> = all.iter().map(key).collect();
    arrange(all, by(&keys));
}

/// Sorts from the largest key to the smallest; equal ones stay as they stand.
pub(crate) fn descending<T>(all: &mut [T], key: impl Fn(&T) -> f64) {
    let keys: Vec<f64> = all.iter().map(|one| -key(one)).collect();
    arrange(all, by(&keys));
}

fn by(keys: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..keys.len()).collect();
    order.sort_by(|&a, &b| keys[a].total_cmp(&keys[b]));
    order
}

/// Puts in each place what stands where `order` says.
fn arrange<T>(all: &mut [T], order: Vec<usize>) {
    for place in 0..order.len() {
        let mut from = order[place];
        // What stood there has been moved to where that place's own came from.
        while from < place {
            from = order[from];
        }
        all.swap(place, from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_are_those_of_a_stable_sort() {
        for n in 0..40 {
            let all: Vec<(f64, usize)> = (0..n)
                .map(|i| (((i * 7919) % 13) as f64 - 6.0, i))
                .collect();
            let (mut up, mut down) = (all.clone(), all.clone());
            ascending(&mut up, |a| a.0);
            descending(&mut down, |a| a.0);
            let mut expected = all.clone();
            expected.sort_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(up, expected);
            expected = all;
            expected.sort_by(|a, b| b.0.total_cmp(&a.0));
            assert_eq!(down, expected);
        }
    }

    #[test]
    fn values_that_are_no_numbers_stand_at_an_end() {
        let mut values = [1.0, f64::NAN, f64::NEG_INFINITY, 2.0];
        descending(&mut values, |v| *v);
        assert!(values[0].is_nan());
        assert_eq!(values[1..], [2.0, 1.0, f64::NEG_INFINITY]);
    }
}
