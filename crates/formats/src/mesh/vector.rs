//! Vectors in space.

/// Components along x, y, z.
pub(super) type Vector = [f64; 3];

pub(super) fn sub(a: &Vector, b: &Vector) -> Vector {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

pub(super) fn scaled(a: &Vector, factor: f64) -> Vector {
    a.map(|component| component * factor)
}

pub(super) fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn cross(a: &Vector, b: &Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn norm(a: &Vector) -> f64 {
    dot(a, a).sqrt()
}
