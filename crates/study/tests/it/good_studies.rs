//! Study files that must be read, and their contents.

use serde_json::Value as Json;
use std::f64::consts::TAU;
use stickslip::model::example;
use stickslip::{law, method};
use stickslip_study::expression::quantity;
use stickslip_study::{Study, book, kinds, read_study, schema, templates};

const EXAMPLE: &str = include_str!("design_example.toml");

fn read(text: &str) -> Study {
    read_study("example.toml", text, &[]).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

fn set(name: &str, value: &str) -> Vec<(String, String)> {
    vec![(name.to_owned(), value.to_owned())]
}

/// The couples of the library are built by calls, those of the templates by text.
#[test]
fn the_blade_couples_are_those_of_the_library() {
    let model = |name: &str| templates::find(name).unwrap().model().assemble().unwrap();
    assert_eq!(model("blade-couple"), example::blade_couple().assemble().unwrap());
    assert_eq!(model("blade-couple-massless"), example::blade_couple_massless().assemble().unwrap());
}

#[test]
fn a_template_named_in_the_file_is_its_model_with_its_defaults() {
    for template in templates::TABLE {
        let text = format!(
            "schema = 1\nmodel = {{ template = \"{}\" }}\n[study]\nkind = \"orbit\"\nfrequency = 1\n",
            template.name
        );
        let case = read(&text).case(0).unwrap();
        assert_eq!(case.model, template.model(), "{}", template.name);
        let parameters = template.parameters();
        assert_eq!(parameters.len(), case.parameters.len(), "{}", template.name);
        for parameter in &parameters {
            let (value, dimension) = case.parameters[&parameter.key];
            // counts such as the number of blades are bare numbers
            let dimension = dimension.unwrap_or(stickslip::dimension::Dimension::NONE);
            assert_eq!((value, dimension), (parameter.value, parameter.dimension), "{}", parameter.key);
        }
        let first = &parameters[0];
        assert_eq!(quantity(&first.default, first.dimension), Ok(first.value));
        // the file itself, without `vary`, which replaces a parameter in every case
        let text: String =
            template.study.lines().filter(|line| !line.starts_with("vary")).map(|line| format!("{line}\n")).collect();
        assert_eq!(read(&text).case(0).unwrap().model, case.model, "{}", template.name);
        read(template.study);
    }
}

#[test]
fn a_template_takes_parameters_a_law_vary_and_set() {
    let text = "
schema = 1
[parameters]
m = 0.2                 # bare: kilograms, as the template says
alpha = \"25 s/mm\"
[model]
template = \"blade-couple\"
law = { kind = \"coulomb-arctan\", limit = \"Ft\", alpha = \"alpha\" }
[study]
kind = \"orbit\"
frequency = \"121 Hz\"
vary = { Ft = { from = \"2 N\", to = \"4 N\", points = 3 } }
";
    let study = read_study("a.toml", text, &set("m1", "m/50")).unwrap();
    let case = study.case(1).unwrap();
    assert_eq!(case.model.joints[0].law.values(), [3.0, 25_000.0]);
    assert_eq!(case.model.masses[1].mass, 0.2 / 50.0);
    assert_eq!(case.label(), "Ft = 3 N");
    assert_eq!(study.cases(), 3);
    // a replaced law does not need valid values
    let study = read_study("a.toml", &text.replace("limit = \"Ft\"", "limit = \"1 N\""), &set("Ft", "-1 N")).unwrap();
    assert_eq!(study.case(0).unwrap().model.joints[0].law.force_scale(), 1.0);
}

#[test]
fn the_example_of_the_design_reads() {
    let study = read(EXAMPLE);
    assert_eq!((study.cases(), study.points(), study.kind().name), (4, 964, "response"));
    assert_eq!(study.title(), "Response curves of the blade couple, m1 = m/100");
    assert_eq!(study.source(), Some("Pust, Pesek, Radolfova (2015), Fig. 6"));
    let case = study.case(2).unwrap();
    assert_eq!(
        (case.varied[0].name.as_str(), case.varied[0].si, case.varied[0].text.as_str()),
        ("Ft", 6.0, "Ft = 6 N")
    );
    assert_eq!(case.method.name, "event-driven");
    assert_eq!(case.values.flag("peaks"), Some(true));
    let frequencies = case.frequencies.unwrap();
    assert_eq!((frequencies.len(), frequencies.get(0)), (241, Some(119.5 * TAU)));
    assert!(study.case(4).is_err());
    let resolved = study.to_record();
    assert_eq!(resolved["cases"][3]["parameters"]["Ft"]["si"], 8.0);
    assert_eq!(resolved["file"], EXAMPLE);
}

#[test]
fn bare_numbers_take_the_unit_of_their_place_also_through_parameters() {
    let text = EXAMPLE.replace("\"182 g\"", "0.182").replace("Ft = \"2 N\"\n", "Ft = 2\nf = 121\n").replace(
        "{ from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241 }",
        "[\"f\", 122, \"f + 2 Hz\", \"121.5 Hz\", \"760 rad/s\"]",
    );
    let case = read(&text).case(0).unwrap();
    assert_eq!(case.model.masses[0].mass, 0.182 - 0.182 / 100.0 / 2.0);
    let frequencies: Vec<f64> = case.frequencies.unwrap().iter().collect();
    assert_eq!(frequencies, [121.0 * TAU, 122.0 * TAU, 121.0 * TAU + 2.0 * TAU, 121.5 * TAU, 760.0]);
}

#[test]
fn cases_are_the_outer_product_the_first_parameter_slowest() {
    let text = EXAMPLE.replace("vary = { Ft = [", "vary = { kt = [5000, \"m * 1e5 s^-2\"], Ft = [");
    let study = read(&text);
    let labels: Vec<String> = (0..study.cases()).map(|i| study.case(i).unwrap().label()).collect();
    assert_eq!(labels[0], "kt = 5000 N/m, Ft = 2 N");
    assert_eq!(labels[1], "kt = 5000 N/m, Ft = 4 N");
    assert_eq!(labels[4], "kt = 18200 N/m, Ft = 2 N");
    assert_eq!(labels.len(), 8);
    assert_eq!(study.varied(), ["kt", "Ft"]);
}

#[test]
fn set_replaces_a_parameter_and_everything_that_follows_from_it() {
    let study = read_study("a/b/fig06.toml", EXAMPLE, &set("m", "100 g")).unwrap();
    assert_eq!(study.name(), "fig06");
    assert_eq!(study.case(0).unwrap().model.masses[1].mass, 0.001);
    let study = read_study("fig06.toml", EXAMPLE, &set("kt", "1")).unwrap();
    assert_eq!(study.case(0).unwrap().model.springs[2].stiffness, 1.0);
}

#[test]
fn transient_keys_are_read() {
    let study_table = "[study]\nkind = \"transient\"\nrun_up = { from = \"110 Hz\", to = \"130 Hz\", duration = \"10 s\" }\n\
                       start = { blade1 = \"1 mm\" }\n";
    let text = format!("{}{study_table}", &EXAMPLE[..EXAMPLE.find("[study]").unwrap()]);
    let case = read(&text).case(0).unwrap();
    assert_eq!(case.values.by_name("start").unwrap()["blade1"], 0.001);
    assert_eq!(case.values.table("run_up").unwrap().quantity("duration"), Some(10.0));
    assert_eq!(case.values.count("samples_per_cycle"), Some(64));
    assert!(case.frequencies.is_none());
}

#[test]
fn the_method_can_be_changed() {
    // options are tried on all methods that have some, because the table grows
    for row in method::TABLE {
        let mut table = format!("kind = \"{}\"\n", row.name);
        for option in row.options {
            table.push_str(&format!("{} = 3\n", option.key));
        }
        let study = read(&EXAMPLE.replace("kind = \"event-driven\"", &table));
        let chosen = study.case(0).unwrap().method;
        assert_eq!((chosen.name.as_str(), chosen.options.len()), (row.name, row.options.len()));
        assert_eq!(study.clone().with_method(row.name).unwrap().case(0).unwrap().method, chosen);
        let other = if row.name == "auto" { "event-driven" } else { "auto" };
        let changed = study.with_method(other).unwrap().case(0).unwrap().method;
        assert_eq!((changed.name.as_str(), changed.options.len()), (other, 0));
    }
    let study = read(EXAMPLE);
    let error = study.clone().with_method("event-drivn").unwrap_err();
    assert_eq!(error.help_text(), Some("did you mean `event-driven`?"));
    let error = study.error_at("method", 0, "kind", "no", None);
    assert_eq!(error.underlined(), Some("\"event-driven\""));
    let error = study.error_at("joint", 0, "law", "no", None);
    assert_eq!(error.line(), Some(38), "{error}");
}

/// Checks JSON against the parts of JSON Schema that this project uses.
fn accepts(root: &Json, schema: &Json, value: &Json) -> Result<(), String> {
    if let Some(name) = schema["$ref"].as_str() {
        return accepts(root, &root["$defs"][name.rsplit('/').next().unwrap()], value);
    }
    for (key, all) in [("anyOf", false), ("oneOf", true)] {
        if let Some(list) = schema[key].as_array() {
            let good = list.iter().filter(|s| accepts(root, s, value).is_ok()).count();
            if good == 0 || (all && good > 1) {
                return Err(format!("{key}: {good} fit {value}"));
            }
        }
    }
    if !schema["const"].is_null() && schema["const"] != *value {
        return Err(format!("{value} is not {}", schema["const"]));
    }
    let types: Vec<&str> = match &schema["type"] {
        Json::String(one) => vec![one],
        Json::Array(several) => several.iter().filter_map(Json::as_str).collect(),
        _ => vec![],
    };
    let fits = |name: &&str| match *name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "integer" => value.is_i64(),
        "number" => value.is_number(),
        "boolean" => value.is_boolean(),
        _ => false,
    };
    if !types.is_empty() && !types.iter().any(fits) {
        return Err(format!("{value} is no {types:?}"));
    }
    for required in schema["required"].as_array().into_iter().flatten() {
        if value.get(required.as_str().unwrap()).is_none() {
            return Err(format!("{required} is missing in {value}"));
        }
    }
    for (key, inner) in value.as_object().into_iter().flatten() {
        match schema["properties"].get(key) {
            Some(schema) => accepts(root, schema, inner)?,
            None if schema["additionalProperties"] == false => return Err(format!("unknown {key}")),
            None if schema["additionalProperties"].is_object() => {
                accepts(root, &schema["additionalProperties"], inner)?;
            }
            None => {}
        }
    }
    for item in value.as_array().into_iter().flatten() {
        if schema["items"].is_object() {
            accepts(root, &schema["items"], item)?;
        }
    }
    Ok(())
}

#[test]
fn the_json_schema_accepts_good_files_and_refuses_unknown_keys() {
    let root = schema::json_schema();
    let mut texts: Vec<String> = templates::TABLE.iter().map(|template| template.study.to_owned()).collect();
    texts.push(EXAMPLE.to_owned());
    texts.push(EXAMPLE.replacen("[[force]]", "[[force]]\nrepeat = { i = 3, j = [2, 4], wrap = [\"i\"] }", 1));
    for text in texts {
        let value: Json = serde_json::to_value(toml::from_str::<toml::Value>(&text).unwrap()).unwrap();
        accepts(&root, &root, &value).unwrap();
        let wrong =
            toml::from_str::<toml::Value>(&text.replace("points = 241", "point = 241").replace("on =", "onn ="));
        assert!(accepts(&root, &root, &serde_json::to_value(wrong.unwrap()).unwrap()).is_err());
    }
    for row in law::TABLE {
        assert!(root.to_string().contains(&format!("\"const\":\"{}\"", row.name)), "{}", row.name);
    }
}

/// A single value stands for a list of one, in the program and in the schema.
#[test]
fn vary_takes_a_single_value() {
    let text = EXAMPLE.replace("[\"2 N\", \"4 N\", \"6 N\", \"8 N\"]", "\"5 N\"");
    let study = read(&text);
    assert_eq!((study.cases(), study.case(0).unwrap().label().as_str()), (1, "Ft = 5 N"));
    let root = schema::json_schema();
    let value: Json = serde_json::to_value(toml::from_str::<toml::Value>(&text).unwrap()).unwrap();
    accepts(&root, &root, &value).unwrap();
    let wrong = toml::from_str::<toml::Value>(&text.replace("\"5 N\"", "[]").replace("Ft = []", "Ft = true")).unwrap();
    assert!(accepts(&root, &root, &serde_json::to_value(wrong).unwrap()).is_err());
}

#[test]
fn the_reference_names_every_key_law_method_kind_and_template() {
    let book = book::markdown();
    let keys = kinds::TABLE.iter().flat_map(|kind| kind.info.keys).chain(schema::FILE).chain(schema::STUDY);
    let names = keys.map(|key| key.name).chain(law::TABLE.iter().map(|row| row.name));
    for name in names.chain(method::TABLE.iter().map(|row| row.name)).chain(templates::TABLE.iter().map(|row| row.name))
    {
        assert!(book.contains(&format!("`{name}`")), "{name}");
    }
}

#[test]
fn the_example_of_every_key_is_toml() {
    for kind in kinds::TABLE {
        for key in kind.info.keys.iter().chain(schema::FILE).chain(schema::STUDY) {
            let text = format!("{} = {}", key.name, key.example);
            assert!(toml::from_str::<toml::Value>(&text).is_ok(), "{text}");
        }
    }
}

/// `--set` of a parameter that `vary` also lists: one case with that value, and a note for the
/// reader of the results.
#[test]
fn set_replaces_the_values_of_vary_and_says_so() {
    let study = read_study("fig06.toml", EXAMPLE, &set("Ft", "3N")).unwrap();
    assert_eq!((study.cases(), study.points()), (1, 241));
    let case = study.case(0).unwrap();
    assert_eq!((case.varied[0].si, case.model.joints[0].law.values()), (3.0, vec![3.0]));
    assert_eq!(study.notes(), ["Ft = 3N from `--set` replaces the 4 values of `vary`."]);
    assert_eq!(study.to_record()["replaced"][0]["values_in_file"], 4);
    // the last of several counts; another parameter of `vary` keeps its values
    let text = EXAMPLE.replace("vary = { Ft = [", "vary = { kt = { from = 1, to = 9, points = 5 }, Ft = [");
    let study = read_study("fig06.toml", &text, &[set("Ft", "3 N"), set("Ft", "m * 10 m/s^2")].concat()).unwrap();
    assert_eq!((study.cases(), study.case(4).unwrap().label().as_str()), (5, "kt = 9 N/m, Ft = 1.82 N"));
    assert!(read(EXAMPLE).notes().is_empty());
    assert!(read_study("fig06.toml", EXAMPLE, &set("kt", "1 N/m")).unwrap().notes().is_empty());
}

/// A column of a varied parameter has its unit and the number that was typed; without a unit it
/// has the bare name.
#[test]
fn columns_of_parameters_have_their_unit() {
    let text = EXAMPLE
        .replace("b = \"0.2 kg/s\"", "b = \"0.2 kg/s\"\nshift = \"0 deg\"\nf = \"1 Hz\"\namplitude = \"10 N\"\nn = 3")
        .replace(
            "vary = {",
            "vary = { shift = [\"47.3 deg\"], f = [\"119.3 Hz\"], amplitude = [\"0.3 N\"], n = [7], kt = [\"1 N/mm\"],",
        )
        .replace(
            "amplitude = \"10 N\"\n\n[study]",
            "amplitude = \"amplitude * n * f / (1 Hz)\"\nphase = \"shift\"\n\n[study]",
        );
    let case = read(&text).case(0).unwrap();
    let columns: Vec<(String, f64)> = case.varied.iter().map(|value| value.column()).collect();
    let expected = [
        ("shift_deg", 47.3),
        ("f_Hz", 119.3),
        ("parameter_amplitude_N", 0.3),
        ("n", 7.0),
        ("kt_N_per_m", 1000.0),
        ("Ft_N", 2.0),
    ];
    assert_eq!(columns, expected.map(|(name, value)| (name.to_owned(), value)));
}

/// A sample of every law, stated by bare numbers in SI on a node with its directions, reads
/// back as that sample.
#[test]
fn every_law_reads_back_from_its_keys() {
    for row in law::TABLE {
        let law = row.sample();
        let mut keys = format!("kind = \"{}\"", row.name);
        for (parameter, value) in row.parameters.iter().zip(row.sample) {
            keys += &format!(", {} = {value:e}", parameter.key);
        }
        assert!(*joint_law(law.directions(), &keys).unwrap() == *law, "{}", row.name);
    }
}

/// Returns the law of a joint between a node with this number of directions and the ground.
fn joint_law(directions: usize, law: &str) -> Result<law::SharedLaw, String> {
    let names = ["\"x\"", "\"y\"", "\"z\""][..directions].join(", ");
    let directions = if directions > 1 { format!("directions = [{names}]\n") } else { String::new() };
    let body = if directions.is_empty() { "body" } else { "body.x" };
    let text = format!(
        "schema = 1\n[[mass]]\nname = \"body\"\nmass = \"1 kg\"\n{directions}[[joint]]\nname = \"foot\"\n\
         between = [\"body\", \"ground\"]\nlaw = {{ {law} }}\n[[force]]\non = \"{body}\"\namplitude = \"1 N\"\n\
         [study]\nkind = \"orbit\"\nfrequency = \"1 Hz\"\n"
    );
    let study = read_study("law.toml", &text, &[]).map_err(|error| error.to_string())?;
    let case = study.case(0).map_err(|error| error.to_string())?;
    Ok(case.model.joints[0].law.clone())
}

#[test]
fn dimensions_depend_on_exponents() {
    let with = |beta: &str, exponent: &str| {
        let law =
            format!("kind = \"bouc-wen\", stiffness = \"1 N/mm\", gamma = 0, beta = {beta}, exponent = {exponent}");
        joint_law(1, &law).map(|law| law.value("beta").unwrap())
    };
    assert_eq!(with("\"3 mm^-1\"", "1"), Ok(3e3));
    assert_eq!(with("\"3 mm^-2\"", "2"), Ok(3e6));
    assert_eq!(with("\"3 mm^-3\"", "3"), Ok(3e9));
    assert_eq!(with("4.5", "1.5"), Ok(4.5), "plain numbers in SI where no unit can be written");
    for (beta, exponent) in [("\"3 mm^-1\"", "2"), ("\"3 mm^-2\"", "1"), ("\"3 mm^-1\"", "1.5")] {
        let error = with(beta, exponent).unwrap_err();
        assert!(error.contains("`beta`"), "{error}");
    }
    assert!(with("\"3 mm^-1\"", "0.5").unwrap_err().contains("`exponent`"));
}

/// If a dimension contains a parameter as an exponent, its unit can be written for every whole
/// value of that parameter.
#[test]
fn a_unit_can_be_written_for_every_exponent() {
    for row in law::TABLE {
        for (raised, power) in row.parameters.iter().filter_map(|p| Some((p, p.power?))) {
            let range = row.parameters.iter().find(|p| p.key == power).unwrap().range;
            for exponent in (0..=1000).map(f64::from).filter(|exponent| range.contains(*exponent)) {
                let dimension = raised.dimension.pow(exponent).unwrap();
                let value = |p: &law::Parameter, sample: f64| match p.key {
                    key if key == raised.key => {
                        format!("{key} = \"2 m^{} s^{} kg^{}\"", dimension.m, dimension.s, dimension.kg)
                    }
                    key if key == power => format!("{key} = {exponent}"),
                    key if p.power == Some(power) => format!("{key} = 0"),
                    key => format!("{key} = {sample}"),
                };
                let keys: Vec<String> = row.parameters.iter().zip(row.sample).map(|(p, s)| value(p, *s)).collect();
                let text = format!("kind = \"{}\", {}", row.name, keys.join(", "));
                let law = joint_law(row.sample().directions(), &text.replace(" s^0 kg^0", ""));
                // other errors of the law are accepted here
                if let Err(error) = law {
                    assert!(
                        !error.contains(&format!("`{}`", raised.key)) || error.contains("more than zero"),
                        "{error}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_contact_has_the_tangents_of_its_nodes_unless_it_states_them() {
    let contact = "kind = \"friction-contact\", tangential = 1, normal = 2, friction = 0.3";
    let tangents = |directions: usize, more: &str| {
        joint_law(directions, &format!("{contact}{more}")).map(|law| law.value("tangents").unwrap())
    };
    assert_eq!(tangents(2, ""), Ok(1.0));
    assert_eq!(tangents(3, ""), Ok(2.0));
    assert_eq!(tangents(2, ", tangents = 1"), Ok(1.0));
    assert!(tangents(2, ", tangents = 2").unwrap_err().contains("3 directions"));
    assert!(tangents(1, "").unwrap_err().contains("3 directions"));
    assert!(tangents(2, ", tangents = 1.5").unwrap_err().contains("a whole number from 1 to 2"));
}
