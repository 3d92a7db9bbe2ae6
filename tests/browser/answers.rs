//! The answer and what can be taken away of it: always in view, and never that of other inputs than those on the screen.

use std::collections::HashMap;

use serde_json::{Map, Value, json};

use crate::access::assert_accessible;
use crate::chromium::Page;
use crate::{SETTLED, both};

/// Edits of one walk; with `PRECUT_EDITS` as many as it says.
const EDITS: usize = 200;

/// Numbers without a pattern that a test could be right by.
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % end
    }
}

/// What is typed, and the number that it stands for; none for what is no number, or may be two.
fn typed(dice: &mut Dice, mm: f64) -> (String, Option<f64>) {
    let value = (mm * 10.0).round() / 10.0;
    match dice.below(12) {
        0 => (format!("{value} mm"), Some(value)),
        1 => (format!("{}", value.round()).replace('.', ","), Some(value.round())),
        2 => (format!("{value:.1}").replace('.', ","), Some(value)),
        3 => (format!("{value:.0} cm"), Some(value.round() * 10.0)),
        4 => (format!("{:.2} in", value / 25.4), Some(((value / 25.4 * 100.0).round() * 254.0) / 1000.0)),
        5 => (format!("{value} kg"), None),
        6 => (["abc", "2,000", "1 2", "-", "", "60 furlong"][dice.below(6)].to_owned(), None),
        _ => (format!("{value}"), Some(value)),
    }
}

/// What stands in the form, by the ids of its fields.
const WATCH: &str = "(() => { \
    window.onScreen = () => [...document.querySelectorAll('.form input[inputmode=decimal]')].filter(it => it.id.startsWith('field-shaft-segments-') || /^field-supports-[0-9]+-z_mm$/.test(it.id) || it.id === 'field-cut-feed_mm_per_rev').map(it => [it.id, it.value]); \
    window.typeInto = (it, text) => { it.focus(); Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(it, text); it.dispatchEvent(new InputEvent('input', { bubbles: true })); }; \
    window.programs = []; window.papers = []; \
    const make = URL.createObjectURL; \
    URL.createObjectURL = blob => { const screen = onScreen(); blob.text().then(text => programs.push({ text, screen })); return make.call(URL, blob); }; \
    window.print = () => papers.push({ text: document.querySelector('.sheet').textContent, screen: onScreen(), red: Boolean(document.querySelector('.not-theirs')) }); \
    window.take = () => { document.querySelector('#take')?.click(); [...document.querySelectorAll('.downloads button')].find(it => it.textContent === 'Print')?.click(); } })()";

/// The job that a person would copy off the screen: the example with the texts of the fields; `None` where one of them is
/// no number.
fn copied(base: &Value, screen: &Value, known: &HashMap<String, f64>) -> Option<Value> {
    let mut job = base.clone();
    let mut rows: Vec<Map<String, Value>> = Vec::new();
    for field in screen.as_array().unwrap() {
        let (id, text) = (field[0].as_str().unwrap(), field[1].as_str().unwrap());
        let number = match text {
            "" => None,
            text => Some(known.get(text).copied().or_else(|| text.parse().ok())?),
        };
        // A support at the end of the shaft goes with it.
        if let Some(place) = id.strip_prefix("field-supports-") {
            let support: usize = place.split('-').next().unwrap().parse().unwrap();
            job["supports"][support]["z_mm"] = number?.into();
            continue;
        }
        match id.strip_prefix("field-shaft-segments-") {
            Some(place) => {
                let (row, name) = place.split_once('-').unwrap();
                let row: usize = row.parse().unwrap();
                rows.resize_with(rows.len().max(row + 1), Map::new);
                match number {
                    Some(number) => drop(rows[row].insert(name.to_owned(), number.into())),
                    // Length and diameter must be there.
                    None if ["length_mm", "diameter_mm"].contains(&name) => return None,
                    None => {}
                }
            }
            None => job["cut"]["feed_mm_per_rev"] = number?.into(),
        }
    }
    job["shaft"]["segments"] = json!(rows);
    Some(job)
}

fn asked(page: &mut Page, job: &Value, accept: &str) -> Value {
    page.evaluate(&format!(
        "fetch('/v1/deflection-compensation', {{ method: 'POST', headers: {{ 'Content-Type': 'application/json', Accept: '{accept}', Prefer: 'wait=60' }}, body: {} }}).then(it => it.text())",
        json!(job.to_string())
    ))
}

/// A program on the machine belongs to the part that stands on the screen, whatever was typed before, and however fast.
#[test]
fn no_program_is_ever_that_of_another_part() {
    let Some((_turn, mut page, service)) = both() else { return };
    let edits = std::env::var("PRECUT_EDITS").ok().and_then(|count| count.parse().ok()).unwrap_or(EDITS);
    page.open(&service.page("deflection-compensation?example=stepped_with_rest"));
    page.until(SETTLED);
    page.evaluate(WATCH);
    let base = page.evaluate(
        "fetch('/v1/calculators/deflection-compensation').then(it => it.json()).then(it => it.jobs.stepped_with_rest)",
    );
    let mut dice = Dice(28);
    let mut known = HashMap::new();
    let mut checked = (0, 0);
    for edit in 0..edits {
        match dice.below(12) {
            0 if dice.below(2) == 0 => drop(page.evaluate("(() => { const all = document.querySelectorAll('.grid:not(.still) .icon:not(:disabled)'); if (all.length > 2) all[all.length - 1].click() })()")),
            0 => drop(page.evaluate("(() => { const all = document.querySelectorAll('.grid:not(.still) tbody'); if (all.length < 5) [...document.querySelectorAll('.form .more')].find(it => it.textContent.startsWith('Add one Segments'))?.click() })()")),
            1 => drop(page.evaluate("document.querySelector('.grid:not(.still) input').dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowUp', bubbles: true }))")),
            2 => {
                let (text, value) = typed(&mut dice, 0.4);
                if let Some(value) = value.filter(|_| !text.contains(' ')) {
                    known.insert(text.clone(), value);
                    page.evaluate(&format!("typeInto(document.querySelector('#field-cut-feed_mm_per_rev'), {})", json!(text)));
                }
            }
            place => {
                // Diameters under those of the blank, now and then a length, with which the supports may not agree.
                let (column, mm) = match place {
                    3 => ("length_mm", 200.0 + dice.below(4000) as f64 / 10.0),
                    4 | 5 => ("stock_diameter_mm", 52.0 + dice.below(60) as f64 / 10.0),
                    _ => ("diameter_mm", 24.0 + dice.below(120) as f64 / 10.0),
                };
                let (text, value) = typed(&mut dice, mm);
                if let Some(value) = value {
                    known.insert(text.clone(), value);
                }
                let cells = "[...document.querySelectorAll('.grid:not(.still) input')].filter(it => it.dataset.column";
                let cell = dice.below(100);
                // Asked for in the same breath, before anything is drawn.
                page.evaluate(&format!("(() => {{ const all = {cells} === '{column}'); typeInto(all[{cell} % all.length], {}); take() }})()", json!(text)));
            }
        }
        if dice.below(3) == 0 {
            page.until("document.querySelector('.result-pane').getAttribute('aria-busy') === 'false'");
        }
        page.evaluate("take()");
        if dice.below(4) == 0 || edit + 1 == edits {
            page.until("document.querySelector('.result-pane').getAttribute('aria-busy') === 'false'");
            page.evaluate("take()");
            // What may be taken comes, or it is said why not.
            page.until("programs.length > 0 || document.querySelector('.not-theirs') || !(document.querySelector('.strip > .fault')?.textContent ?? 'meanwhile').includes('meanwhile')");
            // What cannot be read or computed is mended, so that the walk goes on.
            page.evaluate("[...document.querySelectorAll('.grid input[aria-invalid=true]')].forEach(it => typeInto(it, { diameter_mm: '30', stock_diameter_mm: '55' }[it.dataset.column] ?? '150'))");
            page.until("document.querySelector('.result-pane').getAttribute('aria-busy') === 'false'");
            if page.evaluate("document.querySelector('#take').disabled") == true {
                // Begun anew, from another page: what was typed may not have reached the address.
                page.evaluate("location.hash = '#/results'");
                page.until("!document.querySelector('#take')");
                page.evaluate("location.hash = '#/deflection-compensation?example=stepped_with_rest'");
                page.until(SETTLED);
            }
            // What can be computed gives its sheet and its program, or says why there is none, whatever was typed before.
            page.until("!document.querySelector('#take').disabled");
            page.evaluate("take()");
            page.until("papers.length > 0 && (programs.length > 0 || !(document.querySelector('.strip > .fault')?.textContent ?? 'meanwhile').includes('meanwhile'))");
        }
        for (kind, count) in [("programs", &mut checked.0), ("papers", &mut checked.1)] {
            let taken = page.evaluate(&format!("{kind}.splice(0)"));
            for one in taken.as_array().unwrap() {
                let job = copied(&base, &one["screen"], &known);
                let job =
                    job.unwrap_or_else(|| panic!("edit {edit}: {kind} of what cannot be read: {}", one["screen"]));
                let text = one["text"].as_str().unwrap();
                if kind == "programs" {
                    let own = asked(&mut page, &job, "text/x-gcode");
                    assert_eq!(text, own.as_str().unwrap(), "edit {edit}: another part's: {}", one["screen"]);
                } else {
                    let own: Value =
                        serde_json::from_str(asked(&mut page, &job, "application/json").as_str().unwrap()).unwrap();
                    assert!(text.contains(own["key"].as_str().unwrap()), "edit {edit}: another part's sheet");
                    assert_eq!(one["red"], false);
                }
                *count += 1;
            }
        }
    }
    eprintln!("{edits} edits: {} programs and {} sheets, each that of its screen", checked.0, checked.1);
    assert!(checked.0 >= edits / 10 && checked.1 >= edits / 10, "{checked:?} were taken at all");
    page.assert_calm();
}

/// `60 kg` in a cell: said, red, nothing to take, nothing on paper; and once it can be read all is there again.
#[test]
fn a_cell_is_a_field_like_any_other() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation?example=stepped_with_rest"));
    page.until(SETTLED);
    let cell = "#field-shaft-segments-0-diameter_mm";
    for (text, said) in [
        ("60 kg", "“kg” is no unit that fits here"),
        ("2,000", "“2,000” can be 2000 or 2. Which one?"),
        ("sixty", "This is not a number"),
        ("", "A number is needed here"),
    ] {
        page.fill(cell, text);
        if text.is_empty() {
            page.evaluate("document.execCommand('delete')");
        }
        page.wait_for(".strip.unread");
        assert!(page.text(".row-faults").contains(said), "{text}: {}", page.text(".row-faults"));
        assert_eq!(page.evaluate("[document.querySelector('#take'), ...document.querySelectorAll('.downloads button')].every(it => it.disabled)"), true, "{text}");
        assert_eq!(page.evaluate(&format!("document.querySelector('{cell}').getAttribute('aria-invalid')")), "true");
        if text == "2,000" {
            for dark in [false, true] {
                page.screen(1440, 900, dark);
                assert_accessible(&mut page, "an answer to other inputs");
            }
        }
        page.call("Emulation.setEmulatedMedia", json!({"media": "print"}));
        assert_eq!(
            page.evaluate(
                "[...document.querySelectorAll('.verdict, .picture, .sheet, .headline')].filter(it => it.checkVisibility()).length"
            ),
            0,
            "{text} on paper"
        );
        assert_eq!(page.evaluate("document.querySelector('.not-printed').checkVisibility()"), true, "{text} on paper");
        page.call("Emulation.setEmulatedMedia", json!({"media": ""}));
    }
    page.fill(cell, "2,000");
    page.click(".choices button:last-child");
    page.until("!document.querySelector('.row-faults .choices')");
    page.fill(cell, "1.5 in");
    page.until(&format!("!document.querySelector('.not-theirs') && {SETTLED}"));
    page.until("location.hash.includes('diameter_mm=38.1')");
    page.assert_calm();
}

#[test]
fn rows_of_a_spreadsheet_fill_a_table() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation?example=stepped_with_rest"));
    page.until(SETTLED);
    let paste = |page: &mut Page, text: &str| {
        page.evaluate(&format!("(() => {{ const data = new DataTransfer(); data.setData('text', {}); document.querySelector('.grid:not(.still) input').dispatchEvent(new ClipboardEvent('paste', {{ bubbles: true, cancelable: true, clipboardData: data }})) }})()", json!(text)));
    };
    paste(&mut page, "Length\tDiameter\tStock\n20 cm\t40\t42\n700\t50\t52\n250\t36\t38\n100\t30\t31\n");
    page.until("document.querySelectorAll('.grid:not(.still) tbody').length === 4");
    assert_eq!(page.value("#field-shaft-segments-0-length_mm"), "200");
    assert_eq!(page.value("#field-shaft-segments-3-stock_diameter_mm"), "31");
    paste(&mut page, "1\tx\n2\t3\n");
    page.until(
        "document.querySelector('.fault[role=alert]')?.textContent.includes('“x” cannot be read. Nothing was pasted')",
    );
    assert_eq!(page.value("#field-shaft-segments-0-length_mm"), "200");
    page.assert_calm();
}
