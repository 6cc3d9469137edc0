//! Study files that must be refused, with location, key and words of the message. No input
//! makes the reader panic.

use miette::{GraphicalReportHandler, GraphicalTheme};
use proptest::prelude::*;
use stickslip_study::{StudyError, read_bytes, read_file, read_study, templates};

const EXAMPLE: &str = include_str!("design_example.toml");

/// Returns the text of the error as a user sees it.
fn rendered(error: &StudyError) -> String {
    let mut text = String::new();
    GraphicalReportHandler::new_themed(GraphicalTheme::none()).render_report(&mut text, error).unwrap();
    text
}

/// The example with `from` replaced by `to` is refused at this line and column, for this key,
/// in these words.
fn check(from: &str, to: &str, (line, column): (usize, usize), key: &str, words: &[&str]) {
    assert!(EXAMPLE.contains(from), "{from}");
    let error = read_study("bad.toml", &EXAMPLE.replacen(from, to, 1), &[]).map(|_| to).unwrap_err();
    let all = format!("{error} — {}", error.help_text().unwrap_or_default());
    assert_eq!((error.line(), error.column()), (Some(line), Some(column)), "{all}");
    assert_eq!(error.key(), Some(key), "{all}");
    for word in words {
        assert!(all.contains(word), "{word}: {all}");
    }
    assert!(error.to_string().starts_with(&format!("bad.toml:{line}:{column}: `{key}`: ")), "{all}");
    assert!(!error.to_string().contains('\n'), "{all}");
    assert!(rendered(&error).contains(&format!("bad.toml:{line}:{column}")), "{}", rendered(&error));
}

#[test]
fn keys() {
    check("stiffness = \"k\"", "stifness = \"k\"", (25, 1), "stifness", &["has no key", "did you mean `stiffness`?"]);
    check("[[joint]]", "[[joints]]", (35, 3), "joints", &["did you mean `joint`?"]);
    check("name = \"shroud\"\n", "", (35, 1), "name", &["`name` is missing in joint 1", "add name ="]);
    check("schema = 1\n", "", (1, 1), "schema", &["`schema` is missing", "add schema = 1"]);
    check(
        "points = 241 }",
        "points = 241, tolerance = 0.1 }",
        (46, 51),
        "points",
        &["`tolerance`", "exclude each other"],
    );
    check("schema = 1", "schema = 2", (1, 10), "schema", &["found 2", "reads schema 1"]);
    check("schema = 1", "schema = 1.0", (1, 10), "schema", &["the number 1"]);
    check("limit = \"Ft\"", "", (38, 7), "limit", &["`limit` is missing in law `coulomb`"]);
    check("\"coulomb\"", "\"columb\"", (38, 16), "kind", &["unknown value `columb`", "did you mean `coulomb`?"]);
    check("\"response\"", "\"responce\"", (45, 8), "kind", &["did you mean `response`?"]);
    check("\"event-driven\"", "\"event\"", (50, 8), "kind", &["did you mean `event-driven`?"]);
    check(
        "kind = \"event-driven\"",
        "kind = \"event-driven\"\nwidth = 1",
        (51, 1),
        "width",
        &["method `event-driven`"],
    );
    check(
        "kind = \"event-driven\"",
        "kind = \"auto\"\nperiod = 2",
        (51, 1),
        "period",
        &[
            "method `auto` has no key `period`",
            "a key of `event-driven`, `transient`, `shooting` or `harmonic-balance`",
        ],
    );
    check("kind = \"response\"\n", "", (44, 1), "kind", &["`kind` is missing in [study]", "`transient`"]);
    check("[[mass]]", "[mass]", (16, 3), "mass", &["appears twice"]);
    check("points = 241", "points = \"many\"", (46, 60), "points", &["a whole number", "found the text \"many\""]);
    check("[study]", "[[study]]", (44, 1), "study", &["expected a table, found a list"]);
    check("[[joint]]", "[joint]", (35, 1), "joint", &["a list of tables", "[[joint]]"]);
}

#[test]
fn quantities() {
    check(
        "stiffness = \"k\"",
        "stiffness = \"10 kg\"",
        (25, 14),
        "stiffness",
        &["expected stiffness (N/m)", "mass (kg)"],
    );
    check("stiffness = \"k\"", "stiffness = \"10 N/\"", (25, 18), "stiffness", &["after `/` a unit is missing"]);
    check("stiffness = \"k\"", "stiffness = \"N\"", (25, 14), "stiffness", &["number before it"]);
    check("stiffness = \"k\"", "stiffness = \"\"", (25, 14), "stiffness", &["empty"]);
    check("stiffness = \"k\"", "stiffness = \"10 Nm\"", (25, 17), "stiffness", &["`N m`"]);
    check(
        "stiffness = \"k\"",
        "stiffness = true",
        (25, 13),
        "stiffness",
        &["expected stiffness (N/m)", "found `true`"],
    );
    check("stiffness = \"k\"", "stiffness = nan", (25, 13), "stiffness", &["finite number"]);
    check("stiffness = \"k\"", "stiffness = -inf", (25, 13), "stiffness", &["finite number"]);
    check("Ft = \"2 N\"", "Ft = \"nan N\"", (11, 7), "Ft", &["finite number", "`nan`"]);
    check("Ft = \"2 N\"", "Ft = \"inf N\"", (11, 7), "Ft", &["finite number"]);
    check("Ft = \"2 N\"", "Ft = \"1e999 N\"", (11, 7), "Ft", &["too large"]);
    check("mass = \"m1\"", "mass = \"-1 g\"", (18, 9), "mass", &["must be zero or more", "-0.001 kg"]);
    check("mass = \"m1\"", "mass = \"m1 - m\"", (18, 9), "mass", &["must be zero or more"]);
    check("limit = \"Ft\"", "limit = \"-1 N\"", (38, 36), "limit", &["must be zero or more, found -1 N"]);
    check("mass = \"m - m1/2\"", "mass = \"m - (m1\"", (15, 13), "mass", &["not closed"]);
    check("mass = \"m - m1/2\"", "mass = \"m - k/2\"", (15, 9), "mass", &["mass (kg) and stiffness (N/m)"]);
    check("mass = \"m - m1/2\"", "mass = \"m - m2/2\"", (15, 13), "mass", &["no parameter `m2`", "did you mean"]);
    check("mass = \"m - m1/2\"", "mass = \"m +\"", (15, 12), "mass", &["a value is missing here"]);
}

#[test]
fn parameters() {
    check("m = \"182 g\"", "m = \"100*m1\"", (6, 5), "m", &["in a cycle: m -> m1 -> m"]);
    check("m1 = \"m / 100\"", "m1 = \"m1\"", (7, 6), "m1", &["m1 -> m1"]);
    check("m1 = \"m / 100\"", "m1 = \"m /\"", (7, 10), "m1", &["missing"]);
    check("m1 = \"m / 100\"", "m1 = \"m / 0\"", (7, 7), "m1", &["divides by zero"]);
    check("b = \"0.2 kg/s\"", "sqrt = 1", (9, 1), "sqrt", &["a reserved word"]);
    check("b = \"0.2 kg/s\"", "b-b = 1", (9, 1), "b-b", &["a letter first"]);
    check("b = \"0.2 kg/s\"", "b = [1]", (9, 5), "b", &["expected a quantity, found a list"]);
    check("vary = { Ft", "vary = { FT", (47, 10), "FT", &["did you mean `Ft`?"]);
    check("\"4 N\"", "\"4 kg\"", (47, 24), "Ft", &["expected force (N), found mass (kg)", "(Ft = 4 kg, case 2 of 4)"]);
    check("[\"2 N\", \"4 N\", \"6 N\", \"8 N\"]", "[]", (47, 15), "Ft", &["empty"]);
    check("\"4 N\"", "\"2*Ft\"", (47, 15), "Ft", &["Ft -> Ft"]);
    check("\"4 N\"", "\"-4 N\"", (38, 36), "limit", &["must be zero or more", "(Ft = -4 N, case 2 of 4)"]);
    check("\"2 N\", \"4 N\"", "\"-2 N\", \"4 N\"", (38, 36), "limit", &["found -2 N (Ft = -2 N, case 1 of 4)"]);
}

#[test]
fn names() {
    check(
        "[\"contact\", \"blade3\"]",
        "[\"contcat\", \"blade3\"]",
        (32, 12),
        "between",
        &["no place", "did you mean `contact`?"],
    );
    check("between = [\"contact\", \"blade3\"]", "between = [\"x\", \"blade3\"]", (32, 12), "between", &["`ground`"]);
    check("between = [\"contact\", \"blade3\"]", "between = [\"contact\"]", (32, 11), "between", &["two names"]);
    check(
        "between = [\"contact\", \"blade3\"]",
        "between = [\"blade3\", \"blade3\"]",
        (32, 11),
        "between",
        &["two different places"],
    );
    check("name = \"blade3\"", "name = \"blade1\"", (20, 8), "name", &["appears twice", "another name"]);
    check("name = \"blade3\"", "name = \"blade 3\"", (20, 8), "name", &["a letter first"]);
    check("name = \"blade3\"", "name = 3", (20, 8), "name", &["a name in quotes"]);
    check("on = \"blade1\"", "on = \"blad1\"", (41, 6), "on", &["did you mean `blade1`?"]);
    check("on = \"blade1\"", "on = \"ground\"", (41, 6), "on", &["has no effect"]);
}

#[test]
fn frequencies() {
    let range = "{ from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241 }";
    check("from = \"119.5 Hz\"", "from = \"123 Hz\"", (46, 38), "to", &["the range is empty", "123 Hz to 122.5 Hz"]);
    check("points = 241", "points = 1", (46, 60), "points", &["from 2 to 100000000"]);
    check("points = 241", "points = 1_000_000_000", (46, 60), "points", &["limit", "100000000 points"]);
    check(
        "points = 241",
        "points = 50_000_000",
        (46, 13),
        "frequency",
        &["4 cases times 50000000", "limit of 1000000 cases and 100000000 points"],
    );
    let as_a_text = "\"119.5 Hz to 122.5 Hz\"";
    check(
        range,
        as_a_text,
        (46, 13),
        "frequency",
        &["one quantity", "{ from = \"119.5 Hz\", to = \"122.5 Hz\", points"],
    );
    check(range, "\"119..122 Hz\"", (46, 13), "frequency", &["looks like a range", "from = \"119\", to = \"122 Hz\""]);
    check(range, "\"-1 Hz\"", (46, 14), "frequency", &["more than zero, found -1 Hz"]);
    check(range, "0", (46, 13), "frequency", &["more than zero"]);
    check(range, "[]", (46, 13), "frequency", &["empty"]);
    check(range, "\"121 1/s\"", (46, 14), "frequency", &["1/s does not say whether it counts radians or cycles"]);
    check(range, "\"121 s^-1\"", (46, 14), "frequency", &["radians or cycles"]);
    check(range, "\"121 N\"", (46, 14), "frequency", &["expected frequency (Hz or rad/s), found force (N)"]);
    check(&format!("frequency = {range}\n"), "", (44, 1), "frequency", &["`frequency` is missing"]);
}

/// Users look for a belt under `velocity`: the message says why there is no such key and what
/// to do.
#[test]
fn a_constant_velocity_is_refused() {
    let belt = "[[motion]]\non = \"belt\"\namplitude = \"1 m\"\nvelocity = \"50 mm/s\"\n[[force]]";
    check("[[force]]", belt, (43, 12), "velocity", &["constant velocity, such as a belt", "transient", "two rows"]);
    // lists of keys do not contain it
    check(
        "[[force]]",
        &belt.replace("velocity", "speed"),
        (43, 1),
        "speed",
        &[
            "the keys of motion 1 are `on`, `amplitude`, `data`, `signal`, `column`, `along`, `phase`, `harmonic`, `engine_order`",
        ],
    );
}

/// A key in the wrong table: the message names the right table.
#[test]
fn a_key_in_another_table() {
    check(
        "[[force]]",
        "[frequency]\nfrom = \"1 Hz\"\n[[force]]",
        (40, 2),
        "frequency",
        &["a key of [study]; the keys of the file are"],
    );
    check(
        "on = \"blade1\"\n",
        "on = \"blade1\"\nstiffness = 3\n",
        (42, 1),
        "stiffness",
        &["a key of [structure] and of [[spring]]"],
    );
    // study kinds have different keys, so another table is not suggested
    check("[study]\n", "[study]\npoints = 3\n", (45, 1), "points", &["the keys of a study of kind `response` are"]);
}

#[test]
fn kinds() {
    let swap = |study: &str| format!("{}{study}", &EXAMPLE[..EXAMPLE.find("[study]").unwrap()]);
    let check = |study: &str, line_column: (usize, usize), key: &str, words: &str| {
        let error = read_study("bad.toml", &swap(study), &[]).unwrap_err();
        let all = format!("{error} — {}", error.help_text().unwrap_or_default());
        assert_eq!(
            (error.line(), error.column(), error.key()),
            (Some(line_column.0), Some(line_column.1), Some(key)),
            "{all}"
        );
        assert!(all.contains(words), "{words}: {all}");
    };
    let head = |kind: &str| format!("[study]\nkind = \"{kind}\"\n");
    let hysteresis = head("hysteresis") + "frequency = 1\n";
    check(&(hysteresis.clone() + "loop = \"shrod\""), (47, 8), "loop", "did you mean `shroud`?");
    check(&(hysteresis.clone() + "loop = [\"shroud\", \"blade1\"]"), (47, 19), "loop", "joint or moved place");
    check(&(hysteresis + "samples = 1"), (47, 11), "samples", "from 8 to");
    let transient = head("transient");
    check(&transient, (44, 1), "duration", "the duration of the motion is missing");
    check(&(transient.clone() + "duration = \"1 s\""), (44, 1), "time_step", "free decay");
    check(&(transient.clone() + "cycles = 10"), (46, 10), "cycles", "`frequency`, which is absent");
    check(&(transient.clone() + "duration = 1e9\nfrequency = 100"), (46, 12), "duration", "the limit is");
    check(&(transient.clone() + "duration = 1\nfrequency = 1\nstart = { blad1 = 1 }"), (48, 11), "start", "`blade1`");
    check(&(transient + "duration = 1\nrun_up = { from = 1, to = 2 }"), (47, 10), "duration", "missing in `run_up`");
}

#[test]
fn templates_and_lists_exclude_each_other() {
    let with = |model: &str| {
        EXAMPLE.replace("[[mass]]\nname = \"blade1\"", &format!("[model]\n{model}\n[[mass]]\nname = \"blade1\""))
    };
    let error = read_study("bad.toml", &with("template = \"element\""), &[]).unwrap_err();
    assert!(error.message().contains("contains the whole model"), "{error}");
    let error = read_study("bad.toml", &with("template = \"elment\""), &[]).unwrap_err();
    assert_eq!(error.help_text(), Some("did you mean `element`?"));
    let study = "[study]\nkind = \"orbit\"\nfrequency = 1\n[model]\ntemplate = \"blade-couple\"\n";
    let bad = format!("schema = 1\n{study}[parameters]\nm1 = \"1 kg\"");
    let error = read_study("bad.toml", &bad, &[]).unwrap_err();
    assert_eq!((error.line(), error.underlined()), (Some(6), Some("\"blade-couple\"")), "{error}");
    assert!(error.message().contains("mass 1"), "{error}");
    let error = read_study("bad.toml", &bad.replace("m1 = \"1 kg\"", "Ft = \"-1 N\""), &[]).unwrap_err();
    assert_eq!((error.line(), error.underlined()), (Some(6), Some("\"blade-couple\"")), "{error}");
    assert!(error.message().contains("joint 1") && error.message().contains("`limit`"), "{error}");
}

/// A refusal by a method in one case only names that case.
#[test]
fn a_refusal_of_one_case_names_it() {
    let text = EXAMPLE.replace("vary = {", "vary = { m1 = [\"2 g\", \"0 g\"],");
    let error = stickslip_study::run::check(&read_study("bad.toml", &text, &[]).unwrap()).unwrap_err();
    assert!(error.message().ends_with("(m1 = 0 g, Ft = 2 N, case 5 of 8)"), "{error}");
    assert_eq!(error.line(), Some(18), "{error}");
}

/// A stiffness with `m Ω² < ε k`, where inertia is lost in double precision, is refused. Such
/// studies took up to minutes.
#[test]
fn excessive_stiffness_is_refused() {
    let omega = 119.5 * std::f64::consts::TAU;
    let most = 0.181_09 * omega * omega / f64::EPSILON;
    let with = |stiffness: f64| read_study("a.toml", &EXAMPLE.replacen("\"k\"", &format!("{stiffness:e}"), 1), &[]);
    assert!(with(0.99 * most).is_ok());
    let error = with(1.01 * most).unwrap_err();
    assert_eq!((error.line(), error.key()), (Some(25), Some("stiffness")), "{error}");
    assert!(error.message().contains("`blade1` cannot move at 119.5 Hz"), "{error}");
    assert!(with(1e28).is_err());
    // in one of two cases, a joint has such a stiffness
    let law = "{ kind = \"jenkins\", limit = \"Ft\", stiffness = \"s\" }";
    let text = EXAMPLE
        .replace("{ kind = \"coulomb\", limit = \"Ft\" }", law)
        .replace("b = \"0.2 kg/s\"", "b = \"0.2 kg/s\"\ns = \"1 N/mm\"")
        .replace("vary = {", "vary = { s = [\"1e9 N/mm\", \"1e20 N/mm\"],");
    let error = read_study("a.toml", &text, &[]).unwrap_err();
    assert_eq!((error.line(), error.key()), (Some(39), Some("law")), "{error}");
    assert!(error.message().contains("(s = 1e20 N/mm, Ft = 2 N, case 5 of 8)"), "{error}");
    // a joint with limit zero holds nothing
    let text = text.replace("Ft = [\"2 N\", \"4 N\", \"6 N\", \"8 N\"]", "Ft = [\"0 N\"]");
    assert!(read_study("a.toml", &text, &[]).is_ok());
}

/// A stiffness that is lost relative to inertia, `ε √(m Ω²/k) > 1e-6`, is refused: rounding
/// took a tenth of the motion of a mass of 1e30 kg.
#[test]
fn negligible_stiffness_is_refused() {
    let omega = 122.5 * std::f64::consts::TAU;
    let least = 0.181_09 * (omega * f64::EPSILON / 1e-6).powi(2);
    let with = |stiffness: f64| read_study("a.toml", &EXAMPLE.replacen("\"k\"", &format!("{stiffness:e}"), 1), &[]);
    assert!(with(1.01 * least).is_ok());
    let error = with(0.99 * least).unwrap_err();
    assert_eq!((error.line(), error.key()), (Some(25), Some("stiffness")), "{error}");
    assert!(error.message().contains("has no effect on `blade1` at 122.5 Hz"), "{error}");
    assert!(with(0.0).is_ok());
}

/// An excitation so slow that no mass has inertia is an error of the frequency; the frequency
/// of the help is accepted.
#[test]
fn frequencies_without_inertia_are_refused() {
    let text = |frequency: &str| {
        format!(
            r#"
schema = 1
[[mass]]
name = "b"
mass = "0.2 kg"
[[spring]]
between = ["b", "ground"]
stiffness = "100 N/mm"
[[force]]
on = "b"
amplitude = "8 N"
[study]
kind = "orbit"
frequency = "{frequency}"
"#
        )
    };
    let error = read_study("a.toml", &text("1e-6 Hz"), &[]).unwrap_err();
    assert_eq!((error.line(), error.key()), (Some(14), Some("frequency")), "{error}");
    // the frequency of the mass alone is √(100 N/mm / 0.2 kg) / 2π
    assert!(error.message().contains("1e-6 Hz") && error.message().contains("112.5"), "{error}");
    assert!(error.help_text().unwrap().starts_with("use a frequency of at least 0.0001 Hz"), "{error:?}");
    assert!(read_study("a.toml", &text("1e-4 Hz"), &[]).is_ok());
}

/// An error of all cases does not name the first one.
#[test]
fn an_error_of_all_cases_names_no_case() {
    let error = read_study("bad.toml", &EXAMPLE.replace("stiffness = \"k\"", "stiffness = \"2 s\""), &[]).unwrap_err();
    assert!(!error.message().contains("case"), "{error}");
    let text = EXAMPLE.replace("[\"2 N\", \"4 N\", \"6 N\", \"8 N\"]", "{ from = \"-2 N\", to = \"2 N\", points = 5 }");
    let error = read_study("bad.toml", &text, &[]).unwrap_err();
    assert!(error.message().ends_with("found -2 N (Ft = -2 N, case 1 of 5)"), "{error}");
}

#[test]
fn several_errors_come_together_in_the_order_of_the_file() {
    let text = EXAMPLE.replace("stiffness = \"k\"", "stiffness = \"2 s\"").replace("\"10 N\"", "\"10 m\"");
    let error = read_study("bad.toml", &text, &[]).unwrap_err();
    let lines: Vec<_> = error.others().iter().map(StudyError::line).collect();
    assert_eq!((error.line(), lines), (Some(25), vec![Some(29), Some(42)]));
}

/// A misspelt required key is not reported as missing too.
#[test]
fn a_misspelt_required_key_is_one_error() {
    check("limit = \"Ft\"", "limt = \"Ft\"", (38, 27), "limt", &["did you mean `limit`?"]);
    let error = read_study("bad.toml", &EXAMPLE.replacen("limit = \"Ft\"", "limt = \"Ft\"", 1), &[]).unwrap_err();
    assert!(error.others().is_empty(), "{error}");
}

#[test]
fn overrides() {
    let check = |name: &str, value: &str, words: &str| {
        let error = read_study("a.toml", EXAMPLE, &[(name.to_owned(), value.to_owned())]).unwrap_err();
        let all = format!("{error} — {}", error.help_text().unwrap_or_default());
        assert!(all.contains(words), "{words}: {all}");
        assert_eq!(error.file_name(), format!("--set {name}"), "{all}");
        rendered(&error);
    };
    check("kT", "2", "did you mean `kt`?");
    check("kt", "2 kg", "expected stiffness (N/m), found mass (kg)");
    check("kt", "2 N/", "missing");
    check("kt", "", "empty");
    check("m", "m1", "cycle");
}

#[test]
fn files_that_are_no_studies() {
    let error = read_bytes("bad.toml", b"schema = 1\ntitle = \"\xff\"\n", &[]).unwrap_err();
    assert_eq!((error.line(), error.column()), (Some(2), Some(10)), "{error}");
    assert!(error.message().contains("not UTF-8") && error.message().contains("0xff"), "{error}");
    rendered(&error);

    let error = read_study("bad.toml", "schema = 1\nthis is not toml\n", &[]).unwrap_err();
    assert_eq!(error.line(), Some(2), "{error}");
    assert!(error.message().contains("not TOML"), "{error}");

    let error = read_study("bad.toml", "", &[]).unwrap_err();
    assert!(error.message().contains("`schema` is missing"), "{error}");

    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let error = read_file(&folder.join("tests/it/design_exmple.toml"), &[]).unwrap_err();
    assert!(error.to_string().contains("there is no such file") && error.line().is_none(), "{error}");
    assert!(error.help_text().unwrap().contains("design_example.toml"));
    let error = read_file(folder, &[]).unwrap_err();
    assert!(error.message().contains("folder"), "{error}");
    rendered(&error);
    assert!(read_file(&folder.join("tests/it/design_example.toml"), &[]).is_ok());
    let error = read_bytes("big.toml", &vec![b' '; 5 * 1024 * 1024], &[]).unwrap_err();
    assert!(error.message().contains("too large"), "{error}");
}

/// Reads a text; if it is refused, formats the error in both forms.
fn survives(text: &str) {
    match read_study("any.toml", text, &[]) {
        Ok(study) => {
            study.to_record();
        }
        Err(error) => {
            let line = error.to_string();
            assert!(!line.is_empty() && !line.contains('\n'), "{line:?}");
            rendered(&error);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_text_makes_the_reader_panic(text in "\\PC{0,200}") {
        survives(&text);
    }

    #[test]
    fn no_toml_like_text_makes_the_reader_panic(
        lines in prop::collection::vec(
            "(\\[{1,2}(mass|study|joint|model|parameters|x)\\]{1,2}|(name|mass|kind|frequency|vary|between|a\\.b|law|repeat) = \
             (\"[a-z0-9 *+/^().µ²-]{0,12}\"|-?[0-9]{1,3}(\\.[0-9])?|true|\\[\"a\", 1\\]|\\{ a = 1 \\}|\\{ i = [0-9]{1,6} \\}|\"a\\{[i+*/0-9-]{0,5}\\}?\"|nan|[0-9é\"]{0,3}))?",
            0..20,
        )
    ) {
        survives(&lines.join("\n"));
        survives(&format!("schema = 1\n{}", lines.join("\n")));
    }

    #[test]
    fn no_expression_makes_the_reader_panic(text in "[mkFt0-9 *+/^().,eNsgHzµ²°·√-]{0,30}") {
        survives(&EXAMPLE.replace("m / 100", &text));
        survives(&EXAMPLE.replacen("10 N", &text, 1));
        survives(&EXAMPLE.replacen("119.5 Hz", &text, 1));
    }

    #[test]
    fn no_mutation_of_a_good_study_makes_the_reader_panic(
        template in 0..templates::TABLE.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0usize..3, "[\\[\\]{}\"'=.,#\n a1é-]{0,4}"), 1..5),
    ) {
        let mut text: Vec<char> = templates::TABLE[template].study.chars().collect();
        for (at, removed, put) in changes {
            let at = at.index(text.len());
            let end = (at + removed).min(text.len());
            text.splice(at..end, put.chars());
        }
        survives(&text.into_iter().collect::<String>());
    }

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
        if let Err(error) = read_bytes("any.toml", &bytes, &[]) {
            rendered(&error);
        }
    }
}

#[test]
fn large_files_are_read_or_refused() {
    // a chain of parameters
    let chain: String = (1..20_000).map(|i| format!("p{i} = \"p{} + 1 g\"\n", i - 1)).collect();
    let text = EXAMPLE.replace("m1 = \"m / 100\"", &format!("p0 = \"1 g\"\n{chain}m1 = \"m / 100\""));
    survives(&text);
    survives(&text.replace("p0 = \"1 g\"", "p0 = \"p19999\""));
    survives(&text.replace("p0 = \"1 g\"", "p0 = \"p19998\""));
    // the maximum number of cases
    survives(
        &EXAMPLE
            .replace("points = 241", "points = 2")
            .replace("[\"2 N\", \"4 N\", \"6 N\", \"8 N\"]", "{ from = \"1 N\", to = \"2 N\", points = 100_000 }"),
    );
    // the maximum number of masses, and more
    for masses in [19_997, 19_998] {
        let more: String = (0..masses).map(|i| format!("[[mass]]\nname = \"x{i}\"\nmass = 1\n")).collect();
        let result = read_study(
            "a.toml",
            &EXAMPLE.replace("[[spring]]\nbetween = [\"blade1\"", &format!("{more}[[spring]]\nbetween = [\"blade1\"")),
            &[],
        );
        assert_eq!(result.is_ok(), masses == 19_997);
    }
    survives(&EXAMPLE.replace("10 N", &"(".repeat(1_000_000)));
    survives(&EXAMPLE.replace("10 N", &"1+".repeat(1_000_000)));
    survives(&"[[mass]]\n".repeat(300_000));
    survives(&format!("{} = 1", "a.".repeat(100_000)));
}

#[test]
fn template_errors_name_user_parameters() {
    let study = |parameters: &str, vary: &str| {
        format!(
            "schema = 1\nmodel = {{ template = \"under-platform-wedge\" }}\n[parameters]\n{parameters}\n[study]\nkind = \"response\"\n\
             frequency = \"120 Hz\"\n{vary}"
        )
    };
    let error = |text: String| read_study("wedge.toml", &text, &[]).unwrap_err();
    let found = error(study("m = \"5 g\"\na1 = \"-30 deg\"\nmu = 0.2", ""));
    let expected = "with m = 5 g, a1 = -30 deg, the value `C*sin(a2)/sin(a1 + a2)` of the template parameter `N1` is \
        wrong: this divides by zero";
    assert_eq!((found.line(), found.file_name(), found.message()), (Some(4), "wedge.toml", expected), "{found}");
    let found = error(study("mu = 0.2", "vary = { a1 = [\"30 deg\", \"-30 deg\"] }"));
    assert!(
        found
            .message()
            .contains("with a1 = -30 deg, the value `C*sin(a2)/sin(a1 + a2)` of the template parameter `N1`"),
        "{found}"
    );
    assert_eq!(found.underlined(), Some("\"-30 deg\""), "{found}");
    let set = [("a1".to_owned(), "-30 deg".to_owned())];
    let found = read_study("wedge.toml", &study("mu = 0.2", ""), &set).unwrap_err();
    assert_eq!(found.file_name(), "--set a1", "{found}");
    // an element of the template: the message names the parameter of its key
    let found = error(study("m = \"-5 g\"\nmu = 0.2\nspeed = \"5000 rpm\"", ""));
    assert!(found.message().starts_with("with this value of `m`, body 1 of the template is invalid"), "{found}");
}

/// An expression of the wrong dimension with one parameter without a unit: the error is at the
/// parameter. With several, it is at the expression and names them.
#[test]
fn parameters_without_a_unit_are_the_place_of_the_error() {
    let error = |parameters: &str, amplitude: &str| {
        let text = format!(
            "schema = 1\n[parameters]\n{parameters}\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\n\
             stiffness = \"1 N/mm\"\ndamping = \"1 N s/m\"\n[[force]]\non = \"m\"\namplitude = \"{amplitude}\"\n[study]\nkind = \"response\"\n\
             frequency = \"5 Hz\"\n"
        );
        read_study("study.toml", &text, &[]).unwrap_err()
    };
    let found = error("a = 2\nm0 = \"1 kg\"", "m0*a");
    assert_eq!((found.line(), found.key(), found.underlined()), (Some(3), Some("a"), Some("2")), "{found}");
    for words in ["`a` has no unit", "`amplitude = m0*a`", "expected force (N), found mass (kg)"] {
        assert!(found.message().contains(words), "{found}");
    }
    let found = error("a = 2\nb = 3\nm0 = \"1 kg\"", "m0*a*b");
    assert_eq!((found.key(), found.underlined()), (Some("amplitude"), Some("m0*a*b")), "{found}");
    assert!(found.help_text().is_some_and(|help| help.contains("`a`, `b` have no unit")), "{found}");
    // radians in excess
    let found = error("e = \"1 mm\"", "10 g*e*frequency^2");
    assert_eq!(found.help_text(), Some("2 radians are too many: divide by `(1 rad)^2`"), "{found}");
}

/// A mass on a spring with a joint, with some lines replaced.
fn oscillator(edits: &[(&str, &str)]) -> String {
    let text = r#"schema = 1
[parameters]
n = "1000 rpm"
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "10 N/mm * (1 + (n/(6000 rpm))^2)"
damping = "2 N s/m"
[[joint]]
name = "j"
between = ["m", "ground"]
law = { kind = "jenkins", stiffness = "2 N/mm", limit = "1 N" }
[[force]]
on = "m"
amplitude = "2 N"
[study]
kind = "response"
frequency = { from = "14 Hz", to = "19 Hz", points = 11 }
"#;
    edits.iter().fold(text.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

/// The oscillator with these edits is refused, for this key, in these words.
fn refused(edits: &[(&str, &str)], key: &str, words: &[&str]) {
    let error = read_study("bad.toml", &oscillator(edits), &[]).map(|_| edits).unwrap_err();
    let all: Vec<&StudyError> = std::iter::once(&error).chain(error.others()).collect();
    let said = all.iter().map(|error| format!("{error} — {}", error.help_text().unwrap_or_default()));
    let said: Vec<String> = said.collect();
    let about = all.iter().zip(&said).filter(|(error, _)| error.key() == Some(key)).map(|(_, text)| text);
    let about: Vec<&String> = about.collect();
    assert!(about.iter().any(|text| words.iter().all(|word| text.contains(word))), "{key}, {words:?}: {said:#?}");
}

#[test]
fn wrong_dimensions_give_advice() {
    let stiffness = "10 N/mm * (1 + (n/(6000 rpm))^2)";
    refused(&[(stiffness, "10 N/mm^2")], "stiffness", &["this is a pressure", "10 N/mm"]);
    refused(&[("limit = \"1 N\"", "limit = \"1 MPa\"")], "limit", &["this is a pressure", "area"]);
    refused(&[("1 kg", "0.05 kg m^2")], "stiffness", &["expected angular stiffness (N m/rad)", "\"500 N m/rad\""]);
    refused(&[(stiffness, "2000 N m/rad")], "stiffness", &["moment of inertia in kg m^2", "N m/rad"]);
    refused(&[("2 N s/m", "0.05 N m s/rad")], "damping", &["dampings in N m s/rad"]);
    refused(&[("amplitude = \"2 N\"", "amplitude = \"10 N m\"")], "amplitude", &["slip limits in N m"]);
    refused(&[("amplitude = \"2 N\"", "amplitude = \"2 g\"")], "amplitude", &["`g` is the gram", "9.80665 m/s^2"]);
}

#[test]
fn the_drive_frequency_is_no_parameter() {
    let amplitude = "amplitude = \"2 N\"";
    for name in ["Omega", "omega", "freq"] {
        let with = format!("amplitude = \"2 N * ({name}/(10 Hz))^2\"");
        refused(&[(amplitude, &with)], "amplitude", &[name, "by the name `frequency`", "kind = \"orbit\"", "vary"]);
    }
}

#[test]
fn a_normal_load_of_a_law_without_one() {
    let law = "limit = \"1 N\"";
    let friction = "mu = 0.3, normal = \"10 N\"";
    refused(&[(law, friction)], "mu", &["`jenkins` takes `stiffness` and `limit`", "0.3 * 10 N", "`friction-contact`"]);
    refused(&[(law, friction)], "normal", &["`jenkins` takes `stiffness` and `limit`", "`friction-contact`"]);
    // a parameter of another law: the message names that law
    refused(&[(law, "limit = \"1 N\", chi = -0.5")], "chi", &["`chi` is a parameter of `iwan`"]);
}

#[test]
fn a_step_in_a_range_becomes_a_number_of_points() {
    let points = "points = 11";
    refused(
        &[(points, "step = \"0.5 Hz\", tolerance = \"1 %\"")],
        "step",
        &["`tolerance`", "remove both keys and write points = 11"],
    );
    refused(&[(points, "step = \"0.5 Hz\"")], "step", &["both ends included: points = 11"]);
    refused(&[(points, "points = 6, increment = \"1 Hz\"")], "increment", &["points = 6"]);
}

#[test]
fn words_within_phrases_are_suggested() {
    for (kind, meant) in
        [("frequency response", "response"), ("nonlinear modes", "modes"), ("hysteresis loop", "hysteresis")]
    {
        let with = format!("kind = \"{kind}\"");
        refused(&[("kind = \"response\"", &with)], "kind", &[&format!("did you mean `{meant}`?")]);
    }
}

/// A bare number next to quantities in another unit is refused: it counts in SI, so 1200 would
/// be 72,000 rpm.
#[test]
fn bare_numbers_among_units_are_refused() {
    let study = "points = 11 }";
    let vary = |values: &str| format!("points = 11 }}\nvary = {{ n = {values} }}");
    for values in ["[\"1100 rpm\", 1200]", "[1200]", "{ from = \"1100 rpm\", to = 1200, points = 3 }"] {
        refused(
            &[(study, &vary(values))],
            "n",
            &["1200 counts as 1200 Hz", "other values of this key are in rpm", "\"1200 rpm\" or \"1200 Hz\""],
        );
    }
    refused(&[("{ from = \"14 Hz\", to = \"19 Hz\", points = 11 }", "[\"840 rpm\", 900]")], "frequency", &["900 Hz"]);
    // also for an override
    let error = read_study("n.toml", &oscillator(&[]), &[("n".to_owned(), "1200".to_owned())]).unwrap_err();
    assert!(error.to_string().contains("1200 counts as 1200 Hz"), "{error}");
    // accepted if both readings agree, and for zero
    for values in ["[\"18 Hz\", 20]", "[\"1100 rpm\", 0]"] {
        let edits = [(study, &*vary(values)), ("n = \"1000 rpm\"", "n = \"17 Hz\"")];
        let edits = if values.contains("rpm") { &edits[..1] } else { &edits[..] };
        assert!(read_study("n.toml", &oscillator(edits), &[]).is_ok(), "{values}");
    }
}

/// The damping ratio ζ of a spring with the mass at its end gives c = 2 ζ sqrt(k m).
#[test]
fn damping_ratio_of_a_spring() {
    let spring = |damping: &str| {
        oscillator(&[("damping = \"2 N s/m\"", damping), ("10 N/mm * (1 + (n/(6000 rpm))^2)", "10 N/mm")])
    };
    let damping = |text: &str| {
        let study = read_study("s.toml", text, &[]).unwrap_or_else(|error| panic!("{error}"));
        study.case(0).unwrap().model.springs.iter().map(|spring| spring.damping).collect::<Vec<f64>>()
    };
    // 2 * 0.02 * sqrt(10,000 N/m * 1 kg)
    for text in ["damping = \"2 %\"", "damping_ratio = \"2 %\"", "damping_ratio = 0.02"] {
        assert!((damping(&spring(text))[0] - 4.0).abs() < 1e-12, "{text}");
    }
    assert_eq!(damping(&spring("damping = 0.02")), [0.02], "a bare number is in kg/s");
    // between 1 kg and 3 kg the mass is 3/4 kg: 2 * 0.02 * sqrt(10,000 * 0.75)
    let between = "[[mass]]\nname = \"b\"\nmass = \"3 kg\"\n[[spring]]\nbetween = [\"m\", \"b\"]\nstiffness = \"10 N/mm\"\ndamping_ratio = \"2 %\"\n[[joint]]";
    let two = spring("damping = \"2 %\"").replacen("[[joint]]", between, 1);
    assert!((damping(&two)[1] - 3.464_101_615_137_754_6).abs() < 1e-12, "{:?}", damping(&two));
    refused(&[("damping =", "damping_ratio = \"1 %\"\ndamping =")], "damping_ratio", &["exclude each other"]);
    let other = [
        ("between = [\"m\", \"ground\"]\nstiffness", "between = [\"x\", \"ground\"]\nstiffness"),
        ("damping = \"2 N s/m\"", "damping = \"2 %\""),
    ];
    refused(&other, "between", &["`x`"]);
    let body = "[[body]]\nname = \"b\"\nmass = \"3 kg\"\ninertia = \"1 kg m^2\"\ndirections = [\"x\", \"z\"]\n\
         [[spring]]\nbetween = [\"b.x\", \"ground\"]\nstiffness = \"10 N/mm\"\ndamping = \"2 %\"\n[[joint]]";
    refused(&[("[[joint]]", body)], "damping_ratio", &["the mass of `b.x` is unknown", "2*zeta*sqrt(k*m)"]);
    let massless = [("1 kg", "0 kg"), ("damping = \"2 N s/m\"", "damping = \"2 %\"")];
    refused(&massless, "damping_ratio", &["no end of this spring has a mass"]);
}

#[test]
fn results_are_no_study() {
    let folder = std::env::temp_dir().join(format!("stickslip-no-study-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("curve.csv"), "frequency_Hz,m_amplitude_m\n1,2\n").unwrap();
    std::fs::write(folder.join("k.mtx"), "%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 1\n").unwrap();
    let said = |name: &str| {
        let error = read_file(&folder.join(name), &[]).unwrap_err();
        format!("{error} — {}", error.help_text().unwrap_or_default())
    };
    assert!(said("curve.csv").contains("a table of numbers; a study file (TOML) is needed"), "{}", said("curve.csv"));
    assert!(said("k.mtx").contains("stickslip inspect"), "{}", said("k.mtx"));
    std::fs::write(folder.join("record.json"), "{}").unwrap();
    assert!(said("curve.csv").contains("stickslip plot"), "{}", said("curve.csv"));
    std::fs::remove_dir_all(&folder).unwrap();
}
