//! Maps: the resonance peak over two parameters, its table, its figure and its errors.

use stickslip_study::dataset::{Dataset, Emphasis, Scale, Style};
use stickslip_study::run::{Context, run};
use stickslip_study::{StudyError, read_study};

fn oscillator(study: &str) -> String {
    format!(
        r#"
schema = 1
title = "Map"
[parameters]
F0 = "1 N"
c = "0.1 kg/s"
Ft = "0.5 N"
kt = "0.5 N/m"
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "1 N/m"
damping = "c"
[[joint]]
name = "contact"
between = ["m", "ground"]
law = {{ kind = "jenkins", stiffness = "kt", limit = "Ft" }}
[[force]]
on = "m"
amplitude = "F0"
[study]
{study}
"#
    )
}

fn read(text: &str) -> Result<Dataset, StudyError> {
    run(&read_study("map.toml", text, &[])?, &Context::without_progress(2))
}

fn dataset(study: &str) -> Dataset {
    read(&oscillator(study)).unwrap_or_else(|error| panic!("{study}: {error}"))
}

fn column<'a>(data: &'a Dataset, table: &str, name: &str) -> &'a [f64] {
    let table = data.tables.iter().find(|found| found.name == table).unwrap();
    table.numbers(name).unwrap_or_else(|| panic!("{name}: {:?}", table.columns))
}

const RANGE: &str = "frequency = { from = \"0.1 Hz\", to = \"0.25 Hz\", points = 31 }";

/// A linear oscillator has the peak `F0 / (c √(k/m - (c/2m)²))` (stuck joint: k + kt).
#[test]
fn peaks_of_a_stuck_oscillator_are_the_closed_form() {
    let data = dataset(&format!(
        "kind = \"map\"\n{RANGE}\nover = {{ F0 = {{ from = \"1 mN\", to = \"3 mN\", points = 3 }}, \
         c = {{ from = \"0.05 kg/s\", to = \"0.4 kg/s\", points = 4, scale = \"log\" }} }}"
    ));
    let [force, damping, peak] = ["F0_N", "c_kg_per_s", "amplitude_m"].map(|name| column(&data, "map", name));
    assert_eq!(force, [1e-3, 1e-3, 1e-3, 1e-3, 2e-3, 2e-3, 2e-3, 2e-3, 3e-3, 3e-3, 3e-3, 3e-3]);
    assert_eq!(damping[..4], [0.05, 0.1, 0.2, 0.4]);
    for ((force, damping), peak) in force.iter().zip(damping).zip(peak) {
        let expected = force / (damping * (1.5 - 0.25 * damping * damping).sqrt());
        assert!((peak / expected - 1.0).abs() < 1e-9, "{force} {damping}: {peak} {expected}");
    }
    assert_eq!(data.record.points.get("converged"), Some(&12));
}

/// A cell has the bits of the same case of a performance study, and every combination of `vary`
/// has its own map.
#[test]
fn cells_are_the_peaks_of_performance_curves() {
    let map = dataset(&format!(
        "kind = \"map\"\n{RANGE}\nvary = {{ F0 = [\"1 N\", \"2 N\"] }}\nover = {{ \
         kt = {{ from = \"0.3 N/m\", to = \"0.9 N/m\", points = 3 }}, Ft = {{ from = \"0.2 N\", to = \"1 N\", points = 5 }} }}"
    ));
    let curves = dataset(&format!(
        "kind = \"performance\"\n{RANGE}\nvary = {{ F0 = [\"1 N\", \"2 N\"], \
         kt = [\"0.3 N/m\", \"0.6 N/m\", \"0.9 N/m\"], Ft = {{ from = \"0.2 N\", to = \"1 N\", points = 5 }} }}"
    ));
    for name in ["F0_N", "kt_N_per_m", "Ft_N", "frequency_Hz", "amplitude_m"] {
        let [cells, points] = [column(&map, "map", name), column(&curves, "performance", name)];
        assert_eq!(cells.len(), 30);
        assert_eq!(cells, points, "{name}");
    }
    let figure = map.figure;
    assert_eq!(figure.panels.len(), 2);
    for (panel, force) in figure.panels.iter().zip(["1 N", "2 N"]) {
        assert!(panel.title.starts_with(&format!("F0 = {force}, contours every ")), "{}", panel.title);
        assert_eq!((panel.x.quantity.as_str(), panel.x.range), ("kt", Some([0.3, 0.9])));
        assert_eq!((panel.y.quantity.as_str(), panel.y.range), ("Ft", Some([0.2, 1.0])));
        let of = |style: Style| panel.series.iter().filter(move |series| series.style == style);
        assert_eq!(of(Style::Stripe).map(|row| row.shades.len()).collect::<Vec<_>>(), [3; 5]);
        assert!(of(Style::Solid).count() > 2 && of(Style::Solid).all(|line| line.emphasis == Emphasis::Contour));
        let lowest = of(Style::Stripe).flat_map(|row| row.shades.iter().copied()).fold(f64::INFINITY, f64::min);
        let marks: Vec<_> = of(Style::Marks).collect();
        let [mark] = &marks[..] else { panic!("{} marks", marks.len()) };
        let row = of(Style::Stripe).find(|row| (row.base[0]..=row.y[0]).contains(&mark.y[0])).unwrap();
        assert!(row.shades[row.x.iter().position(|x| *x == mark.x[0]).unwrap()] == lowest);
    }
}

/// A slip limit of 0.5 N does not hold a body without a spring against a constant force of 0.7 N.
/// The figures show the values without a peak.
#[test]
fn figures_show_values_without_a_peak() {
    let loose = |study: &str| {
        let load = "[[force]]\non = \"m\"\namplitude = \"0.7 N\"\nharmonic = 0\n[study]";
        let text = oscillator(study).replace("stiffness = \"1 N/m\"\n", "").replace("\"1 N\"", "\"0.1 N\"");
        read(&text.replace("[study]", load)).unwrap()
    };
    let data = loose(&format!("kind = \"performance\"\n{RANGE}\nvary = {{ Ft = [\"0.5 N\", \"1.5 N\"] }}"));
    let crosses: Vec<_> = data.figure.panels[0].series.iter().filter(|s| s.style == Style::Missing).collect();
    assert_eq!(crosses.len(), 1, "{:?}", data.figure.panels[0].series);
    assert_eq!((crosses[0].label.as_str(), &crosses[0].x[..]), ("1 point without a peak", &[0.5][..]));
    let over = "over = { Ft = { from = \"0.5 N\", to = \"1.5 N\", points = 2 }, \
                kt = { from = \"0.5 N/m\", to = \"0.6 N/m\", points = 2 } }";
    let data = loose(&format!("kind = \"map\"\n{RANGE}\n{over}"));
    assert!(data.figure.panels[0].title.contains("2 empty tiles without a peak"), "{}", data.figure.panels[0].title);
}

/// Cells of a series that is too short for its tolerance have triangles.
#[test]
fn inexact_cells_have_triangles() {
    let method = "[method]\nkind = \"harmonic-balance\"\nharmonics = 3\ntolerance = 1e-9";
    let study = format!(
        "kind = \"map\"\n{RANGE}\nover = {{ Ft = {{ from = \"0.2 N\", to = \"20 N\", points = 2 }}, \
         kt = {{ from = \"0.5 N/m\", to = \"1 N/m\", points = 2 }} }}\n{method}"
    );
    let figure = dataset(&study).figure;
    let marked: Vec<_> = figure.panels[0].series.iter().filter(|series| series.style == Style::Warning).collect();
    let [triangles] = &marked[..] else { panic!("{marked:?}") };
    // the joint of 20 N sticks, and one harmonic is exact
    assert_eq!((&triangles.x[..], &triangles.y[..]), (&[0.2, 0.2][..], &[0.5, 1.0][..]));
    assert_eq!(triangles.label, "points: 2 less exact than requested");
}

/// A range of `vary` may have equal ratios. The peaks are those of the same list.
#[test]
fn varied_ranges_may_be_logarithmic() {
    let performance = |values: &str| dataset(&format!("kind = \"performance\"\n{RANGE}\nvary = {{ c = {values} }}"));
    let range = performance("{ from = \"0.05 kg/s\", to = \"0.2 kg/s\", points = 3, scale = \"log\" }");
    let list = performance("[\"0.05 kg/s\", \"0.1 kg/s\", \"0.2 kg/s\"]");
    for name in ["c_kg_per_s", "amplitude_m"] {
        let (range, list) = (column(&range, "performance", name), column(&list, "performance", name));
        assert!(range.iter().zip(list).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{range:?} {list:?}");
    }
    assert_eq!(range.figure.panels[0].x.scale, Scale::Log);
    assert_eq!(list.figure.panels[0].x.scale, Scale::Linear);
}

/// Tiles fill the panel without gaps; on a logarithmic axis their borders are geometric means.
#[test]
fn tiles_fill_the_panel() {
    let data = dataset(&format!(
        "kind = \"map\"\n{RANGE}\nover = {{ F0 = {{ from = \"1 N\", to = \"2 N\", points = 2 }}, \
         kt = {{ from = \"1 N/m\", to = \"100 N/m\", points = 3, scale = \"log\" }} }}"
    ));
    let panel = &data.figure.panels[0];
    assert_eq!(panel.y.scale, Scale::Log);
    let rows: Vec<_> = panel.series.iter().filter(|series| series.style == Style::Stripe).collect();
    let edges: Vec<f64> = rows.iter().map(|row| row.base[0]).chain([rows[2].y[0]]).collect();
    let expected = [1.0, 10f64.sqrt(), 1000f64.sqrt(), 100.0];
    assert!(edges.iter().zip(expected).all(|(edge, expected)| (edge / expected - 1.0).abs() < 1e-12), "{edges:?}");
}

/// `--set` leaves one value of a parameter. The table has its cells; a note explains the missing
/// figure.
#[test]
fn a_map_of_one_parameter_has_no_figure() {
    let text = oscillator(&format!("kind = \"map\"\n{RANGE}\n{OVER}"));
    let study = read_study("map.toml", &text, &[("Ft".into(), "1 N".into())]).unwrap();
    let data = run(&study, &Context::without_progress(1)).unwrap();
    assert_eq!(column(&data, "map", "kt_N_per_m").len(), 3);
    assert!(data.figure.panels.is_empty());
    assert!(data.notes.iter().any(|note| note.contains("only one value")), "{:?}", data.notes);
}

const OVER: &str = "over = { Ft = { from = \"1 N\", to = \"2 N\", points = 3 }, kt = { from = \"1 N/m\", to = \"2 N/m\", points = 3 } }";

#[test]
fn wrong_ranges_are_reported_at_their_place() {
    let over = |text: &str| format!("kind = \"map\"\n{RANGE}\n{text}");
    for (study, key, message) in [
        (over(""), "over", "missing"),
        (over("over = \"Ft\""), "over", "found the text"),
        (over("over = { Ft = { from = \"1 N\", to = \"2 N\", points = 3 } }"), "over", "found 1 of them"),
        (over(&OVER.replace("kt", "ky")), "ky", "there is no parameter `ky` to map"),
        (
            over(&OVER.replace("{ from = \"1 N/m\", to = \"2 N/m\", points = 3 }", "[\"1 N/m\"]")),
            "kt",
            "expected a range",
        ),
        (over(&format!("{OVER}\nvary = {{ kt = \"1 N/m\" }}")), "kt", "also in `vary`"),
        (over(&OVER.replace("\"2 N/m\"", "\"2 N\"")), "kt", "expected stiffness"),
        (over(&OVER.replace("\"2 N\"", "\"0.5 N\"")), "to", "the range is empty"),
        (over(&OVER.replace("\"1 N\", to", "\"0 N\", scale = \"log\", to")), "from", "begins above zero"),
        (over(&OVER.replace("points = 3 }, kt", "points = 3, scale = \"cubic\" }, kt")), "scale", "`linear` or `log`"),
        (over(OVER).replace("points = 31", "points = 2"), "frequency", "a range of frequencies"),
        (format!("kind = \"performance\"\n{RANGE}\n{OVER}"), "over", "has no key `over`"),
    ] {
        let error = read(&oscillator(&study)).unwrap_err();
        assert_eq!(error.key(), Some(key), "{study}: {error}");
        assert!(error.to_string().contains(message), "{study}: {error}");
        assert!(error.line().is_some(), "{study}: {error}");
    }
    let drawn = oscillator(&over(OVER)) + "[sample]\ncount = 3\nof = { F0 = { uniform = [\"1 N\", \"2 N\"] } }\n";
    let error = read(&drawn).unwrap_err();
    assert!(error.to_string().contains("no random draws"), "{error}");
}

/// The range ends below the resonance of the stuck oscillator, at 0.19 Hz. These cells have the
/// lowest amplitudes, but they are no peaks: a warning names them, and the mark is at another
/// cell.
#[test]
fn an_amplitude_at_the_end_of_the_range_is_no_lowest_peak() {
    let study = "kind = \"map\"\nfrequency = { from = \"0.14 Hz\", to = \"0.17 Hz\", points = 31 }\n\
         over = { F0 = { from = \"0.001 N\", to = \"4 N\", points = 2 }, Ft = { from = \"0.001 N\", to = \"5 N\", points = 3 } }";
    let data = dataset(study);
    let table = data.tables.iter().find(|table| table.name == "map").unwrap();
    let (at_end, height) = (table.flags("at_range_end").unwrap(), table.numbers("amplitude_m").unwrap());
    let cells = |wanted: bool| (0..table.rows()).filter(move |row| at_end[*row] == Some(wanted));
    let lowest = cells(false).min_by(|a, b| height[*a].total_cmp(&height[*b])).unwrap();
    assert!(cells(true).any(|row| height[row] < height[lowest]), "{height:?} {at_end:?}");
    let warned = data.notes.iter().filter(|note| note.contains("at an end of `frequency`")).count();
    assert_eq!(warned, 1, "{:?}", data.notes);
    let marks = data.figure.panels[0].series.iter().find(|series| series.label.contains("lowest")).unwrap();
    let value = |name: &str| table.numbers(name).unwrap()[lowest];
    assert_eq!((marks.x[0], marks.y[0]), (value("F0_N"), value("Ft_N")));
}
