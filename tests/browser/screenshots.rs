//! The pictures of the documentation.

use std::path::Path;

use serde_json::json;

use crate::chromium::Page;
use crate::{SETTLED, both};

/// Name, place, width, height, whether dark.
const SHOTS: [(&str, &str, u32, u32, bool); 21] = [
    ("start", "", 1440, 900, false),
    ("deflection", "deflection-compensation", 1440, 900, false),
    ("deflection-ru", "deflection-compensation?example=stepped_with_rest", 1440, 900, false),
    ("lobes", "fixture-stability?example=lobes", 1440, 900, true),
    ("ring", "ring-roundness", 1440, 900, false),
    ("ring-map", "ring-roundness?example=set_up", 1440, 900, true),
    ("feed", "feed-schedule", 1440, 900, false),
    ("trade-off", "feed-schedule", 1440, 1150, false),
    ("clamp", "fixture-stability", 1920, 1080, true),
    ("study", "studies", 1440, 900, false),
    ("diagnosis", "diagnosis", 1920, 1080, false),
    ("diagnosis-phone", "diagnosis", 360, 740, true),
    ("diagnosis-wide", "diagnosis", 2560, 1300, false),
    ("progress", "ring-roundness?example=set_up", 1440, 900, false),
    ("results", "results", 1440, 900, false),
    ("models", "models", 1024, 600, false),
    ("models-phone", "models", 360, 740, true),
    ("trials", "machinability-fit", 1920, 1080, false),
    ("tablet", "roundness-evaluation", 1024, 600, true),
    ("phone", "fixture-stability?example=lobes", 360, 740, false),
    ("wide", "deflection-compensation?example=chuck_and_tailstock", 2560, 1300, true),
];

#[test]
fn the_documentation_shows_the_workbench_as_it_is() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/workbench");
    let page_of_it = std::fs::read_to_string(folder.with_extension("md")).unwrap();
    for (name, ..) in SHOTS {
        assert!(page_of_it.contains(&format!("workbench/{name}.png")), "docs/workbench.md does not show {name}");
    }
    if std::env::var_os("PRECUT_WRITE_SCREENSHOTS").is_none() {
        for (name, ..) in SHOTS {
            let picture = std::fs::read(folder.join(format!("{name}.png"))).unwrap();
            assert!(picture.starts_with(b"\x89PNG"), "{name}");
        }
        return;
    }
    let (_turn, mut page, service) = both().unwrap();
    std::fs::create_dir_all(&folder).unwrap();
    for (name, place, width, height, dark) in SHOTS {
        page.screen(width, height, dark);
        page.open(&service.page(place));
        let language = if name.ends_with("-ru") { "ru" } else { "en" };
        page.click_on(&language.to_uppercase());
        page.until(&format!("document.documentElement.lang === {}", json!(language)));
        match place {
            "models" | "results" => page.wait_for(".list tbody tr"),
            "studies" => page.wait_for("#run-study"),
            "" => page.wait_for(".outcome-picture svg path"),
            _ => page.until(SETTLED),
        }
        stage(&mut page, name);
        std::thread::sleep(std::time::Duration::from_millis(300));
        std::fs::write(folder.join(format!("{name}.png")), page.picture()).unwrap();
    }
}

/// What is done on a page before it is shown.
fn stage(page: &mut Page, name: &str) {
    match name {
        "deflection" => {
            page.click_on("Pin to compare");
            page.fill("#field-cut-feed_mm_per_rev", "0.35");
            page.until(&format!("document.querySelector('.chart .ghost') && {SETTLED}"));
            let middle = page.middle("svg.chart[data-panel='2']");
            page.evaluate("scrollTo(0, 0)");
            page.point(middle);
        }
        "ring" => {
            page.evaluate("document.querySelector('#replay').focus()");
            page.press("Home");
            for _ in 0..3 {
                page.press("ArrowRight");
            }
            page.until("document.querySelector('.picture h2').textContent.includes('revolution 9 of')");
        }
        "progress" => {
            page.evaluate("location.hash = '#/ring-roundness?example=set_up&/setup_map/tool_angles=721&/setup_map/support_angles=361&/setup_map/highest_order=60'");
            page.wait_for(".shell .count");
            page.until("parseFloat(document.querySelector('.progress-text .left')?.textContent) >= 20");
        }
        "ring-map" => {
            page.click_on("Worst wave");
            let middle = page.middle("svg.chart[data-panel='0']");
            page.evaluate("scrollTo(0, 0)");
            page.point((middle.0 + 60.0, middle.1));
        }
        "trade-off" => {
            page.click_on("Objective over");
            page.evaluate("document.querySelector('#trial').focus()");
            for _ in 0..14 {
                page.press("ArrowRight");
            }
            page.until("document.querySelector('.preview .ghost')");
        }
        "study" => {
            page.click("#add-varied");
            page.pick("#vary-1", "/supports/1/compliance_um_per_n");
            page.click("#run-study");
            page.until(&format!("document.querySelector('.study-rows tbody tr') && {SETTLED}"));
        }
        "diagnosis" => {
            page.fill("#model-name", "lathe-7-winter");
            page.click(".save-model button");
            page.until("/lathe-7-winter.*1/.test(document.querySelector('#model-name-hint').textContent)");
            page.evaluate("scrollTo(0, 0)");
        }
        _ => {}
    }
}
