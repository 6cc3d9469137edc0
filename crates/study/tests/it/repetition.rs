//! Repetition: a repeated entry states the same model as the entries written out one by one.

use std::f64::consts::TAU;
use stickslip::model::Model;
use stickslip_study::{StudyError, read_study};

const STUDY: &str = "[study]\nkind = \"response\"\nfrequency = { from = \"110 Hz\", to = \"130 Hz\", points = 11 }\n";

/// A ring of 12 blades with a disk behind them, a joint between neighbours, and a travelling
/// force.
const RING: &str = r#"schema = 1
[parameters]
k = "100 N/mm"

[[mass]]
repeat = { i = 12 }
name = "blade{i}"
mass = "0.2 kg"

[[spring]]
repeat = { i = 12 }
between = ["blade{i}", "ground"]
stiffness = "k*(1 + 0.01*sin(i))"
damping = "0.2 kg/s"

[[joint]]
repeat = { i = 12, wrap = true }
name = "shroud{i}"
between = ["blade{i}", "blade{i+1}"]
law = { kind = "jenkins", stiffness = "10 N/mm", limit = "i * 0.1 N" }

[[force]]
repeat = { i = 12 }
on = "blade{i}"
amplitude = "5 N"
phase = "-3*i*360 deg/12"
"#;

fn model(text: &str) -> Model {
    read_study("ring.toml", text, &[])
        .unwrap_or_else(|error| panic!("{error} {:?}", error.help_text()))
        .case(0)
        .unwrap()
        .model
}

fn error(text: &str) -> StudyError {
    read_study("bad.toml", text, &[]).map(|_| text.to_owned()).unwrap_err()
}

fn written_out() -> String {
    let mut text = "schema = 1\n[parameters]\nk = \"100 N/mm\"\n".to_owned();
    for i in 1..=12 {
        text += &format!("[[mass]]\nname = \"blade{i}\"\nmass = \"0.2 kg\"\n");
        text += &format!(
            "[[spring]]\nbetween = [\"blade{i}\", \"ground\"]\nstiffness = \"k*(1 + 0.01*sin({i}))\"\ndamping = \"0.2 kg/s\"\n"
        );
        let next = if i == 12 { 1 } else { i + 1 };
        text += &format!(
            "[[joint]]\nname = \"shroud{i}\"\nbetween = [\"blade{i}\", \"blade{next}\"]\n\
             law = {{ kind = \"jenkins\", stiffness = \"10 N/mm\", limit = \"{i} * 0.1 N\" }}\n"
        );
        text += &format!("[[force]]\non = \"blade{i}\"\namplitude = \"5 N\"\nphase = \"-3*{i}*360 deg/12\"\n");
    }
    text + STUDY
}

#[test]
fn a_repeated_ring_equals_the_written_one() {
    let ring = RING.to_owned() + STUDY;
    assert!(ring.lines().count() <= 30, "{}", ring.lines().count());
    let model = model(&ring);
    assert_eq!(model, self::model(&written_out()));
    // and by hand
    assert_eq!((model.masses.len(), model.joints.len()), (12, 12));
    assert_eq!(model.joints[11].between, ["blade12", "blade1"]);
    assert!((model.springs[6].stiffness - 1e5 * (1.0 + 0.01 * 7f64.sin())).abs() < 1e-9);
    assert!((model.forces[4].phase + 3.0 * 5.0 / 12.0 * TAU).abs() < 1e-12);
    assert!((model.joints[2].law.values()[1] - 0.3).abs() < 1e-15);
    model.assemble().unwrap();
}

#[test]
fn indices_have_ranges_and_make_grids() {
    let text = r#"schema = 1
[[mass]]
repeat = { i = 3, j = [0, 1] }
name = "m{i}_{j}"
mass = "i + 0.1*j"
[[spring]]
repeat = { i = 3, wrap = "i" }
between = ["m{i}_0", "m{i+1}_0"]
stiffness = 100
[[spring]]
repeat = { j = [0, 0], i = 3 }
between = ["m{i}_{j}", "m{i}_{j+1}"]
stiffness = 10
[[spring]]
between = ["m1_0", "ground"]
stiffness = 1
"#;
    let model = model(&(text.to_owned() + STUDY));
    let masses: Vec<_> = model.masses.iter().map(|m| (m.name.as_str(), m.mass)).collect();
    assert_eq!(masses[..4], [("m1_0", 1.0), ("m1_1", 1.1), ("m2_0", 2.0), ("m2_1", 2.1)]);
    let between: Vec<String> = model.springs.iter().map(|spring| spring.between.join(" ")).collect();
    let expected = ["m1_0 m2_0", "m2_0 m3_0", "m3_0 m1_0", "m1_0 m1_1", "m2_0 m2_1", "m3_0 m3_1", "m1_0 ground"];
    assert_eq!(between, expected);
}

/// Every error names the entry, the index, and the place in the file.
#[test]
fn errors_name_the_entry_and_the_index() {
    let check = |from: &str, to: &str, line: usize, words: &[&str]| {
        assert!(RING.contains(from), "{from}");
        let error = error(&(RING.replacen(from, to, 1) + STUDY));
        let all = format!("{error} {}", error.help_text().unwrap_or_default());
        assert_eq!(error.line(), Some(line), "{all}");
        for word in words {
            assert!(all.contains(word), "{word}: {all}");
        }
    };
    // errors of the model: no wrap
    check(", wrap = true", "", 19, &["no place `blade13`", "(joint 1, i = 12)"]);
    // errors of the values
    check("i * 0.1 N", "(4 - i) * 1 N", 20, &["zero or more, found -1 N", "(joint 1, i = 5)"]);
    check("*(1 + 0.01*sin(i))", "/abs(i - 3)", 13, &["divides by zero", "(spring 1, i = 3)"]);
    // errors of the text
    check("sin(i)", "sin(j)", 13, &["no parameter `j`", "(i = 1)"]);
    check("0.2 kg\"", "0.2 kg\"\nmas = 1", 9, &["mass 1 has no key `mas`", "(i = 1)"]);
    check("\"blade{i}\"", "\"blade{i/2}\"", 7, &["whole number, found 0.5", "(i = 1)"]);
    check("\"blade{i}\"", "\"blade{i\"", 7, &["not closed"]);
    check("\"blade{i}\"", "\"{i}\"", 7, &["`1` is not a valid name"]);
    check("\"blade{i}\"", "\"blade\"", 7, &["appears twice", "(mass 1, i = 2)"]);
    check("repeat = { i = 12 }\nname", "name", 6, &["repeat = { i = 12 }"]);
    // errors of the repetition itself
    check("{ i = 12 }", "{ i = 0 }", 6, &["number of repetitions"]);
    check("{ i = 12 }", "{ i = 1.5 }", 6, &["number of repetitions"]);
    check("{ i = 12 }", "{ i = [3, 2] }", 6, &["number of repetitions"]);
    check("{ i = 12 }", "{ i = 12, k = 2 }", 6, &["`k` is already a parameter"]);
    check("{ i = 12 }", "{ pi = 12 }", 6, &["reserved word"]);
    check("{ i = 12 }", "{ wrap = true }", 6, &["an index is missing in mass 1"]);
    check("{ i = 12 }", "{ i = 12, wrap = \"j\" }", 6, &["no index `j`"]);
    check("{ i = 12 }", "12", 6, &["expected a table of indices in mass 1, found the number 12"]);
    check("{ i = 12 }", "{ i = 20001 }", 5, &["20001 elements", "20000"]);
    check("{ i = 12 }", "{ i = 1000000, j = 1000000 }", 5, &["the limit is 20000"]);
    check("{ i = 12 }", "{ i = 9999999999 }", 6, &["number of repetitions"]);
}

/// An error in every element of a repeated entry is reported once.
#[test]
fn one_mistake_is_one_error() {
    let error = error(&(RING.replacen("k*(1", "3 kg*(1", 1).replacen("5 N", "5 m", 1) + STUDY));
    let lines: Vec<_> = error.others().iter().map(StudyError::line).collect();
    assert_eq!((error.line(), lines), (Some(13), vec![Some(25)]), "{error}");
    assert!(error.message().ends_with("found mass (kg) (spring 1, i = 1)"), "{error}");
}

/// `--set` and `vary` apply to repeated entries, too.
#[test]
fn parameters_reach_every_repeated_entry() {
    let text = RING.to_owned() + STUDY + "vary = { k = [\"1 N/mm\", \"2 N/mm\"] }\n";
    let study = read_study("ring.toml", &text, &[]).unwrap();
    let last = |index: usize| study.case(index).unwrap().model.springs[11].stiffness;
    assert!((last(1) / last(0) - 2.0).abs() < 1e-15);
}

/// A ring of four thousand blades that move together: no joint is loaded, and each blade is
/// an independent oscillator.
#[test]
fn four_thousand_blades() {
    let text = r#"
schema = 1
title = "Ring of many blades"
[[mass]]
repeat = { i = 4000 }
name = "blade{i}"
mass = "0.2 kg"
[[spring]]
repeat = { i = 4000 }
between = ["blade{i}", "ground"]
stiffness = "100 N/mm"
damping = "0.4 N s/m"
[[joint]]
repeat = { i = 4000, wrap = true }
name = "shroud{i}"
between = ["blade{i}", "blade{i+1}"]
law = { kind = "jenkins", stiffness = "2 N/mm", limit = "1 N" }
[[force]]
repeat = { i = 4000 }
on = "blade{i}"
amplitude = "1 N"
[study]
kind = "response"
frequency = { from = "111 Hz", to = "112 Hz", points = 2 }
peaks = false
[method]
kind = "harmonic-balance"
harmonics = 1
"#;
    let study = read_study("ring.toml", text, &[]).unwrap();
    let checked = stickslip_study::run::check(&study).unwrap();
    let dataset = checked.run(&stickslip_study::run::Context::without_progress(1)).unwrap();
    for name in ["blade1_amplitude_m", "blade3777_amplitude_m"] {
        let amplitudes = dataset.tables[0].numbers(name).unwrap();
        for (hertz, amplitude) in [111.0, 112.0].into_iter().zip(amplitudes) {
            let omega: f64 = TAU * hertz;
            let expected = 1.0 / (1e5 - 0.2 * omega * omega).hypot(0.4 * omega);
            assert!((amplitude / expected - 1.0).abs() < 1e-9, "{name}: {amplitude} {expected}");
        }
    }
    // methods with full matrices refuse it at once, for any memory limit
    let exact = text.replace("kind = \"harmonic-balance\"\nharmonics = 1", "kind = \"event-driven\"");
    let study = read_study("ring.toml", &exact, &[]).unwrap().with_memory_limit(u64::MAX);
    let error = stickslip_study::run::check(&study).unwrap_err().to_string();
    assert!(error.contains("full matrices and takes at most 2000 degrees of freedom"), "{error}");
}
