//! Products too long for a float: determinants, likelihoods.
//!
//! Not physics: a running product whose logarithm is taken before it leaves the range.

/// The logarithm of a long product of positive numbers, without one logarithm for each.
#[derive(Clone, Copy, Debug)]
pub struct LogProduct {
    product: f64,
    ln: f64,
}

impl Default for LogProduct {
    fn default() -> Self {
        Self {
            product: 1.0,
            ln: 0.0,
        }
    }
}

impl LogProduct {
    /// Multiplies by `factor`.
    pub fn times(&mut self, factor: f64) {
        self.product *= factor;
        if !(1e-120..1e120).contains(&self.product) {
            self.ln += self.product.ln();
            self.product = 1.0;
        }
    }

    /// The logarithm of the product.
    #[must_use]
    pub fn ln(self) -> f64 {
        self.ln + self.product.ln()
    }
}
