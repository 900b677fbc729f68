//! Listed laws, one row each, written once more: nothing here uses the library of effects.
//!
//! Noise and outliers are no departures but nuisances: fitted noise levels answer them.

use super::law::{
    DepartureLaw, DeparturePlace, ForceDeparture, ParameterDeparture, SignalDeparture, Wave,
};
use super::scene::Scene;
use std::f64::consts::{PI, TAU};

/// A law of the library as worlds have it.
pub(super) struct ListedLaw {
    pub id: &'static str,
    pub sign: Sign,
    /// Largest size, in units of the twin's own terms: beyond, the system is another one.
    pub largest: f64,
    law: fn(&Sizing<'_>) -> Option<DepartureLaw>,
}

impl std::fmt::Debug for ListedLaw {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.id)
    }
}

/// Signs that the library gives a law, and how its change grows with its size while that is small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sign {
    /// Both, in proportion.
    Both,
    /// Both, in proportion; trials draw the positive one: a spring that softens or a power law that pushes runs away.
    Stable,
    /// One, in proportion.
    One,
    /// One, not in proportion.
    Threshold,
}

impl Sign {
    /// Returns true if the library offers both signs.
    pub fn is_both(self) -> bool {
        matches!(self, Self::Both | Self::Stable)
    }
}

/// Form in which a law is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LawForm {
    /// As in the library's table.
    Listed,
    /// The same physics in other terms, with other edges, by another discretisation.
    Other,
}

/// Everything about a law but its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Variant {
    pub form: LawForm,
    /// 1 or −1.
    pub sign: f64,
    /// Exponent of a power law.
    pub exponent: f64,
    /// Shares of the ranges of times, frequencies, ends of a range.
    pub shapes: [f64; 3],
}

const fn row(
    id: &'static str,
    sign: Sign,
    largest: f64,
    law: fn(&Sizing<'_>) -> Option<DepartureLaw>,
) -> ListedLaw {
    ListedLaw {
        id,
        sign,
        largest,
        law,
    }
}

// One row a law.
#[rustfmt::skip]
static LAWS: [ListedLaw; 27] = [
    row("sensor-bias", Sign::Both, 3.0, |s| s.bias()),
    row("sensor-gain", Sign::Both, 3.0, |s| s.gain()),
    row("sensor-drift", Sign::Both, 3.0, |s| signal(SignalDeparture::Drift {
        rate: 2.0 * s.signed() * s.scene.extent(s.place)?.deviation / s.scene.duration,
        levelling: s.is_other_form().then_some(2.0 * s.scene.duration),
    })),
    row("sensor-lag", Sign::Threshold, 3.0, |s| s.lag()),
    row("sensor-delay", Sign::Threshold, 3.0, |s| s.delay()),
    row("sensor-rectification", Sign::One, 0.9, |s| {
        let range = s.scene.extent(s.place).filter(|range| range.low < 0.0)?;
        signal(SignalDeparture::Rectification { fraction: s.size, rounding: s.soft(0.02 * range.span()) })
    }),
    row("sensor-saturation", Sign::Threshold, 0.9, |s| s.saturation()),
    row("sensor-quantization", Sign::Threshold, 3.0, |s| {
        signal(SignalDeparture::Quantization { step: s.size * s.scene.extent(s.place)?.span(), half_way: s.is_other_form() })
    }),
    row("actuator-gain", Sign::Both, 3.0, |s| s.gain()),
    row("actuator-bias", Sign::Both, 3.0, |s| s.bias()),
    row("actuator-dead-zone", Sign::Threshold, 3.0, |s| {
        let span = s.scene.extent(s.place)?.span();
        signal(SignalDeparture::DeadZone { width: s.size * span, knee: s.soft(0.03 * s.size * span) })
    }),
    row("actuator-backlash", Sign::Threshold, 3.0, |s| {
        signal(SignalDeparture::Play { width: s.size * s.scene.extent(s.place)?.span(), compliance: s.soft(0.1) })
    }),
    row("actuator-saturation", Sign::Threshold, 0.9, |s| s.saturation()),
    // At size 1 the whole range takes a tenth of the record.
    row("actuator-rate-limit", Sign::Threshold, 3.0, |s| {
        let rate = 10.0 * s.scene.extent(s.place)?.span() / (s.size * s.scene.duration);
        signal(SignalDeparture::RateLimit { rate, knee: s.soft(0.3) })
    }),
    row("actuator-lag", Sign::Threshold, 3.0, |s| s.lag()),
    row("actuator-delay", Sign::Threshold, 3.0, |s| s.delay()),
    row("constant-forcing", Sign::Both, 3.0, |s| {
        force(ForceDeparture::Constant { force: s.rate(), onset: s.soft(0.02 * s.scene.duration) })
    }),
    row("coulomb-friction", Sign::One, 3.0, |s| {
        let of = s.state()?;
        force(ForceDeparture::Friction { force: s.rate(), of, width: s.soft(0.03 * s.rms(of)) })
    }),
    row("linear-loss", Sign::One, 3.0, |s| s.linear(-s.rate(), s.state()?)),
    row("cross-coupling", Sign::Both, 3.0, |s| s.linear(s.rate(), s.other?)),
    row("quadratic-drag", Sign::One, 3.0, |s| s.power(2.0, s.state()?)),
    row("cubic-stiffness", Sign::Stable, 3.0, |s| s.power(3.0, s.other?)),
    row("power-law", Sign::Stable, 3.0, |s| s.power(s.variant.exponent, s.state()?)),
    row("periodic-disturbance", Sign::One, 3.0, |s| s.wave()),
    row("state-ceiling", Sign::Threshold, 0.9, |s| s.ceiling()),
    row("parameter-drift", Sign::Both, 0.9, |s| {
        let rate = s.signed() / s.scene.duration;
        Some(DepartureLaw::Parameter(ParameterDeparture::Drift { rate, exponential: s.is_other_form() }))
    }),
    row("parameter-step", Sign::Both, 0.9, |s| {
        let duration = s.scene.duration;
        let time = duration * (0.2 + 0.6 * s.variant.shapes[0]);
        Some(DepartureLaw::Parameter(ParameterDeparture::Step { size: s.signed(), time, ramp: s.soft(0.02 * duration) }))
    }),
];

impl ListedLaw {
    /// The law with this id.
    pub fn named(id: &str) -> Option<&'static Self> {
        LAWS.iter().find(|law| law.id == id)
    }

    /// The law at a size; `None` where the place has no such law.
    pub fn at(&self, sized: &Sizing<'_>) -> Option<DepartureLaw> {
        (self.law)(sized)
    }
}

/// A size and a variant at a place of a scene. Size 1 is as large as the twin's own terms.
pub(super) struct Sizing<'s> {
    pub scene: &'s Scene,
    pub place: DeparturePlace,
    /// The other state of a law between two.
    pub other: Option<usize>,
    pub variant: Variant,
    pub size: f64,
}

impl Sizing<'_> {
    fn state(&self) -> Option<usize> {
        match self.place {
            DeparturePlace::State(i) => Some(i),
            _ => None,
        }
    }

    fn is_other_form(&self) -> bool {
        self.variant.form == LawForm::Other
    }

    /// `width` in the other form, 0 in the library's.
    fn soft(&self, width: f64) -> f64 {
        match self.variant.form {
            LawForm::Listed => 0.0,
            LawForm::Other => width,
        }
    }

    fn signed(&self) -> f64 {
        self.variant.sign * self.size
    }

    /// Signed size in the rate of a state.
    fn rate(&self) -> f64 {
        self.signed() * self.scene.unit(self.place)
    }

    /// Lags and delays of size 1 take a twentieth of the record.
    fn time(&self) -> f64 {
        0.05 * self.size * self.scene.duration
    }

    fn rms(&self, of: usize) -> f64 {
        self.scene.states[of].rms.max(1e-9)
    }

    fn linear(&self, rate: f64, of: usize) -> Option<DepartureLaw> {
        force(ForceDeparture::Linear {
            rate: rate / self.rms(of),
            of,
            span: self.is_other_form().then_some(6.0 * self.rms(of)),
        })
    }

    fn power(&self, exponent: f64, of: usize) -> Option<DepartureLaw> {
        force(ForceDeparture::Power {
            coefficient: self.rate() / self.rms(of).powf(exponent),
            exponent,
            of,
            rounding: self.soft(0.03 * self.rms(of)),
        })
    }

    fn bias(&self) -> Option<DepartureLaw> {
        signal(SignalDeparture::Bias {
            offset: self.signed() * self.scene.extent(self.place)?.deviation,
            settling: self.soft(0.02 * self.scene.duration),
        })
    }

    fn gain(&self) -> Option<DepartureLaw> {
        let factor = 1.0 + (0.5 * self.signed()).max(-0.95);
        signal(SignalDeparture::Gain { factor })
    }

    fn lag(&self) -> Option<DepartureLaw> {
        let tau = self.time();
        let cutoff = 1.0 / (2.0 * PI * tau);
        signal(match self.variant.form {
            LawForm::Listed => SignalDeparture::Lag { tau },
            LawForm::Other => SignalDeparture::LowPass { cutoff },
        })
    }

    fn delay(&self) -> Option<DepartureLaw> {
        // The library keeps 63 samples.
        let delay = self.time().min(60.0 * self.scene.dt);
        let cubic = self.is_other_form();
        signal(SignalDeparture::Delay { delay, cubic })
    }

    fn saturation(&self) -> Option<DepartureLaw> {
        let range = self.scene.extent(self.place)?;
        let (below, cut) = (self.variant.shapes[0] < 0.3, self.size * range.span());
        signal(SignalDeparture::Saturation {
            low: below.then_some(range.low + cut),
            high: (!below).then_some(range.high - cut),
            knee: self.soft(0.01 * range.span()),
        })
    }

    fn wave(&self) -> Option<DepartureLaw> {
        let [frequency, phase, wave] = self.variant.shapes;
        force(ForceDeparture::Periodic {
            amplitude: self.size * self.scene.unit(self.place),
            frequency: (3.0 + 9.0 * frequency) / self.scene.duration,
            phase: TAU * phase,
            wave: match (self.variant.form, wave < 0.5) {
                (LawForm::Listed, _) => Wave::Sine,
                (LawForm::Other, true) => Wave::Triangle,
                (LawForm::Other, false) => Wave::Swelling,
            },
        })
    }

    fn ceiling(&self) -> Option<DepartureLaw> {
        let own = self.state()?;
        let range = self.scene.states[own];
        Some(DepartureLaw::Ceiling {
            level: range.high - self.size * range.span(),
            spill: self.variant.shapes[0],
            to: self.other.filter(|other| *other != own),
            softness: self.soft(0.01 * range.span()),
        })
    }
}

fn signal(law: SignalDeparture) -> Option<DepartureLaw> {
    Some(DepartureLaw::Signal(law))
}

fn force(law: ForceDeparture) -> Option<DepartureLaw> {
    Some(DepartureLaw::Force(law))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Catalogue;

    /// Every row is an effect of the library, and its sign one that the library allows.
    #[test]
    fn signs_are_those_that_the_library_allows() {
        let catalogue = Catalogue::default();
        for law in &LAWS {
            let mut kinds = catalogue.kinds().iter();
            let kind = kinds.find(|kind| kind.id() == law.id).expect(law.id);
            let is_both = kind.magnitudes()[0].limits.low() < 0.0;
            if law.sign != Sign::Threshold {
                assert_eq!(is_both, law.sign.is_both(), "{}", law.id);
            }
        }
    }
}
