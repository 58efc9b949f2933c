//! A scene that is looked at, as a user sees it: the real program, watched with a real browser.
//!
//! Needs Debian's packages `chromium` and `chromium-driver`, and the built binary (`cargo build --release`).

use std::path::Path;

use clerestory_tests::browser::Browser;
use clerestory_tests::farm::{Process, clerestory, succeeded};
use serde_json::Value;

/// Pixels of the shown picture, as a list of numbers.
const PIXELS: &str = "
    const picture = document.querySelector('#picture');
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [picture.naturalWidth, picture.naturalHeight];
    const context = canvas.getContext('2d');
    context.drawImage(picture, 0, 0);
    return Array.from(context.getImageData(0, 0, canvas.width, canvas.height).data);";

/// Waits until a look has all its samples, and returns its picture.
async fn finished(browser: &Browser, look: u32) -> Value {
    let is_there = format!(
        "const {{ look, samples }} = document.querySelector('#picture').dataset;
        return look === '{look}' && samples === '4' ? true : null;"
    );
    browser.script_gives(&is_there).await;
    browser.script(PIXELS).await
}

#[tokio::test]
async fn the_camera_and_the_sun_move_and_the_picture_becomes_clear() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("scenes/room.json");
    let options = ["--size", "96x72", "--spp", "4", "--listen", "127.0.0.1:0"];
    let (mut viewer, address) = Process::serving(clerestory().arg("view").arg(scene).args(options));
    let browser = Browser::open(&address).await;
    browser.shows("#progress", "4 of 4 samples a pixel").await;
    let first = finished(&browser, 1).await;
    assert_eq!(first.as_array().unwrap().len(), 96 * 72 * 4);

    let key = "document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft', bubbles: true }))";
    browser.script(key).await;
    let turned = finished(&browser, 2).await;
    assert_ne!(turned, first, "the camera has turned");

    let slide = "const slider = document.querySelector('#azimuth');
        slider.value = Number(slider.value) + 20;
        slider.dispatchEvent(new Event('input'));
        slider.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft', bubbles: true }));";
    browser.script(slide).await;
    let lit = finished(&browser, 3).await;
    assert_ne!(lit, turned, "the sun has moved");

    browser.click("#reset", "As in the file").await;
    assert_eq!(finished(&browser, 4).await, first, "the same look is the same picture, bit for bit");

    let drag = "const picture = document.querySelector('#picture');
        const { left, top } = picture.getBoundingClientRect();
        picture.setPointerCapture = () => {};
        picture.hasPointerCapture = () => true;
        const at = (type, x) => picture.dispatchEvent(new PointerEvent(type,
            { pointerId: 1, clientX: left + x, clientY: top + 30, bubbles: true,
              movementX: type === 'pointermove' ? 12 : 0 }));
        at('pointerdown', 20);
        at('pointermove', 32);";
    browser.script(drag).await;
    assert_ne!(finished(&browser, 5).await, first, "dragging turns the camera, too");

    let copy = "Object.defineProperty(navigator, 'clipboard', { configurable: true,
        value: { writeText: (text) => COPY } });";
    for (copied, said) in [
        ("{ window.copied = JSON.parse(text); }", "Copied."),
        ("{ throw new Error('no'); }", "The browser does not let the page copy."),
    ] {
        browser.script(&copy.replace("COPY", copied)).await;
        browser.click("#copy", "Copy camera and sun").await;
        browser.shows("#copied", said).await;
    }
    assert!(
        browser.script("return window.copied").await["sun"].is_array(),
        "what is copied can be put into a scene file"
    );

    // While keys are held down, there are pictures all the same.
    let hold = "window.seen = [];
        const picture = document.querySelector('#picture');
        new MutationObserver(() => window.seen.push(picture.dataset.look)).observe(picture, { attributes: true });
        let presses = 0;
        const press = setInterval(() => {
            const key = presses++ % 2 ? 'ArrowLeft' : 'ArrowRight';
            picture.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));
            if (presses === 120) { clearInterval(press); window.pressed = true; }
        }, 10);";
    browser.script(hold).await;
    browser.script_gives("return window.pressed ?? null").await;
    let seen = browser.script("return new Set(window.seen).size").await;
    assert!(seen.as_u64() > Some(5), "{seen} looks were shown while 120 keys were pressed");
    assert_eq!(browser.complaints().await, [""; 0]);

    // An open page does not keep it from ending.
    viewer.ends();
}

#[tokio::test]
async fn a_scene_without_a_sun_has_nothing_to_move_one_with() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("scenes/references/flat-point.json");
    let options = ["--size", "16x16", "--spp", "1", "--listen", "127.0.0.1:0"];
    let (_viewer, address) = Process::serving(clerestory().arg("view").arg(scene).args(options));
    let browser = Browser::open(&address).await;
    browser.shows("#progress", "1 of 1 samples a pixel").await;
    assert_eq!(browser.script("return getComputedStyle(document.querySelector('#sun')).display").await, "none");
}

#[test]
fn a_page_for_the_whole_network_is_refused() {
    let output = clerestory().args(["view", "scene.json", "--listen", "0.0.0.0:0"]).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("--listen: found 0.0.0.0:0, expected an address of this machine"), "{message}");
    succeeded(clerestory().args(["view", "--help"]));
}
