//! For everybody: axe-core finds nothing, the keyboard reaches everything, no width overflows.

use serde_json::{Value, json};

use crate::chromium::Page;
use crate::service::Service;
use crate::sizes::{pane, speak};
use crate::{SETTLED, looking};

/// Version 4.14.1, see its folder.
const AXE: &str = include_str!("vendor/axe-core/axe.min.js");
const RULES: &str = "['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice']";

pub fn assert_accessible(page: &mut Page, place: &str) {
    if page.evaluate("typeof axe") == "undefined" {
        page.evaluate(&format!("{AXE};0"));
    }
    let found = page.evaluate(&format!(
        "axe.run(document, {{runOnly: {RULES}}}).then(it => it.violations.map(rule => [rule.id, rule.help, rule.nodes.slice(0, 3).map(node => node.html.slice(0, 200) + ' ' + node.failureSummary)]))"
    ));
    assert_eq!(found, json!([]), "{place}: {found:#}");
}

/// The addresses of all calculators.
pub fn rooms(page: &mut Page, service: &Service) -> Vec<String> {
    page.open(&service.page(""));
    page.wait_for(".questions li");
    let rooms = page.evaluate(
        "[...document.querySelectorAll('.questions li > a')].map(link => link.getAttribute('href').slice(2))",
    );
    rooms.as_array().unwrap().iter().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// Every calculator; all other states are looked at in `matrix.rs`.
#[test]
fn axe_finds_no_violation_on_any_page() {
    let Some((_turn, mut page, service)) = looking() else { return };
    for (index, room) in rooms(&mut page, service).iter().enumerate() {
        // Either scheme for every second one.
        page.screen(1440, 900, index % 2 == 1);
        page.open(&service.page(room));
        page.until(SETTLED);
        assert_accessible(&mut page, room);
    }
    page.open(&service.page("studies"));
    page.click("#add-varied");
    page.click("#run-study");
    page.until(&format!("document.querySelector('.study-rows') && {SETTLED}"));
    assert_accessible(&mut page, "studies");
    page.open(&service.page("feed-schedule"));
    page.until(SETTLED);
    page.click_on("Objective over");
    // The picture of another place comes once one is tried.
    page.wait_for("#trial");
    page.evaluate("document.querySelector('#trial').focus()");
    for _ in 0..10 {
        page.press("ArrowRight");
    }
    page.wait_for(".preview .picture");
    assert_accessible(&mut page, "trade-off");
    page.assert_calm();
}

#[test]
fn no_page_is_wider_than_its_window() {
    let Some((_turn, mut page, service)) = looking() else { return };
    let mut places = rooms(&mut page, service);
    places.extend(["", "jobs", "results", "models", "library", "studies"].map(str::to_owned));
    for place in &places {
        page.screen(360, 740, false);
        page.open(&service.page(place));
        if ["", "jobs", "results", "models", "library", "studies"].contains(&place.as_str()) {
            page.wait_for("main h1");
        } else {
            page.until(SETTLED);
        }
        for (width, height) in [(360, 740), (768, 1024), (1024, 600), (2560, 1300)] {
            page.screen(width, height, false);
            page.until(&format!("innerWidth === {width}"));
            page.until("document.documentElement.scrollWidth <= innerWidth");
        }
    }
}

/// Three faults in one row of a grid: their texts stand below it, and neither a column nor the page gets wider.
#[test]
fn long_faults_move_no_column() {
    let Some((_turn, mut page, service)) = looking() else { return };
    let columns = "[...document.querySelectorAll('.form .grid thead th')].map(it => Math.round(it.getBoundingClientRect().width))";
    for (width, height) in [(360, 740), (1024, 600), (2560, 1300)] {
        page.screen(width, height, false);
        page.open(&service.page("deflection-compensation?example=stepped_with_rest"));
        page.until(SETTLED);
        if width < 861 {
            page.click(".pane-switch button");
        }
        page.click_on("RU");
        page.until("document.documentElement.lang === 'ru'");
        page.wait_for(".form .grid thead th");
        let before = page.evaluate(columns);
        page.fill("#field-shaft-segments-0-diameter_mm", "900000");
        page.fill("#field-shaft-segments-0-length_mm", "-5");
        page.fill("#field-shaft-segments-1-diameter_mm", "0");
        // On a phone the form and its faults are one pane, the result another.
        page.until("document.querySelectorAll('.row-faults .fault').length >= 3");
        assert_eq!(page.evaluate(columns), before, "{width}");
        let fits = page.evaluate(
            "[...document.querySelectorAll('.form .grid-scroll, .sections')].every(it => it.scrollWidth <= it.clientWidth + 1) && document.documentElement.scrollWidth <= innerWidth",
        );
        assert_eq!(fits, true, "{width}");
        // The field says where its fault stands.
        page.until(
            "document.getElementById(document.querySelector('#field-shaft-segments-0-diameter_mm').getAttribute('aria-describedby'))?.textContent.length > 20",
        );
        page.click_on("EN");
        page.until("document.documentElement.lang === 'en'");
    }
    page.assert_calm();
}

/// Every word of headings, labels and names stands on one line, whatever the width and the language; and nothing lies
/// below the end of the page.
#[test]
fn no_word_is_broken_and_no_page_ends_in_emptiness() {
    let Some((_turn, mut page, service)) = looking() else { return };
    let rooms = rooms(&mut page, service);
    let broken = "(() => { const broken = new Set(); \
        for (const it of document.querySelectorAll('.form .grid:not(.still) th, .row .label, .fold-title, legend, .figure-choice button, .panel-head span, [role=tab], .value-table th, .value-table td, .shell a')) { \
          if (!it.checkVisibility()) continue; \
          const walk = document.createTreeWalker(it, NodeFilter.SHOW_TEXT); \
          for (let text = walk.nextNode(); text; text = walk.nextNode()) for (const word of text.data.matchAll(/[^\\s\\u00a0-]+/g)) { \
            const range = document.createRange(); range.setStart(text, word.index); range.setEnd(text, word.index + word[0].length); \
            const lines = new Set([...range.getClientRects()].filter(box => box.width > 0.5).map(box => Math.round(box.top))); \
            if (lines.size > 1) broken.add(word[0]); } } \
        return [...broken] })()";
    for room in &rooms {
        page.open(&service.page(room));
        for (width, height) in [(360, 740), (1024, 600), (1440, 900)] {
            page.screen(width, height, false);
            for language in ["en", "ru"] {
                speak(&mut page, language);
                page.until(SETTLED);
                page.wait_for(".value-table");
                assert_eq!(page.evaluate(broken), json!([]), "{room} at {width}, {language}");
                let below = "document.documentElement.scrollHeight - Math.max(innerHeight, Math.round(document.querySelector('.result-pane').getBoundingClientRect().bottom + scrollY))";
                assert_eq!(page.evaluate(&format!("{below} <= 2")), true, "{room} at {width}, {language}");
                pane(&mut page, "form");
                page.evaluate(
                    "document.querySelectorAll('.fold-head button[aria-expanded=false]').forEach(it => it.click())",
                );
                page.until("!document.querySelector('.fold-head button[aria-expanded=false]')");
                assert_eq!(page.evaluate(broken), json!([]), "form of {room} at {width}, {language}");
                pane(&mut page, "picture");
            }
        }
    }
    page.assert_calm();
}

#[test]
fn the_keyboard_alone_is_enough() {
    let Some((_turn, mut page, service)) = looking() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.press("Tab");
    page.until("document.activeElement.classList.contains('skip')");
    // Through the shell into the form, in the order in which it is read.
    let mut seen = Vec::new();
    for _ in 0..21 {
        page.press("Tab");
        let name = page.evaluate(
            "(() => { const it = document.activeElement; return (it.id || it.textContent).trim().slice(0, 40) })()",
        );
        seen.push(name.as_str().unwrap_or_default().to_owned());
        assert_eq!(page.evaluate("document.activeElement.checkVisibility()"), true, "{seen:?}");
    }
    let place =
        |part: &str| seen.iter().position(|name| name.contains(part)).unwrap_or_else(|| panic!("{part}: {seen:?}"));
    assert!(
        place("Jobs") < place("EN") && place("EN") < place("example") && place("example") < place("Shaft"),
        "{seen:?}"
    );
    // The menu of questions opens, closes and gives the focus back.
    page.evaluate("document.querySelector('.ask button').focus()");
    page.press("Enter");
    page.until("!document.querySelector('.menu').hidden");
    page.press("Escape");
    page.until(
        "document.querySelector('.menu').hidden && document.activeElement === document.querySelector('.ask button')",
    );
    page.assert_calm();
}
