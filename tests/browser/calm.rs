//! An instrument holds still: nothing moves under the hand, the printed sheet is complete, what is shown says where it
//! comes from.

use serde_json::json;

use crate::{SETTLED, both};

const PLACE: &str = "(() => { const box = document.querySelector('.picture.main').getBoundingClientRect(); return [box.top + scrollY, box.height] })()";
/// Where the picture stands in the page, and the links of the shell.
const ALL: &str = "[...document.querySelectorAll('.picture.main, .shell a, .figure-choice')].map(it => { const box = it.getBoundingClientRect(); return [it.className, Math.round(box.left), Math.round(box.top + scrollY), Math.round(box.width)] })";

#[test]
fn neither_a_reading_nor_a_fault_nor_a_lost_service_moves_the_picture() {
    let Some((_turn, mut page, service)) = both() else { return };
    for room in ["deflection-compensation", "feed-schedule"] {
        page.open(&service.page(room));
        page.until(SETTLED);
        page.click_on("Pin to compare");
        page.evaluate("scrollTo(0, 0)");
        let still = page.evaluate(PLACE);
        let middle = page.middle(".stack svg.chart");
        page.point(middle);
        page.until("[...document.querySelectorAll('.series output')].some(it => it.textContent)");
        assert_eq!(page.evaluate(PLACE), still, "{room}: a reading");
    }
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    let still = page.evaluate(PLACE);
    page.fill("#field-cut-feed_mm_per_rev", "900");
    page.wait_for(".problem[role=alert]");
    assert_eq!(page.evaluate(PLACE), still, "a fault");
    // It names the field as the form does; the pointer is there for those who write programs.
    let link = page.text(".problem .link");
    assert_eq!(link, "Cut · Feed");
    assert_eq!(page.evaluate("document.querySelector('.problem .link').title"), "/cut/feed_mm_per_rev");
    assert!(!page.text(".problem").contains("feed_mm_per_rev"));
    page.fill("#field-cut-feed_mm_per_rev", "0.4");
    page.until(&format!("!document.querySelector('.problem') && {SETTLED}"));

    let offline = |page: &mut crate::chromium::Page, offline: bool| {
        page.call("Network.enable", json!({}));
        let conditions = json!({"offline": offline, "latency": 0, "downloadThroughput": -1, "uploadThroughput": -1});
        page.call("Network.emulateNetworkConditions", conditions);
    };
    let still = page.evaluate(PLACE);
    offline(&mut page, true);
    page.fill("#field-cut-feed_mm_per_rev", "0.3");
    page.wait_for(".banner.away");
    assert_eq!(page.evaluate(PLACE), still, "a lost service");
    assert_eq!(page.evaluate("document.querySelectorAll('.problem').length"), 0, "it is said once");
    offline(&mut page, false);
    page.until(&format!("!document.querySelector('.banner') && location.hash.includes('feed_mm_per_rev=0.3') && !document.querySelector('.stale-note') && {SETTLED}"));
    page.assert_calm();
}

/// A long job is told in room that is there before it begins: nothing moves when it begins, gets on, or is cancelled.
#[test]
fn a_long_job_moves_nothing() {
    let Some((_turn, mut page, service)) = both() else { return };
    for (order, (width, height, language)) in
        [(1440, 900, "en"), (1024, 600, "ru"), (360, 740, "ru"), (360, 740, "en")].into_iter().enumerate()
    {
        page.screen(width, height, false);
        page.open(&service.page("ring-roundness?example=set_up"));
        page.click_on(&language.to_uppercase());
        page.until(&format!("document.documentElement.lang === '{language}' && {SETTLED}"));
        page.until("document.querySelector('.verdict')");
        // The answer comes in the other language after the page does, and its names are longer or shorter.
        let spoken =
            "[...document.querySelectorAll('.verdict, .figure-choice')].map(it => /[а-я]/i.test(it.textContent))";
        page.until(&format!("{spoken}.every(it => it === {})", language == "ru"));
        page.until(SETTLED);
        let still = page.evaluate(ALL);
        let highest = 57 + order;
        page.evaluate(&format!("location.hash = '#/ring-roundness?example=set_up&/setup_map/tool_angles=721&/setup_map/support_angles=361&/setup_map/highest_order={highest}'"));
        page.wait_for(".shell .count");
        page.until("document.querySelector('.progress-box').checkVisibility({visibilityProperty: true})");
        assert_eq!(page.evaluate(ALL), still, "{width} {language}: begun");
        // It is all there: nothing of it is cut off, nothing wider than the page.
        assert_eq!(page.evaluate("document.documentElement.scrollWidth <= innerWidth"), true);
        let inside = "(() => { const head = document.querySelector('.room-head').getBoundingClientRect(); return ['.progress-text .left', '#cancel-job', '.progress-box progress'].every(part => { const box = document.querySelector(part).getBoundingClientRect(); return box.left >= head.left - 1 && box.right <= head.right + 1 && box.top >= head.top - 2 && box.bottom <= head.bottom + 2 }) })()";
        assert_eq!(page.evaluate(inside), true, "{width} {language}: its words are inside the head");
        page.click("#cancel-job");
        page.until("!document.querySelector('.progress-box') && document.querySelector('.stale-note')");
        page.until("!document.querySelector('.shell .count')");
        assert_eq!(page.evaluate(ALL), still, "{width} {language}: cancelled");
        assert_eq!(page.evaluate("document.querySelectorAll('.problem').length"), 0, "a cancel is no fault");
    }
    page.assert_calm();
}

#[test]
fn the_printed_sheet_has_inputs_picture_words_key_and_versions() {
    let Some((_turn, mut page, service)) = both() else { return };
    let shown = |page: &mut crate::chromium::Page, selector: &str| {
        page.evaluate(&format!(
            "[...document.querySelectorAll({})].filter(it => it.checkVisibility()).length",
            json!(selector)
        ))
        .as_u64()
        .unwrap()
    };
    for (room, inputs) in [
        ("feed-schedule", &["Segments 4:", "Zones 6:", "Supports 2:", "Power 10 kW"][..]),
        ("deflection-compensation", &["Segments 1:", "Length 2000 mm", "Supports 2:"]),
    ] {
        page.screen(1440, 900, true);
        page.open(&service.page(room));
        page.until(SETTLED);
        page.call("Emulation.setEmulatedMedia", json!({"media": "print"}));
        page.evaluate("dispatchEvent(new Event('beforeprint'))");
        page.until("document.querySelector('.sheet').checkVisibility()");
        let sheet = page.text(".sheet");
        for input in inputs {
            assert!(sheet.contains(input), "{room}: {input} is not in {sheet}");
        }
        assert!(sheet.contains("b3:") && sheet.contains(&format!("{room} version")), "{sheet}");
        assert_eq!(
            shown(&mut page, ".form-pane, .shell, .bar, [role=tablist], .figure-choice, .tools, .words .more"),
            0
        );
        assert!(shown(&mut page, ".picture svg.chart") >= 4 && shown(&mut page, ".verdict") == 1);
        // Of warnings that are folded on the screen none is missing on paper.
        let told = page.evaluate("fetch('/v1/results/' + document.querySelector('.sheet').textContent.match(/b3:[0-9a-f]+/)[0]).then(it => it.json()).then(it => it.warnings.length)");
        page.until(&format!("document.querySelectorAll('.warnings li').length === {told}"));
        // Paper is white, whatever the screen is.
        assert_eq!(page.evaluate("getComputedStyle(document.body).backgroundColor"), "rgb(255, 255, 255)");
        assert!(page.evaluate("document.documentElement.scrollWidth <= innerWidth") == true);
        page.evaluate("dispatchEvent(new Event('afterprint'))");
    }
    page.assert_calm();
}

/// While the inputs are those of no answer yet, the sheet and the request are still those of the answer that is shown.
#[test]
fn the_sheet_and_the_request_have_the_inputs_of_the_answer_shown() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation?/cut/feed_mm_per_rev=0.37"));
    page.until(SETTLED);
    page.click("#tab-request");
    page.until("document.querySelector('[role=tabpanel] pre')?.textContent.includes('0.37')");
    let (sheet, request) = (page.text(".sheet ul"), page.text("[role=tabpanel]"));
    assert!(sheet.contains("0.37 mm/rev"), "{sheet}");
    page.fill("#field-cut-feed_mm_per_rev", "888");
    page.wait_for(".problem[role=alert]");
    page.wait_for(".stale-note");
    assert_eq!(page.text(".sheet ul"), sheet);
    assert_eq!(page.text("[role=tabpanel]"), request);
    page.assert_calm();
}

#[test]
fn a_default_says_where_it_comes_from_and_many_pictures_are_a_list() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    // The material is named, its numbers are grey; the line below says which material, and whose number it is.
    page.evaluate("document.querySelector('#field-shaft-youngs_modulus_n_per_mm2').focus()");
    page.until("/from the material .*\\(.+\\)/.test(document.querySelector('.help').textContent)");
    // Another material is another source, told while the field is still the one being edited.
    page.evaluate(
        "{ const list = document.querySelector('#field-shaft-material'); list.value = 'c60'; \
         list.dispatchEvent(new Event('change', { bubbles: true })); }",
    );
    page.until("/from the material .*C60.*\\(.+\\)/.test(document.querySelector('.help').textContent)");
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    let first = page.text(".picture h2");
    let count = page.evaluate("document.querySelectorAll('#figure option').length").as_u64().unwrap();
    assert!(count > 6, "{count}");
    page.click("[aria-label='The next picture']");
    page.until(&format!("document.querySelector('.picture h2').textContent !== {}", json!(first)));
    page.click("[aria-label='The picture before']");
    page.click("[aria-label='The picture before']");
    page.until(&format!("document.querySelector('#figure').selectedIndex === {}", count - 1));
    assert!(page.text(".figure-pick").ends_with(&format!("{count} / {count}")));
    page.assert_calm();
}
