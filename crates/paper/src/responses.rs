//! Figs. 6-8 and 10: the response of the blade couple, and the paper's claims about it.

use crate::additional_cases::AdditionalCases;
use crate::finding::{Finding, ReportPart, finding};
use crate::measure::{Curve, largest};
use crate::optimum::{self, Optimum};
use crate::studies::Results;
use crate::text::{list, percent, words};
use crate::verdict::{APPROXIMATE, DIFFERENT, PRINTED, SIMILAR, both, in_all, monotone, small};
use std::f64::consts::TAU;
use stickslip::model::Model;
use stickslip_report::{PageTable, Section, Verdict};
use stickslip_study::dataset::{Axis, Figure, Panel, Series, Style};

/// Indices of the masses of the couple, in the order of the study files.
const BLADE1: usize = 0;
const CONTACT: usize = 1;
const BLADE3: usize = 2;
/// The other blade of the symmetric couple.
const BLADE4: usize = 3;

/// Returns the peak amplitudes of one mass over the slip limits in cm.
fn heights(curves: &[Curve], mass: usize) -> Vec<f64> {
    curves.iter().map(|curve| 100.0 * curve.peak[mass].amplitude).collect()
}

/// Returns the peak frequencies of one mass over the slip limits in Hz.
fn frequencies(curves: &[Curve], mass: usize) -> Vec<f64> {
    curves.iter().map(|curve| curve.peak[mass].frequency).collect()
}

/// Returns the peak frequency of mass `above` minus that of mass `below` in Hz, per slip limit.
fn shifts(curves: &[Curve], above: usize, below: usize) -> Vec<f64> {
    frequencies(curves, above).iter().zip(frequencies(curves, below)).map(|(a, b)| a - b).collect()
}

fn limits(curves: &[Curve]) -> String {
    let limits: Vec<String> = curves.iter().map(|curve| format!("{}", curve.limit)).collect();
    format!("Ft = {} N", limits.join(", "))
}

/// Compares the frequencies with the printed value.
fn printed(frequencies: &[f64], value: f64) -> Verdict {
    in_all(&frequencies.iter().map(|f| (f - value).abs() <= PRINTED).collect::<Vec<_>>())
}

/// Returns the peaks as a table.
fn peaks(caption: &str, curves: &[Curve], masses: &[(&str, usize)]) -> PageTable {
    let mut header = vec!["Ft (N)".to_owned()];
    for (name, _) in masses {
        header.extend([format!("{name} (cm)"), "at (Hz)".to_owned()]);
    }
    let row = |curve: &Curve| {
        let mut row = vec![format!("{}", curve.limit)];
        for (_, mass) in masses {
            row.extend([list([100.0 * curve.peak[*mass].amplitude], 4), list([curve.peak[*mass].frequency], 3)]);
        }
        row
    };
    PageTable { caption: caption.to_owned(), header, rows: curves.iter().map(row).collect() }
}

const MASSES: [(&str, usize); 3] = [("a1", BLADE1), ("a2", CONTACT), ("a3", BLADE3)];

fn section(results: &Results, name: &str, heading: &str, paragraph: &str) -> Option<Section> {
    Some(Section {
        heading: heading.to_owned(),
        paragraphs: vec![paragraph.to_owned()],
        figure: Some(Figure { title: String::new(), ..results.get(name)?.figure.clone() }),
        ..Section::default()
    })
}

/// Returns the mass with this name in a model, in kg.
fn mass_of(model: &Model, name: &str) -> Option<f64> {
    model.masses.iter().find(|mass| mass.name == name).map(|mass| mass.mass)
}

/// Checks the claim that a1 falls, and states the slip limit at which it rises again.
fn falling(curves: &[Curve], optimum: Option<&Optimum>) -> (String, Verdict) {
    let mut measured = format!("Peak of a1 at {}: {} cm.", limits(curves), list(heights(curves, BLADE1), 3));
    let mut verdict = monotone(&heights(curves, BLADE1), -1.0);
    if let Some(optimum) = optimum
        && optimum.interior
    {
        measured += &format!(
            " Lowest at Ft = {:.3} N with {:.4} cm; beyond, it rises again to {:.2} cm at {} N.",
            optimum.lowest.0,
            100.0 * optimum.lowest.1,
            100.0 * optimum.peaks[optimum.peaks.len() - 1],
            optimum.limits[optimum.limits.len() - 1]
        );
        let range = curves.last().map_or(0.0, |curve| curve.limit);
        if verdict == Verdict::Holds && optimum.lowest.0 <= range {
            verdict = Verdict::HoldsWithQualification;
        }
    }
    (measured, verdict)
}

/// Fig. 6.
pub fn figure6(results: &Results, additional: &AdditionalCases) -> Option<ReportPart> {
    let curves = results.curves("fig06")?;
    let (a2, a3) = (heights(&curves, CONTACT), heights(&curves, BLADE3));
    let (f1, f3) = (frequencies(&curves, BLADE1), frequencies(&curves, BLADE3));
    let at = limits(&curves);
    let model = results.model("fig06")?;
    let (blade, small_mass) = (mass_of(&model, "blade1")?, mass_of(&model, "contact")?);
    let stiffness = model.springs.first()?.stiffness;
    let first = (stiffness / blade).sqrt() / TAU;
    let second = (stiffness / (blade + small_mass)).sqrt() / TAU;
    let mut findings = vec![
        finding(
            "two peaks, at 121.25 Hz and 120.75 Hz",
            "\u{201c}There are two response peaks, at the frequencies fr = 121.25 Hz and fr = 120.75 Hz.\u{201d} (Sec. 4)",
            format!(
                "{at}: a1 peaks at {} Hz, a3 at {} Hz. (The first number determines the inferred k, so a1 at 2 \
                 N is not an independent test.)",
                list(f1.iter().copied(), 3),
                list(f3.iter().copied(), 3)
            ),
            both(printed(&f1, 121.25), printed(&f3, 120.75)),
        ),
        finding(
            "121.25 Hz is the eigenfrequency of the excited body m - m1/2",
            "The first peak \u{201c}corresponds to the eigenfrequency of the first excited body with mass m \u{2212} m1/2\u{201d}. (Sec. 4)",
            format!(
                "√(k/(m − m1/2))/2π = {first:.4} Hz with the inferred k; the peak of a1 deviates by {} Hz ({at}).",
                list(f1.iter().map(|f| f - first), 3)
            ),
            in_all(&f1.iter().map(|f| (f - first).abs() <= PRINTED).collect::<Vec<_>>()),
        ),
        finding(
            "120.75 Hz is that of the connected bodies m + m1/2",
            "The second peak \u{201c}is given by connected bodies m + m1/2\u{201d}. (Sec. 4)",
            format!(
                "√(k/(m + m1/2))/2π = {second:.4} Hz; the peak of a3 deviates by {} Hz ({at}).",
                list(f3.iter().map(|f| f - second), 3)
            ),
            in_all(&f3.iter().map(|f| (f - second).abs() <= PRINTED).collect::<Vec<_>>()),
        ),
    ];
    let (measured, verdict) = falling(&curves, additional.couple.as_ref());
    findings.push(finding(
        "a1 falls with Ft",
        "\u{201c}The increasing value of the dry friction slipping force Ft0 causes a decrease of amplitudes a1 of the excited blades.\u{201d} \
         (Sec. 4)",
        measured,
        verdict,
    ));
    findings.push(finding(
        "a2 and a3 rise with Ft",
        "\u{201c}The peaks of these dashed lines together with the peaks of the lower response curves increase with higher dry friction slipping \
         force.\u{201d} (Sec. 4)",
        format!("{at}: a2 {} cm, a3 {} cm.", list(a2.iter().copied(), 3), list(a3.iter().copied(), 3)),
        both(monotone(&a2, 1.0), monotone(&a3, 1.0)),
    ));
    findings.push(close_at_the_highest(&curves, "at 8 N all amplitudes are close",
        "\u{201c}For the highest friction force Ft0 = 8 N they overlap with the peak of curve a1 and the investigated system vibrates approximately \
         with very similar amplitudes in the entire frequency resonance range.\u{201d} (Sec. 4)")?);
    findings.extend(stiffness_claims(&curves, &additional.stiffness));
    let section = Section {
        tables: vec![peaks("Refined peaks", &curves, &MASSES)],
        ..section(
            results,
            "fig06",
            "Fig. 6: response of the couple, m1 = m/100",
            "blade1 is the excited blade (the paper\u{2019}s a1), contact the small mass m1 (a2, dashed), blade3 the other blade (a3). Amplitudes are \
             half of peak to peak; peaks are maximised over frequency.",
        )?
    };
    Some(ReportPart { section, findings })
}

fn close_at_the_highest(curves: &[Curve], name: &'static str, text: &str) -> Option<Finding> {
    let last = curves.last()?;
    let (spread, frequency) = last.spread();
    let verdict = match (small(last.peak_spread(), APPROXIMATE, DIFFERENT), small(spread, APPROXIMATE, DIFFERENT)) {
        (Verdict::Holds, Verdict::Holds) => Verdict::Holds,
        (Verdict::DoesNotHold, _) => Verdict::DoesNotHold,
        _ => Verdict::HoldsWithQualification,
    };
    Some(finding(
        name,
        text,
        format!(
            "At {} N the peaks are {} cm and agree within {}; away from the peak the amplitudes differ by up to \
             {} of it, at {frequency:.2} Hz.",
            last.limit,
            list(last.peak.iter().map(|peak| 100.0 * peak.amplitude), 3),
            percent(last.peak_spread()),
            percent(spread)
        ),
        verdict,
    ))
}

/// Checks the claims about `kt`.
fn stiffness_claims(curves: &[Curve], additional: &[(f64, Vec<Curve>)]) -> Vec<Finding> {
    // Largest difference between a2 and a3 relative to the peak of a3, at each slip limit.
    let apart = |curve: &Curve| {
        let pairs = curve.amplitude[CONTACT].iter().zip(&curve.amplitude[BLADE3]);
        largest(pairs.map(|(a, b)| (a - b).abs())) / curve.peak[BLADE3].amplitude
    };
    let ratio = |curve: &Curve| curve.peak[CONTACT].amplitude / curve.peak[BLADE3].amplitude - 1.0;
    let mut findings = Vec::new();
    if additional.len() > 1 {
        let worst: Vec<f64> = additional.iter().map(|(_, curves)| largest(curves.iter().map(ratio))).collect();
        findings.push(finding(
            "kt influences the difference of a2 and a3",
            "\u{201c}The stiffness kt influences the difference between response curves a2 of the small middle body and a3 of the non-excited body.\u{201d} \
             (Sec. 4)",
            format!(
                "kt = {} N/m: the peak of a2 is higher than that of a3 by up to {}.",
                list(additional.iter().map(|f| f.0), 0),
                worst.iter().map(|v| percent(*v)).collect::<Vec<_>>().join(", ")
            ),
            monotone(&worst, -1.0),
        ));
    }
    let (peaks, whole): (Vec<f64>, Vec<f64>) = curves.iter().map(|curve| (ratio(curve), apart(curve))).unzip();
    let verdict = match (small(largest(peaks.iter().copied()), APPROXIMATE, DIFFERENT), largest(whole.iter().copied()))
    {
        (Verdict::Holds, whole) if whole <= APPROXIMATE => Verdict::Holds,
        (Verdict::DoesNotHold, _) => Verdict::DoesNotHold,
        _ => Verdict::HoldsWithQualification,
    };
    findings.push(finding(
        "a2 and a3 lie near each other at kt = 10000 N/m",
        "\u{201c}As the stiffness kt = 10000 kg/s\u{b2} is very high in this case, both curves \u{2026} lie near each other.\u{201d} (Sec. 4)",
        format!(
            "Peaks of a2 are {} above those of a3 ({}); anywhere in the range the two differ by up to {} of the peak of a3.",
            peaks.iter().map(|v| percent(*v)).collect::<Vec<_>>().join(", "),
            limits(curves),
            percent(largest(whole.iter().copied()))
        ),
        verdict,
    ));
    findings
}

/// Fig. 7.
pub fn figure7(results: &Results, additional: &AdditionalCases) -> Option<ReportPart> {
    let curves = results.curves("fig07")?;
    let heavy = results.curves("fig06")?;
    let at = limits(&curves);
    let (here, before) = (shifts(&curves, BLADE1, BLADE3), shifts(&heavy, BLADE1, BLADE3));
    let apart = here.iter().map(|shift| *shift > 0.0).collect::<Vec<_>>();
    let nearer = here.iter().zip(&before).map(|(a, b)| a.abs() < b.abs()).collect::<Vec<_>>();
    let (measured, verdict) = falling(&curves, additional.light.as_ref());
    let (a2, a3) = (heights(&curves, CONTACT), heights(&curves, BLADE3));
    let top = largest(curves.iter().chain(&heavy).map(Curve::highest));
    let findings = vec![
        finding(
            "again two peaks, a1 above a2 and a3",
            "\u{201c}Again, there exist two response peaks, one at the response curve a1 \u{2026} and the second one of the closely joined bodies.\u{201d} \
             (Sec. 4)",
            format!(
                "{at}: a1 peaks at {} Hz, a3 at {} Hz.",
                list(frequencies(&curves, BLADE1), 3),
                list(frequencies(&curves, BLADE3), 3)
            ),
            in_all(&apart),
        ),
        finding(
            "m/200 moves the peaks together",
            "\u{201c}Due to the smaller body mass m1, the frequency difference between these peaks is smaller than in the previous case.\u{201d} \
             (Sec. 4)",
            format!(
                "{at}: the peaks of a1 and a3 are {} Hz apart, with m1 = m/100 {} Hz.",
                list(here.iter().copied(), 3),
                list(before.iter().copied(), 3)
            ),
            in_all(&nearer),
        ),
        finding(
            "the peak of a1 falls with Ft",
            "\u{201c}The maximum amplitude a1 of the excited body decreases with increasing dry friction force.\u{201d} (Sec. 4)",
            measured,
            verdict,
        ),
        finding(
            "the peaks of a2 and a3 rise simultaneously",
            "\u{201c}\u{2026} but the maximum of amplitudes a2, a3 increase simultaneously.\u{201d} (Sec. 4)",
            format!("{at}: a2 {} cm, a3 {} cm.", list(a2.iter().copied(), 3), list(a3.iter().copied(), 3)),
            both(monotone(&a2, 1.0), monotone(&a3, 1.0)),
        ),
        close_at_the_highest(
            &curves,
            "a narrow bunch of curves at 8 N",
            "\u{201c}All curves form a narrow bunch of response curves at the highest friction force Ft0 = 8 N.\u{201d} (Sec. 4)",
        )?,
        finding(
            "amplitudes up to 5 cm",
            "\u{201c}The results \u{2026} in Fig. 6 and Fig. 7 seem not to be realistic, as the gained amplitudes of vibrations up to 5 cm cannot occur in a \
             real turbine.\u{201d} (Sec. 4)",
            format!(
                "Highest peak of both figures: {:.3} cm. (It determines the inferred b, so this is not an \
                 independent test.)",
                100.0 * top
            ),
            small(top / 0.05 - 1.0, SIMILAR, APPROXIMATE),
        ),
    ];
    let section = Section {
        tables: vec![peaks("Refined peaks", &curves, &MASSES)],
        ..section(
            results,
            "fig07",
            "Fig. 7: response of the couple, m1 = m/200",
            "As Fig. 6, with half the mass of the deformed parts.",
        )?
    };
    Some(ReportPart { section, findings })
}

/// The conclusion about all parameters.
pub fn dependence(results: &Results, additional: &AdditionalCases) -> Option<ReportPart> {
    let (heavy, light) = (results.curves("fig06")?, results.curves("fig07")?);
    let model = results.model("fig06")?;
    // Half-power width of a blade's resonance in Hz.
    let width = model.springs.first()?.damping / (TAU * mass_of(&model, "blade1")?);
    let double = additional.stiffness.iter().find(|(kt, _)| *kt == 2e4).map(|(_, curves)| curves)?;
    let changes = [("Ft doubled", heavy.get(1)?), ("kt doubled", double.first()?), ("m1 halved", light.first()?)];
    let base = heavy.first()?;
    let mut strong = Vec::new();
    let mut rows = Vec::new();
    for (what, curve) in changes {
        let mut row = vec![what.to_owned()];
        let mut most = (0.0f64, 0.0f64);
        for (_, mass) in MASSES {
            let (height, shift) = (
                curve.peak[mass].amplitude / base.peak[mass].amplitude - 1.0,
                curve.peak[mass].frequency - base.peak[mass].frequency,
            );
            most = (most.0.max(height.abs()), most.1.max(shift.abs()));
            row.extend([format!("{:+.1}", 100.0 * height), format!("{shift:+.3}")]);
        }
        strong.extend([most.0 > DIFFERENT, most.1 > 0.5 * width]);
        rows.push(row.into_iter().map(|cell| cell.replace('-', "\u{2212}")).collect());
    }
    let findings = vec![finding(
        "heights and positions depend strongly on all parameters",
        "\u{201c}Their heights and positions strongly depend on all parameters of 3V characteristic of connecting element.\u{201d} (Sec. 6)",
        format!(
            "Starting from Fig. 6 at Ft = 2 N, each of Ft, kt and m1 changes by a factor of two. {} of 6 \
             largest changes are strong: more than {} in height, or more than half the half-power width ({:.3} \
             Hz) in frequency.",
            strong.iter().filter(|s| **s).count(),
            percent(DIFFERENT),
            0.5 * width
        ),
        in_all(&strong),
    )];
    let section = Section {
        heading: "What the peaks depend on".to_owned(),
        tables: vec![PageTable {
            caption: "Change of the refined peaks of Fig. 6 at Ft = 2 N".to_owned(),
            header: words(&["change", "a1, %", "Hz", "a2, %", "Hz", "a3, %", "Hz"]),
            rows,
        }],
        ..Section::default()
    };
    Some(ReportPart { section, findings })
}

/// Returns the largest difference between one figure and ten times another with a tenth of the
/// forces.
fn scaled_difference(results: &Results, large: &str, small: &str) -> Option<f64> {
    let (large, small) = (results.curves(large)?, results.curves(small)?);
    (large.len() == small.len()).then(|| largest(large.iter().zip(&small).map(|(a, b)| a.difference(b, 10.0))))
}

/// Fig. 8.
pub fn figure8(results: &Results) -> Option<ReportPart> {
    let exact = scaled_difference(results, "fig06", "fig08")?;
    let mut findings = vec![finding(
        "ten times smaller forces give the same picture",
        "\u{201c}For ten times lower forces \u{2026} the amplitudes reduce as well, but the character of the responses remain similar.\u{201d} (Sec. 4)",
        format!("Ten times Fig. 8 and Fig. 6 differ by {exact:.1e} of the highest peak (exact Coulomb friction)."),
        small(exact, SIMILAR, APPROXIMATE),
    )];
    if let (Some(kept), Some(scaled)) = (
        scaled_difference(results, "fig06_arctan", "fig08_arctan"),
        scaled_difference(results, "fig06_arctan", "fig08_arctan_similar"),
    ) {
        findings.push(finding(
            "the ratio F0/Ft is the condition of similarity",
            "\u{201c}\u{2026} valid also for vibration with small amplitudes, of course when the conditions of physical similarity such as the ratio \
             of forces F0/Ft0 are fulfilled.\u{201d} (Sec. 4)",
            format!(
                "With the paper’s arctangent law, α F0/√(km) is also a condition. Difference to Fig. 6, \
                 relative to the highest peak of its panel: {kept:.1e} with α = 25 s/mm, {scaled:.1e} with α = \
                 250 s/mm."
            ),
            // Relative difference below which two curves are similar: smooth orbits have an
            // error of about 1e-7.
            small(kept, 1e-6, SIMILAR),
        ));
    }
    let section = section(
        results,
        "fig08",
        "Fig. 8: a tenth of the forces",
        "F0 = 1 N and Ft = 0.2 to 0.8 N instead of 10 N and 2 to 8 N.",
    )?;
    Some(ReportPart { section, findings })
}

/// Fig. 10.
pub fn figure10(results: &Results) -> Option<ReportPart> {
    let symmetric = results.curves("fig10")?;
    let couple = results.curves("fig06")?;
    let at = limits(&symmetric);
    let (here, before) = (shifts(&symmetric, BLADE1, BLADE4), shifts(&couple, BLADE1, BLADE3));
    // Tolerance in Hz for equal peak frequencies: about 1/20 of the half-power width (0.17 Hz).
    let removed: Vec<bool> = here.iter().map(|shift| shift.abs() <= 0.01).collect();
    let first =
        |curves: &[Curve], mass: usize| curves.first().map_or(f64::NAN, |curve| 100.0 * curve.peak[mass].amplitude);
    let excited = first(&symmetric, BLADE1) / first(&couple, BLADE1) - 1.0;
    let other = first(&symmetric, BLADE4) / first(&couple, BLADE3) - 1.0;
    let model = results.model("fig10")?;
    let (ground, force) = (model.springs.first()?, model.forces.first()?);
    let mass = mass_of(&model, "blade1")? + mass_of(&model, "contact2")?;
    let floor = 100.0 * force.amplitude / (2.0 * ground.damping * (ground.stiffness / mass).sqrt());
    let excess: Vec<f64> =
        heights(&symmetric, BLADE1).iter().zip(heights(&couple, BLADE1)).map(|(s, c)| s / c - 1.0).collect();
    let findings = vec![
        finding(
            "the symmetric element removes the frequency shift",
            "\u{201c}This frequency shift can be removed by the application of a more exact slip-stick friction connection\u{201d}; both bodies have \
             \u{201c}the same resonant frequencies\u{201d}. (Sec. 5)",
            format!(
                "{at}: the peaks of the two blades are {} Hz apart, with the non-symmetric element {} Hz. Symmetric: blade1 at {} Hz, blade4 at {} Hz.",
                list(here.iter().copied(), 4),
                list(before.iter().copied(), 3),
                list(frequencies(&symmetric, BLADE1), 3),
                list(frequencies(&symmetric, BLADE4), 3)
            ),
            in_all(&removed),
        ),
        finding(
            "peak amplitudes are similar to the first panel of Fig. 6",
            "\u{201c}Comparing the last figure with the first subfigure in Fig. 6 \u{2026} the peak amplitudes of response curves with the symmetric and \
             non-symmetric friction elements are similar.\u{201d} (Sec. 5)",
            format!(
                "Ft = 2 N: excited blade {:.3} cm, in Fig. 6 {:.3} cm ({}); other blade {:.3} cm, in Fig. 6 \
                 {:.3} cm ({}).",
                first(&symmetric, BLADE1),
                first(&couple, BLADE1),
                percent(excited),
                first(&symmetric, BLADE4),
                first(&couple, BLADE3),
                percent(other)
            ),
            in_all(&[excited.abs() <= APPROXIMATE, other.abs() <= APPROXIMATE]),
        ),
        finding(
            "the damping effect of both is approximately the same",
            "\u{201c}The courses of responses in both cases are different, but the damping effect of symmetric and non-symmetric structure are \
             approximately the same.\u{201d} (Sec. 5)",
            format!(
                "{at}: peak of the excited blade {} cm symmetric, {} cm non-symmetric; excess {}. Friction \
                 between equal blades damps only their relative motion; their common motion alone has a peak of \
                 F0/(2 b ω0) = {floor:.2} cm.",
                list(heights(&symmetric, BLADE1), 3),
                list(heights(&couple, BLADE1), 3),
                excess.iter().map(|v| percent(*v)).collect::<Vec<_>>().join(", ")
            ),
            small(largest(excess.iter().map(|v| v.abs())), APPROXIMATE, DIFFERENT),
        ),
    ];
    let section = Section {
        tables: vec![peaks(
            "Refined peaks",
            &symmetric,
            &[("a1", BLADE1), ("a2", CONTACT), ("a3", BLADE3), ("a4", BLADE4)],
        )],
        ..section(
            results,
            "fig10",
            "Fig. 10: the symmetric element",
            "A spring and a small mass m1/2 on each side, friction between the small masses (Fig. 9). Dashed: the small masses.",
        )?
    };
    Some(ReportPart { section, findings })
}

/// The peak over the slip limit; the paper's four values are samples of this curve.
pub fn optimum(additional: &AdditionalCases) -> Option<ReportPart> {
    let (couple, light, symmetric) =
        (additional.couple.as_ref()?, additional.light.as_ref()?, additional.symmetric.as_ref()?);
    let rows = (0..couple.limits.len())
        .map(|i| {
            let mut row = vec![format!("{}", couple.limits[i])];
            row.extend([couple, light, symmetric].map(|curve| list([100.0 * curve.peaks[i]], 3)));
            row
        })
        .collect();
    let lowest = |curve: &Optimum| {
        if curve.interior {
            format!("lowest {:.4} cm at Ft = {:.3} N", 100.0 * curve.lowest.1, curve.lowest.0)
        } else {
            format!("no minimum inside the range, lowest value {:.4} cm", 100.0 * curve.lowest.1)
        }
    };
    let section = Section {
        heading: "Which slip limit damps best".to_owned(),
        paragraphs: vec![format!(
            "The paper\u{2019}s four slip limits are samples of these curves. m1 = m/100: {}; m1 = m/200: {}; symmetric element: {}.",
            lowest(couple),
            lowest(light),
            lowest(symmetric)
        )],
        figure: Some(optimum::figure(&[
            ("m1 = m/100", couple),
            ("m1 = m/200", light),
            ("symmetric element", symmetric),
        ])),
        tables: vec![PageTable {
            caption: "Highest peak of the excited blade (cm)".to_owned(),
            header: words(&["Ft (N)", "m1 = m/100", "m1 = m/200", "symmetric"]),
            rows,
        }],
        ..Section::default()
    };
    Some(ReportPart { section, findings: Vec::new() })
}

/// The arctangent law compared with the exact law.
pub fn laws(results: &Results) -> Option<ReportPart> {
    let mut rows = Vec::new();
    let mut worst = Vec::new();
    for (figure, exact, arctan) in [
        ("Fig. 6", "fig06", "fig06_arctan"),
        ("Fig. 7", "fig07", "fig07_arctan"),
        ("Fig. 8", "fig08", "fig08_arctan"),
        ("Fig. 8, 250 s/mm", "fig08", "fig08_arctan_similar"),
        ("Fig. 10", "fig10", "fig10_arctan"),
    ] {
        let (Some(exact), Some(arctan)) = (results.curves(exact), results.curves(arctan)) else { continue };
        for (a, b) in exact.iter().zip(&arctan) {
            let pairs = || a.peak.iter().zip(&b.peak);
            let height = largest(pairs().map(|(a, b)| (b.amplitude / a.amplitude - 1.0).abs()));
            let place = largest(pairs().map(|(a, b)| (b.frequency - a.frequency).abs()));
            worst.push((a.difference(b, 1.0), height));
            rows.push(vec![
                figure.to_owned(),
                format!("{}", a.limit),
                format!("{:.4}", 100.0 * a.difference(b, 1.0)),
                format!("{:.4}", 100.0 * height),
                format!("{:.1e}", place),
            ]);
        }
    }
    let curves = largest(worst.iter().map(|w| w.0));
    let heights = largest(worst.iter().map(|w| w.1));
    let (exact, arctan) = (results.curves("fig06")?, results.curves("fig06_arctan")?);
    let panels = exact.iter().zip(&arctan).map(|(a, b)| Panel {
        title: format!("Ft = {} N", a.limit),
        x: Axis::new("frequency", "Hz"),
        y: Axis::new("arctangent \u{2212} exact", "mm"),
        series: ["blade1", "contact", "blade3"]
            .iter()
            .enumerate()
            .map(|(mass, name)| Series {
                label: (*name).to_owned(),
                x: a.frequency.clone(),
                y: b.amplitude[mass].iter().zip(&a.amplitude[mass]).map(|(b, a)| 1e3 * (b - a)).collect(),
                style: if mass == CONTACT { Style::Dashed } else { Style::Solid },
                colour: mass,
                ..Series::default()
            })
            .collect(),
        ..Panel::default()
    });
    let figure = Figure {
        title: "Fig. 6 in the arctangent law minus Fig. 6 in the exact law".to_owned(),
        panels: panels.collect(),
        ..Figure::default()
    };
    let findings = vec![finding(
        "alpha = 25 s/mm is sufficiently great",
        "\u{201c}\u{2026} with sufficiently great parameter \u{3b1} = 25 s/mm guaranteeing appropriate similarity to the exact Coulomb dry friction \
         characteristic.\u{201d} (Sec. 4)",
        format!(
            "Over Figs. 6, 7, 8 and 10 the amplitudes of the two laws differ by up to {} of the highest peak of their panel, the peaks themselves by up to {}.",
            percent(curves),
            percent(heights)
        ),
        small(largest([curves, heights]), SIMILAR, APPROXIMATE),
    )];
    let section = Section {
        heading: "The arctangent law against exact Coulomb friction".to_owned(),
        figure: Some(figure),
        tables: vec![PageTable {
            caption: "Largest differences between the two laws".to_owned(),
            header: words(&[
                "figure",
                "Ft (N)",
                "curves, % of the highest peak",
                "peak amplitudes, %",
                "peak frequencies, Hz",
            ]),
            rows,
        }],
        ..Section::default()
    };
    Some(ReportPart { section, findings })
}
