//! The verdict and the sets behind it in the words of the contract.

use crate::calculator::{Failure, Hypothesis, Monitor, Treatment};
use crate::diagnosis::answer::output::{
    CandidateReport, CauseReport, ContributionReport, FurtherRun, LikelySet, NamedCause, NextReport, OutlyingRunReport,
    ParameterReport, ProfileReport, SeparationReport, SetReport, SignatureReport, VerdictClass,
};
use crate::diagnosis::causes::optima::{Peak, mixture_interval};
use crate::diagnosis::causes::profile::Profile;
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::model::gain::Gain;
use crate::diagnosis::model::next::NextMeasurement;
use crate::diagnosis::model::outlying::OutlyingRun;
use crate::diagnosis::statistics::evidence::quantile;
use crate::diagnosis::verdict::identify::{Signature, separations};
use crate::diagnosis::verdict::judge::Verdict;
use crate::diagnosis::verdict::weigh::Weighing;

/// Leading sets whose signatures and separations are given: those that extend no likelier one.
const SEPARATED_SETS: usize = 6;
/// How far the edges of an interval may differ from those of a quadratic likelihood, as a share of their distance from
/// the fit, before the profile takes their place.
const AGREE: f64 = 0.2;

/// A point of a grid with less of the posterior changes no edge of an interval that is given.
const UNSEEN_WEIGHT: f64 = 1e-4;

/// A change of the prediction below this share of the scatter is not seen in single rows.
const NEGLIGIBLE: f64 = 0.5;

/// What the verdict is made of.
pub(in crate::diagnosis) struct View<'a> {
    pub(in crate::diagnosis) hypotheses: &'a [Hypothesis],
    pub(in crate::diagnosis) weighing: &'a Weighing<'a>,
    /// Of the set whose parameters are reported.
    profiles: Vec<Profile>,
}

impl<'a> View<'a> {
    /// With profiles of the parameters that are reported: of the set that is named, or of the likeliest. Of data that are
    /// not judged there are none.
    pub(in crate::diagnosis) fn of(
        hypotheses: &'a [Hypothesis],
        weighing: &'a Weighing<'a>,
        judged: bool,
        dear: bool,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let mut view = Self { hypotheses, weighing, profiles: Vec::new() };
        if let Some(set) = view.profiled().filter(|_| judged) {
            view.profiles = weighing.profiles(set, quantile(0.95, weighing.noise.dof), dear, monitor)?;
        }
        Ok(view)
    }

    /// The set whose parameters have profiles. Beside a remainder a fit has more free sizes than its own.
    fn profiled(&self) -> Option<&'a SetWeight> {
        match &self.weighing.verdict {
            Verdict::Named(members) => self.weighing.named_sets().find(|set| set.members == *members),
            Verdict::Confounded(likely) => {
                let first = likely.first()?;
                self.weighing.named_sets().find(|set| set.members == *first)
            }
            Verdict::Adequate | Verdict::Unknown(_) => None,
        }
    }

    pub(in crate::diagnosis) fn kind(&self, hypothesis: usize) -> &'static str {
        self.hypotheses[hypothesis].cause.kind
    }

    pub(in crate::diagnosis) fn class(&self) -> VerdictClass {
        class_of(&self.weighing.verdict)
    }

    /// The set whose causes are named.
    pub(in crate::diagnosis) fn leading(&self) -> Option<&'a SetWeight> {
        let of = |members: &[usize], with_remainder: bool| {
            self.weighing.sets.iter().find(|set| set.members == members && set.remainder.is_some() == with_remainder)
        };
        match &self.weighing.verdict {
            Verdict::Named(members) => of(members, false),
            Verdict::Unknown(members) => of(members, true),
            _ => None,
        }
    }

    pub(in crate::diagnosis) fn named(&self) -> Vec<NamedCause> {
        self.leading().map_or_else(Vec::new, |set| self.set(set))
    }

    /// What each cause that is named changes, and the collinearity of all of them.
    pub(in crate::diagnosis) fn contributions(
        &self,
        negligible_below: Option<f64>,
    ) -> Result<(Vec<ContributionReport>, Option<f64>), Failure> {
        let Some(set) = self.leading().filter(|set| !set.members.is_empty()) else { return Ok((Vec::new(), None)) };
        let foundation = self.weighing.foundation;
        let whole = foundation.subject.predict(&set.settings)?;
        let report = |member: usize| {
            let others: Vec<Setting> =
                (0..set.settings.len()).filter(|k| *k != member).map(|k| set.settings[k].clone()).collect();
            let without = if others.is_empty() {
                foundation.subject.predict(&[])?
            } else {
                foundation.subject.predict(&others)?
            };
            let kept = (0..whole.len()).filter(|&row| self.weighing.keep[row]);
            let changes = kept.filter_map(|row| Some(whole[row].ok()? - without[row].ok()?));
            let (sum, count) = changes.fold((0.0, 0.0), |(sum, count), change| (sum + change * change, count + 1.0));
            let change_rms = if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 };
            let hypothesis = &self.hypotheses[set.members[member]];
            let unseen = change_rms < NEGLIGIBLE * self.weighing.noise.sigma;
            Ok(ContributionReport {
                kind: hypothesis.cause.kind.to_owned(),
                label: hypothesis.label.clone(),
                change_rms,
                negligible: unseen && negligible_below.is_some_and(|limit| change_rms < limit),
            })
        };
        let all = (0..set.settings.len()).map(report).collect::<Result<Vec<_>, Failure>>()?;
        let signature = Signature::of(self.weighing, &set.members, &set.settings)?;
        let collinearity = if all.len() > 1 { signature.collinearity() } else { None };
        Ok((all, collinearity))
    }

    /// Runs that the others do not lead one to expect.
    pub(in crate::diagnosis) fn outlying(&self, gain: Option<&Gain>) -> Vec<OutlyingRunReport> {
        let report = |odd: &OutlyingRun| OutlyingRunReport {
            run: u32::try_from(odd.run + 1).unwrap_or(u32::MAX),
            misfit_per_row: odd.misfit_per_row,
            verdict_without: class_of(&odd.without),
            sets_without: kinds_of(self.hypotheses, &odd.without),
        };
        gain.map_or_else(Vec::new, |gain| gain.outlying.iter().map(report).collect())
    }

    pub(in crate::diagnosis) fn likely_sets(&self) -> Vec<LikelySet> {
        let Verdict::Confounded(likely) = &self.weighing.verdict else { return Vec::new() };
        let sets = likely.iter().filter_map(|members| self.weighing.named_sets().find(|set| set.members == *members));
        let listed = |set: &SetWeight| {
            let contains = |other: &&SetWeight| set.members.iter().all(|h| other.members.contains(h));
            let with_others: f64 = self.weighing.named_sets().filter(contains).map(|other| other.posterior).sum();
            LikelySet { causes: self.set(set), posterior: set.posterior, posterior_with_others: with_others.min(1.0) }
        };
        sets.map(listed).collect()
    }

    pub(in crate::diagnosis) fn set_report(&self, set: &SetWeight, gain: Option<&Gain>) -> SetReport {
        let held_out = |gain: &Gain| match set.members.as_slice() {
            [] => Some(gain.rmse_base),
            members => gain.of_sets.iter().find(|(of, _)| of == members).map(|(_, rmse)| *rmse),
        };
        SetReport {
            causes: self.set(set),
            posterior: set.posterior,
            with_remainder: set.remainder.is_some(),
            bic: self.weighing.bic(set),
            lack_of_fit_p: self.weighing.lack_of_fit(set),
            held_out_rmse: gain.filter(|_| set.remainder.is_none()).and_then(held_out),
        }
    }

    fn set(&self, set: &SetWeight) -> Vec<NamedCause> {
        let on_grid = self.weighing.peaks(set);
        let of_member = |member: usize| {
            let hypothesis = &self.hypotheses[set.settings[member].hypothesis];
            let parameters = 0..hypothesis.variables.len();
            NamedCause {
                kind: hypothesis.cause.kind.to_owned(),
                label: hypothesis.label.clone(),
                parameters: parameters
                    .map(|index| {
                        self.parameter(set, member, index, on_grid.as_ref().map(|all| all[member][index].as_slice()))
                    })
                    .collect(),
            }
        };
        (0..set.settings.len()).map(of_member).collect()
    }

    /// `on_grid`: what the value may be where its set has shapes that stay on their grid.
    fn parameter(&self, set: &SetWeight, member: usize, index: usize, on_grid: Option<&[Peak]>) -> ParameterReport {
        let (setting, sd) = (&set.settings[member], set.standard_deviations[member][index]);
        let variable = &self.hypotheses[setting.hypothesis].variables[index];
        let (value, range) = (setting.values[index], variable.range);
        let fitted = sd > 0.0 && !matches!(variable.treatment, Treatment::Stated { .. });
        let dof = self.weighing.noise.dof;
        let quadratic = |share: f64| {
            let half = quantile(share, dof) * sd;
            [value - half, value + half].map(|edge| edge.clamp(range.lower, range.upper))
        };
        let at_optimum = Peak { value, standard_deviation: sd, weight: 1.0 };
        let others: Vec<Peak> = set.others.iter().filter(|_| fitted).map(|other| other.peak(member, index)).collect();
        // Where one point of a grid has all of it, a size is known as if there were no other.
        let is_shape = matches!(variable.treatment, Treatment::Shape { .. });
        let on_grid: Vec<Peak> =
            on_grid.unwrap_or_default().iter().copied().filter(|peak| peak.weight > UNSEEN_WEIGHT).collect();
        // Where both agree the simpler one stands.
        let profile = self.profile(set, setting.hypothesis, index).filter(|profile| {
            let reach = quantile(0.95, dof);
            !profile.agrees(value, quadratic(0.95), reach, AGREE)
        });
        let known = if !others.is_empty() {
            Known::Peaks("several_optima", [vec![at_optimum], others.clone()].concat())
        } else if on_grid.len() > 1 || (is_shape && !on_grid.is_empty()) {
            Known::Peaks("grid", on_grid)
        } else {
            profile.map_or(Known::Quadratic, Known::Profile)
        };
        let from = self.hypotheses[setting.hypothesis].counted_from(index);
        let interval = |share: f64| {
            let counted = fitted.then(|| match &known {
                Known::Peaks(_, peaks) => {
                    mixture_interval(peaks, share, dof).map(|edge| edge.clamp(range.lower, range.upper))
                }
                Known::Profile(profile) => profile.interval(quantile(share, dof)),
                Known::Quadratic => quadratic(share),
            });
            counted.map(|ends| ends.map(|end| end + from))
        };
        let is_change = self.hypotheses[setting.hypothesis].held.is_some();
        let span = range.upper - range.lower;
        ParameterReport {
            name: variable.name.to_owned(),
            unit: variable.unit.to_owned(),
            value: value + from,
            was: (is_change && fitted).then_some(from),
            standard_deviation: fitted.then_some(sd),
            interval_50: interval(0.50),
            interval_90: interval(0.90),
            interval_95: interval(0.95),
            interval_from: fitted.then(|| known.name().to_owned()),
            other_values: others.iter().map(|other| other.value + from).collect(),
            at_limit: fitted && (value - range.lower < 1e-9 * span || range.upper - value < 1e-9 * span),
        }
    }

    fn profile(&self, set: &SetWeight, hypothesis: usize, variable: usize) -> Option<&Profile> {
        if set.remainder.is_some() || self.profiled().is_none_or(|profiled| profiled.members != set.members) {
            return None;
        }
        self.profiles.iter().find(|profile| profile.hypothesis == hypothesis && profile.variable == variable)
    }

    pub(in crate::diagnosis) fn profiles(&self) -> Vec<ProfileReport> {
        let Some(set) = self.profiled() else { return Vec::new() };
        let reach = quantile(0.95, self.weighing.noise.dof);
        let report = |profile: &Profile| {
            let hypothesis = &self.hypotheses[profile.hypothesis];
            let variable = &hypothesis.variables[profile.variable];
            let member = set.settings.iter().position(|setting| setting.hypothesis == profile.hypothesis)?;
            let from = hypothesis.counted_from(profile.variable);
            let (fit, sd) =
                (set.settings[member].values[profile.variable], set.standard_deviations[member][profile.variable]);
            Some(ProfileReport {
                kind: hypothesis.cause.kind.to_owned(),
                label: hypothesis.label.clone(),
                parameter: variable.name.to_owned(),
                unit: variable.unit.to_owned(),
                value: profile.value.iter().map(|value| value + from).collect(),
                deviations: profile.value.iter().map(|value| (value - fit) / sd).collect(),
                rise: profile.rise.clone(),
                rise_at_95: reach * reach,
            })
        };
        self.profiles.iter().filter_map(report).collect()
    }

    pub(in crate::diagnosis) fn causes(&self) -> Vec<CauseReport> {
        let mut causes: Vec<CauseReport> = self
            .hypotheses
            .iter()
            .zip(&self.weighing.inclusion)
            .map(|(hypothesis, &probability)| CauseReport {
                kind: hypothesis.cause.kind.to_owned(),
                label: hypothesis.label.clone(),
                probability,
                confounded_with: hypothesis.cause.confounded_with.iter().map(|&kind| kind.to_owned()).collect(),
            })
            .collect();
        causes.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        causes
    }

    pub(in crate::diagnosis) fn next_report<R: utoipa::ToSchema>(&self, next: NextMeasurement<R>) -> NextReport<R> {
        let kinds = |members: &[usize]| members.iter().map(|&h| self.kind(h).to_owned()).collect();
        let count = |rows: usize| u32::try_from(rows).unwrap_or(u32::MAX);
        let further = next.further.into_iter().map(|own| FurtherRun {
            changes: own.looked.changes.to_owned(),
            run: own.looked.run,
            rows: count(own.looked.rows),
            places: own.looked.places,
            rival: kinds(&own.rival),
            separation_before_sigmas: own.separation_before,
            separation_then_sigmas: own.looked.separation_then,
        });
        let best = next.best;
        NextReport {
            changes: best.changes.to_owned(),
            run: best.run,
            rows: count(best.rows),
            places: best.places,
            leader: kinds(&next.leader),
            rival: kinds(&next.rival),
            separation_now_sigmas: next.separation_now,
            separation_then_sigmas: best.separation_then,
            bayes_factor: best.bayes_factor,
            entropy_drop_nats: best.entropy_drop_nats,
            rows_needed: best.settles.map(|(rows, _)| count(rows)),
            cost_to_settle: best.settles.map(|(_, cost)| cost),
            further_runs: further.collect(),
            candidates: next
                .candidates
                .into_iter()
                .map(|own| CandidateReport {
                    changes: own.changes.to_owned(),
                    run: own.run,
                    separation_sigmas: own.separation_then,
                    cost_to_settle: own.settles.map(|(_, cost)| cost),
                    bayes_factor: own.bayes_factor,
                    entropy_drop_nats: own.entropy_drop_nats,
                })
                .collect(),
        }
    }

    /// What leading sets change, and how well they can be told apart.
    pub(in crate::diagnosis) fn signatures(&self) -> Result<(Vec<SignatureReport>, Vec<SeparationReport>), Failure> {
        let mut signatures: Vec<Signature> = Vec::new();
        for set in self.weighing.named_sets() {
            // A set lies as near as one likes to what it extends.
            if signatures.iter().any(|likelier| likelier.members.iter().all(|h| set.members.contains(h))) {
                continue;
            }
            signatures.push(Signature::of(self.weighing, &set.members, &set.settings)?);
            if signatures.len() == SEPARATED_SETS {
                break;
            }
        }
        let kinds = |members: &[usize]| members.iter().map(|&h| self.kind(h).to_owned()).collect();
        let apart = separations(&signatures)
            .into_iter()
            .map(|pair| SeparationReport { a: kinds(&pair.a), b: kinds(&pair.b), sigmas: pair.sigmas })
            .collect();
        let changes = signatures
            .into_iter()
            .map(|signature| SignatureReport { causes: kinds(&signature.members), change: signature.change })
            .collect();
        Ok((changes, apart))
    }
}

/// A verdict with its sets, by their kinds.
pub(in crate::diagnosis) fn class_and_kinds(
    subject: &dyn Subject,
    verdict: &Verdict,
) -> (VerdictClass, Vec<Vec<String>>) {
    (class_of(verdict), kinds_of(subject.hypotheses(), verdict))
}

fn kinds_of(hypotheses: &[Hypothesis], verdict: &Verdict) -> Vec<Vec<String>> {
    let kinds = |members: &Vec<usize>| members.iter().map(|&h| hypotheses[h].cause.kind.to_owned()).collect::<Vec<_>>();
    match verdict {
        Verdict::Adequate => Vec::new(),
        Verdict::Named(members) | Verdict::Unknown(members) => vec![kinds(members)],
        Verdict::Confounded(sets) => sets.iter().map(kinds).collect(),
    }
}

/// What is known of a fitted value.
enum Known<'a> {
    /// A mixture, and where its parts come from.
    Peaks(&'static str, Vec<Peak>),
    /// A likelihood that is not quadratic.
    Profile(&'a Profile),
    /// One that is.
    Quadratic,
}

impl Known<'_> {
    fn name(&self) -> &'static str {
        match self {
            Self::Peaks(from, _) => from,
            Self::Profile(_) => "profile",
            Self::Quadratic => "quadratic",
        }
    }
}

fn class_of(verdict: &Verdict) -> VerdictClass {
    match verdict {
        Verdict::Adequate => VerdictClass::Adequate,
        Verdict::Named(_) => VerdictClass::Named,
        Verdict::Confounded(_) => VerdictClass::Confounded,
        Verdict::Unknown(_) => VerdictClass::Unknown,
    }
}
