//! The page in a real browser: Chromium, driven by its DevTools protocol over two pipes.
//!
//! Without Chromium (Debian's package `chromium`) the tests say so and pass.
//! `STICKSLIP_SCREENSHOTS=FOLDER` writes a picture of every view.

use crate::chromium::{self, Browser};
use std::path::Path;
use stickslip_explore::{Server, Settings, Start};
use stickslip_study::run::{Context, run};
use stickslip_study::{read_study, templates};

/// Starts a server and a browser on its page; `None` without Chromium.
fn open(start: Start) -> Option<(Server, Browser)> {
    let mut browser = Browser::start()?;
    let server = Server::start(Settings::new(start)).unwrap();
    browser.go(server.address());
    Some((server, browser))
}

fn couple() -> Start {
    Start::Template("blade-couple".into())
}

/// On a busy machine the page asks before it computes; the condition then presses the button once.
const CURVE: &str = "document.querySelector('#response-plot')?.data?.length > 7 \
    || void ((button) => button && !window.pressed && (window.pressed = true, button.click())) \
    ([...document.querySelectorAll('button')].find((b) => b.textContent === 'Compute' && b.offsetParent))";
/// The highest amplitude of the curves that are drawn in front.
const HIGHEST: &str = "Math.max(...document.querySelector('#response-plot').data.filter((t) => t.mode === 'lines' && t.hoverinfo !== 'skip' && t.legendgroup).flatMap((t) => t.y))";

#[test]
fn a_slider_changes_the_curve_and_undo_brings_it_back() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    let before = browser.number(HIGHEST);
    let slide = "const slider = document.getElementById('q-parameters-F0-slider'); slider.value = 700; \
                 slider.dispatchEvent(new Event('input')); slider.dispatchEvent(new Event('change')); true";
    browser.evaluate(slide);
    // F0 from 10 N to 25 N: the couple with the same limits has higher peaks
    browser.wait(&format!("{HIGHEST} > {}", 1.5 * before));
    browser.wait("document.querySelector('.row.changed .name').textContent.startsWith('F0')");
    browser.evaluate("document.getElementById('undo').click()");
    browser.wait(&format!("Math.abs({HIGHEST} / {before} - 1) < 1e-9"));
    browser.wait("document.querySelectorAll('.row.changed').length === 0");
    browser.picture("response");
    browser.check_clean();
}

#[test]
fn a_click_on_the_curve_opens_its_orbit() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    let at = "const plot = document.querySelector('#response-plot'); const full = plot._fullLayout; \
              const box = plot.getBoundingClientRect(); const trace = plot.data.find((t) => t.legendgroup === 'blade1' && t.mode === 'lines' && t.xaxis === 'x2'); \
              const i = trace.y.indexOf(Math.max(...trace.y)); \
              [box.left + full.xaxis2._offset + full.xaxis2.d2p(trace.x[i]), box.top + full.yaxis2._offset + full.yaxis2.d2p(trace.y[i])]";
    let place = browser.evaluate(at);
    let [x, y] = [0, 1].map(|i| place[i].as_f64().unwrap());
    browser.click(x, y);
    browser.wait("document.querySelector('#orbit-loops')?.data?.[0]?.x.length > 200");
    assert_eq!(browser.text("document.getElementById('orbit-case').selectedOptions[0].textContent"), "Ft = 4 N");
    assert!(browser.text("document.getElementById('orbit-words').textContent").contains("energy balance closes"));
    // a loop of Coulomb's law has the limits ± Ft
    let largest = browser.number("Math.max(...document.querySelector('#orbit-loops').data[0].y)");
    assert!((largest - 4.0).abs() < 1e-9, "{largest}");
    browser.picture("orbit");
    browser.evaluate("document.getElementById('tab-motion').click()");
    browser.wait("document.querySelector('canvas').width > 300");
    browser.picture("motion");
    browser.check_clean();
}

#[test]
fn the_best_slip_limit_is_found_and_the_map_moves_the_sliders() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('tab-design').click()");
    browser.evaluate("document.getElementById('compute-performance').click()");
    browser.wait_long("document.querySelector('#design-performance').data?.length > 0");
    let words = browser.text("document.querySelector('#panel-design .hint').textContent");
    let best: f64 = words.split_once("Best Ft: ").unwrap().1.split(' ').next().unwrap().parse().unwrap();
    assert!((best - 6.684).abs() < 0.01, "{words}");
    browser.evaluate("document.getElementById('map-x-points').value = 4; document.getElementById('map-y-points').value = 3; document.getElementById('compute-map').click()");
    browser.wait_long("document.querySelector('#design-map').data?.some((t) => t.type === 'heatmap')");
    browser.picture("design");
    let at = "const plot = document.querySelector('#design-map'); plot.scrollIntoView({ block: 'center' }); const full = plot._fullLayout; const box = plot.getBoundingClientRect(); \
              [box.left + full.xaxis._offset + full.xaxis._length / 2, box.top + full.yaxis._offset + full.yaxis._length / 2]";
    let place = browser.evaluate(at);
    let [x, y] = [0, 1].map(|i| place[i].as_f64().unwrap());
    browser.drag([x, y], [x + 30.0, y - 20.0]);
    browser.wait("document.querySelectorAll('.row.changed').length === 2");
    browser.check_clean();
}

#[test]
fn pins_are_compared() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('pin').click()");
    browser.wait("document.querySelectorAll('#panel-compare tbody tr').length >= 4");
    browser.evaluate("document.getElementById('tab-compare').click()");
    assert!(browser.text("document.querySelector('#panel-compare tbody').textContent").contains("Ft = 2 N"));
    browser.picture("compare");
    browser.check_clean();
}

/// The study that the page saves gives the numbers on the screen, bit for bit.
#[test]
fn the_saved_study_gives_the_numbers_on_the_screen() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate(
        "const field = document.getElementById('q-parameters-kt'); field.value = '12345.6'; field.dispatchEvent(new Event('change')); true",
    );
    browser.wait("document.querySelectorAll('.row.changed').length === 1 && !document.querySelector('#response-plot').classList.contains('stale')");
    let text = browser.text(
        "await new Promise((resolve) => { URL.createObjectURL = (blob) => { blob.text().then(resolve); return 'blob:none'; }; \
         document.getElementById('save-study').click(); })",
    );
    assert!(text.starts_with("# Changed in the explorer; the original is the template blade-couple.\n"), "{text}");
    let original = templates::find("blade-couple").unwrap().study;
    assert!(text.ends_with(&original.replace("10000 N/m", "12345.6 N/m")), "{text}");
    let study = read_study("saved.toml", &text, &[]).unwrap();
    let expected = run(&study, &Context::without_progress(1)).unwrap();
    let tables = browser.evaluate(
        "await import('/assets/api.js').then((api) => api.run('test', { study: 'template:blade-couple', tables: true, \
         changes: [{ path: ['parameters', 'kt'], value: { text: '12345.6 N/m' } }], view: { kind: 'study', points: null, references: false, scale: null } })).then((event) => event.tables)",
    );
    for table in &expected.tables {
        for (at, column) in table.columns.iter().enumerate() {
            let Some(numbers) = table.numbers(&column.name) else { continue };
            let shown = tables[&table.name][at]["values"].as_array().unwrap();
            assert_eq!(shown.len(), numbers.len());
            for (shown, number) in shown.iter().zip(numbers) {
                assert_eq!(
                    shown.as_f64().map(f64::to_bits),
                    Some(number.to_bits()).filter(|_| number.is_finite()),
                    "{}",
                    column.name
                );
            }
        }
    }
}

#[test]
fn a_wrong_value_is_explained_at_its_field() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    let set = |value: &str| {
        format!(
            "const field = document.getElementById('q-joint-0-law-limit'); field.value = '{value}'; field.dispatchEvent(new Event('change')); true"
        )
    };
    browser.evaluate(&set("Fy"));
    browser.wait("!document.getElementById('message').hidden");
    assert!(browser.text("document.getElementById('message').textContent").contains("Fy"));
    browser.evaluate(&set("Ft"));
    browser.wait("document.getElementById('message').hidden");
    browser.evaluate("const field = document.getElementById('q-study-frequency-points'); field.value = '-3'; field.dispatchEvent(new Event('change')); true");
    assert_eq!(
        browser.text("document.getElementById('q-study-frequency-points').getAttribute('aria-invalid')"),
        "true"
    );
}

/// Every template opens, draws its figure and fits on a narrow and on a dark page.
#[test]
fn every_template_opens_wide_narrow_light_and_dark() {
    let Some((server, mut browser)) = open(Start::Gallery) else { return };
    browser.wait("document.querySelectorAll('.card').length >= 12");
    browser.picture("gallery");
    for (index, template) in templates::TABLE.iter().enumerate() {
        browser.evaluate("document.getElementById('open-gallery').click()");
        browser.evaluate(&format!("document.querySelector('[data-study=\"template:{}\"]').click()", template.name));
        browser.wait_long(
            "document.querySelector('#response-plot')?.data?.length > 0 || !document.querySelector('#panel-response .empty button').hidden",
        );
        assert!(browser.number("document.querySelectorAll('.row').length") >= 3.0, "{}", template.name);
        browser.size([390, 844][index % 2].max(390), 844);
        browser.dark(index % 2 == 0);
        browser.wait("document.documentElement.scrollWidth <= innerWidth");
        browser.size(1400, 900);
    }
    browser.picture("dark");
    browser.size(390, 844);
    browser.picture("narrow");
    browser.check_clean();
    // nothing comes from another host
    let own = format!("http://127.0.0.1:{}/", server.port());
    let foreign: Vec<String> = browser
        .requests()
        .into_iter()
        .filter(|address| !address.starts_with(&own) && !address.starts_with("data:") && !address.starts_with("blob:"))
        .collect();
    assert!(foreign.is_empty(), "{foreign:?}");
}

#[test]
fn the_keyboard_reaches_everything() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    let before = browser.number(HIGHEST);
    browser.evaluate("document.getElementById('q-parameters-F0-slider').focus()");
    for _ in 0..40 {
        browser.key("ArrowRight");
    }
    browser.wait(&format!("{HIGHEST} > {}", 1.05 * before));
    browser.evaluate("document.getElementById('tab-response').focus()");
    browser.key("ArrowRight");
    browser.wait("document.getElementById('tab-orbit').getAttribute('aria-selected') === 'true'");
    // every field has a name
    let nameless = "[...document.querySelectorAll('input, select, button')].filter((e) => !e.labels?.length && !e.getAttribute('aria-label') && !e.textContent.trim()).length";
    assert_eq!(browser.number(nameless), 0.0);
}

/// A server that ends while the page is open is reported; the page continues after a restart.
#[test]
fn the_page_continues_after_a_restart() {
    let Some((server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    let port = server.port();
    drop(server);
    browser.evaluate("document.getElementById('q-parameters-F0').value = '11'; document.getElementById('q-parameters-F0').dispatchEvent(new Event('change')); true");
    browser.wait("document.getElementById('message').textContent.includes('does not answer')");
    let _again = Server::start(Settings { port, ..Settings::new(couple()) }).unwrap();
    // the new server has another token: the page says what to do
    browser.wait_long("document.getElementById('message').textContent.includes('token')");
}

#[test]
fn screenshots_have_a_folder() {
    // a misspelt variable would write nowhere
    if let Some(folder) = std::env::var_os(chromium::SCREENSHOTS) {
        assert!(Path::new(&folder).is_dir(), "{folder:?} is no folder");
    }
}
