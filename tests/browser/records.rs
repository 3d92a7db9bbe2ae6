//! Machine, tool and material by name in the form.

use serde_json::json;

use crate::{SETTLED, both};

const MATERIAL: &str = "[data-record=material] input";
const TOOL: &str = "[data-record=tool] input";
const MODULUS: &str = "#field-shaft-youngs_modulus_n_per_mm2";

#[test]
fn a_material_is_found_by_any_name_and_its_numbers_say_where_they_are_from() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.until("document.querySelectorAll('[data-record]').length === 3");
    page.fill(MATERIAL, "38ХМ");
    page.until("document.querySelector('.hits [aria-selected=true] strong')?.textContent === '42crmo4'");
    page.press("Enter");
    page.until(&format!("document.querySelector('{MATERIAL}').value === '42crmo4' && {SETTLED}"));
    page.until("location.hash.includes('42crmo4')");
    // The example's own numbers count until they are taken from the record, too.
    page.click("[data-act=use-records]");
    page.until(&format!("!document.querySelector('[data-act=use-records]') && {SETTLED}"));
    let field = page.evaluate(&format!(
        "(() => {{ const it = document.querySelector('{MODULUS}'); return [it.value, it.placeholder] }})()"
    ));
    assert_eq!(field, json!(["", "210000"]));
    page.click(&format!(".row:has({MODULUS}) .origin-mark"));
    page.wait_for(".origin");
    let origin = page.text(".origin");
    assert!(origin.contains("42crmo4") && origin.contains("210"), "{origin}");
    // What is typed counts; taken away, the record's number is back.
    page.fill(MODULUS, "200000");
    page.until(&format!("!document.querySelector('.row:has({MODULUS}) .origin-mark') && {SETTLED}"));
    page.click("[data-act=use-records]");
    page.until(&format!("document.querySelector('{MODULUS}').value === '' && {SETTLED}"));
    page.assert_calm();
}

#[test]
fn a_tool_is_told_by_its_codes_and_a_bad_name_is_refused_at_its_picker() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill(TOOL, "DNMG150608 PDJNL2525M15");
    page.press("Enter");
    page.until(&format!("document.querySelector('{TOOL}').value === 'DNMG150608 PDJNL2525M15' && {SETTLED}"));
    page.fill(TOOL, "XNMG120408");
    page.press("Enter");
    page.wait_for("[data-record=tool] .fault");
    let fault = page.text("[data-record=tool] .fault");
    assert!(fault.contains("XNMG120408"), "{fault}");
    page.click("[data-record=tool] [data-act=clear]");
    page.until(&format!("!document.querySelector('[data-record=tool] .fault') && {SETTLED}"));
    page.assert_calm();
}

#[test]
fn a_machine_of_ones_own_begins_as_a_copy_and_is_named_in_a_job() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("library"));
    page.wait_for(".record-copy");
    page.pick("#record-from", "lathe_engine_medium");
    page.fill("#record-name", "lathe-3");
    page.click(".record-copy button");
    page.wait_for(".record-numbers");
    let carriage = ".record-numbers input[aria-label='compliance · carriage_um_per_n']";
    page.fill(carriage, "0.018");
    page.click(".record-numbers button");
    page.until("document.querySelector('td.number')?.textContent === '2'");
    assert_eq!(page.value(carriage), "0.018");
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill("[data-record=machine] input", "lathe-3");
    page.press("Enter");
    page.until(&format!("document.querySelector('[data-record=machine] input').value === 'lathe-3' && {SETTLED}"));
    page.until("location.hash.includes('lathe-3')");
    page.assert_calm();
}
