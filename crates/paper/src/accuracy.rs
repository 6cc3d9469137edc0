//! Data that the paper does not state, and the accuracy of the report's numbers.

use crate::additional_cases::AdditionalCases;
use crate::finding::ReportPart;
use crate::studies::Results;
use crate::text::{list, words};
use stickslip_report::{PageTable, Section};
use stickslip_study::results::worst_evidence;

/// Lists inferred values and misprints.
pub fn inferred_values(additional: &AdditionalCases) -> ReportPart {
    let rows = [
        [
            "k = 105103 N/m",
            "not stated",
            "the blade m \u{2212} m1/2 with m1 = m/100 resonates at 121.25 Hz; a relative change of 1e-5 in k moves an amplitude on the flank by 2e-4",
        ],
        [
            "b = 0.2 kg/s",
            "not stated",
            "\u{201c}up to 5 cm\u{201d} is the peak of a1 at Ft = 2 N, about (F0 \u{2212} 4 Ft/\u{3c0})/(b \u{3c9})",
        ],
        [
            "\u{3c9} = 1 rad/s in Figs. 2-4",
            "not stated",
            "between 0.5 and 2 rad/s the loops with mass look like those without",
        ],
        [
            "law in Fig. 4",
            "caption: Coulomb; text: the same parameters as Fig. 3",
            "arctangent: true Coulomb friction makes the loop ring",
        ],
        [
            "masses in Fig. 9",
            "not stated",
            "m1/2 on each side, so that the total mass and the deformed mass stay those of Fig. 6",
        ],
        ["frequency range", "axes without numbers in the text", "119.5 to 122.5 Hz, 241 points"],
        [
            "Eq. (1)",
            "F = kt (x \u{2212} x1) in stick",
            "F = kt (x1 \u{2212} x), as the slip branch and the equation of the loops require",
        ],
        ["Eq. (4), line 4", "derivative of v3", "derivative of v2"],
        ["Eq. (4), line 6", "x31", "x3"],
        ["\u{3b1} = 25 s/mm", "25 s/mm among SI units", "25000 s/m"],
        [
            "Sec. 5",
            "spring at body 1, friction at body 2",
            "friction at the excited blade, spring at the other, as Eq. (3), Fig. 6 and \u{201c}121.25 Hz\u{201d} require",
        ],
        [
            "mass m + m1/2 of the non-excited body",
            "text of Sec. 4",
            "m \u{2212} m1/2 in Eq. (3); with m1 riding along while the contact slips it is m + m1/2",
        ],
    ];
    let mut paragraphs = vec![
        "The paper does not print these equations and numbers, or prints them wrong. The table shows what this \
         report uses instead."
            .to_owned(),
    ];
    if let Some(couple) = &additional.couple {
        paragraphs.push(format!(
            "The inferred b carries over to all amplitudes: near its peak a1 follows (F0 \u{2212} 4 Ft/\u{3c0})/(b \u{3c9}). With it the peaks at Ft = 2 and 4 N are {} cm.",
            list([100.0 * couple.peak_at(2.0), 100.0 * couple.peak_at(4.0)], 3)
        ));
    }
    let section = Section {
        heading: "Data that the paper does not state".to_owned(),
        paragraphs,
        tables: vec![PageTable {
            caption: String::new(),
            header: words(&["what", "the paper", "here, and why"]),
            rows: rows.iter().map(|row| words(row)).collect(),
        }],
        ..Section::default()
    };
    ReportPart { section, findings: Vec::new() }
}

/// Lists the error measures of every dataset.
pub fn error_measures(results: &Results) -> ReportPart {
    let rows = results.all().map(|dataset| {
        let points: u64 = dataset.record.points.values().sum();
        let evidence = worst_evidence(dataset);
        vec![
            dataset.name.clone(),
            points.to_string(),
            dataset.failures.len().to_string(),
            shown(evidence.residual),
            shown(evidence.energy_gap),
            format!("{:.2}", dataset.record.wall_time_s),
        ]
    });
    let section = Section {
        heading: "Accuracy of the numbers".to_owned(),
        paragraphs: vec![
            "Every point is a periodic solution, found by Newton’s method and checked by its energy balance. A \
             failed point is counted, but never drawn. The table shows the largest values over all points of a \
             figure; the folder of each figure contains its tables."
                .to_owned(),
        ],
        tables: vec![PageTable {
            caption: "Evidence".to_owned(),
            header: words(&["figure", "points", "failed", "residual", "energy gap", "time (s)"]),
            rows: rows.collect(),
        }],
        ..Section::default()
    };
    ReportPart { section, findings: Vec::new() }
}

/// Formats an error measure, if it exists.
fn shown(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.1e}"))
}
