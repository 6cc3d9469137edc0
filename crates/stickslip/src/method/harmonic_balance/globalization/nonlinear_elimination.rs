//! Nonlinear elimination: contacts at which a Newton step fails are solved
//! locally; the others follow linearly.
//!
//! A Newton step `d` of all contacts solves the linear equations. A few contacts that
//! begin to slip or to stick leave a residual. A line search over all contacts would
//! take many steps to reduce it. Let `φ(d) = f(c - d) - f(c) + K d` be the nonlinear
//! part of the forces of these contacts, and `S` the receptance of the structure with
//! the derivatives of all contacts. The step `d₀` of all contacts becomes
//!
//! `d = d₀ + S φ(d)`,
//!
//! a small system along the few contacts. It is solved cluster by cluster, each
//! with its own line search, on the subdomain of the structure around it
//! (additive Schwarz). The step of all contacts then uses the whole `S`.
//!
//! Source: Lanzkron, Rose, Wilkes (1996), "An analysis of approximate nonlinear elimination
//! algorithms"; Cai, Li (2011), "Inexact Newton methods with restricted additive Schwarz based
//! nonlinear elimination for problems with high local nonlinearity".

use super::homotopy::Homotopy;
use super::subdomain::{Adjacency, NonlinearElimination, Subdomain};
use crate::method::harmonic_balance::aft::{Port, Ports, block};
use crate::method::harmonic_balance::equations::harmonic_set::weight;
use crate::method::harmonic_balance::equations::{DerivativeScope, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::newton::{HALVINGS, SHORTENS};
use num_complex::Complex64;

/// Residual along a contact, relative to the largest, above which the contact is solved locally.
const MISSED: f64 = 0.1;
/// Maximum number of axes of a cluster.
const MOST_AXES: usize = 16;
/// Layers of adjacent places in the subdomain of a cluster.
const AROUND: usize = 3;
/// Maximum number of Newton steps in a cluster, and the share of the residual that they may
/// leave; the next step of all contacts reduces the remainder.
const STEPS: usize = 20;
const LEFT: f64 = 1e-3;
/// Share of the residual that the elimination may leave at most to be used again at this point.
/// It does not pay off if motion decays slowly from blade to blade, or if most contacts fail.
const WORTH: f64 = 0.5;

/// Forces along the axes of a cluster after a trial step.
#[derive(Debug, Default, Clone)]
struct TrialStep {
    step: Vec<f64>,
    /// φ and its derivative.
    beyond: Vec<f64>,
    slopes: Vec<f64>,
    /// Residual of `d = d₀ + S φ(d)`, m.
    rest: Vec<f64>,
    residual: Vec<f64>,
    size: f64,
}

impl Discretization {
    /// Tells whether nonlinear elimination can follow the next step. Stores the
    /// derivatives of that step.
    pub(crate) fn can_settle(&mut self, ports: &Ports) -> bool {
        let Some(sparse) = self.sparse.as_ref().filter(|_| self.springs.is_empty()) else { return false };
        if ports.iter().any(|port| port.is_force() || port.marches()) {
            return false;
        }
        let settling = self.settling.get_or_insert_with(|| NonlinearElimination::new(Adjacency::new(sparse, ports)));
        if settling.helps {
            settling.tangents.clone_from(&self.tangents);
        }
        settling.helps
    }

    /// Solves failed contacts locally, after a full step with a residual above `beaten`. Writes
    /// the new solution into `motion`. Returns its residual if that is less than `beaten`;
    /// otherwise restores the step of all contacts.
    pub(crate) fn settle(
        &mut self,
        ports: &Ports,
        (omega, ease): (f64, Homotopy),
        motion: &mut HarmonicSolution,
        (length, beaten): (f64, f64),
    ) -> Option<f64> {
        let mut settling = self.settling.take()?;
        let after = self.settled(&mut settling, ports, (omega, ease), motion, length);
        settling.helps = after.is_some_and(|after| after < WORTH * beaten);
        let after = after.filter(|after| *after < (1.0 - SHORTENS) * beaten);
        if after.is_none() {
            self.step.copy_from_slice(&settling.step);
        }
        self.settling = Some(settling);
        after
    }

    fn settled(
        &mut self,
        settling: &mut NonlinearElimination,
        ports: &Ports,
        (omega, ease): (f64, Homotopy),
        motion: &mut HarmonicSolution,
        length: f64,
    ) -> Option<f64> {
        let NonlinearElimination { neighbours, tangents, step, beyond, left, .. } = settling;
        step.clone_from(&self.step);
        let sizes: Vec<f64> = ports.iter().map(|port| self.left_along(port)).collect();
        let largest = sizes.iter().fold(0.0, |most: f64, size| most.max(*size));
        let missed: Vec<bool> = sizes.iter().map(|size| *size > MISSED * largest).collect();
        for sums in [&mut *beyond, &mut *left] {
            sums.clear();
            sums.resize(step.len(), 0.0);
        }
        for cluster in neighbours.clusters(ports, &missed, MOST_AXES) {
            let sparse = self.sparse.as_ref()?;
            let at = (&*cluster, AROUND);
            let mut window = Subdomain::new(sparse, neighbours, ports, at, (tangents, &self.blocks))?;
            let along = (&**tangents, &**step, &mut **beyond, &mut **left);
            self.settle_cluster(ports, &cluster, &mut window, along, (omega, ease, length));
        }
        self.eliminated += 1;
        // the step of all contacts with the nonlinear parts of these forces
        self.sparse.as_mut()?.receive_all(beyond);
        for ((d, left), (step, moved)) in self.step.iter_mut().zip(&*left).zip(step.iter().zip(&*beyond)) {
            *d = step + (moved + left) / length;
        }
        self.advance(ports, motion, 1.0, length);
        Some(self.evaluate(ports, omega, motion, ease, length, DerivativeScope::Cheap))
    }

    /// Returns the size of the residual along a port, weighted as velocities.
    fn left_along(&self, port: &Port) -> f64 {
        let nh = self.harmonics().len();
        let pairs = self.residual[2 * port.first * nh..2 * (port.first + port.axes) * nh].chunks_exact(2);
        let weights = self.harmonics().iter().cycle().map(|h| weight(*h));
        pairs.zip(weights).map(|(r, w)| w * (r[0] * r[0] + r[1] * r[1])).sum::<f64>().sqrt()
    }

    /// Solves `d = d₀ + S φ(d)` along the axes of a cluster, from the step tried last or from
    /// zero. Writes φ into `beyond` and the residual into `left`.
    fn settle_cluster(
        &mut self,
        ports: &Ports,
        cluster: &[usize],
        window: &mut Subdomain,
        (tangents, step, beyond, left): (&[f64], &[f64], &mut [f64], &mut [f64]),
        (omega, ease, length): (f64, Homotopy, f64),
    ) {
        let pair = 2 * self.harmonics().len();
        let along = |values: &[f64]| -> Vec<f64> {
            let ranges = cluster.iter().map(|p| pair * ports[*p].first..pair * (ports[*p].first + ports[*p].axes));
            ranges.flat_map(|range| values[range].iter().map(|d| d * length)).collect()
        };
        let goal = along(step);
        let slopes = cluster.iter().map(|p| (pair * ports[*p].axes).pow(2)).sum();
        let zero = TrialStep {
            step: vec![0.0; goal.len()],
            beyond: vec![0.0; goal.len()],
            slopes: vec![0.0; slopes],
            rest: goal.iter().map(|d| -d).collect(),
            residual: Vec::new(),
            size: 0.0,
        };
        let mut trial = TrialStep { step: along(&self.step), ..zero.clone() };
        let mut now = zero;
        self.measure_cluster(ports, cluster, window, tangents, &mut now);
        let whole = now.size;
        self.try_cluster(ports, cluster, window, (tangents, &goal), (omega, ease), &mut trial);
        if trial.size < now.size {
            std::mem::swap(&mut now, &mut trial);
        }
        let (mut change, mut pull) = (vec![0.0; goal.len()], vec![0.0; goal.len()]);
        for _ in 0..STEPS {
            if now.size < LEFT * whole || !window.change(cluster.iter().map(|p| ports[*p].axes), &now.slopes) {
                break;
            }
            // (1 + S ΔK)⁻¹ r = r - S' ΔK r
            multiply(ports, cluster, pair, &now.slopes, &now.rest, &mut pull);
            window.receive_changed(&mut pull);
            change.iter_mut().zip(now.rest.iter().zip(&pull)).for_each(|(d, (r, u))| *d = r - u);
            let mut fraction = 1.0;
            let mut found = false;
            for _ in 0..=HALVINGS {
                let steps = trial.step.iter_mut().zip(now.step.iter().zip(&change));
                steps.for_each(|(trial, (now, change))| *trial = now - fraction * change);
                self.try_cluster(ports, cluster, window, (tangents, &goal), (omega, ease), &mut trial);
                found = trial.size < (1.0 - SHORTENS * fraction) * now.size;
                if found {
                    break;
                }
                fraction *= 0.5;
            }
            if !found {
                break;
            }
            std::mem::swap(&mut now, &mut trial);
        }
        let mut at = 0;
        for port in cluster.iter().map(|p| &ports[*p]) {
            let own = port.axes * pair;
            beyond[pair * port.first..][..own].copy_from_slice(&now.beyond[at..at + own]);
            left[pair * port.first..][..own].copy_from_slice(&now.rest[at..at + own]);
            at += own;
        }
    }

    /// Computes φ after a step, its derivative, and the residual of `d = d₀ + S φ(d)`.
    fn try_cluster(
        &mut self,
        ports: &Ports,
        cluster: &[usize],
        window: &mut Subdomain,
        (tangents, goal): (&[f64], &[f64]),
        (omega, ease): (f64, Homotopy),
        trial: &mut TrialStep,
    ) {
        let nh = self.harmonics().len();
        let (mut at, mut from) = (0, 0);
        let [mut c, mut force] = [const { Vec::new() }; 2];
        for &p in cluster {
            let port = &ports[p];
            let (own, range) = (2 * nh * port.axes, port.first * nh..(port.first + port.axes) * nh);
            let step = &trial.step[at..at + own];
            let slopes = &mut trial.slopes[from..from + own * own];
            c.clear();
            let before = self.before.c[range.clone()].iter();
            c.extend(before.zip(step.chunks_exact(2)).map(|(c, d)| c - Complex64::new(d[0], d[1])));
            force.clone_from(&c);
            self.alternation.respond(port, (omega, ease.limits), &c, &mut force, Some(slopes));
            let given = &tangents[block(&self.blocks, p, port, nh)];
            slopes.iter_mut().zip(given).for_each(|(slope, given)| *slope -= given);
            let changed = force
                .iter()
                .zip(&self.before.force[range])
                .flat_map(|(f, before)| [f.re - before.re, f.im - before.im]);
            for (beyond, (changed, row)) in trial.beyond[at..].iter_mut().zip(changed.zip(given.chunks_exact(own))) {
                *beyond = changed + row.iter().zip(step).map(|(k, d)| k * d).sum::<f64>();
            }
            (at, from) = (at + own, from + own * own);
        }
        trial.rest.copy_from_slice(&trial.beyond);
        window.receive(&mut trial.rest);
        trial
            .rest
            .iter_mut()
            .zip(trial.step.iter().zip(goal))
            .for_each(|(rest, (step, goal))| *rest = step - goal - *rest);
        self.measure_cluster(ports, cluster, window, tangents, trial);
    }

    /// Computes the size of the residual of a trial, `J (d - d₀ - S φ)`.
    fn measure_cluster(
        &self,
        ports: &Ports,
        cluster: &[usize],
        window: &mut Subdomain,
        tangents: &[f64],
        trial: &mut TrialStep,
    ) {
        let nh = self.harmonics().len();
        trial.residual.resize(trial.rest.len(), 0.0);
        let mut at = 0;
        for &p in cluster {
            let port = &ports[p];
            let own = 2 * nh * port.axes;
            let rows = tangents[block(&self.blocks, p, port, nh)].chunks_exact(own);
            for (out, row) in trial.residual[at..].iter_mut().zip(rows) {
                *out = row.iter().zip(&trial.rest[at..at + own]).map(|(k, r)| k * r).sum();
            }
            at += own;
        }
        window.receive_alone(&mut trial.residual);
        trial.residual.iter_mut().zip(&trial.rest).for_each(|(out, rest)| *out += rest);
        trial.size = self.weighted(&trial.residual);
    }

    /// Returns the size of a vector along whole axes, weighted as velocities.
    fn weighted(&self, values: &[f64]) -> f64 {
        let weights = self.harmonics().iter().cycle().map(|h| weight(*h));
        values.chunks_exact(2).zip(weights).map(|(v, w)| w * (v[0] * v[0] + v[1] * v[1])).sum::<f64>().sqrt()
    }
}

/// Multiplies one block per port by a vector, into another vector.
fn multiply(ports: &Ports, cluster: &[usize], pair: usize, blocks: &[f64], by: &[f64], out: &mut [f64]) {
    let (mut at, mut from) = (0, 0);
    for port in cluster.iter().map(|p| &ports[*p]) {
        let own = pair * port.axes;
        let rows = blocks[from..from + own * own].chunks_exact(own);
        for (out, row) in out[at..at + own].iter_mut().zip(rows) {
            *out = row.iter().zip(&by[at..at + own]).map(|(k, r)| k * r).sum();
        }
        (at, from) = (at + own, from + own * own);
    }
}
