//! The page's own words, in every language, and what it shows in the user's.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use crate::{SETTLED, both};

/// Endings of the forms for a count.
const FORMS: [&str; 4] = [".one", ".few", ".many", ".other"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/app")
}

fn texts(tag: &str) -> Map<String, Value> {
    serde_json::from_str(&std::fs::read_to_string(folder().join(format!("text/{tag}.json"))).unwrap()).unwrap()
}

fn stem(code: &str) -> &str {
    FORMS.iter().find_map(|form| code.strip_suffix(form)).unwrap_or(code)
}

#[test]
fn every_word_of_the_page_exists_in_both_languages_and_is_used() {
    let known: Vec<BTreeSet<String>> =
        ["en", "ru"].map(|tag| texts(tag).keys().map(|code| stem(code).to_owned()).collect()).into();
    assert_eq!(known[0], known[1]);
    let scripts: String = std::fs::read_dir(folder())
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|file| file.extension().is_some_and(|ending| ending == "js"))
        .map(|file| std::fs::read_to_string(file).unwrap())
        .collect();
    for call in ["t('", "plural('"] {
        for (at, _) in scripts.match_indices(call) {
            let before = scripts[..at].chars().next_back().unwrap_or(' ');
            if before.is_alphanumeric() || before == '_' || before == '.' {
                continue;
            }
            let code = scripts[at + call.len()..].split('\'').next().unwrap();
            assert!(known[0].contains(code), "t('{code}') has no text");
        }
    }
    for code in &known[0] {
        let family = code.split('_').next().unwrap();
        let made = ["state", "tab", "group", "form", "own", "record", "certainty", "process"].contains(&family)
            && scripts.contains(&format!("t(`{family}_${{"));
        assert!(made || scripts.contains(&format!("'{code}'")), "{code} is said nowhere");
    }
    let russian = texts("ru");
    for (code, text) in &russian {
        let text = text.as_str().unwrap();
        let needs_letters = texts("en").get(code).is_some_and(|english| english != text)
            || text.chars().any(|c| ('а'..='я').contains(&c));
        assert!(needs_letters || ["docs", "form_json"].contains(&code.as_str()), "{code} is not translated: {text}");
    }
}

/// The shown answer, asked for in another language, comes after what was typed meanwhile has been refused.
#[test]
fn words_that_come_late_hide_no_fault() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.evaluate(
        "(() => { const real = fetch; const gate = new Promise(open => { window.openGate = open; }); \
        window.fetch = async (path, ...rest) => { const answer = await real(path, ...rest); \
        if (String(path).includes('/v1/results/')) await gate; return answer; }; })()",
    );
    page.click_on("RU");
    page.until("document.documentElement.lang === 'ru'");
    page.fill("#field-cut-feed_mm_per_rev", "900");
    page.wait_for(".problem[role=alert]");
    page.evaluate("openGate()");
    page.until("/[а-я]/.test(document.querySelector('.verdict').textContent)");
    page.wait_for(".problem[role=alert]");
    page.assert_calm();
}

#[test]
fn the_page_speaks_russian_and_english() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    let cyrillic = |text: &str| text.chars().any(|c| ('а'..='я').contains(&c));
    assert!(!cyrillic(&page.text("main")));
    page.click_on("RU");
    page.until("document.documentElement.lang === 'ru'");
    page.until(&format!("/[а-я]/.test(document.querySelector('.verdict').textContent) && /[а-я]/.test(document.querySelector('.room-head h1').textContent) && {SETTLED}"));
    for selector in [".fold-title", ".row .label", ".axis-name", ".series", ".x-name", "[role=tab]", ".primary"] {
        let text = page.text(selector);
        assert!(cyrillic(&text), "{selector}: {text}");
    }
    // Numbers with a comma.
    assert_eq!(page.value("#field-cut-feed_mm_per_rev"), "0,5");
    page.fill("#field-cut-feed_mm_per_rev", "0.75");
    page.until("location.hash.includes('/cut/feed_mm_per_rev=0.75')");
    // A picture of a study carries the labels of the form, also in its printed form.
    page.open(&service.page("studies"));
    page.wait_for("#run-study");
    page.click("#add-varied");
    page.click("#run-study");
    page.until("document.querySelector('.study-rows tbody tr') && location.hash.includes('study=b3:')");
    let verdict = page.text(".verdict");
    let has_pointer = verdict.split_whitespace().any(|word| word.starts_with('/') || word.contains('_'));
    assert!(!has_pointer && cyrillic(&verdict), "{verdict}");
    for selector in [".axis-name", ".x-name", ".picture h2"] {
        let text = page.text(selector);
        let latin = text.chars().filter(char::is_ascii_alphabetic).count();
        assert!(cyrillic(&text) && latin == 0, "{selector}: {text}");
    }
    let svg = page.evaluate(
        "fetch('/v1/results/' + location.hash.match(/b3:[0-9a-f]+/)[0], {headers: {Accept: 'image/svg+xml', 'Accept-Language': 'ru'}}).then(it => it.text())",
    );
    let svg = svg.as_str().unwrap();
    let words = svg.split("<text").skip(1).filter_map(|part| part.split('>').nth(1)?.split('<').next());
    let words: Vec<&str> = words.filter(|word| word.chars().any(|c| c.is_ascii_alphabetic())).collect();
    assert!(words.is_empty(), "{words:?}");

    // Whoever switches before the answer is there gets it in the new language.
    page.open(&service.page("fixture-stability?example=lobes"));
    page.click_on("EN");
    page.until(&format!("document.documentElement.lang === 'en' && {SETTLED}"));
    page.until("/^The /.test(document.querySelector('.verdict').textContent)");
    page.click_on("RU");
    page.until("document.documentElement.lang === 'ru'");

    // What is refused is refused in the language of the page, also after a switch.
    page.open(&service.page("feed-schedule?/limits/tool_usage_max=0.001"));
    page.until(
        "document.documentElement.lang === 'ru' && /[а-я]/.test(document.querySelector('.problem li').textContent)",
    );
    let said = page.text(".problem li");
    assert!(said.contains("прогиб (z5)") && !said.contains('@') && !said.contains('_'), "{said}");
    page.click_on("EN");
    page.until("document.documentElement.lang === 'en' && /deflection \\(z5\\)/.test(document.querySelector('.problem li').textContent)");
    page.click_on("RU");
    page.until(
        "document.documentElement.lang === 'ru' && /прогиб/.test(document.querySelector('.problem li').textContent)",
    );

    // It is remembered.
    page.open(&service.page(""));
    page.until("document.documentElement.lang === 'ru' && document.querySelector('.questions')");
    page.click_on("EN");
    page.until("document.documentElement.lang === 'en' && /^What/.test(document.querySelector('h1').textContent)");
    page.assert_calm();
}
