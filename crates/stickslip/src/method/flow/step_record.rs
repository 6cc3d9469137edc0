//! The record of an integration in steps: the motion at instants, and at the quadrature nodes
//! between them.

use super::assembly::Assembly;
use crate::law::Contact;

/// The record of a run: the state at instants, and values at the quadrature nodes between them.
/// Successive runs reuse the memory.
#[derive(Debug, Clone)]
pub(crate) struct StepRecord {
    /// Nodes and weights of the quadrature in a step, relative to its length; the last node is
    /// the end.
    pub nodes: Vec<(f64, f64)>,
    /// Start and length of every step, s.
    pub spans: Vec<(f64, f64)>,
    /// Numbers of degrees of freedom, axes and joints.
    size: [usize; 3],
    /// The values of [`RecordedInstant`], instant by instant: one more than there are steps, or
    /// two per step with `jumps`.
    instants: Vec<f64>,
    /// True if forces may jump between steps. Each step then stores both of its ends, and a
    /// contact state holds for a whole step.
    pub jumps: bool,
    /// The values of [`RecordedNode`] without contact states, node by node.
    values: Vec<f64>,
    contacts: Vec<Contact>,
}

/// The motion at an instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecordedInstant<'a> {
    pub displacement: &'a [f64],
    pub velocity: &'a [f64],
    pub acceleration: &'a [f64],
    /// Forces along the axes.
    pub force: &'a [f64],
}

/// The motion at a node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecordedNode<'a> {
    pub displacement: &'a [f64],
    pub velocity: &'a [f64],
    /// Relative velocities and forces along the axes.
    pub relative: &'a [f64],
    pub force: &'a [f64],
    /// Contact states of the joints.
    pub contact: &'a [Contact],
}

/// Extrapolates two solutions of second order, the finer one in half the steps, to the limit:
/// `fine + (fine - coarse) / 3`, into `coarse`.
pub(crate) fn extrapolate(coarse: &mut [f64], fine: &[f64]) {
    coarse.iter_mut().zip(fine).for_each(|(coarse, fine)| *coarse = fine + (fine - *coarse) / 3.0);
}

impl StepRecord {
    pub fn new(nodes: Vec<(f64, f64)>, assembly: &Assembly) -> Self {
        let size = [assembly.n, assembly.axes.len(), assembly.joints.len()];
        let (instants, values) = (Vec::new(), Vec::new());
        StepRecord { nodes, spans: Vec::new(), size, instants, jumps: false, values, contacts: Vec::new() }
    }

    /// Makes the record of a run with forces that may jump.
    pub fn with_jumps(nodes: Vec<(f64, f64)>, assembly: &Assembly) -> Self {
        StepRecord { jumps: true, ..StepRecord::new(nodes, assembly) }
    }

    pub fn clear(&mut self) {
        self.spans.clear();
        self.instants.clear();
        self.values.clear();
        self.contacts.clear();
    }

    /// Appends an instant with the displacements and velocities of `state`; returns the memory
    /// for its accelerations.
    pub fn push_instant(&mut self, state: &[f64], force: &[f64]) -> &mut [f64] {
        let [n, axes, _] = self.size;
        self.instants.extend_from_slice(&state[..2 * n]);
        let acceleration = self.instants.len();
        self.instants.resize(acceleration + n, 0.0);
        self.instants.extend_from_slice(&force[..axes]);
        &mut self.instants[acceleration..acceleration + n]
    }

    /// Appends a node.
    pub fn push_node(
        &mut self,
        [displacement, velocity]: [&[f64]; 2],
        [relative, force]: [&[f64]; 2],
        contact: impl IntoIterator<Item = Contact>,
    ) {
        for values in [displacement, velocity, relative, force] {
            self.values.extend_from_slice(values);
        }
        self.contacts.extend(contact);
    }

    fn instant(&self, at: usize) -> RecordedInstant<'_> {
        let [n, axes, _] = self.size;
        let (displacement, rest) = self.instants[at * (3 * n + axes)..].split_at(n);
        let (velocity, rest) = rest.split_at(n);
        let (acceleration, rest) = rest.split_at(n);
        RecordedInstant { displacement, velocity, acceleration, force: &rest[..axes] }
    }

    /// Returns both ends of a step.
    pub fn ends(&self, step: usize) -> [RecordedInstant<'_>; 2] {
        let first = if self.jumps { 2 * step } else { step };
        [self.instant(first), self.instant(first + 1)]
    }

    pub fn node(&self, at: usize) -> RecordedNode<'_> {
        let [n, axes, joints] = self.size;
        let (displacement, rest) = self.values[at * 2 * (n + axes)..].split_at(n);
        let (velocity, rest) = rest.split_at(n);
        let (relative, rest) = rest.split_at(axes);
        let contact = &self.contacts[at * joints..(at + 1) * joints];
        RecordedNode { displacement, velocity, relative, force: &rest[..axes], contact }
    }

    /// Returns the number of nodes.
    pub fn count(&self) -> usize {
        self.spans.len() * self.nodes.len()
    }

    /// Returns all nodes in order.
    pub fn nodes(&self) -> impl Iterator<Item = RecordedNode<'_>> {
        (0..self.count()).map(|at| self.node(at))
    }

    /// Returns the contact states of the joints at the end of a step.
    pub fn contact_at_end(&self, step: usize) -> &[Contact] {
        self.node((step + 1) * self.nodes.len() - 1).contact
    }

    /// Returns the time and weight of a node, s.
    pub fn time(&self, at: usize) -> (f64, f64) {
        let ((start, length), (node, weight)) = (self.spans[at / self.nodes.len()], self.nodes[at % self.nodes.len()]);
        (start + node * length, weight * length)
    }

    /// Extrapolates the record of a run with one node per step, with `fine` as the run in half
    /// the steps.
    pub fn extrapolated(mut self, fine: &StepRecord) -> StepRecord {
        let [n, axes, joints] = self.size;
        let length = 3 * n + axes;
        for (i, instant) in self.instants.chunks_exact_mut(length.max(1)).enumerate() {
            extrapolate(instant, &fine.instants[2 * i * length..]);
        }
        // the node of a step is its end, which is the end of every second half step
        let length = 2 * (n + axes);
        for (i, node) in self.values.chunks_exact_mut(length.max(1)).enumerate() {
            extrapolate(node, &fine.values[(2 * i + 1) * length..]);
        }
        for (i, contact) in self.contacts.chunks_exact_mut(joints.max(1)).enumerate() {
            contact.copy_from_slice(&fine.contacts[(2 * i + 1) * joints..(2 * i + 2) * joints]);
        }
        self
    }
}
