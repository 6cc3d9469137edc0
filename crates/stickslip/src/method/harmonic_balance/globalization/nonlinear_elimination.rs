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
use crate::method::harmonic_balance::aft::{Port, Ports, tangent_range};
use crate::method::harmonic_balance::equations::harmonic_set::velocity_weight;
use crate::method::harmonic_balance::equations::{DerivativeScope, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::newton::{HALVINGS, SUFFICIENT_DECREASE};
use num_complex::Complex64;

/// Residual along a contact, relative to the largest, above which the contact is solved locally.
const LOCAL_RESIDUAL: f64 = 0.1;
/// Maximum number of axes of a cluster.
const MOST_AXES: usize = 16;
/// Layers of adjacent places in the subdomain of a cluster.
const OVERLAP_LAYERS: usize = 3;
/// Maximum number of Newton steps in a cluster, and the share of the residual that they may
/// leave; the next step of all contacts reduces the remainder.
const STEPS: usize = 20;
const CLUSTER_TOLERANCE: f64 = 1e-3;
/// Share of the residual that the elimination may leave at most to be used again at this point.
/// It does not pay off if motion decays slowly from blade to blade, or if most contacts fail.
const USEFUL_SHARE: f64 = 0.5;

/// Forces along the axes of a cluster after a trial step.
#[derive(Debug, Default, Clone)]
struct TrialStep {
    step: Vec<f64>,
    /// φ and its derivative.
    nonlinear_force: Vec<f64>,
    slopes: Vec<f64>,
    /// Residual of `d = d₀ + S φ(d)`, m.
    residual_step: Vec<f64>,
    residual: Vec<f64>,
    size: f64,
}

impl Discretization {
    /// Tells whether nonlinear elimination can follow the next step. Stores the
    /// derivatives of that step.
    pub(crate) fn can_eliminate(&mut self, ports: &Ports) -> bool {
        let Some(banded) = self.banded.as_ref().filter(|_| self.linear.closed_stiffness.is_empty()) else {
            return false;
        };
        if ports.iter().any(|port| port.is_force() || port.has_memory_steps()) {
            return false;
        }
        let settling = self.elimination.get_or_insert_with(|| NonlinearElimination::new(Adjacency::new(banded, ports)));
        if settling.is_useful {
            settling.tangents.clone_from(&self.workspace.tangents);
        }
        settling.is_useful
    }

    /// Solves failed contacts locally, after a full step with a residual above `beaten`. Writes
    /// the new solution into `motion`. Returns its residual if that is less than `beaten`;
    /// otherwise restores the step of all contacts.
    pub(crate) fn eliminate_nonlinear(
        &mut self,
        ports: &Ports,
        (omega, homotopy): (f64, Homotopy),
        motion: &mut HarmonicSolution,
        (length, beaten): (f64, f64),
    ) -> Option<f64> {
        let mut settling = self.elimination.take()?;
        let after = self.eliminate_clusters(&mut settling, ports, (omega, homotopy), motion, length);
        settling.is_useful = after.is_some_and(|after| after < USEFUL_SHARE * beaten);
        let after = after.filter(|after| *after < (1.0 - SUFFICIENT_DECREASE) * beaten);
        if after.is_none() {
            self.workspace.step.copy_from_slice(&settling.step);
        }
        self.elimination = Some(settling);
        after
    }

    fn eliminate_clusters(
        &mut self,
        settling: &mut NonlinearElimination,
        ports: &Ports,
        (omega, homotopy): (f64, Homotopy),
        motion: &mut HarmonicSolution,
        length: f64,
    ) -> Option<f64> {
        let NonlinearElimination { neighbours, tangents, step, nonlinear_forces: beyond, residual_steps: left, .. } =
            settling;
        step.clone_from(&self.workspace.step);
        let sizes: Vec<f64> = ports.iter().map(|port| self.port_residual(port)).collect();
        let largest = sizes.iter().fold(0.0, |most: f64, size| most.max(*size));
        let missed: Vec<bool> = sizes.iter().map(|size| *size > LOCAL_RESIDUAL * largest).collect();
        for sums in [&mut *beyond, &mut *left] {
            sums.clear();
            sums.resize(step.len(), 0.0);
        }
        for cluster in neighbours.clusters(ports, &missed, MOST_AXES) {
            let banded = self.banded.as_ref()?;
            let at = (&*cluster, OVERLAP_LAYERS);
            let mut subdomain = Subdomain::new(banded, neighbours, ports, at, (tangents, &self.blocks))?;
            let along = (&**tangents, &**step, &mut **beyond, &mut **left);
            self.solve_cluster(ports, &cluster, &mut subdomain, along, (omega, homotopy, length));
        }
        self.work.eliminations += 1;
        // the step of all contacts with the nonlinear parts of these forces
        self.banded.as_mut()?.solve_along_axes(beyond);
        for ((d, left), (step, moved)) in self.workspace.step.iter_mut().zip(&*left).zip(step.iter().zip(&*beyond)) {
            *d = step + (moved + left) / length;
        }
        self.apply_step(ports, motion, 1.0, length);
        Some(self.evaluate(ports, omega, motion, homotopy, length, DerivativeScope::Cheap))
    }

    /// Returns the size of the residual along a port, weighted as velocities.
    fn port_residual(&self, port: &Port) -> f64 {
        let nh = self.harmonics().len();
        let pairs =
            self.workspace.residual[2 * port.first_axis * nh..2 * (port.first_axis + port.axes) * nh].chunks_exact(2);
        let weights = self.harmonics().iter().cycle().map(|h| velocity_weight(*h));
        pairs.zip(weights).map(|(r, w)| w * (r[0] * r[0] + r[1] * r[1])).sum::<f64>().sqrt()
    }

    /// Solves `d = d₀ + S φ(d)` along the axes of a cluster, from the step tried last or from
    /// zero. Writes φ into `beyond` and the residual into `left`.
    fn solve_cluster(
        &mut self,
        ports: &Ports,
        cluster: &[usize],
        subdomain: &mut Subdomain,
        (tangents, step, beyond, left): (&[f64], &[f64], &mut [f64], &mut [f64]),
        (omega, homotopy, length): (f64, Homotopy, f64),
    ) {
        let pair = 2 * self.harmonics().len();
        let along = |values: &[f64]| -> Vec<f64> {
            let ranges =
                cluster.iter().map(|p| pair * ports[*p].first_axis..pair * (ports[*p].first_axis + ports[*p].axes));
            ranges.flat_map(|range| values[range].iter().map(|d| d * length)).collect()
        };
        let goal = along(step);
        let slopes = cluster.iter().map(|p| (pair * ports[*p].axes).pow(2)).sum();
        let zero = TrialStep {
            step: vec![0.0; goal.len()],
            nonlinear_force: vec![0.0; goal.len()],
            slopes: vec![0.0; slopes],
            residual_step: goal.iter().map(|d| -d).collect(),
            residual: Vec::new(),
            size: 0.0,
        };
        let mut trial = TrialStep { step: along(&self.workspace.step), ..zero.clone() };
        let mut now = zero;
        self.measure_cluster(ports, cluster, subdomain, tangents, &mut now);
        let whole = now.size;
        self.try_cluster(ports, cluster, subdomain, (tangents, &goal), (omega, homotopy), &mut trial);
        if trial.size < now.size {
            std::mem::swap(&mut now, &mut trial);
        }
        let (mut change, mut pull) = (vec![0.0; goal.len()], vec![0.0; goal.len()]);
        for _ in 0..STEPS {
            if now.size < CLUSTER_TOLERANCE * whole
                || !subdomain.factor_changed(cluster.iter().map(|p| ports[*p].axes), &now.slopes)
            {
                break;
            }
            // (1 + S ΔK)⁻¹ r = r - S' ΔK r
            multiply(ports, cluster, pair, &now.slopes, &now.residual_step, &mut pull);
            subdomain.solve_changed(&mut pull);
            change.iter_mut().zip(now.residual_step.iter().zip(&pull)).for_each(|(d, (r, u))| *d = r - u);
            let mut fraction = 1.0;
            let mut found = false;
            for _ in 0..=HALVINGS {
                let steps = trial.step.iter_mut().zip(now.step.iter().zip(&change));
                steps.for_each(|(trial, (now, change))| *trial = now - fraction * change);
                self.try_cluster(ports, cluster, subdomain, (tangents, &goal), (omega, homotopy), &mut trial);
                found = trial.size < (1.0 - SUFFICIENT_DECREASE * fraction) * now.size;
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
            beyond[pair * port.first_axis..][..own].copy_from_slice(&now.nonlinear_force[at..at + own]);
            left[pair * port.first_axis..][..own].copy_from_slice(&now.residual_step[at..at + own]);
            at += own;
        }
    }

    /// Computes φ after a step, its derivative, and the residual of `d = d₀ + S φ(d)`.
    fn try_cluster(
        &mut self,
        ports: &Ports,
        cluster: &[usize],
        subdomain: &mut Subdomain,
        (tangents, goal): (&[f64], &[f64]),
        (omega, homotopy): (f64, Homotopy),
        trial: &mut TrialStep,
    ) {
        let nh = self.harmonics().len();
        let (mut at, mut from) = (0, 0);
        let [mut c, mut force] = [const { Vec::new() }; 2];
        for &p in cluster {
            let port = &ports[p];
            let (own, range) = (2 * nh * port.axes, port.first_axis * nh..(port.first_axis + port.axes) * nh);
            let step = &trial.step[at..at + own];
            let slopes = &mut trial.slopes[from..from + own * own];
            c.clear();
            let before = self.workspace.previous.c[range.clone()].iter();
            c.extend(before.zip(step.chunks_exact(2)).map(|(c, d)| c - Complex64::new(d[0], d[1])));
            force.clone_from(&c);
            self.aft.motion_port_force(port, (omega, homotopy.limit_factor), &c, &mut force, Some(slopes));
            let given = &tangents[tangent_range(&self.blocks, p, port, nh)];
            slopes.iter_mut().zip(given).for_each(|(slope, given)| *slope -= given);
            let changed = force
                .iter()
                .zip(&self.workspace.previous.force[range])
                .flat_map(|(f, before)| [f.re - before.re, f.im - before.im]);
            for (beyond, (changed, row)) in
                trial.nonlinear_force[at..].iter_mut().zip(changed.zip(given.chunks_exact(own)))
            {
                *beyond = changed + row.iter().zip(step).map(|(k, d)| k * d).sum::<f64>();
            }
            (at, from) = (at + own, from + own * own);
        }
        trial.residual_step.copy_from_slice(&trial.nonlinear_force);
        subdomain.solve(&mut trial.residual_step);
        trial
            .residual_step
            .iter_mut()
            .zip(trial.step.iter().zip(goal))
            .for_each(|(rest, (step, goal))| *rest = step - goal - *rest);
        self.measure_cluster(ports, cluster, subdomain, tangents, trial);
    }

    /// Computes the size of the residual of a trial, `J (d - d₀ - S φ)`.
    fn measure_cluster(
        &self,
        ports: &Ports,
        cluster: &[usize],
        subdomain: &mut Subdomain,
        tangents: &[f64],
        trial: &mut TrialStep,
    ) {
        let nh = self.harmonics().len();
        trial.residual.resize(trial.residual_step.len(), 0.0);
        let mut at = 0;
        for &p in cluster {
            let port = &ports[p];
            let own = 2 * nh * port.axes;
            let rows = tangents[tangent_range(&self.blocks, p, port, nh)].chunks_exact(own);
            for (out, row) in trial.residual[at..].iter_mut().zip(rows) {
                *out = row.iter().zip(&trial.residual_step[at..at + own]).map(|(k, r)| k * r).sum();
            }
            at += own;
        }
        subdomain.solve_structure(&mut trial.residual);
        trial.residual.iter_mut().zip(&trial.residual_step).for_each(|(out, rest)| *out += rest);
        trial.size = self.weighted(&trial.residual);
    }

    /// Returns the size of a vector along whole axes, weighted as velocities.
    fn weighted(&self, values: &[f64]) -> f64 {
        let weights = self.harmonics().iter().cycle().map(|h| velocity_weight(*h));
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
