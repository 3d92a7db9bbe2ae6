//! What a record says in an answer; files of records; what ISO codes say.

use axum::Extension;
use axum::extract::{Request, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri};
use axum::response::Response;
use precut_calc::material;
use precut_library::resolve::Revision;
use precut_library::{Kind, built_in, iso, kienzle};
use serde_json::{Map, Value, json};

use super::auth::Caller;
use super::problem::Problem;
use super::query::Query;
use super::{App, body, gate};
use crate::config::Limits;
use crate::engine::{Body, Form, StoredRecord, parsed};
use crate::text::{Glossary, Language};

/// Largest body with codes, bytes.
const MOST_CODES: usize = 4096;

/// A record as it is answered, without its revisions.
pub fn record_said(stored: &StoredRecord, language: Language) -> Value {
    said(stored, &Around::default(), language)
}

/// What the address of one record tells beside it.
#[derive(Default)]
pub(super) struct Around {
    /// The numbers of its revisions.
    pub(super) revisions: Vec<u32>,
    /// How many kept results got it; of what no job names, none.
    pub(super) uses: Option<u64>,
}

/// A record as it is answered: its fields, each number with its source in words, beside its name and state.
pub(super) fn said(stored: &StoredRecord, around: &Around, language: Language) -> Value {
    let record = &stored.record;
    let mut said = Map::new();
    said.insert("name".to_owned(), record.name.clone().into());
    if record.kind == Kind::Material {
        said.insert("id".to_owned(), record.name.clone().into());
    }
    let mut fields = record.value.clone();
    if record.kind.has_sources() {
        in_words(&mut fields);
    }
    if let Some(title) = record.text("title") {
        let title = Glossary::of(language).help(title);
        fields["title"] = title.into();
    }
    if record.kind == Kind::Material {
        material_fields(stored, &mut fields);
    }
    if let Value::Object(fields) = fields {
        said.extend(fields);
    }
    state(stored, around, &mut said);
    said.into()
}

/// Number or version, hash, time, addresses.
fn state(stored: &StoredRecord, around: &Around, said: &mut Map<String, Value>) {
    let (name, folder) = (&stored.record.name, stored.record.kind.plural());
    let newest = format!("/v1/{folder}/{name}");
    let this = match stored.revision {
        Revision::Own(revision) => {
            said.insert("built_in".to_owned(), false.into());
            said.insert("revision".to_owned(), revision.into());
            format!("{newest}@{revision}")
        }
        Revision::BuiltIn(version) => {
            said.insert("built_in".to_owned(), true.into());
            said.insert("data_version".to_owned(), version.into());
            newest.clone()
        }
    };
    said.insert("sha256".to_owned(), stored.sha256.clone().into());
    if let Some(created) = stored.created_ms {
        let created = jiff::Timestamp::from_millisecond(created).unwrap_or_default();
        said.insert("created_at".to_owned(), format!("{created:.3}").into());
    }
    let revisions: Vec<String> = around.revisions.iter().map(|revision| format!("{newest}@{revision}")).collect();
    let mut links = json!({ "self": this, "newest": newest, "comparison": format!("{this}/comparison?with="), "revisions": revisions });
    if let Some(uses) = around.uses {
        said.insert("uses".to_owned(), uses.into());
        links["uses"] = format!("/v1/results?record={}", stored.address()).into();
    }
    said.insert("links".to_owned(), links);
}

/// Sources in words, with the address where they can be read, in place of the keys of the data.
fn in_words(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            fields.values_mut().for_each(in_words);
            let known = fields.get("source").and_then(Value::as_str).and_then(built_in::source);
            if let Some(source) = known {
                let address = source.address.clone();
                fields.insert("source".to_owned(), source.text().into());
                if let Some(address) = address {
                    fields.insert("address".to_owned(), address.into());
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(in_words),
        _ => {}
    }
}

/// Of a material: the one preferred row beside all of them, whether they differ, and what the engine's own said before there
/// were more.
fn material_fields(stored: &StoredRecord, fields: &mut Value) {
    let record = &stored.record;
    let Value::Object(fields) = fields else { return };
    if let Some(rows) = fields.shift_remove("kienzle") {
        let preferred = rows.as_array().and_then(|rows| {
            let is_preferred = |row: &&Value| row.get("use").is_some_and(|word| word == "preferred");
            rows.iter().find(is_preferred).cloned()
        });
        if let Some(preferred) = preferred {
            fields.insert("kienzle".to_owned(), preferred);
        }
        fields.insert("kienzle_rows".to_owned(), rows);
    }
    let rows = kienzle::rows(record);
    let sources = kienzle::choose(&rows, kienzle::Choice::Preferred);
    let conflict = sources.filter(kienzle::Sources::is_conflict).map(|sources| {
        json!({
            "differs_percent": sources.differs_percent,
            "least_n_per_mm2": sources.least.at_reference(),
            "largest_n_per_mm2": sources.largest.at_reference(),
            "at_chip_thickness_mm": kienzle::REFERENCE_CHIP_THICKNESS_MM,
            "force_percent": sources.force_percent,
        })
    });
    fields.insert("conflict".to_owned(), conflict.unwrap_or_default());
    fields.insert("force_sources".to_owned(), force_sources(&rows));
    let engine = matches!(stored.revision, Revision::BuiltIn(_)).then(|| material::find(&record.name)).flatten();
    if let Some(Ok(Value::Object(before))) = engine.map(serde_json::to_value) {
        for (name, value) in before {
            if name != "id" && name != "title" {
                fields.insert(name, value);
            }
        }
    }
}

/// What each source says the specific force is at one chip thickness, where they can be compared.
fn force_sources(rows: &[kienzle::Row<'_>]) -> Value {
    let said = |row: &kienzle::Row<'_>| {
        json!({
            "row": row.index, "value_n_per_mm2": row.at_reference(), "at_chip_thickness_mm": kienzle::REFERENCE_CHIP_THICKNESS_MM,
            "source": row.source, "certainty": row.certainty, "preferred": row.is_preferred, "superseded": row.is_superseded,
        })
    };
    let mut said: Value = rows.iter().map(said).collect();
    in_words(&mut said);
    said
}

fn form_of(kind: &str) -> Option<Form> {
    Some(match kind {
        "application/json" => Form::Json,
        "application/toml" => Form::Toml,
        "text/csv" => Form::Csv,
        _ => return None,
    })
}

/// Types of files of records.
pub(super) const TYPES: [&str; 3] = ["application/json", "application/toml", "text/csv"];

/// `POST /v1/library/import`
pub(super) async fn import(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    uri: Uri,
    request: Request,
) -> Result<Response, Problem> {
    let dry_run = Query::of(&uri, &["dry_run"])?
        .one_of("dry_run", &[true, false], |dry| if dry { "true" } else { "false" })?
        .unwrap_or(false);
    let owner = gate::owner(&caller, &request);
    let (kind, bytes) = body::plain(request, &TYPES, &app.limits, app.engine.bodies()).await?;
    let form = form_of(kind).ok_or_else(Problem::internal)?;
    let report = app.engine.import(&caller.shelf(), (form, &bytes), dry_run, owner).await?;
    Ok(answered(&report))
}

fn answered(value: &impl serde::Serialize) -> Response {
    let body = serde_json::to_vec(value).expect("records have only finite numbers and words");
    let mut response = Response::new(body.into());
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("application/json"));
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

/// `GET /v1/library/export`
pub(super) async fn export(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    uri: Uri,
) -> Result<Response, Problem> {
    let words = ["json", "toml", "csv"];
    let asked = Query::of(&uri, &["format"])?.one_of("format", &words, |word| word)?;
    let by_word = asked.and_then(|word| TYPES.into_iter().find(|kind| kind.ends_with(word)));
    let kind = match by_word {
        Some(kind) => kind,
        None => super::negotiate::liked(&headers, TYPES.into_iter())
            .ok_or_else(|| Problem::of_status(StatusCode::NOT_ACCEPTABLE).with("available", TYPES.join(", ")))?,
    };
    let bytes = app.engine.export(&caller.shelf(), form_of(kind).ok_or_else(Problem::internal)?).await?;
    let mut response = Response::new(bytes.into());
    *response.status_mut() = StatusCode::OK;
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    let name = match kind {
        "application/toml" => "attachment; filename=\"library.toml\"",
        "text/csv" => "attachment; filename=\"library.csv\"",
        _ => "attachment; filename=\"library.json\"",
    };
    headers.insert(CONTENT_DISPOSITION, HeaderValue::from_static(name));
    Ok(response)
}

/// `POST /v1/tools/parse`
pub(super) async fn parse(State(app): State<App>, request: Request) -> Result<Response, Problem> {
    let limits = Limits { json_bytes: app.limits.json_bytes.min(MOST_CODES), ..app.limits.clone() };
    let Body::Json(sent) = body::job(request, || false, &limits, app.engine.bodies()).await? else {
        return Err(Problem::internal());
    };
    let (insert, holder) = codes(&parsed(&sent)?)?;
    codes_said(insert.as_deref(), holder.as_deref()).map(|said| answered(&said))
}

/// What the designations of a tool say.
pub fn codes_said(insert: Option<&str>, holder: Option<&str>) -> Result<Value, Problem> {
    let read = iso::read(insert, holder);
    if !read.faults.is_empty() {
        let total = read.faults.len();
        return Err(Problem::invalid_record(read.faults, total));
    }
    let geometry = read.geometry.map(|geometry| {
        json!({
            "nose_radius_mm": geometry.nose_radius_mm, "cutting_edge_angle_deg": geometry.cutting_edge_angle_deg,
            "minor_edge_angle_deg": geometry.minor_edge_angle_deg, "clearance_angle_deg": geometry.clearance_angle_deg,
            "round_insert": geometry.is_round,
        })
    });
    Ok(json!({
        "insert": read.insert.as_ref().map(insert_says), "holder": read.holder.as_ref().map(holder_says),
        "geometry": geometry,
    }))
}

/// What the designation of an insert says; null where it does not.
fn insert_says(insert: &iso::Insert) -> Value {
    json!({
        "designation": insert.to_string(),
        "shape": insert.shape, "included_angle_deg": insert.included_angle_deg(),
        "clearance_angle_deg": insert.clearance_angle_deg(), "tolerance_class": insert.tolerance_class,
        "chip_breaker_faces": insert.chip_breaker_faces(), "hole": insert.has_hole(),
        "double_sided": insert.is_double_sided(), "thickness_mm": insert.thickness_mm(),
        "inscribed_circle_mm": insert.inscribed_circle_mm(), "cutting_edge_length_mm": insert.cutting_edge_length_mm(),
        "nose_radius_mm": insert.nose_radius_mm(), "edge_condition": insert.edge_condition,
        "direction": insert.direction, "maker": insert.maker,
    })
}

/// What the designation of a holder or a bar says.
fn holder_says(holder: &iso::Holder) -> Value {
    let hand = holder.hand.name();
    let bar = holder.bar.map(|bar| {
        json!({
            "material": bar.material().name(), "youngs_modulus_n_per_mm2": bar.material().youngs_modulus_n_per_mm2(),
            "coolant": bar.has_coolant(), "damped": bar.is_damped(), "diameter_mm": bar.diameter_mm,
        })
    });
    json!({
        "designation": holder.to_string(),
        "clamping": holder.clamping, "shape": holder.shape, "style": holder.style,
        "cutting_edge_angle_deg": holder.cutting_edge_angle_deg(), "clearance_angle_deg": holder.clearance_angle_deg(),
        "hand": hand, "length_mm": holder.length_mm(), "insert_size": format!("{:02}", holder.insert_size),
        "for_facing": holder.is_for_facing(), "shank_height_mm": holder.shank_mm.map(|shank| shank.0),
        "shank_width_mm": holder.shank_mm.map(|shank| shank.1), "bar": bar,
    })
}

/// The codes in a body.
fn codes(sent: &Value) -> Result<(Option<String>, Option<String>), Problem> {
    use precut_calc::calculator::Finding;
    let mut faults = Vec::new();
    let fields = sent.as_object();
    for name in
        fields.into_iter().flatten().map(|(name, _)| name).filter(|name| !["insert", "holder"].contains(&name.as_str()))
    {
        let allowed = vec!["insert", "holder"];
        faults.push(
            Finding::new("unknown_field", format!("/{name}")).with("field", name.clone()).with("allowed", allowed),
        );
    }
    let mut text = |name: &str| match fields.and_then(|fields| fields.get(name)) {
        None | Some(Value::Null) => None,
        Some(Value::String(code)) => Some(code.clone()),
        Some(_) => {
            faults.push(Finding::new("code_not_a_text", format!("/{name}")));
            None
        }
    };
    let (insert, holder) = (text("insert"), text("holder"));
    if faults.is_empty() && insert.is_none() && holder.is_none() {
        faults.push(Finding::new("name_or_codes_missing", ""));
    }
    let total = faults.len();
    if total > 0 { Err(Problem::invalid_record(faults, total)) } else { Ok((insert, holder)) }
}
