//! Vectors of three `f64`, for everything that is not a query: generating, framing, normals.

/// A vector or a point.
pub(crate) type Vector = [f64; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns `from + amount * along`.
pub(crate) fn offset(from: Vector, amount: f64, along: Vector) -> Vector {
    [0, 1, 2].map(|axis| from[axis] + amount * along[axis])
}

pub(crate) fn length(v: Vector) -> f64 {
    dot(v, v).sqrt()
}

/// Returns the vector at length 1, unless its length is 0. No `f32` coordinates are too small or too large.
pub(crate) fn unit(v: Vector) -> Option<Vector> {
    let length = length(v);
    (length > 0.0).then(|| v.map(|c| c / length))
}

/// Rounds a point to the coordinates of a mesh or a ray.
#[expect(clippy::cast_possible_truncation, reason = "the rounding that is wanted")]
pub(crate) fn round(v: Vector) -> [f32; 3] {
    v.map(|c| c as f32)
}
