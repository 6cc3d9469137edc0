//! Figs. 2-4: the loops of the friction elements, and what the paper says of them.

use crate::further::Further;
use crate::measure::{Loop, largest};
use crate::part::{Part, finding};
use crate::studies::Results;
use crate::text::{join, list, percent, words};
use crate::verdict::{APPROXIMATE, DIFFERENT, SIMILAR, in_all, small};
use stickslip_report::{PageTable, Section, Verdict};
use stickslip_study::dataset::{Figure, Panel};

/// Slip limit of the elements, N.
const LIMIT: f64 = 1e-3;

/// A turn of the force counts from this part of Ft on.
const TURN: f64 = 0.01;

/// Panels of several figures in one, each with the figure's number in its title.
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
pub fn exact(results: &Results) -> Option<Part> {
    let loops = results.loops(&["fig02"])?;
    let corners: Vec<usize> = loops.iter().map(Loop::break_points).collect();
    // the sides of a rhomboid: two slopes that alternate
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
            "A spring and a slider in series, without mass, moved by a cos(\u{3c9}t). The force is what moves the element."
                .to_owned(),
        ],
        figure: Some(Figure { title: String::new(), ..results.get("fig02")?.figure.clone() }),
        ..Section::default()
    };
    Some(Part { section, findings })
}

/// Figs. 3 and 4 with the law that the paper used.
pub fn approximate(results: &Results, further: &Further) -> Option<Part> {
    let exact = results.loops(&["fig02"])?;
    let arctan = results.loops(&["fig03a", "fig03b"])?;
    let massive = results.loops(&["fig04a", "fig04b"])?;
    let coulomb = results.loops(&["fig04a_coulomb", "fig04b_coulomb"])?;
    let excess = |a: &[Loop], b: &[Loop]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a.area / b.area - 1.0).collect() };
    let apart =
        |a: &[Loop], b: &[Loop]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a.difference(b) / LIMIT).collect() };
    let within = |values: &[f64]| in_all(&values.iter().map(|v| v.abs() <= SIMILAR).collect::<Vec<_>>());
    let (arctan_area, massive_area) = (excess(&arctan, &exact), excess(&massive, &exact));
    let both: Vec<f64> = arctan_area.iter().chain(&massive_area).copied().collect();
    let form = |a: &[Loop]| -> Vec<f64> { a.iter().zip(&exact).map(|(a, b)| b.distance(a, LIMIT)).collect() };
    let (arctan_form, massive_form) = (form(&arctan), form(&massive));
    let forms: Vec<f64> = arctan_form.iter().chain(&massive_form).copied().collect();
    let (mutual_area, mutual_form) = (excess(&massive, &arctan), apart(&massive, &arctan));
    let per_cent = |values: &[f64]| format!("{} %", list(values.iter().map(|v| 100.0 * v), 1));
    let mut findings = vec![
        finding(
            "areas very similar to the exact element",
            "Both models \u{201c}give very similar properties \u{2026} from the point of view of \u{2026} area proportional to the friction loss \
             energy\u{201d} as the exact loops of Fig. 2. (Sec. 3)",
            format!(
                "Area beyond the exact one, arctangent law: {}; with mass: {} (loops in the order of the table). {} of {} are within {}.",
                per_cent(&arctan_area),
                per_cent(&massive_area),
                both.iter().filter(|v| v.abs() <= SIMILAR).count(),
                both.len(),
                percent(SIMILAR)
            ),
            within(&both),
        ),
        finding(
            "form very similar to the exact element",
            "They are very similar \u{201c}from the point of view of hysteresis loop\u{2019}s form\u{201d}. (Sec. 3)",
            format!(
                "Largest distance between the loops, displacements in a and forces in Ft, arctangent law: {}; with mass: {}. \
                 Highest force, arctangent law: {} to {} mN; with mass: {} to {} mN.",
                per_cent(&arctan_form),
                per_cent(&massive_form),
                list([1e3 * arctan.iter().map(Loop::highest).fold(f64::NAN, f64::min)], 3),
                list([1e3 * largest(arctan.iter().map(Loop::highest))], 3),
                list([1e3 * massive.iter().map(Loop::highest).fold(f64::NAN, f64::min)], 3),
                list([1e3 * largest(massive.iter().map(Loop::highest))], 3)
            ),
            small(largest(forms.iter().copied()), APPROXIMATE, DIFFERENT),
        ),
        finding(
            "the mass changes the force only slightly",
            "With the small mass \u{201c}the excitation force is slightly different\u{201d} from that of the weightless element. (Sec. 2)",
            format!(
                "Largest difference of force between Fig. 4 and Fig. 3 up to {} of Ft; areas differ by up to {}.",
                percent(largest(mutual_form.iter().copied())),
                percent(largest(mutual_area.iter().map(|v| v.abs())))
            ),
            small(largest(mutual_form.iter().chain(&mutual_area).map(|v| v.abs())), SIMILAR, 2.0 * SIMILAR),
        ),
    ];
    if let (Some(exact), Some(arctan)) = (results.get("fig06"), results.get("fig06_arctan")) {
        let ratio = arctan.record.wall_time_s / exact.record.wall_time_s;
        findings.push(finding(
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
        ));
    }
    let microjoule = |l: &Loop| format!("{:.4}", 1e6 * l.area);
    let signed = |v: f64| format!("{:+.1}", 100.0 * v).replace('-', "\u{2212}");
    let rows = (0..exact.len().min(arctan.len()).min(massive.len()).min(coulomb.len()))
        .map(|i| {
            vec![
                format!("{}", exact[i].stiffness),
                format!("{}", 1e3 * exact[i].amplitude),
                microjoule(&exact[i]),
                microjoule(&arctan[i]),
                signed(arctan_area[i]),
                microjoule(&massive[i]),
                signed(massive_area[i]),
                microjoule(&coulomb[i]),
                signed(coulomb[i].area / exact[i].area - 1.0),
            ]
        })
        .collect();
    let areas = PageTable {
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
        rows,
    };
    let frequencies = PageTable {
        caption: "Why \u{3c9} = 1 rad/s: over the six loops, how much Fig. 4 differs from Fig. 3".to_owned(),
        header: words(&["\u{3c9} (rad/s)", "force, % of Ft", "area, %", "highest force in Fig. 4, Ft"]),
        rows: further
            .omega
            .iter()
            .map(|(omega, arctan, massive)| {
                vec![
                    format!("{omega:.4}"),
                    list([100.0 * largest(apart(massive, arctan))], 1),
                    list([100.0 * largest(excess(massive, arctan).iter().map(|v| v.abs()))], 1),
                    list([largest(massive.iter().map(Loop::highest)) / LIMIT], 2),
                ]
            })
            .collect(),
    };
    let section = Section {
        heading: "Figs. 3 and 4: the approximate elements".to_owned(),
        paragraphs: vec![
            "Fig. 3: the slider with the arctangent law, Eq. (2), \u{3b1} = 25 s/mm, without mass. Fig. 4: the same law at a mass of 2 g between \
             spring and slider. How much the arctangent rounds the loop depends on \u{3b1} a \u{3c9} alone, so the smallest \
             loop is the least similar one."
                .to_owned(),
        ],
        figure: merged(
            results,
            "",
            &[("fig03a", "Fig. 3a"), ("fig03b", "Fig. 3b"), ("fig04a", "Fig. 4a"), ("fig04b", "Fig. 4b")],
        ),
        tables: vec![areas, frequencies],
        ..Section::default()
    };
    Some(Part { section, findings })
}

/// Fig. 4 as its caption has it.
pub fn coulomb(results: &Results) -> Option<Part> {
    let loops = results.loops(&["fig04a_coulomb", "fig04b_coulomb"])?;
    let arctan = results.loops(&["fig04a", "fig04b"])?;
    let overshoot = |loops: &[Loop]| largest(loops.iter().map(Loop::highest)) / LIMIT - 1.0;
    let turns = |loops: &[Loop]| -> Vec<usize> { loops.iter().map(|l| l.turns(TURN * LIMIT)).collect() };
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
            "What the caption of Fig. 4 says, against what its text says: the loops of the element with mass when the slider obeys Coulomb\u{2019}s law."
                .to_owned(),
        ],
        figure: merged(results, "", &[("fig04a_coulomb", "Coulomb"), ("fig04b_coulomb", "Coulomb")]),
        ..Section::default()
    };
    Some(Part { section, findings })
}
