//! Fitted effects and the twin without them: evidence that they gain, and intervals that hold where an effect is off.

use super::climb::{Fitted, climb};
use super::evidence::{Evidence, evidence};
use super::outcome::FittedValue;
use super::posterior::{DrawsAsked, posterior};
use super::problem::Problem;
use super::profile::depth;
use super::searched::WithoutEffects;
use crate::fit::budget::ITERATIONS;
use crate::likelihood::kalman::FilterError;
use crate::twin::Noise;

impl WithoutEffects {
    /// Evidence that the effects gain, in nats, where that of the twin with them is `with`. `None` where more than the effects differs, such as the
    /// kind of noise.
    pub(super) fn gain(
        &self,
        problem: &Problem,
        with: &Evidence,
        noise: Noise,
    ) -> Result<Option<f64>, FilterError> {
        if self.problem.dimension() != problem.dimension() {
            return Ok(None);
        }
        let fits = std::slice::from_ref(&self.fitted);
        let drawn = |asked| posterior(&self.problem, fits, asked, noise.child("posterior"));
        let draws = (with.error).map_or(Ok(Default::default()), |_| drawn(DrawsAsked::Usual))?;
        let without = evidence(&self.problem, &self.fitted, &draws, noise.child("evidence"))?;
        Ok(without.map(|without| with.over(&without)))
    }

    /// The value of a magnitude at which its effect is off, within what records show.
    pub(super) fn off(&self, problem: &Problem, name: &str) -> Option<f64> {
        let off = self.magnitudes.get(name)?.off?;
        let j = problem.twin.parameters().position(name).ok()?;
        Some(problem.axes[j].bounds.clamp(off))
    }

    /// Lets intervals of magnitudes reach to where these are off, unless the likelihood falls so far there that an interval of this level ends
    /// before: between both it may fall and rise again, and near a bound an interval of draws leaves the bound out.
    pub(super) fn reach_off(
        &self,
        problem: &Problem,
        (fitted, level, gained): (&Fitted, f64, Option<f64>),
        values: &mut [FittedValue],
    ) -> Result<(), FilterError> {
        let space = problem.twin.parameters();
        for value in values {
            let entry = space.position(&value.name).ok();
            let Some((j, at)) = entry.zip(self.off(problem, &value.name)) else {
                continue;
            };
            let off = self.magnitudes[&value.name].off.unwrap_or(at);
            if value.low <= at && value.high >= at {
                // The end of what was looked for is no end where nothing is felt there.
                if gained.is_some_and(|gained| gained < 0.0) {
                    (value.low, value.high) = (value.low.min(off), value.high.max(off));
                }
                continue;
            }
            let mut theta = fitted.theta.clone();
            theta[j] = at;
            let there = climb(&problem.holding(|i| i == j), &theta, ITERATIONS)?;
            let lost = |there: Fitted| fitted.log_likelihood - there.log_likelihood;
            if there.is_some_and(|there| lost(there) <= depth(level)) {
                (value.low, value.high) = (value.low.min(off), value.high.max(off));
            }
        }
        Ok(())
    }
}
