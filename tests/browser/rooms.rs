//! The pages of the calculators: fill, see, compare, drop a table, take it away.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::{DRAWN, SETTLED, both, looking};

/// What stands along the abscissa of the main picture.
const TICKS: &str =
    "[...document.querySelectorAll('.picture.main .tick-labels[text-anchor=middle] text')].map(it => it.textContent)";
/// Whether the picture shows all of it.
const WHOLE: &str = "document.querySelector('[aria-label^=\"Show all\"]').disabled";
const FEED: &str = "#field-cut-feed_mm_per_rev";

#[test]
fn every_calculator_shows_its_first_example_as_a_picture_with_words() {
    let Some((_turn, mut page, service)) = looking() else { return };
    page.open(&service.page(""));
    page.wait_for(".questions li");
    let rooms =
        page.evaluate("[...document.querySelectorAll('.questions li > a')].map(link => link.getAttribute('href'))");
    let rooms: Vec<&str> = rooms.as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(rooms.len() >= 5, "{rooms:?}");
    for room in rooms {
        page.open(&service.page(room.trim_start_matches("#/")));
        page.until(SETTLED);
        assert!(page.text(".verdict").len() > 20, "{room} explains itself");
        let fields = page.evaluate("document.querySelectorAll('.form input, .form select').length");
        assert!(fields.as_u64().unwrap() >= 2, "{room} has a form");
        let drawn = page.evaluate(DRAWN);
        assert!(drawn.as_str().unwrap().len() > 200, "{room} draws");
        assert!(!drawn.as_str().unwrap().contains("NaN"), "{room}: {drawn}");
    }
    // Nothing came from anywhere else.
    let foreign = page.evaluate(
        "performance.getEntriesByType('resource').map(it => it.name).filter(name => !name.startsWith(location.origin))",
    );
    assert_eq!(foreign, json!([]));
    page.assert_calm();
}

#[test]
fn a_changed_number_changes_the_picture_and_the_address() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    assert_eq!(page.value(FEED), "0.5");
    let before = page.evaluate(DRAWN);
    let verdict = page.text(".verdict");

    // A decimal comma is as good as a point.
    page.fill(FEED, "0,25");
    page.until(&format!("({DRAWN}) !== {before} && {SETTLED}"));
    assert_ne!(page.text(".verdict"), verdict);
    page.until("location.hash.includes('/cut/feed_mm_per_rev=0.25')");

    // The arrow keys nudge it.
    page.press("ArrowUp");
    page.until("location.hash.includes('/cut/feed_mm_per_rev=0.26')");
    assert_eq!(page.value(FEED), "0.26");

    // So does the way back, change by change, and forward again.
    for (step, value) in [("back", "0.25"), ("back", "0.5"), ("forward", "0.25"), ("forward", "0.26")] {
        page.evaluate(&format!("history.{step}()"));
        page.until(&format!("document.querySelector('{FEED}').value === '{value}' && {SETTLED}"));
    }
    // The address brings it all back.
    let address = page.evaluate("location.href");
    page.open(address.as_str().unwrap());
    page.until(SETTLED);
    assert_eq!(page.value(FEED), "0.26");
    page.pick("#example", "stepped_with_rest");
    page.until(&format!("document.querySelector('{FEED}').value !== '0.26' && {SETTLED}"));
    page.evaluate("history.back()");
    page.until(&format!("document.querySelector('{FEED}').value === '0.26' && {SETTLED}"));
    page.assert_calm();
}

#[test]
fn a_fault_stands_at_its_field_in_the_words_of_the_service() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill(FEED, "900");
    page.wait_for(".problem[role=alert]");
    page.wait_for("#field-cut-feed_mm_per_rev-fault");
    let fault = page.text("#field-cut-feed_mm_per_rev-fault");
    assert!(fault.contains("900") && fault.contains("20"), "{fault}");
    let field = page.evaluate(&format!("(() => {{ const it = document.querySelector('{FEED}'); return [it.getAttribute('aria-invalid'), it.getAttribute('aria-describedby')] }})()"));
    assert_eq!(field[0], "true");
    assert!(field[1].as_str().unwrap().contains("-fault"));
    // The pointer in the list leads to it.
    page.evaluate("document.activeElement.blur()");
    page.click(".problem .link");
    page.until(&format!("document.activeElement === document.querySelector('{FEED}')"));
    page.fill(FEED, "0.3");
    page.until(&format!("!document.querySelector('.problem') && !document.querySelector('{FEED}-fault') && {SETTLED}"));
    // What is no number is said without asking.
    page.fill(FEED, "a little");
    page.wait_for("#field-cut-feed_mm_per_rev-fault");
    page.assert_calm();
}

#[test]
fn what_cannot_be_read_makes_the_result_an_old_one_and_is_computed_only_once_it_can() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill(FEED, "0,5 mm");
    page.wait_for(".stale-note");
    assert!(page.text("#field-cut-feed_mm_per_rev-fault").contains("“mm” is no unit that fits here"));
    assert!(page.text(".pane-switch .badge").starts_with('1'));
    page.evaluate("document.activeElement.blur()");
    page.click(".form-head .primary");
    page.until(&format!("document.activeElement === document.querySelector('{FEED}')"));
    assert_eq!(page.value(FEED), "0,5 mm");
    // It is said in the language of the page, also after a switch.
    page.click_on("RU");
    page.until("/[а-я]/.test(document.querySelector('#field-cut-feed_mm_per_rev-fault').textContent)");
    page.click_on("EN");
    page.until("document.documentElement.lang === 'en'");
    page.fill(FEED, "0.3");
    page.until(&format!(
        "!document.querySelector('.stale-note, .pane-switch .badge') && location.hash.includes('feed_mm_per_rev=0.3') && {SETTLED}"
    ));
    page.assert_calm();
}

#[test]
fn a_service_with_too_much_to_do_is_asked_again() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.evaluate(
        "(() => { const own = window.fetch; window.refused = 0; window.fetch = (path, options) => { \
         if (options?.method !== 'POST' || refused === 2) return own(path, options); \
         refused += 1; \
         return Promise.resolve(new Response('{\"title\": \"Too many requests\"}', {status: 429, headers: {'Retry-After': '1'}})) } })()",
    );
    page.fill(FEED, "0.35");
    page.until(&format!(
        "refused === 2 && location.hash.includes('feed_mm_per_rev=0.35') && !document.querySelector('.stale-note') && {SETTLED}"
    ));
    assert_eq!(page.evaluate("document.querySelectorAll('.problem').length"), 0);
    page.assert_calm();
}

#[test]
fn a_run_is_pinned_compared_and_read() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.click_on("Pin to compare");
    page.until("location.hash.includes('pin=b3:')");
    page.fill(FEED, "0.2");
    page.until(&format!("document.querySelector('.chart .ghost') && {SETTLED}"));
    page.until("document.querySelectorAll('.value-table thead:not(.hidden) th').length >= 5");
    page.click(".bar input[type=checkbox]");
    page.until("document.querySelector('.axis-name').textContent.includes('Δ')");
    page.click(".bar input[type=checkbox]");

    // The mouse reads all curves at one place; so do the keys.
    let middle = page.middle(".stack svg.chart");
    page.point(middle);
    page.until("[...document.querySelectorAll('.series output')].filter(it => it.textContent).length >= 4");
    page.evaluate("document.querySelector('.plot').focus()");
    page.press("ArrowRight");
    page.until("document.querySelector('.picture [role=status]').textContent.includes('µm')");

    // Dragging shows a part of it, Escape all of it. What has the focus may have been moved into view.
    let middle = page.middle(".stack svg.chart");
    page.drag((middle.0 - 100.0, middle.1), (middle.0 + 50.0, middle.1));
    page.until("!document.querySelector('[aria-label^=\"Show all\"]').disabled");
    page.evaluate("document.querySelector('.plot').focus()");
    page.press("Escape");
    page.until("document.querySelector('[aria-label^=\"Show all\"]').disabled");

    // The same as numbers.
    page.click("[aria-label='As a table']");
    page.until("document.querySelectorAll('.numbers tbody tr').length > 20");
    page.assert_calm();
}

/// A wheel turned for ever shows neither more than there is nor so little of it that no number can be told from the next.
#[test]
fn the_wheel_zooms_between_all_of_the_picture_and_the_smallest_part_of_it() {
    let Some((_turn, mut page, service)) = both() else { return };
    // A linear axis, a logarithmic one, a map.
    for room in ["deflection-compensation", "feed-schedule", "fixture-stability?example=lobes"] {
        page.open(&service.page(room));
        page.until(SETTLED);
        let turned = |times: u32, by: i32| {
            format!(
                "(async () => {{ const stack = document.querySelector('.stack'), box = stack.getBoundingClientRect(); \
                 for (let turn = 0; turn < {times}; turn += 1) {{ \
                 stack.dispatchEvent(new WheelEvent('wheel', {{deltaY: {by}, ctrlKey: true, bubbles: true, cancelable: true, clientX: box.x + 0.4 * box.width, clientY: box.y + 90}})); \
                 await new Promise(done => setTimeout(done)) }} }})()"
            )
        };
        let whole = page.evaluate(TICKS);
        page.evaluate(&turned(150, -1));
        let near = page.evaluate(TICKS);
        assert_ne!(near, whole, "{room}");
        let texts: std::collections::BTreeSet<&str> =
            near.as_array().unwrap().iter().filter_map(Value::as_str).collect();
        assert!(texts.len() >= 2, "{room}: {near}");
        assert!(!page.evaluate(DRAWN).as_str().unwrap().contains("NaN"), "{room}");
        // As many turns back as lead from the smallest part to the whole.
        page.evaluate(&turned(45, 1));
        assert_eq!(page.evaluate(WHOLE), true, "{room}: {}", page.evaluate(TICKS));
        page.evaluate(&turned(5, 1));
        assert_eq!(page.evaluate(TICKS), whole, "{room}");
    }
    page.assert_calm();
}

#[test]
fn a_click_in_the_lobes_tries_that_point() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("fixture-stability?example=lobes"));
    page.until(SETTLED);
    let speed = page.value("#field-cut-spindle_speed_rpm");
    let depth = page.value("#field-cut-depth_mm");
    page.click(".stack svg.chart");
    page.until(&format!(
        "document.querySelector('#field-cut-spindle_speed_rpm').value !== {} && {SETTLED}",
        json!(speed)
    ));
    assert_ne!(page.value("#field-cut-depth_mm"), depth);
    page.assert_calm();
}

#[test]
fn a_dropped_csv_is_matched_by_column_and_unit_and_evaluated() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("roundness-evaluation"));
    page.until(SETTLED);
    let before = page.text(".verdict");
    // Three lobes of 4 µm, in mm, with a decimal comma and a column of no use.
    let rows: Vec<String> = (0..120)
        .map(|row| {
            let angle = 3.0 * f64::from(row);
            let deviation = 0.004 * (3.0 * angle.to_radians()).cos();
            format!("{angle};{deviation:.6};ok").replace('.', ",")
        })
        .collect();
    let csv = format!("Position (deg);Deviation [mm];Remark\n{}\n", rows.join("\n"));
    page.evaluate(&format!(
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([{}], 'ring.csv', {{type: 'text/csv'}})); \
         document.querySelector('.table-input').dispatchEvent(new DragEvent('drop', {{bubbles: true, cancelable: true, dataTransfer: data}})) }})()",
        json!(csv)
    ));
    page.wait_for(".matching");
    // The angle goes by another name here: what is guessed says so, until the user says which column it is.
    let ready = "!document.querySelector('.matching .primary').disabled";
    let guesses = "document.querySelectorAll('.matching .guessed').length";
    assert_eq!(page.evaluate(guesses), 2);
    page.pick(".matching tbody tr:nth-child(1) select", "0");
    page.until(&format!("{ready} && {guesses} === 1"));
    assert_eq!(page.value(".matching tbody tr:nth-child(2) td:nth-child(3) select"), "mm");
    page.click(".matching .primary");
    page.until(&format!("document.querySelector('.verdict').textContent !== {} && {SETTLED}", json!(before)));
    // Cosine of three waves, 4 µm: peak to valley about the least-squares circle 8 µm, a little less behind the filter.
    let verdict = page.text(".verdict");
    let roundness: f64 =
        verdict.split("circle is ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap().parse().unwrap();
    assert!((7.0..8.01).contains(&roundness), "{verdict}");
    assert!(page.text(".table-state").contains("120"));

    // Too large for an address, the job is found again by its kept result.
    page.until("location.hash.includes('result=b3:')");
    let address = page.evaluate("location.href");
    page.open(address.as_str().unwrap());
    page.until(SETTLED);
    assert_eq!(page.text(".verdict"), verdict);
    page.assert_calm();
}

#[test]
fn results_are_downloaded_in_every_form() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    for (button, ending, begins) in [
        ("JSON", "json", "{\"calculator\""),
        ("CSV", "csv", "z"),
        ("XLSX", "xlsx", "PK"),
        ("PDF", "pdf", "%PDF-1.7"),
        ("SVG", "svg", "<svg"),
        ("G-code", "nc", ""),
    ] {
        page.click_on(button);
        let start = Instant::now();
        let text = loop {
            let files: Vec<_> =
                std::fs::read_dir(page.downloads.path()).unwrap().map(|file| file.unwrap().path()).collect();
            let found = files.iter().find(|file| file.extension().is_some_and(|own| own == ending));
            // It is there before it is complete.
            let text = found.map(|file| std::fs::read(file).unwrap()).unwrap_or_default();
            let text = String::from_utf8_lossy(&text).into_owned();
            if text.len() > 200 {
                break text;
            }
            assert!(start.elapsed() < Duration::from_secs(20), "no .{ending} in {files:?}");
            std::thread::sleep(Duration::from_millis(50));
        };
        assert!(text.starts_with(begins), "{button}: {}", text.chars().take(100).collect::<String>());
    }
    // The other forms in the page itself.
    page.click("#tab-tables");
    page.until("document.querySelectorAll('[role=tabpanel] tbody tr').length > 100");
    page.click("#tab-program");
    page.until("document.querySelector('[role=tabpanel] pre')?.textContent.includes('G1')");
    page.click("#tab-request");
    page.until("document.querySelector('[role=tabpanel] pre')?.textContent.startsWith('curl ')");
    page.click("#tab-basis");
    page.until("document.querySelector('[role=tabpanel] code')?.textContent.includes('deflection/')");
    page.assert_calm();
}
