//! Figs. 2-4: the loops of the friction elements, and the paper's claims about them.

use crate::additional_cases::AdditionalCases;
use crate::finding::{Finding, ReportPart, finding};
use crate::measure::{Loop, largest};
use crate::studies::Results;
use crate::text::{join, list, percent, words};
use crate::verdict::{APPROXIMATE, DIFFERENT, SIMILAR, in_all, small};
use stickslip_report::{PageTable, Section, Verdict};
use stickslip_study::dataset::{Figure, Panel};

/// Slip limit of the elements in N.
const LIMIT: f64 = 1e-3;

/// Merges the panels of several figures. Each panel title has the number of its figure.
fn merged(results: &Results, title: &str, figures: &[(&str, &str)]) -> Option<Figure> {
    let mut panels = Vec::new();
    for (name, number) in figures {
        for panel in &results.get(name)?.figure.panels {
            panels.push(Panel { title: format!("{number}, {}", panel.title), ..panel.clone() });
        }
    }
    Some(Figure { title: title.to_owned(), panels, ..Figure::default() })
}

/// Fig. 2.
pub fn exact(results: &Results) -> Option<ReportPart> {
    let loops = results.loops(&["fig02"])?;
    let corners: Vec<usize> = loops.iter().map(Loop::break_points).collect();
    // A rhomboid has four sides with two alternating slopes.
    let rhomboid: Vec<bool> = loops
        .iter()
        .map(|l| {
            let (slopes, tolerance) = (l.slopes(), 1e-6 * l.stiffness);
            slopes.len() == 4
                && slopes.iter().all(|s| s.abs() < tolerance || (s - l.stiffness).abs() < tolerance)
                && (slopes[0] - slopes[2]).abs() < tolerance
                && (slopes[1] - slopes[3]).abs() < tolerance
        })
        .collect();
    let areas = |l: &Loop| 4.0 * LIMIT * (l.amplitude - LIMIT / l.stiffness);
    let closed = largest(loops.iter().map(|l| (l.area / areas(l) - 1.0).abs()));
    let findings = vec![
        finding(
            "four break points in one cycle",
            "\u{201c}The hysteresis loop of the weightless \u{2018}stick-slip\u{2019} damping element \u{2026} contains four break points in one \
             cycle.\u{201d} (Sec. 3)",
            format!("break points of the {} loops: {}", loops.len(), join(&corners)),
            in_all(&corners.iter().map(|n| *n == 4).collect::<Vec<_>>()),
        ),
        finding(
            "rhomboid form",
            "The loop \u{201c}has a rhomboid-form\u{201d}. (Sec. 3)",
            format!(
                "{} of {} loops have four sides, in turn of slope kt and 0 (a parallelogram). Areas agree with 4 Ft (a - Ft/kt) to {}.",
                rhomboid.iter().filter(|ok| **ok).count(),
                loops.len(),
                percent(closed)
            ),
            in_all(&rhomboid),
        ),
    ];
    let section = Section {
        heading: "Fig. 2: the exact loops".to_owned(),
        paragraphs: vec![
            "A spring and a slider in series, without mass, moved by a cos(ωt). The force is the one that moves \
             the element."
                .to_owned(),
        ],
        figure: Some(Figure { title: String::new(), ..results.get("fig02")?.figure.clone() }),
        ..Section::default()
    };
    Some(ReportPart { section, findings })
}

/// Figs. 3 and 4 with the paper's law.
pub fn approximate(results: &Results, additional: &AdditionalCases) -> Option<ReportPart> {
    let elements = Elements::of(results)?;
    let mut findings = elements.findings();
    findings.extend(computing_time(results));
    let section = Section {
        heading: "Figs. 3 and 4: the approximate elements".to_owned(),
        paragraphs: vec![
            "Fig. 3: the slider with the arctangent law, Eq. (2), α = 25 s/mm, without mass. Fig. 4: the same \
             law at a mass of 2 g between spring and slider. The rounding of the loop by the arctangent depends \
             on α a ω alone, so the smallest loop is the least similar one."
                .to_owned(),
        ],
        figure: merged(
            results,
            "",
            &[("fig03a", "Fig. 3a"), ("fig03b", "Fig. 3b"), ("fig04a", "Fig. 4a"), ("fig04b", "Fig. 4b")],
        ),
        tables: vec![elements.areas(), frequencies(additional)],
        ..Section::default()
    };
    Some(ReportPart { section, findings })
}

/// Loops of the four kinds of element, in the same order.
struct Elements {
    exact: Vec<Loop>,
    arctan: Vec<Loop>,
    massive: Vec<Loop>,
    coulomb: Vec<Loop>,
}

/// Returns the relative excess of each area over that of the other element.
fn excess(a: &[Loop], b: &[Loop]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a.area / b.area - 1.0).collect()
}

/// Returns the largest force difference between loops of the same motion, in slip limits.
fn force_differences(a: &[Loop], b: &[Loop]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a.difference(b) / LIMIT).collect()
}

fn per_cents(values: &[f64]) -> String {
    format!("{} %", list(values.iter().map(|v| 100.0 * v), 1))
}

impl Elements {
    fn of(results: &Results) -> Option<Elements> {
        Some(Elements {
            exact: results.loops(&["fig02"])?,
            arctan: results.loops(&["fig03a", "fig03b"])?,
            massive: results.loops(&["fig04a", "fig04b"])?,
            coulomb: results.loops(&["fig04a_coulomb", "fig04b_coulomb"])?,
        })
    }

    fn findings(&self) -> Vec<Finding> {
        vec![self.same_areas(), self.same_form(), self.little_mass()]
    }

    fn same_areas(&self) -> Finding {
        let (arctan, massive) = (excess(&self.arctan, &self.exact), excess(&self.massive, &self.exact));
        let both: Vec<bool> = arctan.iter().chain(&massive).map(|v| v.abs() <= SIMILAR).collect();
        finding(
            "areas very similar to the exact element",
            "Both models \u{201c}give very similar properties \u{2026} from the point of view of \u{2026} area proportional to the friction loss \
             energy\u{201d} as the exact loops of Fig. 2. (Sec. 3)",
            format!(
                "Area beyond the exact one, arctangent law: {}; with mass: {} (loops in the order of the table). {} of {} are within {}.",
                per_cents(&arctan),
                per_cents(&massive),
                both.iter().filter(|within| **within).count(),
                both.len(),
                percent(SIMILAR)
            ),
            in_all(&both),
        )
    }

    fn same_form(&self) -> Finding {
        let form =
            |loops: &[Loop]| -> Vec<f64> { loops.iter().zip(&self.exact).map(|(a, b)| b.distance(a, LIMIT)).collect() };
        let (arctan, massive) = (form(&self.arctan), form(&self.massive));
        let lowest_top = |loops: &[Loop]| list([1e3 * loops.iter().map(Loop::highest).fold(f64::NAN, f64::min)], 3);
        let highest_top = |loops: &[Loop]| list([1e3 * largest(loops.iter().map(Loop::highest))], 3);
        finding(
            "form very similar to the exact element",
            "They are very similar \u{201c}from the point of view of hysteresis loop\u{2019}s form\u{201d}. (Sec. 3)",
            format!(
                "Largest distance between the loops, displacements in a and forces in Ft, arctangent law: {}; with mass: {}. \
                 Highest force, arctangent law: {} to {} mN; with mass: {} to {} mN.",
                per_cents(&arctan),
                per_cents(&massive),
                lowest_top(&self.arctan),
                highest_top(&self.arctan),
                lowest_top(&self.massive),
                highest_top(&self.massive)
            ),
            small(largest(arctan.iter().chain(&massive).copied()), APPROXIMATE, DIFFERENT),
        )
    }

    fn little_mass(&self) -> Finding {
        let (area, form) = (excess(&self.massive, &self.arctan), force_differences(&self.massive, &self.arctan));
        finding(
            "the mass changes the force only slightly",
            "With the small mass \u{201c}the excitation force is slightly different\u{201d} from that of the weightless element. (Sec. 2)",
            format!(
                "Largest difference of force between Fig. 4 and Fig. 3 up to {} of Ft; areas differ by up to {}.",
                percent(largest(form.iter().copied())),
                percent(largest(area.iter().map(|v| v.abs())))
            ),
            small(largest(form.iter().chain(&area).map(|v| v.abs())), SIMILAR, 2.0 * SIMILAR),
        )
    }

    fn areas(&self) -> PageTable {
        let microjoule = |l: &Loop| format!("{:.4}", 1e6 * l.area);
        let beyond =
            |l: &Loop, exact: &Loop| format!("{:+.1}", 100.0 * (l.area / exact.area - 1.0)).replace('-', "\u{2212}");
        let loops = self.exact.iter().zip(&self.arctan).zip(&self.massive).zip(&self.coulomb);
        let row = |(((exact, arctan), massive), coulomb): (((&Loop, &Loop), &Loop), &Loop)| {
            let mut row = vec![format!("{}", exact.stiffness), format!("{}", 1e3 * exact.amplitude), microjoule(exact)];
            row.extend([arctan, massive, coulomb].into_iter().flat_map(|l| [microjoule(l), beyond(l, exact)]));
            row
        };
        PageTable {
            caption: "Loss per cycle (\u{b5}J), and per cent beyond the exact loop".to_owned(),
            header: words(&[
                "kt (N/m)",
                "a (mm)",
                "exact, Fig. 2",
                "arctangent, Fig. 3",
                "%",
                "with mass, Fig. 4",
                "%",
                "mass, Coulomb",
                "%",
            ]),
            rows: loops.map(row).collect(),
        }
    }
}

fn computing_time(results: &Results) -> Option<Finding> {
    let (exact, arctan) = (results.get("fig06")?, results.get("fig06_arctan")?);
    let ratio = arctan.record.wall_time_s / exact.record.wall_time_s;
    Some(finding(
        "more advantageous than the piecewise solution",
        "The approximate models \u{201c}are also more advantageous than the stepwise piece-wise solution when one period is divided into several \
         intervals\u{201d}. (Sec. 3)",
        format!(
            "Computing time: the {} points of Fig. 6 take {:.2} s piecewise, in closed form between switches, and \
             {:.1} s with the arctangent law, {ratio:.0} times as long (times of this run).",
            exact.record.points.values().sum::<u64>(),
            exact.record.wall_time_s,
            arctan.record.wall_time_s
        ),
        if ratio <= 1.0 { Verdict::Holds } else { Verdict::DoesNotHold },
    ))
}

fn frequencies(additional: &AdditionalCases) -> PageTable {
    let row = |(omega, arctan, massive): &(f64, Vec<Loop>, Vec<Loop>)| {
        vec![
            format!("{omega:.4}"),
            list([100.0 * largest(force_differences(massive, arctan))], 1),
            list([100.0 * largest(excess(massive, arctan).iter().map(|v| v.abs()))], 1),
            list([largest(massive.iter().map(Loop::highest)) / LIMIT], 2),
        ]
    };
    PageTable {
        caption: "Why \u{3c9} = 1 rad/s: over the six loops, how much Fig. 4 differs from Fig. 3".to_owned(),
        header: words(&["\u{3c9} (rad/s)", "force, % of Ft", "area, %", "highest force in Fig. 4, Ft"]),
        rows: additional.omega.iter().map(row).collect(),
    }
}

/// Fig. 4 with the law of its caption.
pub fn coulomb(results: &Results) -> Option<ReportPart> {
    let loops = results.loops(&["fig04a_coulomb", "fig04b_coulomb"])?;
    let arctan = results.loops(&["fig04a", "fig04b"])?;
    let overshoot = |loops: &[Loop]| largest(loops.iter().map(Loop::highest)) / LIMIT - 1.0;
    // Smallest turn of the force that counts, relative to Ft.
    let turns = |loops: &[Loop]| -> Vec<usize> { loops.iter().map(|l| l.turns(0.01 * LIMIT)).collect() };
    let (rung, smooth) = (turns(&loops), turns(&arctan));
    let findings = vec![finding(
        "Fig. 4 shows true Coulomb friction",
        "Caption of Fig. 4: \u{201c}Hysteresis loops of stick-slip Coulomb dry friction element\u{201d}; the text: loops \u{201c}for the same \
         parameters\u{201d} as Fig. 3, of \u{201c}very similar\u{201d} form.",
        format!(
            "Turns of the force in a cycle (a rhomboid has 2): {} with Coulomb friction, {} with the arctangent law. The force exceeds Ft by up to \
             {} and {}.",
            join(&rung),
            join(&smooth),
            percent(overshoot(&loops)),
            percent(overshoot(&arctan))
        ),
        in_all(&rung.iter().zip(&smooth).map(|(rung, smooth)| rung <= smooth).collect::<Vec<_>>()),
    )];
    let section = Section {
        heading: "Fig. 4 with true Coulomb friction".to_owned(),
        paragraphs: vec![
            "The caption of Fig. 4 contradicts its text. This section shows the loops of the element with mass \
             and a slider that obeys Coulomb’s law."
                .to_owned(),
        ],
        figure: merged(results, "", &[("fig04a_coulomb", "Coulomb"), ("fig04b_coulomb", "Coulomb")]),
        ..Section::default()
    };
    Some(ReportPart { section, findings })
}
