//! Parameter studies: from a calculator's page to a table, a map and a file.

use std::time::{Duration, Instant};

use crate::{SETTLED, both};

const DONE: &str = "document.querySelector('.result-pane')?.getAttribute('aria-busy') === 'false' && \
    document.querySelector('.study-rows tbody tr')";

#[test]
fn a_job_is_varied_from_its_own_page_and_every_point_can_be_opened() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill("#field-shaft-segments-0-length_mm", "1500");
    page.until(&format!("location.hash.includes('length_mm=1500') && {SETTLED}"));
    page.fill("#field-supports-1-z_mm", "1500");
    page.click(".form-head .primary");
    page.until(&format!(
        "location.hash.includes('z_mm=1500') && !document.querySelector('.problem') && document.querySelector('#vary')?.href.includes('z_mm=1500') && {SETTLED}"
    ));
    page.click("#vary");
    page.wait_for("#run-study");
    assert_eq!(page.value("#study-calculator"), "deflection-compensation");
    // One field is proposed; another number of values, with a comma in it.
    assert_eq!(page.value("#vary-0"), "/cut/feed_mm_per_rev");
    page.fill("#vary-0-from", "0,2");
    page.fill("#vary-0-to", "0.6");
    page.fill("#vary-0-count", "5");
    page.until("document.querySelector('#study-points').textContent.startsWith('5 ')");
    page.click("#run-study");
    page.until(DONE);
    assert_eq!(page.evaluate("document.querySelectorAll('.study-rows tbody tr').length"), 5);
    assert!(page.text(".study-rows tbody tr:nth-child(2) td").contains("0.3"));
    // Fields go by the names that they have in the form, not by their pointers.
    let verdict = page.text(".verdict");
    let has_pointer = verdict.split_whitespace().any(|word| word.starts_with('/') || word.contains('_'));
    assert!(!has_pointer && verdict.to_lowercase().contains("feed"), "{verdict}");
    page.until("location.hash.includes('study=b3:')");

    // A second field makes it a map, whose cells can be read.
    page.click("#add-varied");
    page.pick("#vary-1", "/cut/spindle_speed_rpm");
    page.fill("#vary-1-count", "4");
    page.until("document.querySelector('#study-points').textContent.startsWith('20 ')");
    page.until("document.querySelector('.so-far')");
    page.click("#run-study");
    page.until(&format!("{DONE} && document.querySelectorAll('.study-rows tbody tr').length === 20 && document.querySelector('.picture image')"));
    page.evaluate("document.querySelector('.plot').focus()");
    for key in ["ArrowRight", "ArrowUp", "Enter"] {
        page.press(key);
    }
    page.until("document.querySelector('.study-rows .picked') && document.querySelector('.hint[role=status] a')");
    page.click_on("Curves");
    page.until("document.querySelectorAll('.series').length >= 4");

    // The table as a file.
    page.click_on("CSV");
    let start = Instant::now();
    let text = loop {
        let file = std::fs::read_dir(page.downloads.path()).unwrap().map(|file| file.unwrap().path()).next();
        let text = file
            .filter(|file| file.extension().is_some_and(|own| own == "csv"))
            .map(|file| std::fs::read_to_string(file).unwrap())
            .unwrap_or_default();
        if text.lines().count() > 20 {
            break text;
        }
        assert!(start.elapsed() < Duration::from_mins(1), "no file");
        std::thread::sleep(Duration::from_millis(50));
    };
    assert!(text.starts_with("cut.feed [mm/rev],cut.spindle_speed"), "{}", &text[..80]);

    // The address brings it back; a point has a page of its own, with the job that was varied.
    let address = page.evaluate("location.href");
    page.open(address.as_str().unwrap());
    page.until(&format!("{DONE} && document.querySelectorAll('.study-rows tbody tr').length === 20"));
    page.click(".study-rows tbody tr a");
    page.until(&format!("location.hash.startsWith('#/deflection-compensation?result=') && {SETTLED}"));
    assert_eq!(page.value("#field-shaft-segments-0-length_mm"), "1500");
    assert_eq!(page.value("#field-cut-feed_mm_per_rev"), "0.2");
    page.assert_calm();
}

#[test]
fn a_point_without_an_answer_keeps_its_row_with_the_reason_and_a_fault_stands_at_its_field() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("studies?calculator=deflection-compensation&example=chuck_and_tailstock"));
    page.wait_for("#run-study");
    page.pick("#vary-0", "/shaft/segments/0/bore_diameter_mm");
    page.click(".study-way label:nth-child(2) input");
    page.fill("#vary-0-values", "0; 10; 20; 45");
    page.click("#run-study");
    page.until(&format!("{DONE} && document.querySelector('.reason')"));
    assert_eq!(page.evaluate("document.querySelectorAll('.study-rows tbody tr').length"), 4);
    let reason = page.text(".study-rows tbody tr:last-child .reason");
    assert!(reason.contains("Breaks a rule") && reason.len() > 40, "{reason}");
    assert_eq!(page.evaluate("document.querySelectorAll('.study-rows tbody tr:last-child a').length"), 0);

    // In Russian the row says the same.
    page.click_on("RU");
    page.until("/[а-я]{4}.*[а-я]{4}/.test(document.querySelector('.study-rows tbody tr:last-child .reason').textContent.slice(18)) && /[а-я]/.test(document.querySelector('.study-rows th').textContent)");
    page.click_on("EN");
    page.until("document.documentElement.lang === 'en'");

    // Equal ratios need ends above zero: said at the field, in the service's words.
    page.click(".study-way label:nth-child(1) input");
    page.fill("#vary-0-from", "0");
    page.fill("#vary-0-to", "20");
    page.pick("#vary-0-spacing", "log");
    page.click("#run-study");
    page.until("document.querySelector('.problem') && document.querySelector('.varied .fault')");
    let fault = page.text(".varied .fault");
    assert!(fault.contains("equal ratios"), "{fault}");
    page.click(".problem .link");
    page.until("document.activeElement.id === 'vary-0'");
    page.assert_calm();
}

#[test]
fn a_large_study_is_a_job_that_survives_a_reload_and_is_cancelled() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("studies?calculator=ring-roundness"));
    page.wait_for("#run-study");
    page.fill("#vary-0-count", "5000");
    page.until("document.querySelector('#study-points').textContent.startsWith('5000 ')");
    page.click("#run-study");
    page.wait_for(".progress-box progress");
    page.until("location.hash.includes('run=')");
    page.until("/point \\d+ of 5000/.test(document.querySelector('.progress-text').textContent)");
    // So far as it is computed, it is drawn.
    page.wait_for(".picture svg.chart");
    let address = page.evaluate("location.href");
    page.open(address.as_str().unwrap());
    page.wait_for(".progress-box progress");
    assert_eq!(page.value("#vary-0-count"), "5000");
    page.click("#cancel-job");
    page.until("!document.querySelector('.progress-box') && document.querySelector('.problem')?.textContent.includes('Cancelled')");
    page.open(&service.page("jobs"));
    page.until("document.querySelector('.state.cancelled')");
    assert!(page.text(".list tbody th").contains("Parameter study"));
    page.assert_calm();
}

/// A link to a study on its way that somebody else started: the page has its fields, not those of a new one.
#[test]
fn a_study_that_somebody_else_started_is_shown_with_its_own_fields() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(""));
    let id = page.evaluate(
        "(async () => { const { jobs, examples } = await (await fetch('/v1/calculators/deflection-compensation')).json(); \
         const study = { calculator: 'deflection-compensation', job: jobs[examples[0].id], vary: [{ pointer: '/cut/spindle_speed_rpm', from: 100, to: 300, count: 23 }] }; \
         const answer = await fetch('/v1/studies', { method: 'POST', body: JSON.stringify(study), \
         headers: { 'Content-Type': 'application/json', Prefer: 'respond-async' } }); return (await answer.json()).id })()",
    );
    page.open(&service.page(&format!("studies?run={}", id.as_str().unwrap())));
    page.wait_for("#vary-0");
    assert_eq!(page.value("#vary-0"), "/cut/spindle_speed_rpm");
    assert!(page.text("#study-points").starts_with("23 "));
    page.until(DONE);
    assert_eq!(page.evaluate("document.querySelectorAll('.study-rows tbody tr').length"), 23);
    page.assert_calm();
}
