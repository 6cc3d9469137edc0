//! Tests of the gallery: the studies under `studies/gallery/`, their page in the book, their
//! pictures.
//!
//! To write the page and the pictures again at full size (half a minute):
//! `STICKSLIP_UPDATE_BOOK=1 cargo test -p stickslip-report --test it gallery`

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fs;
use std::path::{Path, PathBuf};
use stickslip_report::output::Outputs;
use stickslip_study::dataset::{CellValues, Dataset, Table};
use stickslip_study::run::{Context, run};
use stickslip_study::{Study, read_study};

const UPDATE: &str = "STICKSLIP_UPDATE_BOOK";
const HINT: &str = "is stale; run: STICKSLIP_UPDATE_BOOK=1 cargo test -p stickslip-report --test it gallery";

/// The studies in the order of the page.
const STUDIES: [&str; 35] = [
    "underplatform_damper",
    "best_slip_force",
    "damper_map",
    "slip_limit_map",
    "tip_shroud",
    "worst_of_several",
    "ring_of_blades",
    "mistuned_ring",
    "friction_ring",
    "disk_diameters",
    "disk_shapes",
    "campbell",
    "mistuned_disk",
    "disk_contacts",
    "mistuned_mode",
    "amplification",
    "bolted_joint",
    "friction_rig",
    "blade_sweeps",
    "ring_down_test",
    "lap_joint",
    "ring_down",
    "nonlinear_modes",
    "loops_against_blade",
    "joint_forces",
    "preload",
    "two_harmonics",
    "run_up",
    "isolator",
    "tuned_mass_damper",
    "flutter",
    "inches_and_pounds",
    "smooth_and_exact",
    "contact_mass_exact",
    "contact_mass_balance",
];

/// Number of frequencies of a range in a reduced study.
const FEW: usize = 9;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(name: &str) -> String {
    let path = root().join(format!("studies/gallery/{name}.toml"));
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn study(name: &str, text: &str) -> Study {
    let file = root().join(format!("studies/gallery/{name}.toml"));
    read_study(&file.display().to_string(), text, &[]).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Returns the study with [`FEW`] frequencies in its range.
fn reduced(text: &str) -> String {
    let line = |line: &str| match line.strip_prefix("frequency = {").and_then(|rest| rest.rsplit_once(',')) {
        Some((ends, _)) => format!("frequency = {{{ends}, points = {FEW} }}\n"),
        None => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

fn dataset(name: &str, text: &str) -> Dataset {
    run(&study(name, text), &Context::without_progress(1)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn picture(dataset: &Dataset) -> String {
    let svg = Outputs::select(&["svg"]).unwrap();
    let files: Vec<_> = svg.iter().flat_map(|output| (output.make)(dataset).unwrap()).collect();
    let [file] = &files[..] else { panic!("{}: {} pictures", dataset.name, files.len()) };
    String::from_utf8(file.content.clone()).unwrap()
}

/// Returns the description above the first key of a study, in two parts.
fn words(name: &str, text: &str) -> (String, String) {
    let comment: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("# ")).collect();
    let comment = comment.join(" ");
    let (what, learn) = comment.split_once(" Learn: ").unwrap_or_else(|| panic!("{name}: no line `# Learn: …`"));
    (what.to_owned(), learn.to_owned())
}

fn page() -> String {
    let mut page =
        "<!-- Generated from studies/gallery/ by crates/report/tests/it/gallery.rs; do not edit. -->\n\n# Gallery\n\n\
         I want to start from a similar problem. Together, all studies here run in ten seconds:\n\n\
         ```sh\nstickslip run studies/gallery/*.toml --out gallery\n```\n\n\
         Copy the closest one from `studies/gallery/`, change the numbers, and run it.\n"
            .to_owned();
    for name in STUDIES {
        let text = text(name);
        let (what, learn) = words(name, &text);
        let title = study(name, &text).title().to_owned();
        page += &format!("\n## {title}\n\n{what} {learn}\n\n![{name}.toml](images/gallery/{name}.svg)\n");
    }
    page
}

#[test]
fn every_study_has_its_sentence_and_its_picture() {
    let folder = root().join("docs/src/images/gallery");
    if std::env::var_os(UPDATE).is_some() {
        fs::create_dir_all(&folder).unwrap();
        for name in STUDIES {
            let dataset = dataset(name, &text(name));
            assert!(dataset.failures.is_empty(), "{name}: {:?}", dataset.failures);
            assert!(!dataset.notes.iter().any(|note| is_wrong(name, note)), "{name}: {:?}", dataset.notes);
            fs::write(folder.join(format!("{name}.svg")), picture(&dataset)).unwrap();
        }
        fs::write(root().join("docs/src/gallery.md"), page()).unwrap();
    }
    let names = |folder: &Path, end: &str| -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = entries.map(|file| file.strip_suffix(end).unwrap_or(&file).to_owned()).collect();
        names.sort();
        names
    };
    let mut expected = STUDIES.map(str::to_owned).to_vec();
    expected.sort();
    assert_eq!(names(&root().join("studies/gallery"), ".toml"), expected);
    assert_eq!(names(&folder, ".svg"), expected);
    assert!(fs::read_to_string(root().join("docs/src/gallery.md")).unwrap() == page(), "docs/src/gallery.md {HINT}");
    for name in STUDIES {
        let svg = fs::read_to_string(folder.join(format!("{name}.svg"))).unwrap();
        let title = study(name, &text(name)).title().to_owned();
        assert!(svg.contains(&title), "the picture of {name} {HINT}");
    }
}

/// Returns `true` for an unexpected warning. The flutter study intends its unstable orbits.
fn is_wrong(name: &str, note: &str) -> bool {
    note.starts_with("warning") && !(name == "flutter" && note.contains("unstable"))
}

/// Every study runs at reduced size without failures and warnings, and draws something.
#[test]
fn every_study_runs() {
    for name in STUDIES {
        let few = dataset(name, &reduced(&text(name)));
        assert!(few.failures.is_empty(), "{name}: {:?}", few.failures);
        assert!(few.record.points.keys().all(|status| status == "converged"), "{name}: {:?}", few.record.points);
        // Few points step over resonances, and a warning states the sufficient number.
        let wrong = |note: &String| is_wrong(name, note) && !note.contains("points the steps are no wider");
        assert!(!few.notes.iter().any(wrong), "{name}: {:?}", few.notes);
        assert!(!few.figure.panels.is_empty(), "{name}");
        assert!(picture(&few).contains("<path"), "{name}");
    }
}

fn table<'a>(dataset: &'a Dataset, name: &str) -> &'a Table {
    dataset.tables.iter().find(|table| table.name == name).unwrap_or_else(|| panic!("no table {name}"))
}

fn column<'a>(dataset: &'a Dataset, name: &str, column: &str) -> &'a [f64] {
    table(dataset, name).numbers(column).unwrap_or_else(|| panic!("no column {column}"))
}

fn close(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found} instead of {expected}");
}

/// Masing's rule: each slider of stiffness `kt` dissipates `4 Ft (a - Ft/kt)` per cycle.
#[test]
fn the_bolted_joint_loses_what_its_sliders_lose() {
    let found = dataset("bolted_joint", &text("bolted_joint"));
    let stiffness = 2e6;
    let losses = column(&found, "loops_summary", "dissipation_J");
    assert_eq!(losses.len(), 3);
    for (found, a) in losses.iter().zip([4e-6, 8e-6, 12e-6]) {
        let limits = (1..=10).map(|i| 2.0 * f64::from(i)).filter(|limit| limit / stiffness < a);
        let expected: f64 = limits.map(|limit| 4.0 * limit * (a - limit / stiffness)).sum();
        close(*found, expected, 1e-12);
    }
}

/// One-term harmonic balance of a damper to ground: best limit `π/2 F0`, peak `π F0/kt`.
#[test]
fn the_best_slip_force_is_that_of_the_closed_form() {
    let found = dataset("best_slip_force", &text("best_slip_force"));
    // The closed form has one harmonic, the study all: the difference is 0.2 % here.
    let limits = column(&found, "optimum", "Ft_N");
    let peaks = column(&found, "optimum", "amplitude_m");
    assert_eq!((limits.len(), peaks.len()), (2, 2));
    for ((limit, peak), stiffness) in limits.iter().zip(peaks).zip([1e4, 2e4]) {
        close(*limit, FRAC_PI_2 * 10.0, 5e-3);
        close(*peak, PI * 10.0 / stiffness, 1e-3);
    }
}

/// The optimum slip limit is `π/2 F0` in every row of the map. The lowest cell is therefore one
/// of the two cells next to that value.
#[test]
fn the_map_is_lowest_at_the_closed_form_for_every_stiffness() {
    let found = dataset("damper_map", &text("damper_map"));
    let [limits, stiffnesses, peaks] = ["Ft_N", "kt_N_per_m", "amplitude_m"].map(|name| column(&found, "map", name));
    let rows = 9;
    for row in 0..rows {
        let cells = (row..peaks.len()).step_by(rows);
        let best = cells.min_by(|a, b| peaks[*a].total_cmp(&peaks[*b])).unwrap();
        assert!([15.0, 16.0].contains(&limits[best]), "{} N/m: {} N", stiffnesses[best], limits[best]);
        close(peaks[best], PI * 10.0 / stiffnesses[best], 1e-2);
    }
}

/// The closed form for blades with neighbours under engine order 3 of 12.
///
/// The peak is `π F0/(4 kt sin²(θ/2))` with θ = 90°.
#[test]
fn the_ring_of_blades_has_the_peak_of_the_closed_form() {
    let found = dataset("ring_of_blades", &text("ring_of_blades"));
    let limits = column(&found, "peaks", "Ft_N");
    let at = limits.iter().position(|limit| *limit == 5.6).unwrap();
    // A little viscous damping and higher harmonics lower the peak by 0.5 %.
    close(column(&found, "peaks", "amplitude_m")[at], PI * 5.0 / (4.0 * 1e4 * 0.5), 1e-2);
}

/// The scripts that made the data integrate models with these parameters.
#[test]
fn fits_find_the_parameters_that_made_the_data() {
    let sweeps: &[(&str, f64)] = &[("k", 170e3), ("c", 3.0), ("kt", 50e3), ("Ft", 12.0)];
    let record: &[(&str, f64)] = &[("k", 80e3), ("c", 0.8), ("kt", 20e3), ("Ft", 3.0), ("blow", 0.2)];
    for (study, parameters) in [("blade_sweeps", sweeps), ("ring_down_test", record)] {
        let found = dataset(study, &text(study));
        let (values, errors) = (column(&found, "parameters", "value"), column(&found, "parameters", "standard_error"));
        assert_eq!(values.len(), parameters.len());
        for (k, (name, truth)) in parameters.iter().enumerate() {
            let apart = (values[k] - truth) / errors[k];
            assert!(apart.abs() < 2.5 && errors[k] < 0.25 * truth, "{study}, {name}: {} of {truth}", values[k]);
        }
    }
}

/// While the lap joint sticks, the decay is linear: `ζ = c/(2 √((k + kt) m))`,
/// `f = √((k + kt)/m)/2π`.
#[test]
fn the_ring_down_ends_with_the_viscous_damping() {
    let found = dataset("ring_down", &text("ring_down"));
    let number = |name: &str| column(&found, "decay_summary", name)[0];
    // The turning points lie between samples at a distance of 1/56 period.
    close(number("last_damping_ratio"), 0.8 / (2.0 * (100e3f64 * 2.0).sqrt()), 1e-3);
    close(number("last_frequency_Hz"), (100e3f64 / 2.0).sqrt() / TAU, 1e-4);
    // The value is a one-term describing function at twice the amplitude of first slip. The
    // amplitude falls by a quarter per cycle, which blurs it.
    close(number("largest_damping_ratio"), 20e3 / (PI * 2.0 * 90e3) + 0.8 / (2.0 * (90e3f64 * 2.0).sqrt()), 0.15);
}

/// The describing function of the joint at twice the amplitude of first slip: `k + kt/2`,
/// `ω c = kt/π`.
#[test]
fn the_nonlinear_mode_is_damped_most_near_twice_the_first_slip() {
    let found = dataset("nonlinear_modes", &text("nonlinear_modes"));
    let number = |name: &str| column(&found, "modes_summary", name)[0];
    // The largest ratio is close to twice the first slip, and higher harmonics exist: 1 %.
    let stiffness = 100e3 + 15e3;
    let viscous = 0.2 / (2.0 * (stiffness * 0.2f64).sqrt());
    close(number("largest_damping_ratio"), 30e3 / (PI * 2.0 * stiffness) + viscous, 2e-2);
    close(number("small_end_frequency_Hz"), (130e3f64 / 0.2).sqrt() / TAU, 1e-6);
}

/// A joint that slips in both directions carries no constant force; the spring carries it.
#[test]
fn the_preload_shifts_the_mean_by_force_over_stiffness() {
    let found = dataset("preload", &text("preload"));
    let means = column(&found, "orbits", "seal_mean_m");
    assert!(means[0].abs() < 1e-12);
    close(means[1], 40.0 / 200e3, 1e-9);
}

/// Two methods give the same peaks of the blade on one structure.
#[test]
fn the_contact_mass_has_the_same_peaks_by_both_methods() {
    let [exact, balance] = ["contact_mass_exact", "contact_mass_balance"].map(|name| {
        let found = dataset(name, &text(name));
        let peaks = table(&found, "peaks");
        let column = peaks.columns.iter().find(|column| column.name == "mass").unwrap();
        let CellValues::Text(masses) = &column.values else { panic!("masses have names") };
        let heights = peaks.numbers("amplitude_m").unwrap();
        let of_blade = masses.iter().zip(heights).filter(|(mass, _)| *mass == "blade1");
        // The maximum at the end of the range, at 119 Hz, is not a resonance.
        of_blade.map(|(_, height)| *height).filter(|height| *height > 1e-3).collect::<Vec<f64>>()
    });
    assert_eq!((exact.len(), balance.len()), (3, 3));
    for (exact, balance) in exact.iter().zip(&balance) {
        close(*balance, *exact, 1e-2);
    }
}

/// The pads start to slip when the inertia force of the machine reaches their limit:
/// `m ω² a = Ft`.
#[test]
fn the_isolator_breaks_loose_where_inertia_reaches_the_limit() {
    let found = dataset("isolator", &text("isolator"));
    let [limits, frequencies, slip] =
        ["Ft_N", "frequency_Hz", "pads_slip_fraction"].map(|name| column(&found, "curve", name));
    let mut seen = [0, 0];
    for ((limit, frequency), slip) in limits.iter().zip(frequencies).zip(slip).filter(|row| *row.0.0 > 0.0) {
        let loose = (limit / (400.0 * 0.5e-3)).sqrt() / TAU;
        // Rounding decides the points at the limit.
        if (frequency / loose - 1.0).abs() > 1e-6 {
            assert_eq!(*slip > 0.0, *frequency > loose, "Ft = {limit} N, {frequency} Hz, loose at {loose} Hz");
            seen[usize::from(*frequency > loose)] += 1;
        }
    }
    assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
    // The machine that moves with the floor, by 0.5 mm, has a constant amplitude without a
    // peak.
    let peaks = column(&found, "peaks", "amplitude_m");
    assert!(peaks.len() == 4 && peaks.iter().all(|peak| (peak - 0.5e-3).abs() > 1e-5), "{peaks:?}");
}

/// The flutter branch turns at the same excitation as the one-harmonic curve
/// `F0(A) = A |k + keq - m ω² + j (ω c + ω ceq)|`.
#[test]
fn the_flutter_branch_turns_where_one_harmonic_says() {
    let found = dataset("flutter", &text("flutter"));
    let (k, m, c, kt, limit, omega) = (1e5, 0.2, -0.6, 2e4, 10.0, TAU * 116.0);
    let slip: f64 = limit / kt;
    let force = |a: f64| {
        let angle = (1.0 - 2.0 * slip / a).acos();
        let stiffness = kt / PI * (angle - (2.0 * angle).sin() / 2.0);
        let loss = 4.0 * limit / (PI * a) * (1.0 - slip / a);
        a * (k + stiffness - m * omega * omega).hypot(omega * c + loss)
    };
    let forces: Vec<f64> = (0..2000).map(|i| force(slip * (1.0 + (f64::from(i) + 0.5) * 1e-3))).collect();
    let turns = forces.windows(3).filter(|f| (f[1] - f[0]) * (f[2] - f[1]) < 0.0).map(|f| f[1]);
    let expected: Vec<f64> = turns.collect();
    let found = column(&found, "turns", "F0_N");
    assert_eq!((expected.len(), found.len()), (2, 2));
    for (found, expected) in found.iter().zip(expected) {
        // The joint has higher harmonics, which hardly move the mass.
        close(*found, expected, 5e-3);
    }
}

#[test]
fn figures_say_what_they_show() {
    let titles = |name: &str| -> Vec<String> {
        dataset(name, &reduced(&text(name))).figure.panels.into_iter().map(|panel| panel.title).collect()
    };
    assert_eq!(titles("preload")[0], "displacement, P = 0 N, 80 Hz");
    let ring = titles("mistuned_ring");
    assert_eq!(ring[0], "spread = 0 %, all places are equal");
    assert!(ring[1].starts_with("spread = 2 %, maximum at blade"), "{ring:?}");
    // The refined optimum is a point of its curve.
    let best = dataset("best_slip_force", &text("best_slip_force"));
    for (series, limit) in best.figure.panels[0].series.iter().zip(column(&best, "optimum", "Ft_N")) {
        assert!(series.x.contains(limit) && series.x.is_sorted(), "{limit} {:?}", series.x);
    }
}

/// No joint carries more than its limit.
#[test]
fn the_rivet_carries_its_limit_at_most() {
    let found = dataset("joint_forces", &text("joint_forces"));
    let forces = column(&found, "curve", "rivet_force_amplitude_N");
    let highest = forces.iter().copied().fold(0.0, f64::max);
    close(highest, 12.0, 1e-9);
    assert_eq!(found.figure.panels.len(), 2);
}
