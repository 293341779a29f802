//! Whether a slope in what the catalogue says of stars is one star by another name.
//!
//! The brightest of a dozen stars has nearly all the flux there is: a shift that goes with the flux is a shift of that star
//! and nothing else. How far the columns X of a slope, one row a star and n of it seen, can follow star s alone is
//!
//! ```text
//! h_s = n_s x_s' (sum n x x')^-1 x_s        x = (1, P_1(v), ...)      1: they say nothing of any other star
//! ```
//!
//! Of a slope that really is one, the others have the rest: at a half of it, half of its nats.
//!
//! Source: Hoaglin & Welsch 1978 (leverage).

use nalgebra::{DMatrix, DVector};

use crate::search::empirical::Empirical;
use crate::star::data::StarData;

/// From this on a slope is that star more than all others.
const ALONE: f64 = 0.5;

/// Whether `columns` of `slope`, counted from its own first, can follow the star `star_id` alone.
pub(super) fn is_one_star(
    data: &StarData,
    slope: &Empirical,
    columns: &[usize],
    star_id: i64,
) -> bool {
    let Some(star) = data.stars.iter().position(|s| s.id == star_id) else {
        return false;
    };
    let mut rows = vec![0.0; data.stars.len()];
    let mut values = vec![0.0; data.stars.len()];
    for (row, &star) in data.star.iter().enumerate() {
        let of_star = [data.mag[row], data.bv[row], data.log_flux[row]];
        let Some(value) = slope.value_of_star(of_star) else {
            return false;
        };
        rows[star] += 1.0;
        values[star] = value;
    }
    leverage(&values, &rows, &slope.orders_of(columns), star) > ALONE
}

/// The leverage of `star` of all with these `values`, so often seen, beside a constant and polynomials of these `orders`.
fn leverage(values: &[f64], rows: &[f64], orders: &[usize], star: usize) -> f64 {
    let x = |star: usize| {
        DVector::from_fn(orders.len() + 1, |k, _| match k {
            0 => 1.0,
            k => values[star].powf(orders[k - 1] as f64),
        })
    };
    let size = orders.len() + 1;
    let normal = (0..values.len()).fold(DMatrix::zeros(size, size), |sum, star| {
        sum + x(star) * x(star).transpose() * rows[star]
    });
    let own = x(star);
    // as many numbers as stars, or more: any of them alone
    let solved = normal.cholesky().map(|c| c.solve(&own));
    solved.map_or(1.0, |solved| rows[star] * own.dot(&solved))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twelve stars evenly along a line share two numbers, the ends four tenths of it; one that has ten times what the
    /// others have is the slope.
    #[test]
    fn one_star_has_all_the_flux() {
        let even: Vec<f64> = (0..12).map(f64::from).collect();
        let rows = vec![100.0; 12];
        let sum: f64 = (0..12).map(|s| leverage(&even, &rows, &[1], s)).sum();
        assert!((sum - 2.0).abs() < 1e-9, "{sum}");
        // 1/n + 5.5^2 / 143
        let end = leverage(&even, &rows, &[1], 11);
        assert!((end - (1.0 / 12.0 + 30.25 / 143.0)).abs() < 1e-9, "{end}");
        let mut flux = vec![1.0; 12];
        flux[3] = 10.0;
        assert!(leverage(&flux, &rows, &[1], 3) > 0.999);
        flux[4] = 2.0;
        assert!(leverage(&flux, &rows, &[1], 3) > ALONE);
        assert!(leverage(&flux, &rows, &[1], 4) < ALONE);
    }
}
