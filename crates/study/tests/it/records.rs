//! Forces and motions from records, against closed forms.

use std::fmt::Write;
use stickslip_study::dataset::Dataset;
use stickslip_study::run::{Context, run};
use stickslip_study::{read_file, read_study};

fn try_run(record: &str, study: &str) -> Result<Dataset, String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("record.csv"), record).expect("the record");
    let file = folder.path().join("study.toml");
    std::fs::write(&file, format!("schema = 1\n[[data]]\nname = \"record\"\nfile = \"record.csv\"\n{study}"))
        .expect("the study");
    let study = read_file(&file, &[]).map_err(|error| format!("{error} {}", error.help_text().unwrap_or_default()))?;
    run(&study, &Context::without_progress(1)).map_err(|error| error.to_string())
}

fn motion(record: &str, study: &str, column: &str) -> Vec<(f64, f64)> {
    let dataset = try_run(record, study).unwrap_or_else(|error| panic!("{error}"));
    let table = dataset.tables.iter().find(|table| table.name == "motion").expect("the motion");
    let (time, values) = (table.numbers("time_s").expect("time"), table.numbers(column).expect(column));
    time.iter().copied().zip(values.iter().copied()).collect()
}

const TRANSIENT: &str = "[study]\nkind = \"transient\"\nduration = \"2 s\"\ntime_step = \"10 ms\"\n";

/// A mass under a rising force slides from `t0 = F/a` on: `x = a (t - t0)³/(6 m)`.
#[test]
fn a_free_mass_slides_under_a_ramp() {
    let (m, limit, a): (f64, f64, f64) = (3.0, 1.5, 4.0);
    let study = format!(
        "[[mass]]\nname = \"m\"\nmass = \"{m} kg\"\n[[joint]]\nname = \"j\"\nbetween = [\"m\", \"ground\"]\n\
         law = {{ kind = \"coulomb\", limit = \"{limit} N\" }}\n[[force]]\non = \"m\"\ndata = \"record\"\n{TRANSIENT}"
    );
    // rows that do not fall on the samples
    let rows = [0.0, 0.137, 0.42, 0.9, 1.331, 2.5].iter().fold("time_s,force_N\n".to_owned(), |mut text, t| {
        let _ = writeln!(text, "{t},{}", a * t);
        text
    });
    let t0 = limit / a;
    let mut worst = 0.0f64;
    for (t, x) in motion(&rows, &study, "m_displacement_m") {
        let expected = if t > t0 { a * (t - t0).powi(3) / (6.0 * m) } else { 0.0 };
        worst = worst.max((x - expected).abs());
    }
    // the largest displacement is 0.95 m
    assert!(worst < 1e-8, "{worst}");
}

/// A damped oscillator under a triangle of force: the sum of three ramp responses.
#[test]
fn an_oscillator_follows_a_triangle() {
    let (m, k, c): (f64, f64, f64) = (2.0, 300.0, 4.0);
    let (omega0, decay) = (f64::sqrt(k / m), c / (2.0 * m));
    let omega = (omega0 * omega0 - decay * decay).sqrt();
    // response to the force t from t = 0 on
    let ramp = |t: f64| {
        if t <= 0.0 {
            return 0.0;
        }
        let lag = 2.0 * decay / (omega0 * omega0);
        let (a, b) = (lag, (decay * lag - 1.0) / omega);
        (t - lag + (-decay * t).exp() * (a * (omega * t).cos() + b * (omega * t).sin())) / k
    };
    let force = |t: f64| 20.0 * (ramp(t - 0.1) - 2.0 * ramp(t - 0.55) + ramp(t - 1.0));
    let body = format!(
        "[[mass]]\nname = \"m\"\nmass = \"{m} kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"{k} N/m\"\n\
         damping = \"{c} N s/m\"\n"
    );
    let study = format!("{body}[[force]]\non = \"m\"\ndata = \"record\"\n{TRANSIENT}");
    let rows = "time_s,force_N\n0,0\n0.1,0\n0.55,9\n1,0\n1.2,0\n";
    let found = motion(rows, &study, "m_displacement_m");
    let worst = found.iter().map(|(t, x)| (x - force(*t)).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-9 * 0.03, "{worst}");
    // the ground moves with the acceleration -F/m
    let ground = format!("{body}[[motion]]\non = \"ground\"\ndata = \"record\"\n{TRANSIENT}");
    let rows = "time_s,acceleration_m_per_s2\n0,0\n0.1,0\n0.55,-4.5\n1,0\n1.2,0\n";
    let relative = motion(rows, &ground, "m_displacement_m");
    for ((_, x), (_, y)) in found.iter().zip(&relative) {
        assert!((x - y).abs() < 1e-12, "{x} {y}");
    }
}

/// A mass on a belt sticks until the spring pulls with the slip limit, and then oscillates about
/// `F/k` with the velocity of the belt as amplitude.
#[test]
fn a_belt_carries_a_mass_until_it_slips() {
    let (m, k, limit, v): (f64, f64, f64, f64) = (1.0, 100.0, 2.0, 0.05);
    let study = format!(
        "[[mass]]\nname = \"m\"\nmass = \"{m} kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"{k} N/m\"\n\
         [[motion]]\non = \"belt\"\ndata = \"record\"\n[[joint]]\nname = \"j\"\nbetween = [\"m\", \"belt\"]\n\
         law = {{ kind = \"coulomb\", limit = \"{limit} N\" }}\n\
         [study]\nkind = \"transient\"\nduration = \"0.9 s\"\ntime_step = \"10 ms\"\nstart_velocity = {{ m = \"{v} m/s\" }}\n"
    );
    let rows = format!("time_s,displacement_m\n0,0\n0.3,{}\n5,{}\n", 0.3 * v, 5.0 * v);
    let (omega, slip) = (f64::sqrt(k / m), limit / k / v);
    for (t, x) in motion(&rows, &study, "m_displacement_m") {
        let expected = if t < slip { v * t } else { limit / k + v / omega * (omega * (t - slip)).sin() };
        assert!((x - expected).abs() < 1e-9, "{t}: {x} {expected}");
    }
}

/// Largest displacement of the continuous logarithmic run-up: 0.1676827 m at 41.507 s (DOP853 of
/// SciPy). Cycles of constant frequency differ by a few 1e-4.
#[test]
fn a_logarithmic_run_up() {
    let study = "schema = 1\n[[mass]]\nname = \"block\"\nmass = \"2 kg\"\n[[spring]]\nbetween = [\"block\", \"ground\"]\n\
        stiffness = \"800 N/m\"\ndamping = \"3 N s/m\"\n[[force]]\non = \"block\"\namplitude = \"12 N\"\n\
        [study]\nkind = \"transient\"\nrun_up = { from = \"0.5 Hz\", to = \"8 Hz\", duration = \"60 s\", scale = \"log\" }\n";
    let study = read_study("run_up.toml", study, &[]).unwrap_or_else(|error| panic!("{error}"));
    let dataset = run(&study, &Context::without_progress(1)).unwrap_or_else(|error| panic!("{error}"));
    let table = dataset.tables.iter().find(|table| table.name == "motion_summary").expect("the summary");
    let largest = table.numbers("largest_displacement_m").expect("a number")[0];
    let time = table.numbers("time_s").expect("a number")[0];
    assert!((largest / 0.1676827 - 1.0).abs() < 1e-3 && (time - 41.507).abs() < 0.2, "{largest} {time}");
}

/// A deck on a sliding bearing under a record of 8 s. Largest slip 0.374564 m (own program: steps
/// with exact friction, 4e-5 s, force linear between the rows).
#[test]
fn a_deck_slides_under_a_record() {
    let record = include_str!("data/deck.csv");
    let body = "[[mass]]\nname = \"deck\"\nmass = \"1000 kg\"\n[[spring]]\nbetween = [\"deck\", \"ground\"]\n\
        stiffness = \"10 kN/m\"\n[[joint]]\nname = \"slide\"\nbetween = [\"deck\", \"ground\"]\n\
        law = { kind = \"coulomb\", limit = \"600 N\" }\n";
    let study = "[study]\nkind = \"transient\"\nduration = \"8 s\"\ntime_step = \"10 ms\"\n";
    let force = format!("{body}[[force]]\non = \"deck\"\ndata = \"record\"\n{study}");
    let ground = format!("{body}[[motion]]\non = \"ground\"\ndata = \"record\"\n{study}");
    for study in [force, ground] {
        let slip = motion(record, &study, "slide_displacement_m").iter().fold(0.0f64, |most, (_, x)| most.max(x.abs()));
        assert!((slip / 0.374564 - 1.0).abs() < 1e-4, "{slip}");
    }
}

/// Displacements of an undamped oscillator of 2 kg and 300 N/m under a signal.
fn under_signal(signal: &str) -> Vec<(f64, f64)> {
    let study = format!(
        "[[mass]]\nname = \"m\"\nmass = \"2 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"300 N/m\"\n\
         [[force]]\non = \"m\"\nsignal = {signal}\n{TRANSIENT}"
    );
    motion("time_s,force_N\n0,0\n1,0\n", &study, "m_displacement_m")
}

/// Under `F sin pt` from rest, `x = F/(k (1 - r²)) (sin pt - r sin ωt)` with `r = p/ω`; after the
/// shock, the difference of two such motions.
#[test]
fn a_half_sine_shock() {
    let (omega, p) = (f64::sqrt(150.0), std::f64::consts::PI / 0.4);
    let r = p / omega;
    let sine =
        |t: f64| if t > 0.0 { 7.0 / 300.0 / (1.0 - r * r) * ((p * t).sin() - r * (omega * t).sin()) } else { 0.0 };
    for (t, x) in under_signal("{ kind = \"half-sine\", amplitude = \"7 N\", duration = \"0.4 s\", begin = \"0.1 s\" }")
    {
        let expected = sine(t - 0.1) + sine(t - 0.5);
        assert!((x - expected).abs() < 1e-4 * 0.03, "{t}: {x} {expected}");
    }
}

/// A mass is pushed against a stop, rebounds, and touches it five times. Displacements by DOP853 of
/// SciPy, which ends at every touch and release, with errors of 1e-12 per step.
#[test]
fn a_half_sine_shock_against_a_gap() {
    let study = format!(
        "[[mass]]\nname = \"m\"\nmass = \"2 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"300 N/m\"\n\
         damping = \"1 N s/m\"\n[[joint]]\nname = \"stop\"\nbetween = [\"m\", \"ground\"]\nlaw = {{ kind = \"gap\", gap = \
         \"20 mm\", stiffness = \"5 N/mm\" }}\n[[force]]\non = \"m\"\nsignal = {{ kind = \"half-sine\", amplitude = \"25 N\", \
         duration = \"0.4 s\", begin = \"0.1 s\" }}\n{TRANSIENT}"
    );
    let found = motion("time_s,force_N\n0,0\n1,0\n", &study, "m_displacement_m");
    for (time, x) in [
        (0.1, 0.0),
        (0.25, 3.2468408379e-2),
        (0.4, 3.0158544612e-2),
        (0.55, -1.8918220717e-2),
        (0.7, -1.4707666246e-2),
        (0.85, 2.2654091234e-2),
        (1.0, -1.6827832333e-2),
        (1.15, -1.2849698272e-2),
        (1.3, 2.1760220953e-2),
        (1.6, -1.6143009423e-2),
        (1.9, 5.6822043526e-3),
    ] {
        let row = found.iter().find(|(t, _)| (t - time).abs() < 1e-9).expect("a row");
        // the signal is linear between its rows
        assert!((row.1 - x).abs() < 2e-4 * 0.03, "{time}: {} {x}", row.1);
    }
}

/// A deck on a sliding isolator in two directions under an earthquake-like record, with 22 changes
/// between stick and slip. `data/isolator.py` writes the record, and the motion by SciPy.
#[test]
fn an_isolator_slides_in_two_directions() {
    let study = "[[mass]]\nname = \"deck\"\nmass = \"1000 kg\"\ndirections = [\"x\", \"y\"]\n\
        [[spring]]\nbetween = [\"deck.x\", \"ground\"]\nstiffness = \"10 kN/m\"\n\
        [[spring]]\nbetween = [\"deck.y\", \"ground\"]\nstiffness = \"10 kN/m\"\n\
        [[joint]]\nname = \"slide\"\nbetween = [\"deck\", \"ground\"]\n\
        law = { kind = \"jenkins-2d\", stiffness = \"200 kN/m\", limit = \"600 N\" }\n\
        [[motion]]\non = \"ground\"\nalong = \"x\"\ndata = \"record\"\ncolumn = \"east_m_per_s2\"\n\
        [[motion]]\non = \"ground\"\nalong = \"y\"\ndata = \"record\"\ncolumn = \"north_m_per_s2\"\n\
        [study]\nkind = \"transient\"\nduration = \"8 s\"\ntime_step = \"10 ms\"\n";
    let record = include_str!("data/isolator.csv");
    let expected = include_str!("data/isolator_motion.csv");
    for (column, at) in [("deck.x_displacement_m", 1), ("deck.y_displacement_m", 2)] {
        let found = motion(record, study, column);
        for line in expected.lines().skip(1) {
            let row: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
            let own = found.iter().find(|(time, _)| (time - row[0]).abs() < 1e-9).expect("a row");
            // the largest displacement is 60 mm
            assert!((own.1 - row[at]).abs() < 1e-4 * 0.06, "{column} at {} s: {} {}", row[0], own.1, row[at]);
        }
    }
}

/// A chirp through resonance against the classical Runge-Kutta method.
#[test]
fn a_chirp_through_resonance() {
    let tau = std::f64::consts::TAU;
    for (scale, from, to) in [("linear", 1.0f64, 4.0f64), ("log", 4.0, 1.0)] {
        let phase = |t: f64| match scale {
            "linear" => tau * (from * t + 0.5 * (to - from) / 2.0 * t * t),
            _ => tau * from * 2.0 / (to / from).ln() * ((to / from).powf(t / 2.0) - 1.0),
        };
        let slope = |t: f64, [x, v]: [f64; 2]| [v, (5.0 * phase(t).sin() - 300.0 * x) / 2.0];
        let signal = format!(
            "{{ kind = \"chirp\", amplitude = \"5 N\", from = \"{from} Hz\", to = \"{to} Hz\", duration = \"2 s\", scale \
             = \"{scale}\" }}"
        );
        let (mut state, h, mut worst, mut largest) = ([0.0f64; 2], 1e-3, 0.0f64, 0.0f64);
        for (row, (t, x)) in under_signal(&signal).into_iter().enumerate() {
            worst = worst.max((x - state[0]).abs());
            largest = largest.max(x.abs());
            for i in 0..10 {
                let t = t + h * f64::from(i);
                let on = |k: [f64; 2], h: f64| [state[0] + h * k[0], state[1] + h * k[1]];
                let a = slope(t, state);
                let b = slope(t + 0.5 * h, on(a, 0.5 * h));
                let c = slope(t + 0.5 * h, on(b, 0.5 * h));
                let d = slope(t + h, on(c, h));
                state = std::array::from_fn(|k| state[k] + h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]));
            }
            assert!(row < 202);
        }
        assert!(worst < 2e-3 * largest, "{scale}: {worst} of {largest}");
    }
}

/// A mass slides by 0.45 m under a force above its slip limit of 1.5 N: the work on the joint is the
/// limit times the distance. The spectra have a line per frequency.
#[test]
fn further_tables_of_a_motion() {
    let study = format!(
        "[[mass]]\nname = \"m\"\nmass = \"2 kg\"\n[[joint]]\nname = \"j\"\nbetween = [\"m\", \"ground\"]\nlaw = {{ kind = \
         \"coulomb\", limit = \"1.5 N\" }}\n[[force]]\non = \"m\"\ndata = \"record\"\n{TRANSIENT}also = [\"joint_work\", \
         \"spectrum\", \"shock_spectrum\"]\n"
    );
    let rows = "time_s,force_N\n0,2\n5,2\n";
    let dataset = try_run(rows, &study).unwrap_or_else(|error| panic!("{error}"));
    let numbers = |table: &str, column: &str| {
        let found = dataset.tables.iter().find(|one| one.name == table).unwrap_or_else(|| panic!("no table {table}"));
        found.numbers(column).unwrap_or_else(|| panic!("no column {column}")).to_vec()
    };
    let (work, distance) = (numbers("joint_work", "j_work_J"), numbers("motion", "m_displacement_m"));
    assert!((distance[200] - 0.5).abs() < 1e-9, "{}", distance[200]);
    for (work, distance) in work.iter().zip(&distance) {
        assert!((work - 1.5 * distance).abs() < 1e-9, "{work} {distance}");
    }
    let frequency = numbers("spectrum", "frequency_Hz");
    assert!(frequency.len() == 22 && (frequency[0] - 1.0 / 0.44).abs() < 1e-9, "{frequency:?}");
    assert!(numbers("spectrum", "m_displacement_density_m2_per_Hz")[0] > 0.0);
    // a constant acceleration of 0.25 m/s²: an oscillator overshoots to nearly twice of it
    let shock = numbers("shock_spectrum", "m_largest_acceleration_m_per_s2");
    assert!(shock.iter().all(|a| (0.25..0.5).contains(a)), "{shock:?}");
    let error = try_run(rows, &study.replace("\"spectrum\"", "\"spektrum\"")).expect_err("an unknown table");
    assert!(error.contains("no table `spektrum`"), "{error}");
}

/// The ground accelerates by 2 m/s² under a stiff structure, which moves with it: oscillators on the
/// structure see this acceleration, and overshoot by `e^(-πζ/√(1 - ζ²))`, 85 %.
#[test]
fn shock_spectra_include_the_motion_of_the_ground() {
    let study = format!(
        "[[mass]]\nname = \"m\"\nmass = \"2 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"1e6 N/m\"\n\
         damping = \"1e3 N s/m\"\n[[motion]]\non = \"ground\"\ndata = \"record\"\n{TRANSIENT}also = [\"shock_spectrum\"]\n"
    );
    let study = study.replace("2 s\"", "4 s\"");
    let dataset = try_run("time_s,acceleration_m_per_s2\n0,2\n5,2\n", &study).unwrap_or_else(|error| panic!("{error}"));
    let table = dataset.tables.iter().find(|one| one.name == "shock_spectrum").unwrap();
    let numbers = |column: &str| table.numbers(column).unwrap_or_else(|| panic!("no column {column}")).to_vec();
    for (hertz, largest) in numbers("frequency_Hz").iter().zip(numbers("m_largest_acceleration_m_per_s2")) {
        if (0.5..5.0).contains(hertz) {
            assert!((largest / 3.7089 - 1.0).abs() < 5e-3, "{hertz} Hz: {largest}");
        }
    }
}

/// A half-sine of 11 ms under a soft structure, whose small acceleration is a difference of large
/// ones. Many rows of the signal lie between two samples. Expected: DOP853 of SciPy.
#[test]
fn shock_spectra_see_pulses_between_samples() {
    let study = "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \
                 \"1000 N/m\"\ndamping = \"2 N s/m\"\n[[motion]]\non = \"ground\"\nsignal = { kind = \"half-sine\", amplitude = \
                 \"100 m/s^2\", duration = \"11 ms\" }\n[study]\nkind = \"transient\"\nduration = \"1 s\"\ntime_step = \"1 ms\"\n\
                 also = [\"shock_spectrum\"]\n";
    let dataset = run(&read_study("study.toml", study, &[]).unwrap(), &Context::without_progress(1)).unwrap();
    let table = dataset.tables.iter().find(|one| one.name == "shock_spectrum").unwrap();
    let frequency = table.numbers("frequency_Hz").unwrap();
    let row = frequency.iter().position(|hertz| (hertz - 67.7379).abs() < 1e-4).expect("the frequency");
    let largest = table.numbers("m_largest_acceleration_m_per_s2").unwrap()[row];
    assert!((largest / 21.20603 - 1.0).abs() < 1e-3, "{largest}");
}

/// A mass on a spring with dry friction turns at 0.1, -0.08, 0.06, -0.04 and 0.02 m, and friction
/// takes 0.4 N times the way, also with ten samples a period. Three samples a period are too few to
/// follow the motion.
#[test]
fn tables_of_few_samples() {
    let study = |step: &str| {
        format!(
            "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \
             \"40 N/m\"\n[[joint]]\nname = \"j\"\nbetween = [\"m\", \"ground\"]\nlaw = {{ kind = \"coulomb\", limit = \
             \"0.4 N\" }}\n[study]\nkind = \"transient\"\nstart = {{ m = \"0.1 m\" }}\nduration = \"{} s\"\ntime_step = \
             \"{step}\"\nalso = [\"joint_work\"]\n",
            2.0 * std::f64::consts::TAU / f64::sqrt(40.0)
        )
    };
    let dataset =
        run(&read_study("study.toml", &study("100 ms"), &[]).unwrap(), &Context::without_progress(1)).unwrap();
    let table = dataset.tables.iter().find(|one| one.name == "joint_work").unwrap();
    let (time, work) = (table.numbers("time_s").unwrap(), table.numbers("j_work_J").unwrap());
    let (last, rate) = (time.len() - 1, f64::sqrt(40.0));
    assert!((time[last] - 1.9).abs() < 1e-9, "{time:?}");
    // in the fourth half of a period, about the place -0.01 m
    let x = -0.01 - 0.03 * (rate * time[last] - 3.0 * std::f64::consts::PI).cos();
    let way = 0.18 + 0.14 + 0.1 + (x + 0.04);
    assert!((work[last] / (0.4 * way) - 1.0).abs() < 2e-3, "{work:?} {way}");
    let noted = |dataset: &Dataset| dataset.notes.iter().any(|note| note.contains("too far apart to follow"));
    assert!(!noted(&dataset), "{:?}", dataset.notes);
    let coarse = run(&read_study("study.toml", &study("300 ms"), &[]).unwrap(), &Context::without_progress(1)).unwrap();
    assert!(noted(&coarse), "{:?}", coarse.notes);
}

#[test]
fn signals_are_checked() {
    let study = |signal: &str| {
        format!(
            "[[mass]]\nname = \"m\"\nmass = \"2 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"300 \
             N/m\"\n[[motion]]\non = \"ground\"\nsignal = {signal}\n{TRANSIENT}"
        )
    };
    let run = |signal: &str| try_run("time_s,force_N\n0,0\n1,0\n", &study(signal));
    let random =
        "{ kind = \"random\", density = \"0.1 m^2/s^4/Hz\", from = \"1 Hz\", to = \"8 Hz\", duration = \"2 s\" }";
    let rms = |signal: &str| {
        let dataset = run(signal).unwrap_or_else(|error| panic!("{error}"));
        let table = dataset.tables.iter().find(|table| table.name == "motion_summary").expect("a summary").clone();
        table.numbers("rms_displacement_m").expect("a number")[0]
    };
    let (first, other) = (rms(random), rms(&random.replace("duration", "seed = 2, duration")));
    assert!(first > 0.0 && first == rms(random) && first != other, "{first} {other}");
    for (signal, words) in [
        ("{ kind = \"half-sine\", duration = \"1 s\" }", "needs `amplitude`"),
        ("{ kind = \"half-sine\", amplitude = \"1 N\", duration = \"1 s\" }", "expected"),
        ("{ kind = \"square\", duration = \"1 s\" }", "half-sine"),
        ("{ kind = \"chirp\", amplitude = \"1 m/s^2\", from = \"1 Hz\", duration = \"1 s\" }", "needs `to`"),
        (
            "{ kind = \"chirp\", amplitude = \"1 m/s^2\", from = \"1 Hz\", to = \"1 MHz\", duration = \"9 s\" }",
            "the limit is 2e6",
        ),
        (&random.replace("1 Hz", "1.1 Hz").replace("8 Hz", "1.4 Hz"), "narrower"),
    ] {
        let error = run(signal).expect_err(signal);
        assert!(error.contains(words), "{signal}: {error}");
    }
}

#[test]
fn wrong_records_are_refused() {
    let rows = "time_s,force_N\n0,0\n1,1\n";
    let study = format!(
        "[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"1 N/m\"\n\
         [[force]]\non = \"m\"\ndata = \"record\"\n{TRANSIENT}"
    );
    assert!(try_run(rows, &study).is_ok());
    for (from, to, part) in [
        ("data = \"record\"", "data = \"recrd\"", "no [[data]] `recrd`"),
        ("data = \"record\"", "data = \"record\"\namplitude = \"1 N\"", "exclude each other"),
        ("data = \"record\"", "", "`amplitude` is missing in force 1"),
        ("data = \"record\"", "data = \"record\"\ncolumn = \"force_kN\"", "no column `force_kN`"),
        ("duration = \"2 s\"", "duration = \"2 s\"\nfrequency = \"1 Hz\"", "exclude each other"),
        ("[study]", "[[force]]\non = \"m\"\namplitude = \"1 N\"\n[study]", "exclude each other"),
        (
            "kind = \"transient\"\nduration = \"2 s\"\ntime_step = \"10 ms\"",
            "kind = \"response\"\nfrequency = \"1 Hz\"",
            "transient",
        ),
    ] {
        let error = try_run(rows, &study.replacen(from, to, 1)).expect_err(to);
        assert!(error.contains(part), "{to}: {error}");
    }
    for rows in [
        "time_s,force_N\n0,0\n0,1\n",
        "time_s,force_N\n0,0\n",
        "time_s,force_m\n0,0\n1,1\n",
        "time_s,force_N\n0,0\n1,\n2,1\n",
    ] {
        assert!(try_run(rows, &study).is_err(), "{rows}");
    }
}
