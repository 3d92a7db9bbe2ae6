//! From numbers to places on the page, and the ticks between.

use super::unit::superscript;

/// Beyond this, places are drawn at the edge: sums and differences must stay finite.
const LARGEST: f64 = 1e300;

/// Spans below this share of the numbers themselves are noise of the last digits, not a shape.
const NOISE: f64 = 1e-9;

/// An interval of numbers, never empty, both ends finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Range {
    /// What all finite values span; widened where that is a point, 0 to 1 where there are none.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Self {
        let range = values.filter(|value| value.is_finite()).map(bounded).fold(None, |range, value| match range {
            None => Some(Self { low: value, high: value }),
            Some(Self { low, high }) => Some(Self { low: value.min(low), high: value.max(high) }),
        });
        range.map_or(Self { low: 0.0, high: 1.0 }, Self::widened)
    }

    fn widened(self) -> Self {
        let size = self.low.abs().max(self.high.abs());
        if self.high - self.low > NOISE * size && size > 1e-290 {
            return self;
        }
        let middle = f64::midpoint(self.low, self.high);
        let half = if size > 1e-290 { 0.1 * size } else { 1.0 };
        Self { low: middle - half, high: middle + half }
    }

    /// With room beyond the outermost values, and down or up to 0 where that is near; a curve that runs
    /// along 0 does not run along the frame.
    pub(super) fn roomy(self) -> Self {
        let Self { low, high } = self;
        let room = 0.06 * (high - low);
        let beyond = |end: f64| if end.abs() > 0.0 { 0.0 } else { 0.4 * room };
        let near = 4.0 * room;
        if low >= 0.0 && low <= near {
            Self { low: -beyond(low), high: high + room }
        } else if high <= 0.0 && -high <= near {
            Self { low: low - room, high: beyond(high) }
        } else {
            Self { low: low - room, high: high + room }
        }
    }
}

fn bounded(value: f64) -> f64 {
    value.clamp(-LARGEST, LARGEST)
}

/// A straight map from numbers to pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    range: Range,
    from_px: f64,
    to_px: f64,
}

impl Scale {
    pub(super) fn new(range: Range, from_px: f64, to_px: f64) -> Self {
        Self { range, from_px, to_px }
    }

    /// Where a finite number lies.
    pub(super) fn at(&self, value: f64) -> f64 {
        let Range { low, high } = self.range;
        self.from_px + (bounded(value) - low) / (high - low) * (self.to_px - self.from_px)
    }
}

/// Round numbers on an axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    /// Their numbers and how they are written.
    pub(super) marks: Vec<(f64, String)>,
    /// The written numbers stand for 10 to this power.
    pub(super) power: i32,
}

impl Ticks {
    /// At steps of 1, 2 or 5 times a power of ten, about `count` of them.
    pub(super) fn new(range: Range, count: f64, decimal: char) -> Self {
        let (digit, exponent) = step((range.high - range.low) / count.max(1.0));
        let power = written_power(range.low.abs().max(range.high.abs()));
        let decimals = usize::try_from((power - exponent).clamp(0, 12)).unwrap_or(0);
        let unit = digit * ten_to(exponent);
        let slack = 1e-9 * (range.high - range.low);
        let first = ((range.low - slack) / unit).ceil();
        let marks = (0_u8..50)
            .map(|k| first + f64::from(k))
            .take_while(|k| k * unit <= range.high + slack)
            .map(|k| (k * unit, label(k * digit * ten_to(exponent - power), decimals, decimal)))
            .collect();
        Self { marks, power }
    }

    /// `10⁻³` before the unit of the axis, where the numbers are written so.
    pub(super) fn factor(&self) -> Option<String> {
        (self.power != 0).then(|| format!("10{}", self.power.to_string().chars().map(superscript).collect::<String>()))
    }
}

/// A number as print writes it: with a minus, not a hyphen.
pub(super) fn label(value: f64, decimals: usize, decimal: char) -> String {
    let text = format!("{value:.decimals$}");
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.chars()
        .filter(|c| !(zero && *c == '-'))
        .map(|c| match c {
            '-' => '−',
            '.' => decimal,
            c => c,
        })
        .collect()
}

/// A number with about four digits that count, for words about a curve.
pub(super) fn rough(value: f64, decimal: char) -> String {
    let size = value.abs();
    if size > 0.0 && !(1e-4..1e6).contains(&size) {
        let text = format!("{value:.2e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let raised: String = exponent.chars().map(superscript).collect();
        return format!("{}·10{raised}", digits.replace('-', "−").replace('.', &decimal.to_string()));
    }
    let decimals = usize::try_from((3 - magnitude(size)).clamp(0, 7)).unwrap_or(0);
    label(value, decimals, decimal)
}

/// Digit and power of ten of the least round step that is not smaller than `raw`.
fn step(raw: f64) -> (f64, i32) {
    let exponent = magnitude(raw);
    [1.0, 2.0, 5.0]
        .into_iter()
        .find(|digit| digit * ten_to(exponent) >= raw * (1.0 - 1e-9))
        .map_or((1.0, exponent + 1), |digit| (digit, exponent))
}

/// Numbers up to 99999 and down to hundredths are written as they are, others in powers of a thousand.
fn written_power(size: f64) -> i32 {
    if (1e-2..1e5).contains(&size) { 0 } else { magnitude(size).div_euclid(3) * 3 }
}

/// The power of ten of the first digit; 0 for 0.
fn magnitude(size: f64) -> i32 {
    if size <= 0.0 || !size.is_finite() {
        return 0;
    }
    // Within the range of f64, the logarithm lies between -324 and 308.
    #[allow(clippy::cast_possible_truncation)]
    let exponent = size.log10().floor() as i32;
    exponent
}

/// The double next to the power of ten. `powi` is not the same on every machine.
fn ten_to(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::MAX)
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(low: f64, high: f64, count: f64) -> (Vec<String>, Option<String>) {
        let ticks = Ticks::new(Range { low, high }, count, '.');
        (ticks.marks.iter().map(|(_, label)| label.clone()).collect(), ticks.factor())
    }

    #[test]
    fn round_steps() {
        assert_eq!(written(0.0, 2000.0, 10.0).0.join(" "), "0 200 400 600 800 1000 1200 1400 1600 1800 2000");
        assert_eq!(written(-0.013, 0.021, 4.0).0.join(" "), "−0.01 0.00 0.01 0.02");
        assert_eq!(written(0.0, 0.3, 3.0).0.join(" "), "0.0 0.1 0.2 0.3");
        assert_eq!(written(89.96, 90.01, 5.0).0.join(" "), "89.96 89.97 89.98 89.99 90.00 90.01");
    }

    #[test]
    fn large_and_small_numbers_share_a_power() {
        let (labels, factor) = written(0.0, 2.5e6, 5.0);
        assert_eq!((labels.join(" ").as_str(), factor.as_deref()), ("0.0 0.5 1.0 1.5 2.0 2.5", Some("10⁶")));
        let (labels, factor) = written(0.0, 4e-5, 4.0);
        assert_eq!((labels.join(" ").as_str(), factor.as_deref()), ("0 10 20 30 40", Some("10⁻⁶")));
    }

    #[test]
    fn ranges() {
        let of = |values: &[f64]| Range::of(values.iter().copied());
        assert_eq!(of(&[]), Range { low: 0.0, high: 1.0 });
        assert_eq!(of(&[f64::NAN, 2.0, -1.0, f64::INFINITY]), Range { low: -1.0, high: 2.0 });
        assert_eq!(of(&[0.0, 0.0]), Range { low: -1.0, high: 1.0 });
        assert_eq!(of(&[10.0]), Range { low: 9.0, high: 11.0 });
        assert_eq!(of(&[1.0, 10.0]).roomy().low, 0.0);
        assert!(of(&[8.0, 10.0]).roomy().low > 7.0);
        assert!(of(&[0.0, 10.0]).roomy().low < 0.0, "a curve along 0 keeps off the frame");
    }

    #[test]
    fn rough_numbers() {
        assert_eq!(rough(-12.3456, '.'), "−12.35");
        assert_eq!(rough(0.0, '.'), "0.000");
        assert_eq!(rough(2.5e-9, ','), "2,50·10⁻⁹");
        assert_eq!(rough(1234.6, '.'), "1235");
    }

    proptest! {
        #[test]
        fn ticks_are_few_and_inside(a in proptest::num::f64::NORMAL | proptest::num::f64::ZERO, b in proptest::num::f64::NORMAL, count in 1.0..20.0) {
            let range = Range::of([a, b].into_iter());
            let ticks = Ticks::new(range, count, '.');
            let slack = 1e-6 * (range.high - range.low);
            prop_assert!(ticks.marks.len() <= 21, "{} ticks", ticks.marks.len());
            for (value, label) in &ticks.marks {
                prop_assert!(*value >= range.low - slack && *value <= range.high + slack);
                prop_assert!(label.chars().all(|c| c.is_ascii_digit() || c == '−' || c == '.'), "{}", label);
            }
            let scale = Scale::new(range, 10.0, 90.0);
            prop_assert!((10.0 - 1e-6..=90.0 + 1e-6).contains(&scale.at(a)));
        }
    }
}
