//! The figure of hysteresis loops.

use super::tables;
use crate::case::study::varied_text;
use crate::kinds::hysteresis::tables::{DISPLACEMENT, FORCE, JOINT, LOOPS};
use crate::results::columns::FREQUENCY as DRIVE;
use crate::results::dataset::{Figure, Panel, Series};
use crate::results::draw_panels;
use crate::results::drawing::{CaseRows, FigureInput, join_title, largest, numbers, words};
use crate::syntax::format::format_hertz;

/// Draws the loops. The last varied parameter and the frequency distinguish loops in a panel;
/// the others distinguish panels.
pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let Some(table) = drawing.table(LOOPS) else { return Figure::default() };
    let (x_axis, x_factor) = drawing.axis(0, "displacement", largest(table, [DISPLACEMENT.to_owned()]), "m");
    let (y_axis, y_factor) = drawing.axis(1, "force", largest(table, [FORCE.to_owned()]), "N");
    let joints = words(table, JOINT);
    // a table from another source may lack columns
    if joints.len() != table.rows() {
        return Figure::default();
    }
    let frequencies = table.numbers(DRIVE);
    let several = joints.iter().any(|joint| *joint != joints[0]);
    let panels_of = |cases: &[CaseRows], words: &dyn Fn(&CaseRows) -> (String, String)| {
        let mut panels: Vec<Panel> = Vec::new();
        for case_rows in cases {
            let (outer, inner) = words(case_rows);
            for rows in tables::split_loops(table, case_rows.rows.clone()) {
                let from = rows.start;
                let joint = Some(joints[from].clone()).filter(|_| several);
                let title = join_title([outer.clone()].into_iter().chain(joint));
                let frequency = frequencies.map(|frequencies| format_hertz(frequencies[from]));
                let label = join_title([inner.clone()].into_iter().chain(frequency));
                let label = if label.is_empty() { joints[from].clone() } else { label };
                let index = panels.iter().position(|panel| panel.title == title).unwrap_or_else(|| {
                    let (x, y) = (x_axis.clone(), y_axis.clone());
                    panels.push(Panel { title, x, y, ..Panel::default() });
                    panels.len() - 1
                });
                let x = numbers(table, DISPLACEMENT, rows.clone()).iter().map(|u| u * x_factor).collect();
                let y = numbers(table, FORCE, rows).iter().map(|f| f * y_factor).collect();
                let colour = panels[index].series.len();
                panels[index].series.push(Series::line(label, x, y, colour));
            }
        }
        panels
    };
    let cases = drawing.case_rows(table);
    if drawing.study.draws().is_some() {
        let case_panels = |case_rows: &CaseRows, title: String| {
            panels_of(std::slice::from_ref(case_rows), &|_| (title.clone(), String::new()))
        };
        return Figure { panels: draw_panels::panels(drawing, &cases, &case_panels), ..Figure::default() };
    }
    let split = |case_rows: &CaseRows| {
        let (outer, inner) = case_rows.varied.split_at(case_rows.varied.len().saturating_sub(1));
        (varied_text(outer), varied_text(inner))
    };
    Figure { panels: panels_of(&cases, &split), ..Figure::default() }
}
