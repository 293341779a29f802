//! What is taken from a segment before its spectrum.
//!
//! ```text
//! Constant: x[n] - mean
//! Linear:   x[n] - mean - b (n - nc),   b = sum (n - nc) x[n] / sum (n - nc)^2,   nc = (N - 1)/2
//! ```
//!
//! Source: least squares; Bendat & Piersol, Random Data (4th ed. 2010), Section 10.4.1.

/// What is taken from every segment, by least squares, before its window is applied.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detrend {
    /// Nothing.
    None,
    /// The mean. The bin at 0 then says nothing, nor those within the main lobe of the window.
    #[default]
    Constant,
    /// A straight line.
    Linear,
}

impl Detrend {
    /// Writes `x` less its trend; returns nothing else.
    ///
    /// # Panics
    ///
    /// If the lengths differ.
    pub fn apply_into(self, x: &[f64], out: &mut [f64]) {
        assert_eq!(x.len(), out.len(), "one place for each sample");
        let count = x.len() as f64;
        if self == Self::None || x.is_empty() {
            out.copy_from_slice(x);
            return;
        }
        let mean = x.iter().sum::<f64>() / count;
        for (o, v) in out.iter_mut().zip(x) {
            *o = v - mean;
        }
        if self == Self::Linear && x.len() > 1 {
            let middle = 0.5 * (count - 1.0);
            let moment: f64 = out
                .iter()
                .enumerate()
                .map(|(n, v)| (n as f64 - middle) * v)
                .sum();
            let slope = moment / (count * (count * count - 1.0) / 12.0);
            for (n, o) in out.iter_mut().enumerate() {
                *o -= slope * (n as f64 - middle);
            }
        }
    }
}
