//! From numbers to places on the page, and the ticks between.

use precut_calc::calculator::Spacing;

use super::unit::superscript;

/// Beyond this, places are drawn at the edge: sums and differences must stay finite.
const LARGEST: f64 = 1e300;

/// Spans below this share of the numbers themselves are noise of the last digits, not a shape.
const NOISE: f64 = 1e-9;

/// Where a number stands on its axis: itself, or its decimal logarithm; `None` for what has no place there.
pub(super) fn coordinate(spacing: Spacing, value: f64) -> Option<f64> {
    match spacing {
        Spacing::Linear => value.is_finite().then(|| bounded(value)),
        Spacing::Logarithmic => (value.is_finite() && value > 0.0).then(|| value.log10()),
    }
}

/// An interval of coordinates, never empty, both ends finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Range {
    /// What all values span that have a place on the axis; widened where that is a point, 0 to 1 where
    /// there are none.
    pub(super) fn of(spacing: Spacing, values: impl Iterator<Item = f64>) -> Self {
        Self::spanning(values.filter_map(|value| coordinate(spacing, value)))
    }

    /// What all coordinates span, widened likewise.
    pub(super) fn spanning(coordinates: impl IntoIterator<Item = f64>) -> Self {
        let finite = coordinates.into_iter().filter(|at| at.is_finite()).map(bounded);
        let range = finite.fold(None, |range, value| match range {
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
    pub(super) fn roomy(self, spacing: Spacing) -> Self {
        let Self { low, high } = self;
        let room = 0.06 * (high - low);
        if spacing == Spacing::Logarithmic {
            return Self { low: low - room, high: high + room };
        }
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

/// From numbers to pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    spacing: Spacing,
    range: Range,
    from_px: f64,
    to_px: f64,
}

impl Scale {
    pub(super) fn new(spacing: Spacing, range: Range, from_px: f64, to_px: f64) -> Self {
        Self { spacing, range, from_px, to_px }
    }

    /// Where a number lies, if it has a place on the axis.
    pub(super) fn at(&self, value: f64) -> Option<f64> {
        coordinate(self.spacing, value).map(|coordinate| self.px(coordinate))
    }

    /// Where a coordinate lies.
    pub(super) fn px(&self, coordinate: f64) -> f64 {
        let Range { low, high } = self.range;
        self.from_px + (coordinate - low) / (high - low) * (self.to_px - self.from_px)
    }

    /// Where bars stand: at zero if the axis has one, else at its lower end; never off the axis.
    pub(super) fn foot(&self) -> f64 {
        let Range { low, high } = self.range;
        self.px(coordinate(self.spacing, 0.0).map_or(low, |zero| zero.clamp(low, high)))
    }
}

/// Round numbers on an axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    /// Their coordinates and how they are written.
    pub(super) marks: Vec<(f64, String)>,
    /// Coordinates of finer lines without numbers.
    pub(super) minor: Vec<f64>,
    /// The written numbers stand for 10 to this power.
    pub(super) power: i32,
    /// From one to the next, where the steps are equal.
    pub(super) step: Option<f64>,
}

impl Ticks {
    /// About `count` of them.
    pub(super) fn new(spacing: Spacing, range: Range, count: f64, decimal: char) -> Self {
        match spacing {
            Spacing::Linear => Self::even(range, count, decimal),
            Spacing::Logarithmic => Self::decades(range, count, decimal),
        }
    }

    /// At steps of 1, 2 or 5 times a power of ten.
    fn even(range: Range, count: f64, decimal: char) -> Self {
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
        Self { marks, minor: Vec::new(), power, step: Some(unit) }
    }

    /// At powers of ten, with finer lines between; over few of them also at twice and five times a power,
    /// and within less than one at even steps.
    fn decades(range: Range, count: f64, decimal: char) -> Self {
        let (low, high) = (range.low, range.high);
        let slack = 1e-9 * (high - low);
        let inside = |at: &f64| *at >= low - slack && *at <= high + slack;
        if high - low < 1.0 {
            let even = Self::even(Range { low: power_of_ten(low), high: power_of_ten(high) }, count, decimal);
            let marks = even.marks.into_iter().filter(|(value, _)| *value > 0.0);
            let marks = marks.map(|(value, label)| (value.log10(), label)).filter(|(at, _)| inside(at)).collect();
            return Self { marks, minor: Vec::new(), power: even.power, step: None };
        }
        let every = ((high - low) / count.max(1.0)).ceil().max(1.0);
        let first = ((low - slack) / every).floor();
        // Coordinates lie between -324 and 308.
        let powers: Vec<f64> =
            (0_u16..700).map(|k| (first + f64::from(k)) * every).take_while(|at| *at <= high + slack).collect();
        let digits: &[f64] = match every {
            e if e > 1.0 => &[1.0],
            _ if 3.0 * (high - low) <= count => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let marks = powers
            .iter()
            .flat_map(|power| digits.iter().map(move |digit| (power + digit.log10(), *digit, *power)))
            .filter(|(at, ..)| inside(at))
            .map(|(at, digit, power)| (at, power_label(digit, power, decimal)))
            .collect();
        let finer = if every > 1.0 { 0.0..0.0 } else { 2.0..10.0 };
        let minor = powers
            .iter()
            .flat_map(|power| (2_u8..10).map(f64::from).map(move |digit| (digit, power + digit.log10())))
            .filter(|(digit, at)| finer.contains(digit) && !digits.contains(digit) && inside(at))
            .map(|(_, at)| at)
            .collect();
        Self { marks, minor, power: 0, step: None }
    }

    /// `10⁻³` before the unit of the axis, where the numbers are written so.
    pub(super) fn factor(&self) -> Option<String> {
        (self.power != 0).then(|| format!("10{}", self.power.to_string().chars().map(superscript).collect::<String>()))
    }
}

/// `2·10⁻⁶`, or plainly where that is short; `power` is whole.
fn power_label(digit: f64, power: f64, decimal: char) -> String {
    if (-3.0..5.0).contains(&power) {
        // Within a few decades the product is next to the round number, and rounds to it.
        return label(digit * power_of_ten(power), usize::from(power < 0.0) * count_of(-power), decimal);
    }
    let raised: String = label(power, 0, decimal).chars().map(superscript).collect();
    if digit > 1.0 { format!("{digit}·10{raised}") } else { format!("10{raised}") }
}

fn count_of(decimals: f64) -> usize {
    (0..20_u8).find(|n| f64::from(*n) >= decimals).map_or(20, usize::from)
}

/// Ten to a coordinate of a logarithmic axis.
pub(super) fn power_of_ten(coordinate: f64) -> f64 {
    10_f64.powf(coordinate)
}

/// A round number as it is, without zeros at its end.
pub(super) fn round_number(value: f64, decimal: char) -> String {
    let text = rough(value, decimal);
    let (digits, power) = text.split_at(text.find('·').unwrap_or(text.len()));
    let short = if digits.contains(decimal) { digits.trim_end_matches('0').trim_end_matches(decimal) } else { digits };
    format!("{short}{power}")
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
        let ticks = Ticks::new(Spacing::Linear, Range { low, high }, count, '.');
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
        let of = |values: &[f64]| Range::of(Spacing::Linear, values.iter().copied());
        assert_eq!(of(&[]), Range { low: 0.0, high: 1.0 });
        assert_eq!(of(&[f64::NAN, 2.0, -1.0, f64::INFINITY]), Range { low: -1.0, high: 2.0 });
        assert_eq!(of(&[0.0, 0.0]), Range { low: -1.0, high: 1.0 });
        assert_eq!(of(&[10.0]), Range { low: 9.0, high: 11.0 });
        assert_eq!(of(&[1.0, 10.0]).roomy(Spacing::Linear).low, 0.0);
        assert!(of(&[8.0, 10.0]).roomy(Spacing::Linear).low > 7.0);
        assert!(of(&[0.0, 10.0]).roomy(Spacing::Linear).low < 0.0, "a curve along 0 keeps off the frame");
    }

    #[test]
    fn rough_numbers() {
        assert_eq!(rough(-12.3456, '.'), "−12.35");
        assert_eq!(rough(0.0, '.'), "0.000");
        assert_eq!(rough(2.5e-9, ','), "2,50·10⁻⁹");
        assert_eq!(rough(1234.6, '.'), "1235");
        for (value, text) in [(5.0, "5"), (0.05, "0,05"), (200.0, "200"), (2e-9, "2·10⁻⁹"), (0.0, "0")] {
            assert_eq!(round_number(value, ','), text);
        }
    }

    fn written_by_decades(low: f64, high: f64, count: f64) -> (String, usize) {
        let range = Range::of(Spacing::Logarithmic, [low, high].into_iter());
        let ticks = Ticks::new(Spacing::Logarithmic, range, count, '.');
        let labels: Vec<_> = ticks.marks.into_iter().map(|(_, label)| label).collect();
        (labels.join(" "), ticks.minor.len())
    }

    #[test]
    fn decades() {
        assert_eq!(written_by_decades(1e-3, 1e3, 8.0), ("0.001 0.01 0.1 1 10 100 1000".to_owned(), 48));
        assert_eq!(written_by_decades(1.0, 100.0, 8.0), ("1 2 5 10 20 50 100".to_owned(), 12));
        assert_eq!(written_by_decades(1e-7, 1e-4, 5.0).0, "10⁻⁷ 10⁻⁶ 10⁻⁵ 10⁻⁴");
        assert_eq!(written_by_decades(2e4, 6e5, 8.0).0, "20000 50000 10⁵ 2·10⁵ 5·10⁵");
        assert_eq!(written_by_decades(1e-12, 1e12, 6.0).0, "10⁻¹² 10⁻⁸ 10⁻⁴ 1 10000 10⁸ 10¹²");
        assert_eq!(written_by_decades(0.3, 0.7, 4.0), ("0.3 0.4 0.5 0.6 0.7".to_owned(), 0), "less than a decade");
    }

    #[test]
    fn what_is_not_positive_has_no_place_on_a_logarithmic_axis() {
        let range = Range::of(Spacing::Logarithmic, [0.0, -5.0, f64::NAN, 1.0, 100.0].into_iter());
        assert_eq!(range, Range { low: 0.0, high: 2.0 });
        let scale = Scale::new(Spacing::Logarithmic, range, 0.0, 50.0);
        assert_eq!((scale.at(10.0), scale.at(0.0), scale.at(-1.0)), (Some(25.0), None, None));
        assert_eq!(scale.foot(), 0.0);
    }

    proptest! {
        #[test]
        fn decades_are_few_and_inside(a in proptest::num::f64::ANY, b in proptest::num::f64::ANY, count in 1.0..20.0) {
            let range = Range::of(Spacing::Logarithmic, [a, b].into_iter());
            let ticks = Ticks::new(Spacing::Logarithmic, range, count, '.');
            let slack = 1e-6 * (range.high - range.low);
            prop_assert!(ticks.marks.len() <= 42 && ticks.minor.len() <= 200);
            for at in ticks.marks.iter().map(|(at, _)| at).chain(&ticks.minor) {
                prop_assert!(*at >= range.low - slack && *at <= range.high + slack);
            }
        }

        #[test]
        fn ticks_are_few_and_inside(a in proptest::num::f64::NORMAL | proptest::num::f64::ZERO, b in proptest::num::f64::NORMAL, count in 1.0..20.0) {
            let range = Range::of(Spacing::Linear, [a, b].into_iter());
            let ticks = Ticks::new(Spacing::Linear, range, count, '.');
            let slack = 1e-6 * (range.high - range.low);
            prop_assert!(ticks.marks.len() <= 21, "{} ticks", ticks.marks.len());
            for (value, label) in &ticks.marks {
                prop_assert!(*value >= range.low - slack && *value <= range.high + slack);
                prop_assert!(label.chars().all(|c| c.is_ascii_digit() || c == '−' || c == '.'), "{}", label);
            }
            let scale = Scale::new(Spacing::Linear, range, 10.0, 90.0);
            prop_assert!((10.0 - 1e-6..=90.0 + 1e-6).contains(&scale.at(a).expect("finite")));
        }
    }
}
