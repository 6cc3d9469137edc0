//! Settings of Newton's method, of the work limits and of the fallbacks: every knob with its
//! default and its reason. Other settings stand in the files that use them.
//!
//! The options that users set are in `options`.

use super::budget::WorkShare;

/// Settings of Newton's method.
#[derive(Debug, Clone, Copy)]
pub(super) struct NewtonSettings {
    /// Largest number of iterations. Default 60; 3 to 15 are usual.
    pub iterations: usize,
    /// Iterations without a halved least residual after which a search with unknown forces
    /// stagnates. Default 8.
    pub stagnation_iterations: usize,
    /// Largest residual that counts as rounding if a step with the exact Jacobian does not reduce
    /// it. Default 1e-8: forces are differentiable functions of the harmonics, so the remainder is
    /// the rounding of structures whose stiffnesses differ widely.
    pub rounding: f64,
    /// Newton's method on coarse samples, for many contacts.
    pub coarse: CoarseSettings,
    /// Steps of a body that contacts alone support.
    pub mean: MeanSettings,
}

impl Default for NewtonSettings {
    fn default() -> Self {
        NewtonSettings {
            iterations: 60,
            stagnation_iterations: 8,
            rounding: 1e-8,
            coarse: CoarseSettings::default(),
            mean: MeanSettings::default(),
        }
    }
}

/// Settings of Newton's method with coarse samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct CoarseSettings {
    /// Residual at which a search on coarse samples ends, for 1024 full samples. For fewer samples
    /// it grows with the square of their spacing. Default 8e-4: the sampling error of the coarse
    /// samples has this size.
    pub tolerance: f64,
    /// Largest share of the residual that a step with the coarse Jacobian may leave. A larger share
    /// ends the use of coarse Jacobians. A smaller one keeps the Jacobian for the next step,
    /// because a new one would have the same sampling error. Default 0.1.
    pub reduction: f64,
}

impl Default for CoarseSettings {
    fn default() -> Self {
        CoarseSettings { tolerance: 8e-4, reduction: 0.1 }
    }
}

/// Settings for a body that contacts alone support: a step that opens all of them, or slips in
/// all, loses the restoring stiffness.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeanSettings {
    /// Mean displacement of a step, relative to the extent of the motion, above which regularized
    /// steps are tried too. Default 2.
    pub long_step: f64,
    /// Stiffnesses of the springs that regularize such a step, relative to closed contacts.
    pub springs: [f64; 5],
    /// Mean displacement, relative to the extent of the motion, beyond which a body has left its
    /// contacts. Default 10: the mean of a supported body stays within about its vibration
    /// amplitude.
    pub left_contacts: f64,
    /// Share of the residual below which even a long step counts as leading to the solution.
    /// Default 0.1.
    pub near_solution: f64,
}

impl Default for MeanSettings {
    fn default() -> Self {
        MeanSettings { long_step: 2.0, springs: [1e-3, 1e-2, 0.1, 1.0, 10.0], left_contacts: 10.0, near_solution: 0.1 }
    }
}

/// Settings of the work limits.
#[derive(Debug, Clone, Copy)]
pub(super) struct WorkSettings {
    /// Multiplications of one search. Default 2e10, about four seconds on one core.
    pub multiplications: f64,
    /// Least number of eliminations in the limit of a search. Default 40; a converging search takes
    /// a few. It does not apply to a series with force ports that refines a shorter one.
    pub eliminations: f64,
    /// Products with the Jacobian in one step by GMRES, roughly. Default 30.
    pub products_per_step: f64,
    /// Multiplications of one evaluation per sample and axis: both Fourier transforms and the law.
    /// Default 40, measured: 15 µs for 2048 samples.
    pub evaluation: f64,
    /// Multiplications of such an evaluation for friction that falls with velocity, whose force is
    /// solved for at six instants of each sample. Default 2000, measured: 0.4 µs.
    pub falling_evaluation: f64,
    /// Time steps of laws with memory in one search, unless `evaluations` ask for more. Default
    /// 3e6: a converging search of one joint takes a few hundred thousand, and with a stiff law the
    /// limit takes ten seconds.
    pub time_steps: usize,
    /// Number of evaluations of all laws with memory that the limit of a search always covers, each
    /// over four periods of at most 1024 samples. Default 800; homotopies take hundreds.
    pub evaluations: usize,
    /// Limit of all searches of a point, relative to one search, including those of the error
    /// estimate. Default 3 for multiplications: Newton's method and two of the fallbacks may each
    /// use the eliminations of one search. Converged points of 173 random systems used at most 1.01
    /// of half of it, all but one at most 0.4. Default 1 for time steps.
    pub point: WorkShare,
    /// Work of a point, relative to that of its first orbit, up to which longer series may reduce
    /// the error of that orbit. Default 8: a few doublings of the number of harmonics.
    pub improvement: f64,
    /// Newton steps that the remaining budget of a point must cover before a longer series is
    /// begun. Default 3: refining a shorter series takes 6 to 25 steps in banded form, and at most
    /// three counted steps with GMRES.
    pub reserved_steps: f64,
}

impl Default for WorkSettings {
    fn default() -> Self {
        WorkSettings {
            multiplications: 2e10,
            eliminations: 40.0,
            products_per_step: 30.0,
            evaluation: 40.0,
            falling_evaluation: 2000.0,
            time_steps: 3_000_000,
            evaluations: 800,
            point: WorkShare { multiplications: 3.0, time_steps: 1.0 },
            improvement: 8.0,
            reserved_steps: 3.0,
        }
    }
}

/// Settings of the proximal point method, with the weight `s` of its term.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProximalSettings {
    /// First value of `s`. Default 1.
    pub first_weight: f64,
    /// Largest value of `s`. Default 1e4: beyond it a proximal point hardly moves.
    pub largest_weight: f64,
    /// Bounds of the factor by which `s` shrinks after a point. Default 0.1 and 0.3. The factor is
    /// squared after few Newton iterations, within these bounds; failures increase it.
    pub reduction: [f64; 2],
    /// Factor above which a failure keeps `s` in the next try. Default 0.5. A failure with an
    /// unchanged `s` increases it.
    pub retry_factor: f64,
    /// Residual at which the last point counts as the solution if the next one is not found.
    /// Default 1e-6, a thousandth of the usual truncation error: the total force of redundant
    /// contacts is then known to this accuracy; only its distribution among them is not.
    pub accepted_residual: f64,
    /// Largest number of points and tries. Default 40; ten are usual.
    pub points: usize,
    /// Newton iterations per point. Default 30; 2 to 10 are usual.
    pub iterations: usize,
    /// Newton iterations up to which a point was found quickly. Default 8.
    pub quick_iterations: usize,
}

impl Default for ProximalSettings {
    fn default() -> Self {
        ProximalSettings {
            first_weight: 1.0,
            largest_weight: 1e4,
            reduction: [0.1, 0.3],
            retry_factor: 0.5,
            accepted_residual: 1e-6,
            points: 40,
            iterations: 30,
            quick_iterations: 8,
        }
    }
}

/// Settings of the interior point method.
#[derive(Debug, Clone, Copy)]
pub(super) struct InteriorPointSettings {
    /// Samples per wave of the highest harmonic on the path. Default 16; Newton's method continues
    /// with all samples.
    pub samples_per_wave: usize,
    /// Complementarity product, in units of the squared limit, at which the path ends. Default
    /// 1e-4: nearly all samples are then at a limit or clearly inside.
    pub end_of_path: f64,
    /// Largest number of steps. Default 60; 5 to 30 are usual.
    pub steps: usize,
    /// Steps without halved products after which the path is given up. Default 8: elastic friction
    /// next to the rigid one may stop its progress, because its kinks are not smoothed.
    pub stagnation_steps: usize,
    /// Newton iterations from the end of the path. Default 30; 1 to 5 are usual.
    pub iterations: usize,
}

impl Default for InteriorPointSettings {
    fn default() -> Self {
        InteriorPointSettings {
            samples_per_wave: 16,
            end_of_path: 1e-4,
            steps: 60,
            stagnation_steps: 8,
            iterations: 30,
        }
    }
}

/// Settings of the homotopy in the slip limits.
#[derive(Debug, Clone, Copy)]
pub(super) struct SlipHomotopySettings {
    /// Total Newton iterations while slip limits are raised. Default 200; one is enough at limits
    /// at which all joints stick.
    pub raising_iterations: usize,
    /// Newton iterations at one raised limit if only contacts support the structure. Default 6: one
    /// iteration from static equilibrium reaches the solution in which all joints stick, if the
    /// limits are high enough.
    pub stuck_iterations: usize,
    /// Total Newton iterations while slip limits are lowered. Default 3000; a few hundred are
    /// usual.
    pub iterations: usize,
}

impl Default for SlipHomotopySettings {
    fn default() -> Self {
        SlipHomotopySettings { raising_iterations: 200, stuck_iterations: 6, iterations: 3000 }
    }
}

/// Settings of initial guesses from time integration.
#[derive(Debug, Clone, Copy)]
pub(super) struct TimeStartSettings {
    /// Largest number of frequencies at which the motion is integrated after a failure, in each
    /// block of a sweep. Default 8; each integration takes seconds.
    pub integrations: usize,
    /// Largest number of degrees of freedom. Default 60: steps multiply full matrices.
    pub dofs: usize,
    /// Number of series lengths that are tried from a settled motion, each with twice the
    /// harmonics. Default 3.
    pub series_lengths: usize,
}

impl Default for TimeStartSettings {
    fn default() -> Self {
        TimeStartSettings { integrations: 8, dofs: 60, series_lengths: 3 }
    }
}
