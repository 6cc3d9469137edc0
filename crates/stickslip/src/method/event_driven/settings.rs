//! Settings of the event-driven method.

/// The name of the method in study files.
pub(super) const NAME: &str = "event-driven";

/// Settings of the search for an exact orbit and of its segments.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EventDrivenSettings {
    /// Residual of a converged orbit, relative to its state: a hundred times the rounding of one
    /// period.
    pub residual: f64,
    /// Energy gap per distance of a motion that has not completely settled. It is the ratio of
    /// stored energy to the work of a period in a structure with a quality factor of 1000.
    pub gap_per_distance: f64,
    /// Fraction of the state that the loads can cause below which a state counts as rest.
    pub rest_fraction: f64,
    /// Largest energy gap of a converged orbit. The closed-form integrals are exact to about
    /// 1e-12.
    pub energy_gap: f64,
    /// Estimated distance to the orbit, relative to its state, above which a converged orbit
    /// receives one more Newton step. Near a resonance, the distance is dozens of times the
    /// residual. Measured amplitude errors of the couple: at most 3e-11 with this step, 6e-11
    /// without it. One orbit in fifty takes the step.
    pub refinement_distance: f64,
    /// Relative stiffness below which a direction counts as unsupported, and relative residual
    /// force below which a load counts as supported. It covers rounding of a stiffness matrix that
    /// lost some digits in its assembly.
    pub support: f64,
    /// Relative velocity, as a fraction of the largest one, that counts as zero. Switch times are
    /// accurate to 1e-15 of the velocity scale. Joints that switch together by symmetry differ by
    /// the rounding of the whole orbit, about 1e-12.
    pub zero_velocity: f64,
    /// A force within this fraction of its limit counts as at the limit. The reason is that of
    /// `zero_velocity`.
    pub at_limit: f64,
    /// An acceleration or higher derivative below this fraction of its terms counts as zero.
    pub zero_acceleration: f64,
    /// Number of derivatives after which contacts exactly at the border remain in stick.
    pub derivatives: u32,
    /// Number of switches in one run above which the motion counts as chatter. Den Hartog's
    /// oscillator at a fiftieth of its natural frequency has about 200.
    pub switches: usize,
    /// Memory of the segments of one run, bytes, above which the motion also counts as chatter. A
    /// return of a ring of 48 blades has a few hundred switches, and a segment takes a tenth of a
    /// megabyte.
    pub segment_memory: usize,
    /// Number of switches without motion, per part, after which rounding makes the decision and
    /// the signals contradict each other. This occurs for a motion that creeps towards a border
    /// and has reached it up to rounding.
    pub idle_switches: usize,
    /// Number of switches at the same instant, per part, above which the decision cycles. Every
    /// part can change once per derivative that decides.
    pub simultaneous_switches: usize,
    /// Upper bound of the energy scale of springs in series with sliders, as a multiple of that of
    /// the loads. Structures that slip at all have a ratio below 10.
    pub preload_ratio: f64,
}

impl Default for EventDrivenSettings {
    fn default() -> Self {
        EventDrivenSettings {
            residual: 1e-12,
            gap_per_distance: 1e3,
            rest_fraction: 1e-3,
            energy_gap: 1e-8,
            refinement_distance: 7e-12,
            support: 1e-12,
            zero_velocity: 1e-10,
            at_limit: 1e-10,
            zero_acceleration: 1e-9,
            derivatives: 4,
            switches: 20_000,
            segment_memory: 256 << 20,
            idle_switches: 2,
            simultaneous_switches: 8,
            preload_ratio: 10.0,
        }
    }
}
