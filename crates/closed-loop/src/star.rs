//! Stars as the measurement: centroids against catalogue and reference, or against themselves.
//!
//! ```text
//! run, explain, finish    the order of the steps, from bundle to rows, to what is found, and to the report
//! data            centroids beside what the declared model says of them
//! directions      directions and attitudes from the centroids alone, where nothing else tells them
//! misalignment    the rotation between camera and reference, taken exactly
//! frame_rotation  the rotation that the stars of a frame agree on
//! light           where the light of each star fell, better than its reference says
//! landing         where fits take the stars, and with them the light
//! outliers        rows that stand out
//! windows         rows that have raw windows, and those that have none
//! nuisance        what the declared model leaves unknown, as columns with priors
//! changes         what residuals change by from frame to frame
//! weights         how much each star counts
//! layout          the forms in which columns are held
//! columns         all columns of a fit, row by row
//! reference_noise how much the rotation that they share counts
//! moments         their products, in one pass, for every fit at every noise
//! by_star         the same of a short run, star by star
//! evidence        data, noise and products as what the search asks of a measurement
//! prediction      amplitudes to predict a fold with, beside a slow error of the reference
//! settling        the declared model at its best, and the outliers beside it
//! steadied        the reference's path less its slow error
//! search          the search where the reference itself may err
//! pointed         which of many stars and pixels the residual points at
//! reference_wander, own_attitude    two things to tell beside the effects
//! ```
//!
//! Not physics: the contents of a folder.

mod by_star;
mod changes;
pub(crate) mod columns;
pub(crate) mod data;
pub(crate) mod directions;
pub(crate) mod evidence;
mod explain;
mod finish;
pub(crate) mod frame_rotation;
#[cfg(test)]
pub(crate) mod harness;
pub(crate) mod landing;
mod layout;
mod light;
mod misalignment;
mod moments;
pub(crate) mod nuisance;
mod outliers;
mod own_attitude;
mod placing;
mod pointed;
mod prediction;
mod reference_noise;
mod reference_wander;
mod rows_left;
mod run;
pub(crate) mod search;
mod seen_directions;
mod settling;
pub(crate) mod slow_price;
mod steadied;
pub(crate) mod weights;
mod windows;

pub(crate) use run::run;
