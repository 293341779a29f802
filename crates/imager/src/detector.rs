//! From light to numbers: what each pixel makes of the electrons in it.
//!
//! ```text
//! q  = Poisson(S light + D T) + hits          S: sensitivity, D: dark current of the pixel
//! q' = min(q, full well)
//! q''= trailed(q')                            towards later rows
//! dn = round(bias + (q'' (1 - n q''/full well) + column + read noise) / gain), within the converter
//! ```
//!
//! Source: Janesick, Scientific Charge-Coupled Devices (2001), chapters 4, 5 and 7; Holst & Lomheim,
//! CMOS/CCD Sensors and Camera Systems (2011).

mod hits;
mod pixels;
mod trailing;

use rand_core::Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::ImagerError;

pub use hits::Particles;
pub(crate) use pixels::PixelTraits;
pub use pixels::{Fringe, HotPixel};
pub use trailing::Trailing;

/// `[detector]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Detector {
    /// Photo-electrons per second of a star of magnitude 0; default 5e6.
    pub electrons_s_mag0: f64,
    /// Whether arrivals are random; default yes.
    pub photon_noise: bool,
    /// Read noise, electrons rms; default 15.
    pub read_noise_e: f64,
    /// Electrons per digital number; default 6.5.
    pub gain_e_per_dn: f64,
    /// Bits of the converter; default 14.
    pub bits: u32,
    /// Level of no charge, DN; default 100.
    pub bias_dn: f64,
    /// Charge that a pixel holds, electrons; default 1e5.
    pub full_well_e: f64,
    /// Loss of response at full well, relative; default 0.
    pub nonlinearity: f64,
    /// Spread of the pixels' sensitivity, rms; default 0.
    pub prnu: f64,
    /// Interference fringes in the sensitivity; default none.
    pub fringe: Option<Fringe>,
    /// Mean dark current, electrons per second; default 0.
    pub dark_e_s: f64,
    /// Spread of the dark current, electrons per second rms; default 0.
    pub dsnu_e_s: f64,
    /// Share of pixels that are warm; default 0.
    pub warm_share: f64,
    /// Mean extra dark current of warm pixels (exponential), electrons per second; default 0.
    pub warm_e_s: f64,
    /// Share of the warm pixels that switch on and off; default 0.
    pub telegraph_share: f64,
    /// Mean time such a pixel stays on, and off, s; default 100.
    pub telegraph_s: f64,
    /// Single hot pixels.
    pub hot: Vec<HotPixel>,
    /// Spread of the columns' offsets, electrons rms; default 0.
    pub column_e: f64,
    /// Charge left behind at transfer; default none.
    pub trailing: Option<Trailing>,
    /// Particle hits; default none.
    pub particles: Option<Particles>,
}

impl Default for Detector {
    fn default() -> Self {
        Self {
            electrons_s_mag0: 5e6,
            photon_noise: true,
            read_noise_e: 15.0,
            gain_e_per_dn: 6.5,
            bits: 14,
            bias_dn: 100.0,
            full_well_e: 1e5,
            nonlinearity: 0.0,
            prnu: 0.0,
            fringe: None,
            dark_e_s: 0.0,
            dsnu_e_s: 0.0,
            warm_share: 0.0,
            warm_e_s: 0.0,
            telegraph_share: 0.0,
            telegraph_s: 100.0,
            hot: Vec::new(),
            column_e: 0.0,
            trailing: None,
            particles: None,
        }
    }
}

/// One window as it is exposed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// First column and row.
    pub(crate) corner: [i32; 2],
    /// Columns of the window.
    pub(crate) columns: usize,
    /// Middle of the exposure, s.
    pub(crate) t_s: f64,
    pub(crate) exposure_s: f64,
}

impl Detector {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        ImagerError::positive("detector.electrons_s_mag0", self.electrons_s_mag0)?;
        ImagerError::positive("detector.gain_e_per_dn", self.gain_e_per_dn)?;
        ImagerError::positive("detector.full_well_e", self.full_well_e)?;
        ImagerError::positive("detector.telegraph_s", self.telegraph_s)?;
        ImagerError::check(
            "detector.bits",
            f64::from(self.bits),
            (1..=32).contains(&self.bits),
            "from 1 to 32",
        )?;
        for (name, value) in [
            ("detector.read_noise_e", self.read_noise_e),
            ("detector.bias_dn", self.bias_dn),
            ("detector.nonlinearity", self.nonlinearity),
            ("detector.prnu", self.prnu),
            ("detector.dark_e_s", self.dark_e_s),
            ("detector.dsnu_e_s", self.dsnu_e_s),
            ("detector.warm_e_s", self.warm_e_s),
            ("detector.column_e", self.column_e),
        ] {
            ImagerError::not_negative(name, value)?;
        }
        for (name, share) in [
            ("detector.warm_share", self.warm_share),
            ("detector.telegraph_share", self.telegraph_share),
        ] {
            ImagerError::check(name, share, (0.0..=1.0).contains(&share), "from 0 to 1")?;
        }
        self.fringe.iter().try_for_each(Fringe::check)?;
        self.hot.iter().copied().try_for_each(HotPixel::check)?;
        self.trailing.iter().try_for_each(Trailing::check)?;
        self.particles.iter().try_for_each(Particles::check)
    }

    /// Turns expected light, electrons, into digital numbers in place.
    pub(crate) fn read_out<R: Rng>(
        &self,
        traits: &PixelTraits<'_>,
        place: Place,
        window: &mut [f64],
        rng: &mut R,
    ) {
        for (k, light) in window.iter_mut().enumerate() {
            let (column, row) = pixel_of(place, k);
            let sensitivity = traits.sensitivity(column, row);
            let dark = traits.dark_e_s(column, row, place.t_s) * place.exposure_s;
            let expected = (*light * sensitivity + dark).max(0.0);
            *light = if self.photon_noise && expected > 0.0 {
                Poisson::new(expected).map_or(expected, |poisson| poisson.sample(rng))
            } else {
                expected
            };
        }
        if let Some(particles) = &self.particles {
            particles.hit(place, window, rng);
        }
        for charge in window.iter_mut() {
            *charge = charge.min(self.full_well_e);
        }
        if let Some(trailing) = &self.trailing {
            trailing.apply(place, window);
        }
        let most = f64::from(u32::MAX >> (32 - self.bits));
        for (k, charge) in window.iter_mut().enumerate() {
            let (column, _) = pixel_of(place, k);
            let noise: f64 = StandardNormal.sample(rng);
            let response = *charge * (1.0 - self.nonlinearity * *charge / self.full_well_e);
            let read = response + traits.column_e(column) + self.read_noise_e * noise;
            *charge = (self.bias_dn + read / self.gain_e_per_dn)
                .round()
                .clamp(0.0, most);
        }
    }
}

/// Column and row of pixel `k` of a window.
fn pixel_of(place: Place, k: usize) -> (i32, i32) {
    // windows have at most 64 x 64 pixels
    let whole = |k: usize| i32::try_from(k).unwrap_or(i32::MAX);
    let (column, row) = (whole(k % place.columns), whole(k / place.columns));
    (place.corner[0] + column, place.corner[1] + row)
}
