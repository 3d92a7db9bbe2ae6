//! A program of one's own: beside its picture, dropped as a file, taken away in its own bytes, refused at its line.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::chromium::Page;
use crate::sizes::assert_fits;
use crate::{SETTLED, both};

const ROOM: &str = "program-compensation?example=slender_shaft";
const CHOSEN: &str = "document.querySelector('.listing .chosen [data-line]')?.dataset.line";

/// Lets a file fall on the program of the form.
fn drop_program(page: &mut Page, name: &str, bytes: &[u8]) {
    page.evaluate(&format!(
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([new Uint8Array({})], {})); \
         document.querySelector('.text-file').dispatchEvent(new DragEvent('drop', {{bubbles: true, cancelable: true, dataTransfer: data}})) }})()",
        json!(bytes),
        json!(name)
    ));
}

/// What the program of the example is.
fn text_of_example(page: &mut Page) -> String {
    page.value("#field-nc_program")
}

fn downloaded(page: &Page, name: &str) -> Vec<u8> {
    let file: PathBuf = page.downloads.path().join(name);
    let start = Instant::now();
    // It is there before it is complete.
    while std::fs::metadata(&file).map_or(0, |file| file.len()) < 100 {
        assert!(start.elapsed() < Duration::from_secs(20), "{name} never came");
        std::thread::sleep(Duration::from_millis(50));
    }
    std::fs::read(file).unwrap()
}

#[test]
fn a_line_shows_its_cut_and_a_cut_its_line() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(ROOM));
    page.until(SETTLED);
    page.wait_for(".listing");
    // What changed stands under what it was.
    let changed = page.evaluate(
        "[...document.querySelectorAll('.listing .changed')].map(it => [it.querySelector('[data-line]').dataset.line, it.querySelector('del').textContent, it.querySelectorAll('ins').length])",
    );
    let changed = changed.as_array().unwrap();
    assert!(!changed.is_empty());
    let told = page.evaluate("document.querySelector('.verdict').textContent");
    assert!(told.as_str().unwrap().contains(&format!("{} of 26 lines change", changed.len())), "{told}");
    // A line that is pressed shows its cut,
    let line = "20";
    page.click(&format!(".listing [data-line='{line}']"));
    page.until(&format!("{CHOSEN} === '{line}' && document.querySelector('.marked')"));
    let cut = page.text(".cut-of-line");
    assert!(cut.contains("Line 20") && cut.contains("µm") && cut.contains("mm"), "{cut}");
    // and the cut its line.
    let place = page.evaluate(
        "(() => { const box = document.querySelector('.stack svg[data-panel=\"0\"] .marked').getBoundingClientRect(); return [box.left + box.width / 2, box.top + box.height / 2] })()",
    );
    let place = (place[0].as_f64().unwrap(), place[1].as_f64().unwrap());
    page.click(&format!(".listing [data-line='{line}']"));
    page.until("!document.querySelector('.marked') && !document.querySelector('.listing .chosen')");
    page.press_at(place);
    page.let_go(place);
    page.until(&format!("{CHOSEN} === '{line}' && document.querySelector('.marked')"));
    // From line to line by keys.
    page.evaluate(&format!("document.querySelector('.listing [data-line=\"{line}\"]').focus()"));
    page.press("ArrowDown");
    page.until(&format!("Number({CHOSEN}) > {line} && document.activeElement.dataset.line === {CHOSEN}"));
    page.click_on("RU");
    page.until("/Строка \\d+/.test(document.querySelector('.cut-of-line').textContent)");
    page.click_on("EN");
    page.until("/Line \\d+/.test(document.querySelector('.cut-of-line').textContent)");
    assert_fits(&mut page, 2, "a program with a line chosen");
    page.assert_calm();
}

#[test]
fn a_file_goes_back_in_its_own_bytes_under_its_own_name() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(ROOM));
    page.until(SETTLED);
    let text = text_of_example(&mut page).replace('\n', "\r\n").replace("(ROUGH)", "(\u{d6}L)");
    let bytes: Vec<u8> = text.chars().map(|letter| u8::try_from(letter).unwrap()).collect();
    drop_program(&mut page, "shaft.mpf", &bytes);
    page.until("document.querySelector('.listing [data-line=\"4\"] code').textContent.includes('\u{d6}L')");
    page.until(&format!("{SETTLED} && !document.querySelector('#take').disabled"));
    page.click("#take");
    let returned = downloaded(&page, "shaft.mpf");
    page.click_on("Diff");
    let diff = downloaded(&page, "shaft.mpf.diff");
    let kept = b"N20 T0101 (\xd6L)\r\n";
    assert!(returned.windows(kept.len()).any(|window| window == kept) && returned != bytes);
    assert!(diff.starts_with(b"--- given\n+++ corrected\n") && diff.ends_with(b"\r\n"));
    // What is typed into it keeps the ends of its lines.
    let longer = format!("{}; said\n", text_of_example(&mut page));
    page.fill("#field-nc_program", &longer);
    page.until("document.querySelector('.listing').textContent.includes('; said')");
    page.until(&format!("{SETTLED} && !document.querySelector('#take').disabled"));
    page.click("#tab-request");
    page.until("document.querySelector('[role=tabpanel] pre[aria-label]')");
    let request = page.text("[role=tabpanel]");
    assert!(request.contains("\\r\\n") && request.contains("latin_1"), "{request}");
    page.assert_calm();
}

#[test]
fn a_program_that_is_refused_is_shown_with_its_lines() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(ROOM));
    page.until(SETTLED);
    drop_program(&mut page, "macro.nc", b"G21 G18 G99\nT0101\nG97 S500\nG0 X40. Z2.\n#1=2.\nG1 Z-5. F0.2 ,R2.\nM30\n");
    page.wait_for(".listing .wrong");
    let wrong: Value =
        page.evaluate("[...document.querySelectorAll('.listing .wrong [data-line]')].map(it => it.dataset.line)");
    assert_eq!(wrong, json!(["5", "6"]));
    assert!(page.text(".listing .wrong .fault").contains("#1=2."));
    assert_eq!(page.evaluate("document.querySelector('#take').disabled"), true);
    assert_fits(&mut page, 0, "a refused program");
    page.assert_calm();
}
