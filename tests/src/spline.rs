//! Height fields as uniform cubic tensor-product B-splines, evaluated in the plainest way.
//!
//! The grid values are the coefficients: the surface approximates them and does not pass through them. Column `i` of
//! row `j` sits at `u = (i + 1/2) / columns`, `v = (j + 1/2) / rows`; outside the grid the border values go on.

/// Rows and columns that are repeated around the grid, so that evaluation needs no clamping of single taps.
const PADDING: usize = 4;

/// A height field over the unit square.
#[derive(Clone, Debug)]
pub struct Spline {
    columns: usize,
    rows: usize,
    padded: Vec<f64>,
    bounds: [f64; 2],
}

/// A height with its derivatives by `u` and `v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplineValue {
    /// The height, metres.
    pub height: f64,
    /// Derivative of the height by `u`, metres.
    pub du: f64,
    /// Derivative of the height by `v`, metres.
    pub dv: f64,
}

impl Spline {
    /// A spline from `rows * columns` coefficients in metres, row by row.
    ///
    /// # Panics
    ///
    /// When the number of coefficients is not `rows * columns`, or zero.
    pub fn new(coefficients: &[f64], columns: usize, rows: usize) -> Self {
        assert!(columns > 0 && rows > 0 && coefficients.len() == columns * rows, "a grid of {columns} x {rows} values");
        let clamp = |i: usize, n: usize| i.saturating_sub(PADDING).min(n - 1);
        let padded = (0..rows + 2 * PADDING)
            .flat_map(|j| (0..columns + 2 * PADDING).map(move |i| (i, j)))
            .map(|(i, j)| coefficients[clamp(j, rows) * columns + clamp(i, columns)])
            .collect();
        let bounds = coefficients.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], c| [a.min(*c), b.max(*c)]);
        Self { columns, rows, padded, bounds }
    }

    /// No displacement.
    pub fn flat() -> Self {
        Self::new(&[0.0], 1, 1)
    }

    /// Smallest and largest coefficient: the height lies between them (convex hull property).
    pub fn bounds(&self) -> [f64; 2] {
        self.bounds
    }

    /// The height and its derivatives at `(u, v)`.
    pub fn value(&self, u: f64, v: f64) -> SplineValue {
        let (column, fu) = cell(u, self.columns);
        let (row, fv) = cell(v, self.rows);
        let (wu, du) = weights(fu);
        let (wv, dv) = weights(fv);
        let stride = self.columns + 2 * PADDING;
        let mut value = SplineValue { height: 0.0, du: 0.0, dv: 0.0 };
        for k in 0..4 {
            let p = &self.padded[(row + k) * stride + column..][..4];
            let s = wu[0] * p[0] + wu[1] * p[1] + wu[2] * p[2] + wu[3] * p[3];
            let e = du[0] * p[0] + du[1] * p[1] + du[2] * p[2] + du[3] * p[3];
            value.height += wv[k] * s;
            value.du += wv[k] * e;
            value.dv += dv[k] * s;
        }
        value.du *= self.columns as f64;
        value.dv *= self.rows as f64;
        value
    }
}

/// The first padded tap and the position between the second and the third.
fn cell(t: f64, n: usize) -> (usize, f64) {
    let a = t * n as f64 - 0.5;
    let k = a.floor().clamp(-3.0, n as f64 + 1.0);
    ((k + (PADDING - 1) as f64) as usize, a - k)
}

/// Values and derivatives of the four cubic B-splines that are not zero at `f`.
fn weights(f: f64) -> ([f64; 4], [f64; 4]) {
    let (f2, g) = (f * f, 1.0 - f);
    let f3 = f2 * f;
    (
        [g * g * g / 6.0, (3.0 * f3 - 6.0 * f2 + 4.0) / 6.0, (-3.0 * f3 + 3.0 * f2 + 3.0 * f + 1.0) / 6.0, f3 / 6.0],
        [-0.5 * g * g, (9.0 * f2 - 12.0 * f) / 6.0, (-9.0 * f2 + 6.0 * f + 3.0) / 6.0, 0.5 * f2],
    )
}
