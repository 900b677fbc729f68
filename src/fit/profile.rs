//! Profile likelihood of single parameters: what the records alone say of each, bounds aside.
//!
//! ```text
//! ℓ_j(v) = max { log p(y | θ) : θ_j = v }          the prior of parameters and magnitudes is left out, that of noise levels stays
//! interval of level p:  ℓ_j(v) ≥ max ℓ_j − ½·χ²₁(p)
//! ```
//!
//! From the top outward on either side: each fit begins where the two before lead, and steps grow or shrink so that √(max ℓ − ℓ) rises by a
//! third of the way to the end of the interval. Where ℓ crosses that, the end is found by secants. A side that meets a bound before it has none.
//!
//! Source: A. Raue et al., *Structural and practical identifiability analysis of partially observed dynamical models by exploiting the profile
//! likelihood*, Bioinformatics 25 (2009) 1923–1929.

use super::climb::{Fitted, climb, reach};
use super::problem::Problem;
use crate::fit::budget::BUDGET;
use crate::fit::budget::ITERATIONS;
use crate::likelihood::kalman::FilterError;
use crate::math::ascending;
use crate::parallel::try_each;
use crate::twin::Role;
use nalgebra::DVector;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeSet;

/// The likelihood along one parameter, all else at its best.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Profile {
    /// Name of the parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Values, in rising order.
    pub values: Vec<f64>,
    /// Log-likelihood at each of them below the highest, in nats: 0 or less.
    pub log_likelihoods: Vec<f64>,
    /// Lower end of the interval; none where the bound is still inside.
    pub low: Option<f64>,
    /// Upper end of the interval.
    pub high: Option<f64>,
}

/// Parameters that a fit has profiles of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ProfilesOf {
    None,
    /// Those whose posterior the prior shapes.
    Shaped,
    All,
}

impl ProfilesOf {
    /// Those that are told beside the end of a search: where it is no top nothing is stated, and so nothing profiled unasked.
    pub fn beside(self, arrived: bool) -> Self {
        match self {
            Self::Shaped if !arrived => Self::None,
            which => which,
        }
    }
}

/// Profiles of a fit, and names of those parameters whose intervals hold theirs. The likelihood of a black box costs simulations: nothing is profiled
/// there unless it is asked for.
pub(super) fn profiles(
    problem: &Problem,
    fitted: &Fitted,
    (which, level): (ProfilesOf, f64),
) -> Result<(Vec<Profile>, BTreeSet<String>), FilterError> {
    let shaped = shaped(problem, fitted);
    let entries = match which {
        ProfilesOf::All => entries(problem),
        ProfilesOf::Shaped if !problem.is_simulated() => shaped.clone(),
        _ => vec![],
    };
    let profiled = match entries.is_empty() {
        true => None,
        false => Profiled::new(problem, fitted)?,
    };
    let Some(profiled) = profiled else {
        return Ok((vec![], BTreeSet::new()));
    };
    let space = problem.twin.parameters();
    let names = shaped.iter().map(|&j| space[j].name.clone()).collect();
    Ok((profiled.of(&entries, level)?, names))
}

/// Nats below its top at which a profile leaves an interval of this level.
pub(crate) fn depth(level: f64) -> f64 {
    ChiSquared::new(1.0).map_or(f64::NAN, |c| 0.5 * c.inverse_cdf(level))
}

/// Entries that are profiled: the free ones that are no noise level.
fn entries(problem: &Problem) -> Vec<usize> {
    let space = problem.twin.parameters();
    (0..space.len())
        .filter(|&j| !problem.axes[j].held && space[j].role != Role::Noise)
        .collect()
}

/// Those of them whose posterior the prior shapes, to first order: it pulls the value, or narrows the interval.
fn shaped(problem: &Problem, fitted: &Fitted) -> Vec<usize> {
    let (d, mut entries) = (problem.dimension(), entries(problem));
    let phi = problem.coordinates.of(&fitted.theta);
    let free: Vec<usize> = (0..d).filter(|&j| !problem.axes[j].held).collect();
    let with_prior = (fitted.information)
        .select_rows(&free)
        .select_columns(&free);
    let mut alone = with_prior.clone();
    let mut pull = DVector::zeros(free.len());
    let terms: Vec<(f64, f64)> = problem.prior_terms().collect();
    for (a, &j) in free.iter().enumerate() {
        if entries.contains(&j) {
            let (centre, precision) = terms[j];
            alone[(a, a)] -= (1.0 - BUDGET.no_information) * precision;
            pull[a] = precision * (phi[j] - centre);
        }
    }
    let (Some(posterior), Some(records)) = (with_prior.cholesky(), alone.cholesky()) else {
        return entries;
    };
    let (shift, posterior, records) =
        (records.solve(&pull), posterior.inverse(), records.inverse());
    entries.retain(|j| {
        let Some(a) = free.iter().position(|i| i == j) else {
            return false;
        };
        let (own, wide) = (posterior[(a, a)], records[(a, a)]);
        shift[a].abs() > BUDGET.pull * own.sqrt() || own < BUDGET.narrowed * wide
    });
    entries
}

/// The problem without the priors of parameters, and its top.
struct Profiled {
    problem: Problem,
    top: Fitted,
    /// Standard error of each entry in φ, all else answering.
    errors: Vec<f64>,
}

impl Profiled {
    /// From a fit with priors. `None` where no search works.
    fn new(problem: &Problem, fitted: &Fitted) -> Result<Option<Self>, FilterError> {
        let space = problem.twin.parameters();
        let is_level = |j: usize| j < space.len() && space[j].role == Role::Noise;
        let mut problem = problem.clone();
        for (j, axis) in problem.axes.iter_mut().enumerate() {
            if !is_level(j) {
                axis.deviation = f64::INFINITY;
            }
        }
        let errors = |problem: &Problem, at: &Fitted| -> Vec<f64> {
            let slopes = problem.coordinates.slopes(&at.theta);
            let errors = at.std_errors(problem);
            (errors.iter().zip(&slopes))
                .map(|(error, slope)| error / slope)
                .collect()
        };
        let Some(begin) = climb(&problem, &fitted.theta, 0)? else {
            return Ok(None);
        };
        // A narrow prior, which is left out, does not say how far it is to the top.
        let far = errors(&problem, &begin);
        for (axis, error) in problem.axes.iter_mut().zip(far) {
            axis.longest = axis.longest.max(error);
        }
        let Some(top) = climb(&problem, &fitted.theta, ITERATIONS)? else {
            return Ok(None);
        };
        let errors = errors(&problem, &top);
        Ok(Some(Self {
            problem,
            top,
            errors,
        }))
    }

    /// The profiles of these entries, with intervals of this level.
    fn of(&self, entries: &[usize], level: f64) -> Result<Vec<Profile>, FilterError> {
        let depth = depth(level);
        let sides = entries.iter().flat_map(|&j| [(j, -1.0), (j, 1.0)]);
        let sides = try_each(sides, |(j, sign)| self.side(j, sign, depth))?;
        let both = entries.iter().zip(sides.chunks_exact(2));
        Ok(both
            .map(|(&j, both)| self.profile(j, both, depth))
            .collect())
    }

    /// Fits with entry j held at more and more distant values on one side; the last one lies beyond the end, or at a bound.
    fn side(&self, j: usize, sign: f64, depth: f64) -> Result<Vec<ProfilePoint>, FilterError> {
        let held = self.problem.holding(|i| i == j);
        let c = &self.problem.coordinates;
        let start = c.of(&self.top.theta);
        let bound = if sign > 0.0 {
            c.upper()[j]
        } else {
            c.lower()[j]
        };
        let usual = Some(self.errors[j]).filter(|e| e.is_finite() && *e > 0.0);
        let mut step = usual.unwrap_or(self.problem.axes[j].longest) * (2.0 * depth).sqrt()
            / BUDGET.profile_parts;
        let mut points: Vec<ProfilePoint> = vec![];
        let answers = self.answers(j);
        let before = (start.iter().zip(&answers)).map(|(phi, answer)| phi - sign * step * answer);
        let (mut before, mut here) = (before.collect::<Vec<f64>>(), start);
        while points.len() < BUDGET.most_profile_fits && here[j] != bound {
            let next = here[j] + sign * step;
            let next = if sign * (next - bound) >= 0.0 {
                bound
            } else {
                next
            };
            let led = self.fitted(&held, (j, next), [&before, &here])?;
            let point = match led {
                None => self.fitted(&held, (j, next), [&here, &here])?,
                led => led,
            };
            let Some(point) = point else {
                break;
            };
            let last = points.last().map_or(0.0, ProfilePoint::root);
            let rise = (point.root() - last) * BUDGET.profile_parts / depth.sqrt();
            (before, here) = (here, point.phi.clone());
            let is_beyond = point.drop > depth;
            points.push(point);
            if is_beyond {
                self.secants(&held, j, &mut points, depth)?;
                break;
            }
            step *= (1.0 / rise.max(0.0)).clamp(0.5, 2.0);
        }
        self.fill(&held, j, &mut points)?;
        Ok(points)
    }

    /// Rates at which the best of all other entries follow entry j at the top, to first order: those within their bounds, and what the records do
    /// not tell stays where it is.
    fn answers(&self, j: usize) -> Vec<f64> {
        let (axes, c) = (&self.problem.axes, &self.problem.coordinates);
        let top = c.of(&self.top.theta);
        let is_free = |i: usize| top[i] > c.lower()[i] && top[i] < c.upper()[i];
        let is_other = |i: &usize| *i != j && !axes[*i].held && is_free(*i);
        let others: Vec<usize> = (0..axes.len()).filter(is_other).collect();
        let rows = self.top.information.select_rows(&others);
        let mut own = rows.select_columns(&others);
        for (a, &i) in others.iter().enumerate() {
            own[(a, a)] += axes[i].longest.powi(-2);
        }
        let mut answers = vec![0.0; axes.len()];
        if let Some(root) = own.cholesky() {
            let all = root.solve(&rows.column(j));
            for (&i, answer) in others.iter().zip(all.iter()) {
                answers[i] = -answer;
            }
        }
        answers[j] = 1.0;
        answers
    }

    /// Puts points into the widest gaps between the top and the end.
    fn fill(
        &self,
        held: &Problem,
        j: usize,
        points: &mut Vec<ProfilePoint>,
    ) -> Result<(), FilterError> {
        let top = self.problem.coordinates.of(&self.top.theta);
        while (1..BUDGET.least_profile_points).contains(&points.len()) {
            let before = |i: usize| if i == 0 { &top } else { &points[i - 1].phi };
            let gap = |i: &usize| (points[*i].phi[j] - before(*i)[j]).abs();
            let widest = (0..points.len()).max_by(|a, b| gap(a).total_cmp(&gap(b)));
            let i = widest.unwrap_or(0);
            let middle = 0.5 * (points[i].phi[j] + before(i)[j]);
            let Some(point) = self.fitted(held, (j, middle), [&points[i].phi, before(i)])? else {
                break;
            };
            points.insert(i, point);
        }
        Ok(())
    }

    /// Puts a point near the end of the interval between the last two.
    fn secants(
        &self,
        held: &Problem,
        j: usize,
        points: &mut Vec<ProfilePoint>,
        depth: f64,
    ) -> Result<(), FilterError> {
        let top = self.problem.coordinates.of(&self.top.theta);
        for _ in 0..BUDGET.secants {
            let [inside, beyond] = around(points, &top);
            let is_close =
                |point: &ProfilePoint| (point.root() - depth.sqrt()).abs() < BUDGET.profile_error;
            if is_close(&inside) || is_close(&beyond) {
                break;
            }
            let at = crossing(j, [&inside, &beyond], depth);
            let Some(point) = self.fitted(held, (j, at), [&inside.phi, &beyond.phi])? else {
                break;
            };
            let last = points.len() - 1;
            match point.drop > depth {
                // What lies beyond it stays out of the picture.
                true => points[last] = point,
                false => points.insert(last, point),
            }
        }
        Ok(())
    }

    /// The fit with entry j at φ_j, from where two fits lead.
    fn fitted(
        &self,
        held: &Problem,
        (j, to): (usize, f64),
        [before, here]: [&[f64]; 2],
    ) -> Result<Option<ProfilePoint>, FilterError> {
        let run = here[j] - before[j];
        let share = if run == 0.0 {
            0.0
        } else {
            (to - here[j]) / run
        };
        let mut phi: Vec<f64> = (here.iter().zip(before))
            .map(|(here, before)| here + share * (here - before))
            .collect();
        phi[j] = to;
        let c = &self.problem.coordinates;
        let ends = c.lower().iter().zip(c.upper());
        for (phi, (low, high)) in phi.iter_mut().zip(ends) {
            *phi = phi.max(*low).min(*high);
        }
        let found = reach(held, &c.theta(&phi), ITERATIONS)?;
        Ok(found.map(|fitted| ProfilePoint {
            phi: c.of(&fitted.theta),
            drop: self.top.objective - fitted.objective,
        }))
    }

    /// Both sides as one curve. A point above the top is the top: what is below the highest is counted from there.
    fn profile(&self, j: usize, both: &[Vec<ProfilePoint>], depth: f64) -> Profile {
        let c = &self.problem.coordinates;
        let middle = ProfilePoint {
            phi: c.of(&self.top.theta),
            drop: 0.0,
        };
        let mut all: Vec<ProfilePoint> =
            (both.iter().flatten().chain([&middle])).cloned().collect();
        ascending(&mut all, |a| a.phi[j]);
        let highest = all.iter().map(|p| p.drop).fold(0.0, f64::min);
        all.iter_mut().for_each(|point| point.drop -= highest);
        let value = |phi: f64| {
            let mut whole = middle.phi.clone();
            whole[j] = phi;
            c.theta(&whole)[j]
        };
        let best = (0..all.len()).min_by(|a, b| all[*a].drop.total_cmp(&all[*b].drop));
        let best = best.unwrap_or(0);
        let end = |pair: &[ProfilePoint]| {
            let [inside, beyond] = [&pair[0], &pair[1]];
            (beyond.drop > depth && inside.drop <= depth)
                .then(|| value(crossing(j, [inside, beyond], depth)))
        };
        let below: Vec<ProfilePoint> = all[..=best].iter().rev().cloned().collect();
        let space = self.problem.twin.parameters();
        Profile {
            name: space[j].name.clone(),
            unit: space[j].unit.clone(),
            values: all.iter().map(|point| value(point.phi[j])).collect(),
            log_likelihoods: all.iter().map(|point| 0.0 - point.drop).collect(),
            low: below.windows(2).find_map(end),
            high: all[best..].windows(2).find_map(end),
        }
    }
}

/// A fit with one entry held.
#[derive(Debug, Clone)]
struct ProfilePoint {
    phi: Vec<f64>,
    /// Nats below the top.
    drop: f64,
}

impl ProfilePoint {
    /// √drop: near the top it grows as the distance does.
    fn root(&self) -> f64 {
        self.drop.max(0.0).sqrt()
    }
}

/// The last point, and what lies before it.
fn around(points: &[ProfilePoint], top: &[f64]) -> [ProfilePoint; 2] {
    let last = points.len() - 1;
    let inside = match last {
        0 => ProfilePoint {
            phi: top.to_vec(),
            drop: 0.0,
        },
        n => points[n - 1].clone(),
    };
    [inside, points[last].clone()]
}

/// φ_j at which √drop crosses that of the depth, on a line between two points.
fn crossing(j: usize, [inside, beyond]: [&ProfilePoint; 2], depth: f64) -> f64 {
    let (a, b) = (inside.root(), beyond.root());
    let share = if b > a {
        (depth.sqrt() - a) / (b - a)
    } else {
        1.0
    };
    inside.phi[j] + share * (beyond.phi[j] - inside.phi[j])
}

#[cfg(test)]
mod tests {
    use crate::fit::FitSettings;
    use crate::progress::Progress;
    use crate::record::{Drive, Record, Signal};
    use crate::study::{Study, StudyFile};
    use crate::twin::{Noise, Now, Outline, Parameter, StateSpace};

    /// y = a·b·u + c, the product alone is seen.
    struct Product;

    impl StateSpace for Product {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("a", "1", 1.0, 2.0).within(0.5, 4.0))
                .parameter(Parameter::new("b", "1", 1.0, 2.0).within(0.5, 4.0))
                .parameter(Parameter::new("c", "V", -0.1, 0.1).within(-50.0, 50.0))
                .state("x", "V")
                .input("u", "V")
                .output("y", "V")
        }
        fn drift(&self, _: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = -x[0];
        }
        fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = now.theta[0] * now.theta[1] * now.u[0] + now.theta[2] + x[0];
        }
        fn start(&self, _: &Now<'_>, x: &mut [f64]) {
            x[0] = 0.0;
        }
        fn noise(&self, _: &Now<'_>, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
            measurement[0] = 0.5;
        }
    }

    fn fitted(offset: f64, profile: bool) -> crate::fit::Fit {
        let inputs = Signal::from_shape_fn((120, 1), |(k, _)| [1.0, -1.0, 0.5][k / 7 % 3]);
        let drive = Drive::new(0.1, inputs).unwrap();
        let mut noise = Noise::new(4, "profile", 0).source("y");
        let y = drive.inputs().mapv(|u| 2.0 * u + offset)
            + Signal::from_shape_fn((120, 1), |_| 0.5 * noise.normal());
        let record = Record::new(drive, y).unwrap();
        let settings = FitSettings {
            profile,
            ..FitSettings::default()
        };
        let study = Study::of(Product).unwrap();
        study
            .fit_with(&[record], &settings, &Progress::silent())
            .unwrap()
    }

    /// An offset beyond its prior is stated as the records alone have it: mean ± 1.645 deviations of the mean. What is not identified has
    /// no ends, and reaches from bound to bound.
    #[test]
    fn profiles_are_what_records_say() {
        let fit = fitted(0.4, true);
        let of = |name: &str| fit.profiles.iter().find(|p| p.name == name).unwrap();
        for name in ["a", "b"] {
            assert_eq!((of(name).low, of(name).high), (None, None), "{name}");
            let (first, last) = (of(name).values[0], *of(name).values.last().unwrap());
            assert!(first < 0.51 && last > 3.99, "{name}: {first} to {last}");
        }
        let c = of("c");
        let highest = c.log_likelihoods.iter().copied().fold(f64::MIN, f64::max);
        assert_eq!(highest, 0.0);
        let (low, high) = (c.low.unwrap(), c.high.unwrap());
        // The noise level is fitted, too: the curve is that of Student's t, a little wider.
        let width = 2.0 * 1.645 * 0.5 / 120f64.sqrt();
        assert!(
            (0.9..1.1).contains(&((high - low) / width)),
            "{low} to {high}"
        );
        assert!(low < 0.4 + 0.15 && high > 0.4 - 0.15, "{low} to {high}");
        let value = fit.parameters.iter().find(|p| p.name == "c").unwrap();
        assert!(
            value.by_profile && value.low <= low && value.high >= high,
            "{value:?}"
        );
    }

    /// Without being asked, nothing is profiled but what the prior shapes: the two factors, of which the records say nothing alone.
    #[test]
    fn only_what_the_prior_shapes_is_profiled() {
        let fit = fitted(0.02, false);
        assert!(
            fit.profiles.iter().all(|p| p.name != "c"),
            "{:?}",
            fit.profiles
        );
    }

    /// A line with known noise, and a prior of its slope that is far from the record and says nothing of how far: the exact profile is a parabola.
    #[test]
    fn a_far_prior_has_no_part() {
        let text = "[parameters]\na = { prior = [5.0, 15.0], bounds = [5.0, 15.0] }\n\
            b = { prior = [0.12, 0.14], bounds = [-50.0, 50.0] }\n[states]\nx = { rate = \"b/1.5\", start = 0.0 }\n\
            [outputs]\ny = { value = \"a + x\", noise = { std = 3.4, known = true } }\n[noise]\nprocess = \"none\"\n[record]\nstep = 0.5\nsamples = 4\n";
        let file = StudyFile::parse(text, "line.toml".as_ref()).unwrap();
        let study = Study::of_file(&file).unwrap();
        let y = Signal::from_shape_vec((4, 1), vec![-4.8, -3.1, -6.6, -4.5]).unwrap();
        let record = Record::new(Drive::autonomous(0.5, 4).unwrap(), y).unwrap();
        let settings = FitSettings {
            profile: true,
            ..FitSettings::default()
        };
        let fit = study
            .fit_with(&[record], &settings, &Progress::silent())
            .unwrap();
        let near = |end: Option<f64>, exact: f64| end.is_some_and(|end| (end - exact).abs() < 0.03);
        let [a, b] = [&fit.profiles[0], &fit.profiles[1]];
        assert!(
            a.low.is_none() && near(a.high, 6.104),
            "{:?} {:?}",
            a.low,
            a.high
        );
        assert!(
            near(b.low, -17.29) && near(b.high, -8.34),
            "{:?} {:?}",
            b.low,
            b.high
        );
    }
}
