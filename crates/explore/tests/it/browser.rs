//! The page in a real browser: Chromium, driven by its DevTools protocol over two pipes.
//!
//! Without Chromium (Debian's package `chromium`) the tests say so and pass.
//! `STICKSLIP_SCREENSHOTS=FOLDER` writes a picture of every view.

use crate::chromium::{self, Browser};
use crate::{fit, solid};
use std::path::Path;
use stickslip_explore::{Server, Settings, Start};
use stickslip_study::run::{Context, run};
use stickslip_study::{read_study, templates};

/// Starts a server and a browser on its page; `None` without Chromium.
pub(crate) fn open(start: Start) -> Option<(Server, Browser)> {
    let mut browser = Browser::start()?;
    let server = Server::start(Settings::new(start)).unwrap();
    browser.go(server.address());
    Some((server, browser))
}

fn couple() -> Start {
    Start::Template("blade-couple".into())
}

/// The whole figure of a study with several panels is drawn. (A busy machine draws parts before.)
pub(crate) const CURVE: &str = "document.querySelector('#response-plot[aria-busy=\"false\"]')?.data?.length > 7 && document.getElementById('trust').childElementCount > 0";
/// Waits for the figure of a study. Presses the button if a busy machine expects a long run.
fn wait_or_compute(browser: &mut Browser, figure: &str) {
    let button = "[...document.querySelectorAll('button')].find((b) => b.textContent === 'Compute' && b.offsetParent)";
    let press =
        format!("void ((button) => button && !window.pressed && (window.pressed = true, button.click())) ({button})");
    browser.wait_long(&format!("({figure}) || {press}"));
}

/// The highest amplitude of the curves that are drawn in front.
const HIGHEST: &str = "Math.max(...document.querySelector('#response-plot').data.filter((t) => t.mode === 'lines' && t.hoverinfo !== 'skip' && t.legendgroup).flatMap((t) => t.y))";

/// Types a value into a field.
fn type_value(id: &str, value: &str) -> String {
    format!(
        "{{ const field = document.getElementById('{id}'); field.value = '{value}'; field.dispatchEvent(new Event('change')); }} true"
    )
}

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
    browser.wait("document.querySelector('.row.changed .name')?.textContent.startsWith('F0')");
    browser.evaluate("document.getElementById('undo').click()");
    browser.wait(&format!("Math.abs({HIGHEST} / {before} - 1) < 1e-9"));
    browser.wait("document.querySelectorAll('.row.changed').length === 0");
    browser.picture("response");
    // Enter reports a typed value, and leaving the field reports it again: one step of undo
    browser.evaluate(&type_value("q-parameters-Ft", "6"));
    browser.evaluate("document.getElementById('q-parameters-Ft').dispatchEvent(new Event('change')); true");
    browser.wait("document.querySelectorAll('.row.changed').length > 0");
    browser.evaluate("document.getElementById('undo').click()");
    browser.wait("document.querySelectorAll('.row.changed').length === 0");
    browser.check_clean();
}

/// The orbit follows the peak until another frequency is chosen. The peaks are those of the
/// couple at 6 N and at 8 N.
#[test]
fn the_orbit_follows_the_peak() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('tab-orbit').click()");
    let near = |hertz: f64| format!("Math.abs(document.getElementById('orbit-frequency').value - {hertz}) < 0.002");
    let pressed = "[...document.querySelectorAll('button')].find((b) => b.textContent === 'At the peak').getAttribute('aria-pressed')";
    for (limit, hertz) in [("6", 121.231), ("8", 120.842)] {
        browser.evaluate(&type_value("q-parameters-Ft", limit));
        browser.wait(&near(hertz));
        assert_eq!(browser.text(pressed), "true");
    }
    browser.evaluate(&type_value("orbit-frequency", "121"));
    browser.evaluate(&type_value("q-parameters-Ft", "6"));
    // the loop of Coulomb's law has the limits ± Ft: the orbit is that of 6 N
    browser.wait("Math.abs(Math.max(...document.querySelector('#orbit-loops').data[0].y) - 6) < 1e-9");
    assert_eq!(browser.text(pressed), "false");
    assert_eq!(browser.text("document.getElementById('orbit-frequency').value"), "121");
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
    browser.wait("document.querySelector('canvas[aria-label=\"The structure in motion\"]').width > 300");
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
    // other values are compared before they are pinned, and one slip limit needs no column for it
    browser.evaluate(&type_value("q-parameters-Ft", "6"));
    browser.wait("document.querySelector('#pin-summary tbody tr:nth-child(2)')?.textContent.includes('not pinned')");
    browser.picture("compare");
    browser.evaluate(
        "document.querySelector('#panel-compare tbody button[aria-label=\"Remove as in the file\"]').click()",
    );
    browser.evaluate("document.getElementById('pin').click()");
    browser.wait("document.querySelectorAll('#pin-summary tbody tr').length === 1");
    browser.wait("![...document.querySelectorAll('#panel-compare th')].some((title) => title.textContent === 'Case')");
    // a reload keeps the pins of this tab
    browser.evaluate("window.before = true; setTimeout(() => location.reload(), 0)");
    browser.wait("window.before === undefined && document.querySelectorAll('#pin-summary tbody tr').length >= 1");
    assert!(browser.text("document.querySelector('#pin-summary tbody').textContent").contains("Ft = 6"));
    browser.check_clean();
}

/// The checkbox shows the scale of the file, and changes it.
#[test]
fn the_scale_of_the_file_can_be_changed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.toml");
    std::fs::write(
        &file,
        "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"1 N/mm\"\n\
         damping = \"2 kg/s\"\n[[force]]\non = \"m\"\namplitude = \"1 N\"\n[study]\nkind = \"response\"\n\
         frequency = { from = \"2 Hz\", to = \"8 Hz\", points = 13 }\n[figure]\ny = \"log\"\n",
    )
    .unwrap();
    let Some((_server, mut browser)) = open(Start::File(file)) else { return };
    let scale = |browser: &mut Browser, name: &str| {
        browser.wait(&format!("document.querySelector('#response-plot')?.layout?.yaxis?.type === '{name}'"));
    };
    browser.wait("document.getElementById('log')?.checked");
    scale(&mut browser, "log");
    browser.evaluate("document.getElementById('log').click()");
    scale(&mut browser, "linear");
    browser.evaluate("document.getElementById('log').click()");
    scale(&mut browser, "log");
    browser.check_clean();
}

/// A wheel of blades with dampers between them: 24 parts, each damper at equal distances from its
/// two blades.
#[test]
fn dampers_stand_between_their_blades() {
    let Some((_server, mut browser)) = open(Start::Template("under-platform-wedge".into())) else { return };
    let scene =
        "(await import('./assets/scene.js')).sceneOf((await import('./assets/store.js')).state.description.model)";
    browser.wait("document.querySelectorAll('.row').length > 5");
    let distances = format!(
        "const scene = {scene}; const of = (name) => scene.masses.find((one) => one.name === name); \
         const apart = (a, b) => Math.hypot(of(a).x - of(b).x, of(a).y - of(b).y); \
         [scene.masses.length, apart('wedge_0', 'blade_0') / apart('wedge_0', 'blade_1'), \
          apart('wedge_11', 'blade_11') / apart('wedge_11', 'blade_0'), apart('wedge_0', 'blade_0') / apart('blade_0', 'blade_1')]"
    );
    let found = browser.evaluate(&distances);
    let found: Vec<f64> = found.as_array().unwrap().iter().filter_map(|one| one.as_f64()).collect();
    assert_eq!(found[0], 24.0);
    assert!((found[1] - 1.0).abs() < 1e-9 && (found[2] - 1.0).abs() < 1e-9 && found[3] < 1.0, "{found:?}");
}

/// Masses with two directions move in the picture. The force and its arrow are in the left half, and
/// nothing but the other mass changes the right half.
#[test]
fn masses_with_directions_move() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("pair.toml");
    std::fs::write(
        &file,
        "schema = 1\n[[mass]]\nname = \"a\"\nmass = \"1 kg\"\ndirections = [\"x\", \"z\"]\n[[mass]]\nname = \"b\"\n\
         mass = \"1 kg\"\ndirections = [\"x\", \"z\"]\n[[spring]]\nbetween = [\"a.x\", \"ground\"]\nstiffness = \"1 N/mm\"\n\
         damping = \"2 kg/s\"\n[[spring]]\nbetween = [\"a.z\", \"ground\"]\nstiffness = \"1 N/mm\"\n[[spring]]\n\
         between = [\"a.x\", \"b.x\"]\nstiffness = \"1 N/mm\"\n[[spring]]\nbetween = [\"b.z\", \"ground\"]\nstiffness = \"1 N/mm\"\n\
         [[force]]\non = \"a.x\"\namplitude = \"1 N\"\n[study]\nkind = \"response\"\nfrequency = { from = \"2 Hz\", to = \"4 Hz\", points = 5 }\n",
    )
    .unwrap();
    let Some((_server, mut browser)) = open(Start::File(file)) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('tab-motion').click()");
    browser.wait("document.querySelector('canvas[aria-label=\"The structure in motion\"]').width > 300");
    let half = |phase: &str| {
        format!(
            "(() => {{ const time = document.querySelector('[aria-label=\"Time in the period\"]'); time.value = '{phase}'; \
             time.dispatchEvent(new Event('input')); const canvas = document.querySelector('canvas[aria-label=\"The structure in motion\"]'); \
             return canvas.getContext('2d').getImageData(Math.round(0.55 * canvas.width), 0, Math.round(0.45 * canvas.width), canvas.height).data.join(); }})()"
        )
    };
    let differ = format!("{} !== {}", half("0.05"), half("0.55"));
    browser.wait(&differ);
    browser.check_clean();
}

/// A pinned curve stays in the plot when the study has another number of panels.
#[test]
fn a_pin_survives_other_panels() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('pin').click()");
    browser.evaluate(&type_value("q-parameters-Ft", "6"));
    // one case instead of four: one panel
    browser.wait("document.querySelector('#response-plot').layout.xaxis2 === undefined");
    let dashed = "document.querySelector('#response-plot').data.filter((t) => t.owner === 'as in the file')";
    assert_eq!(browser.number(&format!("{dashed}.length")), 12.0, "three places in four cases");
    browser.evaluate("document.getElementById('pin').click()");
    browser.wait("document.querySelectorAll('.legend .pin').length === 2");
    let dashes = "new Set([...document.querySelectorAll('.legend .pin path')].map((path) => path.getAttribute('stroke-dasharray'))).size";
    assert_eq!(browser.number(dashes), 2.0, "pins have different dashes");
    browser.picture("pins");
    // the pinned peak of 2 N is inside the axis
    let inside = format!(
        "document.querySelector('#response-plot')._fullLayout.yaxis.range[1] > Math.max(...{dashed}.flatMap((t) => t.y))"
    );
    browser.wait(&inside);
    browser.evaluate("document.getElementById('pin').click()");
    browser.evaluate("document.getElementById('tab-compare').click()");
    assert!(browser.text("document.querySelector('#pin-summary').textContent").contains("−57.2 %"));
    browser.check_clean();
}

/// Returns what the page offers to save when a button is pressed: the content of the last file.
fn saved(browser: &mut Browser, button: &str) -> String {
    let content = browser.awaited(&format!(
        "new Promise((resolve) => {{ URL.createObjectURL = (blob) => {{ blob.text().then(resolve); return 'data:,'; }}; \
         document.getElementById('{button}').click(); }})"
    ));
    content.as_str().unwrap().to_owned()
}

#[test]
fn pictures_tables_and_a_program_are_saved() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('pin').click()");
    browser.evaluate("window.makeAddress = URL.createObjectURL; true");
    let picture = saved(&mut browser, "save-svg");
    assert!(picture.starts_with("<svg") && picture.contains("amplitude (mm)"), "{}", &picture[..200]);
    for name in ["blade3", "as in the file", "all joints stuck"] {
        assert!(picture.contains(name), "the legend has no {name}");
    }
    // the marker of the page is not part of the figure
    assert!(!picture.contains("#a84a00"));
    let size = "new Promise((resolve) => { const make = window.makeAddress ?? URL.createObjectURL; URL.createObjectURL = (blob) => { if (blob.type === 'image/png') { resolve([blob.type, blob.size]); return 'data:,'; } return make(blob); }; \
                document.getElementById('save-png').click(); })";
    let picture = browser.awaited(size);
    assert!(picture[0] == "image/png" && picture[1].as_f64().unwrap() > 20_000.0, "{picture}");
    let table = saved(&mut browser, "save-csv");
    assert!(table.starts_with("Ft_N,frequency_Hz,") && table.lines().count() == 965, "{}", &table[..80]);
    let program = browser.awaited(
        "new Promise((resolve) => { Object.defineProperty(navigator, 'clipboard', { value: { writeText: async (text) => resolve(text) } }); \
         document.getElementById('save-python').click(); })",
    );
    let program = program.as_str().unwrap();
    let (begin, rest) = program.split_once("from_text(\"\"\"\n").unwrap();
    let (text, end) = rest.split_once("\"\"\", name=\"blade-couple_explored\")\n").unwrap();
    assert!(begin.starts_with("import stickslip\n") && end.contains("study.run()"), "{program}");
    assert_eq!(text, templates::find("blade-couple").unwrap().study);
    browser.check_clean();
}

/// The report is one file that draws its figures without a server.
#[test]
fn a_report_of_the_pins_stands_alone() {
    let Some((server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('pin').click()");
    browser.evaluate(&type_value("q-parameters-kt", "20000"));
    browser.wait("document.querySelectorAll('.row.changed').length === 1 && !document.querySelector('#response-plot').classList.contains('stale')");
    browser.wait("!document.querySelector('#panel-response .state').textContent.includes('fewer')");
    browser.evaluate("document.getElementById('pin').click()");
    browser.wait("document.querySelectorAll('#pin-summary tbody tr').length === 2");
    let report = saved(&mut browser, "save-report");
    drop(server);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("report.html");
    std::fs::write(&file, report).unwrap();
    browser.go(&format!("file://{}", file.display()));
    browser.wait("document.querySelectorAll('.js-plotly-plot .scatterlayer').length >= 2");
    let text = browser.text("document.body.innerText");
    for part in ["kt = 20000 N/m", "as in the file", "48.93 mm", "kt = \"20000 N/m\""] {
        assert!(text.contains(part), "{part}: {text}");
    }
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
    browser.wait("document.querySelectorAll('.card').length >= 11");
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
    let before = browser.number(HIGHEST);
    let (port, token) = (server.port(), server.address().split_once("token=").unwrap().1.to_owned());
    // the server ends while it computes
    browser.evaluate(&type_value("q-study-frequency-points", "90000"));
    drop(server);
    browser.evaluate(&type_value("q-study-frequency-points", "241"));
    browser.evaluate(&type_value("q-parameters-F0", "20"));
    browser.wait("document.getElementById('message').textContent.includes('does not answer')");
    let again = Server::start(Settings { port, token: Some(token), ..Settings::new(couple()) }).unwrap();
    browser.wait_long(&format!("document.getElementById('message').hidden && {HIGHEST} > {}", 1.3 * before));
    drop(again);
    // with another token the page says what to do, and keeps the changes for the new address
    browser.wait_long("document.getElementById('message').textContent.includes('does not answer') || (document.getElementById('q-parameters-F0').dispatchEvent(new Event('change')), false)");
    let other = Server::start(Settings { port, ..Settings::new(couple()) }).unwrap();
    browser.wait_long("document.getElementById('message').textContent.includes('token')");
    browser.go(other.address());
    browser.wait("document.getElementById('q-parameters-F0')?.value === '20' && document.querySelectorAll('.row.changed').length >= 1");
}

/// A page of another server on this machine gets nothing, and a wrong token shows no study.
#[test]
fn other_pages_and_wrong_tokens_get_nothing() {
    let Some((server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    let own = format!("http://127.0.0.1:{}", server.port());
    let token = server.address().split_once("token=").unwrap().1.to_owned();
    let elsewhere = Server::start(Settings::new(Start::Gallery)).unwrap();
    browser.go(elsewhere.address());
    browser.wait("document.querySelectorAll('.card').length >= 11");
    // its own policy forbids the request; without the policy, that of the browser does
    for ask in [
        "fetch",
        "((address, how) => { const frame = document.createElement('iframe'); document.body.append(frame); return frame.contentWindow.fetch(address, how); })",
    ] {
        let script = format!(
            "await {ask}('{own}/api/catalog', {{ headers: {{ 'x-stickslip-token': '{token}' }} }}).then((answer) => 'answer ' + answer.status, () => 'refused')"
        );
        assert_eq!(browser.text(&script), "refused");
    }
    browser.forget_cookies();
    browser.go(&format!("{own}/?token=00000000000000000000000000000000"));
    browser.wait("document.body.innerText.includes('the token is missing or wrong')");
    assert_eq!(browser.number("document.scripts.length"), 0.0);
}

/// On a narrow page a button opens the parameters below the curve.
#[test]
fn a_narrow_page_has_its_parameters_in_a_sheet() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.size(390, 844);
    browser.wait(CURVE);
    assert_eq!(browser.number("document.getElementById('parameters').offsetHeight"), 0.0);
    browser.evaluate("document.getElementById('show-parameters').click()");
    browser.wait("document.getElementById('parameters').offsetHeight > 200");
    browser.wait("document.getElementById('parameters').getBoundingClientRect().bottom <= innerHeight + 1 && document.documentElement.scrollWidth <= innerWidth");
    browser.picture("narrow_parameters");
    browser.key("Escape");
    browser.wait(
        "document.getElementById('parameters').offsetHeight === 0 && document.activeElement.id === 'show-parameters'",
    );
    browser.check_clean();
}

/// With the key Tab alone a user reaches every control in the order of the page.
#[test]
fn tab_reaches_all_controls_in_order() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.querySelectorAll('details.group:not(:first-of-type)').forEach((group) => { group.open = false; }); document.activeElement.blur()");
    let mut seen: Vec<String> = Vec::new();
    for _ in 0..80 {
        browser.key("Tab");
        seen.push(
            browser.text(
                "document.activeElement.id || document.activeElement.className || document.activeElement.tagName",
            ),
        );
    }
    let at =
        |id: &str| seen.iter().position(|one| one == id).unwrap_or_else(|| panic!("{id} is not reached: {seen:?}"));
    let order = [
        "skip",
        "open-gallery",
        "theme",
        "search",
        "q-parameters-m",
        "q-parameters-F0-slider",
        "tab-response",
        "quantity",
        "log",
        "pin",
    ];
    assert!(order.map(at).is_sorted(), "{seen:?}");
    // the focus is visible
    browser.evaluate("document.getElementById('pin').focus()");
    browser.key("Tab");
    assert_eq!(browser.text("getComputedStyle(document.activeElement).outlineStyle"), "solid");
}

/// The disks of a histogram come one after the other.
#[test]
fn mistuned_disks_fill_a_histogram() {
    let Some((_server, mut browser)) = open(Start::Template("bladed-ring".into())) else { return };
    wait_or_compute(&mut browser, CURVE);
    browser.evaluate("document.getElementById('tab-design').click()");
    browser.wait("document.getElementById('mistuning-of').value === 'k'");
    browser.evaluate(
        "document.getElementById('mistuning-disks').value = '4'; document.getElementById('compute-mistuning').click()",
    );
    browser.wait_long("document.querySelector('#design-mistuning').data?.[0]?.x.length === 4");
    browser.wait_long("document.getElementById('compute-mistuning').textContent === 'Compute'");
    let words = browser.text("document.querySelector('[aria-label^=\"Worst blade\"] .hint').textContent");
    assert!(
        words.starts_with("Worst of 4 disks: seed ") && words.contains(" times the peak of the tuned disk"),
        "{words}"
    );
    browser.picture("mistuning");
    browser.check_clean();
}

/// A search of a former study ends when another study is opened.
#[test]
fn another_study_begins_without_searches() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('tab-design').click()");
    // the first press may say how long it takes
    browser.evaluate("for (const axis of ['x', 'y']) { document.getElementById(`map-${axis}-points`).value = 90; } document.getElementById('compute-map').click()");
    browser.wait("document.getElementById('compute-map').textContent === 'Stop' || /takes/.test(document.querySelector('[aria-label=\"Peak over two parameters\"] .hint').textContent)");
    browser.evaluate("document.getElementById('open-gallery').click(); document.querySelector('[data-study=\"template:symmetric-couple\"]').click()");
    browser.wait("document.getElementById('title').textContent !== 'Studies' && document.getElementById('trust').childElementCount > 0");
    browser.evaluate("document.getElementById('tab-design').click()");
    browser.wait("document.getElementById('compute-map').textContent === 'Compute' && document.querySelector('[aria-label=\"Peak over two parameters\"] .hint').textContent.startsWith('How high')");
    browser.check_clean();
}

/// Searches that run can be stopped.
#[test]
fn a_map_can_be_stopped() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('tab-design').click()");
    browser.evaluate("for (const axis of ['x', 'y']) { document.getElementById(`map-${axis}-points`).value = 90; } document.getElementById('compute-map').click()");
    // it takes long, and begins when the button is pressed again
    browser.wait(
        "document.querySelector('[aria-label=\"Peak over two parameters\"] .hint').textContent.includes('Press the button again')",
    );
    browser.evaluate("document.getElementById('compute-map').click()");
    browser.wait(
        "document.querySelector('[aria-label=\"Peak over two parameters\"] .hint').textContent.includes('% computed')",
    );
    assert_eq!(browser.text("document.getElementById('compute-map').textContent"), "Stop");
    browser.evaluate("document.getElementById('compute-map').click()");
    browser
        .wait("document.querySelector('[aria-label=\"Peak over two parameters\"] .hint').textContent === 'Stopped.'");
    // the server is free for the next request
    browser.evaluate("document.getElementById('compute-performance').click()");
    browser.wait_long("document.querySelector('#design-performance').data?.length > 0");
}

/// A structure with a mesh is drawn in three dimensions, moves, and turns with the arrow keys.
#[test]
fn a_structure_with_a_mesh_turns_in_three_dimensions() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_server, mut browser)) = open(Start::File(solid::bar(folder.path()))) else { return };
    wait_or_compute(&mut browser, "document.querySelector('#response-plot')?.data?.length > 0");
    browser.evaluate("document.getElementById('tab-motion').click()");
    browser.wait_long("document.getElementById('solid').offsetHeight > 200");
    // WebGL forgets the picture after the frame, so that it is read in the same task
    let seen = "(() => { const canvas = document.getElementById('solid'); canvas.dispatchEvent(new KeyboardEvent('keydown', { key: KEY })); \
                const gl = canvas.getContext('webgl2'); const bytes = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight); \
                gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, bytes); \
                return bytes.reduce((sum, value, i) => sum + (i % 4 === 3 && value > 0 ? 1 : 0), 0) + 1e-3 * bytes.reduce((sum, value, i) => (sum + value * (i % 97)) % 1009, 0); })()";
    let home = browser.number(&seen.replace("KEY", "'Home'"));
    assert!(home > 5000.0, "{home} pixels");
    let turned = browser.number(&seen.replace("KEY", "'ArrowLeft'"));
    assert!(turned > 5000.0 && turned != home, "{home} {turned}");
    let large = browser.number(&seen.replace("KEY", "'+'"));
    assert!(large > 1.1 * turned, "{turned} {large}");
    assert_eq!(browser.text("document.getElementById('solid-colour').value"), "state");
    browser.picture("solid");
    browser.check_clean();
}

/// `motion.html` draws the surface of a mesh with its contact nodes, moves, and turns.
#[test]
fn a_written_motion_is_drawn_and_turns() {
    let Some(mut browser) = Browser::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = solid::bar(folder.path());
    let text = std::fs::read_to_string(&file).unwrap();
    let (model, _) = text.split_once("[study]").unwrap();
    let text = format!("{model}[study]\nkind = \"orbit\"\nfrequency = \"50 Hz\"\nfields = 8\n");
    let study = read_study(&file.display().to_string(), &text, &[]).unwrap();
    let dataset = run(&study, &Context::without_progress(1)).unwrap();
    let outputs = stickslip_report::Outputs::select(&["motion"]).unwrap();
    stickslip_report::write_dataset(&dataset, folder.path(), &outputs).unwrap();
    browser.go(&format!("file://{}", folder.path().join("bar/motion.html").display()));
    browser.wait_long("document.getElementById('motion')?.data?.length === 2");
    // ten faces of two triangles, and the five nodes that have a contact
    assert_eq!(browser.number("document.getElementById('motion').data[0].i.length"), 20.0);
    assert_eq!(browser.number("document.getElementById('motion').data[1].x.length"), 5.0);
    let height = "document.getElementById('motion').data[0].z.reduce((sum, z) => sum + z * z, 0)";
    browser.evaluate("document.getElementById('play').click()");
    browser.wait("document.getElementById('play').textContent === 'Play'");
    let still = browser.number(height);
    browser.evaluate("(() => { const time = document.getElementById('time'); time.value = (Number(time.value) + 0.25) % 1; time.dispatchEvent(new Event('input')); })()");
    browser.wait(&format!("{height} !== {still}"));
    let eye = "document.getElementById('motion').layout.scene.camera.eye.x";
    let before = browser.number(eye);
    browser.evaluate(
        "document.getElementById('motion').dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft' }))",
    );
    browser.wait(&format!("Math.abs({eye} - {before}) > 0.01"));
    assert!(browser.text("document.getElementById('factor').textContent").starts_with("displacements × "));
    browser.picture("motion");
    browser.check_clean();
}

/// A fit starts at the sliders, shows errors, and moves the sliders to its values.
#[test]
fn a_fit_moves_the_sliders_to_the_measured_curve() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_server, mut browser)) = open(Start::File(fit::rig(folder.path()))) else { return };
    browser.wait_long("document.querySelector('#response-plot')?.data?.some((t) => t.name === 'measured: rig')");
    browser.evaluate("document.getElementById('tab-design').click()");
    assert_eq!(
        browser.text("document.getElementById('fit-target').selectedOptions[0].textContent"),
        "rig: response of body"
    );
    browser.evaluate("document.getElementById('compute-fit').click()");
    browser.wait_long("document.querySelector('#panel-design table.fitted tbody tr')");
    browser.wait("document.querySelector('#design-fit').data?.length > 0");
    browser.picture("fit");
    browser.evaluate("document.querySelector('#panel-design button.take').click()");
    browser.wait(&format!(
        "Math.abs(document.getElementById('q-parameters-Ft').value / {} - 1) < 1e-4 && document.querySelectorAll('.row.changed').length >= 1",
        fit::LIMIT
    ));
    browser.check_clean();
}

/// While a slider moves, only the paths of the curves change; the rest follows when it stops.
#[test]
fn curves_follow_a_moving_slider_and_settle() {
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    let path = "document.querySelector('#response-plot .scatterlayer .trace path.js-line')?.getAttribute('d')";
    let first = browser.text(path);
    browser.evaluate("performance.clearMarks(); const moving = document.getElementById('q-parameters-F0-slider'); moving.value = 480; moving.dispatchEvent(new Event('input')); true");
    browser.wait(&format!("{path} !== '{first}'"));
    // it rests: nothing of the movement stays, and the data are those of the new curve
    browser.wait_long("document.querySelector('#panel-response .state').textContent === '' && document.querySelectorAll('path.before').length === 0");
    browser.wait("document.querySelectorAll('#response-plot .trace[style*=visibility]').length === 0");
    browser.check_clean();
}

/// The rules of axe-core for every tab, light and dark. `STICKSLIP_AXE` names its script, which
/// `.ci/explorer` fetches.
#[test]
fn axe_finds_no_violations() {
    let script = std::env::var_os("STICKSLIP_AXE").and_then(|file| std::fs::read_to_string(file).ok());
    let Some(script) = script else {
        eprintln!("skipped: STICKSLIP_AXE does not name the script of axe-core (.ci/explorer fetches it)");
        return;
    };
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.wait(CURVE);
    browser.evaluate("document.getElementById('pin').click()");
    browser.evaluate(&script);
    for dark in [false, true] {
        browser.dark(dark);
        for tab in ["response", "orbit", "motion", "design", "compare"] {
            browser.evaluate(&format!("document.getElementById('tab-{tab}').click()"));
            if tab == "orbit" {
                browser.wait("document.querySelector('#orbit-loops')?.data?.length > 0");
            }
            let found = browser.text(
                "await axe.run(document, { resultTypes: ['violations'] }).then((all) => all.violations.map((one) => `${one.id}: ${one.help}: ${one.nodes.slice(0, 3).map((node) => node.html.slice(0, 160)).join(' | ')}`).join('\\n'))",
            );
            assert_eq!(found, "", "{tab}, dark: {dark}");
        }
    }
    browser.evaluate("document.getElementById('open-gallery').click()");
    let found = browser.text("await axe.run(document).then((all) => all.violations.map((one) => `${one.id}: ${one.help}: ${one.nodes[0].html.slice(0, 160)}`).join('\\n'))");
    assert_eq!(found, "", "gallery");
}

#[test]
fn screenshots_have_a_folder() {
    // a misspelt variable would write nowhere
    if let Some(folder) = std::env::var_os(chromium::SCREENSHOTS) {
        assert!(Path::new(&folder).is_dir(), "{folder:?} is no folder");
    }
}

/// Writes the pictures of the book to the folder that `STICKSLIP_SCREENSHOTS` names.
#[test]
#[ignore = "writes pictures"]
fn pictures_of_the_book() {
    let folder = std::env::var_os(chromium::SCREENSHOTS).expect("STICKSLIP_SCREENSHOTS must name a folder");
    let Some((_server, mut browser)) = open(couple()) else { return };
    browser.hide_scrollbars();
    browser.size(1320, 860);
    browser.wait(CURVE);
    browser.wait("document.querySelector('#response-plot').clientHeight < 900");
    browser.evaluate("document.activeElement.blur()");
    browser.picture("explorer");
    browser.size(1320, 730);
    browser.evaluate("document.getElementById('tab-orbit').click()");
    browser.wait("document.querySelector('#orbit-loops')?.data?.length > 0");
    browser.evaluate("const cases = document.getElementById('orbit-case'); cases.value = '3'; cases.dispatchEvent(new Event('change')); [...document.querySelectorAll('button')].find((b) => b.textContent === 'At the peak').click()");
    browser.wait("Math.abs(document.getElementById('orbit-frequency').value - 120.842) < 0.01 && Math.max(...document.querySelector('#orbit-loops').data[0].y) > 7.9");
    browser.picture("explorer_orbit");
    browser.dark(true);
    browser.evaluate("document.getElementById('tab-motion').click()");
    browser.wait("document.querySelector('canvas[aria-label=\"The structure in motion\"]').width > 300");
    browser.picture("explorer_motion");
    browser.dark(false);
    browser.evaluate("document.getElementById('tab-design').click()");
    browser.evaluate("document.getElementById('compute-performance').click()");
    browser.wait_long("document.querySelector('#design-performance').data?.length > 0");
    browser.evaluate("document.getElementById('compute-map').click(); setInterval(() => { if (/Press the button again/.test(document.querySelector('[aria-label=\"Peak over two parameters\"] .hint').textContent)) { document.getElementById('compute-map').click(); } }, 300)");
    browser.wait_long("document.querySelector('#design-map').data?.some((t) => t.type === 'heatmap')");
    browser.evaluate("document.getElementById('design-map').scrollIntoView({ block: 'end' }); scrollBy(0, 70)");
    browser.picture("explorer_design");
    browser.dark(true);
    browser.size(390, 844);
    browser.evaluate("document.getElementById('tab-response').click(); document.getElementById('show-parameters').click(); document.activeElement.blur(); scrollTo(0, 300)");
    browser.picture("explorer_narrow");
    let Some((_server, mut browser)) = open(Start::Template("bladed-ring".into())) else { return };
    browser.hide_scrollbars();
    browser.size(1200, 780);
    browser.wait_long(CURVE);
    browser.evaluate("document.getElementById('tab-design').click()");
    browser.evaluate(
        "document.getElementById('mistuning-disks').value = '12'; document.getElementById('compute-mistuning').click()",
    );
    browser.wait_long("document.querySelector('#design-mistuning').data?.[0]?.x.length === 12 && document.getElementById('compute-mistuning').textContent === 'Compute'");
    browser.evaluate("document.getElementById('design-mistuning').scrollIntoView({ block: 'end' }); scrollBy(0, 60)");
    browser.picture("explorer_mistuning");
    let studies = tempfile::tempdir().unwrap();
    let Some((_server, mut browser)) = open(Start::File(solid::blade(studies.path()))) else { return };
    browser.hide_scrollbars();
    browser.size(1200, 640);
    // a study that takes long asks first
    browser.evaluate("setInterval(() => [...document.querySelectorAll('#panel-response button')].find((b) => b.textContent === 'Compute' && b.offsetParent)?.click(), 300); true");
    browser.wait_long("document.getElementById('trust')?.childElementCount > 0");
    browser.evaluate("document.getElementById('tab-motion').click()");
    browser.wait_long("document.getElementById('solid').offsetHeight > 200");
    browser.evaluate("[...document.querySelectorAll('button')].find((b) => b.textContent === 'Pause')?.click(); const time = document.querySelector('[aria-label=\"Time in the period\"]'); time.value = 0.3; time.dispatchEvent(new Event('input'))");
    browser.picture("explorer_solid");
    let file = fit::rig(studies.path());
    let data = studies.path().join("rig.csv");
    // a transducer that resolves 50 micrometres
    let rounded = |line: &str| match line.split_once(',').and_then(|(x, y)| Some((x, y.parse::<f64>().ok()?))) {
        Some((frequency, amplitude)) => format!("{frequency},{}\n", 50.0 * (amplitude / 50.0).round()),
        None => format!("{line}\n"),
    };
    let rows: String = std::fs::read_to_string(&data).unwrap().lines().map(rounded).collect();
    std::fs::write(&data, rows).unwrap();
    let Some((_server, mut browser)) = open(Start::File(file)) else { return };
    browser.hide_scrollbars();
    browser.size(1100, 760);
    browser.wait_long("document.querySelector('#response-plot')?.data?.some((t) => t.name === 'measured: rig')");
    browser.evaluate("document.getElementById('tab-design').click(); document.getElementById('compute-fit').click()");
    browser.wait_long("document.querySelector('#design-fit').data?.length > 0");
    browser.evaluate("document.getElementById('design-fit').scrollIntoView({ block: 'end' }); scrollBy(0, 60)");
    browser.picture("explorer_fit");
    for name in ["", "_orbit", "_motion", "_design", "_narrow", "_mistuning", "_solid", "_fit"] {
        let file = Path::new(&folder).join(format!("explorer{name}.png"));
        let bytes = std::fs::metadata(&file).unwrap().len();
        assert!(bytes <= 170_000, "{}: {bytes} bytes", file.display());
    }
}
