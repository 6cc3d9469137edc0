//! Identification from the data of random models with noise. The models are computed here, without
//! the library: sums of sliders, closed forms, and the classical Runge-Kutta method.
//!
//! `STICKSLIP_MODELS` sets the number of models, by default one of each family but the responses,
//! which take half a minute. `STICKSLIP_FAMILY` selects one family by its number from 0.

#![allow(clippy::print_stdout)] // tests print their measurements

use super::identify::{Noise, estimate, identify_in};
use std::f64::consts::TAU;
use std::fmt::Write;
use stickslip_study::kinds::identify::Residuals;

/// A fitted parameter.
struct Truth {
    name: &'static str,
    value: f64,
    unit: &'static str,
    is_determined: bool,
}

/// A model with its data.
struct Synthetic {
    head: &'static str,
    rows: Vec<Vec<f64>>,
    /// Columns with noise, and their largest value in the group.
    noisy: &'static [usize],
    truth: Vec<Truth>,
    law: &'static str,
    target: &'static str,
}

fn truth(name: &'static str, value: f64, unit: &'static str) -> Truth {
    Truth { name, value, unit, is_determined: true }
}

/// Displacements of growing amplitude, up to 1 mm.
fn path() -> Vec<f64> {
    (1..=300).map(|i| f64::from(i) / 100.0).map(|t| 1e-3 * (0.4 + 0.2 * t) * (TAU * t).sin()).collect()
}

/// Rows of a loop: `force` returns the force after a straight step between two displacements.
fn loop_rows(scale: f64, spring: f64, mut force: impl FnMut(f64, f64) -> f64) -> Vec<Vec<f64>> {
    let mut before = 0.0;
    path()
        .into_iter()
        .map(|u| {
            let u = scale * u;
            let row = vec![u, force(before, u) + spring * u];
            before = u;
            row
        })
        .collect()
}

const LOOP_HEAD: &str = "displacement_m,force_N";
const LOOP: &str = "is = \"loop\", at = \"pad\"";

/// Loop of a law with a stiffness and a limit beside a spring. `step` returns the force after a
/// straight step from the force before, the stiffness, the limit and the change of displacement.
fn limited_loop(random: &mut Noise, law: &'static str, step: impl Fn(f64, f64, f64, f64) -> f64) -> Synthetic {
    let kt = 1e4 * 10f64.powf(random.uniform() - 0.5);
    let limit = kt * 1e-4 * (1.0 + 3.0 * random.uniform());
    let k = kt * (0.05 + 0.3 * random.uniform());
    let mut force = 0.0;
    Synthetic {
        head: LOOP_HEAD,
        rows: loop_rows(1.0, k, |from, to| {
            force = step(force, kt, limit, to - from);
            force
        }),
        noisy: &[1],
        truth: vec![truth("a", kt, "N/m"), truth("b", limit, "N"), truth("k", k, "N/m")],
        law,
        target: LOOP,
    }
}

fn jenkins_loop(random: &mut Noise) -> Synthetic {
    limited_loop(random, SLIDER, |force, kt, limit, run| (force + kt * run).clamp(-limit, limit))
}

/// Dahl: `df/du = kt (1 - f sign(u')/limit)`, so that f tends exponentially to the limit.
fn dahl_loop(random: &mut Noise) -> Synthetic {
    limited_loop(random, "kind = \"dahl\", stiffness = \"a\", limit = \"b\"", |force, kt, limit, run| {
        let end = limit * run.signum();
        end + (force - end) * (-kt * run.abs() / limit).exp()
    })
}

/// Bouc-Wen with the exponent 1: `dz/du = 1 - (beta sign(u' z) + gamma) |z|`.
fn bouc_wen_loop(random: &mut Noise) -> Synthetic {
    let stiffness = 1e4 * 10f64.powf(random.uniform() - 0.5);
    let (beta, gamma) = (2e3 * (1.0 + 2.0 * random.uniform()), 1e3 * (1.0 + random.uniform()));
    let mut z = 0.0f64;
    Synthetic {
        head: LOOP_HEAD,
        rows: loop_rows(1.0, 0.0, |from, to| {
            let h = (to - from) / 100.0;
            let slope = |z: f64| 1.0 - (beta * (h * z).signum() + gamma) * z.abs();
            for _ in 0..100 {
                let a = slope(z);
                let b = slope(z + 0.5 * h * a);
                let c = slope(z + 0.5 * h * b);
                z += h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(z + h * c));
            }
            stiffness * z
        }),
        noisy: &[1],
        truth: vec![truth("a", stiffness, "N/m"), truth("b", beta, "1/m"), truth("d", gamma, "1/m")],
        law: "kind = \"bouc-wen\", stiffness = \"a\", beta = \"b\", gamma = \"d\"",
        target: LOOP,
    }
}

/// Four-parameter Iwan joint as a sum of 2000 sliders, driven up to `scale` mm. Without macro-slip,
/// the data do not separate `FS` and `beta`.
fn iwan_loop(random: &mut Noise, scale: f64) -> Synthetic {
    let stiffness = 1e4 * 10f64.powf(random.uniform() - 0.5);
    let (chi, beta) = (-0.8 + 0.6 * random.uniform(), 0.1 + 0.9 * random.uniform());
    let far = 1e-3 * (0.3 + 0.4 * random.uniform());
    let shape = beta + (chi + 1.0) / (chi + 2.0);
    let limit = stiffness * far * shape / (1.0 + beta);
    // stiffness up to the slip displacement φ: KT/(1 + beta) (φ/φmax)^(chi + 1)
    let count = 2000;
    let edge = |i: i32| far * (f64::from(i) / f64::from(count)).powi(3);
    let mut sliders: Vec<[f64; 3]> = (0..count)
        .map(|i| {
            let (from, to) = (edge(i) / far, edge(i + 1) / far);
            let part = stiffness / (1.0 + beta) * (to.powf(chi + 1.0) - from.powf(chi + 1.0));
            let force =
                stiffness / (1.0 + beta) * (chi + 1.0) / (chi + 2.0) * (to.powf(chi + 2.0) - from.powf(chi + 2.0));
            [part, force * far, 0.0]
        })
        .collect();
    sliders.push([stiffness * beta / (1.0 + beta), stiffness * beta / (1.0 + beta) * far, 0.0]);
    let rows = loop_rows(scale, 0.0, |from, to| {
        let mut sum = 0.0;
        for [stiffness, limit, force] in &mut sliders {
            *force = (*force + *stiffness * (to - from)).clamp(-*limit, *limit);
            sum += *force;
        }
        sum
    });
    let is_determined = scale * 1e-3 > far;
    Synthetic {
        head: LOOP_HEAD,
        rows,
        noisy: &[1],
        truth: vec![
            truth("a", stiffness, "N/m"),
            Truth { is_determined, ..truth("b", limit, "N") },
            truth("d", chi, ""),
            Truth { is_determined, ..truth("e", beta, "") },
        ],
        law: "kind = \"iwan\", stiffness = \"a\", limit = \"b\", chi = \"d\", beta = \"e\"",
        target: LOOP,
    }
}

/// An oscillator of 1 kg with an elastic slider.
struct Oscillator {
    k: f64,
    c: f64,
    kt: f64,
    limit: f64,
}

impl Oscillator {
    fn new(random: &mut Noise) -> Self {
        let k = 1e4 * 10f64.powf(random.uniform() - 0.5);
        let c = 2.0 * k.sqrt() * (0.02 + 0.02 * random.uniform());
        let kt = k * (0.3 + 0.7 * random.uniform());
        Oscillator { k, c, kt, limit: kt * 1e-4 * (1.0 + random.uniform()) }
    }

    /// Takes a Runge-Kutta step under a force. The slider's force is the third state.
    fn step(&self, [x, v, f]: [f64; 3], h: f64, force: impl Fn(f64) -> f64) -> [f64; 3] {
        let slope = |t: f64, [x, v, f]: [f64; 3]| {
            let slips = f * v > 0.0 && f.abs() >= self.limit;
            [v, force(t) - self.k * x - self.c * v - f, if slips { 0.0 } else { self.kt * v }]
        };
        let on = |k: [f64; 3], h: f64| [x + h * k[0], v + h * k[1], f + h * k[2]];
        let a = slope(0.0, [x, v, f]);
        let b = slope(0.5 * h, on(a, 0.5 * h));
        let c = slope(0.5 * h, on(b, 0.5 * h));
        let d = slope(h, on(c, h));
        let [x, v, f] = [0, 1, 2].map(|i| [x, v, f][i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        [x, v, f.clamp(-self.limit, self.limit)]
    }

    fn truth(&self) -> Vec<Truth> {
        let (k, c) = (truth("k", self.k, "N/m"), truth("c", self.c, "N s/m"));
        vec![k, c, truth("a", self.kt, "N/m"), truth("b", self.limit, "N")]
    }
}

const SLIDER: &str = "kind = \"jenkins\", stiffness = \"a\", limit = \"b\"";

fn ring_down(random: &mut Noise) -> Synthetic {
    let model = Oscillator::new(random);
    let step = TAU / (model.k + model.kt).sqrt() / 24.0;
    let mut state = [1e-3, 0.0, 0.0];
    let rows = (0..240)
        .map(|i| {
            let row = vec![step * f64::from(i), state[0]];
            (0..400).for_each(|_| state = model.step(state, step / 400.0, |_| 0.0));
            row
        })
        .collect();
    Synthetic {
        head: "time_s,response_m",
        rows,
        noisy: &[1],
        truth: model.truth(),
        law: SLIDER,
        target: "is = \"ring-down\", at = \"m\"",
    }
}

fn response(random: &mut Noise) -> Synthetic {
    let model = Oscillator::new(random);
    let mut rows = Vec::new();
    for (group, level) in [0.4, 1.2, 3.0].into_iter().enumerate() {
        let (low, high) = (model.k.sqrt(), (model.k + model.kt).sqrt());
        for i in 0..15 {
            let omega = 0.85 * low + (1.12 * high - 0.85 * low) * f64::from(i) / 14.0;
            let (force, steps) = (level * model.limit, 600);
            let h = TAU / omega / f64::from(steps);
            let mut state = [0.0; 3];
            let (mut re, mut im) = (0.0, 0.0);
            let (settled, all) = (80 * steps, 81 * steps);
            for n in 0..all {
                let at = omega * h * f64::from(n % steps);
                if n >= settled {
                    re += state[0] * at.cos() * 2.0 / f64::from(steps);
                    im -= state[0] * at.sin() * 2.0 / f64::from(steps);
                }
                state = model.step(state, h, |t| force * (at + omega * t).cos());
            }
            rows.push(vec![omega / TAU, force, re, im, group as f64]);
        }
    }
    Synthetic {
        head: "frequency_Hz,force_N,response_real_m,response_imaginary_m,group",
        rows,
        noisy: &[2, 3],
        truth: model.truth(),
        law: SLIDER,
        target: "is = \"response\", at = \"m\"",
    }
}

type Family = fn(&mut Noise) -> Synthetic;

const FAMILIES: [(&str, Family); 7] = [
    ("jenkins loop", jenkins_loop),
    ("dahl loop", dahl_loop),
    ("bouc-wen loop", bouc_wen_loop),
    ("iwan loop", |random| iwan_loop(random, 1.0)),
    ("iwan loop without macro-slip", |random| iwan_loop(random, 0.2)),
    ("ring-down", ring_down),
    ("response", response),
];

impl Synthetic {
    /// Returns the data with noise of a fraction of the largest value.
    fn data(&self, fraction: f64, random: &mut Noise) -> String {
        let largest =
            self.rows.iter().map(|row| self.noisy.iter().map(|column| row[*column].powi(2)).sum::<f64>().sqrt());
        let deviation = fraction * largest.fold(0.0, f64::max);
        let mut text = format!("{}\n", self.head);
        for row in &self.rows {
            let value = |(i, value): (usize, &f64)| {
                let noise = if self.noisy.contains(&i) { deviation * random.normal() } else { 0.0 };
                (value + noise).to_string()
            };
            let _ = writeln!(text, "{}", row.iter().enumerate().map(value).collect::<Vec<_>>().join(","));
        }
        text
    }

    /// Returns the study; the search begins a factor of ten away from every parameter.
    fn study(&self, random: &mut Noise, weight: f64) -> String {
        let (mut stated, mut fit) = (String::new(), String::new());
        for Truth { name, value, unit, .. } in &self.truth {
            if *value < 0.0 {
                // the exponent of an Iwan joint
                let _ = writeln!(stated, "{name} = {}", if random.uniform() < 0.5 { -0.05 } else { -0.9 });
                let _ = writeln!(fit, "fit.{name} = {{ from = -0.95, to = 0.0 }}");
                continue;
            }
            let start = value * if random.uniform() < 0.5 { 10.0 } else { 0.1 };
            let range = |factor: f64| format!("\"{:e} {unit}\"", value * factor);
            let _ = writeln!(stated, "{name} = \"{start:e} {unit}\"");
            let _ = writeln!(fit, "fit.{name} = {{ from = {}, to = {}, scale = \"log\" }}", range(0.02), range(50.0));
        }
        let fits = |name: &str| self.truth.iter().any(|truth| truth.name == name);
        let spring = if fits("k") {
            let damping = if fits("c") { "damping = \"c\"\n" } else { "" };
            format!("[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"k\"\n{damping}")
        } else {
            String::new()
        };
        let force = if self.target.contains("response") { "[[force]]\non = \"m\"\namplitude = \"1 N\"\n" } else { "" };
        let start =
            if self.target.contains("ring-down") { "start = { m = \"1 mm\" }\nbegin = \"unloaded\"\n" } else { "" };
        format!(
            "schema = 1\n[[data]]\nname = \"test\"\nfile = \"data.csv\"\n[parameters]\n{stated}[[mass]]\nname = \"m\"\nmass = \
             \"1 kg\"\n{spring}[[joint]]\nname = \"pad\"\nbetween = [\"m\", \"ground\"]\nlaw = {{ {} }}\n{force}\
             [study]\nkind = \"identify\"\n{fit}{start}targets = [{{ data = \"test\", {}, weight = \"{} % of largest\" }}]\n",
            self.law,
            self.target,
            100.0 * weight
        )
    }
}

/// Outcomes of the fits of a family.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    models: usize,
    /// Fits whose loss is at most that of the true parameters.
    found: usize,
    /// Intervals, and those that contain the truth.
    intervals: usize,
    inside: usize,
    /// Parameters that the data do not determine, and those that are reported so or have an
    /// interval with the truth.
    undetermined: usize,
    reported: usize,
    /// Parameters that were reported as not determined, of models with only determined ones.
    lost: usize,
    seconds: f64,
}

fn fit(model: &Synthetic, fraction: f64, random: &mut Noise, tally: &mut Tally) {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, study) = (model.data(fraction, random), model.study(random, fraction));
    let begin = std::time::Instant::now();
    let (study, dataset) = identify_in(folder.path(), &data, &study);
    tally.seconds += begin.elapsed().as_secs_f64();
    tally.models += 1;
    if dataset.tables.iter().all(|table| table.name != "parameters" || table.rows() == 0) {
        return;
    }
    let residuals = Residuals::new(&study, 0).expect("residuals");
    let names = residuals.names();
    let loss = |of: &dyn Fn(&str) -> f64| {
        let x: Vec<f64> = names.iter().map(|name| of(name)).collect();
        residuals.values(&x).map_or(f64::INFINITY, |r| r.iter().map(|r| r * r).sum::<f64>())
    };
    let fitted = loss(&|name| {
        let value = estimate(&dataset, name).value;
        let bounds = residuals.bounds()[names.iter().position(|own| own == name).expect("a name")];
        value.clamp(bounds[0], bounds[1])
    });
    let true_loss = loss(&|name| model.truth.iter().find(|truth| truth.name == name).expect("a name").value);
    tally.found += usize::from(fitted <= true_loss * (1.0 + 1e-9));
    for truth in &model.truth {
        let estimate = estimate(&dataset, truth.name);
        let is_determined = estimate.status == "determined";
        if !truth.is_determined {
            tally.undetermined += 1;
            let is_inside = estimate.low <= truth.value && truth.value <= estimate.high;
            tally.reported += usize::from(!is_determined || is_inside);
        } else if is_determined {
            tally.intervals += 1;
            tally.inside += usize::from(estimate.low <= truth.value && truth.value <= estimate.high);
        } else if model.truth.iter().all(|truth| truth.is_determined) {
            tally.lost += 1;
        }
    }
}

/// The 95 % intervals contain the truth in 90 to 98 % of the cases, starts a factor of ten away
/// lead to the minimum, and what the data do not determine is reported.
#[test]
fn random_models_are_found_from_noisy_data() {
    let models =
        std::env::var("STICKSLIP_MODELS").ok().and_then(|text| text.parse().ok()).unwrap_or(FAMILIES.len() - 1);
    let mut all = Tally::default();
    for fraction in [0.01, 0.05] {
        let mut random = Noise(17);
        let mut tallies = [Tally::default(); FAMILIES.len()];
        let only = std::env::var("STICKSLIP_FAMILY").ok().and_then(|text| text.parse::<usize>().ok());
        for number in (0..models).filter(|number| only.is_none_or(|only| number % FAMILIES.len() == only)) {
            let (_, family) = FAMILIES[number % FAMILIES.len()];
            let model = family(&mut random);
            fit(&model, fraction, &mut random, &mut tallies[number % FAMILIES.len()]);
        }
        for ((name, _), tally) in FAMILIES.iter().zip(tallies) {
            println!("{:.0} % {name}: {tally:?}", 100.0 * fraction);
            all.models += tally.models;
            all.found += tally.found;
            all.intervals += tally.intervals;
            all.inside += tally.inside;
            all.undetermined += tally.undetermined;
            all.reported += tally.reported;
            all.lost += tally.lost;
        }
    }
    println!("{all:?}");
    // few models: allow four standard deviations of the number
    let least = |whole: usize| 0.95 * whole as f64 - 4.0 * (0.95 * 0.05 * whole as f64).sqrt();
    let (inside, intervals) = (all.inside as f64, all.intervals as f64);
    let slack = 4.0 * (0.95 * 0.05 * intervals).sqrt();
    assert!(inside >= least(all.intervals).min(0.9 * intervals), "{all:?}");
    assert!(inside <= (0.95 * intervals + slack).max(0.98 * intervals), "{all:?}");
    assert!(all.found as f64 >= least(all.models) && all.reported as f64 >= least(all.undetermined), "{all:?}");
    assert!(all.lost as f64 <= intervals - least(all.intervals), "{all:?}");
}
