//! Linear equations whose matrix has entries near its diagonal only: elimination with row exchanges inside the band.
//!
//! Memory and work grow with the number of unknowns times the band, and its square. Source: Golub and Van Loan, "Matrix
//! Computations" (2013), Sec. 4.3.

/// A square matrix with `band` diagonals on either side of the main one.
///
/// # Example
/// ```
/// use stickslip_numerics::banded::Banded;
/// let mut matrix = Banded::new(3, 1);
/// for (i, j, value) in [(0, 1, 1.0), (1, 0, 2.0), (1, 2, 1.0), (2, 2, 4.0)] {
///     matrix.add(i, j, value);
/// }
/// assert!(matrix.factor());
/// let mut x = [2.0, 5.0, 12.0];
/// matrix.solve(&mut x);
/// assert_eq!(x, [1.0, 2.0, 3.0]);
/// ```
#[derive(Debug, Clone)]
pub struct Banded {
    n: usize,
    band: usize,
    /// Row i holds columns i - band to i + 2 band: row exchanges fill the upper band up to twice its width.
    rows: Vec<f64>,
    pivots: Vec<usize>,
    /// Last column of each factored row.
    ends: Vec<usize>,
}

impl Banded {
    /// The zero matrix.
    pub fn new(n: usize, band: usize) -> Self {
        Banded { n, band, rows: vec![0.0; n * (3 * band + 1)], pivots: vec![0; n], ends: vec![0; n] }
    }

    /// Memory of such a matrix of `n` rows, bytes.
    pub fn bytes(n: usize, band: usize) -> f64 {
        8.0 * n as f64 * (3 * band + 3) as f64
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.rows.fill(0.0);
    }

    /// Adds to the entry (i, j).
    ///
    /// # Panics
    /// If the entry lies outside of the band.
    #[inline]
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        assert!(i.abs_diff(j) <= self.band, "({i}, {j}) lies outside of the band {}", self.band);
        self.rows[i * (3 * self.band + 1) + j + self.band - i] += value;
    }

    /// Factors the matrix in place. False if it is singular.
    pub fn factor(&mut self) -> bool {
        let (n, b) = (self.n, self.band);
        let width = 3 * b + 1;
        // entry (i, j) stands at i * width + j + b - i
        let at = |i: usize, j: usize| i * width + j + b - i;
        // the last column of every row that is not zero: beyond it only row exchanges fill
        self.ends.iter_mut().enumerate().for_each(|(i, end)| *end = (i + b).min(n - 1));
        for k in 0..n {
            let last = (k + b).min(n - 1);
            let mut pivot = k;
            for i in k + 1..=last {
                if self.rows[at(i, k)].abs() > self.rows[at(pivot, k)].abs() {
                    pivot = i;
                }
            }
            let value = self.rows[at(pivot, k)];
            if value == 0.0 || !value.is_finite() {
                return false;
            }
            self.pivots[k] = pivot;
            if pivot != k {
                for j in k..=self.ends[k].max(self.ends[pivot]) {
                    self.rows.swap(at(k, j), at(pivot, j));
                }
                self.ends.swap(k, pivot);
            }
            let end = self.ends[k];
            let inverse = 1.0 / value;
            for i in k + 1..=last {
                let factor = self.rows[at(i, k)] * inverse;
                self.rows[at(i, k)] = factor;
                if factor != 0.0 {
                    self.ends[i] = self.ends[i].max(end);
                    let (top, bottom) = self.rows.split_at_mut(i * width);
                    let source = &top[at(k, k) + 1..=at(k, end)];
                    let start = k + 1 + b - i;
                    for (x, p) in bottom[start..start + source.len()].iter_mut().zip(source) {
                        *x -= factor * p;
                    }
                }
            }
        }
        true
    }

    /// Solves with the factors; `right` becomes the solution.
    pub fn solve(&self, right: &mut [f64]) {
        let (n, b) = (self.n, self.band);
        let width = 3 * b + 1;
        let at = |i: usize, j: usize| i * width + j + b - i;
        for k in 0..n {
            right.swap(k, self.pivots[k]);
            for i in k + 1..=(k + b).min(n - 1) {
                right[i] -= self.rows[at(i, k)] * right[k];
            }
        }
        for k in (0..n).rev() {
            let end = self.ends[k];
            let row = &self.rows[at(k, k)..=at(k, end)];
            let sum: f64 = row[1..].iter().zip(&right[k + 1..=end]).map(|(a, x)| a * x).sum();
            right[k] = (right[k] - sum) / row[0];
        }
    }
}

/// An order of the nodes of a graph in which neighbours stand close together: `order[node]` is the node's position. `links` lists the
/// pairs that are connected.
///
/// Source: Cuthill and McKee (1969).
pub fn order(nodes: usize, links: &[(usize, usize)]) -> Vec<usize> {
    let mut neighbours = vec![Vec::new(); nodes];
    for &(a, b) in links {
        if a != b {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    let mut position = vec![usize::MAX; nodes];
    let mut sequence: Vec<usize> = Vec::with_capacity(nodes);
    while sequence.len() < nodes {
        let free = (0..nodes).filter(|&i| position[i] == usize::MAX);
        let first = free.min_by_key(|&i| neighbours[i].len()).expect("a node is left");
        position[first] = sequence.len();
        sequence.push(first);
        let mut next = sequence.len() - 1;
        while next < sequence.len() {
            let mut found: Vec<usize> =
                neighbours[sequence[next]].iter().copied().filter(|&i| position[i] == usize::MAX).collect();
            found.sort_by_key(|&i| neighbours[i].len());
            for i in found {
                position[i] = sequence.len();
                sequence.push(i);
            }
            next += 1;
        }
    }
    position
}
