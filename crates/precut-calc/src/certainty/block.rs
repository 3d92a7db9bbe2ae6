//! The block `uncertainty` of a job: one shape for every calculator, whose quantities are its own.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Violations;

use super::{
    Contradiction, Distribution, Level, Pair, Quantity, Source, Uncertain, check_correlations, check_presence,
    check_quantities,
};

/// What a block says.
pub(crate) trait Block {
    /// Its quantities.
    type Of: Quantity;

    /// Those that the job states.
    fn stated(&self) -> Vec<(Self::Of, &Distribution)>;

    /// How they go together.
    fn pairs(&self) -> Vec<Pair<'_, Self::Of>>;

    /// Whether what is usual is uncertain, too.
    fn has_usual(&self) -> bool;

    /// Standard uncertainty in percent that it states of a quantity, in place of what is usual.
    fn percent(&self, _quantity: Self::Of) -> Option<f64> {
        None
    }

    /// A quantity as the job states it, else as is usual; `None` of one that is known.
    fn uncertain(&self, quantity: Self::Of, level: Level, usual: Option<Distribution>) -> Option<Uncertain<Self::Of>> {
        let own = self.stated().into_iter().find(|(stated, _)| *stated == quantity);
        let (distribution, source) = match (own, usual, self.percent(quantity)) {
            (Some((_, own)), _, _) => (own.clone(), Source::Stated),
            (None, Some(_), Some(percent)) => {
                (Distribution::Lognormal { log_standard_deviation: percent / 100.0 }, Source::Stated)
            }
            (None, Some(usual), None) if self.has_usual() => (usual, Source::Default),
            (None, _, _) => return None,
        };
        distribution.is_wide().then_some(Uncertain { quantity, distribution, level, source })
    }

    /// Finds what cannot be; `contradiction` is what the correlations come to, `missing_in` the field without which there is
    /// nothing of that kind.
    fn check(
        &self,
        contradiction: impl FnOnce() -> Option<Contradiction>,
        missing_in: impl Fn(Self::Of) -> Option<&'static str>,
        violations: &mut Violations,
    ) {
        let stated = self.stated();
        check_quantities(&stated, violations);
        check_correlations(&self.pairs(), &stated, contradiction, violations);
        check_presence(stated.iter().map(|(quantity, _)| *quantity), missing_in, violations);
    }
}

/// When a probability is checked on the real model; elsewhere a response surface about the stated values tells it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProbabilityCheck {
    /// Where that is expected to take no longer than 50 ms, and with the analysis `certainty`.
    #[default]
    Auto,
    /// Always.
    Always,
    /// With the analysis `certainty` alone.
    Never,
}

/// Declares the block of a calculator with the names that its contract has: the block, a quantity with its distribution, and a
/// correlation.
macro_rules! uncertainty_block {
    (
        $(#[$about:meta])*
        $block:ident {
            $(force_percent: $percent:ty, of $force:ident;)?
            quantities: $one:ident of $quantity:ident ($($quantities:tt)*), such as $example:tt;
            correlations: $pair:ident ($pairs:tt), such as $examples:tt;
            $(effects: $open:ty;)?
            $(#[$defaults:meta])*
            defaults;
            $(#[$wanted:meta])*
            wanted_probability;
            $(check: $check:ty;)?
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $block {
            $(
                /// Of the cutting force, the standard deviation of its logarithm, in place of the usual 10 %; a material by name brings
                /// its own.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                #[schema(minimum = 0.0, maximum = 100.0, example = 15.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("u_F"))))]
                pub force_percent: $percent,
            )?
            /// What is uncertain, in place of what is usual or beside it.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            #[schema($($quantities)*)]
            pub quantities: Vec<$one>,
            /// Which of them go together.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            #[schema(max_items = $pairs, extensions(("x-advanced" = json!(true))))]
            pub correlations: Vec<$pair>,
            $(
                /// What is not known of the effects of the job, as a diagnosis leaves it; a stored model brings its own. It takes the
                /// place of what is usual of the same.
                #[serde(default, skip_serializing_if = "Vec::is_empty")]
                #[schema(max_items = 256, extensions(("x-advanced" = json!(true))))]
                pub effects: $open,
            )?
            $(#[$defaults])*
            #[serde(default = "crate::certainty::block::yes")]
            #[schema(default = true, example = true)]
            pub defaults: bool,
            $(#[$wanted])*
            #[serde(default = "crate::certainty::block::nineteen_of_twenty")]
            #[schema(exclusive_minimum = 0.0, exclusive_maximum = 1.0, default = 0.95, example = 0.95, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("P"))))]
            pub wanted_probability: f64,
            /// Seed of the points over which probabilities are integrated.
            #[serde(default = "crate::certainty::block::one")]
            #[schema(minimum = 0, maximum = 100_000_000, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("seed"))))]
            pub seed: u32,
            $(
                /// Whether the probability is checked on the real model.
                #[serde(default)]
                #[schema(default = "auto", example = "always", extensions(("x-advanced" = json!(true))))]
                pub check: $check,
            )?
        }

        impl Default for $block {
            fn default() -> Self {
                use crate::certainty::block::{nineteen_of_twenty, one, yes};
                Self {
                    $(force_percent: <$percent>::default(),)?
                    quantities: Vec::new(),
                    correlations: Vec::new(),
                    $(effects: <$open>::new(),)?
                    defaults: yes(),
                    wanted_probability: nineteen_of_twenty(),
                    seed: one(),
                    $(check: <$check>::default(),)?
                }
            }
        }

        impl crate::certainty::Block for $block {
            type Of = $quantity;

            fn stated(&self) -> Vec<($quantity, &crate::certainty::Distribution)> {
                self.quantities.iter().map(|one| (one.quantity, &one.distribution)).collect()
            }

            fn pairs(&self) -> Vec<crate::certainty::Pair<'_, $quantity>> {
                self.correlations.iter().map(|pair| (&pair.between[..], pair.coefficient)).collect()
            }

            fn has_usual(&self) -> bool {
                self.defaults
            }

            $(
                fn percent(&self, quantity: $quantity) -> Option<f64> {
                    self.force_percent.filter(|_| quantity == $quantity::$force)
                }
            )?
        }

        /// How a quantity is distributed.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $one {
            /// Which.
            #[schema(example = $example)]
            pub quantity: $quantity,
            /// How it is distributed about what the job states.
            pub distribution: crate::certainty::Distribution,
        }

        /// How two quantities go together.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $pair {
            /// Which two.
            #[schema(min_items = 2, max_items = 2, example = json!($examples))]
            pub between: Vec<$quantity>,
            /// Correlation of their standard normal scores.
            #[schema(exclusive_minimum = -1.0, exclusive_maximum = 1.0, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
            pub coefficient: f64,
        }
    };
}
pub(crate) use uncertainty_block;

pub(crate) fn yes() -> bool {
    true
}

pub(crate) fn nineteen_of_twenty() -> f64 {
    0.95
}

pub(crate) fn one() -> u32 {
    1
}
