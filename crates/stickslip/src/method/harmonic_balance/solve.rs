//! The equations of harmonic balance and their solution.
//!
//! Unknown are the harmonics `c` of the motion along the joints; what the structure does between them is its receptance `R`:
//! `c + R f(c) - c_lin = 0` per harmonic. Newton's method with the exact derivative; where it fails, friction is made smooth and
//! sharpened step by step. Rigid sliders end with rounds of multipliers, after which the width has no influence.

use super::joints::{Alternation, Coordinate, Seen, Sharpness};
use super::rest::Rest;
use super::sparse::Sparse;
use crate::model::System;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::dense;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Residual relative to the motion at which the equations count as solved: a thousand times the rounding of a stiff system.
pub(super) const SOLVED: f64 = 1e-10;
/// Newton iterations at one sharpness; 3 to 6 are usual.
const ITERATIONS: usize = 40;
/// Whole steps that may pass without coming closer.
const PATIENCE: usize = 8;
/// Halvings of a step.
const HALVINGS: usize = 7;
/// The width of rigid sliders at the end, relative to the largest velocity of the motion; multipliers remove its influence.
const WIDTH: f64 = 1e-7;
/// The smallest width relative to the velocity without friction: below it the equations lose all digits.
const LEAST_WIDTH: f64 = 1e-9;
/// Factor by which friction is sharpened, as long as Newton's method follows.
const SHARPEN: f64 = 0.25;
/// The same where that failed.
const SLOWLY: f64 = 0.6;
/// The first width from a neighbour that was not near enough, relative to its velocity.
const NEAR: f64 = 1e-2;
/// Smoothing that may be left where the set of slipping samples cannot be found, at the very onset of slip, relative to the velocity
/// without friction.
const LEFT: f64 = 1e-4;
/// Rounds of multipliers.
const ROUNDS: usize = 20;
/// A round that changes the motion by less than this share ends the search: the width has less influence still.
const INDEPENDENT: f64 = 1e-8;

/// All that belongs to one number of harmonics.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pub alternation: Alternation,
    /// Receptance per harmonic, q × q.
    receptance: Vec<DMatrix<Complex64>>,
    /// See [`WIDTH`].
    pub width: f64,
    /// Motion of the coordinates without friction, [q][harmonic].
    pub linear: Vec<Complex64>,
    /// Motion of all places without friction, per harmonic.
    pub free: Vec<DVector<Complex64>>,
    /// In place of receptance and Jacobian, for large systems.
    pub sparse: Option<Sparse>,
    tangents: Vec<f64>,
    jacobian: Vec<f64>,
    residual: Vec<f64>,
    step: Vec<f64>,
    next: Vec<Vec<Seen>>,
    /// The sharpest motion of a search that did not end.
    sharpest: Option<Motion>,
    seen: Vec<Vec<Seen>>,
}

/// A solution or a start.
#[derive(Debug, Clone, Default)]
pub(super) struct Motion {
    /// Harmonics of the coordinates, [q][harmonic], m.
    pub c: Vec<Complex64>,
    /// Harmonics of the forces along them, N.
    pub force: Vec<Complex64>,
    /// Multipliers of rigid sliders, per sample, N.
    pub multipliers: Vec<Vec<f64>>,
    pub sharpness: Sharpness,
    pub residual: f64,
    pub iterations: usize,
    /// Smoothing that could not be removed, as a share of the velocity.
    pub left: f64,
}

impl Default for Sharpness {
    fn default() -> Self {
        Sharpness { width: 0.0, blur: 0.0, limits: 1.0, hold: false }
    }
}

/// The search did not end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lost {
    pub iterations: usize,
    pub residual: f64,
}

impl Level {
    pub fn new(
        harmonics: Vec<usize>,
        samples: usize,
        (coordinates, rigid): (usize, usize),
        sparse: Option<Sparse>,
    ) -> Self {
        let nh = harmonics.len();
        let size = 2 * nh * coordinates;
        Level {
            alternation: Alternation::new(harmonics, samples),
            receptance: Vec::new(),
            width: WIDTH,
            linear: vec![ZERO; nh * coordinates],
            free: Vec::new(),
            tangents: vec![0.0; 4 * nh * nh * coordinates],
            jacobian: vec![0.0; if sparse.is_some() { 0 } else { size * size }],
            sparse,
            residual: vec![0.0; size],
            step: vec![0.0; size],
            seen: Vec::new(),
            sharpest: None,
            next: vec![vec![Seen::Force(0.0); samples]; rigid],
        }
    }

    pub fn harmonics(&self) -> &[usize] {
        &self.alternation.harmonics
    }

    /// Prepares for a drive frequency.
    pub fn drive(&mut self, system: &System, coordinates: &[Coordinate], rest: &Rest, omega: f64) {
        let n = system.dofs();
        let excitation = system.excitation(omega);
        let nh = self.harmonics().len();
        self.receptance.clear();
        self.free.clear();
        if let Some(sparse) = &mut self.sparse
            && !sparse.drive(omega)
        {
            // a singular frequency: the next number has none of its zeros
            sparse.drive(omega * (1.0 + f64::EPSILON));
        }
        for k in 0..nh {
            let h = self.alternation.harmonics[k];
            let load = excitation.iter().find(|(number, _)| *number as usize == h);
            let mut free = DVector::from_element(n, ZERO);
            if let Some(sparse) = &mut self.sparse {
                if let Some((_, force)) = load {
                    sparse.respond(k, |i| force[i], free.as_mut_slice());
                }
            } else {
                let mut receptance = rest.receptance(h, omega);
                for (q, coordinate) in coordinates.iter().enumerate() {
                    receptance[(q, q)] += coordinate.series;
                }
                self.receptance.push(receptance);
                if let Some((_, force)) = load {
                    free = rest.respond(h, omega, force);
                }
            }
            for (q, coordinate) in coordinates.iter().enumerate() {
                let joint = &system.joints[coordinate.joint];
                let imposed = joint.imposed.iter().find(|(number, _)| *number as usize == h).map_or(ZERO, |(_, g)| *g);
                let u: Complex64 = (0..n).map(|i| free[i] * joint.direction[(i, 0)]).sum();
                self.linear[q * nh + k] = u + imposed;
            }
            self.free.push(free);
        }
    }

    /// Forces and residual at `motion.c`; the derivative into `self.jacobian` if `tangent`.
    fn evaluate(&mut self, coordinates: &[Coordinate], omega: f64, motion: &mut Motion, tangent: bool) -> f64 {
        let (nh, count) = (self.harmonics().len(), coordinates.len());
        let block = 4 * nh * nh;
        for (q, coordinate) in coordinates.iter().enumerate() {
            let range = q * nh..(q + 1) * nh;
            let slot = &mut self.tangents[q * block..(q + 1) * block];
            self.alternation.evaluate(
                coordinate,
                &motion.c[range.clone()],
                omega,
                motion.sharpness,
                &motion.multipliers,
                &mut self.next,
                &mut motion.force[range],
                tangent.then_some(slot),
            );
        }
        let mut sum = 0.0;
        if let Some(sparse) = &mut self.sparse {
            for k in 0..nh {
                let (residual, weight) = (&mut self.residual, weight(self.alternation.harmonics[k]));
                let (c, linear) = (&motion.c, &self.linear);
                sparse.receive(
                    k,
                    |q| motion.force[q * nh + k],
                    |q, u| {
                        let r = c[q * nh + k] - linear[q * nh + k] + u;
                        let at = 2 * (q * nh + k);
                        (residual[at], residual[at + 1]) = (r.re, r.im);
                        sum += r.norm_sqr() * weight;
                    },
                );
            }
            return sum.sqrt();
        }
        for q in 0..count {
            for k in 0..nh {
                let mut r = motion.c[q * nh + k] - self.linear[q * nh + k];
                for p in 0..count {
                    r += self.receptance[k][(q, p)] * motion.force[p * nh + k];
                }
                let at = 2 * (q * nh + k);
                (self.residual[at], self.residual[at + 1]) = (r.re, r.im);
                sum += r.norm_sqr() * weight(self.alternation.harmonics[k]);
            }
        }
        if tangent {
            let size = 2 * nh * count;
            self.jacobian.fill(0.0);
            for q in 0..count {
                for k in 0..nh {
                    for p in 0..count {
                        let r = self.receptance[k][(q, p)];
                        let from = &self.tangents[p * block..(p + 1) * block];
                        let (re, im) = (
                            &from[2 * k * 2 * nh..(2 * k + 1) * 2 * nh],
                            &from[(2 * k + 1) * 2 * nh..(2 * k + 2) * 2 * nh],
                        );
                        let row = 2 * (q * nh + k) * size + 2 * p * nh;
                        let (first, second) = self.jacobian[row..].split_at_mut(size);
                        for b in 0..2 * nh {
                            first[b] += r.re * re[b] - r.im * im[b];
                            second[b] += r.re * im[b] + r.im * re[b];
                        }
                    }
                }
            }
            for i in 0..size {
                self.jacobian[i * size + i] += 1.0;
            }
        }
        sum.sqrt()
    }

    /// The residual at `motion`, and its derivative into `jacobian` if wanted.
    pub fn residual_at(
        &mut self,
        coordinates: &[Coordinate],
        omega: f64,
        motion: &mut Motion,
        jacobian: Option<&mut [f64]>,
    ) -> &[f64] {
        self.evaluate(coordinates, omega, motion, jacobian.is_some());
        if let Some(jacobian) = jacobian {
            jacobian.copy_from_slice(&self.jacobian);
        }
        &self.residual
    }

    /// Size of the motion against which residuals are measured.
    fn size(&self, motion: &Motion) -> f64 {
        let nh = self.harmonics().len();
        let norm = |c: &[Complex64]| {
            c.iter()
                .enumerate()
                .map(|(i, z)| z.norm_sqr() * weight(self.alternation.harmonics[i % nh]))
                .sum::<f64>()
                .sqrt()
        };
        norm(&motion.c) + 1e-2 * norm(&self.linear)
    }

    /// Newton's method at the sharpness of `motion`: whole steps as long as they come closer within [`PATIENCE`] of them, which is
    /// the rule when only the set of slipping samples is searched; shortened steps from the best motion where they do not.
    pub fn newton(
        &mut self,
        coordinates: &[Coordinate],
        omega: f64,
        motion: &mut Motion,
        most: usize,
    ) -> Result<(), Lost> {
        let mut residual = self.evaluate(coordinates, omega, motion, true);
        let mut best = (residual, motion.c.clone());
        let (mut waits, mut short) = (0, false);
        for _ in 0..most {
            motion.residual = residual / self.size(motion).max(f64::MIN_POSITIVE);
            if motion.residual <= SOLVED || residual == 0.0 {
                return Ok(());
            }
            if !self.newton_step() {
                break;
            }
            motion.iterations += 1;
            self.step.copy_from_slice(&self.residual);
            let from = if short { best.1.clone() } else { motion.c.clone() };
            let mut fraction = 1.0;
            let mut accepted = false;
            for _ in 0..=if short { HALVINGS } else { 0 } {
                for ((t, c), d) in motion.c.iter_mut().zip(&from).zip(self.step.chunks_exact(2)) {
                    *t = c - Complex64::new(d[0], d[1]) * fraction;
                }
                residual = self.evaluate(coordinates, omega, motion, true);
                if residual.is_finite() && residual < (1.0 - 1e-3 * fraction) * best.0 {
                    accepted = true;
                    break;
                }
                fraction *= 0.5;
            }
            if accepted {
                best.0 = residual;
                best.1.copy_from_slice(&motion.c);
                waits = 0;
                continue;
            }
            waits += 1;
            if short {
                break;
            }
            if waits > PATIENCE || !residual.is_finite() {
                short = true;
                motion.c.copy_from_slice(&best.1);
                residual = self.evaluate(coordinates, omega, motion, true);
            }
        }
        motion.c.copy_from_slice(&best.1);
        let residual = self.evaluate(coordinates, omega, motion, false);
        motion.residual = residual / self.size(motion).max(f64::MIN_POSITIVE);
        if motion.residual <= SOLVED {
            return Ok(());
        }
        Err(Lost { iterations: motion.iterations, residual: motion.residual })
    }

    /// Replaces the residual of the last evaluation by the step that removes it.
    fn newton_step(&mut self) -> bool {
        match &mut self.sparse {
            Some(sparse) => sparse.step(&self.tangents, &mut self.residual),
            None => {
                let size = self.residual.len();
                dense::solve(&mut self.jacobian, size, &mut self.residual)
            }
        }
    }

    /// One Newton step with every rigid slider left as free or as clamped as it was in the last evaluation.
    fn hold_step(&mut self, coordinates: &[Coordinate], omega: f64, motion: &mut Motion) {
        let before = motion.c.clone();
        motion.sharpness.hold = true;
        self.evaluate(coordinates, omega, motion, true);
        motion.sharpness.hold = false;
        if self.newton_step() {
            motion.iterations += 1;
            for (c, d) in motion.c.iter_mut().zip(self.residual.chunks_exact(2)) {
                *c -= Complex64::new(d[0], d[1]);
            }
            if !motion.c.iter().all(|c| c.is_finite()) {
                motion.c = before;
            }
        }
    }

    /// Largest velocity along a coordinate, m/s.
    fn speed(&self, c: &[Complex64], omega: f64) -> f64 {
        let nh = self.harmonics().len();
        c.chunks_exact(nh)
            .map(|c| c.iter().zip(self.harmonics()).map(|(z, &h)| h as f64 * omega * z.norm()).sum::<f64>())
            .fold(0.0, f64::max)
    }

    /// From `start` (a solution nearby) or, without one, from smooth friction.
    pub fn solve(
        &mut self,
        coordinates: &[Coordinate],
        omega: f64,
        mut start: Motion,
        warm: bool,
    ) -> Result<Motion, Lost> {
        use super::joints::Slider;
        let has = |test: fn(&Slider) -> bool| coordinates.iter().flat_map(|c| &c.sliders).any(test);
        let rigid = has(|s| matches!(s, Slider::Rigid { .. }));
        let smooth = has(|s| matches!(s, Slider::Smooth { .. }));
        let free_speed = self.speed(&self.linear, omega).max(f64::MIN_POSITIVE);
        start.left = 0.0;
        let mut spent = 0;
        if warm || !(rigid || smooth) {
            let mut motion = start.clone();
            motion.iterations = 0;
            motion.sharpness = Sharpness::default();
            motion.sharpness.width = (self.width * self.speed(&motion.c, omega)).max(LEAST_WIDTH * free_speed);
            let done = self
                .newton(coordinates, omega, &mut motion, ITERATIONS)
                .and_then(|()| if rigid { self.settle_multipliers(coordinates, omega, &mut motion) } else { Ok(()) });
            match done {
                Ok(()) => return Ok(motion),
                Err(lost) => spent += lost.iterations,
            }
        }
        let neighbour = start.clone();
        let mut motion = start;
        motion.iterations = spent;
        motion.multipliers.iter_mut().for_each(|m| m.fill(0.0));
        if !(rigid || smooth) {
            self.lower_limits(coordinates, omega, &mut motion)?;
            return Ok(motion);
        }
        let mut attempts: Vec<(Motion, f64, f64)> = Vec::new();
        if warm {
            // a little smoothing often is enough
            let width = NEAR * self.speed(&neighbour.c, omega);
            attempts.push((neighbour, width.max(LEAST_WIDTH * free_speed), SHARPEN));
        }
        let mut free = motion.clone();
        free.c.copy_from_slice(&self.linear);
        attempts.push((free.clone(), free_speed, SHARPEN));
        attempts.push((motion, free_speed, SHARPEN));
        attempts.push((free, free_speed, SLOWLY));
        let mut lost = Lost { iterations: spent, residual: f64::INFINITY };
        self.sharpest = None;
        for (mut motion, width, pace) in attempts {
            motion.iterations = lost.iterations;
            let sharp = self.sharpen(coordinates, omega, &mut motion, (rigid, smooth), (width, free_speed), pace);
            let done = sharp
                .and_then(|()| if rigid { self.settle_multipliers(coordinates, omega, &mut motion) } else { Ok(()) });
            match done {
                Ok(()) => return Ok(motion),
                Err(failure) => lost = failure,
            }
        }
        // a width that is left is an error like that of the missing harmonics: it is reported with it
        match self.sharpest.take() {
            Some(mut motion) if motion.sharpness.width <= LEFT * free_speed => {
                motion.left = motion.sharpness.width / free_speed;
                motion.iterations = lost.iterations;
                Ok(motion)
            }
            _ => Err(lost),
        }
    }

    /// Velocity laws: from wide to sharp.
    fn sharpen(
        &mut self,
        coordinates: &[Coordinate],
        omega: f64,
        motion: &mut Motion,
        (rigid, smooth): (bool, bool),
        (mut width, free_speed): (f64, f64),
        pace: f64,
    ) -> Result<(), Lost> {
        let mut factor = pace;
        let mut good: Option<Motion> = None;
        loop {
            motion.sharpness = Sharpness { width, blur: width, ..Sharpness::default() };
            if good.is_some() && rigid {
                self.hold_step(coordinates, omega, motion);
            }
            let mut done = self.newton(coordinates, omega, motion, ITERATIONS);
            if let (Err(_), Some(good)) = (&done, &good) {
                // the same without the step that guesses what is free
                let iterations = motion.iterations;
                *motion = Motion { iterations, ..good.clone() };
                motion.sharpness = Sharpness { width, blur: width, ..Sharpness::default() };
                done = self.newton(coordinates, omega, motion, ITERATIONS);
            }
            match done {
                Ok(()) => {
                    let target = (self.width * self.speed(&motion.c, omega)).max(LEAST_WIDTH * free_speed);
                    if width <= target {
                        break;
                    }
                    if rigid {
                        // with the forces as multipliers the velocity in stick goes to zero before the width does
                        let before = motion.clone();
                        self.take_multipliers(coordinates, omega, motion);
                        self.hold_step(coordinates, omega, motion);
                        if self.newton(coordinates, omega, motion, ITERATIONS).is_err() {
                            *motion = Motion { iterations: motion.iterations, ..before };
                        }
                        self.evaluate(coordinates, omega, motion, false);
                    }
                    good = Some(motion.clone());
                    if !smooth && self.sharpest.as_ref().is_none_or(|sharpest| width < sharpest.sharpness.width) {
                        self.sharpest = good.clone();
                    }
                    width = (width * factor).max(0.999 * target);
                    factor = (factor * 0.8).max(pace * pace);
                }
                Err(lost) => {
                    let iterations = motion.iterations;
                    let Some(good) = &good else { return Err(lost) };
                    *motion = Motion { iterations, ..good.clone() };
                    self.evaluate(coordinates, omega, motion, false);
                    factor = factor.sqrt();
                    if factor > 0.97 {
                        return Err(lost);
                    }
                    width = good.sharpness.width * factor;
                }
            }
        }
        if smooth {
            motion.sharpness.blur = 0.0;
            self.newton(coordinates, omega, motion, ITERATIONS)?;
        }
        let _ = rigid;
        Ok(())
    }

    /// Sliders behind springs: from slip limits that hold to those that are given.
    fn lower_limits(&mut self, coordinates: &[Coordinate], omega: f64, motion: &mut Motion) -> Result<(), Lost> {
        let mut limits = 1.0;
        // where everything sticks the equations are linear
        for _ in 0..60 {
            limits *= 4.0;
            motion.sharpness = Sharpness { limits, ..Sharpness::default() };
            if self.newton(coordinates, omega, motion, ITERATIONS).is_ok() {
                break;
            }
        }
        let mut good = motion.clone();
        let mut factor: f64 = 0.5;
        while good.sharpness.limits > 1.0 {
            motion.sharpness.limits = (good.sharpness.limits * factor).max(1.0);
            match self.newton(coordinates, omega, motion, ITERATIONS) {
                Ok(()) => good = motion.clone(),
                Err(lost) => {
                    let iterations = motion.iterations;
                    *motion = good.clone();
                    motion.iterations = iterations;
                    factor = factor.sqrt();
                    if factor > 0.995 {
                        return Err(lost);
                    }
                }
            }
        }
        *motion = Motion { iterations: motion.iterations, ..good };
        Ok(())
    }

    /// Replaces multipliers by the forces.
    fn take_multipliers(&mut self, coordinates: &[Coordinate], omega: f64, motion: &mut Motion) {
        self.evaluate(coordinates, omega, motion, false);
        self.seen.clone_from(&self.next);
        for (multipliers, seen) in motion.multipliers.iter_mut().zip(&self.seen) {
            for (multiplier, seen) in multipliers.iter_mut().zip(seen) {
                *multiplier = match seen {
                    Seen::Force(force) => *force,
                    Seen::Crossing => 0.0,
                };
            }
        }
    }

    /// Replaces multipliers by the forces until that changes nothing: the width has no influence then.
    fn settle_multipliers(&mut self, coordinates: &[Coordinate], omega: f64, motion: &mut Motion) -> Result<(), Lost> {
        for _ in 0..ROUNDS {
            self.take_multipliers(coordinates, omega, motion);
            let residual = self.evaluate(coordinates, omega, motion, false) / self.size(motion).max(f64::MIN_POSITIVE);
            motion.residual = residual;
            if residual <= SOLVED {
                return Ok(());
            }
            // which sliders are free is known from the solution, not from its evaluation with new multipliers
            self.next.clone_from(&self.seen);
            let before = motion.c.clone();
            self.hold_step(coordinates, omega, motion);
            self.newton(coordinates, omega, motion, ITERATIONS)?;
            let (nh, size) = (self.harmonics().len(), self.size(motion));
            let change = before.iter().zip(&motion.c).enumerate();
            let change = change.map(|(i, (a, b))| (a - b).norm_sqr() * weight(self.alternation.harmonics[i % nh]));
            if change.sum::<f64>().sqrt() <= INDEPENDENT * size {
                return Ok(());
            }
        }
        Err(Lost { iterations: motion.iterations, residual: motion.residual })
    }
}

/// Weight of a harmonic in norms: that of its velocity.
fn weight(h: usize) -> f64 {
    ((h * h) as f64).max(1.0)
}

/// `motion` with other harmonics and samples: harmonics that are new are those that the forces are not known of, zero.
pub(super) fn transfer(motion: &Motion, from: &[usize], to: &[usize], samples: usize, coordinates: usize) -> Motion {
    let pick = |values: &[Complex64]| {
        let mut out = Vec::with_capacity(coordinates * to.len());
        for q in 0..coordinates {
            for h in to {
                let at = from.binary_search(h).ok();
                out.push(at.map_or(ZERO, |k| values[q * from.len() + k]));
            }
        }
        out
    };
    let resample = |values: &Vec<f64>| -> Vec<f64> {
        let n = values.len();
        (0..samples)
            .map(|i| {
                let x = i as f64 * n as f64 / samples as f64;
                let (low, part) = (x.floor() as usize, x.fract());
                (1.0 - part) * values[low % n] + part * values[(low + 1) % n]
            })
            .collect()
    };
    Motion {
        c: pick(&motion.c),
        force: pick(&motion.force),
        multipliers: motion.multipliers.iter().map(resample).collect(),
        ..*motion
    }
}
