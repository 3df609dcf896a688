//! The studio in a real browser: the whole story with the mouse, the same with keys alone, both
//! widths, light and dark. Where Chromium or its driver is absent it says so, and passes.
//!
//! With `LEVERRIER_SHOTS` set to a folder, every step is kept there as a picture.

use std::fs;

use crate::support::browser::{ALT, Browser, CONTROL, ENTER, TAB};
use crate::support::studio::{Studio, demo};

const ADD_DRAG: &str = "button[data-effect='viscous_drag(q)']";
const SEEN: &str = "document.querySelector('#figures svg') && document.querySelector('.leader')";
const QUIET: &str = "document.querySelector('.verdict.nothing_missing')";

/// Every control has a name, nothing sticks out sideways, and the browser has no complaint.
fn sound(browser: &Browser, what: &str) {
    let nameless = browser.value(
        "[...document.querySelectorAll('button, input, select, textarea, summary')]
            .filter((e) => e.checkVisibility())
            .filter((e) => !(e.innerText?.trim() || e.ariaLabel || e.labels?.length
                || e.getAttribute('aria-labelledby')))
            .map((e) => e.outerHTML.slice(0, 120))",
    );
    assert_eq!(nameless, serde_json::json!([]), "{what}: controls without a name");
    let wide = browser.value("document.documentElement.scrollWidth - innerWidth");
    assert!(wide.as_i64().is_some_and(|x| x <= 0), "{what}: {wide} pixels too wide");
    assert_eq!(browser.complaints(), Vec::<String>::new(), "{what}");
}

/// The error that the page shows first, in units of the noise.
fn error(browser: &Browser) -> f64 {
    let text = browser.value("document.querySelector('.card b').innerText");
    let word = text.as_str().and_then(|text| text.split(' ').next());
    word.and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("{text}"))
}

/// A message is shown, and says this: the text of a hidden one is that of the file before.
fn handed(words: &str) -> String {
    format!(
        "!document.getElementById('message').hidden
            && document.getElementById('message').innerText.includes('{words}')"
    )
}

fn story(width: u32, height: u32, dark: bool) {
    let Some(browser) = Browser::open(width, height, dark) else { return };
    let (folder, spec) = demo();
    let studio = Studio::open(&spec);
    let shot = |step: &str| browser.shot(&format!("{width}-{step}"));
    browser.go(&studio.address);
    browser.until("document.getElementById('text').value.includes('cos(q)')");
    assert_eq!(browser.value("location.hash"), "", "the token stays in sight");
    // The failure is seen, and named.
    browser.until(SEEN);
    assert!(error(&browser) > 3.0);
    assert!(browser.value("document.querySelectorAll('#figures svg').length").as_u64() >= Some(6));
    shot("1-failure");
    sound(&browser, "open");
    // A stretch of time is picked in one plot; the portrait shows it too.
    browser.run(
        "document.querySelector('#figures path[data-run]:not([data-times])')
            .closest('svg').scrollIntoView({ block: 'center' })",
    );
    let area = browser.value(
        "(() => { const path = document.querySelector('#figures path[data-run]:not([data-times])');
            const box = path.getBoundingClientRect();
            return [box.left, box.top + box.height / 2, box.width]; })()",
    );
    let at = |i: usize| area[i].as_f64().expect("a place");
    browser.drag((at(0) + 0.3 * at(2), at(1)), (at(0) + 0.6 * at(2), at(1)));
    browser.until("document.querySelectorAll('.picked').length >= 3");
    browser.until("document.querySelector('.cloud.picked')");
    assert!(
        browser.value("document.getElementById('look-from').valueAsNumber").as_f64() > Some(0.5)
    );
    shot("2-picked");
    browser.click("#look-clear");
    browser.until("!document.querySelector('.picked')");
    // The suggested effect is added: the error falls to the noise floor.
    browser.click(ADD_DRAG);
    browser.until("document.getElementById('ledger').innerText.includes('add viscous_drag(q)')");
    browser.until(QUIET);
    let fallen = error(&browser);
    assert!((0.8..1.2).contains(&fallen), "{fallen}");
    assert!(fs::read_to_string(&spec).expect("the spec").contains("effect viscous_drag(q)"));
    assert!(
        browser.value("document.getElementById('text').value.includes('viscous_drag')") == true
    );
    browser.run("scrollTo(0, 0)");
    shot("3-added");
    sound(&browser, "added");
    // Everything can be saved, and the menu stays as the hand left it when a file arrives.
    for format in ["latex", "rust", "report (HTML)", "all plots (SVG)", "all plots (PNG)"] {
        browser.run("document.getElementById('message').hidden = true");
        browser.click("#export summary");
        browser.run(&format!(
            "[...document.querySelectorAll('#formats button')]
                .find((button) => button.innerText === '{format}').click();
             document.querySelector('#export summary').click()"
        ));
        browser.until(&handed(" is handed to the browser"));
        assert_eq!(browser.value("document.getElementById('export').open"), true, "{format}");
        browser.click("#export summary");
    }
    browser.run("document.getElementById('message').hidden = true");
    browser.click("figcaption button[aria-label$='PNG']");
    browser.until(&handed(".png is handed"));
    // A spec with errors says so in place, and cannot be learned.
    browser.run(
        "const text = document.getElementById('text');
         text.value = text.value.replace('cos(q)', 'coz(q)');
         text.dispatchEvent(new Event('input')); text.scrollIntoView({ block: 'center' })",
    );
    browser.until("document.querySelector('.problem.error') && document.querySelector('.wrong')");
    assert_eq!(browser.value("document.getElementById('learn').disabled"), true);
    shot("4-error");
    sound(&browser, "a spec with errors");
    browser.click("#reload");
    browser.until("!document.querySelector('.problem')");
    // And undone.
    browser.run("scrollTo(0, 0)");
    browser.click("#undo");
    browser.until("document.querySelector('.verdict.missing')");
    assert!(error(&browser) > 3.0);
    assert!(!fs::read_to_string(&spec).expect("the spec").contains("effect"));
    shot("5-undone");
    sound(&browser, "undone");
    drop(folder);
}

#[test]
fn the_whole_story_on_a_desk() {
    story(1280, 900, false);
}

#[test]
fn the_whole_story_on_a_telephone_at_night() {
    story(390, 844, true);
}

#[test]
fn the_whole_story_with_keys_alone() {
    let Some(browser) = Browser::open(1280, 900, true) else { return };
    let (_folder, spec) = demo();
    let studio = Studio::open(&spec);
    browser.go(&studio.address);
    browser.until(SEEN);
    // Tab reaches the button of the first suggestion, and what has the focus can be seen.
    let reached = (0..120).any(|_| {
        browser.press(&[TAB]);
        browser.value("document.activeElement.dataset.effect === 'viscous_drag(q)'") == true
    });
    assert!(reached, "the suggestion is not reached with Tab");
    let outline = browser.value("getComputedStyle(document.activeElement).outlineStyle");
    assert_ne!(outline, "none");
    browser.shot("keys-1-focus");
    browser.press(&[ENTER]);
    browser.until(QUIET);
    assert!(error(&browser) < 1.2);
    browser.press(&[ALT, "z"]);
    browser.until("document.querySelector('.verdict.missing')");
    // A stretch of time by numbers.
    browser.run("document.getElementById('look-from').focus()");
    browser.press(&[CONTROL, "a"]);
    browser.write("2");
    browser.press(&[TAB]);
    browser.press(&[CONTROL, "a"]);
    browser.write("5");
    browser.press(&[ENTER]);
    browser.until("document.querySelectorAll('.picked').length >= 3");
    // The spec is edited, saved and learned.
    browser.press(&[ALT, "1"]);
    browser.press(&[CONTROL, "\u{E010}"]);
    browser.write("# by hand");
    browser.press(&[CONTROL, ENTER]);
    browser.until("document.getElementById('saved').innerText.startsWith('As it is')");
    assert!(fs::read_to_string(&spec).expect("the spec").ends_with("# by hand"));
    // The suggestion again, by its own key; the list of keys.
    browser.until(
        "document.getElementById('job-text').innerText === 'Ready'
            && document.querySelector('.verdict.missing')
            && document.querySelector('.leader button:not(:disabled)')",
    );
    browser.press(&[ALT, "a"]);
    browser.until(QUIET);
    browser.press(&[ALT, "3"]);
    browser.press(&["?"]);
    browser.until("document.getElementById('keys').open");
    browser.shot("keys-2-list");
    sound(&browser, "keys");
}

#[test]
fn without_the_token_nothing_is_shown() {
    let Some(browser) = Browser::open(390, 844, false) else { return };
    let (_folder, spec) = demo();
    let studio = Studio::open(&spec);
    browser.go(&format!("http://127.0.0.1:{}/", studio.port));
    browser.until("document.getElementById('job-text').innerText === 'No access'");
    assert_eq!(browser.value("document.getElementById('text').value"), "");
    browser.shot("390-no-access");
}
