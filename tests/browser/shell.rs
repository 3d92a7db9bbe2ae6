//! What is around the pages: the address, the navigation, the lists that take files.

use crate::both;

#[test]
fn an_address_that_is_no_encoding_is_the_address_of_no_page() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("%"));
    page.until("document.querySelector('main h1')?.textContent === 'There is no such page'");
    // The same on the way from a page that there is.
    page.evaluate("location.hash = '#/jobs'");
    page.until("document.querySelector('main h1').textContent === 'Jobs'");
    page.evaluate("location.hash = '#/%E0%A4%A'");
    page.until("document.querySelector('main h1').textContent === 'There is no such page'");
    page.click("main a");
    page.wait_for(".questions li");
    page.assert_calm();
}
