//! Maps of the residuals: where in time, at which values, in which output, at which lags and frequencies they exceed white noise.

use crate::diagnose::outcome::{Band, Cell, Channel, Lag, Maps, Region, Window};
use crate::diagnose::residuals::cut::{Bins, Cut, Past};
use crate::diagnose::residuals::excess::excess;
use crate::diagnose::residuals::shares::shares;
use crate::hypothesis::search::model::Model;
use crate::math::descending;
use crate::study::StudyError;

/// Describes the innovations of a model. `best` divides the shares by where it helps.
pub(in crate::diagnose) fn maps(model: &Model, best: Option<&Model>) -> Result<Maps, StudyError> {
    let states = model.problem.states(&model.fitted.theta)?;
    let after = best
        .map(|best| best.problem.filtered(&best.fitted.theta))
        .transpose()?;
    let records = &model.problem.records;
    let bins = Bins::new(&model.problem.outline(), &states, records);
    let shares = shares(&bins, &states, records, after.as_deref());
    let scores: Vec<f64> = (excess(&states, records, &bins).iter())
        .map(|e| (e.square - e.expected) / (2.0 * e.expected).max(1.0).sqrt())
        .collect();
    let signals = model.problem.twin.signals();
    let output = |channel: usize| signals.outputs[channel].name.clone();
    let dt = records[0].drive().dt();
    let mut maps = Maps::default();
    for ((cut, score), share) in bins.cuts.iter().zip(scores).zip(shares) {
        match *cut {
            Cut::Window {
                record,
                channel,
                from,
                to,
            } => maps.windows.push(Window {
                record,
                start: records[record].drive().time(from),
                end: records[record].drive().time(to - 1),
                channel: output(channel),
                score,
                share,
            }),
            Cut::Region {
                variable,
                low,
                high,
            } => maps.regions.push(Region {
                variable: bins.variables[variable].clone(),
                low,
                high,
                score,
                share,
            }),
            Cut::Channel { channel } => maps.channels.push(Channel {
                channel: output(channel),
                score,
                share,
            }),
            Cut::Lag {
                channel,
                past,
                from,
                to,
            } => maps.lags.push(Lag {
                channel: output(channel),
                signal: match past {
                    Past::Output(j) => output(j),
                    Past::Input(i) => signals.inputs[i].name.clone(),
                },
                from: from as f64 * dt,
                to: to as f64 * dt,
                score,
                share,
            }),
            Cut::Band { channel, low, high } => maps.bands.push(Band {
                channel: output(channel),
                low: low / dt,
                high: high / dt,
                score,
                share,
            }),
        }
    }
    clearest_first(&mut maps.windows);
    clearest_first(&mut maps.regions);
    clearest_first(&mut maps.channels);
    clearest_first(&mut maps.lags);
    clearest_first(&mut maps.bands);
    Ok(maps)
}

fn clearest_first<C: Cell>(cells: &mut [C]) {
    // Of equal shares the larger score first.
    descending(cells, C::score);
    descending(cells, C::share);
}
