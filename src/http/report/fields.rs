//! Single values of a job or a result with what they are called, by their schema.

use serde_json::Value;

use super::own;
use super::tree::Tree;
use super::vocabulary::Vocabulary;
use crate::registry::forms;
use crate::render::{Datum, Field};
use crate::text::{Glossary, Language, capitalised, spoken_number};

/// Between the names of what stands around a field.
const JOINT: &str = " · ";
/// Values of a list that stand in one field.
const MOST_VALUES: usize = 40;

/// Digits with which a number is read, and an error of one.
const DIGITS: usize = 5;
const ERROR_DIGITS: usize = 2;

/// What becomes of lists, and of what only experts ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lists {
    /// Every item is told.
    Told,
    /// They have tables of their own.
    LeftOut,
}

/// A schema whose values are told.
pub(super) struct Fields<'d> {
    document: &'d Value,
    root: &'d str,
    language: Language,
    glossary: &'static Glossary,
    vocabulary: &'d Vocabulary,
    lists: Lists,
}

/// What a value may be: its schemas, each with the name of its type.
type Forms<'d> = Vec<(&'d Value, &'d str)>;

/// Where in the tree a value stands.
#[derive(Clone)]
struct Place<'t> {
    way: Vec<String>,
    names: Vec<String>,
    /// The objects around it, the nearest first.
    around: Vec<&'t Tree>,
}

impl<'d> Fields<'d> {
    pub(super) fn of(
        document: &'d Value,
        root: &'d str,
        (language, vocabulary): (Language, &'d Vocabulary),
        lists: Lists,
    ) -> Self {
        Self { document, root, language, glossary: Glossary::of(language), vocabulary, lists }
    }

    /// Every value of the tree.
    pub(super) fn all(&self, tree: &Tree) -> Vec<Field> {
        let mut found = Vec::new();
        let forms = forms(self.document, self.document, self.root, 0);
        let place = Place { way: Vec::new(), names: Vec::new(), around: Vec::new() };
        self.walk(&forms, tree, &place, &mut found);
        found
    }

    fn walk(&self, forms: &Forms<'d>, tree: &Tree, place: &Place<'_>, found: &mut Vec<Field>) {
        let is = |mark: &str| forms.iter().any(|(form, _)| form[mark] == true);
        if self.lists == Lists::LeftOut && is("x-advanced") {
            return;
        }
        match tree {
            Tree::Nothing => {}
            Tree::Object(fields) => self.object(forms, tree, fields, place, found),
            Tree::List(items, count) => {
                if self.lists == Lists::Told {
                    self.list(forms, (items, *count), place, found);
                }
            }
            Tree::Truth(truth) => {
                let word = own(self.language, if *truth { "yes" } else { "no" });
                found.push(self.field(forms, Datum::Word(word), place));
            }
            Tree::Number(number) => found.push(self.field(forms, Datum::Number(*number), place)),
            Tree::Word(word) => found.push(self.field(forms, Datum::Word(self.word(forms, word, place)), place)),
        }
    }

    fn object(
        &self,
        forms: &Forms<'d>,
        tree: &Tree,
        fields: &[(String, Tree)],
        place: &Place<'_>,
        found: &mut Vec<Field>,
    ) {
        let shapes = fitting(forms, fields);
        for (name, value) in fields {
            let own: Vec<_> =
                shapes.iter().filter_map(|(form, of)| Some((form["properties"].get(name)?, *of))).collect();
            let component = own.first().map_or("", |(_, component)| component);
            let forms = self.forms(own);
            let unit = forms.iter().find_map(|(form, _)| form["x-unit"].as_str().or(form["items"]["x-unit"].as_str()));
            let mut inside = place.clone();
            inside.way.push(name.clone());
            inside.names.push(capitalised(&self.glossary.label(component, name, unit)));
            inside.around.insert(0, tree);
            self.walk(&forms, value, &inside, found);
        }
    }

    /// Single values in one field, others one after another.
    fn list(&self, forms: &Forms<'d>, (items, count): (&[Tree], usize), place: &Place<'_>, found: &mut Vec<Field>) {
        let inner = forms.iter().filter(|(form, _)| form["items"].is_object()).map(|(form, of)| (&form["items"], *of));
        let inner = self.forms(inner.collect());
        if items.is_empty() {
            return;
        }
        if items.iter().all(|item| !matches!(item, Tree::Object(_) | Tree::List(..))) {
            let mut said: Vec<String> =
                items.iter().take(MOST_VALUES).map(|item| self.single(&inner, item, place)).collect();
            if count > said.len() {
                said.push(format!("… ({count})"));
            }
            let forms = if forms.iter().any(|(form, _)| form["x-unit"].is_string()) { forms } else { &inner };
            found.push(self.field(forms, Datum::Word(said.join("; ")), place));
            return;
        }
        for (index, item) in items.iter().enumerate() {
            let mut inside = place.clone();
            inside.way.push(index.to_string());
            if let Some(last) = inside.names.last_mut() {
                *last = format!("{last} {}", index + 1);
            }
            // The item is what stands around its fields.
            self.walk(&inner, item, &inside, found);
        }
        if count > items.len() {
            let shown = format!("{} / {count}", items.len());
            found.push(self.field(forms, Datum::Word(shown), place));
        }
    }

    fn field(&self, forms: &Forms<'d>, value: Datum, place: &Place<'_>) -> Field {
        let (label, around) =
            place.names.split_last().map_or((String::new(), &[][..]), |(last, rest)| (last.clone(), rest));
        let unit = forms.iter().find_map(|(form, _)| form["x-unit"].as_str()).unwrap_or_default();
        // `as objective_unit says`: the field of that name that stands nearest.
        let said = unit.strip_prefix("as ").and_then(|rest| rest.strip_suffix(" says"));
        let unit = said.and_then(|name| place.around.iter().find_map(|object| object.word(name))).unwrap_or(unit);
        Field {
            way: place.way.clone(),
            group: around.join(JOINT),
            label,
            value,
            digits: place.way.last().map_or(DIGITS, |name| if is_error(name) { ERROR_DIGITS } else { DIGITS }),
            unit: if unit.is_empty() { String::new() } else { self.glossary.unit(unit) },
        }
    }

    fn forms(&self, nodes: Forms<'d>) -> Forms<'d> {
        nodes.into_iter().flat_map(|(node, component)| forms(self.document, node, component, 0)).collect()
    }

    /// A word of a choice in the reader's language; a name that the user gave stays as it is.
    fn word(&self, forms: &Forms<'d>, word: &str, place: &Place<'_>) -> String {
        if forms.iter().any(|(form, _)| allows(form, word) == Some(true)) {
            return self.glossary.word(word);
        }
        // In a job, words of no choice are the user's.
        let name = place.way.last().filter(|_| self.lists == Lists::LeftOut);
        name.and_then(|name| self.vocabulary.under(name, word)).unwrap_or_else(|| word.to_owned())
    }

    fn single(&self, forms: &Forms<'d>, item: &Tree, place: &Place<'_>) -> String {
        match item {
            Tree::Number(number) => spoken_number(*number, self.language),
            Tree::Word(word) => self.word(forms, word, place),
            Tree::Truth(truth) => own(self.language, if *truth { "yes" } else { "no" }),
            Tree::Nothing | Tree::List(..) | Tree::Object(_) => "–".to_owned(),
        }
    }
}

fn is_error(name: &str) -> bool {
    ["numerical_error", "uncertainty"].iter().any(|word| name.contains(word))
}

/// Whether a choice has this word; `None` where the schema lists none.
fn allows(form: &Value, word: &str) -> Option<bool> {
    let listed = form["enum"].as_array().map(|words| words.iter().any(|known| known == word));
    listed.or_else(|| form["const"].as_str().map(|known| known == word))
}

/// Those of the forms that an object with these fields has; all where none has all of them.
fn fitting<'d>(forms: &Forms<'d>, fields: &[(String, Tree)]) -> Forms<'d> {
    let fits = |form: &Value| {
        fields.iter().all(|(name, value)| match (form["properties"].get(name), value) {
            (None, _) => false,
            (Some(field), Tree::Word(word)) => allows(field, word).unwrap_or(true),
            (Some(_), _) => true,
        })
    };
    let fitting: Forms<'d> = forms.iter().filter(|(form, _)| fits(form)).copied().collect();
    if fitting.is_empty() {
        forms.iter().filter(|(form, _)| form["properties"].is_object()).copied().collect()
    } else {
        fitting
    }
}
