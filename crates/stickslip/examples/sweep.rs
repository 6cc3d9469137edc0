//! Sweeps the paper's couple and prints counts and speed.
use std::f64::consts::TAU;
use std::time::Instant;
use stickslip::method::{Method, event_driven::EventDriven};
use stickslip::model::templates;

fn main() {
    for (template, m1) in [("blade-couple", 0.00182), ("blade-couple", 0.00091), ("symmetric-couple", 0.00182)] {
        for ft in [2.0, 4.0, 6.0, 8.0] {
            let model = templates::find(template).unwrap().model_with(&[("Ft", ft), ("m1", m1)]).unwrap();
            let system = if template == "blade-couple" && m1 < 0.001 {
                templates::find(template).unwrap().model_with(&[("Ft", ft), ("m1", m1)]).unwrap().assemble().unwrap()
            } else {
                model.assemble().unwrap()
            };
            let mut solver = EventDriven.solver(&system).unwrap();
            let start = Instant::now();
            let mut state: Option<Vec<f64>> = None;
            let (mut failed, mut its, mut gap, mut res, mut peak) = (0, 0, 0.0f64, 0.0f64, (0.0f64, 0.0));
            for i in 0..241 {
                let f = 119.5 + 3.0 * i as f64 / 240.0;
                match solver.orbit(TAU * f, state.as_deref()) {
                    Ok(o) => {
                        its += o.evidence.iterations;
                        gap = gap.max(o.evidence.energy_gap);
                        res = res.max(o.evidence.residual);
                        let a = o.places[0].amplitude();
                        if a > peak.0 {
                            peak = (a, f)
                        }
                        state = Some(o.start);
                    }
                    Err(e) => {
                        failed += 1;
                        println!("{f}: {e}");
                    }
                }
            }
            let t = start.elapsed().as_secs_f64();
            println!(
                "{template} {m1} Ft={ft}: failed {failed}, iterations {its}, gap {gap:.1e}, residual {res:.1e}, peak {:.5} cm @ {:.3}; {:.1} us/orbit",
                100.0 * peak.0,
                peak.1,
                t * 1e6 / 241.0
            );
        }
    }
}
