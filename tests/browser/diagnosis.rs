//! From measurements to a stored model to a job that uses it.

use crate::{SETTLED, both};

#[test]
fn a_diagnosis_is_saved_as_a_model_and_used_in_another_form() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    assert!(page.text(".verdict").len() > 20);
    // The named cause beside "nothing" and "unknown", its size with as many digits as it is sure of, what is gained on
    // held-back data, and the next measurement.
    let found = page.text(".causes");
    for part in [
        "Headstock compliance",
        "Nothing: scatter alone",
        "not in the list",
        "0.0220 ± 0.0012 µm/N",
        "held back",
        "worth making next",
    ] {
        assert!(found.contains(part), "{part}: {found}");
    }
    page.until("document.querySelectorAll('.causes tr.named').length === 1");
    page.click_on("RU");
    page.until("document.querySelector('.causes .named')?.textContent.startsWith('Податливость передней бабки')");
    page.until("!/[a-z]{4}/.test(document.querySelector('.causes').textContent)");
    page.click_on("EN");
    page.until(&format!(
        "document.querySelector('.causes .named').textContent.startsWith('Headstock') && /^[ -~]+$/.test(document.querySelector('.verdict').textContent) && {SETTLED}"
    ));
    // A bad name is refused before it is sent, a good one makes a revision.
    page.fill("#model-name", "lathe-7-winter");
    page.press("Enter");
    page.until("/lathe-7-winter.*1/.test(document.querySelector('#model-name-hint').textContent)");
    page.evaluate("document.querySelector('#model-name').focus()");
    page.press("Enter");
    page.until("/lathe-7-winter.*2/.test(document.querySelector('#model-name-hint').textContent)");

    page.open(&service.page("models"));
    page.wait_for(".list tbody tr");
    assert!(page.text(".list tbody th").contains("lathe-7-winter"));
    page.click(".list tbody a.button");
    page.until(&format!("location.hash.includes('lathe-7-winter') && {SETTLED}"));
    assert_eq!(page.value("#field-model"), "lathe-7-winter");
    page.click("#tab-basis");
    page.until("document.querySelector('[role=tabpanel]').textContent.includes('lathe-7-winter')");

    page.open(&service.page("models"));
    page.wait_for(".list tbody tr");
    page.click(".list tbody tr td:last-child button:last-child");
    // The first click asks, the second one does it.
    page.until("document.querySelector('.list .sure')");
    assert_eq!(page.evaluate("document.querySelectorAll('.list tbody tr').length"), 1);
    page.click(".list tbody tr td:last-child button:last-child");
    page.until("!document.querySelector('.list tbody tr')");
    page.assert_calm();
}

/// The headings of the shop's own table are understood where they are the form's words.
#[test]
fn a_table_with_headings_in_russian_is_matched() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    page.click_on("RU");
    page.until(&format!("document.documentElement.lang === 'ru' && {SETTLED}"));
    // The form follows a moment after the page's own words.
    page.until("document.querySelector('.sections').textContent.includes('Отклонение диаметра')");
    let csv = page.evaluate(
        "(async () => { const room = await (await fetch('/v1/calculators/diagnosis')).json(); \
         const rows = room.jobs[room.examples[0].id].measurements; const said = number => String(number).replace('.', ','); \
         return ['Опыт;Z, мм;Отклонение диаметра (мкм);Примечание', ...rows.map(row => [row.run, said(row.z_mm), said(row.diameter_deviation_um), 'норма'].join(';'))].join('\\n') })()",
    );
    page.evaluate(&format!(
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([{csv}], 'вал.csv', {{type: 'text/csv'}})); \
         document.querySelector('.table-input').dispatchEvent(new DragEvent('drop', {{bubbles: true, cancelable: true, dataTransfer: data}})) }})()"
    ));
    page.wait_for(".matching .primary:not(:disabled)");
    let matched = "[...document.querySelectorAll('.matching .match tbody tr')].map(row => row.querySelector('select').value).filter(Boolean).join()";
    assert_eq!(page.evaluate(matched), "0,1,2");
    page.click(".matching .primary");
    page.until("!document.querySelector('.matching')");
    let state = page.text(".table-state");
    assert!(state.contains("110") && state.contains("Отклонение диаметра") && !state.contains('_'), "{state}");
    page.click_on("EN");
    page.until("document.documentElement.lang === 'en'");
    page.assert_calm();
}

#[test]
fn measurements_are_dropped_on_a_diagnosis() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    let before = page.text(".verdict");
    // The rows of the example, their first numbers a little larger: as a file with units of its own.
    let csv = page.evaluate(
        "(async () => { \
         const room = await (await fetch('/v1/calculators/diagnosis')).json(); \
         const job = room.jobs[room.examples[0].id]; const rows = job.measurements; const names = Object.keys(rows[0]); \
         const title = name => name.replace(/_(um|mm)$/, ' [$1]'); \
         return [names.map(title).join(';'), ...rows.map(row => names.map(name => name.endsWith('_um') ? row[name] * 1.5 : row[name] ?? '').join(';'))].join('\\n') })()",
    );
    page.evaluate(&format!(
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([{csv}], 'shaft.csv', {{type: 'text/csv'}})); \
         const input = document.querySelector('input[data-table=measurements]').closest('.table-input'); \
         input.dispatchEvent(new DragEvent('drop', {{bubbles: true, cancelable: true, dataTransfer: data}})) }})()"
    ));
    page.wait_for(".matching .primary:not(:disabled)");
    page.click(".matching .primary");
    // What took longer than a blink is not followed by itself.
    page.until("!document.querySelector('.matching')");
    page.click(".form-head .primary");
    page.until(&format!(
        "document.querySelector('.verdict').textContent !== {} && {SETTLED}",
        serde_json::json!(before)
    ));
    page.assert_calm();
}

/// Where the rows object to the best of the catalogue its share is not read as a name.
#[test]
fn shares_of_what_the_rows_object_to_are_said_to_mean_little() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("diagnosis?example=built_up_edge"));
    page.until(SETTLED);
    assert!(page.text(".causes").contains("How likely each of them takes part"));
    // Every second value a little larger, the others smaller; and a level at which that is too much.
    let key = page.evaluate(
        "(async () => { const room = await (await fetch('/v1/calculators/diagnosis')).json(); const job = room.jobs.built_up_edge; \
         job.measurements.forEach((row, i) => { row.roughness_um *= i % 2 ? 1.03 : 0.97; }); job.options = { level: 0.2, held_out: false }; \
         const answer = await fetch('/v1/diagnosis', { method: 'POST', headers: { 'content-type': 'application/json' }, body: JSON.stringify(job) }); \
         return (await answer.json()).key })()",
    );
    let key = key.as_str().unwrap();
    page.open(&service.page(&format!("diagnosis?result={key}")));
    page.until(&format!("document.querySelector('.verdict')?.textContent.includes('not all that acts') && {SETTLED}"));
    let found = page.text(".causes");
    assert!(found.contains("does not fit these rows: none is named"), "{found}");
    assert_eq!(page.evaluate("document.querySelectorAll('.causes tr.named').length"), 0);
    page.assert_calm();
}
