//! Additional cases for the claims: other slip limits, contact stiffnesses and frequencies.

use crate::measure::{Curve, Loop, curves, loops};
use crate::optimum::Optimum;
use crate::studies::read;
use stickslip_study::run::{Context, run};

/// Additional cases; empty if the run was interrupted.
#[derive(Debug, Default)]
pub struct AdditionalCases {
    /// Contact stiffness (N/m) and the curves of Fig. 6 with it.
    pub stiffness: Vec<(f64, Vec<Curve>)>,
    /// Peaks over the slip limit, non-symmetric element.
    pub couple: Option<Optimum>,
    /// Peaks over the slip limit, non-symmetric element with m1 = m/200.
    pub light: Option<Optimum>,
    /// Peaks over the slip limit, symmetric element.
    pub symmetric: Option<Optimum>,
    /// Frequency of the loops (rad/s), and the loops of Figs. 3 and 4.
    pub omega: Vec<(f64, Vec<Loop>, Vec<Loop>)>,
}

/// Contact stiffnesses for the claim about `kt`.
const STIFFNESSES: [(f64, &str); 4] = [(5e3, "5000 N/m"), (1e4, "10000 N/m"), (2e4, "20000 N/m"), (4e4, "40000 N/m")];
/// Frequencies that support the inferred frequency of the loops.
const OMEGAS: [(f64, &str); 4] =
    [(0.5, "0.5 rad/s"), (1.0, "1 rad/s"), (2.0, "2 rad/s"), (std::f64::consts::TAU, "6.283185307179586 rad/s")];

impl AdditionalCases {
    /// Computes the cases. `points` replaces the number of points of response curves.
    pub fn new(context: &Context, points: Option<usize>) -> AdditionalCases {
        // An interrupted or failed case leaves only its claim without a measurement.
        let with = |name: &str, key: &str, value: &str| {
            let study = read(name, points, &[(key, value)]).ok()?;
            let dataset = run(&study, context).ok()?;
            Some((study, dataset))
        };
        let stopped = || context.stopped();
        if stopped() {
            return AdditionalCases::default();
        }
        let stiffness = STIFFNESSES
            .iter()
            .filter_map(|(kt, text)| {
                let (study, dataset) = with("fig06", "kt", text)?;
                Some((*kt, curves(&study, &dataset)?))
            })
            .collect();
        let all = |names: [&str; 2], text: &str| {
            let mut all = Vec::new();
            for name in names {
                let (study, dataset) = with(name, "omega", text)?;
                all.extend(loops(&study, &dataset)?);
            }
            Some(all)
        };
        let omega = OMEGAS
            .iter()
            .filter_map(|(w, text)| Some((*w, all(["fig03a", "fig03b"], text)?, all(["fig04a", "fig04b"], text)?)))
            .collect();
        let optimum = |name: &str| Optimum::new(&read(name, points, &[]).ok()?, context);
        let additional = AdditionalCases {
            stiffness,
            omega,
            couple: optimum("fig06_optimum"),
            light: optimum("fig07_optimum"),
            symmetric: optimum("fig10_optimum"),
        };
        if stopped() { AdditionalCases::default() } else { additional }
    }
}
