//! The sizes at which the page is used, each in both languages, on light and on dark screens.

use crate::access::assert_accessible;
use crate::chromium::Page;

/// A phone, a shop tablet, a desk, a wide desk.
pub const SIZES: [(u32, u32); 4] = [(390, 844), (1024, 600), (1440, 900), (2560, 1440)];

/// The page in a language, its answer too.
pub fn speak(page: &mut Page, tag: &str) {
    page.click_on(&tag.to_uppercase());
    page.until(&format!(
        "document.documentElement.lang === '{tag}' && /[а-я]/i.test(document.querySelector('.verdict')?.textContent || (document.documentElement.lang === 'ru' ? 'я' : '')) === {}",
        tag == "ru"
    ));
}

/// Looks at the page at every size. Each size has another pair of language and scheme, and with `turn` it has all of them
/// after four states. Back to English on a desk.
pub fn at_sizes(page: &mut Page, turn: usize, mut look: impl FnMut(&mut Page, &str)) {
    for (at, (width, height)) in SIZES.into_iter().enumerate() {
        let pair = (at + turn) % 4;
        let (is_dark, tag) = (pair % 2 == 1, if pair < 2 { "en" } else { "ru" });
        page.screen(width, height, is_dark);
        page.until(&format!("innerWidth === {width}"));
        speak(page, tag);
        look(page, &format!("{width}x{height}, {tag}, {}", if is_dark { "dark" } else { "light" }));
    }
    page.screen(1440, 900, false);
    page.until("innerWidth === 1440");
    speak(page, "en");
}

/// Without a violation and no wider than the window at every size.
pub fn assert_fits(page: &mut Page, turn: usize, state: &str) {
    at_sizes(page, turn, |page, size| fits(page, &format!("{state} at {size}")));
}

/// Without a violation and no wider than the window.
pub fn fits(page: &mut Page, place: &str) {
    page.until("document.documentElement.scrollWidth <= innerWidth");
    assert_accessible(page, place);
}

/// Which of the two panes of a phone is shown.
pub fn pane(page: &mut Page, name: &str) {
    let press = format!(
        "(() => {{ const room = document.querySelector('main.room'); if (room.dataset.pane !== '{name}') document.querySelector(`.pane-switch button:nth-child(${{'{name}' === 'form' ? 1 : 2}})`).click() }})()"
    );
    page.evaluate(&press);
    page.until(&format!("document.querySelector('main.room').dataset.pane === '{name}'"));
}
