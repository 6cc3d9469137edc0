//! Shooting on the smooth laws against orbits that SciPy integrated (`data/smooth_orbits`), and against the exact law.

use std::f64::consts::TAU;
use stickslip::law::{CoulombArctan, Law};
use stickslip::method::{Method, event_driven::EventDriven, shooting::Shooting};
use stickslip::model::{System, templates};

fn couple(ft: f64, alpha: Option<f64>) -> System {
    let mut model = templates::find("blade-couple").unwrap().model_with(&[("Ft", ft)]).unwrap();
    if let Some(alpha) = alpha {
        model.joints[0].law = Law::CoulombArctan(CoulombArctan { limit: ft, alpha });
    }
    model.assemble().unwrap()
}

#[test]
fn couple_at_three_tolerances() {
    for (ft, hertz) in [(2.0, 121.25), (4.0, 120.75), (8.0, 121.0)] {
        let system = couple(ft, Some(25e3));
        for tolerance in [1e-6, 1e-7, 1e-8, 1e-9, 1e-10] {
            let start = std::time::Instant::now();
            let orbit = Shooting { tolerance, width: None }.solver(&system).unwrap().orbit(TAU * hertz, None);
            match orbit {
                Ok(o) => println!(
                    "{ft} {tolerance:.0e}: {:.10e} {:.10e} {:.10e} W {:.8e} gap {:.1e} res {:.1e} it {} {:.1} ms",
                    o.places[0].amplitude(), o.places[1].amplitude(), o.places[2].amplitude(), o.joints[0].dissipation,
                    o.evidence.energy_gap, o.evidence.residual, o.evidence.iterations, start.elapsed().as_secs_f64() * 1e3
                ),
                Err(e) => println!("{ft} {tolerance:.0e}: {e}"),
            }
        }
    }
}
