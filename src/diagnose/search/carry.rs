//! Explanations carried on to a twin with another step, or to all rows.

use super::Search;
use super::evidence::Evidence;
use super::explanations::Explanations;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::set::TermSet;
use crate::parallel::try_each;
use crate::study::StudyError;

/// Explanations of a kind, best first.
struct List<'k> {
    all: Vec<&'k Explanation>,
    /// Number of the best that are carried on, if they have more nats than `least`.
    most: usize,
    least: f64,
    /// The set that they stand beside.
    beside: Option<TermSet>,
}

impl<E: Evidence> Search<E> {
    /// Explanations for other evidence: the best ones fitted on; of the others, log Z stays with another step, and nats grow with the rows.
    pub(super) fn carried(&self, new: &E) -> Result<Explanations, StudyError> {
        let old = &self.known;
        let ratio = new.rows().0 as f64 / self.evidence.rows().0 as f64;
        let lists = self.lists(ratio > 1.0);
        let fitted = try_each(&lists, |list| {
            try_each(list.all.iter().take(list.most), |e| {
                match old.gain(e) > list.least {
                    true => new.carried(e),
                    false => Ok(None),
                }
            })
        })?;
        let mut known = Explanations::new(new.twin());
        let twin = known.twin().log_z;
        for (list, fitted) in lists.iter().zip(fitted) {
            if list
                .beside
                .as_ref()
                .is_some_and(|set| known.model(set).is_none())
            {
                continue;
            }
            let gains = fitted.iter().flatten().map(|e| e.log_z - twin);
            let best = gains.fold(0.0, f64::max);
            let promise = |e: &Explanation| match old.gain(e) {
                _ if ratio <= 1.0 => e.log_z,
                gain if gain > 0.0 => twin + (ratio * gain).min(best),
                gain => twin + gain,
            };
            let mut fitted = fitted.into_iter();
            let carried = list.all.iter().map(|e| {
                fitted.next().flatten().unwrap_or_else(|| Explanation {
                    terms: e.terms.clone(),
                    log_z: promise(e),
                    model: None,
                })
            });
            match &list.beside {
                Some(set) => known.extend(set.clone(), carried.collect()),
                None => carried.for_each(|e| known.add(e)),
            }
        }
        Ok(known)
    }

    /// Lists to be carried on. To more rows, that costs as much more, and what remains beside the best sets comes along; with another step,
    /// functions are asked again.
    fn lists(&self, to_more_rows: bool) -> Vec<List<'_>> {
        let (known, budget) = (&self.known, &self.budget);
        let least = budget.stands_out * known.top();
        let (effects, functions, noise) = match to_more_rows {
            true => (budget.singles, budget.functions_of_all_rows, 1),
            false => (usize::MAX, 0, 0),
        };
        let list = |all, most, least| List {
            all,
            most,
            least,
            beside: None,
        };
        let mut lists = vec![
            list(known.listed(), effects, least),
            list(known.pairs(), effects, least),
            list(known.unknown(), functions, 0.0),
            list(known.noise(), noise, 0.0),
            list(known.noise_pairs(), noise, 0.0),
        ];
        if to_more_rows {
            let sets = (known.listed().into_iter()).chain(known.pairs());
            for set in sets.filter(|e| known.gain(e) > least) {
                let beside = Some(set.set());
                lists.extend(known.beside(&set.set()).map(|all| List {
                    beside,
                    ..list(all, functions, 0.0)
                }));
            }
        }
        lists
    }
}
