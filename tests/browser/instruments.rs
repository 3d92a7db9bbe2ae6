//! What is particular to single calculators: the replay of a ring, the map of set-ups, the trade-off of a schedule,
//! the clamp force, and numbers with the digits that their uncertainty leaves.

use serde_json::{Value, json};

use crate::chromium::Page;
use crate::{DRAWN, SETTLED, both};

const LIMIT: &str = "#field-zones-0-deflection_max_um";

/// The result behind the key that the page shows under "Basis".
fn shown_result(page: &mut Page) -> Value {
    page.click("#tab-basis");
    page.wait_for(".key-text");
    page.evaluate(
        "(async () => (await (await fetch('/v1/results/' + document.querySelector('.key-text').textContent)).json()).result)()",
    )
}

fn number(value: &Value, place: &str) -> f64 {
    value.pointer(place).and_then(Value::as_f64).unwrap_or_else(|| panic!("{place}: {value}"))
}

/// Opens the picture whose button begins so.
fn choose(page: &mut Page, name: &str) {
    page.click_on(name);
    page.until(&format!(
        "document.querySelector('.figure-choice [aria-pressed=true]').textContent.startsWith({})",
        json!(name)
    ));
}

#[test]
fn the_history_of_a_ring_is_gone_through_revolution_by_revolution() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("ring-roundness?example=clear_start"));
    page.until(SETTLED);
    let end = page.evaluate(DRAWN);
    // Tool and supports stand where they touch.
    assert_eq!(page.evaluate("document.querySelectorAll('.polar .glyph').length"), 3);
    page.evaluate("document.querySelector('#replay').focus()");
    page.press("Home");
    page.until("document.querySelector('.scrub-text').textContent.startsWith('Revolution 0 of 108')");
    page.until("document.querySelector('.picture h2').textContent.includes('revolution 0 of')");
    let blank = page.evaluate(DRAWN);
    assert_ne!(blank, end);
    for _ in 0..20 {
        page.press("ArrowRight");
    }
    page.until("document.querySelector('.picture h2').textContent.includes('revolution 20 of')");
    assert_ne!(page.evaluate(DRAWN), blank);
    assert_eq!(page.evaluate("document.querySelectorAll('.polar .glyph').length"), 3);
    // All states came with one answer: one job for the page, one for the replay, and nothing for each step.
    let asked = |ending: &str| {
        format!(
            "performance.getEntriesByType('resource').filter(it => new URL(it.name).pathname.endsWith('{ending}')).length"
        )
    };
    assert_eq!(page.evaluate(&asked("/v1/ring-roundness")), 2);
    assert_eq!(page.evaluate(&asked("/figures")), 0);
    // The deviation drawn is the one that the whole run noted there: a tenth of a pixel of the chart is two in a thousand.
    let whole = shown_result(&mut page);
    let noted = number(&whole, "/simulation/history/roundness_um/19");
    assert!((number(&whole, "/simulation/history/revolution/19") - 20.0).abs() < 0.01);
    page.click("[aria-label='As a table']");
    let drawn = page.evaluate(
        "(() => { const all = [...document.querySelectorAll('.numbers tbody tr')].map(row => Number([...row.querySelectorAll('td')].at(-1).textContent.replace('−', '-'))); \
         return Math.max(...all) - Math.min(...all) })()",
    );
    // The table shows every third of the 360 angles.
    let drawn = drawn.as_f64().unwrap();
    assert!(drawn <= 1.003 * noted && drawn > 0.8 * noted, "{drawn} against {noted}");
    page.click("[aria-label='As a table']");
    // It plays to the end by itself.
    page.click(".scrubber button");
    page.until("document.querySelector('#replay').value === document.querySelector('#replay').max");
    page.until(&format!("({DRAWN}) === {end}"));
    page.assert_calm();
}

#[test]
fn a_cell_of_the_set_up_map_puts_its_angles_into_the_form_by_click_and_by_key() {
    let Some((_turn, mut page, service)) = both() else { return };
    try_set_ups(&mut page, &service.page("ring-roundness?example=set_up"));
    page.assert_calm();
}

/// A support and a tool that stand beside their places in the job: the form gets what makes them really stand there.
#[test]
fn a_set_up_from_the_map_allows_for_known_shifts_of_support_and_tool() {
    let Some((_turn, mut page, service)) = both() else { return };
    let effects = json!([
        { "kind": "support_position", "support_b_shift_mm": 0.8 },
        { "kind": "tool_off_line", "tangential_offset_mm": -0.6 },
    ]);
    let effects = effects.to_string().replace('"', "%22");
    try_set_ups(&mut page, &service.page(&format!("ring-roundness?example=set_up&/effects={effects}")));
    assert!(page.text(".hint").contains("known shifts"));
    page.assert_calm();
}

/// Tries two cells of the map, by click and by key; the real set-up is the one that was pointed at.
fn try_set_ups(page: &mut Page, address: &str) {
    page.open(address);
    page.until(SETTLED);
    choose(page, "Worst wave");
    let before = shown_result(page);
    let picked = |page: &mut Page, was: &str| {
        page.until(&format!(
            "document.querySelector('#field-supports-distance_mm').value !== {} && !document.querySelector('.problem') && {SETTLED}",
            json!(was)
        ));
        let result = shown_result(page);
        let [tool, half] = ["/setup_map/here/tool_angle_deg", "/setup_map/here/support_half_angle_deg"]
            .map(|place| number(&result, place));
        // The middle of a cell: tool angles every 4 degrees, half angles every 2 from 15; millimetres are rounded to 1e-4.
        assert!((tool / 4.0 - (tool / 4.0).round()).abs() < 1e-4, "{tool}");
        assert!(((half - 15.0) / 2.0 - ((half - 15.0) / 2.0).round()).abs() < 1e-4, "{half}");
        // Nothing but the angles differs: neither the size nor what a revolution takes off.
        for place in ["/setting/circumradius_mm", "/setting/half_turn_reduction_um"] {
            assert!((number(&result, place) / number(&before, place) - 1.0).abs() < 1e-5, "{place}");
        }
        (tool, half)
    };
    let was = page.value("#field-supports-distance_mm");
    let (x, y) = page.middle("svg.chart[data-panel='0']");
    page.drag((x + 90.0, y + 20.0), (x + 91.0, y + 20.0));
    let clicked = picked(page, &was);
    page.until("location.hash.includes('/supports/distance_mm=')");

    // From there two cells up and one to the right.
    let was = page.value("#field-supports-distance_mm");
    page.evaluate("document.querySelector('.plot').focus()");
    page.press("Escape");
    for key in ["ArrowRight", "ArrowUp", "ArrowUp"] {
        page.press(key);
    }
    page.until("document.querySelector('.picture [role=status]').textContent.includes('support half angle')");
    page.press("Enter");
    let typed = picked(page, &was);
    assert!(typed.1 > clicked.1 && typed.0 >= clicked.0, "{clicked:?} then {typed:?}");
}

#[test]
fn what_binds_is_a_ribbon_along_the_shaft_that_says_its_zone() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("feed-schedule"));
    page.until(SETTLED);
    let pieces = "document.querySelectorAll('.picture.main rect.ribbon').length";
    assert!(page.evaluate(pieces).as_u64().unwrap() >= 8);
    // It begins and ends with the shaft's zones, on the same axis as the feed above it.
    let ends = page.evaluate(
        "(() => { const ends = boxes => [Math.min(...boxes.map(it => it.left)), Math.max(...boxes.map(it => it.right))]; \
         const panels = [...document.querySelectorAll('.picture.main svg.chart')]; \
         const ribbon = panels.find(it => it.querySelector('rect.ribbon')); \
         return [...ends([...ribbon.querySelectorAll('g rect.ribbon')].map(it => it.getBoundingClientRect())), \
                 ...ends([...panels[1].querySelectorAll('path.line.command')].map(it => it.getBoundingClientRect()))] })()",
    );
    let end = |at: usize| ends[at].as_f64().unwrap();
    assert!((end(0) - end(2)).abs() < 2.5 && (end(1) - end(3)).abs() < 2.5, "{ends}");
    // Not by colour alone: a letter or the name in every piece, the same letters in the legend, patterns.
    let said =
        page.evaluate("[...document.querySelectorAll('.picture.main .chart text.said')].map(it => it.textContent)");
    let letters = page.evaluate("[...document.querySelectorAll('.panel-head .said')].map(it => it.textContent)");
    assert!(!said.as_array().unwrap().is_empty() && letters.as_array().unwrap().len() >= 3, "{said} {letters}");
    assert!(page.evaluate("document.querySelectorAll('.picture.main rect.weave').length").as_u64().unwrap() > 0);
    // The mouse reads the zone, so do the keys.
    let place = page.middle("svg.chart:has(rect.ribbon)");
    page.point(place);
    page.until("/^z\\d/.test(document.querySelector('.stretch').textContent) && [...document.querySelectorAll('.series output')].some(it => it.textContent.includes('%'))");
    page.evaluate("document.querySelector('.plot').focus()");
    page.press("ArrowRight");
    page.until("/z\\d+: .* %/.test(document.querySelector('.picture [role=status]').textContent)");
    // As a table.
    page.click("[aria-label='As a table']");
    page.until("[...document.querySelectorAll('.numbers thead th')].some(it => /deflection/.test(it.textContent) && /%/.test(it.textContent))");
    // A name hides its pieces.
    let before = page.evaluate(pieces);
    page.click(".series:has(.ribbon)");
    page.until(&format!("{pieces} < {before}"));
    // The same in the printed form of the picture, in both languages.
    page.click("#tab-basis");
    page.wait_for(".key-text");
    for (language, word) in [("en", "roughness, hardening"), ("ru", "шероховатость, наклёп")] {
        let svg = page.evaluate(&format!(
            "fetch('/v1/results/' + document.querySelector('.key-text').textContent, {{headers: {{Accept: 'image/svg+xml', 'Accept-Language': '{language}'}}}}).then(it => it.text())"
        ));
        let svg = svg.as_str().unwrap();
        for part in ["class=\"ribbon n0\"", "url(#precut-weave-2)", word, ">A</text>", "<title>z5: "] {
            assert!(svg.contains(part), "{language}: {part}");
        }
    }
    page.assert_calm();
}

#[test]
fn the_point_of_the_trade_off_is_dragged_and_stepped_and_its_tolerance_goes_into_the_form() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("feed-schedule"));
    page.until(SETTLED);
    // The schedule shows roughness against its limit, too.
    page.until("[...document.querySelectorAll('.axis-name')].some(it => it.textContent.startsWith('Roughness'))");
    choose(&mut page, "Objective over");
    assert_eq!(page.value(LIMIT), "10");
    page.until(
        "document.querySelector('.preview')?.dataset.at === '1' && document.querySelector('#take-trial').disabled",
    );

    // By keys: looser, faster; the schedule there lies over the present one.
    page.evaluate("document.querySelector('#trial').focus()");
    for _ in 0..10 {
        page.press("ArrowRight");
    }
    page.until(
        "document.querySelector('.preview .ghost') && Number(document.querySelector('.preview').dataset.at) > 1.1",
    );
    let stepped = page.text(".scrub-text");
    assert!(stepped.contains('µ') && stepped.contains('−'), "{stepped}");

    // By hand along the curve.
    let point = page.middle(".handle");
    page.drag(point, (point.0 + 60.0, point.1));
    page.until(&format!("document.querySelector('.scrub-text').textContent !== {}", json!(stepped)));
    // The schedule below is that of the point, whose factor is told to three digits.
    page.until("Number(document.querySelector('.preview').dataset.at) > 1 && Math.abs(Number(document.querySelector('.preview').dataset.at) / Number(document.querySelector('.scrub-text').textContent.match(/([0-9.]+): /)[1]) - 1) < 0.005");
    assert_eq!(page.value(LIMIT), "10", "nothing is taken before it is asked for");

    let wanted: f64 = page.text(".scrub-text strong").split(' ').find_map(|word| word.parse().ok()).unwrap();
    assert!(wanted > 11.0, "{wanted}");
    page.click("#take-trial");
    page.until(&format!("document.querySelector('{LIMIT}').value !== '10' && {SETTLED}"));
    let taken: f64 = page.value(LIMIT).parse().unwrap();
    assert!((taken - wanted).abs() < 0.01, "{taken} for {wanted}");
    assert_eq!(page.value("#field-zones-5-deflection_max_um"), page.value(LIMIT));
    page.until("document.querySelector('#take-trial').disabled");
    page.assert_calm();
}

#[test]
fn the_working_point_of_the_lobes_is_dragged() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("fixture-stability?example=lobes"));
    page.until(SETTLED);
    let depth = page.value("#field-cut-depth_mm");
    let point = page.middle(".handle");
    page.drag(point, (point.0 + 40.0, point.1 - 30.0));
    page.until(&format!("document.querySelector('#field-cut-depth_mm').value !== {} && {SETTLED}", json!(depth)));
    assert!(page.value("#field-cut-depth_mm").parse::<f64>().unwrap() > depth.parse::<f64>().unwrap());
    page.assert_calm();
}

#[test]
fn the_clamp_force_is_shown_as_asked_and_as_set() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("fixture-stability?example=paper"));
    page.until(&format!("{SETTLED} && document.querySelectorAll('.clamp tr').length === 4"));
    // The first picture is one that shows something: without lobes not an empty plane.
    page.until("document.querySelectorAll('.picture.main path.line').length > 0");
    assert!(page.text(".clamp").contains("is enough"));
    let widths = "[...document.querySelectorAll('.clamp rect')].map(it => Number(it.getAttribute('width')))";
    let bars = page.evaluate(widths);
    assert!(number(&bars, "/3") > number(&bars, "/1") && number(&bars, "/1") > number(&bars, "/0"), "{bars}");
    // Set too low it is said.
    page.fill("#field-fixture-clamp_force_n", "300");
    page.click(".form-head .primary");
    page.until(&format!("document.querySelector('.clamp')?.textContent.includes('not enough') && {SETTLED}"));
    page.assert_calm();
}

#[test]
fn numbers_have_the_digits_that_their_uncertainty_leaves() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("ring-roundness"));
    page.until(SETTLED);
    let value = |page: &mut Page| {
        page.evaluate(
            "[...document.querySelectorAll('.value-table tr')].find(row => /^(Roundness|Отклонение от круглости)$/.test(row.querySelector('th').textContent)).querySelector('td').textContent",
        )
    };
    let shown = value(&mut page);
    let result = shown_result(&mut page);
    let (roundness, error) = (number(&result, "/roundness_um"), number(&result, "/roundness_error_um"));
    assert!((0.1..1.0).contains(&error), "{error}");
    assert_eq!(shown.as_str().unwrap(), format!("{roundness:.2} ± {error:.2}"));
    page.click("#tab-values");
    // Said once: not again in a line of its own.
    assert_eq!(
        page.evaluate(
            "[...document.querySelectorAll('.value-table th')].some(it => it.textContent === 'Roundness error')"
        ),
        false
    );
    page.click_on("RU");
    page.until(&format!("document.documentElement.lang === 'ru' && {SETTLED} && document.querySelector('.value-table td').textContent.includes(',')"));
    assert_eq!(value(&mut page).as_str().unwrap(), format!("{roundness:.2} ± {error:.2}").replace('.', ","));
    page.assert_calm();
}
