//! Measured tables as they come from the shop: units, and columns that nobody asked for.

use serde_json::json;

use crate::access::assert_accessible;
use crate::chromium::Page;
use crate::{SETTLED, both};

const READY: &str = "!document.querySelector('.matching .primary').disabled";

/// Lets a file fall on the first table of the form.
fn drop_csv(page: &mut Page, csv: &str) {
    page.evaluate(&format!(
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([{}], 'table.csv', {{type: 'text/csv'}})); \
         document.querySelector('.table-input').dispatchEvent(new DragEvent('drop', {{bubbles: true, cancelable: true, dataTransfer: data}})) }})()",
        json!(csv)
    ));
    page.wait_for(".matching");
}

/// Three lobes of so many µm, in the unit of which there are so many in one, under this heading.
fn ring(heading: &str, lobes_um: f64, um: f64) -> String {
    let row = |row: i32| {
        let angle = 6.0 * f64::from(row);
        format!("{angle};{:.9};ok\n", lobes_um * (3.0 * angle.to_radians()).cos() / um)
    };
    format!("Angle [deg];{heading};Remark\n{}", (0..60).map(row).collect::<String>())
}

fn unit_of_deviation(page: &mut Page) -> String {
    page.value(".matching tbody tr:nth-child(2) td:nth-child(3) select")
}

#[test]
fn a_unit_is_converted_asked_for_or_refused_and_never_guessed() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("roundness-evaluation"));
    page.until(SETTLED);
    for (heading, unit, um, lobes_um) in [
        ("Deviation [cm]", "cm", 1e4, 4.0),
        ("deviation_inch", "inch", 25_400.0, 5.0),
        ("Deviation, мкм", "um", 1.0, 6.0),
        ("DEVIATION (MM)", "mm", 1e3, 7.0),
    ] {
        let before = page.text(".verdict");
        drop_csv(&mut page, &ring(heading, lobes_um, um));
        page.until(READY);
        assert_eq!(unit_of_deviation(&mut page), unit, "{heading}");
        // What is not taken is said.
        assert_eq!(page.text(".columns-left"), "Not taken: Remark");
        page.click(".matching .primary");
        page.until(&format!("document.querySelector('.verdict').textContent !== {} && {SETTLED}", json!(before)));
        let said = page.text(".verdict");
        let roundness: f64 =
            said.split("circle is ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap().parse().unwrap();
        assert!((1.75..2.01).contains(&(roundness / lobes_um)), "{heading}: {said}");
    }
    for (heading, said) in [
        ("Deviation [furlong]", "“furlong” is no unit that can be converted here"),
        ("Deviation [N]", "“N” is no unit that can be converted here"),
        ("Deviation", "the heading names no unit"),
    ] {
        drop_csv(&mut page, &ring(heading, 4.0, 1.0));
        page.until("document.querySelector('.matching .fault')");
        assert!(page.text(".matching .fault").contains(said), "{heading}: {}", page.text(".matching"));
        assert_eq!(page.evaluate(READY), false, "{heading}");
        page.pick(".matching tbody tr:nth-child(2) td:nth-child(3) select", "um");
        page.until(&format!("{READY} && !document.querySelector('.matching .fault')"));
        page.click_on("Cancel");
        page.until("!document.querySelector('.matching')");
    }
    page.assert_calm();
}

/// The page offers the units of `src/units.rs`, all of them and no others.
#[test]
fn the_page_knows_the_units_of_the_service() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page(""));
    let dimensions = page.evaluate(
        "import(new URL('units.js', document.querySelector('script[type=module]').src)).then(it => [it.DIMENSIONS, it.DIMENSIONS.map(units => units.map(([one]) => it.converted(1, one, units[0][0])))])",
    );
    let (dimensions, sizes): (Vec<Vec<Vec<String>>>, Vec<Vec<f64>>) = serde_json::from_value(dimensions).unwrap();
    assert!(dimensions.len() > 15);
    for (units, sizes) in dimensions.into_iter().zip(sizes) {
        for (spellings, size) in units.iter().zip(sizes) {
            let own = precut::units::convert(1.0, &spellings[0], &units[0][0]).unwrap();
            assert!((size / own - 1.0).abs() < 1e-11, "{}: {size} against {own}", spellings[0]);
        }
        let first = units[0][0].clone();
        assert_eq!(units.concat(), precut::units::alike(&first).collect::<Vec<_>>(), "{first}");
        for spellings in units {
            for one in &spellings {
                assert_eq!(precut::units::convert(1.0, one, &spellings[0]), Some(1.0), "{one}");
            }
        }
    }
}

/// Trials with a column that is a further variable and one that is a factor give what their rows give.
#[test]
fn columns_that_no_field_has_are_kept_where_the_rows_take_them() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("machinability-fit?example=batches_and_nose_radius"));
    page.until(SETTLED);
    page.click("#tab-basis");
    page.wait_for(".key-text");
    let key = page.text(".key-text");
    let csv = page.evaluate(
        "fetch('/v1/calculators/machinability-fit').then(it => it.json()).then(({ jobs }) => ['id;Speed [m/min];Feed [mm/rev];Roughness [um];Nose radius [mm];batch', \
         ...jobs.batches_and_nose_radius.trials.map(row => [row.id, row.speed_m_per_min, row.feed_mm_per_rev, row.roughness_um, row.further.nose_radius_mm, row.factors.batch].join(';'))].join('\\n'))",
    );
    drop_csv(&mut page, csv.as_str().unwrap());
    page.until(READY);
    assert_eq!(page.text(".columns-kept"), "Kept with every row: Nose radius [mm]; batch");
    assert_eq!(page.text(".columns-left"), "");
    page.evaluate("document.querySelector('.key-text').textContent = ''");
    page.click(".matching .primary");
    page.until("!document.querySelector('.matching')");
    page.click_on("Compute");
    page.until(SETTLED);
    page.click("#tab-request");
    page.until("document.querySelector('[role=tabpanel] pre')?.textContent.includes('Nose radius [mm];batch')");
    page.click("#tab-basis");
    page.wait_for(".key-text");
    assert_eq!(page.text(".key-text"), key);
    // Where the rows take further numbers alone, words are left, and named.
    page.open(&service.page(""));
    page.wait_for(".questions li");
    page.evaluate(
        "(() => { const own = window.fetch; \
         const without = part => { for (const [name, inner] of Object.entries(part ?? {})) if (inner?.['x-free-columns'] === 'words') delete part[name]; else if (typeof inner === 'object') without(inner); return part }; \
         window.fetch = async (path, options) => { const answer = await own(path, options); \
         return path === '/v1/calculators/machinability-fit' ? new Response(JSON.stringify(without(await answer.json()))) : answer }; \
         location.hash = '#/machinability-fit?example=batches_and_nose_radius' })()",
    );
    page.until(SETTLED);
    drop_csv(&mut page, csv.as_str().unwrap());
    page.until(READY);
    assert_eq!(page.text(".columns-kept"), "Kept with every row: Nose radius [mm]");
    assert_eq!(page.text(".columns-left"), "Not taken: batch");
    page.assert_calm();
}

/// Every measured table of every page takes a file that is chosen, as on a phone, shows it with its chart, and uses it only
/// when it is told to; meanwhile nothing on the page is an answer to it.
#[test]
fn a_chosen_file_is_shown_before_it_is_used() {
    let Some((_turn, mut page, service)) = both() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("profile.txt");
    // No heading, a decimal comma, the unit known to whoever measured.
    let rows = (0..60).map(|row: i32| {
        let angle = f64::from(6 * row);
        format!("{angle};{:.6}\n", 5e-3 * (3.0 * angle.to_radians()).cos()).replace('.', ",")
    });
    std::fs::write(&file, rows.collect::<String>()).unwrap();
    page.screen(360, 740, false);
    page.open(&service.page("roundness-evaluation"));
    page.until(SETTLED);
    page.click_on("Inputs");
    let limits = page.text(".door-limits");
    assert!(
        limits.contains("200\u{202f}000 rows") && limits.contains("8.4 MB"),
        "said before a file is read: {limits}"
    );
    for times in 1..=2 {
        // The same file again, as after a mistake.
        page.choose_file("input[data-table=deviations]", &file);
        page.wait_for(".matching");
        assert!(page.text(".matching").contains("no heading"), "{times}");
        assert_eq!(page.evaluate("document.querySelectorAll('.matching .guessed').length"), 2, "guesses are said");
        assert_eq!(page.evaluate("document.querySelector('.matching .primary').disabled"), true, "a unit is missing");
        assert_eq!(page.evaluate("document.querySelector('#take').disabled"), true, "a table waits");
        page.click_on("Cancel");
        page.until("!document.querySelector('.matching') && !document.querySelector('#take').disabled");
    }
    page.choose_file("input[data-table=deviations]", &file);
    page.wait_for(".matching");
    page.pick(".matching tbody tr:nth-child(1) td:nth-child(3) select", "deg");
    page.pick(".matching tbody tr:nth-child(2) td:nth-child(3) select", "mm");
    page.until(READY);
    assert_eq!(page.text(".table-chart figcaption span"), "Radial deviation: −5 … 5 µm");
    assert_accessible(&mut page, "a table that waits");
    page.click(".matching .primary");
    page.until("!document.querySelector('.matching')");
    page.click(".pane-switch button:nth-child(2)");
    page.until(&format!("/circle is (9\\.|10)/.test(document.querySelector('.verdict').textContent) && {SETTLED}"));
    page.assert_calm();
}

/// Sizes where deviations are asked for: nobody takes anything off them unasked.
#[test]
fn sizes_are_not_taken_for_deviations() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("roundness-evaluation"));
    page.until(SETTLED);
    let rows = (0..60).map(|row: i32| {
        let angle = f64::from(6 * row);
        format!("{angle};{:.9}\n", (32.0 + 4e-3 * (3.0 * angle.to_radians()).cos()) / 25.4)
    });
    drop_csv(&mut page, &format!("Angle [deg];Measured radius, inch\n{}", rows.collect::<String>()));
    page.until("document.querySelector('.sizes-asked .fault')");
    assert_eq!(page.evaluate(READY), false);
    assert!(page.text(".sizes-asked").contains("look like sizes of about 32 mm"));
    page.click_on("Take off the nominal");
    page.until(READY);
    page.click(".matching .primary");
    page.until(&format!("/circle is [78][. ]/.test(document.querySelector('.verdict').textContent) && {SETTLED}"));
    page.assert_calm();
}

/// A diagnosis without a measured column is none: one of them is asked for by name.
#[test]
fn what_was_measured_is_always_asked_for() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("diagnosis"));
    page.until(SETTLED);
    drop_csv(&mut page, "Station [mm];Inspector\n10;A\n20;B\n30;C\n");
    page.until("document.querySelector('.matching .fault')");
    let said = page.text(".matching");
    assert!(said.contains("What was measured is still needed") && said.contains("Diameter deviation"), "{said}");
    assert_eq!(page.evaluate(READY), false);
    page.click_on("Cancel");
    // As the shop calls it: matched by what it is, and said to be a guess.
    drop_csv(&mut page, "Pos (mm);Measured dia, inch\n10;1.2601\n20;1.2602\n30;1.2603\n");
    page.until(READY);
    assert_eq!(page.evaluate("document.querySelectorAll('.matching .guessed').length"), 2);
    page.assert_calm();
}
