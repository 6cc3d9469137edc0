//! Generator of random study files: small structures with parameters over many decades, every
//! law, method and kind.

#[path = "../../../../verification/src/laws_of_seeds.rs"]
mod laws_of_seeds;

use laws_of_seeds::LAWS_OF_SEEDS;
use std::fmt::Write;
use stickslip::law;
use stickslip_numerics::random::SplitMix64;
use stickslip_study::{kinds, templates};

/// Kinds that are not drawn: later kinds must not change the studies of a seed.
pub const NOT_DRAWN: [&str; 2] = ["map", "identify"];

/// Random numbers: a seed gives the same numbers on every machine.
pub struct Chance(SplitMix64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Chance(SplitMix64::new(0).skip(seed))
    }

    /// Returns a number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0.next_unit()
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns a whole number from `low` to `high`, both included.
    pub fn count(&mut self, low: usize, high: usize) -> usize {
        low + (self.0.next_u64() % (high - low + 1) as u64) as usize
    }

    /// Returns true with the probability `1/n`.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.count(1, n) == 1
    }

    pub fn of<'a, T: ?Sized>(&mut self, all: &[&'a T]) -> &'a T {
        all[self.count(0, all.len() - 1)]
    }

    /// Returns a power of ten between these exponents.
    fn decade(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(self.between(low, high))
    }

    /// Sometimes replaces a sensible value by an arbitrary one.
    fn or_extreme(&mut self, value: f64) -> f64 {
        if self.one_in(80) { self.decade(-9.0, 12.0) } else { value }
    }
}

/// Scales of a structure: a mass, a natural frequency and a force.
struct Scales {
    mass: f64,
    hertz: f64,
    force: f64,
}

impl Scales {
    fn stiffness(&self) -> f64 {
        self.mass * (std::f64::consts::TAU * self.hertz).powi(2)
    }

    fn length(&self) -> f64 {
        self.force / self.stiffness()
    }
}

/// Names of the model that the rest of the study uses.
struct Names {
    masses: Vec<String>,
    joints: Vec<String>,
    /// Parameters that `vary` may contain: name and value with its unit.
    parameters: Vec<(&'static str, f64, &'static str)>,
}

/// Generates the text of a study.
pub fn study_text(chance: &mut Chance) -> String {
    let scales =
        Scales { mass: chance.decade(-3.0, 1.5), hertz: chance.decade(0.0, 3.0), force: chance.decade(-1.0, 3.0) };
    // the cells of a map are those of a performance curve
    let names: Vec<&str> =
        kinds::TABLE.iter().map(|kind| kind.info.name).filter(|name| !NOT_DRAWN.contains(name)).collect();
    let kind = chance.of(&names);
    let mut model = String::new();
    let (names, scales) = if chance.one_in(8) {
        let (names, scales) = template(chance, &mut model);
        (names, scales)
    } else {
        (lists(chance, &scales, kind, &mut model), scales)
    };
    let mut text = "schema = 1\n".to_owned();
    if !model.starts_with("[model]") {
        text.push_str("[parameters]\n");
        for (name, value, unit) in &names.parameters {
            let _ = writeln!(text, "{name} = \"{value:e} {unit}\"");
        }
    }
    text.push_str(&model);
    study(chance, &scales, kind, &names, &mut text);
    method(chance, &scales, &mut text);
    figure(chance, &names, &mut text);
    if kind == "nodal-diameter" {
        let _ = writeln!(text, "[disk]\nsectors = {}", chance.count(2, 12));
    }
    text
}

fn template(chance: &mut Chance, text: &mut String) -> (Names, Scales) {
    let row = &templates::TABLE[chance.count(0, templates::TABLE.len() - 1)];
    let _ = writeln!(text, "[model]\ntemplate = \"{}\"", row.name);
    let model = row.model();
    let names = Names {
        masses: model.masses.iter().map(|mass| mass.name.clone()).collect(),
        joints: model.joints.iter().map(|joint| joint.name.clone()).collect(),
        parameters: vec![("Ft", chance.decade(-1.0, 1.5), "N")],
    };
    // the blade couples, and the element, which has no natural frequency
    let hertz = if names.masses.len() > 1 { 120.6 } else { 0.2 };
    (names, Scales { mass: 0.182, hertz, force: 10.0 })
}

/// Generates a law with parameters of these scales. Half of the limits are the parameter
/// `limit`.
fn law_text(chance: &mut Chance, scales: &Scales, smooth: bool) -> String {
    // places here move along one direction; smooth laws have a rate, exact laws consist of
    // pieces
    let fits = |row: &&law::LawInfo| {
        let law = row.sample();
        LAWS_OF_SEEDS.contains(&row.name)
            && law.directions() == 1
            && if smooth { law.rate().is_some() } else { law.ideal_elements().is_some() }
    };
    let rows: Vec<&law::LawInfo> = law::TABLE.iter().copied().filter(fits).collect();
    let row = chance.of(&rows);
    let mut text = format!("{{ kind = \"{}\"", row.name);
    for (parameter, sample) in row.parameters.iter().zip(row.sample) {
        if parameter.default.is_some() {
            continue;
        }
        let value = match parameter.key {
            "limit" if chance.one_in(2) => {
                text.push_str(", limit = \"limit\"");
                continue;
            }
            "limit" if chance.one_in(12) => 0.0,
            "limit" => scales.force * chance.decade(-2.0, 1.5),
            "stiffness" => scales.stiffness() * chance.decade(-2.0, 2.0),
            // lengths and velocities by the scales of the model, pure numbers as in the sample
            "gap" => scales.length() * (chance.decade(-2.0, 1.0) - 0.1),
            "static_limit" => scales.force * chance.decade(0.5, 2.0),
            "velocity" => chance.decade(-1.0, 1.0) * scales.length() * std::f64::consts::TAU * scales.hertz,
            "slip_stiffness" => scales.stiffness() * chance.decade(-4.0, -2.0),
            _ if parameter.dimension == stickslip::dimension::Dimension::NONE => *sample,
            "lambda" | "beta" | "gamma" => chance.decade(-1.0, 1.0) / scales.length(),
            "damping" | "viscous" => 1e-3 * chance.decade(-1.0, 1.0) * (scales.mass * scales.stiffness()).sqrt(),
            // steepness at rest: a fraction of the velocity scale
            "alpha" => chance.decade(0.0, 3.0) / (scales.length() * std::f64::consts::TAU * scales.hertz),
            _ => sample * chance.decade(-1.0, 1.0),
        };
        let value = if value == 0.0 { 0.0 } else { chance.or_extreme(value) };
        let _ = write!(text, ", {} = {value:e}", parameter.key);
    }
    text + " }"
}

fn lists(chance: &mut Chance, scales: &Scales, kind: &str, text: &mut String) -> Names {
    let n = chance.count(1, 5);
    let name = |i: usize| format!("m{}", i + 1);
    let smooth = chance.one_in(3);
    let stiffness = |chance: &mut Chance| {
        let value = scales.stiffness() * chance.decade(-1.0, 1.0);
        chance.or_extreme(value)
    };
    // damping ratios from a ten-thousandth to a third, sometimes zero or negative
    let damping = |chance: &mut Chance| match chance.count(1, 12) {
        1 => 0.0,
        2 if chance.one_in(5) => -1e-3 * (scales.mass * scales.stiffness()).sqrt(),
        _ => 2.0 * chance.decade(-4.0, -0.5) * (scales.mass * scales.stiffness()).sqrt(),
    };
    // a ring of equal masses by repetition, or one entry each
    let repeated = n >= 3 && chance.one_in(6);
    if repeated {
        let _ = writeln!(text, "[[mass]]\nname = \"m{{i}}\"\nmass = {:e}\nrepeat = {{ i = {n} }}", scales.mass);
    } else {
        for i in 0..n {
            let mass = if i > 0 && chance.one_in(25) { 0.0 } else { scales.mass * chance.decade(-1.0, 1.0) };
            let mass = if mass == 0.0 { 0.0 } else { chance.or_extreme(mass) };
            let _ = writeln!(text, "[[mass]]\nname = \"{}\"\nmass = {mass:e}", name(i));
        }
    }
    let mut spring = |chance: &mut Chance, a: &str, b: &str, more: &str| {
        let (k, c) = (stiffness(chance), damping(chance));
        let _ = writeln!(text, "[[spring]]\nbetween = [\"{a}\", \"{b}\"]\nstiffness = {k:e}\ndamping = {c:e}{more}");
    };
    if repeated {
        spring(chance, "m{i}", "ground", &format!("\nrepeat = {{ i = {n} }}"));
        spring(chance, "m{i}", "m{i+1}", &format!("\nrepeat = {{ i = {n}, wrap = true }}"));
    } else {
        let free = chance.one_in(10);
        match chance.count(1, 3) {
            // a chain or a ring
            1 => {
                (1..n).for_each(|i| spring(chance, &name(i - 1), &name(i), ""));
                if n > 2 && chance.one_in(2) {
                    spring(chance, &name(n - 1), &name(0), "");
                }
            }
            // a star
            2 => (1..n).for_each(|i| spring(chance, &name(0), &name(i), "")),
            // each mass on a spring to the ground
            _ => (1..n).for_each(|i| spring(chance, &name(i), "ground", "")),
        }
        if !free {
            spring(chance, &name(0), "ground", "");
        }
    }
    let mut names = Names { masses: (0..n).map(name).collect(), joints: Vec::new(), parameters: Vec::new() };
    names.parameters.push(("limit", scales.force * chance.decade(-2.0, 1.0), "N"));
    names.parameters.push(("F0", scales.force, "N"));
    let most = if chance.one_in(12) { 6 } else { 2 };
    for j in 0..chance.count(usize::from(kind == "hysteresis"), most) {
        let a = chance.count(0, n - 1);
        let b = chance.count(0, n);
        let (a, b) = (name(a), if b == n || b == a { "ground".to_owned() } else { name(b) });
        let law = law_text(chance, scales, smooth);
        let _ = writeln!(text, "[[joint]]\nname = \"j{j}\"\nbetween = [\"{a}\", \"{b}\"]\nlaw = {law}");
        names.joints.push(format!("j{j}"));
    }
    let phase = |chance: &mut Chance| chance.of(&["0 deg", "90 deg", "-120 deg", "1.234 rad", "17 deg"]).to_owned();
    let harmonic = |chance: &mut Chance| if chance.one_in(3) { chance.count(0, 5) } else { 1 };
    let fewest = usize::from(!chance.one_in(15));
    for f in 0..chance.count(fewest, 2) {
        let on = name(chance.count(0, n - 1));
        let amplitude =
            if f == 0 { "\"F0\"".to_owned() } else { format!("{:e}", scales.force * chance.decade(-2.0, 0.0)) };
        let _ = writeln!(
            text,
            "[[force]]\non = \"{on}\"\namplitude = {amplitude}\nphase = \"{}\"\nharmonic = {}",
            phase(chance),
            if f == 0 && !chance.one_in(10) { 1 } else { harmonic(chance) }
        );
    }
    if chance.one_in(6) {
        let k = stiffness(chance);
        let _ = writeln!(text, "[[spring]]\nbetween = [\"m1\", \"shaker\"]\nstiffness = {k:e}");
        let amplitude = chance.or_extreme(scales.length());
        let (phase, harmonic) = (phase(chance), harmonic(chance));
        let _ = writeln!(
            text,
            "[[motion]]\non = \"shaker\"\namplitude = {amplitude:e}\nphase = \"{phase}\"\nharmonic = {harmonic}"
        );
    }
    names
}

fn frequencies(chance: &mut Chance, scales: &Scales, kind: &str) -> String {
    let ratio = |chance: &mut Chance| scales.hertz * chance.between(0.3, 2.0);
    let range = matches!(kind, "response" | "performance" | "branch");
    let adapts = kinds::find(kind).is_some_and(|kind| kind.info.adapts);
    match chance.count(1, 8) {
        1 | 2 if !range => {
            let (a, b) = (ratio(chance), ratio(chance));
            format!("[\"{a:.4} Hz\", \"{b:.4} Hz\"]")
        }
        _ if !range => {
            let value = ratio(chance);
            format!("\"{:e} Hz\"", chance.or_extreme(value))
        }
        shape => {
            let from = scales.hertz * chance.between(0.3, 1.0);
            let to = from * chance.between(1.01, 3.0);
            if adapts && shape == 1 {
                let percent = chance.count(2, 20);
                return format!("{{ from = \"{from:.6} Hz\", to = \"{to:.6} Hz\", tolerance = \"{percent} %\" }}");
            }
            let points = chance.count(3, if kind == "performance" { 5 } else { 12 });
            format!("{{ from = \"{from:.6} Hz\", to = \"{to:.6} Hz\", points = {points} }}")
        }
    }
}

fn outputs(chance: &mut Chance) -> String {
    let all: Vec<&str> = kinds::outputs().iter().map(|output| output.0).collect();
    let some: Vec<String> = (0..chance.count(1, 3)).map(|_| format!("\"{}\"", chance.of(&all))).collect();
    format!("[{}]", some.join(", "))
}

fn study(chance: &mut Chance, scales: &Scales, kind: &str, names: &Names, text: &mut String) {
    let mut lines = vec![format!("kind = \"{kind}\"")];
    let mass = |chance: &mut Chance| names.masses.get(chance.count(0, names.masses.len().max(1) - 1)).cloned();
    let free_decay = kind == "transient" && chance.one_in(3);
    let run_up = kind == "transient" && !free_decay && chance.one_in(3);
    if !["modes", "nodal-diameter", "campbell"].contains(&kind) && !free_decay && !run_up {
        lines.push(format!("frequency = {}", frequencies(chance, scales, kind)));
    }
    if ["response", "orbit", "branch"].contains(&kind) && chance.one_in(5) {
        lines.push(format!("output = {}", outputs(chance)));
    }
    if ["response", "performance", "branch"].contains(&kind) && chance.one_in(3) {
        let one = mass(chance).filter(|_| chance.one_in(2)).unwrap_or_else(|| "all".to_owned());
        lines.push(format!("peak_of = \"{one}\""));
    }
    let series = |chance: &mut Chance, lines: &mut Vec<String>| {
        if !chance.one_in(6) {
            let harmonics = chance.count(1, 9);
            lines.push(format!("harmonics = {harmonics}\nsamples = {}", 4 * (harmonics + 1) + 2 * chance.count(0, 60)));
        }
    };
    match kind {
        "nodal-diameter" => lines.push(format!("modes = {}", chance.count(1, 6))),
        "campbell" => {
            let (from, to) = (scales.hertz * chance.between(0.0, 0.5), scales.hertz * chance.between(0.6, 3.0));
            lines.push(format!(
                "speed = {{ from = \"{from:e} Hz\", to = \"{to:e} Hz\", points = {} }}",
                chance.count(2, 20)
            ));
        }
        "response" if chance.one_in(3) => lines.push("peaks = false".to_owned()),
        "hysteresis" => {
            lines.push(format!("samples = {}", chance.count(8, 400)));
            match mass(chance) {
                Some(mass) if chance.one_in(4) => {
                    lines.push(format!("against = \"{mass}\"\nsum = {}", chance.one_in(2)));
                }
                _ if !names.joints.is_empty() && chance.one_in(3) => {
                    let joint = &names.joints[chance.count(0, names.joints.len() - 1)];
                    lines.push(format!("loop = \"{joint}\""));
                }
                _ => {}
            }
        }
        "orbit" => {
            lines.push(format!("samples = {}\nmultipliers = {}", chance.count(8, 400), chance.one_in(3)));
        }
        "modes" => {
            let mode = chance.count(1, names.masses.len().clamp(1, 3));
            let from = scales.length() * chance.decade(-3.0, 0.0);
            let to = from * chance.decade(0.2, 4.0);
            let points = chance.count(2, 15);
            lines.push(format!("mode = {mode}\namplitude = {{ from = {from:e}, to = {to:e}, points = {points} }}"));
            series(chance, &mut lines);
        }
        "branch" => {
            lines.push(format!("steps = {}", chance.count(2, 15)));
            series(chance, &mut lines);
        }
        "transient" => {
            let period = 1.0 / scales.hertz;
            if free_decay {
                lines.push(format!(
                    "duration = {:e}\ntime_step = {:e}",
                    period * chance.between(1.0, 20.0),
                    period * 0.05
                ));
            } else if run_up {
                let (from, to) = (scales.hertz * chance.between(0.3, 0.9), scales.hertz * chance.between(1.0, 2.0));
                lines.push(format!(
                    "run_up = {{ from = \"{from:e} Hz\", to = \"{to:e} Hz\", duration = {:e} }}",
                    period * chance.between(2.0, 20.0)
                ));
            } else {
                lines.push(format!("cycles = {}\nsamples_per_cycle = {}", chance.count(1, 15), chance.count(8, 64)));
            }
            if let Some(mass) = mass(chance).filter(|_| free_decay || chance.one_in(3)) {
                let start = scales.length() * chance.between(-3.0, 3.0);
                lines.push(format!("start = {{ {mass} = {:e} }}", if chance.one_in(20) { 0.0 } else { start }));
            }
        }
        _ => {}
    }
    let vary = kind == "performance" || chance.one_in(3);
    if let Some((name, value, unit)) = names.parameters.first().filter(|_| vary) {
        let (a, b) = (value * chance.between(0.1, 1.0), value * chance.between(1.1, 5.0));
        let few = if kind == "performance" { 3 } else { chance.count(2, 3) };
        let values = match chance.count(1, 3) {
            1 if kind != "performance" => format!("[\"{a:e} {unit}\", \"{b:e} {unit}\"]"),
            2 => format!("[\"{a:e} {unit}\", \"{value:e} {unit}\", \"{b:e} {unit}\"]"),
            _ => format!("{{ from = \"{a:e} {unit}\", to = \"{b:e} {unit}\", points = {few} }}"),
        };
        let force = if chance.one_in(6) && names.parameters.len() > 1 {
            format!("F0 = [\"{:e} N\", \"{:e} N\"], ", scales.force, scales.force * 0.3)
        } else {
            String::new()
        };
        lines.push(format!("vary = {{ {force}{name} = {values} }}"));
    }
    let _ = writeln!(text, "[study]\n{}", lines.join("\n"));
}

fn method(chance: &mut Chance, scales: &Scales, text: &mut String) {
    let velocity = scales.length() * std::f64::consts::TAU * scales.hertz;
    let width = |chance: &mut Chance| velocity * chance.decade(-3.0, -0.5);
    let options = match chance.count(1, 8) {
        1..=3 => return,
        4 => "kind = \"event-driven\"".to_owned(),
        5 => {
            let mut options = format!("kind = \"transient\"\nperiods = {}", chance.count(1, 300));
            if chance.one_in(3) {
                let _ = write!(options, "\nwidth = {:e}", width(chance));
            }
            if chance.one_in(2) {
                let _ = write!(options, "\ntolerance = {:e}", chance.decade(-8.0, -3.0));
            }
            options
        }
        6 => {
            format!("kind = \"shooting\"\nwidth = {:e}\ntolerance = {:e}", width(chance), chance.decade(-9.0, -5.0))
        }
        _ => {
            let mut options = "kind = \"harmonic-balance\"".to_owned();
            if chance.one_in(2) {
                let harmonics = chance.count(1, 20);
                let _ = write!(options, "\nharmonics = {harmonics}");
                if chance.one_in(2) {
                    let _ = write!(options, "\nsamples = {}", 4 * (harmonics + 1) + 2 * chance.count(0, 100));
                }
            }
            if chance.one_in(2) {
                let _ = write!(options, "\ntolerance = {:e}", chance.decade(-4.0, -1.0));
            }
            options
        }
    };
    let _ = writeln!(text, "[method]\n{options}");
}

fn figure(chance: &mut Chance, names: &Names, text: &mut String) {
    if !chance.one_in(4) {
        return;
    }
    let _ = writeln!(text, "[figure]");
    if chance.one_in(2) {
        let _ = writeln!(text, "overlay = {}", chance.one_in(2));
    }
    if chance.one_in(3) {
        let _ = writeln!(text, "references = true");
    }
    if chance.one_in(3) {
        let _ = writeln!(text, "y = \"log\"");
    }
    if let Some(mass) = names.masses.first().filter(|_| chance.one_in(3)) {
        let _ = writeln!(text, "only = \"{mass}\"");
    }
}
