//! Answers are kept in English with the codes and numbers of their sentences; here those sentences are said again in
//! another language.

use precut_calc::calculator::{Finding, Message, Value as Datum, Values};
use serde::Serialize;
use serde_json::{Map, Value};

use super::{Language, Texts};
use crate::registry::interned;

/// The sentences of an answer that `text` holds as JSON, the `explanation` or the `warnings`, in `language`. What
/// cannot be said in it, because the answer was made by an engine with other texts, stays as it is.
pub(crate) fn reworded(field: &str, text: &[u8], language: Language) -> Option<Vec<u8>> {
    let items: Vec<Value> = serde_json::from_slice(text).ok()?;
    let again: Vec<Value> = items
        .into_iter()
        .map(|item| {
            let said = if field == "warnings" { notice(&item, language) } else { remark(&item, language) };
            said.unwrap_or(item)
        })
        .collect();
    serde_json::to_vec(&again).ok()
}

/// The result of a parameter study that `text` holds as JSON, with the reasons of its rows in `language`.
pub(crate) fn reworded_rows(text: &[u8], language: Language) -> Option<Vec<u8>> {
    let mut result: Value = serde_json::from_slice(text).ok()?;
    for row in result["rows"].as_array_mut()? {
        let Some(Value::Object(mut told)) = row.get("detail_values").cloned() else { continue };
        told.insert("code".to_owned(), row["code"].clone());
        if let Some(finding) = finding(&told.into())
            && let Ok(said) = Texts::shared().try_finding(language, "fault", &finding)
        {
            row["detail"] = said.into();
        }
    }
    serde_json::to_vec(&result).ok()
}

fn remark(item: &Value, language: Language) -> Option<Value> {
    let message = message(item)?;
    Texts::shared().try_word(language, "explanation", message.code, &message.values).ok()?;
    written(&Texts::shared().remark(language, &message))
}

fn notice(item: &Value, language: Language) -> Option<Value> {
    let finding = finding(item)?;
    Texts::shared().try_finding(language, "warning", &finding).ok()?;
    written(&Texts::shared().notice(language, "warning", &finding))
}

fn written(value: &impl Serialize) -> Option<Value> {
    serde_json::to_value(value).ok()
}

/// A sentence of the explanation as it stands in documents, back to its code and numbers.
pub(crate) fn message(item: &Value) -> Option<Message> {
    Some(Message { code: interned(item["code"].as_str()?), values: values(item.get("values"))? })
}

/// A fault or warning likewise.
pub(crate) fn finding(item: &Value) -> Option<Finding> {
    let mut finding = Finding::new(interned(item["code"].as_str()?), item["pointer"].as_str()?);
    finding.value = item["value"].as_f64();
    finding.limit = item["limit"].as_f64();
    finding.unit = item["unit"].as_str().map(interned);
    finding.values = values(item.get("values"))?;
    Some(finding)
}

fn values(item: Option<&Value>) -> Option<Values> {
    let nothing = Map::new();
    let map = item.map_or(Some(&nothing), Value::as_object)?;
    map.iter().try_fold(Values::new(), |values, (name, value)| Some(values.with(interned(name), datum(value)?)))
}

/// A number, a name or a list of them as it stands in documents.
pub(crate) fn datum(value: &Value) -> Option<Datum> {
    Some(match value {
        Value::Number(number) => Datum::Number(number.as_f64()?),
        Value::String(text) => Datum::Text(text.clone().into()),
        Value::Array(items) => Datum::List(items.iter().map(datum).collect::<Option<_>>()?),
        _ => return None,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_sentence_is_said_again_with_the_same_numbers() {
        let texts = Texts::shared();
        let message = Message::new("work_dominates").with("share", 0.835).with("z_mm", 250.5);
        let english = serde_json::to_vec(&[texts.remark(Language::En, &message)]).unwrap();
        let russian = reworded("explanation", &english, Language::Ru).unwrap();
        assert_eq!(russian, serde_json::to_vec(&[texts.remark(Language::Ru, &message)]).unwrap());
        assert_eq!(reworded("explanation", &russian, Language::En).unwrap(), english);
        let warning = Finding::new("command_too_deep", "/path").measured(3.5, 3.0, "mm");
        let english = serde_json::to_vec(&[texts.notice(Language::En, "warning", &warning)]).unwrap();
        let russian: Value = serde_json::from_slice(&reworded("warnings", &english, Language::Ru).unwrap()).unwrap();
        assert_eq!(russian[0]["detail"], "заданная глубина доходит до 3,5 мм, больше, чем берёт пластина, 3 мм");
        assert_eq!(russian[0]["value"], 3.5);
    }

    #[test]
    fn what_has_no_text_stays_as_it_is() {
        let kept = br#"[{"code":"of_long_ago","text":"It was so.","values":{}}]"#;
        assert_eq!(reworded("explanation", kept, Language::Ru).unwrap(), kept);
    }
}
