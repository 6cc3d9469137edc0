//! Measured curves of `[[data]]`, drawn with the computed ones.
//!
//! A table with the columns `frequency` and `response`, or a column with the name of a place,
//! belongs to the curves of a response. A table with the columns `displacement` and `force`
//! belongs to the loops of a hysteresis study.

use stickslip::dimension::Dimension;
use stickslip_study::dataset::{Axis, Emphasis, Figure, Panel, Series};
use stickslip_study::{Study, units};

/// Adds the measured curves that belong to a figure of a study, as marks.
pub(crate) fn add(study: &Study, figure: &mut Figure) {
    for name in study.data_names() {
        match study.kind().name {
            "response" => add_response(study, name, figure),
            "hysteresis" => add_loop(study, name, figure),
            _ => {}
        }
    }
}

fn add_response(study: &Study, table: &str, figure: &mut Figure) {
    let places = places(figure);
    for (place, colour) in &places {
        for panel in figure.panels.iter_mut().filter(|panel| shows(panel, place)) {
            let column = |role: &str, axis: &Axis| column(study, table, role, axis);
            let Some(frequency) = column("frequency", &panel.x) else { continue };
            let only = || column("response", &panel.y).filter(|_| places.len() == 1);
            if let Some(values) = column(place, &panel.y).or_else(only) {
                panel.series.push(Series::marks(format!("measured: {table}"), frequency, values, *colour));
            }
        }
    }
}

fn add_loop(study: &Study, table: &str, figure: &mut Figure) {
    for panel in &mut figure.panels {
        let column = |role: &str, axis: &Axis| column(study, table, role, axis);
        if let (Some(x), Some(y)) = (column("displacement", &panel.x), column("force", &panel.y)) {
            let colour = panel.series.len();
            panel.series.push(Series::marks(format!("measured: {table}"), x, y, colour));
        }
    }
}

/// Returns a column in the unit of an axis; `None` if it has another dimension.
fn column(study: &Study, table: &str, role: &str, axis: &Axis) -> Option<Vec<f64>> {
    let acceleration = Dimension { kg: 0, m: 1, s: -2, rad: 0 };
    let known = [
        ("m", Dimension::LENGTH),
        ("m/s", Dimension::VELOCITY),
        ("m/s^2", acceleration),
        ("N", Dimension::FORCE),
        ("rad/s", Dimension::FREQUENCY),
    ];
    let (factor, dimension) = known.into_iter().find_map(|(si, of)| Some((units::ratio(si, &axis.unit)?, of)))?;
    let values = study.data_column(table, role, dimension)?;
    Some(values.into_iter().map(|value| value * factor).collect())
}

/// Returns the places of the curves of a response, with their colours. A curve is named after
/// its place, or after its case in a panel with the name of the place.
fn places(figure: &Figure) -> Vec<(String, usize)> {
    let mut found: Vec<(String, usize)> = Vec::new();
    for panel in &figure.panels {
        for series in panel.series.iter().filter(|series| !series.label.is_empty()) {
            let name = if series.label.contains(" = ") { &panel.title } else { &series.label };
            let is_reference = matches!(series.emphasis, Emphasis::Reference | Emphasis::OwnReference);
            let is_curve = !is_reference && series.x.len() > 2;
            if is_curve && found.iter().all(|(known, _)| known != name) {
                found.push((name.clone(), series.colour));
            }
        }
    }
    found
}

fn shows(panel: &Panel, place: &str) -> bool {
    panel.title == place || panel.series.iter().any(|series| series.label == place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_study::dataset::Style;
    use stickslip_study::run::{Context, run};
    use stickslip_study::{read_study, templates};

    /// The figure of a study with a measured file.
    fn figure(study: &str, data: &str) -> Figure {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("rig.csv"), data).unwrap();
        let text = format!("{study}\n[[data]]\nname = \"rig\"\nfile = \"rig.csv\"\n");
        let name = folder.path().join("study.toml");
        let study = read_study(name.to_str().unwrap(), &text, &[]).unwrap();
        let mut figure = run(&study, &Context::without_progress(2)).unwrap().figure;
        add(&study, &mut figure);
        figure
    }

    fn marks(figure: &Figure) -> Vec<&Series> {
        let all = figure.panels.iter().flat_map(|panel| &panel.series);
        all.filter(|series| series.label == "measured: rig" && series.style == Style::Marks).collect()
    }

    #[test]
    fn a_measured_response_is_drawn_in_every_panel_of_its_place() {
        let text = templates::find("blade-couple").unwrap().study.replace("points = 241", "points = 5");
        let figure = figure(&text, "frequency_Hz,blade1 [mm]\n120,4\n121,22\n");
        let found = marks(&figure);
        assert_eq!(found.len(), 4, "one for each case");
        assert!((found[0].x[0] - 120.0).abs() < 1e-9 && found[0].x.len() == 2, "{:?}", found[0].x);
        assert!((found[0].y[1] - 22.0).abs() < 1e-12, "{:?}", found[0].y);
        let curve = figure.panels[0].series.iter().find(|series| series.label == "blade1").unwrap();
        assert_eq!(found[0].colour, curve.colour);
    }

    /// The linear references are not places, so that `response` belongs to the only mass.
    #[test]
    fn a_response_belongs_to_the_only_place() {
        let text = "schema = 1\n[[mass]]\nname = \"body\"\nmass = \"1 kg\"\n\
            [[spring]]\nbetween = [\"body\", \"ground\"]\nstiffness = \"10 N/mm\"\ndamping = \"2 N s/m\"\n\
            [[joint]]\nname = \"foot\"\nbetween = [\"body\", \"ground\"]\n\
            law = { kind = \"jenkins\", stiffness = \"2 N/mm\", limit = \"1 N\" }\n\
            [[force]]\non = \"body\"\namplitude = \"2 N\"\n\
            [study]\nkind = \"response\"\nfrequency = { from = \"14 Hz\", to = \"19 Hz\", points = 11 }\n\
            [figure]\nreferences = true\n";
        let figure = figure(text, "frequency_Hz,response_mm\n15,1\n16,2\n");
        assert!(figure.panels[0].series.iter().any(|series| series.emphasis == Emphasis::Reference));
        let found = marks(&figure);
        assert_eq!((found.len(), &found[0].y[..]), (1, &[1.0, 2.0][..]));
    }

    #[test]
    fn a_measured_loop_is_drawn_over_the_computed_ones() {
        let text = templates::find("element").unwrap().study;
        let figure = figure(text, "displacement_mm,force_mN\n-1,0.5\n1,1\n");
        let found = marks(&figure);
        assert_eq!((found.len(), &found[0].x[..]), (1, &[-1.0, 1.0][..]));
    }

    #[test]
    fn data_of_another_kind_are_not_drawn() {
        let text = templates::find("element").unwrap().study;
        assert!(marks(&figure(text, "time_s,response_m\n0,1\n1,2\n")).is_empty());
    }
}
