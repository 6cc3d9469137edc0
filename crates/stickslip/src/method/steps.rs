//! The record of a run in steps: the motion at instants, and at the nodes of a quadrature between them.

use super::assembly::Assembly;
use crate::law::Contact;

/// The record of a run: the state at instants, and values at the nodes of a quadrature between them. One run after the other fills the same memory.
#[derive(Debug, Clone)]
pub(crate) struct Steps {
    /// Nodes and weights of the quadrature within a step, over its length; the last node is its end.
    pub nodes: Vec<(f64, f64)>,
    /// Start and length of every step, s.
    pub spans: Vec<(f64, f64)>,
    /// Degrees of freedom, axes of joints, joints.
    size: [usize; 3],
    /// What [`Instant`] says, instant after instant, one more than there are steps, or two for each.
    instants: Vec<f64>,
    /// Whether forces may jump from one step to the next, so that each has both of its ends, and joints do the same
    /// throughout a step.
    pub jumps: bool,
    /// What [`Node`] says but for the contacts, node after node.
    values: Vec<f64>,
    contacts: Vec<Contact>,
}

/// The motion at an instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Instant<'a> {
    pub displacement: &'a [f64],
    pub velocity: &'a [f64],
    pub acceleration: &'a [f64],
    /// Forces along the axes.
    pub force: &'a [f64],
}

/// The motion at a node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node<'a> {
    pub displacement: &'a [f64],
    pub velocity: &'a [f64],
    /// Relative velocity and force along the axes.
    pub relative: &'a [f64],
    pub force: &'a [f64],
    /// What the joints do.
    pub contact: &'a [Contact],
}

/// What two solutions of second order, the finer one in half the steps, say of the limit: `fine + (fine - coarse) / 3`, into `coarse`.
pub(crate) fn extrapolate(coarse: &mut [f64], fine: &[f64]) {
    coarse.iter_mut().zip(fine).for_each(|(coarse, fine)| *coarse = fine + (fine - *coarse) / 3.0);
}

impl Steps {
    pub fn new(nodes: Vec<(f64, f64)>, assembly: &Assembly) -> Self {
        let size = [assembly.n, assembly.axes.len(), assembly.joints.len()];
        let (instants, values) = (Vec::new(), Vec::new());
        Steps { nodes, spans: Vec::new(), size, instants, jumps: false, values, contacts: Vec::new() }
    }

    /// The same of a run whose forces may jump.
    pub fn with_jumps(nodes: Vec<(f64, f64)>, assembly: &Assembly) -> Self {
        Steps { jumps: true, ..Steps::new(nodes, assembly) }
    }

    pub fn clear(&mut self) {
        self.spans.clear();
        self.instants.clear();
        self.values.clear();
        self.contacts.clear();
    }

    /// Appends an instant at which the state begins with displacements and velocities; returns where its accelerations go.
    pub fn keep_instant(&mut self, state: &[f64], force: &[f64]) -> &mut [f64] {
        let [n, axes, _] = self.size;
        self.instants.extend_from_slice(&state[..2 * n]);
        let acceleration = self.instants.len();
        self.instants.resize(acceleration + n, 0.0);
        self.instants.extend_from_slice(&force[..axes]);
        &mut self.instants[acceleration..acceleration + n]
    }

    /// Appends a node.
    pub fn keep_node(
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

    fn instant(&self, at: usize) -> Instant<'_> {
        let [n, axes, _] = self.size;
        let (displacement, rest) = self.instants[at * (3 * n + axes)..].split_at(n);
        let (velocity, rest) = rest.split_at(n);
        let (acceleration, rest) = rest.split_at(n);
        Instant { displacement, velocity, acceleration, force: &rest[..axes] }
    }

    /// Both ends of a step.
    pub fn ends(&self, step: usize) -> [Instant<'_>; 2] {
        let first = if self.jumps { 2 * step } else { step };
        [self.instant(first), self.instant(first + 1)]
    }

    pub fn node(&self, at: usize) -> Node<'_> {
        let [n, axes, joints] = self.size;
        let (displacement, rest) = self.values[at * 2 * (n + axes)..].split_at(n);
        let (velocity, rest) = rest.split_at(n);
        let (relative, rest) = rest.split_at(axes);
        let contact = &self.contacts[at * joints..(at + 1) * joints];
        Node { displacement, velocity, relative, force: &rest[..axes], contact }
    }

    /// How many nodes there are.
    pub fn count(&self) -> usize {
        self.spans.len() * self.nodes.len()
    }

    /// Every node.
    pub fn each(&self) -> impl Iterator<Item = Node<'_>> {
        (0..self.count()).map(|at| self.node(at))
    }

    /// What the joints do at the end of a step.
    pub fn contact_at_end(&self, step: usize) -> &[Contact] {
        self.node((step + 1) * self.nodes.len() - 1).contact
    }

    /// Time and weight of a node, s.
    pub fn time(&self, at: usize) -> (f64, f64) {
        let ((start, length), (node, weight)) = (self.spans[at / self.nodes.len()], self.nodes[at % self.nodes.len()]);
        (start + node * length, weight * length)
    }

    /// The record of a run in steps of one node with what one in halves of them, `fine`, says of their error.
    pub fn extrapolated(mut self, fine: &Steps) -> Steps {
        let [n, axes, joints] = self.size;
        let length = 3 * n + axes;
        for (i, instant) in self.instants.chunks_exact_mut(length.max(1)).enumerate() {
            extrapolate(instant, &fine.instants[2 * i * length..]);
        }
        // the node of a step is its end, which is that of every second half
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
