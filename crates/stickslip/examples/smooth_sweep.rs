//! Times shooting over the paper's Fig. 6 with the arctan law.

use std::f64::consts::TAU;
use std::time::Instant;
use stickslip::law::{CoulombArctan, Law};
use stickslip::method::{Method, shooting::Shooting};
use stickslip::model::templates;
fn main() {
    let m1: f64 = std::env::args().nth(1).map_or(0.00182, |s| s.parse().unwrap());
    for ft in [2.0, 4.0, 6.0, 8.0] {
        let mut model = templates::find("blade-couple").unwrap().model_with(&[("Ft", ft), ("m1", m1)]).unwrap();
        model.joints[0].law = Law::CoulombArctan(CoulombArctan { limit: ft, alpha: 25e3 });
        let system = model.assemble().unwrap();
        let mut solver = Shooting::default().solver(&system).unwrap();
        let start = Instant::now();
        let mut state: Option<Vec<f64>> = None;
        let (mut failed, mut its, mut slow) = (0, 0, Vec::new());
        for i in 0..241 {
            let f = 119.5 + 3.0 * i as f64 / 240.0;
            let t = Instant::now();
            match solver.orbit(TAU * f, state.as_deref()) {
                Ok(o) => {
                    its += o.evidence.iterations;
                    state = Some(o.start);
                }
                Err(e) => {
                    failed += 1;
                    println!("{f}: {e}");
                }
            }
            let t = t.elapsed().as_secs_f64();
            if t > 0.1 {
                slow.push((f, t));
                println!("slow {f} {t}");
                if slow.len() > 5 {
                    break;
                }
            }
        }
        println!(
            "Ft={ft}: failed {failed}, iterations {its}; {:.2} ms/orbit, slow {slow:?}",
            start.elapsed().as_secs_f64() * 1e3 / 241.0
        );
    }
}
