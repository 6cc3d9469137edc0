//! Contacts that a step of Newton's method misses are settled by themselves: the others follow by their derivatives.
//!
//! A step `d` of all contacts solves the linear equations; where a few begin to slip or to stick on its way they leave a residual that shortening the step of
//! all would take many steps to pass. With `φ(d) = f(c - d) - f(c) + K d`, what the forces of these few have beyond their derivatives, and `S` the
//! receptance of the structure with the derivatives of all contacts, the step `d₀` becomes one that has the few as they are,
//!
//! `d = d₀ + S φ(d)`,
//!
//! small equations along the few. They are solved cluster by cluster, each with its own length of step, and with the structure around it; the step of all
//! then has the whole `S`. Source: Lanzkron, Rose, Wilkes (1996), "An analysis of approximate nonlinear elimination algorithms"; Cai, Li (2011), "Inexact
//! Newton methods with restricted additive Schwarz based nonlinear elimination for problems with high local nonlinearity".

use super::ease::Ease;
use super::equations::{Level, Slopes, Solution};
use super::kept::weight;
use super::ports::{Port, Ports, block};
use super::solve::{HALVINGS, SHORTENS};
use super::window::{Neighbours, Settling, Window};
use num_complex::Complex64;

/// Share of the largest residual along one contact from which on a contact is settled.
const MISSED: f64 = 0.1;
/// Axes of a cluster, at most.
const MOST_AXES: usize = 16;
/// Neighbours of its places that a cluster's part of the structure has on every side.
const AROUND: usize = 3;
/// Steps in a cluster, and the share of the step of all that they are to leave: the next step of all begins with what is left.
const STEPS: usize = 20;
const LEFT: f64 = 1e-3;
/// Share of the residual before the step that settling must leave at most to be tried again at this point: it is not worth its time where motion carries
/// far from blade to blade, or where most contacts are missed.
const WORTH: f64 = 0.5;

/// Forces along the axes of a cluster after a step.
#[derive(Debug, Default, Clone)]
struct Trial {
    step: Vec<f64>,
    /// φ, and the derivative of that.
    beyond: Vec<f64>,
    slopes: Vec<f64>,
    /// What the equations leave.
    rest: Vec<f64>,
    residual: Vec<f64>,
    size: f64,
}

impl Level {
    /// Whether contacts can be settled after the step that is about to be made; keeps the derivatives by which it is made.
    pub(super) fn can_settle(&mut self, ports: &Ports) -> bool {
        let Some(sparse) = self.sparse.as_ref().filter(|_| self.springs.is_empty()) else { return false };
        if ports.iter().any(|port| port.is_force() || port.marches()) {
            return false;
        }
        let settling = self.settling.get_or_insert_with(|| Settling::new(Neighbours::new(sparse, ports)));
        if settling.helps {
            settling.tangents.clone_from(&self.tangents);
        }
        settling.helps
    }

    /// After a whole step, from whose end the residual is, that left more than `beaten`: the step with the contacts that it missed as they are, into
    /// `motion`. The residual there, if it is less; otherwise the step is that of all again.
    pub(super) fn settle(
        &mut self,
        ports: &Ports,
        (omega, ease): (f64, Ease),
        motion: &mut Solution,
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
        settling: &mut Settling,
        ports: &Ports,
        (omega, ease): (f64, Ease),
        motion: &mut Solution,
        length: f64,
    ) -> Option<f64> {
        let Settling { neighbours, tangents, step, beyond, left, .. } = settling;
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
            let mut window = Window::new(sparse, neighbours, ports, at, (tangents, &self.blocks))?;
            let along = (&**tangents, &**step, &mut **beyond, &mut **left);
            self.settle_cluster(ports, &cluster, &mut window, along, (omega, ease, length));
        }
        self.eliminated += 1;
        // the step of all with what these forces have beyond their derivatives
        self.sparse.as_mut()?.receive_all(beyond);
        for ((d, left), (step, moved)) in self.step.iter_mut().zip(&*left).zip(step.iter().zip(&*beyond)) {
            *d = step + (moved + left) / length;
        }
        self.advance(ports, motion, 1.0, length);
        Some(self.evaluate(ports, omega, motion, ease, length, Slopes::Cheap))
    }

    /// Size of the residual along a port, weighted as velocities are.
    fn left_along(&self, port: &Port) -> f64 {
        let nh = self.harmonics().len();
        let pairs = self.residual[2 * port.first * nh..2 * (port.first + port.axes) * nh].chunks_exact(2);
        let weights = self.harmonics().iter().cycle().map(|h| weight(*h));
        pairs.zip(weights).map(|(r, w)| w * (r[0] * r[0] + r[1] * r[1])).sum::<f64>().sqrt()
    }

    /// Solves `d = d₀ + S φ(d)` along the axes of a cluster, from the step that was tried last or from none; φ goes into `beyond`.
    fn settle_cluster(
        &mut self,
        ports: &Ports,
        cluster: &[usize],
        window: &mut Window,
        (tangents, step, beyond, left): (&[f64], &[f64], &mut [f64], &mut [f64]),
        (omega, ease, length): (f64, Ease, f64),
    ) {
        let pair = 2 * self.harmonics().len();
        let along = |values: &[f64]| -> Vec<f64> {
            let ranges = cluster.iter().map(|p| pair * ports[*p].first..pair * (ports[*p].first + ports[*p].axes));
            ranges.flat_map(|range| values[range].iter().map(|d| d * length)).collect()
        };
        let goal = along(step);
        let slopes = cluster.iter().map(|p| (pair * ports[*p].axes).pow(2)).sum();
        let zero = Trial {
            step: vec![0.0; goal.len()],
            beyond: vec![0.0; goal.len()],
            slopes: vec![0.0; slopes],
            rest: goal.iter().map(|d| -d).collect(),
            residual: Vec::new(),
            size: 0.0,
        };
        let mut trial = Trial { step: along(&self.step), ..zero.clone() };
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

    /// φ after a step, its derivative, and what is left of `d = d₀ + S φ(d)`.
    fn try_cluster(
        &mut self,
        ports: &Ports,
        cluster: &[usize],
        window: &mut Window,
        (tangents, goal): (&[f64], &[f64]),
        (omega, ease): (f64, Ease),
        trial: &mut Trial,
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

    /// Size of the residual that a trial leaves, `J (d - d₀ - S φ)`.
    fn measure_cluster(
        &self,
        ports: &Ports,
        cluster: &[usize],
        window: &mut Window,
        tangents: &[f64],
        trial: &mut Trial,
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

    /// Size of a vector along whole axes, weighted as velocities are.
    fn weighted(&self, values: &[f64]) -> f64 {
        let weights = self.harmonics().iter().cycle().map(|h| weight(*h));
        values.chunks_exact(2).zip(weights).map(|(v, w)| w * (v[0] * v[0] + v[1] * v[1])).sum::<f64>().sqrt()
    }
}

/// The products of one block per port with a vector, into another.
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
