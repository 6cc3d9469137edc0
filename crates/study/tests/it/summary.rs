//! The summary of a study before it is run.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stickslip_study::run::{Context, check, run};
use stickslip_study::summary::{ModelSummary, OrbitCount};
use stickslip_study::{Study, read_study, templates};

fn study(text: &str) -> Study {
    read_study("study.toml", text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Returns the study of a template, edited.
fn template(name: &str, edits: &[(&str, &str)]) -> String {
    edits.iter().fold(templates::find(name).unwrap().study.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from} is not in the template");
        text.replacen(from, to, 1)
    })
}

fn summary(text: &str) -> ModelSummary {
    ModelSummary::new(&study(text)).unwrap()
}

/// The only warning contains all these words.
fn warns(text: &str, words: &[&str]) {
    let warnings = summary(text).warnings;
    assert_eq!(warnings.len(), 1, "{warnings:?}\n{text}");
    assert!(warnings[0].starts_with("warning: "), "{warnings:?}");
    for word in words {
        assert!(warnings[0].contains(word), "`{word}` is not in {warnings:?}");
    }
}

fn silent(text: &str) {
    assert_eq!(summary(text).warnings, Vec::<String>::new(), "{text}");
}

#[test]
fn templates_have_no_warnings() {
    for row in templates::TABLE {
        let mut warnings = summary(row.study).warnings;
        // only friction keeps a friction ring in place
        warnings.retain(|warning| !warning.contains("only friction keeps them in place"));
        assert_eq!(warnings, Vec::<String>::new(), "{}", row.study);
    }
}

#[test]
fn summary_of_the_couple() {
    let text = summary(templates::find("blade-couple").unwrap().study).to_string();
    // free 121.25 Hz (theory 6.1), damping 7.23e-4; strongest stuck force 19.7237 N at 120.9589
    // Hz (6.8): 2 N are 10.1 % of it
    for word in
        ["3 degrees of freedom, 1 joint", "shown for Ft = 2 N", "121.25", "0.072", "rigid until then", "120.9589 Hz"]
    {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert!(
        text.contains("119.5 to 120.2704 Hz, 120.6697 to 122.5 Hz; 0.101 times the excitation makes it slip"),
        "{text}"
    );
    // one of the three masses may have two peaks
    assert!(text.contains("4 cases, 979 rows"), "4 (241 + 1.3 · 3 masses): {text}");
    // a spring in series with the slider: 2 N / 10 kN/m
    let text = summary(templates::find("blade-couple-massless").unwrap().study).to_string();
    assert!(text.contains("slips at 2 N, 200 µm of relative displacement"), "{text}");
    // without degrees of freedom there are no modes
    assert!(!summary(templates::find("element").unwrap().study).to_string().contains("Hz"));
}

/// No force reaches the second joint while the first one, at the place of the force, holds. After
/// its slip it does.
#[test]
fn loads_of_joints_are_those_with_all_joints_stuck() {
    let model = |limit: &str| {
        summary(&format!(
            r#"schema = 1
mass = [{{ name = "a", mass = "1 kg" }}, {{ name = "b", mass = "2 kg" }}]
spring = [{{ between = ["a", "b"], stiffness = "2000 N/m", damping = "1 N s/m" }}]
joint = [
  {{ name = "ja", between = ["a", "ground"], law = {{ kind = "coulomb", limit = "{limit}" }} }},
  {{ name = "jb", between = ["b", "ground"], law = {{ kind = "coulomb", limit = "2 N" }} }},
]
force = [{{ on = "a", amplitude = "6 N" }}]
[study]
kind = "response"
frequency = {{ from = "4 Hz", to = "14 Hz", points = 6 }}
"#
        ))
        .to_string()
    };
    let slips = model("1 N");
    assert!(slips.contains("rigid until then; sticks while the other joints stick\n"), "{slips}");
    let sticks = model("10 N");
    assert!(sticks.contains("sticks, even under a million times the excitation"), "{sticks}");
}

#[test]
fn a_model_without_excitation() {
    warns(&template("blade-couple", &[("F0 = \"10 N\"", "F0 = \"0 N\"")]), &["all forces and motions are zero"]);
    warns(
        &template("blade-couple", &[("amplitude = \"F0\"", "amplitude = \"F0\"\nharmonic = 0")]),
        &["constant in time", "nothing vibrates"],
    );
    let drive = "kind = \"response\"\nfrequency = { from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241 }";
    let decay = |start: &str| {
        let kind = format!("kind = \"transient\"\nduration = \"0.1 s\"\ntime_step = \"1 ms\"\n{start}");
        template("blade-couple", &[("F0 = \"10 N\"", "F0 = \"0 N\""), (drive, &kind)])
    };
    warns(&decay(""), &["nothing vibrates"]);
    silent(&decay("start = { blade1 = \"1 mm\" }"));
    // a zero among several values is a reference
    silent(&template(
        "blade-couple",
        &[("vary = { Ft = [\"2 N\", \"4 N\", \"6 N\", \"8 N\"] }", "vary = { F0 = [\"0 N\", \"5 N\"] }")],
    ));
    // a mode is a free vibration
    let modes = "kind = \"modes\"\namplitude = { from = \"10 um\", to = \"10 cm\" }";
    silent(&template("blade-couple", &[("F0 = \"10 N\"", "F0 = \"0 N\""), (drive, modes)]));
    let constant = ("amplitude = \"F0\"", "amplitude = \"F0\"\nharmonic = 0");
    silent(&template("blade-couple", &[constant, (drive, modes)]));
}

#[test]
fn unconstrained_masses() {
    let edits = [("[[joint]]", "[[mass]]\nname = \"lost\"\nmass = \"1 g\"\n\n[[joint]]")];
    warns(&template("blade-couple", &edits), &["`lost` can move freely"]);
    let ground = [
        ("[[spring]]\nbetween = [\"contact\", \"blade3\"]\nstiffness = \"kt\"\n", ""),
        ("kt = \"10000 N/m\"", "# none"),
    ];
    warns(&template("blade-couple", &ground), &["no spring holds `contact`", "only friction", "its mean position"]);
}

/// The dampers of all sectors have one warning.
#[test]
fn loose_dampers_of_a_disk() {
    let disk = r#"schema = 1
disk = { sectors = 9 }
mass = [{ name = "blade", mass = "1 kg" }, { name = "damper", mass = "0.3 kg" }]
spring = [{ between = ["blade", "ground"], stiffness = "4000 N/m", damping = "2 N s/m" }]
joint = [{ name = "j", between = ["damper", "blade"], law = { kind = "coulomb", limit = "1 N" } }]
force = [{ on = "blade", amplitude = "6 N", engine_order = 2 }]
[study]
kind = "orbit"
frequency = "5 Hz"
"#;
    warns(disk, &["`damper_0`, `damper_1`", "and 3 more: only friction keeps them in place", "their mean position"]);
}

/// A law without force at rest balances no constant force, however small it is.
#[test]
fn smooth_friction_creeps_under_a_constant_force() {
    let block = |law: &str| {
        format!(
            "schema = 1\nmass = [{{ name = \"a\", mass = \"1 kg\" }}]\njoint = [{{ name = \"j\", between = [\"a\", \
             \"ground\"], law = {{ {law} }} }}]\nforce = [{{ on = \"a\", amplitude = \"0.3 N\" }}, {{ on = \"a\", amplitude = \
             \"0.1 N\", harmonic = 0 }}]\n[study]\nkind = \"orbit\"\nfrequency = \"9 Hz\"\n"
        )
    };
    let smooth = summary(&block(r#"kind = "coulomb-tanh", limit = "1 N", velocity = "1 mm/s""#)).warnings;
    assert!(smooth.iter().any(|text| text.contains("`coulomb-tanh` of `j` has no force at rest")), "{smooth:?}");
    let rigid = summary(&block(r#"kind = "coulomb", limit = "1 N""#)).warnings;
    assert!(!rigid.iter().any(|text| text.contains("equilibrium")), "{rigid:?}");
}

/// A block on a contact whose preload pushes it away: there is no warning if a force pushes it
/// back.
#[test]
fn an_unbalanced_preload() {
    let block = |press: &str| {
        format!(
            "schema = 1\n[[mass]]\nname = \"block\"\nmass = \"1 kg\"\ndirections = [\"x\", \"z\"]\n[[joint]]\nname = \"foot\"\n\
             between = [\"block\", \"ground\"]\nlaw = {{ kind = \"friction-contact\", tangential = \"1 N/um\", normal = \"2 N/um\", \
             friction = 0.5, preload = \"10 N\", tangents = 1 }}\n[[force]]\non = \"block.x\"\namplitude = \"1 N\"\n{press}[study]\n\
             kind = \"orbit\"\nfrequency = \"100 Hz\"\n"
        )
    };
    warns(&block(""), &["the preload of `foot`, 10 N in total, pushes `block.x`, `block.z` away", "harmonic = 0"]);
    silent(&block("[[force]]\non = \"block.z\"\namplitude = \"8 N\"\nharmonic = 0\n"));
}

#[test]
fn unused_parameters() {
    let edits = [("F0 = \"10 N\"", "F0 = \"10 N\"\nspare = \"1 N\"\nother = \"2 * spare\"")];
    warns(&template("blade-couple", &edits), &["uses the parameter `spare`, `other`"]);
    let varied = [("F0 = \"10 N\"", "F0 = \"10 N\"\nspare = \"1 N\""), ("vary = { Ft =", "vary = { spare =")];
    warns(
        &template("blade-couple", &varied),
        &["no value of the study uses `spare`", "`vary` only repeats equal cases"],
    );
    // used in another parameter, in an expression of `vary`, in the study
    let used = [
        ("F0 = \"10 N\"", "F0 = \"10 N\"\nhalf = \"1 N\"\nlow = \"119.5 Hz\""),
        ("\"2 N\", \"4 N\"", "\"2 * half\", \"4 N\""),
        ("from = \"119.5 Hz\"", "from = \"low\""),
    ];
    silent(&template("blade-couple", &used));
    // a template uses its parameters, unless its law is replaced
    let short = |law: &str| {
        format!(
            "schema = 1\n[parameters]\nFt = \"3 N\"\n[model]\ntemplate = \"blade-couple\"\n{law}\n[study]\nkind = \"response\"\n\
             frequency = {{ from = \"119 Hz\", to = \"123 Hz\", points = 41 }}\nvary = {{ Ft = [\"1 N\", \"2 N\"] }}\n"
        )
    };
    silent(&short(""));
    warns(&short("law = { kind = \"coulomb\", limit = \"5 N\" }"), &["no value of the study uses `Ft`, so `vary`"]);
}

#[test]
fn a_range_without_a_resonance() {
    let range = |from: &str, to: &str| {
        template(
            "blade-couple",
            &[("from = \"119.5 Hz\", to = \"122.5 Hz\"", &format!("from = \"{from}\", to = \"{to}\""))],
        )
    };
    warns(
        &range("100 Hz", "110 Hz"),
        &["between 100 and 110 Hz", "the nearest one, with all joints free, is at 120.575 Hz"],
    );
    // a resonance may lie between the free frequency of a mode and its stuck one
    silent(&range("120.7 Hz", "120.9 Hz"));
    silent(&range("100 Hz", "121 Hz"));
    // the third harmonic of the excitation meets the resonance
    let third = [
        ("from = \"119.5 Hz\", to = \"122.5 Hz\"", "from = \"40 Hz\", to = \"41 Hz\""),
        ("amplitude = \"F0\"", "amplitude = \"F0\"\nharmonic = 3"),
    ];
    silent(&template("blade-couple", &third));
    // a single frequency is a point, not a range
    silent(&template("blade-couple", &[("{ from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241 }", "\"100 Hz\"")]));
}

/// A cubic spring of `k + 3/4 k3 a²` has its resonance at any frequency, depending on its
/// amplitude.
#[test]
fn a_stiffening_spring_has_its_resonance_at_any_frequency() {
    let oscillator = |joint: &str| {
        format!(
            "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"10 N/mm\"\n\
             damping = \"20 N s/m\"\n{joint}[[force]]\non = \"m\"\namplitude = \"20 N\"\n\
             [study]\nkind = \"response\"\nfrequency = {{ from = \"18 Hz\", to = \"22 Hz\", points = 41 }}\n"
        )
    };
    warns(&oscillator(""), &["the nearest one, with all joints free, is at 15.9155 Hz"]);
    silent(&oscillator(
        "[[joint]]\nname = \"j\"\nbetween = [\"m\", \"ground\"]\nlaw = { kind = \"cubic\", stiffness = \"1e9 N/m^3\" }\n",
    ));
}

/// The narrower resonance of the couple is that of a blade with half of the contact's mass. Its
/// width is b/(2π (m + m1/2)) = 0.174 Hz, which fits 17.2 times into 3 Hz.
#[test]
fn frequencies_further_apart_than_a_resonance_is_wide() {
    let points = |points: &str| template("blade-couple", &[("points = 241", points)]);
    warns(
        &points("points = 9"),
        &["are 0.38 Hz apart", "0.17 Hz wide", "with 19 points the steps are no wider than it"],
    );
    silent(&points("points = 19"));
    silent(&points("tolerance = \"1 %\""));
    // a branch computes its points between the ends as needed
    let branch = [("kind = \"response\"", "kind = \"branch\""), ("points = 241", "points = 2")];
    silent(&template("blade-couple-massless", &branch));
}

#[test]
fn a_case_in_which_the_joints_hold_is_shown() {
    let values = |values: &str| template("blade-couple", &[("\"2 N\", \"4 N\", \"6 N\", \"8 N\"", values)]);
    let text = summary(&values("\"0 N\", \"2 N\", \"4 N\"")).to_string();
    assert!(text.contains("shown for Ft = 2 N") && text.contains("slips at 2 N"), "{text}");
    assert!(summary(&values("\"0 N\"")).to_string().contains("free: no slip limit"));
}

#[test]
fn bare_numbers_as_angles() {
    let phase = |value: &str| {
        template("blade-couple", &[("amplitude = \"F0\"", &format!("amplitude = \"F0\"\nphase = {value}"))])
    };
    // 90 rad are 5156.62 deg
    warns(&phase("90"), &["`phase` of force 1", "means 90 rad", "(5157 deg)", "\"90 deg\""]);
    warns(&phase("\"2 * 45\""), &["90"]);
    for value in ["\"90 deg\"", "\"1.5 rad\"", "\"pi/2\"", "0", "\"pi/2 * 1 rad\""] {
        silent(&phase(value));
    }
}

/// Parameters in trigonometric functions have no unit by their position.
#[test]
fn bare_parameters_as_angles() {
    let wedge = |angle: &str| template("under-platform-wedge", &[("a1 = \"30 deg\"", &format!("a1 = {angle}"))]);
    let said = |angle: &str| summary(&wedge(angle)).warnings.iter().any(|text| text.contains("the bare number"));
    assert!(said("30") && said("45.5"));
    assert!(!said("\"30 deg\"") && !said("\"0.5 rad\"") && !said("0.5") && !said("\"pi/6\""));
    // numbers of blades in sin(pi EO / N)
    silent(&template("bladed-ring", &[]));
}

#[test]
fn a_mode_that_never_slips() {
    let drive = "kind = \"response\"\nfrequency = { from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241 }";
    let modes = |to: &str| {
        let study = format!("kind = \"modes\"\nmode = 2\namplitude = {{ from = \"1 um\", to = \"{to}\" }}");
        template("blade-couple-massless", &[(drive, &study)])
    };
    // both blades move in opposition, each by the amplitude: they slip at 2 N / 10 kN/m = 2 x
    warns(&modes("0.09 mm"), &["no joint slips", "end at 90 µm", "100 µm"]);
    silent(&modes("0.11 mm"));
}

/// Options of [method] that kind `modes` has in its own table have no effect.
#[test]
fn an_option_in_the_wrong_table_is_named() {
    let mode = "kind = \"modes\"\nmode = 2\namplitude = { from = \"1 um\", to = \"10 mm\" }\n";
    let model = "schema = 1\n[model]\ntemplate = \"blade-couple-massless\"\n[study]\n";
    let method = "[method]\nkind = \"harmonic-balance\"\nharmonics = 1\n";
    warns(&format!("{model}{mode}{method}"), &["`harmonics` in [method]", "kind `modes`", "[study]"]);
    silent(&format!("{model}{mode}harmonics = 1\n"));
}

#[test]
fn warnings_stand_in_the_record() {
    let text = template(
        "blade-couple",
        &[("from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241", "from = \"100 Hz\", to = \"110 Hz\", points = 3")],
    );
    let context = Context::without_progress(1);
    let dataset = run(&study(&text), &context).unwrap();
    assert!(dataset.notes[0].starts_with("warning: no resonance"), "{:?}", dataset.notes);
    let record = &dataset.record.study["summary"];
    assert_eq!(record["degrees_of_freedom"], 3);
    let stuck = record["joints_stuck"]["frequencies_Hz"].as_array().unwrap();
    assert!((stuck[0].as_f64().unwrap() - 120.94).abs() < 0.01);
}

#[test]
fn an_optimum_at_the_boundary_gives_a_warning() {
    let text = template(
        "blade-couple",
        &[
            ("kind = \"response\"", "kind = \"performance\""),
            ("points = 241", "points = 9"),
            ("\"2 N\", \"4 N\", \"6 N\", \"8 N\"", "\"2 N\", \"3 N\", \"4 N\""),
        ],
    );
    let context = Context::without_progress(1);
    let notes = run(&study(&text), &context).unwrap().notes;
    assert!(
        notes.iter().any(|note| note.starts_with("warning: the lowest peak is at an end of the values of Ft")),
        "{notes:?}"
    );
}

/// Checks that a study that is too large is refused with its size, and accepted with a larger
/// memory limit.
fn refused(text: &str, key: &str) {
    let study = study(text).with_memory_limit(2_000_000_000);
    let context = Context { finished: Arc::new(|| panic!("nothing is computed")), ..Context::without_progress(1) };
    let error = run(&study, &context).unwrap_err();
    assert!(error.message().contains("GB of memory") && error.message().contains("the limit is 2.0 GB"), "{error}");
    assert!(error.help_text().unwrap().contains(key) && error.line().is_some(), "{error:?}");
    let size = ModelSummary::new(&study).unwrap().size;
    assert!(size.memory < size.memory_all_tables && size.memory_all_tables > 2_000_000_000, "{size:?}");
    // a run that writes its tables continuously is refused at its own size
    let error = check(&study.clone().with_memory_limit(size.memory - 1)).unwrap_err();
    assert!(error.message().contains("B of memory"), "{error}");
    check(&study.with_memory_limit(size.memory)).unwrap();
}

#[test]
fn studies_that_need_too_much_memory_are_refused_in_advance() {
    // a hundred loops of 1e5 samples each: 1e7 rows of five columns
    let loops = template(
        "element",
        &[
            ("frequency = \"1 rad/s\"", "frequency = \"1 rad/s\"\nsamples = 100000"),
            ("[\"1.25 mm\", \"2 mm\", \"2.75 mm\"]", "{ from = \"1.25 mm\", to = \"2 mm\", points = 100 }"),
        ],
    );
    refused(&loops, "samples");
    let summary = ModelSummary::new(&study(&loops)).unwrap();
    assert!((10_000_000..10_010_000).contains(&summary.size.rows), "{:?}", summary.size);
    // displacement and velocity of three masses, also force and contact of the joint: a
    // thousand orbits of 20,000 samples
    let orbits = template(
        "blade-couple",
        &[
            ("kind = \"response\"", "kind = \"orbit\"\nsamples = 20000"),
            ("points = 241", "points = 1000"),
            ("vary = { Ft = [\"2 N\", \"4 N\", \"6 N\", \"8 N\"] }", ""),
        ],
    );
    refused(&orbits, "frequencies");
    // eighty thousand cases of one frequency each
    let cases = template(
        "element",
        &[("[\"1.25 mm\", \"2 mm\", \"2.75 mm\"]", "{ from = \"1.25 mm\", to = \"2 mm\", points = 80000 }")],
    );
    refused(&cases, "vary");
}

/// A point of a branch keeps the coefficients of its motion, not the memory of the equations.
#[test]
fn a_branch_is_counted_by_what_it_keeps() {
    let (name, masses) = (|i: usize| if i == 0 { "ground".to_owned() } else { format!("m{i}") }, 300);
    let one = |i: usize| {
        let (before, name) = (name(i - 1), name(i));
        format!(
            "[[mass]]\nname = \"{name}\"\nmass = \"1 kg\"\n\n\
             [[spring]]\nbetween = [\"{name}\", \"{before}\"]\nstiffness = \"1 MN/m\"\ndamping = \"1 kg/s\"\n\n"
        )
    };
    let chain: String = (1..=masses).map(one).collect();
    let text = format!(
        "schema = 1\n\n{chain}[[joint]]\nname = \"j\"\nbetween = [\"m1\", \"ground\"]\n\
         law = {{ kind = \"jenkins\", stiffness = \"1 MN/m\", limit = \"1 N\" }}\n\n\
         [[force]]\non = \"m1\"\namplitude = \"1 N\"\n\n\
         [study]\nkind = \"branch\"\nsteps = 10\nfrequency = {{ from = \"1 Hz\", to = \"2 Hz\" }}\n"
    );
    let size = ModelSummary::new(&study(&text)).unwrap().size;
    // 16 harmonics of 16 bytes and the start, the measured numbers of each mass, 40 kB of the
    // joint
    let kept = 50.0 * (16.0 * 17.0 * 300.0 + 100.0 * 300.0 + 40.0 * 1024.0);
    assert!((kept..3.0 * kept).contains(&(size.memory as f64)), "{} {kept}", size.memory);
}

#[test]
fn sizes_are_those_of_the_tables() {
    let context = Context::without_progress(1);
    let small = ("points = 241", "points = 7");
    let one = ("vary = { Ft = [\"2 N\", \"4 N\", \"6 N\", \"8 N\"] }", "");
    let drive = "kind = \"response\"\nfrequency = { from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241 }";
    let kinds = [
        template("blade-couple", &[small]),
        template("blade-couple", &[small, ("kind = \"response\"", "kind = \"orbit\""), one]),
        template("blade-couple", &[small, ("kind = \"response\"", "kind = \"hysteresis\""), one]),
        template("blade-couple", &[small, ("kind = \"response\"", "kind = \"performance\"")]),
        template("blade-couple", &[(drive, "kind = \"transient\"\nfrequency = \"121 Hz\"\ncycles = 20")]),
        template(
            "blade-couple",
            &[(
                drive,
                "kind = \"transient\"\nstart = { blade1 = \"1 mm\" }\nduration = \"0.2 s\"\ntime_step = \"0.5 ms\"",
            )],
        ),
        template(
            "blade-couple-massless",
            &[(drive, "kind = \"modes\"\namplitude = { from = \"1 um\", to = \"1 mm\" }")],
        ),
        template("element", &[]),
    ];
    for text in kinds {
        let study = study(&text);
        let estimate = ModelSummary::new(&study).unwrap().size;
        let dataset = run(&study, &context).unwrap();
        let rows: usize = dataset.tables.iter().map(|table| table.rows()).sum();
        let cells: usize = dataset.tables.iter().map(|table| table.rows() * table.columns.len()).sum();
        // columns of switches and multipliers that do not occur are counted
        let kind = study.kind().name;
        assert!(
            rows as u64 <= estimate.rows + 4 && (rows as f64) > 0.9 * estimate.rows as f64,
            "{kind}: {rows} {estimate:?}"
        );
        let share = cells as f64 * 8.0 / estimate.results as f64;
        assert!((0.85..1.1).contains(&share), "{kind}: {share} {cells} {estimate:?}");
    }
}

/// Probes compute a few points in advance. They leave the results of the run unchanged, and a
/// stop ends them.
#[test]
fn probes_do_not_change_a_run() {
    let text = template("blade-couple", &[("points = 241", "points = 31")]);
    let (running, stopped) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(true)));
    let tables = |probed: bool| {
        let checked = check(&study(&text)).unwrap();
        if probed {
            assert!(checked.expected_time(&running).unwrap().to_string().contains("on one thread"));
            assert_eq!(checked.expected_time(&stopped), None);
        }
        // compared as text, because missing values are NaN
        format!("{:?}", checked.run(&Context::without_progress(1)).unwrap().tables)
    };
    assert_eq!(tables(true), tables(false));
}

/// Friction with a constant limit has one orbit. A stop, and friction that falls with velocity,
/// may have several and are named.
#[test]
fn several_orbits_are_announced() {
    let coulomb = r#"law = { kind = "coulomb", limit = "Ft" }"#;
    assert_eq!(summary(&template("blade-couple", &[])).orbits, Some(OrbitCount::One));
    let falling = r#"law = { kind = "stribeck", limit = "Ft", static_limit = "1.5*Ft", velocity = "1 mm/s" }"#;
    let falling = summary(&template("blade-couple", &[(coulomb, falling)]));
    assert_eq!(
        falling.orbits,
        Some(OrbitCount::Several { reasons: "`stribeck` of shroud".to_owned(), reverse_sweep: true })
    );
    assert!(falling.to_string().contains("several may exist at one frequency (`stribeck` of shroud)"), "{falling}");
    let stop = summary(&stop(r#"kind = "gap", gap = "1 mm", stiffness = "1e5 N/m""#, ""));
    assert_eq!(stop.orbits, Some(OrbitCount::Several { reasons: "`gap` of j".to_owned(), reverse_sweep: true }));
}

/// A stop for a mass of 1 kg, with a gap as a bare number, and a figure with references.
fn stop(law: &str, figure: &str) -> String {
    format!(
        r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "1 N/mm"
damping = "5 N s/m"
[[joint]]
name = "j"
between = ["m", "ground"]
law = {{ {law} }}
[[force]]
on = "m"
amplitude = "2 N"
[study]
kind = "response"
frequency = {{ from = "4 Hz", to = "6 Hz", points = 11 }}
{figure}
"#
    )
}

#[test]
fn bare_lengths_that_are_long_are_asked_about() {
    let gap = |gap: &str| stop(&format!("kind = \"gap\", gap = {gap}, stiffness = \"1 N/mm\""), "");
    warns(&gap("0.1"), &["`gap` of joint 1", "means 0.1 m (100 mm)", "\"0.1 mm\""]);
    silent(&gap("1e-4"));
    silent(&gap("\"0.1 m\""));
}

#[test]
fn references_that_no_law_has_are_missed_before_the_run() {
    let references = "[figure]\nreferences = true";
    let text = stop("kind = \"cubic\", stiffness = \"1e6 N/m^3\"", references);
    let warnings = summary(&text).warnings;
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    for (warning, what) in warnings.iter().zip(["free", "stuck"]) {
        let words =
            format!("no reference curve with all joints {what}: the law `cubic` of joint `j` has no slip limit");
        assert!(warning.contains(&words), "{warning}");
    }
    // a run reports it once
    let notes = run(&study(&text), &Context::without_progress(1)).unwrap().notes;
    assert_eq!(notes.iter().filter(|note| note.contains("no reference curve")).count(), 2, "{notes:?}");
    silent(&stop("kind = \"gap\", gap = \"1 mm\", stiffness = \"1 N/mm\"", references));
}

/// Percentiles of draws have no linear reference; a warning says it, and none is computed.
#[test]
fn references_of_draws_are_missed_before_the_run() {
    let sample =
        "[figure]\nreferences = true\n[sample]\ncount = 4\nof = { c = { uniform = [\"1 kg/s\", \"2 kg/s\"] } }\n";
    let law = "kind = \"gap\", gap = \"1 mm\", stiffness = \"1 N/mm\"";
    let text = stop(law, sample).replace("schema = 1", "schema = 1\n[parameters]\nc = \"1 kg/s\"");
    let text = text.replace("damping = \"5 N s/m\"", "damping = \"c\"");
    warns(&text, &["`references` has no effect", "[sample]"]);
    let found = run(&study(&text), &Context::without_progress(1)).unwrap();
    assert!(found.tables.iter().all(|table| table.name != "references"));
    assert_eq!(found.notes.iter().filter(|note| note.contains("`references` has no effect")).count(), 1);
}

/// A mass of 2 kg on 100 N/mm, pressed by `preload` on a face of 300 N/mm, under a constant
/// force.
fn pressed(preload: &str, constant: &str) -> String {
    format!(
        r#"
schema = 1
[[mass]]
name = "foot"
mass = "2 kg"
directions = ["x", "z"]
[[spring]]
between = ["foot.x", "ground"]
stiffness = "50 N/mm"
[[spring]]
between = ["foot.z", "ground"]
stiffness = "100 N/mm"
[[joint]]
name = "face"
between = ["foot", "ground"]
law = {{ kind = "friction-contact", tangential = "200 N/mm", normal = "300 N/mm", friction = 0.3, preload = "{preload}" }}
[[force]]
on = "foot.z"
amplitude = "{constant}"
harmonic = 0
[[force]]
on = "foot.x"
amplitude = "1 N"
[study]
kind = "response"
frequency = ["20 Hz", "21 Hz"]
output = "joint_mean"
"#
    )
}

/// The spring of the structure takes the fraction `k/(k + kn)` of the preload, and the constant
/// force is shared likewise. The mean of a small vibration is the same.
#[test]
fn preload_at_rest() {
    for (preload, constant, left) in [(40.0, 0.0, 10.0), (40.0, 40.0, 40.0), (40.0, 80.0, 70.0), (40.0, -40.0, -20.0)] {
        let text = pressed(&format!("{preload} N"), &format!("{constant} N"));
        let found = summary(&text);
        let normal = found.joints.iter().find(|joint| joint.name == "face.n" || joint.name == "face.z").unwrap();
        assert!(
            (normal.normal_force_at_rest.unwrap() - left).abs() < 1e-9 * preload,
            "{:?} {left}",
            normal.normal_force_at_rest
        );
        let said = found.to_string();
        let words = match left {
            10.0 => {
                "pressed with 10 N in static equilibrium (the structure carries 30 N of its preload of 40 N); a larger"
            }
            40.0 => "pressed with 40 N in static equilibrium; a larger dynamic force opens it",
            70.0 => "pressed with 70 N in static equilibrium, by its preload of 40 N and 30 N of the constant forces",
            _ => "open in static equilibrium, because the structure carries its preload of 40 N",
        };
        assert!(said.contains(words), "{words}: {said}");
        if left > 0.0 {
            let data = run(&study(&text), &Context::without_progress(1)).unwrap();
            let column =
                data.tables[0].columns.iter().find(|c| c.name.starts_with("face_") && c.name.contains("z_force_mean"));
            let column = column.unwrap_or_else(|| panic!("{:?}", data.tables[0].columns.iter().map(|c| &c.name)));
            let mean = column.as_numbers().unwrap()[0];
            assert!((mean.abs() / left - 1.0).abs() < 1e-3, "{mean} {left}");
        }
    }
}

/// A contact with exchanged places opens under the load that should close it, and the damper is
/// free. Held by a spring, the same contact is only open.
#[test]
fn a_contact_with_exchanged_places() {
    let exchanged = r#"
schema = 1
[[mass]]
name = "blade"
mass = "400 g"
directions = ["x", "z"]
[[spring]]
between = ["blade.x", "ground"]
stiffness = "300 N/mm"
damping_ratio = "0.1 %"
[[spring]]
between = ["blade.z", "ground"]
stiffness = "20 kN/mm"
damping_ratio = "0.1 %"
[[mass]]
name = "wedge"
mass = "8 g"
directions = ["x", "z"]
[[spring]]
between = ["wedge.x", "ground"]
stiffness = "30 N/mm"
damping_ratio = "0.1 %"
[[place]]
name = "top"
of = "wedge"
normal = [0, 0, 1]
[[place]]
name = "platform"
of = "blade"
normal = [0, 0, 1]
[[joint]]
name = "face"
between = ["platform", "top"]
law = { kind = "friction-contact", tangential = "30 N/mm", normal = "60 N/mm", friction = 0.3, preload = "20 N" }
[[force]]
on = "wedge.z"
amplitude = "20 N"
harmonic = 0
[[force]]
on = "blade.x"
amplitude = "6 N"
[study]
kind = "response"
frequency = ["145 Hz"]
"#;
    let warned = |text: &str| summary(text).warnings.join("\n");
    let held = exchanged.replace(
        "between = [\"wedge.x\"",
        "between = [\"wedge.z\", \"ground\"]\nstiffness = \"1 N/mm\"\n[[spring]]\nbetween = [\"wedge.x\"",
    );
    let right = exchanged.replace("[\"platform\", \"top\"]", "[\"top\", \"platform\"]");
    assert!(warned(exchanged).contains("exchange the two places"), "{}", warned(exchanged));
    for text in [&held, &right] {
        assert!(!warned(text).contains("exchange"), "{}", warned(text));
    }
    // a rotation that a spring holds does not hold the whole body
    let cylinder = include_str!("../../templates/under-platform-cylinder.toml");
    let turned = cylinder.replace("[\"cylinder1\", \"platform1\"]", "[\"platform1\", \"cylinder1\"]");
    assert_ne!(turned, cylinder);
    assert!(!warned(cylinder).contains("exchange"), "{}", warned(cylinder));
    assert!(warned(&turned).contains("exchange the two places"), "{}", warned(&turned));
}

/// Contacts that are open at rest count as closed in the modes with all joints stuck, as in the
/// reference curve of a figure.
#[test]
fn stuck_contacts_count_as_closed() {
    let hertz = |k: f64| (k / 2.0).sqrt() / std::f64::consts::TAU;
    for preload in ["0 N", "40 N"] {
        let found = summary(&pressed(preload, "0 N"));
        let stuck: Vec<f64> = found.stuck.elastic.iter().map(|mode| mode.omega / std::f64::consts::TAU).collect();
        let expected = [hertz(250e3), hertz(400e3)];
        assert!(stuck.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{stuck:?} {expected:?}");
    }
    let gap = "law = { kind = \"gap\", gap = \"1 mm\", stiffness = \"400 N/m\" }";
    let found = summary(&template("blade-couple", &[("law = { kind = \"coulomb\", limit = \"Ft\" }", gap)]));
    assert_eq!(found.stuck.elastic.len(), found.free.elastic.len());
    assert!(found.stuck.elastic[0].omega > found.free.elastic[0].omega, "{found}");
}

/// Pressed faces without friction slide freely along the face.
#[test]
fn faces_without_friction_are_free() {
    let found = summary(&pressed("40 N", "0 N").replace("friction = 0.3", "friction = 0"));
    assert!(
        found.to_string().contains("face.x         free: no slip limit and no force in static equilibrium"),
        "{found}"
    );
}

/// A light body that only a joint holds has its mode far above the resonance of the blade, whose
/// frequency it hardly changes: steps that are too wide for this resonance are reported.
#[test]
fn steps_too_wide_for_the_blade_of_a_light_damper() {
    let text = "schema = 1\n[[mass]]\nname = \"blade\"\nmass = \"1 kg\"\n[[mass]]\nname = \"damper\"\nmass = \"20 g\"\n\
         [[spring]]\nbetween = [\"blade\", \"ground\"]\nstiffness = \"100 N/mm\"\ndamping_ratio = \"0.3 %\"\n\
         [[joint]]\nname = \"face\"\nbetween = [\"damper\", \"blade\"]\nlaw = { kind = \"jenkins\", stiffness = \"8 N/um\", limit = \"5 N\" }\n\
         [[force]]\non = \"blade\"\namplitude = \"1 N\"\n\
         [study]\nkind = \"response\"\nfrequency = { from = \"40 Hz\", to = \"60 Hz\", points = 11 }\n";
    let warnings = summary(text).warnings.join("\n");
    // 2 x 0.003 x 49.8 Hz
    assert!(warnings.contains("2 Hz apart") && warnings.contains("only 0.3 Hz wide"), "{warnings}");
}

/// A force on the wrong side of a contact is reported with the places to exchange; in the right
/// order there is no warning.
#[test]
fn a_contact_in_the_wrong_direction() {
    let text = |between: &str| {
        format!(
            "schema = 1\n[[mass]]\nname = \"blade\"\nmass = \"1 kg\"\n[[mass]]\nname = \"damper\"\nmass = \"20 g\"\n\
             [[spring]]\nbetween = [\"blade\", \"ground\"]\nstiffness = \"100 N/mm\"\ndamping = \"3 N s/m\"\n\
             [[joint]]\nname = \"face\"\nbetween = {between}\nlaw = {{ kind = \"gap\", gap = \"0 m\", stiffness = \"8 N/um\" }}\n\
             [[force]]\non = \"damper\"\namplitude = \"20 N\"\nharmonic = 0\n[[force]]\non = \"blade\"\namplitude = \"1 N\"\n\
             [study]\nkind = \"orbit\"\nfrequency = \"30 Hz\"\n"
        )
    };
    warns(&text("[\"blade\", \"damper\"]"), &["`face` is open", "exchange the two places of its `between`"]);
    silent(&text("[\"damper\", \"blade\"]"));
    // a force that slides the damper off its face presses it: nothing is exchanged
    let sliding = "schema = 1\n[[mass]]\nname = \"block\"\nmass = \"0.5 kg\"\ndirections = [\"x\", \"z\"]\n\
         [[joint]]\nname = \"floor\"\nbetween = [\"block\", \"ground\"]\n\
         law = { kind = \"friction-contact\", tangential = \"50 N/mm\", normal = \"100 N/mm\", friction = 0.4 }\n\
         [[force]]\non = \"block.z\"\namplitude = \"10 N\"\nharmonic = 0\n[[force]]\non = \"block.x\"\namplitude = \"6 N\"\nharmonic = 0\n\
         [[force]]\non = \"block.x\"\namplitude = \"1 N\"\n[study]\nkind = \"orbit\"\nfrequency = \"20 Hz\"\n";
    let warnings = summary(sliding).warnings.join("\n");
    assert!(!warnings.contains("exchange") && !warnings.contains("preload"), "{warnings}");
    assert!(warnings.contains("push along them with more than friction can carry"), "{warnings}");
}

/// A wedge without a load lies loose between its faces: one warning for all wedges says what is
/// missing.
#[test]
fn wedges_without_load() {
    let edit = ("speed = \"2600 rpm\"", "speed = \"0 rpm\"");
    let alone = ("vary = { speed = [\"2000 rpm\", \"2600 rpm\", \"4000 rpm\", \"8000 rpm\"] }\n", "");
    let words = [
        "warning: `wedge_0.x`",
        "can move freely",
        "`face1_in_0`, `face1_out_0`",
        "and 42 more touch them",
        "they have no preload",
    ];
    warns(&template("under-platform-wedge", &[edit, alone]), &words);
}

#[test]
fn a_tuned_disk_is_warned_of_the_nodal_diameters_that_its_excitation_meets() {
    // with nodal diameter 3 the disk has a mode at 99 Hz free and 101 Hz stuck; with 2 and 4 it
    // has none from 96 to 104 Hz
    let disk = |order: i32, more: &str| {
        format!(
            "schema = 1\nmodel = {{ template = \"bladed-disk\" }}\n[parameters]\nEO = {order}\n[study]\nkind = \"response\"\npeak_of = \"blade\"\n\
             frequency = {{ from = \"96 Hz\", to = \"104 Hz\", points = 9 }}\n{more}"
        )
    };
    for order in [3, -3, 21, 27] {
        warns(&disk(order, ""), &["1 Hz apart", "the resonance at 99.253 Hz", "may miss it"]);
    }
    for order in [2, 4] {
        silent(&disk(order, ""));
    }
    // mistuned blades respond with all nodal diameters
    let mistuned = "[disk]\nsectors = 24\nmistuning = { of = \"kb\", deviation = \"1 %\", seed = 7 }\n";
    warns(&disk(2, mistuned), &["may miss it"]);
}

#[test]
fn rounding_does_not_cause_slip() {
    let first = |amplitude: &str| {
        let text = format!(
            "schema = 1\nmodel = {{ template = \"bladed-disk\" }}\n[parameters]\nEO = 0\nF0 = \"{amplitude}\"\n[study]\nkind = \"response\"\n\
             peak_of = \"blade\"\nfrequency = {{ from = \"96 Hz\", to = \"104 Hz\", points = 801 }}\n"
        );
        let summary = summary(&text);
        assert!(summary.to_json()["joints"][0]["slips_at_excitation_times"].is_null(), "{}", summary.to_json());
        summary.to_string()
    };
    // all blades move alike, so that no shroud is loaded
    let rounding = first("1 N");
    assert!(rounding.contains("sticks, even under a million times the excitation"), "{rounding}");
    let none = first("0 N");
    assert!(none.contains("the excitation does not reach it"), "{none}");
}

/// A mass of 1 kg on 10 N/mm, 2 N s/m, with a joint of this law under a force.
fn rubbing(law: &str, edits: &[(&str, &str)]) -> String {
    let text = format!(
        r#"
schema = 1
[[mass]]
name = "body"
mass = "1 kg"
[[spring]]
between = ["body", "ground"]
stiffness = "10 N/mm"
damping = "2 N s/m"
[[joint]]
name = "foot"
between = ["body", "ground"]
law = {{ {law} }}
[[force]]
on = "body"
amplitude = "1 N"
[study]
kind = "response"
frequency = {{ from = "14 Hz", to = "19 Hz", points = 101 }}
"#
    );
    edits.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

const JENKINS: &str = "kind = \"jenkins\", stiffness = \"2 N/mm\", limit = \"1 N\"";

#[test]
fn resonances_without_damping() {
    let undamped = [("damping = \"2 N s/m\"\n", "")];
    // 15.9155 Hz = sqrt(10,000 N/m / 1 kg)/2 pi
    warns(&rubbing(JENKINS, &undamped), &["only the joints damp the resonance at 15.9155 Hz", "damping_ratio"]);
    silent(&rubbing(JENKINS, &[]));
    // an undamped resonance is harmless outside the range, and if no force drives it
    let range = ("from = \"14 Hz\"", "from = \"17 Hz\"");
    silent(&rubbing(JENKINS, &[undamped[0], range]));
    // bristles have viscous friction while they slip freely: 2 N s/m
    let lugre = "kind = \"lugre\", stiffness = \"2 N/mm\", viscous = \"2 N s/m\", limit = \"1 N\", static_limit = \"1 N\", velocity = \"1 mm/s\"";
    let free = summary(&rubbing(lugre, &undamped));
    assert!((free.free.elastic[0].damping - 0.01).abs() < 1e-12 && free.warnings.is_empty(), "{:?}", free.warnings);
}

/// A damping ratio that is probably percent is valid, with a warning that gives the text for
/// percent.
#[test]
fn large_damping_ratios() {
    let ratio = |text: &str| rubbing(JENKINS, &[("damping = \"2 N s/m\"", &format!("damping_ratio = {text}"))]);
    warns(&ratio("2"), &["`damping_ratio` of spring 1 is 200 %", "write \"2 %\""]);
    warns(&ratio("0.5"), &["is 50 %", "write \"0.5 %\""]);
    silent(&ratio("\"2 %\""));
    silent(&ratio("0.02"));
}

#[test]
fn models_without_mass() {
    let massless = rubbing(JENKINS, &[("mass = \"1 kg\"", "mass = \"0 kg\"")]);
    warns(&massless, &["the mass of `body` is zero", "it has no resonance"]);
}

#[test]
fn implausible_stiffness() {
    let stiff = JENKINS.replace("2 N/mm", "2e9 N/mm");
    warns(&rubbing(&stiff, &[]), &["225", "stiffness of `foot`, 2e12 N/m", "`coulomb`"]);
    let spring = rubbing(
        JENKINS,
        &[("stiffness = \"10 N/mm\"", "stiffness = \"1e13 N/m\""), ("14 Hz", "4 kHz"), ("19 Hz", "600 kHz")],
    );
    let warnings = summary(&spring).warnings;
    assert!(warnings.iter().any(|warning| warning.contains("between `body` and `ground`")), "{warnings:?}");
}

/// Stuck bristles are springs with dampers: (s1 + s2)/(2 sqrt((s0 + k) m)) = 316.6278/(2
/// sqrt(100,002)) at sqrt(100,002)/2 pi = 50.33 Hz.
#[test]
fn stuck_bristles_damp() {
    let law = "kind = \"lugre\", stiffness = \"1e5 N/m\", damping = \"316.2278 N s/m\", viscous = \"0.4 N s/m\", limit = \"1 N\", static_limit = \"1.5 N\", velocity = \"0.001 m/s\"";
    let text = rubbing(
        law,
        &[
            ("stiffness = \"10 N/mm\"\ndamping = \"2 N s/m\"", "stiffness = \"2 N/m\""),
            ("1 N\"\n[study]", "1 mN\"\n[study]"),
        ],
    );
    let found = summary(&text);
    let stuck = found.stuck.elastic[0];
    assert!((stuck.omega / std::f64::consts::TAU - 50.329_7).abs() < 1e-3, "{stuck:?}");
    assert!((stuck.damping - 0.500_628).abs() < 1e-6, "{stuck:?}");
    assert!(found.to_string().contains("50.33 Hz, damping ratio 50 %"), "{found}");
}

/// An Iwan joint of 4 N slips completely at FS (1 + beta)/(KT (beta + (chi+1)/(chi+2))) = 4.105
/// mm, and partly before.
#[test]
fn summary_states_macro_slip_of_iwan() {
    let law = "kind = \"iwan\", stiffness = \"2 N/mm\", limit = \"4 N\", chi = -0.5, beta = 0.3";
    let found = summary(&rubbing(law, &[]));
    let text = found.to_string();
    assert!(text.contains("macro-slip at 4 N, 4.105 mm of relative displacement, micro-slip before"), "{text}");
    // stuck, 1 N against 2 N s/m at sqrt(12,000) rad/s: 4.564 mm, over 4.105 mm
    assert!(text.contains("; macro-slip at 17."), "{text}");
    let mild = summary(&rubbing(law, &[("amplitude = \"1 N\"", "amplitude = \"0.1 N\"")])).to_string();
    assert!(mild.contains("only micro-slip, up to 11.1 % of the slip limit at 17.43"), "{mild}");
    assert!(!text.contains("e-1"), "no rounding is told as a force: {text}");
    let undamped = summary(&rubbing(law, &[("damping = \"2 N s/m\"\n", "")])).to_string();
    assert!(undamped.contains("any excitation makes it slip at its undamped resonance at 17.43455 Hz"), "{undamped}");
}

/// Bouc-Wen has the limit stiffness/(beta + gamma), and both references: free, and the spring
/// of small motion.
#[test]
fn bouc_wen_has_one_limit_and_both_references() {
    let law = "kind = \"bouc-wen\", stiffness = \"15 N/mm\", beta = \"0.6 /mm\", gamma = \"0.2 /mm\", exponent = 1";
    let text = rubbing(
        law,
        &[("points = 101 }", "points = 3 }\n[figure]\nreferences = true"), ("from = \"14 Hz\"", "from = \"15 Hz\"")],
    );
    let found = summary(&text);
    assert!(found.to_string().contains("slips at 18.75 N, 1.25 mm of relative displacement"), "{found}");
    assert!(found.warnings.iter().all(|warning| !warning.contains("slip limit")), "{:?}", found.warnings);
    let data = run(&study(&text), &Context::without_progress(1)).unwrap();
    let table = data.tables.iter().find(|table| table.name == "references").unwrap();
    let column = |name: &str| table.numbers(name).unwrap();
    let linear = |k: f64, f: f64| {
        let omega = std::f64::consts::TAU * f;
        1.0 / (k - omega * omega).hypot(2.0 * omega)
    };
    for (i, f) in column("frequency_Hz").iter().enumerate() {
        assert!((column("body_free_amplitude_m")[i] / linear(10e3, *f) - 1.0).abs() < 1e-9);
        assert!((column("body_stuck_amplitude_m")[i] / linear(25e3, *f) - 1.0).abs() < 1e-9);
    }
}

/// A block with a preload of 20 N carries a constant load of 15 N: its slip limit is 0.3 times the
/// load. On a face of 35 degrees, friction of 0.25 does not hold a block, and its force at rest is
/// unknown.
#[test]
fn slip_limits_are_those_at_rest() {
    let block = |normal: &str, friction: f64, load: &str| {
        let text = format!(
            "schema = 1\n[[mass]]\nname = \"b\"\nmass = \"0.2 kg\"\ndirections = [\"x\", \"z\"]\n[[place]]\nname = \"face\"\n\
             of = \"b\"\nnormal = {normal}\n[[spring]]\nbetween = [\"b.x\", \"ground\"]\nstiffness = \"1 N/mm\"\n\
             damping = \"1 kg/s\"\n[[joint]]\nname = \"foot\"\nbetween = [\"face\", \"ground\"]\nlaw = {{ kind = \"friction-contact\", \
             tangential = \"50 N/mm\", normal = \"50 N/mm\", friction = {friction}, preload = \"20 N\" }}\n{load}[[force]]\n\
             on = \"b.x\"\namplitude = \"0.05 N\"\n[study]\nkind = \"orbit\"\nfrequency = \"5 Hz\"\n"
        );
        ModelSummary::new(&read_study("block.toml", &text, &[]).unwrap()).unwrap()
    };
    let load = "[[force]]\non = \"b.z\"\namplitude = \"15 N\"\nharmonic = 0\n";
    let pressed = block("[0, 0, 1]", 0.3, load);
    let normal = pressed.joints.iter().find_map(|joint| joint.normal_force_at_rest).unwrap();
    assert!((normal - 15.0).abs() < 1e-6, "{normal}");
    let limit = pressed.joints.iter().find(|joint| joint.normal_force.is_none()).unwrap().limit;
    assert!((limit - 4.5).abs() < 1e-6, "{limit}");
    let inclined = block("[\"-sin(35 deg)\", 0, \"cos(35 deg)\"]", 0.25, "");
    assert!(inclined.joints.iter().all(|joint| joint.normal_force_at_rest.is_none()), "{inclined}");
}

/// Friction alone holds a pressed block along its plate. The suggested spring is a tenth of the
/// inertia of 0.2 kg at 10 Hz, `0.1 · 0.2 · (2π · 10)²` = 78.96 N/m.
#[test]
fn directions_that_friction_alone_holds_are_named() {
    let text = r#"schema = 1
[[mass]]
name = "block"
mass = "0.2 kg"
directions = ["x", "z"]
[[joint]]
name = "foot"
between = ["block", "ground"]
law = { kind = "friction-contact", tangential = "1 N/um", normal = "2 N/um", friction = 0.3, preload = "5 N" }
[[force]]
on = "block.x"
amplitude = "1 N"
[study]
kind = "response"
frequency = { from = "5 Hz", to = "10 Hz", points = 3 }
"#;
    let shown = summary(text).to_string();
    let line = shown.lines().find(|line| line.trim_start().starts_with("friction ")).unwrap();
    assert!(line.contains("alone holds `block.x`, so") && line.contains("(78.96 N/m on `block.x`"), "{line}");
}
