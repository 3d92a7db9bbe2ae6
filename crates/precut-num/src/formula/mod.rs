//! Formulas that a user writes: read once within bounds, their units checked, evaluated with their slopes.
//!
//! ```text
//! sum     = product {("+" | "-") product}          product = signed {("*" | "/") signed}
//! signed  = "-" signed | power                      power   = atom ["^" signed]
//! atom    = number ["[" unit "]"] | name | function "(" sum {"," sum} ")" | "(" sum ")"
//! unit    = one {("*" | "/") one}                   one     = ("1" | name) ["^" whole]
//! ```
//!
//! All is computed in mm, min, N, K and rad, whatever units it was written in, so that a sum of um and mm is right. Every reading and
//! every evaluation ends: text, nodes and depth have their most, and there is no loop and no name that stands for a formula.

mod read;
mod unit;

pub use read::Fault;
pub use unit::Unit;

use unit::Dimension;

/// Letters of a formula at most.
pub const MOST_LETTERS: usize = 256;
/// Numbers, names, signs and functions in it at most.
pub const MOST_NODES: usize = 96;
/// Brackets within brackets at most.
pub const MOST_DEPTH: usize = 24;

/// Directions along which slopes are told.
pub const DIRECTIONS: usize = 2;

/// A formula that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    /// Each refers to those before it; the last is the value.
    nodes: Vec<Node>,
}

/// A step of a formula.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Node {
    Number(f64, Dimension),
    Name(usize),
    Of(Function, usize),
    Both(Operator, usize, usize),
}

/// A function of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Function {
    Minus,
    Exp,
    Ln,
    Sqrt,
    Abs,
    Sin,
    Cos,
    Tanh,
}

/// What makes one of two.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Operator {
    Plus,
    Less,
    Times,
    Over,
    Power,
    Least,
    Most,
}

/// A value with its slopes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// Its slopes.
    pub slopes: [f64; DIRECTIONS],
}

impl Dual {
    /// What goes with no direction.
    pub const fn fixed(value: f64) -> Self {
        Self { value, slopes: [0.0; DIRECTIONS] }
    }

    /// Another value, and by how much it goes with this one.
    fn through(self, value: f64, slope: f64) -> Self {
        // What does not move has no slope even where the function is vertical.
        Self { value, slopes: self.slopes.map(|own| if own.abs() <= 0.0 { 0.0 } else { slope * own }) }
    }

    fn with(self, other: Self, value: f64, [of_self, of_other]: [f64; 2]) -> Self {
        let (a, b) = (self.through(0.0, of_self), other.through(0.0, of_other));
        Self { value, slopes: std::array::from_fn(|k| a.slopes[k] + b.slopes[k]) }
    }
}

impl Formula {
    /// Reads a formula over names with their units, whose value is to be in a unit.
    pub fn read(text: &str, names: &[(&str, Unit)], wanted: Unit) -> Result<Self, Fault> {
        let of_names: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        let nodes = read::nodes(text, &of_names)?;
        let formula = Self { nodes };
        let found = formula.dimension(names)?;
        if found == wanted.dimension {
            Ok(formula)
        } else {
            Err(Fault::Unit { found: found.said(), wanted: wanted.dimension.said() })
        }
    }

    /// Which of the names it uses.
    pub fn uses(&self, name: usize) -> bool {
        self.nodes.contains(&Node::Name(name))
    }

    /// Its value, of values of the names in mm, min, N, K and rad; not finite where it has none.
    pub fn value(&self, names: &[Dual]) -> Dual {
        let mut found = [Dual::fixed(0.0); MOST_NODES];
        let mut last = Dual::fixed(f64::NAN);
        for (index, node) in self.nodes.iter().enumerate().take(MOST_NODES) {
            last = match *node {
                Node::Number(value, _) => Dual::fixed(value),
                Node::Name(name) => names.get(name).copied().unwrap_or(Dual::fixed(f64::NAN)),
                Node::Of(function, of) => function.value(found[of]),
                Node::Both(operator, a, b) => operator.value(found[a], found[b]),
            };
            found[index] = last;
        }
        last
    }

    fn dimension(&self, names: &[(&str, Unit)]) -> Result<Dimension, Fault> {
        let mut found: Vec<Dimension> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let own = match *node {
                Node::Number(_, dimension) => dimension,
                Node::Name(name) => names[name].1.dimension,
                Node::Of(function, of) => function.dimension(found[of])?,
                Node::Both(Operator::Power, a, b) => self.of_power(found[a], found[b], b)?,
                Node::Both(operator, a, b) => operator.dimension(found[a], found[b])?,
            };
            found.push(own);
        }
        Ok(found.last().copied().unwrap_or(Dimension::NONE))
    }

    /// A power of something with a unit has one only where the exponent is a number.
    fn of_power(&self, base: Dimension, exponent: Dimension, of: usize) -> Result<Dimension, Fault> {
        if exponent != Dimension::NONE {
            return Err(Fault::Unit { found: exponent.said(), wanted: Dimension::NONE.said() });
        }
        if base == Dimension::NONE {
            return Ok(base);
        }
        match self.constant(of) {
            Some(exponent) => Ok(base.power(exponent)),
            None => Err(Fault::Unit { found: base.said(), wanted: Dimension::NONE.said() }),
        }
    }

    fn constant(&self, of: usize) -> Option<f64> {
        match self.nodes[of] {
            Node::Number(value, _) => Some(value),
            Node::Of(Function::Minus, of) => self.constant(of).map(|value| -value),
            _ => None,
        }
    }
}

impl Function {
    const NAMED: [(&'static str, Self); 7] = [
        ("exp", Self::Exp),
        ("ln", Self::Ln),
        ("sqrt", Self::Sqrt),
        ("abs", Self::Abs),
        ("sin", Self::Sin),
        ("cos", Self::Cos),
        ("tanh", Self::Tanh),
    ];

    fn dimension(self, of: Dimension) -> Result<Dimension, Fault> {
        match self {
            Self::Minus | Self::Abs => Ok(of),
            Self::Sqrt => Ok(of.power(0.5)),
            _ if of == Dimension::NONE => Ok(of),
            _ => Err(Fault::Unit { found: of.said(), wanted: Dimension::NONE.said() }),
        }
    }

    fn value(self, of: Dual) -> Dual {
        let x = of.value;
        let (value, slope) = match self {
            Self::Minus => (-x, -1.0),
            Self::Exp => (x.exp(), x.exp()),
            Self::Ln => (x.ln(), 1.0 / x),
            Self::Sqrt => (x.sqrt(), 0.5 / x.sqrt()),
            Self::Abs => (x.abs(), x.signum()),
            Self::Sin => (x.sin(), x.cos()),
            Self::Cos => (x.cos(), -x.sin()),
            Self::Tanh => (x.tanh(), 1.0 - x.tanh().powi(2)),
        };
        of.through(value, slope)
    }
}

impl Operator {
    /// Functions of two numbers.
    const NAMED: [(&'static str, Self); 2] = [("min", Self::Least), ("max", Self::Most)];

    fn dimension(self, a: Dimension, b: Dimension) -> Result<Dimension, Fault> {
        match self {
            Self::Times => Ok(a.times(b, 1.0)),
            Self::Over => Ok(a.times(b, -1.0)),
            _ if a == b => Ok(a),
            _ => Err(Fault::Unit { found: b.said(), wanted: a.said() }),
        }
    }

    fn value(self, a: Dual, b: Dual) -> Dual {
        let (x, y) = (a.value, b.value);
        match self {
            Self::Plus => a.with(b, x + y, [1.0, 1.0]),
            Self::Less => a.with(b, x - y, [1.0, -1.0]),
            Self::Times => a.with(b, x * y, [y, x]),
            Self::Over => a.with(b, x / y, [1.0 / y, -x / (y * y)]),
            Self::Power => a.with(b, x.powf(y), [y * x.powf(y - 1.0), x.powf(y) * x.ln()]),
            // What is no number is not hidden by one that is.
            Self::Least | Self::Most if x.is_nan() || y.is_nan() => Dual::fixed(f64::NAN),
            Self::Least => {
                if x <= y {
                    a
                } else {
                    b
                }
            }
            Self::Most => {
                if x >= y {
                    a
                } else {
                    b
                }
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod tests {
    use super::*;

    fn unit(text: &str) -> Unit {
        Unit::read(text).unwrap()
    }

    fn names() -> Vec<(&'static str, Unit)> {
        vec![("v", unit("m/min")), ("t", unit("mm")), ("a", unit("1"))]
    }

    /// Of v = 50 m/min with its slope first, t = 2 mm with its slope second, and a = 0.5.
    fn value(text: &str, wanted: &str) -> Dual {
        let formula = Formula::read(text, &names(), unit(wanted)).unwrap();
        let v = Dual { value: 50.0 * unit("m/min").factor, slopes: [1.0, 0.0] };
        formula.value(&[v, Dual { value: 2.0, slopes: [0.0, 1.0] }, Dual::fixed(0.5)])
    }

    #[test]
    fn values_are_those_of_the_arithmetic_they_say() {
        for (text, expected) in [
            ("1 + 2*3 - 4/2", 5.0),
            ("-2^2", -4.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("(1 + 2)*3", 9.0),
            ("8/4/2", 1.0),
            ("1.5e-3*2E3", 3.0),
            ("a*ln(v/25[m/min])", 0.5 * 2.0_f64.ln()),
            ("min(t, 500[um])/1[mm] + max(1, 2)", 2.5),
            ("exp(-((v - 50000[mm/min])/10[m/min])^2)", 1.0),
            ("sqrt(t^2)/1[mm] + abs(-3) + tanh(0) + cos(0) + sin(90[deg])", 2.0 + 3.0 + 0.0 + 1.0 + 1.0),
        ] {
            assert!((value(text, "1").value - expected).abs() < 1e-12, "{text}: {:?}", value(text, "1"));
        }
        // In which unit it was written does not matter.
        assert!((value("3[um]*t/1000[um]", "um").value - 0.006).abs() < 1e-15);
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let text = "a*tanh(ln(v/20[m/min]))*sqrt(t/1[mm]) - exp(-t/3[mm])*sin(v/100[m/min]) + (t/1[mm])^1.7/cos(a) \
                    + abs(t - 3[mm])/1[mm] + min(t, 1[m])*v/1[mm*mm/min]/1e6";
        let formula = Formula::read(text, &names(), unit("1")).unwrap();
        let at = |v: f64, t: f64| {
            formula.value(&[
                Dual { value: v, slopes: [1.0, 0.0] },
                Dual { value: t, slopes: [0.0, 1.0] },
                Dual::fixed(0.5),
            ])
        };
        let own = at(5e4, 2.0);
        for (k, (v, t)) in [(1.0, 0.0), (0.0, 1e-5)].into_iter().enumerate() {
            let slope = (at(5e4 + v, 2.0 + t).value - at(5e4 - v, 2.0 - t).value) / (2.0 * (v + t));
            assert!((own.slopes[k] / slope - 1.0).abs() < 1e-6, "{k} {own:?} {slope}");
        }
    }

    #[test]
    fn what_has_no_value_is_not_finite_and_nothing_panics() {
        for text in ["ln(a - 1)", "1/(a - a)", "sqrt(-a)", "(-a)^0.3", "exp(1e6)", "max(1, ln(-1))", "0/0"] {
            assert!(!value(text, "1").value.is_finite(), "{text}");
        }
    }

    #[test]
    fn units_are_checked() {
        let fault = |text: &str, wanted: &str| Formula::read(text, &names(), unit(wanted)).unwrap_err();
        for (text, wanted, expected) in [
            ("v + t", "1", ("mm", "mm/min")),
            ("ln(v)", "1", ("mm/min", "1")),
            ("t^a", "1", ("mm", "1")),
            ("a^t", "1", ("mm", "1")),
            ("t", "1", ("mm", "1")),
            ("a", "um", ("1", "mm")),
            ("t*t/v", "mm", ("mm*min", "mm")),
            ("sqrt(t)", "mm", ("mm^0.5", "mm")),
            ("2[N]/t^2", "1", ("N/mm^2", "1")),
        ] {
            let Fault::Unit { found, wanted } = fault(text, wanted) else { panic!("{text}") };
            assert_eq!((found.as_str(), wanted.as_str()), expected, "{text}");
        }
    }

    #[test]
    fn what_cannot_be_read_says_where() {
        let fault = |text: &str| Formula::read(text, &names(), unit("1")).unwrap_err();
        for (text, at) in [
            ("1 + ", 4),
            ("1 + * 2", 4),
            ("(1", 2),
            ("1)", 1),
            ("min(1)", 5),
            ("2 3", 2),
            ("a $ 1", 2),
            ("", 0),
            ("1e", 0),
        ] {
            assert_eq!(fault(text), Fault::Unexpected { at }, "{text}");
        }
        assert_eq!(fault("a*w"), Fault::UnknownName { name: "w".to_owned(), at: 2 });
        assert_eq!(fault("sinh(a)"), Fault::UnknownName { name: "sinh".to_owned(), at: 0 });
        assert_eq!(fault("1[furlong]"), Fault::UnknownUnit { unit: "furlong".to_owned(), at: 1 });
        assert_eq!(fault(&"1+".repeat(200)), Fault::TooLong);
        assert_eq!(fault(&format!("{}1", "1+".repeat(60))), Fault::TooLong);
        assert_eq!(fault(&format!("{}1{}", "(".repeat(40), ")".repeat(40))), Fault::TooDeep);
        assert_eq!(fault(&format!("{}1", "-".repeat(40))), Fault::TooDeep);
        assert_eq!(fault("1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1^1"), Fault::TooDeep);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod properties {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever stands there is read or refused, and what was read is computed.
        #[test]
        fn no_text_panics(text in "[-+*/^(),.\\[\\]0-9ae tvlnsqrtminx]{0,60}") {
            let length = Unit::read("mm").unwrap();
            let names = [("v", length), ("t", length), ("a", Unit::ONE)];
            if let Ok(formula) = Formula::read(&text, &names, Unit::ONE) {
                let _ = formula.value(&[Dual::fixed(1.0), Dual::fixed(0.0), Dual::fixed(-1.0)]);
            }
        }
    }
}
