//! Every state of the page, and what the workbench promises, at every size, in both languages, light and dark.

use serde_json::json;

use crate::access::rooms;
use crate::chromium::Page;
use crate::sizes::{assert_fits, at_sizes, fits, pane};
use crate::{SETTLED, both, looking};

/// A shaft with steps, a rest and a table of segments.
const SHAFT: &str = "deflection-compensation?example=stepped_with_rest";
const CELL: &str = "#field-shaft-segments-0-diameter_mm";
const CURRENT: &str = "!document.querySelector('.not-theirs')";

/// Types into a field, also where the pane with it is not shown.
fn typed(page: &mut Page, field: &str, text: &str) {
    pane(page, "form");
    page.fill(field, text);
    pane(page, "picture");
}

#[test]
fn no_state_of_the_page_breaks_a_rule_of_axe_or_its_window() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(""));
    page.until("document.querySelectorAll('.outcome-picture svg path').length > 20");
    assert_fits(&mut page, 0, "start");
    page.open(&service.page(SHAFT));
    page.until(SETTLED);
    assert_fits(&mut page, 1, "answer");
    pane(&mut page, "form");
    page.evaluate("document.querySelectorAll('.fold-head button[aria-expanded=false]').forEach(it => it.click())");
    assert_fits(&mut page, 2, "form");
    typed(&mut page, CELL, "60 kg");
    page.wait_for(".strip.unread");
    assert_fits(&mut page, 3, "unread");
    typed(&mut page, CELL, "900000");
    page.wait_for(".strip.wrong .problem");
    assert_fits(&mut page, 0, "refused");
    run_for_ever(&mut page);
    typed(&mut page, CELL, "44");
    page.wait_for(".progress-box");
    assert_fits(&mut page, 1, "running");
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    assert_fits(&mut page, 2, "diagnosis");
    let broken = "deflection-compensation?example=nothing_like_it";
    for (turn, (place, there)) in [
        (broken, ".plain-list a"),
        ("library", ".record-copy"),
        ("studies", "#run-study"),
        ("jobs", "main h1"),
        ("results", ".list tbody a"),
        ("models", "main h1"),
    ]
    .into_iter()
    .enumerate()
    {
        page.open(&service.page(place));
        page.wait_for(there);
        assert_fits(&mut page, 3 + turn, place);
    }
    page.assert_calm();
}

/// From now on what is asked becomes a job that runs and is never done.
fn run_for_ever(page: &mut Page) {
    page.evaluate(
        "(() => { const own = window.fetch; const id = '00000000-0000-4000-8000-000000000001'; const job = { id, state: 'running', progress: 0.4, remaining_ms: 90000 }; \
         window.fetch = (path, options) => { \
         if (options?.method === 'POST') return Promise.resolve(new Response(JSON.stringify(job), { status: 202, headers: { 'Content-Type': 'application/json' } })); \
         if (String(path).endsWith('/events')) return Promise.resolve(new Response(new ReadableStream({ start: go => go.enqueue(new TextEncoder().encode(`event: state\\ndata: ${JSON.stringify(job)}\\n\\nevent: progress\\ndata: ${JSON.stringify({ ...job, stage: 'run' })}\\n\\n`)) }))); \
         return own(path, options) } })()",
    );
}

/// Whether all of an element is in sight.
const IN_SIGHT: &str = "(it => { const box = it.getBoundingClientRect(); return box.height > 0 && box.top >= 0 && box.left >= 0 && box.right <= innerWidth + 1 && box.bottom <= innerHeight })";

/// 4: the first screen has the answer and a picture of it, and the answer stays where one scrolls.
#[test]
fn the_first_screen_shows_the_answer_and_its_picture() {
    let Some((_turn, mut page, service)) = looking() else { return };
    for (turn, room) in
        ["deflection-compensation", "ring-roundness", "feed-schedule", "fixture-stability?example=lobes", "diagnosis"]
            .into_iter()
            .enumerate()
    {
        page.open(&service.page(room));
        page.until(SETTLED);
        at_sizes(&mut page, turn, |page, size| {
            page.evaluate("scrollTo(0, 0)");
            let seen = format!(
                "['.verdict', '.headline dd', '#take'].every(part => {{ const it = document.querySelector(part); const box = it.getBoundingClientRect(); const at = document.elementFromPoint(box.x + box.width / 2, box.y + Math.min(box.height, 16) / 2); return {IN_SIGHT}(it) && (it.contains(at) || at?.contains(it)) }})"
            );
            page.until(&seen);
            // All of a picture of one panel, the first panel of others; on a phone the names above a map leave no more of it.
            page.until("(() => { const charts = [...document.querySelectorAll('.picture.main svg.chart')]; const { top, bottom, height } = charts[0].getBoundingClientRect(); return innerWidth < 861 && charts.length === 1 ? Math.min(bottom, innerHeight) - top > 0.7 * height : bottom <= innerHeight })()");
            // No number runs into the button.
            let apart = "(() => { const take = document.querySelector('.hand-over').getBoundingClientRect(); return [...document.querySelectorAll('.headline dd')].filter(it => it.checkVisibility()).every(it => { const range = document.createRange(); range.selectNodeContents(it); const box = range.getBoundingClientRect(); return box.right <= take.left || box.bottom <= take.top || box.top >= take.bottom }) })()";
            assert_eq!(page.evaluate(apart), true, "{room} at {size}");
            page.evaluate("scrollTo(0, document.documentElement.scrollHeight)");
            page.until(&seen);
            assert!(page.evaluate("scrollY").as_f64().unwrap() > 0.0, "{room} at {size}");
        });
    }
    page.assert_calm();
}

/// 1: what cannot be read makes the answer another's, and nothing of it leaves the page.
#[test]
fn nothing_leaves_the_page_that_is_not_of_its_inputs() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(SHAFT));
    page.until(SETTLED);
    let closed =
        "[document.querySelector('#take'), ...document.querySelectorAll('.downloads button')].every(it => it.disabled)";
    let on_paper = "[...document.querySelectorAll('.verdict, .headline, .picture, .sheet, .not-printed')].filter(it => it.checkVisibility()).map(it => it.className)";
    at_sizes(&mut page, 1, |page, size| {
        typed(page, CELL, "60 kg");
        page.until(&format!("document.querySelector('.strip.unread .stale-note') && {closed}"));
        page.call("Emulation.setEmulatedMedia", json!({"media": "print"}));
        assert_eq!(page.evaluate(on_paper), json!(["not-printed"]), "{size}");
        page.call("Emulation.setEmulatedMedia", json!({"media": ""}));
        typed(page, CELL, "1.5 in");
        page.until(&format!("{CURRENT} && {SETTLED} && !document.querySelector('#take').disabled"));
    });
    page.assert_calm();
}

/// 2: a file is shown with its columns and its chart before it is used, and meanwhile nothing is an answer to it.
#[test]
fn a_file_is_shown_before_it_is_used_at_every_size() {
    let Some((_turn, mut page, service)) = both() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("shaft.csv");
    std::fs::write(&file, "Pos (mm);Measured dia, inch\n10;1.2601\n20;1.2602\n30;1.2603\n").unwrap();
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    page.choose_file("input[data-table=measurements]", &file);
    page.wait_for(".matching");
    pane(&mut page, "form");
    at_sizes(&mut page, 2, |page, size| {
        for part in [".match tbody tr:last-child", ".table-chart svg", ".primary"] {
            let part = format!(".matching {part}");
            page.evaluate(&format!("document.querySelector('{part}').scrollIntoView({{ block: 'center' }})"));
            page.until(&format!("{IN_SIGHT}(document.querySelector('{part}'))"));
        }
        assert_eq!(page.evaluate("document.querySelector('#take').disabled"), true, "{size}");
        fits(page, &format!("a table that waits at {size}"));
    });
    page.assert_calm();
}

/// 2: a file can be chosen for every measured table that a calculator asks for, on a phone.
#[test]
fn every_measured_table_takes_a_chosen_file() {
    let Some((_turn, mut page, service)) = both() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("no_heading.csv");
    std::fs::write(&file, "0;1,5\n6;2\n12;2,5\n").unwrap();
    page.screen(390, 844, false);
    let mut tables = 0;
    for room in rooms(&mut page, &service) {
        page.open(&service.page(&room));
        page.until(SETTLED);
        pane(&mut page, "form");
        let found =
            page.evaluate("[...document.querySelectorAll('input[type=file][data-table]')].map(it => it.dataset.table)");
        for table in found.as_array().unwrap().iter().filter_map(serde_json::Value::as_str) {
            page.choose_file(&format!("input[data-table={table}]"), &file);
            page.until("document.querySelectorAll('.matching .match tbody tr').length > 0 && document.querySelector('#take').disabled");
            page.click_on("Cancel");
            page.until("!document.querySelector('.matching') && !document.querySelector('#take').disabled");
            tables += 1;
        }
    }
    assert!(tables >= 4, "{tables} tables");
    page.assert_calm();
}

/// After `gated()` what is asked waits until `go()`.
const GATE: &str = "(() => { const own = window.fetch; let open = null; let gate = null; \
    window.gated = () => { gate = new Promise(go => { open = go }) }; window.go = () => { open?.(); gate = null }; \
    window.fetch = async (path, options) => { const waits = options?.method === 'POST' ? gate : null; await waits; return own(path, options) } })()";

/// 3 and 5: a handle stands at the place that the axis says, goes where the hand puts it, and says what that does; until that is
/// computed what was there before is dimmed.
#[test]
fn handles_stand_on_the_axis_and_follow_the_hand() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(SHAFT));
    page.until(SETTLED);
    page.evaluate(GATE);
    let shoulder = ".grip[data-name=handle_shoulder]";
    let place = format!("Number(document.querySelector('{shoulder}').getAttribute('aria-valuenow'))");
    // Where two numbers of the axis stand says where all others are.
    let off = format!(
        "(() => {{ const middle = it => {{ const box = it.getBoundingClientRect(); return box.x + box.width / 2 }}; \
         const [first, second] = [...document.querySelectorAll('.picture.main .tick-labels[text-anchor=middle] text')].map(it => [Number(it.textContent.replace(/[\\s\u{202f}]/g, '')), middle(it)]); \
         return (middle(document.querySelector('{shoulder}')) - first[1]) / (second[1] - first[1]) - ({place} - first[0]) / (second[0] - first[0]) }})()"
    );
    at_sizes(&mut page, 3, |page, size| {
        page.until(&format!("{CURRENT} && {SETTLED} && document.querySelector('{shoulder}')"));
        // In steps of the axis, of which a label and a handle know their middles to half a pixel.
        assert!(page.evaluate(&off).as_f64().unwrap().abs() < 0.03, "{size}: {}", page.evaluate(&off));
        // None is so near to another that it would be hidden.
        for name in ["handle_end", "handle_centre", "handle_shoulder", "handle_diameter"] {
            let there = format!("document.querySelector('.grip[data-name={name}]') !== null");
            assert_eq!(page.evaluate(&there), true, "{name} at {size}");
        }
        let before = page.evaluate(&place);
        page.evaluate(&format!("(gated(), document.querySelector('{shoulder}').focus())"));
        page.press("ArrowLeft");
        page.wait_for(".strip.not-theirs ~ .result.stale");
        page.evaluate("go()");
        page.until(&format!("{place} < {before} && {CURRENT} && {SETTLED}"));
        page.until(&format!(
            "document.activeElement.matches('{shoulder}') && document.querySelector('{shoulder} b').checkVisibility()"
        ));
    });
    page.assert_calm();
}

/// 5: so do the ends of a schedule's zones, and the supports and the tool of a ring round its picture.
#[test]
fn zones_and_the_supports_of_a_ring_follow_the_hand() {
    let Some((_turn, mut page, service)) = both() else { return };
    for (room, grip) in
        [("feed-schedule", ".grip[data-name=handle_zone]"), ("ring-roundness?example=clear_start", ".grip.round")]
    {
        page.open(&service.page(room));
        page.until(SETTLED);
        page.wait_for(grip);
        let place = format!("Number(document.querySelector('{grip}').getAttribute('aria-valuenow'))");
        let (before, job) = (page.evaluate(&place), page.evaluate("location.hash"));
        page.evaluate(&format!("document.querySelector('{grip}').focus()"));
        page.press("ArrowRight");
        page.until(&format!("{place} !== {before} && location.hash !== {job} && {CURRENT} && {SETTLED}"));
    }
    page.assert_calm();
}

/// 6: the lobes as a decision: what is safe is shaded and named, and the better speeds stand with their numbers to be pressed.
#[test]
fn lobes_are_a_decision_at_every_size() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("fixture-stability?example=lobes"));
    page.until(SETTLED);
    at_sizes(&mut page, 1, |page, size| {
        assert_eq!(page.evaluate("document.querySelectorAll('.picture.main path.band').length > 0"), true, "{size}");
        let words = page.evaluate("document.querySelector('.picture.main .key').textContent.length");
        assert!(words.as_u64().unwrap() > 20, "the colours in words at {size}");
        page.middle(".offers li button");
        page.until(&format!("document.querySelectorAll('.offers li').length > 0 && [...document.querySelectorAll('.offers li')].every(it => it.querySelectorAll('dd').length >= 4) && {IN_SIGHT}(document.querySelector('.offers li button'))"));
    });
    page.assert_calm();
}

/// 8: a pinned run and the one after it are told apart in words and numbers, on the screen and on paper.
#[test]
fn two_runs_are_told_apart_on_the_screen_and_on_paper() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.click_on("Pin to compare");
    page.fill("#field-cut-feed_mm_per_rev", "0.2");
    page.until(&format!("document.querySelector('.chart .ghost') && {CURRENT} && {SETTLED}"));
    let legend = "(() => { const it = document.querySelector('.pin-legend'); return it.checkVisibility() && /[AА].*[BБ]/.test(it.textContent) })()";
    at_sizes(&mut page, 2, |page, size| {
        assert_eq!(page.evaluate(legend), true, "{size}");
        page.call("Emulation.setEmulatedMedia", json!({"media": "print"}));
        assert_eq!(page.evaluate(legend), true, "{size} on paper");
        page.call("Emulation.setEmulatedMedia", json!({"media": ""}));
    });
    page.click(".bar input[type=checkbox]");
    page.until("document.querySelector('.pin-legend').textContent.startsWith('B minus A')");
    page.assert_calm();
}

/// 8: the first stops of the keyboard lead to the answer and its button; what is explained follows the cursor.
#[test]
fn the_keyboard_is_led_to_the_answer_and_its_button() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    at_sizes(&mut page, 0, |page, size| {
        page.evaluate("(scrollTo(0, 0), document.querySelectorAll('.skip')[1].focus())");
        page.until(&format!("{IN_SIGHT}(document.activeElement)"));
        page.press("Enter");
        page.until("document.activeElement.id === 'answer'");
        page.press("Tab");
        assert_eq!(page.evaluate("document.activeElement.id"), "take", "{size}");
        pane(page, "form");
        // What is under the mouse would be explained before that.
        page.point((1.0, 1.0));
        for field in ["#field-cut-feed_mm_per_rev", "#field-supports-0-compliance_um_per_n"] {
            page.evaluate(&format!("document.querySelector('{field}').focus()"));
            page.until(&format!("document.querySelector('.help strong').textContent.length > 2 && document.querySelector('{field}').closest('.row').querySelector('.label').textContent.startsWith(document.querySelector('.help strong').textContent)"));
        }
        pane(page, "picture");
    });
    page.assert_calm();
}

/// 8: what a finger has to hit is large enough for one.
#[test]
fn what_is_pressed_with_a_finger_is_as_large_as_one() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.call("Emulation.setTouchEmulationEnabled", json!({"enabled": true}));
    page.open(&service.page(SHAFT));
    page.until(SETTLED);
    for (width, height) in [(390, 844), (1024, 600)] {
        page.screen(width, height, false);
        page.until(&format!("innerWidth === {width} && matchMedia('(pointer: coarse)').matches"));
        for name in ["picture", "form"] {
            pane(&mut page, name);
            let small = "[...document.querySelectorAll('.strip button, .form button.icon, .form input:not([type=checkbox]), .form select, .form-head button, .pane-switch button, .figure-choice button, .tools button, [role=tab], .grip, .bar button, .languages button')].filter(it => it.checkVisibility()).map(it => [it.id || it.className || it.textContent, Math.round(it.getBoundingClientRect().height)]).filter(([, height]) => height < 36)";
            assert_eq!(page.evaluate(small), json!([]), "{name} at {width}");
        }
        // The hint is one for fingers.
        page.evaluate("document.activeElement.blur()");
        pane(&mut page, "form");
        page.until("document.querySelector('.help .quiet')?.textContent.startsWith('Tap a field')");
    }
    page.assert_calm();
}
