//! Writes the motions of a mesh as a page: a surface that can be turned and moves, with the contact
//! states in colour.
//!
//! The page draws with plotly.js, as `figure.html` does.

use crate::fields::Fields;
use crate::figure::colour::PALETTE;
use crate::figure::html::{document, script, script_name};
use crate::figure::svg::escape;
use crate::moving_surface::MovingSurface;
use crate::output::result_file::{File, Output, ReportError};
use serde_json::json;
use stickslip_study::dataset::Dataset;

/// The output `motion`.
pub const OUTPUT: Output = Output {
    name: "motion",
    summary: "the table `fields` as motion.html: the mesh in motion, with the contact states",
    make: files,
    sink: None,
    is_default: true,
};

/// Limits of the page.
#[derive(Debug, Clone, Copy)]
struct MotionSettings {
    /// Largest number of nodes times instants of all motions. Default 2e6: a page of 35 MB.
    moves: usize,
}

impl Default for MotionSettings {
    fn default() -> Self {
        MotionSettings { moves: 2_000_000 }
    }
}

/// Colours of the contact states open, touching, sticking, slipping, as indices of the palette.
const STATES: [(&str, usize); 4] = [("open", 3), ("touches", 4), ("sticks", 0), ("slips", 1)];

const STYLE: &str = "\
body { max-width: 1280px; }
#motion { width: 100%; height: min(70vh, 46rem); min-height: 18rem; }
#motion:focus-visible { outline: 2px solid #2f7fc9; }
.tools { display: flex; flex-wrap: wrap; align-items: center; gap: .5rem 1.2rem; margin: .5rem 0; }
.tools label { display: inline-flex; align-items: center; gap: .5rem; }
.tools [hidden] { display: none; }
.tools button, .tools select { font: inherit; padding: .2rem .7rem; max-width: 100%; }
.key { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; padding: 0; margin: .5rem 0; list-style: none; }
.key i { display: inline-block; width: .8rem; height: .8rem; border-radius: 50%; margin-right: .4rem; background: var(--light); }
@media screen and (prefers-color-scheme: dark) { .key i { background: var(--dark); } }
@media print { .tools { display: none; } }
";

const MOVE: &str = include_str!("motion.js");

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    let Some((fields, source)) = Fields::of(dataset) else { return Ok(Vec::new()) };
    let surface = MovingSurface::new(&fields, source);
    let (all, mut orbits, mut moves) = (fields.orbits(), Vec::new(), 0);
    for orbit in &all {
        moves += surface.nodes() * fields.instants(orbit).len();
        if moves > MotionSettings::default().moves {
            break;
        }
        orbits.push(orbit);
    }
    if orbits.is_empty() {
        return Ok(Vec::new());
    }
    let motions = orbits.iter().map(|orbit| {
        let mut motion = surface.motion(orbit);
        motion["label"] = fields.label(orbit).into();
        motion
    });
    let mut data = surface.still();
    data["motions"] = motions.collect();
    let colours = STATES.map(|(_, index)| PALETTE[index]);
    data["states"] = json!(colours);
    let has_contact = fields.contact.is_some_and(|states| states.iter().any(|state| !state.is_empty()));
    let page = page(dataset, &data, all.len() - orbits.len(), has_contact);
    Ok(vec![File::new("motion.html", page), File::shared(script_name(), script())])
}

/// Returns the page; `left_out` motions are too many for it.
fn page(dataset: &Dataset, data: &serde_json::Value, left_out: usize, has_contact: bool) -> String {
    let title = escape(&dataset.figure.title);
    let key: String = STATES
        .iter()
        .filter(|_| has_contact)
        .map(|(word, index)| {
            let [light, dark] = PALETTE[*index];
            format!("<li><i style=\"--light: {light}; --dark: {dark}\"></i>{word}</li>\n")
        })
        .collect();
    let more = match left_out {
        0 => String::new(),
        count => format!("<p>{count} more motions are in the files for ParaView.</p>\n"),
    };
    // a `<` in a name could close the script element
    let data = data.to_string().replace('<', "\\u003c");
    let body = format!(
        "<h1>{title}</h1>\n<div class=\"live\">\n<div class=\"tools\">\n\
         <button type=\"button\" id=\"play\">Play</button>\n\
         <label>Time <input type=\"range\" id=\"time\" min=\"0\" max=\"1\" step=\"0.001\" value=\"0\"></label>\n\
         <label>Scale <input type=\"range\" id=\"scale\" min=\"-2\" max=\"1\" step=\"0.01\" value=\"0\"></label>\n\
         <output id=\"factor\"></output>\n\
         <label>Motion <select id=\"which\"></select></label>\n</div>\n\
         <div id=\"motion\" tabindex=\"0\" role=\"img\" aria-label=\"The structure in three dimensions. Arrow keys turn it.\"></div>\n\
         <ul class=\"key\">\n{key}</ul>\n\
         <p>Drag to turn, roll to zoom, or use the arrow keys. The surface is coloured by the displacement from its mean \
         over the period.</p>\n{more}</div>\n<script>\n{MOVE}\nstart({data});\n</script>"
    );
    document(&title, STYLE, &body, &format!("../{}", script_name()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use stickslip_study::dataset::Column;

    /// Two motions of a tetrahedron; a title with a tag cannot close the script.
    #[test]
    fn a_page_has_all_motions_and_their_labels() {
        let mut dataset = samples::motions_of_a_tetrahedron();
        let case = Column::texts("case", ["a</script>", "b"].map(|name| vec![name.to_owned(); 4]).concat());
        dataset.tables[0].columns.insert(0, case);
        let files = files(&dataset).unwrap();
        let page = String::from_utf8(files[0].content.clone()).unwrap();
        assert_eq!(files[0].name, "motion.html");
        assert!(page.contains("case a\\u003c/script>, frequency 10 Hz") && page.contains("case b, frequency 20 Hz"));
        assert!(page.contains(">slips</li>"));
        let data = &page[page.rfind("start(").unwrap() + 6..page.rfind(");\n</script>").unwrap()];
        let data: serde_json::Value = serde_json::from_str(data).unwrap();
        assert_eq!(data["motions"][1]["instants"], 2);
        assert_eq!(data["motions"][1]["contact"], crate::base64::base64(&[0, 0, 0, 4, 0, 0, 0, 4]).as_str());
        // without nodes of a mesh there is no page
        assert!(super::files(&Dataset::default()).unwrap().is_empty());
    }
}
