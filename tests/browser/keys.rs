//! A service that asks for a key.

use precut::config::ApiKey;
use precut::http::auth;

use crate::chromium::Page;
use crate::service::Service;
use crate::{SETTLED, TURN};

const KEY: &str = "the key of this test";

fn locked() -> Service {
    Service::start_with(|config| {
        config.auth.keys.push(ApiKey {
            name: "shop".to_owned(),
            hash: auth::hash(KEY).to_hex().to_string(),
            ..ApiKey::default()
        });
    })
}

/// Opens a page of a tab without a key, and gives it.
fn open_with_key(page: &mut Page, address: &str) {
    page.open(address);
    page.wait_for("#api-key");
    page.fill("#api-key", KEY);
    page.press("Enter");
    page.until(&format!("!document.querySelector('.key-form') && {SETTLED}"));
}

#[test]
fn with_a_key_ones_own_part_is_wherever_the_key_is() {
    const MODULUS: &str = "#field-shaft-youngs_modulus_n_per_mm2";
    let _turn = TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let Some(mut page) = Page::new() else { return };
    let service = locked();
    open_with_key(&mut page, &service.page("deflection-compensation"));
    page.fill(MODULUS, "123000");
    page.until(&format!("{SETTLED} && !document.querySelector('.not-theirs')"));
    page.click("[data-own='shaft Shaft'] [data-act=keep]");
    page.wait_for("[data-own='shaft Shaft'] [data-act=forget]");
    assert_eq!(page.evaluate("localStorage.getItem('precut-own-parts')"), serde_json::Value::Null);
    page.assert_calm();
    // Another browser, the same key, another calculator.
    drop(page);
    let Some(mut page) = Page::new() else { return };
    open_with_key(&mut page, &service.page("feed-schedule"));
    assert_eq!(page.value(MODULUS), "123000");
    assert!(page.text(".own-note").contains("shaft"));
    page.click("[data-own='shaft Shaft'] [data-act=forget]");
    page.wait_for("[data-own='shaft Shaft'] [data-act=keep]");
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    assert_ne!(page.value(MODULUS), "123000");
    page.assert_calm();
}

#[test]
fn a_locked_service_asks_for_its_key_and_says_when_it_is_wrong() {
    let _turn = TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let Some(mut page) = Page::new() else { return };
    let service = locked();
    page.open(&service.page("deflection-compensation"));
    page.wait_for("#api-key");
    page.until("document.activeElement.id === 'api-key'");
    assert!(page.text(".key-form label").contains("asks for a key"));
    assert_eq!(page.evaluate("document.querySelector('.form')"), serde_json::Value::Null);

    page.fill("#api-key", "another key");
    page.press("Enter");
    page.until("document.querySelector('.key-form [role=alert]')?.textContent.includes('does not know')");
    crate::access::assert_accessible(&mut page, "key refused");
    assert_eq!(page.value("#api-key"), "");
    assert_eq!(page.evaluate("document.querySelector('#api-key').type"), "password");

    page.fill("#api-key", KEY);
    page.press("Enter");
    page.until(&format!("!document.querySelector('.key-form') && {SETTLED}"));
    // It is used for everything, a reload included, and lives no longer than the tab.
    page.click("#tab-tables");
    page.until("document.querySelectorAll('[role=tabpanel] tbody tr').length > 100");
    page.evaluate("location.reload()");
    page.until(&format!("performance.navigation.type === 1 && !document.querySelector('.key-form') && {SETTLED}"));
    assert_eq!(page.evaluate("JSON.stringify(localStorage).includes('the key')"), false);
    assert_eq!(page.evaluate("location.href.includes('the%20key') || document.cookie !== ''"), false);
    page.assert_calm();
}
