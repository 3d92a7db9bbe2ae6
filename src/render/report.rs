//! What an answer says, ready to be set as pages or laid out on sheets: words in the reader's language, numbers as
//! numbers.

use precut_calc::calculator::Table;

/// An answer with everything that belongs on its paper.
#[derive(Debug, Clone)]
pub struct Report {
    /// `en`, `ru`.
    pub language: &'static str,
    /// Between whole and decimals: `.` or `,`.
    pub decimal: char,
    /// What the calculator is called.
    pub title: String,
    /// What it answers.
    pub question: String,
    /// What tells this job from others.
    pub subject: String,
    /// The answer in words, most important first; the first is the verdict.
    pub remarks: Vec<String>,
    /// What the answer warns of.
    pub warnings: Vec<String>,
    /// Single numbers and words of the result.
    pub results: Vec<Field>,
    /// The job with every default filled in.
    pub inputs: Vec<Field>,
    /// Pictures, the main one first.
    pub pictures: Vec<Picture>,
    /// Tables, the main one first.
    pub tables: Vec<Sheet>,
    /// The equations that acted.
    pub equations: Vec<Equation>,
    /// Where the formulas come from.
    pub references: Vec<String>,
    /// What made the answer: name and value. The last is its key.
    pub origin: Vec<(String, String)>,
    /// The same in one line.
    pub signature: String,
    /// The paper's own words.
    pub headings: Headings,
}

/// What the parts of the paper are called.
#[derive(Debug, Clone)]
pub struct Headings {
    /// The answer in words.
    pub answer: String,
    /// Warnings.
    pub warnings: String,
    /// Single numbers of the result.
    pub results: String,
    /// The job.
    pub inputs: String,
    /// Tables.
    pub tables: String,
    /// Equations and their sources.
    pub equations: String,
    /// Literature.
    pub references: String,
    /// What made the answer.
    pub origin: String,
    /// Above groups, fields, their values, units and places in the contract.
    pub columns: [String; 5],
}

/// What is said with counts.
#[derive(Debug, Clone, Copy)]
pub enum Counted {
    /// So many evenly chosen ones of so many rows stand here.
    EvenRows(usize, usize),
    /// So many of so many rows stand here, from the first on.
    FirstRows(usize, usize),
    /// So many of so many values stand here.
    Fields(usize, usize),
    /// Number of a page, and how many there are.
    Page(usize, usize),
}

/// The caller's words for what is said with counts.
pub type Counts<'a> = &'a dyn Fn(Counted) -> String;

/// One number or word of a job or a result.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its place in the contract, from name to name; items of lists are numbers from 0.
    pub way: Vec<String>,
    /// What stands around it.
    pub group: String,
    /// What it is called.
    pub label: String,
    /// What it is.
    pub value: Datum,
    /// With how many digits it is read.
    pub digits: usize,
    /// Printed unit; empty for words and bare numbers.
    pub unit: String,
}

impl Field {
    /// Its place as a JSON Pointer.
    pub fn pointer(&self) -> String {
        self.way
            .iter()
            .fold(String::new(), |pointer, step| format!("{pointer}/{}", step.replace('~', "~0").replace('/', "~1")))
    }
}

/// A value.
#[derive(Debug, Clone, PartialEq)]
pub enum Datum {
    /// A number.
    Number(f64),
    /// Words.
    Word(String),
}

/// A figure as it is drawn.
#[derive(Debug, Clone)]
pub struct Picture {
    /// The drawing.
    pub svg: String,
    /// What can be seen, for those who cannot.
    pub description: String,
}

/// A table with the words of its head.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// What it is called.
    pub title: String,
    /// Names and units of its columns as they are printed.
    pub heads: Vec<(String, String)>,
    /// Its columns, their words in the reader's language.
    pub table: Table,
}

/// An equation that acted.
#[derive(Debug, Clone)]
pub struct Equation {
    /// Its number in the documentation.
    pub number: String,
    /// What it says, line by line; nothing where it is no formula.
    pub formula: Vec<String>,
    /// Where it comes from.
    pub source: String,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use precut_calc::calculator::Column;

    pub(in crate::render) fn sheet(columns: Vec<Column>) -> Sheet {
        let heads = columns.iter().map(|column| (column.name.to_string(), column.unit.to_owned())).collect();
        Sheet { title: "Table".to_owned(), heads, table: Table { id: "table", columns } }
    }

    pub(in crate::render) fn field(way: &[&str], group: &str, value: Datum) -> Field {
        Field {
            way: way.iter().map(|step| (*step).to_owned()).collect(),
            group: group.to_owned(),
            label: way.last().map_or(String::new(), |step| (*step).to_owned()),
            value,
            digits: 5,
            unit: "mm".to_owned(),
        }
    }

    pub(in crate::render) fn report(tables: Vec<Sheet>) -> Report {
        let words = |text: &str| text.to_owned();
        Report {
            language: "en",
            decimal: '.',
            title: words("Toy"),
            question: words("How far does it bend?"),
            subject: words("length 3 mm"),
            remarks: vec![words("It bends."), words("It does so everywhere.")],
            warnings: vec![words("it is a toy")],
            results: vec![field(&["sag_mm"], "", Datum::Number(0.25))],
            inputs: vec![field(&["bar", "length_mm"], "Bar", Datum::Number(3.0))],
            pictures: Vec::new(),
            tables,
            equations: vec![Equation {
                number: words("toy/1"), formula: vec![words("y = x²")], source: words("none")
            }],
            references: vec![words("A book")],
            origin: vec![(words("key"), words("b3:00"))],
            signature: words("precut 0 toy 1 b3:00"),
            headings: Headings {
                answer: words("Answer"),
                warnings: words("Warnings"),
                results: words("Results"),
                inputs: words("Inputs"),
                tables: words("Tables"),
                equations: words("Equations"),
                references: words("Literature"),
                origin: words("Origin"),
                columns: ["group", "field", "value", "unit", "place"].map(words),
            },
        }
    }
}
