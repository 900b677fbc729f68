//! Inputs that act on equations: behind the actuators, and between samples.

use super::parts::Theta;
use crate::record::Drive;
use crate::twin::integrator::Between;
use crate::twin::{Composed, Hold, Now, SimulationError};
use std::borrow::Cow;

/// A drive as the equations of a twin see it at θ.
pub(crate) struct Acting<'d> {
    drive: Cow<'d, Drive>,
    hold: Hold,
    /// All of θ, held entries too.
    theta: Theta,
}

impl<'d> Acting<'d> {
    /// The drive behind the actuators of `twin`.
    pub fn of(twin: &Composed, theta: &[f64], drive: &'d Drive) -> Result<Self, SimulationError> {
        let drive = match twin.actuated(theta, drive)? {
            Some(actuated) => Cow::Owned(actuated),
            None => Cow::Borrowed(drive),
        };
        Ok(Self {
            drive,
            hold: twin.stepping().hold,
            theta: twin.complete(theta),
        })
    }

    /// The drive as it is recorded.
    pub(super) fn plain(theta: &[f64], drive: &'d Drive, hold: Hold) -> Self {
        Self {
            drive: Cow::Borrowed(drive),
            hold,
            theta: Theta::from_slice(theta),
        }
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.drive.samples()
    }

    /// Leaves out entries of θ from this one on.
    pub(super) fn first_entries(&mut self, entries: usize) {
        self.theta.truncate(entries);
    }

    /// Row k. The last input is held.
    #[inline]
    pub fn at(&self, k: usize) -> Now<'_> {
        let mut now = Now::new(0.0, 0.0, &[], &self.theta);
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
