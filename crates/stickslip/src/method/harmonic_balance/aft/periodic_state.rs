//! Laws with memory: integration of their states through the samples of a period until the
//! states repeat, with the exact derivative of the computed result.
//!
//! A step computes states and forces from the previous states and its inputs. The inputs are
//! linear in the harmonics of the motion. The states `z` at t = 0 are periodic if `z = F(z)`,
//! with the map `F` over one period. Newton's method solves this with `Π`, the product of the
//! steps' derivatives. A step that does not reduce the change over a period is shortened; if no
//! short step reduces it, the integration continues for one more period.
//!
//! The derivative by a harmonic of the motion follows from `δz = Π δz + δq`. If some state is
//! never forgotten, as in a permanently stuck contact, `1 - Π` is singular. Along such
//! directions, states and derivatives are those of a joint that moves straight from static
//! equilibrium to the beginning of the period, and then through periods until its states repeat.

use super::frequency_time::{FrequencyTime, InitialState, amplitude_factor};
use super::workspace::{PERIODICITY_TOLERANCE, StepWorkspace, derivative_batch};
use crate::law::MAX_DIRECTIONS;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::ops::Range;
use stickslip_numerics::dense::{ProductShape, Transpose, multiply_blocked};
use stickslip_numerics::interrupt;

/// Settings of the search for periodic states.
#[derive(Debug, Clone, Copy)]
struct PeriodicStateSettings {
    /// Replaces [`PERIODICITY_TOLERANCE`] if the change over a period no longer decreases.
    rounded: f64,
    /// Maximum number of periods with derivatives; hysteresis that slips forgets in a few.
    periods: usize,
    /// Least fraction of a Newton step that is tried.
    least_fraction: f64,
    /// Change over a period from which one Newton step may reach the solution. Two periods without
    /// derivatives, which cost less than one with them, then tell.
    last_step: f64,
    /// Maximum number of initial periods without derivatives. A period with derivatives costs as
    /// much as three without.
    plain_periods: usize,
    /// Ratio of successive changes above which the periods without derivatives end.
    slow_ratio: f64,
    /// Ratio to the least change so far that a step of Broyden's method must reach. Two misses in
    /// a row end the iteration.
    broyden_reduction: f64,
    /// Singular values of `1 - Π` below this belong to states that are never forgotten.
    neutral_singular_value: f64,
    /// Number of harmonics up to which a matrix product transforms derivatives, instead of FFTs.
    matrix_harmonics: usize,
}

impl Default for PeriodicStateSettings {
    fn default() -> Self {
        PeriodicStateSettings {
            rounded: 1e-9,
            periods: 60,
            least_fraction: 0.1,
            last_step: 1e-4,
            plain_periods: 6,
            slow_ratio: 0.03,
            broyden_reduction: 0.3,
            neutral_singular_value: 1e-9,
            matrix_harmonics: 16,
        }
    }
}

/// States from which Newton's method takes a step.
struct NewtonBase {
    states: DVector<f64>,
    /// Change of the states over a period, and its size relative to theirs.
    change: DVector<f64>,
    gap: f64,
    /// The whole Newton step.
    step: DVector<f64>,
}

/// A law with memory as a sequence of steps.
pub(super) trait StepSequence {
    fn states(&self) -> usize;
    /// Returns the size of the states.
    fn state_scale(&self) -> f64;
    fn axes(&self) -> usize;
    /// Returns the number of inputs of a step for each axis. Inputs are ordered
    /// by kind, then by axis.
    fn inputs(&self) -> usize;
    /// Tells whether the last derivative of a step is that by ω, at fixed displacements.
    fn knows_frequency(&self) -> bool {
        false
    }
    /// Returns the factors `w` of the inputs `Re(U w)` along an axis, for the
    /// motion `Re(U e^{jhθ})` and a step that ends where `e^{jhθ}` equals `at`.
    /// `angle` is the length of a step.
    fn input_factors(&self, h: usize, angle: f64, at: Complex64) -> [Complex64; 4];
    /// Returns these factors for the initial step.
    fn initial_input_factors(&self, h: usize) -> [Complex64; 4];
    /// Takes all steps of a period: from sample 0 to sample 1, and at last from
    /// the last sample to sample 0. Replaces the states `z` at sample 0 by
    /// those after the period, and writes the forces at the samples.
    ///
    /// `rows`, [sample], receives the derivatives of the step that ends at the sample: those of
    /// the states after it, then those of the forces. Its columns are the inputs, the states
    /// before, and ω if that is known. Returns false if a step has no solution.
    fn period(&mut self, z: &mut [f64], force: &mut [Vec<f64>; MAX_DIRECTIONS], rows: Option<&mut [f64]>) -> bool;
    /// Tells whether the law dissipates in a period with these forces at the samples, so that its
    /// states follow from the period alone.
    fn dissipates(&self, _force: &[Vec<f64>; MAX_DIRECTIONS]) -> bool {
        true
    }
    /// Takes the initial step, straight from static equilibrium to sample 0.
    /// Returns false if it has no solution.
    fn initial_step(&mut self, after: &mut [f64], force: &mut [f64; MAX_DIRECTIONS], rows: Option<&mut [f64]>) -> bool;
}

impl FrequencyTime {
    /// Computes the forces along the axes and their derivative. The forces are
    /// NaN if no periodic states are found.
    pub(super) fn periodic_response(
        &mut self,
        sequence: &mut dyn StepSequence,
        force: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let nh = self.harmonics.len();
        let mut memory = std::mem::take(&mut self.workspace);
        if let Some(product) = self.find_periodic_state(sequence, &mut memory, tangent.is_some()) {
            for a in 0..sequence.axes() {
                self.add_force(a, &mut force[a * nh..(a + 1) * nh]);
            }
            if let Some(tangent) = tangent
                && !self.memory_tangent(sequence, &mut memory, &product, tangent)
            {
                force.fill(Complex64::new(f64::NAN, 0.0));
            }
        } else {
            self.state.clear();
            force.fill(Complex64::new(f64::NAN, 0.0));
        }
        self.workspace = memory;
    }

    /// Finds periodic states, into `self.state`, and the forces. With `linear`,
    /// computes the derivatives of all steps and returns Π; otherwise returns
    /// an arbitrary matrix. `None` if no periodic states are found.
    ///
    /// The known states of a nearby motion are a valid start only if the joint slips in every
    /// period. If it sticks there, its states depend on the history, which begins in static
    /// equilibrium.
    fn find_periodic_state(
        &mut self,
        sequence: &mut dyn StepSequence,
        memory: &mut StepWorkspace,
        linear: bool,
    ) -> Option<DMatrix<f64>> {
        let m = sequence.states();
        let known = std::mem::take(&mut self.known_state);
        if m > 0 && known.state.len() == m {
            let product = self.periodic_state_from(sequence, memory, known, linear);
            if product.is_some() && self.dissipates {
                return product;
            }
        }
        let (mut z, mut force) = (DVector::zeros(m), [0.0; MAX_DIRECTIONS]);
        if !sequence.initial_step(z.as_mut_slice(), &mut force, None) {
            return None;
        }
        if self.transient(sequence, &mut z, None)? && !linear {
            self.accept(sequence, &z);
            return Some(DMatrix::zeros(m, m));
        }
        self.newton(sequence, memory, z)
    }

    /// Finds periodic states from those of a nearby motion.
    fn periodic_state_from(
        &mut self,
        sequence: &mut dyn StepSequence,
        memory: &mut StepWorkspace,
        known: InitialState,
        linear: bool,
    ) -> Option<DMatrix<f64>> {
        let m = sequence.states();
        let mut z = DVector::from_vec(known.state);
        if known.forgetting_inverse.len() == m * m {
            let inverse = DMatrix::from_row_slice(m, m, &known.forgetting_inverse);
            if !linear {
                if self.broyden(sequence, &mut z, inverse)? {
                    return Some(DMatrix::zeros(m, m));
                }
            } else if self.periodicity_tolerance > PERIODICITY_TOLERANCE {
                // known states from other samples: one period without derivatives brings them near
                // enough, at a third of the cost of one with derivatives
                let change = self.period(sequence, &z, None)? - &z;
                z += inverse * change;
            }
        }
        self.newton(sequence, memory, z)
    }

    /// Finds periodic states by Newton's method from `z`. Returns Π.
    ///
    /// The derivatives may be those of the last iterate before the solution: a joint that has
    /// slipped into a state in which it just sticks keeps the derivatives of slip.
    fn newton(
        &mut self,
        sequence: &mut dyn StepSequence,
        memory: &mut StepWorkspace,
        mut z: DVector<f64>,
    ) -> Option<DMatrix<f64>> {
        let settings = PeriodicStateSettings::default();
        let (m, scale) = (sequence.states(), sequence.state_scale());
        let mut best: Option<NewtonBase> = None;
        let mut fraction = 1.0;
        for _ in 0..settings.periods {
            let (after, product) = self.linear_period(sequence, &z, memory)?;
            let change = after - &z;
            let gap = change.amax() / scale;
            let last = best.as_ref().map_or(f64::INFINITY, |best| best.gap);
            if m == 0 || gap <= self.periodicity_tolerance || (gap <= settings.rounded && gap >= 0.5 * last) {
                self.accept(sequence, &z);
                return Some(product);
            }
            best = match best.take() {
                Some(base) if gap > (1.0 - 0.5 * fraction) * base.gap => {
                    fraction *= 0.5;
                    if fraction < settings.least_fraction {
                        z = base.states + base.change;
                        fraction = 1.0;
                        continue;
                    }
                    z = &base.states + fraction * &base.step;
                    Some(base)
                }
                _ => {
                    fraction = 1.0;
                    let step = pseudo_inverse(DMatrix::identity(m, m) - &product) * &change;
                    let next = &z + &step;
                    let states = std::mem::replace(&mut z, next);
                    if gap <= settings.last_step {
                        // the second period ends slip into stick that the step left in another
                        // direction; joints that slip have better derivatives at the solution
                        for attempt in 0..2 {
                            let after = self.period(sequence, &z, None)?;
                            let settled = (&after - &z).amax() <= self.periodicity_tolerance * scale;
                            z = after;
                            if settled && (attempt == 0 || !sequence.dissipates(&self.force)) {
                                self.accept(sequence, &z);
                                return Some(product);
                            }
                        }
                    }
                    Some(NewtonBase { states, change, gap, step })
                }
            };
        }
        None
    }

    /// Keeps periodic states, whose period was integrated last.
    fn accept(&mut self, sequence: &dyn StepSequence, z: &DVector<f64>) {
        self.state.clear();
        self.state.extend(z.iter());
        self.dissipates = sequence.dissipates(&self.force);
    }

    /// Integrates periods from `z` until the states repeat, change slowly, or the periods exceed
    /// [`PeriodicStateSettings::plain_periods`]. A law that slips forgets its initial states in a
    /// few periods. `rows` receives the derivatives of every period. Returns whether the states
    /// repeat. `None` if a step has no solution.
    fn transient(
        &mut self,
        sequence: &mut dyn StepSequence,
        z: &mut DVector<f64>,
        mut rows: Option<&mut Vec<Vec<f64>>>,
    ) -> Option<bool> {
        let settings = PeriodicStateSettings::default();
        let scale = sequence.state_scale();
        let mut last = f64::INFINITY;
        for _ in 0..settings.plain_periods {
            let own = rows.as_deref_mut().map(|rows| rows.push_mut(Vec::new()));
            let after = self.period(sequence, z, own)?;
            let gap = (&after - &*z).amax() / scale;
            *z = after;
            if gap <= PERIODICITY_TOLERANCE {
                return Some(true);
            }
            if gap > settings.slow_ratio * last {
                break;
            }
            last = gap;
        }
        Some(false)
    }

    /// Finds periodic states from those of a nearby motion by Broyden's method. The initial
    /// inverse Jacobian is that of the nearby motion. No derivatives are needed, which cost as
    /// much as three periods. Returns whether the states were found, into `self.state`. If not,
    /// `z` is the last iterate. `None` if a step has no solution.
    ///
    /// Source: Broyden, "A class of methods for solving nonlinear simultaneous
    /// equations" (1965), his good method.
    fn broyden(
        &mut self,
        sequence: &mut dyn StepSequence,
        z: &mut DVector<f64>,
        mut inverse: DMatrix<f64>,
    ) -> Option<bool> {
        let settings = PeriodicStateSettings::default();
        let scale = sequence.state_scale();
        let mut change = self.period(sequence, z, None)? - &*z;
        let mut best = change.amax() / scale;
        let mut waited = 0;
        while best > PERIODICITY_TOLERANCE {
            let step = &inverse * &change;
            *z += &step;
            let after = self.period(sequence, z, None)? - &*z;
            let gap = after.amax() / scale;
            (best, waited) =
                if gap < settings.broyden_reduction * best { (gap, 0) } else { (best.min(gap), waited + 1) };
            if waited > 1 || !gap.is_finite() {
                return Some(false);
            }
            // the step that the inverse predicts for this change of the gap
            let seen = &inverse * (&change - &after);
            let size = step.dot(&seen);
            if size != 0.0 {
                inverse += (&step - &seen) * (step.transpose() * &inverse) / size;
            }
            change = after;
        }
        self.accept(sequence, z);
        Some(true)
    }

    /// Integrates one period and returns the states after it. `None` if a step has no solution.
    fn period(
        &mut self,
        sequence: &mut dyn StepSequence,
        z: &DVector<f64>,
        mut rows: Option<&mut Vec<f64>>,
    ) -> Option<DVector<f64>> {
        interrupt::check();
        let n = self.samples();
        let (m, d) = (sequence.states(), sequence.axes());
        let size = (m + d) * width(sequence);
        if let Some(rows) = rows.as_deref_mut() {
            rows.resize(n * size, 0.0);
        }
        let mut z = z.clone();
        self.law_steps += n;
        sequence.period(z.as_mut_slice(), &mut self.force, rows.map(|rows| &mut rows[..])).then_some(z)
    }

    /// Integrates one period with derivatives. Returns the states after it and Π, and writes
    /// the derivatives of the forces by the initial states.
    fn linear_period(
        &mut self,
        sequence: &mut dyn StepSequence,
        z: &DVector<f64>,
        memory: &mut StepWorkspace,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let after = self.period(sequence, z, Some(&mut memory.rows))?;
        let n = self.samples();
        memory.by_state.resize(n * sequence.axes() * sequence.states(), 0.0);
        Some((after, PeriodDerivatives::new(sequence, &memory.rows, n).product(&mut memory.by_state)))
    }

    /// Adds the derivative of the forces. Returns false if the first period has no solution.
    fn memory_tangent(
        &mut self,
        sequence: &mut dyn StepSequence,
        memory: &mut StepWorkspace,
        product: &DMatrix<f64>,
        tangent: &mut [f64],
    ) -> bool {
        let settings = PeriodicStateSettings::default();
        let (n, nh) = (self.samples(), self.harmonics.len());
        let (m, d) = (sequence.states(), sequence.axes());
        let size = 2 * nh * d;
        let open = DMatrix::identity(m, m) - product;
        let neutral = m > 0 && open.clone().singular_values().min() <= settings.neutral_singular_value;
        let inverse = pseudo_inverse(open);
        self.forgetting_inverse.clear();
        if !neutral {
            self.forgetting_inverse.extend(inverse.transpose().iter());
        }
        // states that are never forgotten have the derivative of the periods until they repeat
        let beginning = if neutral {
            let mut first = std::mem::take(&mut memory.first);
            let rows = self.transient_derivatives(sequence, &mut first);
            memory.first = first;
            match rows {
                Some(rows) => Some(rows),
                None => return false,
            }
        } else {
            None
        };
        let wide = 2 * nh;
        let few = nh <= settings.matrix_harmonics;
        if few {
            self.fill_projection(&mut memory.projection);
            memory.of_states.resize(wide * d * m, 0.0);
            let shape = ProductShape { rows: d * m, inner: n, columns: wide };
            multiply_blocked(&memory.by_state, &memory.projection, &mut memory.of_states, shape, Transpose::Yes);
        }
        // few harmonics: all axes at once; a long series: one axis and a group
        // of harmonics at a time
        let (together, count) = if few { (d, nh) } else { (1, derivative_batch(d, n, nh).0) };
        for range in (0..nh).step_by(count).map(|from| from..nh.min(from + count)) {
            self.fill_input_factors(sequence, memory, range.clone());
            for first in (0..d).step_by(together) {
                let (wide_here, steps) = (2 * range.len(), (beginning.as_deref(), &inverse));
                let tall = together * wide_here;
                self.differentiate_forces(
                    sequence,
                    memory,
                    steps,
                    (DerivativeVariable::Solution { first }, together, wide_here),
                );
                if few {
                    // [sample][axis][column] times the projection on the harmonics
                    memory.spectrum.resize(d * tall * wide, 0.0);
                    let shape = ProductShape { rows: d * tall, inner: n, columns: wide };
                    multiply_blocked(&memory.columns, &memory.projection, &mut memory.spectrum, shape, Transpose::Yes);
                    for (to, values) in memory.spectrum.chunks_exact(d * tall).enumerate() {
                        for (a, values) in values.chunks_exact(tall).enumerate() {
                            let row = &mut tangent[(a * wide + to) * size + first * wide..][..tall];
                            row.iter_mut().zip(values).for_each(|(t, value)| *t += value);
                            let by_state = memory.of_states[(to * d + a) * m..][..m].iter();
                            by_state.zip(memory.shift.chunks_exact(tall)).for_each(|(by, shift)| add(row, *by, shift));
                        }
                    }
                    continue;
                }
                memory.shift_columns(m, tall);
                memory.signal.resize(n, 0.0);
                for (a, column) in (0..d).flat_map(|a| (0..tall).map(move |column| (a, column))) {
                    for i in 0..n {
                        memory.signal[i] = memory.columns[(i * d + a) * tall + column];
                    }
                    let sums = self.fourier.transform(&mut memory.signal);
                    for (l, &to) in self.harmonics.iter().enumerate() {
                        let value = sums[to] * amplitude_factor(to, n);
                        let at = (a * wide + 2 * l) * size + first * wide + 2 * range.start + column;
                        tangent[at] += value.re;
                        if to > 0 {
                            tangent[at + size] += value.im;
                        }
                    }
                }
            }
        }
        if sequence.knows_frequency() {
            self.differentiate_forces(
                sequence,
                memory,
                (beginning.as_deref(), &inverse),
                (DerivativeVariable::Frequency, 1, 1),
            );
            memory.shift_columns(m, 1);
            memory.signal.resize(n, 0.0);
            for a in 0..d {
                for i in 0..n {
                    memory.signal[i] = memory.columns[i * d + a];
                }
                self.add_by_frequency(a, &mut memory.signal);
            }
        }
        true
    }

    /// Fills the matrix from a signal to its harmonics: real and imaginary parts, 2 × harmonics
    /// for each sample. A mean has no imaginary part.
    fn fill_projection(&self, projection: &mut Vec<f64>) {
        let n = self.samples();
        if projection.len() == 2 * self.harmonics.len() * n {
            return;
        }
        projection.clear();
        for i in 0..n {
            for &h in &self.harmonics {
                let wave = self.rotations[h * i % n] * amplitude_factor(h, n);
                projection.extend([wave.re, if h == 0 { 0.0 } else { -wave.im }]);
            }
        }
    }

    /// Fills the derivatives of the inputs by the parts of some harmonics of a motion:
    /// [sample][kind][part], followed by those of the initial step.
    fn fill_input_factors(
        &self,
        sequence: &dyn StepSequence,
        StepWorkspace { input_factors: waves, .. }: &mut StepWorkspace,
        range: Range<usize>,
    ) {
        let (n, kinds, harmonics) = (self.samples(), sequence.inputs(), &self.harmonics[range]);
        // all steps have these factors, rotated on the unit circle
        let one = Complex64::new(1.0, 0.0);
        let each = harmonics.iter().map(|&h| sequence.input_factors(h, TAU / n as f64, one));
        let fixed: Vec<[Complex64; 4]> =
            each.chain(harmonics.iter().map(|&h| sequence.initial_input_factors(h))).collect();
        waves.clear();
        let mut at = vec![0; harmonics.len()];
        for _ in 0..n {
            for kind in 0..kinds {
                for ((at, fixed), &h) in at.iter().zip(&fixed).zip(harmonics) {
                    waves.extend(<[f64; 2]>::from(parts(fixed[kind] * self.rotations[*at], h)));
                }
            }
            for (at, &h) in at.iter_mut().zip(harmonics) {
                *at = (*at + h) % n;
            }
        }
        for kind in 0..kinds {
            let first = fixed[harmonics.len()..].iter().zip(harmonics);
            waves.extend(first.flat_map(|(first, &h)| <[f64; 2]>::from(parts(first[kind], h))));
        }
    }

    /// Computes the derivative of the sampled forces by the inputs at fixed states at t = 0,
    /// into `memory.columns`: [sample][axis][column]. Writes the changes of these states that keep
    /// them periodic into `memory.shift`.
    ///
    /// The columns are the parts of the harmonics of the motion along `count` axes, or the
    /// frequency. `beginning` contains the steps of the periods from static equilibrium if
    /// some state is never forgotten; the states at t = 0 then change with the inputs.
    fn differentiate_forces(
        &self,
        sequence: &dyn StepSequence,
        memory: &mut StepWorkspace,
        (beginning, inverse): (Option<&[Vec<f64>]>, &DMatrix<f64>),
        (input, count, wide): (DerivativeVariable, usize, usize),
    ) {
        let n = self.samples();
        let (m, d) = (sequence.states(), sequence.axes());
        let width = width(sequence);
        let size = (m + d) * width;
        let by = InputLayout { input, kinds: sequence.inputs(), axes: d, width, wide, tall: count * wide };
        let tall = by.tall;
        let (mut start, mut next) = (vec![0.0; m * tall], vec![0.0; m * tall]);
        let table = &memory.input_factors;
        let at = |i: usize| &table[i * by.kinds * wide..][..by.kinds * wide];
        let none = Vec::new();
        let waves = |i: usize| if matches!(input, DerivativeVariable::Frequency) { &none[..] } else { at(i) };
        if let Some(beginning) = beginning {
            // the factors of the initial step follow those of the samples
            by.advance(&memory.first[..m * width], waves(n), &next, &mut start);
            for (period, step) in beginning.iter().flat_map(|period| (1..=n).map(move |step| (period, step))) {
                let i = step % n;
                by.advance(&period[i * size..][..m * width], waves(i), &start, &mut next);
                std::mem::swap(&mut start, &mut next);
            }
        }
        // one period from the initial change
        memory.columns.resize(n * d * tall, 0.0);
        let mut s = start.clone();
        for step in 1..=n {
            let i = step % n;
            let (states, forces) = memory.rows[i * size..(i + 1) * size].split_at(m * width);
            by.advance(states, waves(i), &s, &mut next);
            let columns = &mut memory.columns[i * d * tall..][..d * tall];
            let same = forces.iter().zip(states).take_while(|(a, b)| a == b).count() / width;
            // forces that are states have the same derivatives
            let (alike, other) = columns.split_at_mut(same * tall);
            alike.copy_from_slice(&next[..same * tall]);
            by.advance(&forces[same * width..], waves(i), &s, other);
            std::mem::swap(&mut s, &mut next);
        }
        // the states at t = 0 change so that they stay periodic
        memory.shift.clear();
        memory.shift.resize(m * tall, 0.0);
        for (r, shift) in memory.shift.chunks_exact_mut(tall).enumerate() {
            for t in 0..m {
                let weight = inverse[(r, t)];
                let gap = s[t * tall..].iter().zip(&start[t * tall..]);
                shift.iter_mut().zip(gap).for_each(|(shift, (s, start))| *shift += (s - start) * weight);
            }
        }
    }

    /// Computes the derivatives of the initial step, into `first`, and of the periods after it
    /// until the states repeat. Restores `self.force`.
    fn transient_derivatives(
        &mut self,
        sequence: &mut dyn StepSequence,
        first: &mut Vec<f64>,
    ) -> Option<Vec<Vec<f64>>> {
        let (m, d) = (sequence.states(), sequence.axes());
        first.resize((m + d) * width(sequence), 0.0);
        let mut z = DVector::zeros(m);
        let mut force = [0.0; MAX_DIRECTIONS];
        if !sequence.initial_step(z.as_mut_slice(), &mut force, Some(first)) {
            return None;
        }
        let forces = self.force.clone();
        let mut rows = Vec::new();
        let run = self.transient(sequence, &mut z, Some(&mut rows));
        self.force = forces;
        run.map(|_| rows)
    }
}

impl StepWorkspace {
    /// Adds to the columns the effect of the changes of the states at t = 0 on the forces.
    fn shift_columns(&mut self, states: usize, wide: usize) {
        if states == 0 {
            return;
        }
        for (column, by_state) in self.columns.chunks_exact_mut(wide).zip(self.by_state.chunks_exact(states)) {
            by_state.iter().zip(self.shift.chunks_exact(wide)).for_each(|(by, shift)| add(column, *by, shift));
        }
    }
}

/// The derivatives of all steps of a period: [sample][state, then force]. The columns are the
/// inputs, then from `before` on the states before the step.
struct PeriodDerivatives<'a> {
    rows: &'a [f64],
    width: usize,
    before: usize,
    states: usize,
    axes: usize,
    samples: usize,
}

impl<'a> PeriodDerivatives<'a> {
    fn new(sequence: &dyn StepSequence, rows: &'a [f64], samples: usize) -> Self {
        let (states, axes) = (sequence.states(), sequence.axes());
        PeriodDerivatives { rows, width: width(sequence), before: sequence.inputs() * axes, states, axes, samples }
    }

    /// Returns Π, the derivative of the states after a period by those before
    /// it. Writes the derivative of the forces at the samples by these states
    /// into `forces`, [sample][axis][state].
    fn product(&self, forces: &mut [f64]) -> DMatrix<f64> {
        match self.states {
            0 => DMatrix::zeros(0, 0),
            1 => self.product_static::<1>(forces),
            2 => self.product_static::<2>(forces),
            _ => self.product_dynamic(forces),
        }
    }

    /// Computes the product for a fixed number of states; most laws have one or two.
    fn product_static<const M: usize>(&self, forces: &mut [f64]) -> DMatrix<f64> {
        let mut product: [[f64; M]; M] = std::array::from_fn(|s| std::array::from_fn(|t| f64::from(u8::from(s == t))));
        for step in 1..=self.samples {
            let i = step % self.samples;
            let rows = &self.rows[i * (M + self.axes) * self.width..][..(M + self.axes) * self.width];
            let (states, own) = rows.split_at(M * self.width);
            let times = |row: &[f64]| -> [f64; M] {
                let row = &row[self.before..self.before + M];
                std::array::from_fn(|t| row.iter().zip(&product).map(|(x, p)| x * p[t]).sum())
            };
            let out = forces[i * self.axes * M..][..self.axes * M].chunks_exact_mut(M);
            own.chunks_exact(self.width).zip(out).for_each(|(row, out)| out.copy_from_slice(&times(row)));
            product = std::array::from_fn(|s| times(&states[s * self.width..]));
        }
        DMatrix::from_fn(M, M, |s, t| product[s][t])
    }

    fn product_dynamic(&self, forces: &mut [f64]) -> DMatrix<f64> {
        let m = self.states;
        let mut product = DMatrix::identity(m, m);
        for step in 1..=self.samples {
            let i = step % self.samples;
            let size = (m + self.axes) * self.width;
            let rows = DMatrix::from_row_slice(m + self.axes, self.width, &self.rows[i * size..(i + 1) * size]);
            let next = rows.columns(self.before, m) * &product;
            let out = &mut forces[i * self.axes * m..][..self.axes * m];
            out.iter_mut().enumerate().for_each(|(at, out)| *out = next[(m + at / m, at % m)]);
            product = next.rows(0, m).into_owned();
        }
        product
    }
}

/// Returns the number of derivatives of a step: by its inputs, by the states
/// before it, and by ω if that is known.
fn width(sequence: &dyn StepSequence) -> usize {
    sequence.inputs() * sequence.axes() + sequence.states() + usize::from(sequence.knows_frequency())
}

/// The variables of a derivative.
#[derive(Clone, Copy)]
enum DerivativeVariable {
    /// The harmonics of the motion along this axis and the next ones.
    Solution { first: usize },
    /// The frequency ω.
    Frequency,
}

/// Returns the derivatives of `Re(U wave)` by the real and imaginary part of U, of harmonic `h`.
fn parts(wave: Complex64, h: usize) -> (f64, f64) {
    (wave.re, if h == 0 { 0.0 } else { -wave.im })
}

/// Layout of the derivatives of a step by its inputs.
struct InputLayout {
    input: DerivativeVariable,
    kinds: usize,
    axes: usize,
    width: usize,
    /// Number of columns of one axis, and of all.
    wide: usize,
    tall: usize,
}

impl InputLayout {
    /// Multiplies `rows` by the inputs, [kind][column of any axis], and by the states,
    /// [state][column]. Writes the result into `out`, [row][column].
    #[inline]
    fn advance(&self, rows: &[f64], waves: &[f64], states: &[f64], out: &mut [f64]) {
        for (row, out) in rows.chunks_exact(self.width).zip(out.chunks_exact_mut(self.tall)) {
            let before = &row[self.kinds * self.axes..];
            for (number, out) in out.chunks_exact_mut(self.wide).enumerate() {
                let states = states.chunks_exact(self.tall).map(|state| &state[number * self.wide..][..self.wide]);
                match self.input {
                    // most laws: two inputs and two states, all at once
                    DerivativeVariable::Solution { first } if self.kinds == 2 && states.len() == 2 => {
                        let weights = [row[first + number], row[self.axes + first + number], before[0], before[1]];
                        let mut states = states;
                        let (Some(one), Some(two)) = (states.next(), states.next()) else { continue };
                        let (from, to) = waves.split_at(self.wide);
                        mix(weights, [from, to, one, two], out);
                        continue;
                    }
                    DerivativeVariable::Solution { first } => {
                        out.fill(0.0);
                        for (kind, wave) in waves.chunks_exact(self.wide).enumerate() {
                            add(out, row[kind * self.axes + first + number], wave);
                        }
                    }
                    DerivativeVariable::Frequency => out.fill(row[self.width - 1]),
                }
                before.iter().zip(states).for_each(|(weight, state)| add(out, *weight, state));
            }
        }
    }
}

/// Computes the weighted sum of inputs and states. An open contact has only zero weights; one
/// that sticks along another axis has no weights of inputs.
#[inline]
fn mix(weights: [f64; 4], [from, to, one, two]: [&[f64]; 4], out: &mut [f64]) {
    let states = one.iter().zip(two);
    if weights == [0.0; 4] {
        out.fill(0.0);
    } else if weights[..2] == [0.0; 2] {
        out.iter_mut().zip(states).for_each(|(out, (one, two))| *out = weights[2] * one + weights[3] * two);
    } else {
        for ((out, (from, to)), (one, two)) in out.iter_mut().zip(from.iter().zip(to)).zip(states) {
            *out = (weights[0] * from + weights[1] * to) + (weights[2] * one + weights[3] * two);
        }
    }
}

/// Adds `weight` times `values`. Most weights of a step are zero.
#[inline]
fn add(to: &mut [f64], weight: f64, values: &[f64]) {
    if weight != 0.0 {
        to.iter_mut().zip(values).for_each(|(to, value)| *to += weight * value);
    }
}

/// Returns the pseudo-inverse, with singular values below
/// [`PeriodicStateSettings::neutral_singular_value`] taken as zero.
fn pseudo_inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let settings = PeriodicStateSettings::default();
    let m = matrix.nrows();
    if m == 0 {
        return matrix;
    }
    let svd = matrix.svd(true, true);
    svd.pseudo_inverse(settings.neutral_singular_value).unwrap_or_else(|_| DMatrix::zeros(m, m))
}
