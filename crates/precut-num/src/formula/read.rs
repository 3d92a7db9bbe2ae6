//! From the text of a formula to its steps.

use thiserror::Error;

use super::unit::Unit;
use super::{Function, MOST_DEPTH, MOST_LETTERS, MOST_NODES, Node, Operator};

/// Why a formula is none.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Fault {
    /// More letters or steps than are read.
    #[error("the formula is too long")]
    TooLong,
    /// More brackets within brackets than are read.
    #[error("the formula is nested too deeply")]
    TooDeep,
    /// Something else was expected here.
    #[error("unexpected at letter {at}")]
    Unexpected {
        /// Letters before it.
        at: usize,
    },
    /// A name that is not known.
    #[error("{name} is not known")]
    UnknownName {
        /// The name.
        name: String,
        /// Letters before it.
        at: usize,
    },
    /// A unit that is not known.
    #[error("{unit} is no unit")]
    UnknownUnit {
        /// The unit.
        unit: String,
        /// Letters before it.
        at: usize,
    },
    /// Units that do not go together.
    #[error("{found} where {wanted} is needed")]
    Unit {
        /// The unit there.
        found: String,
        /// What it should be.
        wanted: String,
    },
}

/// The steps of a formula over these names.
pub(super) fn nodes(text: &str, names: &[&str]) -> Result<Vec<Node>, Fault> {
    if text.chars().count() > MOST_LETTERS {
        return Err(Fault::TooLong);
    }
    let letters: Vec<char> = text.chars().collect();
    let mut reader = Reader { letters: &letters, names, at: 0, depth: 0, nodes: Vec::new() };
    reader.sum()?;
    reader.skip();
    if reader.at < letters.len() {
        return Err(Fault::Unexpected { at: reader.at });
    }
    Ok(reader.nodes)
}

struct Reader<'a> {
    letters: &'a [char],
    names: &'a [&'a str],
    at: usize,
    depth: usize,
    nodes: Vec<Node>,
}

impl Reader<'_> {
    fn skip(&mut self) {
        while self.letters.get(self.at).is_some_and(|letter| letter.is_whitespace()) {
            self.at += 1;
        }
    }

    /// Passes one of these signs if it stands next.
    fn sign(&mut self, signs: &[char]) -> Option<char> {
        self.skip();
        let next = self.letters.get(self.at).copied().filter(|letter| signs.contains(letter))?;
        self.at += 1;
        Some(next)
    }

    fn expect(&mut self, sign: char) -> Result<(), Fault> {
        self.sign(&[sign]).map(|_| ()).ok_or(Fault::Unexpected { at: self.at })
    }

    fn put(&mut self, node: Node) -> Result<usize, Fault> {
        if self.nodes.len() == MOST_NODES {
            return Err(Fault::TooLong);
        }
        self.nodes.push(node);
        Ok(self.nodes.len() - 1)
    }

    /// What is read one level deeper.
    fn deeper(&mut self, read: impl FnOnce(&mut Self) -> Result<usize, Fault>) -> Result<usize, Fault> {
        if self.depth == MOST_DEPTH {
            return Err(Fault::TooDeep);
        }
        self.depth += 1;
        let found = read(self);
        self.depth -= 1;
        found
    }

    fn sum(&mut self) -> Result<usize, Fault> {
        let mut left = self.product()?;
        while let Some(sign) = self.sign(&['+', '-']) {
            let right = self.product()?;
            let operator = if sign == '+' { Operator::Plus } else { Operator::Less };
            left = self.put(Node::Both(operator, left, right))?;
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<usize, Fault> {
        let mut left = self.signed()?;
        while let Some(sign) = self.sign(&['*', '/']) {
            let right = self.signed()?;
            let operator = if sign == '*' { Operator::Times } else { Operator::Over };
            left = self.put(Node::Both(operator, left, right))?;
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<usize, Fault> {
        if self.sign(&['-']).is_some() {
            let of = self.deeper(Self::signed)?;
            return self.put(Node::Of(Function::Minus, of));
        }
        let base = self.atom()?;
        if self.sign(&['^']).is_none() {
            return Ok(base);
        }
        let exponent = self.deeper(Self::signed)?;
        self.put(Node::Both(Operator::Power, base, exponent))
    }

    fn atom(&mut self) -> Result<usize, Fault> {
        self.skip();
        match self.letters.get(self.at) {
            Some('(') => {
                self.at += 1;
                let inner = self.deeper(Self::sum)?;
                self.expect(')')?;
                Ok(inner)
            }
            Some(letter) if letter.is_ascii_digit() || *letter == '.' => self.number(),
            Some(letter) if letter.is_ascii_alphabetic() => self.name(),
            _ => Err(Fault::Unexpected { at: self.at }),
        }
    }

    /// Letters from here on that go on so.
    fn run(&self, goes_on: impl Fn(usize, char) -> bool) -> String {
        let rest = self.letters[self.at..].iter().enumerate();
        rest.take_while(|(k, letter)| goes_on(self.at + k, **letter)).map(|(_, letter)| *letter).collect()
    }

    fn number(&mut self) -> Result<usize, Fault> {
        let start = self.at;
        let text = self.run(|at, letter| {
            let follows = |signs: &[char]| at > start && signs.contains(&self.letters[at - 1]);
            letter.is_ascii_digit()
                || letter == '.'
                || matches!(letter, 'e' | 'E')
                || (matches!(letter, '+' | '-') && follows(&['e', 'E']))
        });
        let value: f64 = text.parse().map_err(|_| Fault::Unexpected { at: start })?;
        self.at += text.chars().count();
        let unit = self.unit()?;
        self.put(Node::Number(value * unit.factor, unit.dimension))
    }

    /// A unit in brackets, if one stands next.
    fn unit(&mut self) -> Result<Unit, Fault> {
        if self.letters.get(self.at) != Some(&'[') {
            return Ok(Unit::ONE);
        }
        let at = self.at;
        self.at += 1;
        let text = self.run(|_, letter| letter != ']');
        self.at += text.chars().count();
        self.expect(']')?;
        Unit::read(&text).ok_or(Fault::UnknownUnit { unit: text, at })
    }

    fn name(&mut self) -> Result<usize, Fault> {
        let at = self.at;
        let text = self.run(|_, letter| letter.is_ascii_alphanumeric() || letter == '_');
        self.at += text.len();
        if let Some(name) = self.names.iter().position(|known| *known == text) {
            return self.put(Node::Name(name));
        }
        let of_one = Function::NAMED.iter().find(|(known, _)| *known == text);
        let of_two = Operator::NAMED.iter().find(|(known, _)| *known == text);
        match (of_one, of_two) {
            (Some((_, function)), _) => {
                self.expect('(')?;
                let of = self.deeper(Self::sum)?;
                self.expect(')')?;
                self.put(Node::Of(*function, of))
            }
            (_, Some((_, operator))) => {
                self.expect('(')?;
                let first = self.deeper(Self::sum)?;
                self.expect(',')?;
                let second = self.deeper(Self::sum)?;
                self.expect(')')?;
                self.put(Node::Both(*operator, first, second))
            }
            _ => Err(Fault::UnknownName { name: text, at }),
        }
    }
}
