//! Datasets for the tests: similar to those of real studies, and extreme ones.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use stickslip_study::dataset::*;

fn axis(quantity: &str, unit: &str) -> Axis {
    Axis::new(quantity, unit)
}

fn series(label: &str, x: Vec<f64>, y: Vec<f64>, style: Style, colour: usize) -> Series {
    Series { label: label.into(), x, y, style, colour, ..Series::default() }
}

fn text(name: &str, values: &[&str]) -> Column {
    Column::texts(name, values.iter().map(|v| (*v).to_owned()).collect())
}

fn record(points: &[(&str, u64)]) -> Record {
    Record {
        version: "0.2.0".into(),
        study: serde_json::json!({ "parameters": { "m": 0.182, "k": 105103.0, "Ft": [2.0, 4.0, 6.0, 8.0] } }),
        methods: Vec::new(),
        seed: Some(7),
        threads: 2,
        wall_time_s: 0.125,
        points: points.iter().map(|(status, n)| ((*status).to_owned(), *n)).collect::<BTreeMap<_, _>>(),
        interrupted: false,
    }
}

/// Two orbits of two instants on a tetrahedron; its second and third node are not in the table.
pub(crate) fn motions_of_a_tetrahedron() -> Dataset {
    let deck = "*NODE\n1,0,0,0\n2,2,0,0\n3,0,3,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n";
    let mesh = stickslip_formats::mesh::read_bytes(deck.as_bytes()).unwrap();
    let table = Table {
        name: FIELDS.to_owned(),
        columns: vec![
            Column::numbers("frequency_Hz", [[10.0; 4], [20.0; 4]].concat()),
            Column::numbers("time_s", [0.0, 0.0, 0.5, 0.5].repeat(2)),
            Column { name: "node".to_owned(), values: CellValues::Integer([1, 4].repeat(4)) },
            Column::numbers("x_m", (0..8).map(f64::from).collect()),
            Column::numbers("y_m", vec![0.0; 8]),
            Column::numbers("z_m", vec![0.0; 8]),
            text("contact", &["", "slip+"].repeat(4)),
        ],
    };
    let source = MeshSource { mesh, length: 1e-3, axis: None };
    Dataset { tables: vec![table], mesh: Some(std::sync::Arc::new(source)), ..Dataset::default() }
}

pub(crate) fn all() -> Vec<Dataset> {
    vec![
        response(),
        hysteresis(),
        hostile(),
        many(),
        cases(5),
        cases(400),
        masses(),
        envelope(),
        spectrum(),
        modes(),
        ring(),
    ]
}

/// A ring: slip of its joints over frequency, and its deflection at one frequency.
pub(crate) fn ring() -> Dataset {
    let x: Vec<f64> = (0..=60).map(|i| 110.0 + 0.2 * f64::from(i)).collect();
    let shade = |joint: f64, x: f64| 100.0 * (-((x - 114.0 - 0.4 * joint) / 1.5).powi(2)).exp();
    let stripe = |joint: u32| {
        let joint = f64::from(joint);
        Series::stripe(
            x.clone(),
            joint,
            x.iter().map(|x| if *x == 116.0 { f64::NAN } else { shade(joint, *x) }).collect(),
        )
    };
    let map = Panel {
        title: "share of the period in which a joint slips".into(),
        x: Axis::new("frequency", "Hz"),
        y: Axis {
            names: (0..12).map(|j| format!("shroud_{j}")).collect(),
            ..Axis::new("joint", "").with_range(-0.5, 11.5)
        },
        series: (0..12).map(stripe).collect(),
        ..Panel::default()
    };
    let turn = |i: u32| TAU * f64::from(i) / 96.0;
    let circle = |label: &str, deflection: f64| {
        let radius = |i: u32| 1.0 + deflection * (3.0 * turn(i)).cos();
        let x = (0..=96).map(|i| radius(i) * turn(i).sin()).collect();
        Series::line(label, x, (0..=96).map(|i| radius(i) * turn(i).cos()).collect(), 0)
    };
    let wheel = Panel {
        title: "three nodal diameters".into(),
        series: vec![circle("at rest", 0.0).reference(), circle("blade", 0.3)],
        equal_axes: true,
        ..Panel::default()
    };
    let mut dataset = bare("ring", "A ring of twelve", vec![map, wheel]);
    dataset.figure.varied = Some(Axis::new("share of the period", "%").with_range(0.0, 100.0));
    dataset
}

/// Response curves of two weakly coupled blades and their contact, for four slip limits.
pub(crate) fn response() -> Dataset {
    let resonance =
        |f: f64, f0: f64, zeta: f64| 1.0 / ((1.0 - (f / f0).powi(2)).powi(2) + (2.0 * zeta * f / f0).powi(2)).sqrt();
    let f: Vec<f64> = (0..241).map(|i| 119.5 + 3.0 * f64::from(i) / 240.0).collect();
    let (mut panels, mut rows) = (Vec::new(), [const { Vec::new() }; 4]);
    let (mut peak_case, mut peak_mass, mut peak_f, mut peak_a) = (vec![], vec![], vec![], vec![]);
    for limit in [2.0, 4.0, 6.0, 8.0] {
        let zeta = 0.0008 + 0.0002 * limit;
        let a = |k: usize| -> Vec<f64> {
            let at = |f: &f64| match k {
                0 => 100.0 * 5.2 * 0.0000115 * resonance(*f, 120.95, zeta) * 2.0,
                1 => 100.0 * 3.1 * 0.0000115 * resonance(*f, 121.1 + 0.02 * limit, zeta) * 2.0,
                _ => 100.0 * 1.2 * 0.0000115 * resonance(*f, 120.8 + 0.05 * limit, 1.5 * zeta) * 2.0,
            };
            f.iter().map(at).collect()
        };
        let mut list = Vec::new();
        for (k, (name, style)) in
            [("a₁", Style::Solid), ("a₂", Style::Dashed), ("a₃", Style::Solid)].into_iter().enumerate()
        {
            let values = a(k);
            let top = (0..f.len()).max_by(|i, j| values[*i].total_cmp(&values[*j])).unwrap();
            peak_case.push(limit);
            peak_mass.push(["blade1", "contact", "blade3"][k]);
            peak_f.push(f[top]);
            peak_a.push(values[top] / 100.0);
            rows[k + 1].extend(values.iter().map(|v| v / 100.0));
            list.push(series("peak", vec![f[top]], vec![values[top]], Style::Marks, k));
            list.insert(k, series(name, f.clone(), values, style, k));
        }
        rows[0].extend(f.iter().map(|_| limit));
        panels.push(Panel {
            title: format!("Ft = {limit} N"),
            x: axis("frequency", "Hz"),
            y: axis("amplitude", "cm"),
            series: list,
            ..Panel::default()
        });
    }
    let [limits, a1, a2, a3] = rows;
    Dataset {
        mesh: None,
        name: "fig06".into(),
        title: "Response curves of the blade couple, m₁ = m/100".into(),
        source: Some("Pust, Pesek, Radolfova (2015), Fig. 6".into()),
        kind: "response".into(),
        tables: vec![
            Table {
                name: "curve".into(),
                columns: vec![
                    Column::numbers("Ft", limits),
                    Column::numbers("frequency_Hz", f.repeat(4)),
                    Column::numbers("blade1_amplitude_m", a1),
                    Column::numbers("contact_amplitude_m", a2),
                    Column::numbers("blade3_amplitude_m", a3),
                    Column { name: "stable".into(), values: CellValues::Flag(vec![Some(true); 964]) },
                    Column { name: "iterations".into(), values: CellValues::Integer(vec![4; 964]) },
                    text("status", &["converged"; 964]),
                ],
            },
            Table {
                name: "peaks".into(),
                columns: vec![
                    Column::numbers("Ft", peak_case),
                    text("mass", &peak_mass),
                    Column::numbers("frequency_Hz", peak_f),
                    Column::numbers("amplitude_m", peak_a),
                ],
            },
        ],
        figure: Figure {
            title: "Response curves of the blade couple, m₁ = m/100".into(), panels, ..Figure::default()
        },
        notes: vec!["Amplitudes are half peak to peak over one period.".into()],
        failures: vec![],
        record: record(&[("converged", 964)]),
    }
}

/// Hysteresis loops of an elastic dry-friction element: two stiffnesses, three amplitudes.
pub(crate) fn hysteresis() -> Dataset {
    let mut panels = Vec::new();
    let (mut stiffness, mut amplitude, mut loss) = (vec![], vec![], vec![]);
    for kt in [2.0, 10.0] {
        let limit = 2.0; // In mN; displacements are in mm.
        let mut list = Vec::new();
        for (k, a) in [1.0, 1.5, 2.5].into_iter().enumerate() {
            let slip = f64::min(2.0 * limit / kt, 2.0 * a);
            let x = vec![a, a - slip, -a, -a + slip, a];
            let y = vec![limit, -limit, -limit, limit, limit];
            list.push(series(&format!("a = {a} mm"), x, y, [Style::Solid, Style::Dashed, Style::Dotted][k], k));
            stiffness.push(kt);
            amplitude.push(a * 1e-3);
            loss.push(4.0 * limit * (a - limit / kt) * 1e-6);
        }
        panels.push(Panel {
            title: format!("kt = {kt} N/m"),
            x: axis("displacement", "mm"),
            y: axis("force", "mN"),
            series: list,
            ..Panel::default()
        });
    }
    Dataset {
        mesh: None,
        name: "fig02".into(),
        title: "Hysteresis loops of elastic dry friction".into(),
        source: Some("Pust, Pesek, Radolfova (2015), Fig. 2".into()),
        kind: "hysteresis".into(),
        tables: vec![Table {
            name: "loops_summary".into(),
            columns: vec![
                Column::numbers("kt", stiffness),
                Column::numbers("amplitude_m", amplitude),
                Column::numbers("dissipation_J", loss.clone()),
                Column::numbers("equivalent_stiffness_N_per_m", loss.iter().map(|e| 1.25e6 * e).collect()),
                Column::numbers("equivalent_damping_kg_per_s", loss.iter().map(|e| 3.3e3 * e).collect()),
            ],
        }],
        figure: Figure { title: "Hysteresis loops of elastic dry friction".into(), panels, ..Figure::default() },
        notes: vec![],
        failures: vec![],
        record: record(&[("converged", 6)]),
    }
}

/// Gaps, failures, empty and constant curves, huge and tiny values, characters that need
/// escaping.
pub(crate) fn hostile() -> Dataset {
    let x: Vec<f64> = (0..60).map(|i| f64::from(i) / 10.0).collect();
    let gap = |i: usize| (20..26).contains(&i) || i == 40 || i == 42;
    let wave = |a: f64| -> Vec<f64> {
        x.iter().enumerate().map(|(i, x)| if gap(i) { f64::NAN } else { a * x.sin() }).collect()
    };
    let panel = |title: &str, unit: &str, series: Vec<Series>| Panel {
        title: title.into(),
        x: axis("time", "s"),
        y: axis("x < y & \"z\"", unit),
        series,
        ..Panel::default()
    };
    let panels = vec![
        panel(
            "gaps & <failures>",
            "mm",
            vec![
                series("wave & <b>bold</b> \"q\" 'a' $x$", x.clone(), wave(1.0), Style::Solid, 0),
                series("failed", vec![2.2, 4.1], vec![0.5, -0.5], Style::Marks, 1),
            ],
        ),
        panel(
            "constant",
            "N",
            vec![
                series("zero", x.clone(), vec![0.0; 60], Style::Solid, 2),
                series("constant", x.clone(), vec![0.0; 60], Style::Dashed, 3),
            ],
        ),
        panel("huge", "Pa", vec![series("huge", x.clone(), wave(1e301), Style::Solid, 4)]),
        panel("tiny", "m", vec![series("tiny", x.clone(), wave(3e-12), Style::Dotted, 5)]),
        panel(
            "single point, a title so long that it cannot stand in one line above the panel",
            "",
            vec![series("one", vec![1.0], vec![5.0], Style::Solid, 6)],
        ),
        panel(
            "empty",
            "m",
            vec![
                series("", vec![], vec![], Style::Solid, 0),
                series("nothing", vec![f64::NAN], vec![1.0], Style::Solid, 7),
            ],
        ),
        panel(
            "offset",
            "m",
            vec![series("offset", x.clone(), x.iter().map(|x| 1e6 + 1e-3 * x).collect(), Style::Solid, 8)],
        ),
    ];
    Dataset {
        mesh: None,
        name: "hostile".into(),
        title: "Ω < ω₀ & </title><script>alert('Příčka')</script> – \"quoted\" ůž 位移, with a title whose large number of words must be broken into more than one line of text to fit".into(),
        source: Some("<i>anybody</i> & sons".into()),
        kind: "orbit".into(),
        tables: vec![
            Table { name: "peaks".into(), columns: vec![Column::numbers("frequency_Hz", vec![f64::NAN, 1e-300, 121.25]), text("mass", &["<b>", "a,b", "位移"]), Column::numbers("amplitude_m", vec![1e300, -0.0, 0.0487321])] },
            Table { name: "empty".into(), columns: vec![Column::numbers("a_m", vec![])] },
            Table { name: "none".into(), columns: vec![] },
        ],
        figure: Figure { title: "Ω < ω₀ & </title><script>alert('Příčka')</script> – \"quoted\" ůž, with a title whose large number of words must be broken into more than one line of text to fit the figure, which is not all that narrow".into(), panels, ..Figure::default() },
        notes: vec!["A <note> & more.".into()],
        failures: (0..9).map(|i| Failure { location: format!("Ft = 2 N, frequency = {} Hz", 121.0 + 0.25 * f64::from(i)),
            reason: "shooting stopped after 50 iterations, residual 3.1e-4; try more harmonics <or> start from a neighbour".into() }).collect(),
        record: record(&[("converged", 240), ("not converged", 9)]),
    }
}

/// One panel with every colour of the palette and many points.
pub(crate) fn many() -> Dataset {
    let x: Vec<f64> = (0..40_000).map(|i| f64::from(i) * 1e-4).collect();
    let list = (0..7).map(|k| {
        let y = x
            .iter()
            .map(|x| 8.0 * f64::from(k) + 3.0 * (TAU * 5.0 * x).sin() * (-x * f64::from(k) / 5.0).exp())
            .collect();
        series(&format!("mass {k}"), x.clone(), y, Style::Solid, k as usize)
    });
    Dataset {
        name: "many".into(),
        tables: vec![],
        figure: Figure {
            title: "Transient".into(),
            panels: vec![Panel {
                title: String::new(),
                x: axis("time", "s"),
                y: axis("displacement", "mm"),
                series: list.collect(),
                ..Panel::default()
            }],
            ..Figure::default()
        },
        kind: "transient".into(),
        ..hysteresis()
    }
}

/// Amplitude of one mass under a unit force, relative to its static displacement.
fn resonance(f: f64, f0: f64, zeta: f64) -> f64 {
    1.0 / ((1.0 - (f / f0).powi(2)).powi(2) + (2.0 * zeta * f / f0).powi(2)).sqrt()
}

fn bare(name: &str, title: &str, panels: Vec<Panel>) -> Dataset {
    Dataset {
        name: name.into(),
        title: title.into(),
        tables: vec![],
        figure: Figure { title: title.into(), panels, ..Figure::default() },
        ..hysteresis()
    }
}

/// Overlaid response curves for `count` slip limits with peaks, between the free and the stuck
/// curve.
pub(crate) fn cases(count: usize) -> Dataset {
    let f: Vec<f64> = (0..300).map(|i| 100.0 + 0.2 * f64::from(i)).collect();
    let curve = |f0: f64, zeta: f64| f.iter().map(|f| 0.1 * resonance(*f, f0, zeta)).collect::<Vec<f64>>();
    let mut list = Vec::new();
    for k in 0..count {
        let part = k as f64 / count as f64;
        let limit = (k + 1) as f64;
        let y = curve(120.0 + 20.0 * part, 0.012 + 0.12 * part * (1.0 - part));
        let top = (0..y.len()).max_by(|i, j| y[*i].total_cmp(&y[*j])).unwrap();
        list.push(Series::marks("peak", vec![f[top]], vec![y[top]], k).with_value(limit));
        list.push(Series::line(format!("Ft = {limit} N"), f.clone(), y, k).with_value(limit));
    }
    list.push(Series::line("free", f.clone(), curve(120.0, 0.001), 0).reference());
    list.push(Series { style: Style::Dotted, ..Series::line("stuck", f.clone(), curve(140.0, 0.004), 0).reference() });
    let panel = Panel {
        title: "blade".into(),
        x: axis("frequency", "Hz"),
        y: axis("amplitude", "mm"),
        series: list,
        ..Panel::default()
    };
    let mut dataset =
        bare(&format!("cases{count}"), "Response of a blade under a damper, slip limits compared", vec![panel]);
    dataset.figure.varied = Some(axis("Ft", "N"));
    dataset
}

/// Panels by mass on common axes, coloured by twelve contact stiffnesses in a geometric
/// sequence.
///
/// The labels name the masses.
pub(crate) fn masses() -> Dataset {
    let f: Vec<f64> = (0..300).map(|i| 100.0 + 0.2 * f64::from(i)).collect();
    let panel = |name: &str, height: f64| {
        let list = (0..12).map(|k| {
            let y = f.iter().map(|f| height * resonance(*f, 115.0 + 2.5 * f64::from(k), 0.02)).collect();
            Series::line(name, f.clone(), y, k as usize).with_value(f64::from(1u32 << k))
        });
        Panel {
            title: name.into(),
            x: axis("frequency", "Hz"),
            y: axis("amplitude", "mm"),
            series: list.collect(),
            ..Panel::default()
        }
    };
    let panels = vec![panel("blade", 1.0), panel("contact", 0.04), panel("shroud", 0.3)];
    let mut dataset = bare("masses", "Influence of the contact stiffness on all masses", panels);
    dataset.figure.varied = Some(axis("kt", "N/mm").log());
    dataset.figure.sharing = Sharing::Always;
    dataset
}

/// The largest of many blades over the single blades, on a logarithmic axis with a fixed range.
///
/// A second panel shows percentiles of a random sample.
pub(crate) fn envelope() -> Dataset {
    let f: Vec<f64> = (0..300).map(|i| 100.0 + 0.2 * f64::from(i)).collect();
    let blades: Vec<Vec<f64>> = (0..48)
        .map(|k| f.iter().map(|f| 0.1 * resonance(*f, 125.0 + 8.0 * (f64::from(k) * 2.4).sin(), 0.004)).collect())
        .collect();
    let largest: Vec<f64> = (0..f.len()).map(|i| blades.iter().map(|b| b[i]).fold(0.0, f64::max)).collect();
    let mut list: Vec<Series> =
        blades.iter().map(|b| Series::line("single blades", f.clone(), b.clone(), 0).pale()).collect();
    list.push(Series::line("largest (blade 17)", f.clone(), largest.clone(), 1));
    let first = Panel {
        title: "48 blades".into(),
        x: axis("frequency", "Hz").with_range(110.0, 140.0),
        y: axis("amplitude", "mm").log().with_range(0.1, 10.0),
        series: list,
        ..Panel::default()
    };
    let scaled = |by: f64| largest.iter().map(|v| by * v).collect::<Vec<f64>>();
    let second = Panel {
        title: "random stiffness".into(),
        x: axis("frequency", "Hz"),
        y: axis("amplitude", "mm"),
        series: vec![
            Series::line("median", f.clone(), scaled(0.5), 2),
            Series::band("5 % to 95 %", f.clone(), scaled(0.3), scaled(0.9), 2),
        ],
        ..Panel::default()
    };
    bare("envelope", "Mistuned ring of 48 blades", vec![first, second])
}

/// Harmonics of three masses as bars.
pub(crate) fn spectrum() -> Dataset {
    let order: Vec<f64> = (1..=9).map(f64::from).collect();
    let list = ["blade 1", "blade 2", "contact"].iter().enumerate().map(|(k, name)| {
        let y = order.iter().map(|n| (3.0 + k as f64) / n.powi(2)).collect();
        Series::bars(*name, order.clone(), y, k)
    });
    let panel = Panel {
        title: String::new(),
        x: axis("harmonic", ""),
        y: axis("amplitude", "µm"),
        series: list.collect(),
        ..Panel::default()
    };
    bare("spectrum", "Harmonics of the motion", vec![panel])
}

/// Frequency, damping and dissipation of nonlinear modes over four decades of amplitude.
pub(crate) fn modes() -> Dataset {
    let a: Vec<f64> = (0..=80).map(|i| 10f64.powf(-2.0 + f64::from(i) / 20.0)).collect();
    let panel = |quantity: &str, unit: &str, y: &dyn Fn(f64) -> f64| Panel {
        title: quantity.into(),
        x: axis("amplitude", "µm").log(),
        y: axis(quantity, unit),
        series: vec![Series::line("mode 1", a.clone(), a.iter().map(|a| y(*a)).collect(), 0)],
        ..Panel::default()
    };
    let mut panels = vec![
        panel("frequency", "Hz", &|a| 120.0 + 20.0 / (1.0 + a)),
        panel("damping ratio", "%", &|a| 5.0 * a / (1.0 + a * a)),
        panel("dissipation", "J", &|a| 1e-9 * a * a / (1.0 + a)),
    ];
    panels[2].y = axis("dissipation per cycle, all joints of the ring together with the tip shroud", "J").log();
    bare("modes", "Nonlinear modes", panels)
}
