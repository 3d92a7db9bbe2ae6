//! Every cause since every part as one hypothesis (`process/3.2`, `process/3.3`).

use nalgebra::DMatrix;

use crate::diagnosis::{log_sum_exp, spread_of_cosines};
use crate::process::change::null::{Form, Null, Told};
use crate::process::change::sums::{Fit, Reach, Sums, Waves};
use crate::process::part::sight::{COSINES, Catalogue};

/// The last parts are all onsets; before them every fourth is, back to this many parts.
const ALL: usize = 40;
pub(in crate::process) const WINDOW: usize = 160;
const EVERY: usize = 4;
/// Shares of the names by a step and by a drift, and of what has no name.
const STEPS: f64 = 0.65;
const DRIFTS: f64 = 0.20;
const UNNAMED: f64 = 0.15;
/// Sizes of a step, in prior standard deviations of its cause.
const SCALES: [f64; 2] = [0.2, 1.0];
/// Pointwise sizes of what has no name, in standard deviations of a reading, and its correlation length along the part.
const SIZES: [f64; 3] = [1.0, 3.0, 10.0];
const LENGTH: f64 = 0.08;

/// What is weighed over onsets and causes.
pub(in crate::process) struct Scale<'a> {
    pub(in crate::process) catalogue: &'a Catalogue,
    /// Standard deviation of a reading.
    pub(in crate::process) sigma: f64,
    /// Onsets that stand for several weigh as much as these.
    pub(in crate::process) thinned_weigh: bool,
}

/// A hypothesis with its evidence.
#[derive(Debug, Clone)]
pub(in crate::process) struct Entry {
    /// The part since which it acts.
    pub(in crate::process) since: u32,
    pub(in crate::process) what: What,
    pub(in crate::process) form: Form,
    /// ln of weight times Bayes factor.
    pub(in crate::process) log_weight: f64,
    /// Posterior mean and variance of the size of a cause, in prior standard deviations of its variant.
    pub(in crate::process) mean: f64,
    pub(in crate::process) variance: f64,
    /// Of cosines all of them.
    pub(in crate::process) waves: Option<Box<Waves>>,
}

/// What a hypothesis is about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::process) enum What {
    /// A variant of a cause.
    Cause(usize),
    /// All cosines, of one of [`SIZES`].
    Unnamed(usize),
}

/// Who is told of hypotheses.
pub(in crate::process) type Hear<'h> = &'h mut dyn FnMut(Entry, &DMatrix<f64>);

impl Scale<'_> {
    /// Prior standard deviations of the cosines of something without a name.
    pub(in crate::process) fn waves(&self, size: usize) -> Vec<f64> {
        spread_of_cosines(COSINES, LENGTH, SIZES[size] * self.sigma)
    }

    /// Everything that may have changed since the parts from `first` on; `hear` is given each hypothesis with L^-1 c of all
    /// basic columns.
    pub(in crate::process) fn each(&self, parts: &[Told<'_>], null: &Null, first: u32, hear: Hear<'_>) {
        let Some(newest) = parts.last() else { return };
        let basic = newest.gram.residual();
        let tried = Tried::of(self);
        let mut sums = Sums::none(null.columns.len(), basic);
        let mut next: Option<u32> = None;
        for part in parts.iter().rev() {
            if part.number < first {
                break;
            }
            sums.earlier(next.map_or(0.0, |next| f64::from(next - part.number)));
            sums.begin_with(part);
            next = Some(part.number);
            let weight = self.onset(newest.ordinal - part.ordinal, part.ordinal);
            if weight > 0.0 {
                tried.since(part.number, weight, &sums, null, hear);
            }
        }
    }

    /// Weight of an onset so many parts ago; 0 where it is left to another one.
    fn onset(&self, age: usize, ordinal: usize) -> f64 {
        match age {
            _ if age < ALL => 1.0,
            // It stands for itself and those before it: that all parts alike have something is no change.
            _ if age < WINDOW && (ordinal + 1).is_multiple_of(EVERY) => {
                if self.thinned_weigh {
                    EVERY as f64
                } else {
                    1.0
                }
            }
            _ => 0.0,
        }
    }

    /// All of it.
    pub(in crate::process) fn entries(&self, parts: &[Told<'_>], null: &Null, first: u32) -> Vec<Entry> {
        let mut entries = Vec::new();
        self.each(parts, null, first, &mut |entry, _| entries.push(entry));
        entries
    }

    /// ln of the Bayes factor of "this part alone is off", of each of some parts: by any cause, half the weight, or by cosines.
    pub(in crate::process) fn log_alone(&self, parts: &[Told<'_>], null: &Null) -> Vec<f64> {
        let tried = Tried::of(self);
        let count = parts.last().map_or(0, |part| part.gram.residual());
        let alone = |part: &Told<'_>| {
            let mut sums = Sums::none(null.columns.len(), count);
            sums.begin_with(part);
            let halved = sums.halved(Form::Step, null);
            let fit = |own: &TriedCause| {
                let fit = sums.one(COSINES + own.variant, Form::Step, own.scale, &halved, null).within(&own.reach);
                (0.5 / STEPS).ln() + own.log_share + fit.log_bf
            };
            let mut all: Vec<f64> = tried.causes.iter().filter(|own| own.form == Form::Step).map(fit).collect();
            let cosines = sums.cosines(&halved, null);
            let waves = tried.waves.iter().filter_map(|sd| cosines.waves(sd));
            all.extend(waves.map(|waves| (0.5 / SIZES.len() as f64).ln() + waves.log_bf));
            log_sum_exp(&all)
        };
        parts.iter().map(alone).collect()
    }
}

/// All that is tried at every onset.
struct Tried {
    causes: Vec<TriedCause>,
    /// Prior standard deviations of the cosines, of each of [`SIZES`].
    waves: Vec<Vec<f64>>,
}

/// A variant of a cause, of one form and size.
struct TriedCause {
    form: Form,
    variant: usize,
    scale: f64,
    /// ln of its share of all that may change.
    log_share: f64,
    reach: Reach,
}

impl Tried {
    fn of(scale: &Scale<'_>) -> Self {
        let shares = scale.catalogue.shares();
        let mut causes = Vec::new();
        for (form, share, scales) in [(Form::Step, STEPS, SCALES.as_slice()), (Form::Drift, DRIFTS, &SCALES[1..])] {
            for (variant, own) in shares.iter().enumerate() {
                let log_share = (share * own / scales.len() as f64).ln();
                let reach = scale.catalogue.variants[variant].reach();
                causes.extend(scales.iter().map(|&scale| TriedCause {
                    form,
                    variant,
                    scale,
                    log_share,
                    reach: Reach::of(scale, reach),
                }));
            }
        }
        Self { causes, waves: (0..SIZES.len()).map(|size| scale.waves(size)).collect() }
    }

    /// All of it since an onset of this weight.
    fn since(&self, since: u32, weight: f64, sums: &Sums, null: &Null, hear: Hear<'_>) {
        for form in [Form::Step, Form::Drift] {
            let halved = sums.halved(form, null);
            for own in self.causes.iter().filter(|own| own.form == form) {
                let fit = sums.one(COSINES + own.variant, form, own.scale, &halved, null).within(&own.reach);
                let (what, log_weight) = (What::Cause(own.variant), weight.ln() + own.log_share + fit.log_bf);
                let Fit { mean, variance, .. } = fit;
                hear(Entry { since, what, form, log_weight, mean, variance, waves: None }, &halved);
            }
            if form == Form::Step {
                let cosines = sums.cosines(&halved, null);
                for (size, sd) in self.waves.iter().enumerate() {
                    let Some(waves) = cosines.waves(sd) else { continue };
                    let prior = weight * UNNAMED / SIZES.len() as f64;
                    let (what, log_weight) = (What::Unnamed(size), prior.ln() + waves.log_bf);
                    let waves = Some(Box::new(waves));
                    hear(Entry { since, what, form, log_weight, mean: 0.0, variance: 0.0, waves }, &halved);
                }
            }
        }
    }
}

impl Entry {
    /// Posterior mean and variance of its size: of a cause in prior standard deviations of its variant, of cosines root mean
    /// square along the part, in the unit of the quantity.
    pub(in crate::process) fn size(&self) -> (f64, f64) {
        self.waves.as_ref().map_or((self.mean, self.variance), |waves| waves.rms())
    }
}
