//! White and first-order Gauss-Markov noise, found and removed by whitening filters.
//!
//! A slow error leaves trends, lines and steps in a series that ordinary least squares takes for effects.
//! [`Coloured`] is the noise of one series,
//!
//! ```text
//! y_k = b_k + w_k         w ~ N(0, white^2 / count_k)
//! b_k+1 = a b_k + n_k     a = exp(-dt/tau),  n ~ N(0, slow^2 (1 - a^2))
//! ```
//!
//! at any times, through gaps, of rows that are means of `count` measurements. The Kalman filter of this model
//! turns the series into independent innovations of unit variance. It is linear and its gains depend on the
//! times alone, so that regressors go through the same filter, and least squares afterwards is generalised
//! least squares. The three numbers are those of greatest likelihood.
//!
//! [`CommonNoise`] is that of the rotations that the stars of each frame agree on, three axes at once: an error
//! of the reference, which all stars share, beside the white noise of each star, which they do not. Its
//! [`Filter`] goes on from one block of the data to the next.
//!
//! | for | use |
//! |---|---|
//! | the noise of a series | [`Coloured::fit`], [`Coloured::refit`] |
//! | the same beside a known white part | [`Coloured::fit_above`], [`Coloured::refit_above`] |
//! | the same beside what is known of the slow part | [`Coloured::refit_near`], [`Foreknown`] |
//! | how well the slow part is known | [`Coloured::slow_bounds`], [`Coloured::relative_sigma`] of a long series |
//! | the noise taken out of series and regressors | [`Coloured::whiten`] |
//! | many steps at once | [`Coloured::steps`] |
//! | likelihoods of rival noises | [`Coloured::log_likelihood`], [`LogProduct`] |
//! | rotations of frames, and whether their error is slow | [`Rotations`], [`SlowGains`] |
//! | the noise taken out of their columns | [`Filter`] |
//! | the noise to tell amplitudes beside, once that is so | [`Rotations::believed`] |
//! | the slow error itself, as all rotations tell it | [`Rotations::slow_part`] |
//!
//! Series and sigmas are in one unit, whatever it is; times are seconds.
//!
//! ```
//! use coloured_noise::Coloured;
//! use rand_core::SeedableRng;
//! use rand_distr::{Distribution, StandardNormal};
//!
//! // white noise of 1 over an error of 2 that lasts for 50 s, 10 000 s of it
//! let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(3);
//! let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
//! let (t_s, count) = ((0..10_000).map(f64::from).collect::<Vec<_>>(), vec![1.0; 10_000]);
//! let decay = (-1.0_f64 / 50.0).exp();
//! let mut slow = 0.0;
//! let mut series: Vec<f64> = t_s
//!     .iter()
//!     .map(|_| {
//!         slow = decay * slow + 2.0 * (1.0 - decay * decay).sqrt() * normal();
//!         slow + normal()
//!     })
//!     .collect();
//!
//! let noise = Coloured::fit(&t_s, &series, &count);
//! let [slow_sigma, tau_sigma] = noise.relative_sigma(&t_s, &series, &count).expect("a summit");
//! assert!((noise.slow / 2.0).ln().abs() < 5.0 * slow_sigma);
//! assert!((noise.tau_s / 50.0).ln().abs() < 5.0 * tau_sigma);
//!
//! // neighbours are alike before, independent and of unit variance after
//! let alike = |y: &[f64]| y.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / y.len() as f64;
//! assert!(alike(&series) > 2.0);
//! noise.whiten(&t_s, &count, &mut [&mut series]);
//! assert!(alike(&series).abs() < 5.0 / 100.0);
//! let variance = series.iter().map(|e| e * e).sum::<f64>() / 1e4;
//! assert!((variance - 1.0).abs() < 5.0 * (2.0_f64 / 1e4).sqrt());
//! ```
#![forbid(unsafe_code)]

mod bounds;
mod coloured;
mod common_noise;
mod filter;
mod foreknown;
mod joint;
mod log_product;
mod rotations;
mod smoother;

pub use bounds::{Bounds, SlowBounds};
pub use coloured::Coloured;
pub use common_noise::CommonNoise;
pub use filter::Filter;
pub use foreknown::Foreknown;
pub use log_product::LogProduct;
pub use rotations::{Rotations, SlowGains};
