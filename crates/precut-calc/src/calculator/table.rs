//! Tables of an answer, by columns.

use std::borrow::Cow;

/// Columns of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Name for `?table=`.
    pub id: &'static str,
    /// Left to right.
    pub columns: Vec<Column>,
}

/// One column; CSV header `name [unit]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Field name without its unit's suffix: `diameter_error`.
    pub name: Cow<'static, str>,
    /// Unit as in the contract, `1` for numbers without, empty for words.
    pub unit: &'static str,
    /// The rows.
    pub cells: Cells,
}

/// The rows of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Numbers; `None` where there is none.
    Numbers(Vec<Option<f64>>),
    /// Words.
    Words(Vec<Cow<'static, str>>),
}

impl Column {
    /// A column of numbers that are all there.
    pub fn numbers(name: &'static str, unit: &'static str, cells: &[f64]) -> Self {
        Self { name: name.into(), unit, cells: Cells::Numbers(cells.iter().copied().map(Some).collect()) }
    }
    /// A column of numbers with gaps.
    pub fn optional(name: &'static str, unit: &'static str, cells: &[Option<f64>]) -> Self {
        Self { name: name.into(), unit, cells: Cells::Numbers(cells.to_vec()) }
    }
    /// A column of words.
    pub fn words(name: &'static str, cells: Vec<Cow<'static, str>>) -> Self {
        Self { name: name.into(), unit: "", cells: Cells::Words(cells) }
    }
}
