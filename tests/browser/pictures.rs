//! Pages as pictures, for people to look at.

use super::devtools::Browser;
use serde_json::json;
use std::fs;
use std::path::Path;

/// Pictures of a page at these widths, everything unfolded, and the page as it prints, beside it.
pub fn take(browser: &mut Browser, page: &Path, widths: &[u32]) {
    browser.open(page);
    for width in widths {
        browser.resize(*width, 800);
        browser.evaluate("document.querySelectorAll('details').forEach((d) => d.open = true)");
        let height = browser.evaluate("document.documentElement.scrollHeight");
        browser.resize(*width, height.as_u64().unwrap());
        let whole = json!({ "format": "png" });
        save(
            browser,
            "Page.captureScreenshot",
            whole,
            &page.with_extension(format!("{width}.png")),
        );
    }
    browser.evaluate("document.querySelectorAll('details').forEach((d) => d.open = false)");
    // As a printer would have it, not as the screen that is put on.
    browser.media("");
    let sheet = json!({ "printBackground": true, "paperWidth": 8.27, "paperHeight": 11.69 });
    save(
        browser,
        "Page.printToPDF",
        sheet,
        &page.with_extension("pdf"),
    );
}

fn save(browser: &mut Browser, method: &str, params: serde_json::Value, path: &Path) {
    let answer = browser.ask(method, params);
    fs::write(path, decoded(answer["data"].as_str().unwrap())).unwrap();
}

/// Bytes of a text in base 64.
pub fn decoded(text: &str) -> Vec<u8> {
    let (mut bits, mut held, mut bytes) = (0, 0_u32, Vec::new());
    for c in text.bytes() {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => break,
        };
        held = held << 6 | u32::from(value);
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
        }
    }
    bytes
}

#[test]
fn base_64_is_read() {
    assert_eq!(decoded("JVBERi0="), b"%PDF-");
    assert_eq!(decoded("AP+A"), [0, 255, 128]);
}
