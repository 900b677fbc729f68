//! Inputs that act on equations: behind the actuators, and between samples.

use super::integrator::Between;
use crate::record::Drive;
use crate::twin::{Hold, Now, SimulationError, StateSpace};
use std::borrow::Cow;

/// A drive as the equations of a twin see it.
pub(crate) struct Acting<'d> {
    drive: Cow<'d, Drive>,
    hold: Hold,
}

impl<'d> Acting<'d> {
    /// The drive behind the actuators of `twin`.
    pub fn of(
        twin: &(impl StateSpace + ?Sized),
        theta: &[f64],
        drive: &'d Drive,
    ) -> Result<Self, SimulationError> {
        let drive = match twin.actuated(theta, drive)? {
            Some(actuated) => Cow::Owned(actuated),
            None => Cow::Borrowed(drive),
        };
        let hold = twin.stepping().hold;
        Ok(Self { drive, hold })
    }

    /// Row k at θ. The last input is held.
    #[inline]
    pub fn at<'a>(&'a self, k: usize, theta: &'a [f64]) -> Now<'a> {
        let mut now = Now::new(0.0, 0.0, &[], theta);
        self.go_to(k, &mut now);
        now
    }

    /// Moves on to row k. In place: eight of these a row are not worth a copy.
    #[inline(always)]
    pub fn go_to<'a>(&'a self, k: usize, now: &mut Now<'a>) {
        let drive = self.drive.as_ref();
        (now.t, now.dt, now.u) = (drive.time(k), drive.step(k), drive.input(k));
        if self.hold != Hold::Zero {
            let next = drive.input((k + 1).min(drive.samples() - 1));
            now.between = Some(Between {
                next,
                share: 0.0,
                hold: self.hold,
            });
        }
    }
}
