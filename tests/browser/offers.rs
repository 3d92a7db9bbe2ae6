//! What an answer offers, and what is done with it: the numbers that say it, what one percent buys, better speeds, handles in
//! the drawing, the sheet of the next measurement; the start page by outcomes; links that lead to nothing.

use serde_json::{Value, json};

use crate::access::assert_accessible;
use crate::chromium::Page;
use crate::sizes::assert_fits;
use crate::{SETTLED, both};

const CURRENT: &str = "!document.querySelector('.not-theirs')";
/// The strip's numbers, by their names.
const HEADLINE: &str = "Object.fromEntries([...document.querySelectorAll('.headline > div')].map(it => [it.querySelector('dt').textContent, it.querySelector('dd').textContent]))";
#[test]
fn the_strip_of_a_diagnosis_says_what_is_named_how_surely_and_what_it_gains() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    let told = page.evaluate(HEADLINE);
    let result = page.evaluate("(async () => { const found = await (await fetch('/v1/results?calculator=diagnosis')).json(); return (await (await fetch('/v1/results/' + found.items[0].key)).json()).result })()");
    assert_eq!(result["verdict"], "named");
    let posterior = result["sets"][0]["posterior"].as_f64().unwrap();
    assert_eq!(told["Headstock compliance"], format!("{:.0} %", 100.0 * posterior), "{told}");
    let gain = |name: &str| result["gain"][name].as_f64().unwrap();
    let held_back = told["Error on data that was held back"].as_str().unwrap();
    let ends: Vec<f64> = held_back.trim_end_matches(" µm").split(" → ").map(|number| number.parse().unwrap()).collect();
    for (end, name) in ends.iter().zip(["rmse_base", "rmse_extended"]) {
        assert!((end / gain(name) - 1.0).abs() < 0.006, "{held_back}: {name}");
    }
    assert!(told["Added compliance"].as_str().unwrap().starts_with("0.0220 ± 0.0012"), "{told}");
    // Its button leads to where the model is kept.
    assert_eq!(page.text("#take"), "Keep the model");
    page.click("#take");
    page.until("document.activeElement.id === 'model-name'");
    // Where nothing of the list is named, that is what the numbers say.
    page.open(&service.page("diagnosis?example=guideway"));
    page.until(&format!(
        "{SETTLED} && document.querySelector('.verdict').textContent.includes('catalogue does not hold')"
    ));
    let told = page.evaluate(HEADLINE);
    assert!(told["Something that is not in the list"].as_str().unwrap().ends_with('%'), "{told}");
    assert_eq!(page.text("#take"), "Print the sheet");
    // Which mode it is stands in the name; the size is what was fitted.
    page.open(&service.page("diagnosis?example=chatter_log"));
    page.until(&format!("{SETTLED} && document.querySelector('.verdict').textContent.includes('mode frequency')"));
    let told = page.evaluate(HEADLINE);
    assert!(told["Factor"].as_str().unwrap().starts_with("0.8791 ± 0.00"), "{told}");
    page.assert_calm();
}

/// Green says that nothing is to be heeded: an answer with a warning is marked as one.
#[test]
fn an_answer_with_a_warning_is_marked() {
    let Some((_turn, mut page, service)) = both() else { return };
    let mut seen = [false, false];
    for place in [
        "deflection-compensation?example=paper",
        "deflection-compensation?example=two_passes",
        "ring-roundness?example=how_sure",
    ] {
        page.open(&service.page(place));
        page.until(SETTLED);
        let is_warned = page.evaluate("document.querySelectorAll('.words .warnings li').length > 0") == true;
        let is_marked = page.evaluate("getComputedStyle(document.querySelector('.strip')).borderLeftColor !== (() => { const it = document.createElement('i'); it.style.color = 'var(--good)'; document.body.append(it); return getComputedStyle(it).color })()");
        assert_eq!(is_marked, is_warned, "{place}");
        seen[usize::from(is_warned)] = true;
    }
    assert_eq!(seen, [true, true]);
    page.assert_calm();
}

#[test]
fn the_start_page_shows_outcomes() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(""));
    page.until("document.querySelectorAll('.outcome-picture svg path').length > 20");
    let count = page.evaluate("document.querySelectorAll('.questions li').length");
    assert_eq!(page.evaluate("document.querySelectorAll('.outcome-picture svg').length"), count);
    // Every picture shows something, and its example is told beside it and opens.
    assert_eq!(page.evaluate("[...document.querySelectorAll('.outcome-picture svg')].every(it => [...it.querySelectorAll('path')].some(path => path.getAttribute('d').split(/[ML]/).length > 5))"), true);
    assert_eq!(page.evaluate("[...document.querySelectorAll('.outcome a, .examples a')].some(it => it.textContent.includes('source paper'))"), false);
    // Nothing was computed for it.
    assert_eq!(
        page.evaluate(
            "performance.getEntriesByType('resource').some(it => new URL(it.name).pathname.startsWith('/v1/results'))"
        ),
        false
    );
    assert!(page.text(".outcome").contains("0.1 mm thick in the middle"));
    page.click(".outcome a");
    page.until(&format!("location.hash.includes('example=paper') && {SETTLED}"));
    // As the outcome says.
    let error = page.evaluate("parseFloat(document.querySelector('.headline div:nth-child(3) dd').textContent)");
    assert!((90.0..110.0).contains(&error.as_f64().unwrap()), "{error}");
    page.assert_calm();
}

#[test]
fn a_bar_turns_its_number_by_one_percent_and_buys_what_it_says() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("feed-schedule"));
    page.until(SETTLED);
    page.wait_for(".knobs li button");
    let first = page.evaluate("document.querySelector('.knobs li button').dataset.pointer");
    let field = format!("#field-{}", first.as_str().unwrap().trim_start_matches('/').replace('/', "-"));
    let before: f64 = page.value(&field).parse().unwrap();
    let told = page.text(".knobs li .number");
    // Longer bars buy more.
    assert_eq!(page.evaluate("(() => { const all = [...document.querySelectorAll('.knobs rect')].map(it => Number(it.getAttribute('width'))); return all.length > 2 && all.every((width, at) => at === 0 || width <= all[at - 1]) })()"), true);
    page.evaluate("document.querySelector('.knobs li button').focus()");
    page.press("Enter");
    page.until(&format!(
        "document.querySelector('.knob-came').textContent.includes('the bar said') && {SETTLED} && {CURRENT}"
    ));
    let after: f64 = page.value(&field).parse().unwrap();
    assert!(((after / before - 1.0).abs() - 0.01).abs() < 1e-6, "{before} to {after}");
    let said = page.text(".knob-came");
    assert!(said.contains(&told), "{said}: {told}");
    let percent = |text: &str| text.replace('−', "-").parse::<f64>().unwrap();
    let numbers: Vec<f64> = said
        .split(' ')
        .zip(said.split(' ').skip(1))
        .filter(|(_, unit)| unit.starts_with('%'))
        .map(|(text, _)| percent(text))
        .collect();
    // A price is a slope: over one percent it bends a little.
    assert!(numbers.len() == 2 && (numbers[0] / numbers[1] - 1.0).abs() < 0.1, "{said}");
    page.until("location.hash.includes('=')");
    assert_fits(&mut page, 0, "knobs");
    page.assert_calm();
}

#[test]
fn a_better_speed_is_used_and_keeps_what_it_promises() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("fixture-stability?example=lobes"));
    page.until(SETTLED);
    page.wait_for(".offers li button");
    assert_fits(&mut page, 1, "better speeds");
    let promised = "[...document.querySelectorAll('.offers li:first-child dd')].map(it => parseFloat(it.textContent.replace(/\\s/g, '')))";
    let best = page.evaluate(promised);
    // Speed, depth, removal rate, clamp force; the best first, each more than now.
    let rates =
        "[...document.querySelectorAll('.offers li')].map(it => parseFloat(it.querySelectorAll('dd')[2].textContent))";
    assert_eq!(page.evaluate(&format!("({rates}).every((rate, at, all) => at === 0 || rate <= all[at - 1])")), true);
    assert_eq!(
        page.evaluate("[...document.querySelectorAll('.offers .gain')].every(it => it.textContent.startsWith('+'))"),
        true
    );
    page.click(".offers li button");
    page.until(&format!(
        "Number(document.querySelector('#field-cut-spindle_speed_rpm').value) === {} && {SETTLED} && {CURRENT}",
        best[0]
    ));
    page.until(&format!("Number(document.querySelector('#field-cut-depth_mm').value) === {}", best[1]));
    assert!(page.text(".verdict").starts_with("The cut is stable"), "{}", page.text(".verdict"));
    page.click("#tab-values");
    let rate = page.evaluate("parseFloat([...document.querySelectorAll('.value-table tr')].find(row => row.querySelector('th').textContent === 'Removal rate').querySelector('td').textContent)");
    assert!((rate.as_f64().unwrap() / best[2].as_f64().unwrap() - 1.0).abs() < 0.01, "{rate} of {best}");
    page.assert_calm();
}

/// Middle of a handle, px.
fn grip(page: &mut Page, name: &str) -> (f64, f64) {
    page.middle(&format!(".grip[data-name={name}]"))
}

#[test]
fn shoulders_diameters_and_supports_follow_the_hand() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation?example=stepped_with_rest"));
    page.until(SETTLED);
    let number = |page: &mut Page, field: &str| page.value(field).parse::<f64>().unwrap();
    let [left, right] = ["#field-shaft-segments-0-length_mm", "#field-shaft-segments-1-length_mm"];
    let whole = number(&mut page, left) + number(&mut page, right);
    let before = number(&mut page, left);
    let shown = page.text(".headline");
    let from = grip(&mut page, "handle_shoulder");
    page.drag(from, (from.0 + 30.0, from.1));
    page.until(&format!("Number(document.querySelector('{left}').value) > {before} && {SETTLED} && {CURRENT}"));
    // What one segment gains the other loses, by whole millimetres, and the answer is that of the new part.
    let after = number(&mut page, left);
    assert!((after + number(&mut page, right) - whole).abs() < 1e-9 && (after - after.round()).abs() < 1e-9, "{after}");
    page.until(&format!("document.querySelector('.headline').textContent !== {}", json!(shown)));
    // The handle is where the shoulder is.
    let there = page
        .evaluate("Number(document.querySelector('.grip[data-name=handle_shoulder]').getAttribute('aria-valuenow'))");
    assert!((there.as_f64().unwrap() - after).abs() < 1e-6);
    // By keys: a rest goes along the shaft, a diameter grows.
    let rest = page
        .evaluate("Number(document.querySelector('.grip[data-name=handle_rest]').getAttribute('aria-valuenow'))")
        .as_f64()
        .unwrap();
    page.evaluate("document.querySelector('.grip[data-name=handle_rest]').focus()");
    page.press("ArrowRight");
    page.until(&format!("Number(document.querySelector('.grip[data-name=handle_rest]').getAttribute('aria-valuenow')) > {rest} && {SETTLED} && {CURRENT}"));
    assert_eq!(page.evaluate("document.activeElement.dataset.name"), "handle_rest");
    let diameter = number(&mut page, "#field-shaft-segments-0-diameter_mm");
    page.evaluate("document.querySelector('.grip[data-name=handle_diameter]').focus()");
    page.press("ArrowDown");
    page.until(&format!("Number(document.querySelector('#field-shaft-segments-0-diameter_mm').value) < {diameter} && {SETTLED} && {CURRENT}"));
    // The end takes the tailstock with it.
    let tail = "Math.max(...[...document.querySelectorAll('.grip[data-name=handle_centre], .grip[data-name=handle_chuck]')].map(it => Number(it.getAttribute('aria-valuenow'))))";
    let end = "Number(document.querySelector('.grip[data-name=handle_end]').getAttribute('aria-valuenow'))";
    assert_eq!(page.evaluate(&format!("{tail} === {end}")), true);
    let was = page.evaluate(end);
    page.evaluate("document.querySelector('.grip[data-name=handle_end]').focus()");
    page.press("ArrowLeft");
    page.until(&format!("{end} < {was} && {tail} === {end} && {SETTLED} && {CURRENT}"));
    assert!(!page.text(".verdict").is_empty() && page.evaluate("document.querySelector('.problem')") == Value::Null);
    // It can be undone step by step.
    page.until("location.hash.includes('/shaft/segments/')");
    page.assert_calm();
}

#[test]
fn a_support_that_is_dragged_stops_at_the_end_of_the_shaft() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation?/supports/1/z_mm=1900"));
    page.until(SETTLED);
    page.until("document.querySelectorAll('.grip[data-name=handle_centre]').length === 2");
    page.evaluate("document.querySelectorAll('.grip[data-name=handle_centre]')[1].id = 'tailstock'");
    let from = page.middle("#tailstock");
    let end = page.middle(".grip[data-name=handle_end]");
    // Some pixels short of it.
    page.drag(from, (end.0 - 4.0, from.1));
    page.until(&format!("location.hash.includes('paper') && Number(document.querySelector('#tailstock').getAttribute('aria-valuenow')) === 2000 && {SETTLED} && {CURRENT}"));
    page.assert_calm();
}

/// The sheet is taken, filled in by a person, and chosen again: its rows are those of a run that was not there.
#[test]
fn the_sheet_of_the_next_measurement_is_filled_in_and_comes_back() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    page.evaluate("window.print = () => { window.printed = { text: document.querySelector('.paper').textContent, alone: document.body.classList.contains('paper-only') }; dispatchEvent(new Event('afterprint')); }");
    page.click(".sheet-buttons button:last-of-type");
    page.until("window.printed");
    let paper = page.evaluate("printed");
    assert_eq!(paper["alone"], true);
    for part in ["Next measurement", "Depth: 1.8 mm", "Diameter deviation, µm", "Station, mm"] {
        assert!(paper["text"].as_str().unwrap().contains(part), "{part}: {paper}");
    }
    page.until("!document.querySelector('.paper') && !document.body.classList.contains('paper-only')");
    page.click(".sheet-buttons button");
    let folder = page.downloads.path().to_owned();
    let sheet = loop {
        let found = std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path());
        if let Some(file) = found.filter(|file| file.extension().is_some_and(|ending| ending == "csv")).last() {
            break file;
        }
        page.evaluate("new Promise(go => setTimeout(go, 40))");
    };
    let text = std::fs::read_to_string(&sheet).unwrap();
    let rows: Vec<&str> = text.trim_start_matches('\u{feff}').lines().filter(|line| !line.is_empty()).collect();
    assert!(rows[0].starts_with("run,z_mm,") && rows[0].ends_with(",diameter_deviation_um"), "{}", rows[0]);
    assert!(rows.len() > 10 && rows[1..].iter().all(|row| row.starts_with("6,") && row.ends_with(',')), "{text}");
    // As it is nothing can be used of it.
    page.choose_file("input[data-table=measurements]", &sheet);
    page.wait_for(".matching");
    assert_eq!(page.evaluate("document.querySelector('.matching .primary').disabled"), true);
    page.click_on("Cancel");
    // All but the last row measured.
    let filled: Vec<String> = rows
        .iter()
        .enumerate()
        .map(
            |(at, row)| {
                if at == 0 || at + 1 == rows.len() { (*row).to_owned() } else { format!("{row}{}.5", 10 + at % 3) }
            },
        )
        .collect();
    let back = folder.join("filled.csv");
    std::fs::write(&back, filled.join("\n")).unwrap();
    page.choose_file("input[data-table=measurements]", &back);
    page.wait_for(".matching .primary:not(:disabled)");
    assert!(page.text(".columns-runs").contains("Depth"), "{}", page.text(".columns-runs"));
    assert_eq!(page.text(".matching [role=status]"), "1 rows without a measured value are left out.");
    assert!(page.text(".matching .primary").starts_with("Add to the 110 rows"));
    assert_accessible(&mut page, "a sheet that comes back");
    page.click(".matching .primary");
    page.until("!document.querySelector('.matching')");
    let count = 110 + rows.len() - 2;
    assert!(page.text(".table-state").starts_with(&format!("{count} rows")), "{}", page.text(".table-state"));
    page.click(".form-head .primary");
    page.until(&format!("{SETTLED} && {CURRENT}"));
    page.click("#tab-request");
    let job = page.evaluate("(async () => { const found = await (await fetch('/v1/results?calculator=diagnosis')).json(); return (await (await fetch('/v1/results/' + found.items[0].key + '/job')).json()).job })()");
    assert_eq!((job["measurements"].as_array().unwrap().len(), job["runs"].as_array().unwrap().len()), (count, 6));
    assert_eq!(job["runs"][5]["depth_mm"], 1.8);
    assert_eq!(
        (&job["measurements"][110]["run"], &job["measurements"][110]["diameter_deviation_um"]),
        (&json!(6), &json!(11.5))
    );
    page.assert_calm();
}

#[test]
fn links_that_lead_to_nothing_are_answered_in_the_users_words() {
    let Some((_turn, mut page, service)) = both() else { return };
    for (place, said) in [
        ("deflection-compensation?example=nothing_like_it", "There is no example “nothing_like_it” here"),
        (
            "deflection-compensation?example=paper&/cut/feed_mm_per_rev=0.",
            "/cut/feed_mm_per_rev = 0., which cannot be read",
        ),
        ("deflection-compensation?result=b3:0123", "The result of this link is not kept here"),
        ("deflection-compensation?run=00000000-0000-4000-8000-000000000000", "The job of this link is not known here"),
    ] {
        page.screen(360, 740, true);
        page.open(&service.page(place));
        page.until("document.querySelector('main h1')?.textContent === 'This link leads to nothing'");
        assert!(page.text("main").contains(said), "{place}: {}", page.text("main"));
        assert_accessible(&mut page, place);
        page.screen(1440, 900, false);
        page.click(".plain-list a");
        page.until(SETTLED);
    }
    page.assert_calm();
}

#[test]
fn a_part_that_is_kept_as_ones_own_is_where_another_calculator_begins() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill("#field-shaft-youngs_modulus_n_per_mm2", "123000");
    page.until(&format!("{SETTLED} && {CURRENT}"));
    page.click("[data-own='shaft Shaft'] [data-act=keep]");
    page.wait_for("[data-own='shaft Shaft'] [data-act=forget]");
    // Every calculator that asks for a shaft begins with it, and says so.
    page.open(&service.page("feed-schedule"));
    page.until(SETTLED);
    assert_eq!(page.value("#field-shaft-youngs_modulus_n_per_mm2"), "123000");
    assert!(page.text(".own-note").contains("shaft"));
    page.until("location.hash.includes('/shaft')");
    assert_fits(&mut page, 2, "own parts");
    // The example is a click away, and what is one's own another.
    page.click(".own-note a");
    page.until(&format!("!document.querySelector('.own-note') && {SETTLED}"));
    let example = page.value("#field-shaft-youngs_modulus_n_per_mm2");
    assert_ne!(example, "123000");
    page.click("[data-own='shaft Shaft'] [data-act=use]");
    page.until("document.querySelector('#field-shaft-youngs_modulus_n_per_mm2').value === '123000'");
    page.click("[data-own='shaft Shaft'] [data-act=forget]");
    page.open(&service.page("feed-schedule"));
    page.until(SETTLED);
    assert_eq!(page.value("#field-shaft-youngs_modulus_n_per_mm2"), example);
    page.assert_calm();
}
