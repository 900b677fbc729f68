//! Instances of the thread that asks: an FMU may be called from one thread only, and passes of a filter side by side have parameters of their own.

use super::ExchangeModel;
use super::bench::ExchangeBench;
use crate::twin::SimulationError;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Weak};

/// Instances of a model on a thread, each at other parameters: twice as many as passes go side by side. With half as many they are initialised
/// at every step; twice as many hold more memory and are no faster.
const MOST: usize = 16;

/// Instances of one model.
struct Desk {
    of: Weak<ExchangeModel>,
    benches: Vec<ExchangeBench>,
    clock: u64,
}

thread_local! {
    static DESKS: RefCell<Vec<Desk>> = const { RefCell::new(Vec::new()) };
}

/// Calls `then` with an instance at these parameters.
///
/// # Errors
///
/// No instance, or an error of the FMU; after a fatal one, the FMU is not called any more.
pub(super) fn with<R>(
    model: &Arc<ExchangeModel>,
    theta: &[f64],
    then: impl FnOnce(&mut ExchangeBench) -> Result<R, SimulationError>,
) -> Result<R, SimulationError> {
    let corrupt = || SimulationError::fatal("the FMU is corrupt: it reported a fatal error");
    if model.is_corrupt.load(Ordering::Relaxed) {
        return Err(corrupt());
    }
    let asked = DESKS.try_with(|desks| {
        let mut desks = desks.borrow_mut();
        let desk = desk_of(&mut desks, model);
        let bench = desk.bench(model, theta)?;
        // A status that the standard does not know is a panic of the library that reads it.
        let outcome = catch_unwind(AssertUnwindSafe(|| then(bench)))
            .unwrap_or_else(|_| Err(SimulationError::fatal("the FMU left the FMI standard")));
        match &outcome {
            Ok(_) => {}
            Err(SimulationError::Fatal(_)) => {
                model.is_corrupt.store(true, Ordering::Relaxed);
                // The standard forbids any further call, that to free instances included.
                std::mem::forget(std::mem::take(&mut desk.benches));
            }
            Err(_) => bench.distrust(),
        }
        outcome
    });
    asked.unwrap_or_else(|_| Err(corrupt()))
}

/// The desk of a model; those of models that are no more go.
fn desk_of<'d>(desks: &'d mut Vec<Desk>, model: &Arc<ExchangeModel>) -> &'d mut Desk {
    let is_it = |desk: &Desk| std::ptr::eq(desk.of.as_ptr(), Arc::as_ptr(model));
    let index = desks.iter().position(is_it).unwrap_or_else(|| {
        desks.retain(|desk| desk.of.strong_count() > 0);
        desks.push(Desk {
            of: Arc::downgrade(model),
            benches: Vec::new(),
            clock: 0,
        });
        desks.len() - 1
    });
    &mut desks[index]
}

impl Desk {
    fn bench(
        &mut self,
        model: &ExchangeModel,
        theta: &[f64],
    ) -> Result<&mut ExchangeBench, SimulationError> {
        self.clock += 1;
        let has_it = |bench: &ExchangeBench| bench.theta == theta;
        let index = match self.benches.iter().position(has_it) {
            Some(index) => index,
            None => self.changed(model, theta)?,
        };
        let bench = &mut self.benches[index];
        bench.used = self.clock;
        Ok(bench)
    }

    /// A new instance, or the one that was used longest ago, at other parameters.
    fn changed(&mut self, model: &ExchangeModel, theta: &[f64]) -> Result<usize, SimulationError> {
        let mut problem = None;
        if self.benches.len() < MOST {
            match ExchangeBench::new(model, theta) {
                Ok(bench) => {
                    self.benches.push(bench);
                    return Ok(self.benches.len() - 1);
                }
                Err(error) => problem = Some(error),
            }
        }
        let all = self.benches.iter().enumerate();
        match all.min_by_key(|(_, bench)| bench.used) {
            Some((index, _)) => {
                self.benches[index].change_theta(theta);
                Ok(index)
            }
            None => {
                let problem = problem.map(|error| error.to_string()).unwrap_or_default();
                Err(SimulationError::Failed(
                    format!("no instance of the FMU: {problem}").into(),
                ))
            }
        }
    }
}
