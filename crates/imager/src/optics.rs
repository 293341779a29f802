//! Where the optics put a star, and how wide.
//!
//! ```text
//! x, y = X/Z, Y/Z                                             tangent plane
//! d    = (k1 r^2 + k2 r^4) (x, y) + (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y)
//! x'   = (x + d) (1 + colour (B-V - 0.6))                     lateral colour
//! x''  = x' / (1 + x' tan ty + y' tan tx)                     detector tilted about its axes
//! px   = f (1 + a (T - T0)) x'' + centre                      focal length with temperature
//!
//! s^2  = (s0 + s1 (B-V - 0.6))^2 + (b (T - T_focus))^2        width of the spot
//! flare displaced from the core by coma_px r / r_edge along the radius, centre of light unmoved
//! ```
//!
//! The tracker believes in a plain pinhole of the nominal focal length: what a calibration takes away
//! is left out on both sides, so that the coefficients here are what remains after it.
//!
//! Source: Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32 (1966) 444;
//! perspective of a tilted plane.

use focal_plane::{Camera, Pixel};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{ImagerError, Spot};

/// Colour at which the optics are specified, B-V mag: a star of type G.
const COLOUR: f64 = 0.6;

/// `[optics]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Optics {
    /// Pixels along x and y; default 1024 by 1024.
    pub pixels: [u32; 2],
    /// Whole field of view along x, deg; pixels are square. Default 20.
    pub fov_deg: f64,
    /// Width of the spot, 1 sigma of the Gaussian before the pixel, px; default 0.7.
    pub psf_sigma_px: f64,
    /// Growth of the width with colour, px per mag of B-V; default 0.
    pub psf_colour_px_per_mag: f64,
    /// Displacement of the flare at the middle of an edge of the field, px; default 0.
    pub coma_px: f64,
    /// Share of the light in the flare; default 0.2, which does nothing while `coma_px` is 0.
    pub coma_share: f64,
    /// Radial distortion, per square of the tangent; default 0.
    pub k1: f64,
    /// Radial distortion, per fourth power of the tangent; default 0.
    pub k2: f64,
    /// Decentring, per tangent; default 0.
    pub p1: f64,
    /// Decentring, per tangent; default 0.
    pub p2: f64,
    /// Tilt of the detector about x and y, deg; default 0.
    pub tilt_deg: [f64; 2],
    /// Optical axis on the detector, px from its centre; default 0.
    pub centre_px: [f64; 2],
    /// Lateral colour: relative change of scale per mag of B-V, 1e-6; default 0.
    pub lateral_colour_ppm_per_mag: f64,
    /// Thermal node of the tube; needed by the three keys below.
    pub node: Option<String>,
    /// Temperature at which the nominal focal length holds, deg C; default 20.
    pub nominal_c: f64,
    /// Relative change of the focal length per degree, 1e-6; default 0.
    pub focal_ppm_per_c: f64,
    /// Blur by defocus, px of sigma per degree from `focus_c`; default 0.
    pub defocus_px_per_c: f64,
    /// Temperature of best focus, deg C; default 20.
    pub focus_c: f64,
}

impl Default for Optics {
    fn default() -> Self {
        Self {
            pixels: [1024, 1024],
            fov_deg: 20.0,
            psf_sigma_px: 0.7,
            psf_colour_px_per_mag: 0.0,
            coma_px: 0.0,
            coma_share: 0.2,
            k1: 0.0,
            k2: 0.0,
            p1: 0.0,
            p2: 0.0,
            tilt_deg: [0.0; 2],
            centre_px: [0.0; 2],
            lateral_colour_ppm_per_mag: 0.0,
            node: None,
            nominal_c: 20.0,
            focal_ppm_per_c: 0.0,
            defocus_px_per_c: 0.0,
            focus_c: 20.0,
        }
    }
}

impl Optics {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        let fov = self.fov_deg;
        ImagerError::check(
            "optics.fov_deg",
            fov,
            fov > 0.0 && fov < 120.0,
            "between 0 and 120",
        )?;
        ImagerError::positive("optics.psf_sigma_px", self.psf_sigma_px)?;
        let share = self.coma_share;
        ImagerError::check(
            "optics.coma_share",
            share,
            (0.0..1.0).contains(&share),
            "from 0 to 1",
        )?;
        for (name, value) in [
            ("optics.psf_colour_px_per_mag", self.psf_colour_px_per_mag),
            ("optics.coma_px", self.coma_px),
            ("optics.k1", self.k1),
            ("optics.k2", self.k2),
            ("optics.p1", self.p1),
            ("optics.p2", self.p2),
            ("optics.centre_px", self.centre_px[0] + self.centre_px[1]),
            (
                "optics.lateral_colour_ppm_per_mag",
                self.lateral_colour_ppm_per_mag,
            ),
            ("optics.nominal_c", self.nominal_c),
            ("optics.focal_ppm_per_c", self.focal_ppm_per_c),
            ("optics.defocus_px_per_c", self.defocus_px_per_c),
            ("optics.focus_c", self.focus_c),
        ] {
            ImagerError::finite(name, value)?;
        }
        for tilt in self.tilt_deg {
            ImagerError::check("optics.tilt_deg", tilt, tilt.abs() < 45.0, "within 45 deg")?;
        }
        if self.node.is_none() && (self.focal_ppm_per_c != 0.0 || self.defocus_px_per_c != 0.0) {
            return Err(ImagerError::NeedsNode {
                name: "optics.focal_ppm_per_c or optics.defocus_px_per_c",
            });
        }
        Ok(())
    }

    /// The camera that the tracker believes in.
    ///
    /// # Errors
    ///
    /// A field of view or a number of pixels that no camera has.
    pub fn camera(&self) -> Result<Camera, ImagerError> {
        let half = 0.5 * focal_plane::Angle::from_deg(self.fov_deg).rad();
        let focal_px = 0.5 * f64::from(self.pixels[0]) / half.tan();
        Ok(Camera::from_focal_length_px(self.pixels, focal_px)?)
    }

    /// The light's way for one star in one frame.
    pub(crate) fn way(&self, camera: &Camera, bv: f64, temperature_c: Option<f64>) -> Way {
        let colour = if bv.is_nan() { 0.0 } else { bv - COLOUR };
        let warm = temperature_c.map_or(0.0, |t| t - self.nominal_c);
        let blur = temperature_c.map_or(0.0, |t| self.defocus_px_per_c * (t - self.focus_c));
        // no star is so red or blue that its spot vanishes
        let core = (self.psf_sigma_px + self.psf_colour_px_per_mag * colour).max(0.05);
        Way {
            radial: [self.k1, self.k2],
            decentring: [self.p1, self.p2],
            colour: 1.0 + 1e-6 * self.lateral_colour_ppm_per_mag * colour,
            tilt: self
                .tilt_deg
                .map(|deg| focal_plane::Angle::from_deg(deg).rad().tan()),
            focal_px: camera.focal_length_px()[0] * (1.0 + 1e-6 * self.focal_ppm_per_c * warm),
            centre_px: self.centre_px,
            sigma_px: core.hypot(blur),
            flare: if self.coma_px == 0.0 {
                0.0
            } else {
                self.coma_share
            },
            flare_per_px: self.coma_px / camera.half_size_px()[0],
        }
    }
}

/// The optics as one star in one frame meets them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    radial: [f64; 2],
    decentring: [f64; 2],
    colour: f64,
    tilt: [f64; 2],
    focal_px: f64,
    centre_px: [f64; 2],
    sigma_px: f64,
    flare: f64,
    flare_per_px: f64,
}

impl Way {
    /// Place on the detector of a direction in tracker axes; none behind the camera.
    pub(crate) fn project(&self, v: &Vector3<f64>) -> Option<Pixel> {
        if v.z <= 0.0 {
            return None;
        }
        let (x, y) = (v.x / v.z, v.y / v.z);
        let r2 = x * x + y * y;
        let radial = r2 * (self.radial[0] + self.radial[1] * r2);
        let [p1, p2] = self.decentring;
        let dx = radial * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let dy = radial * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        let (x, y) = (self.colour * (x + dx), self.colour * (y + dy));
        let scale = self.focal_px / (1.0 + x * self.tilt[1] + y * self.tilt[0]);
        Some(Pixel {
            x: scale * x + self.centre_px[0],
            y: scale * y + self.centre_px[1],
        })
    }

    /// The spot at a place.
    pub(crate) fn spot(&self, at: Pixel) -> Spot {
        Spot {
            sigma_px: self.sigma_px,
            flare: self.flare,
            flare_px: [self.flare_per_px * at.x, self.flare_per_px * at.y],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shift(optics: &Optics, v: [f64; 3], bv: f64, temperature_c: Option<f64>) -> [f64; 2] {
        let camera = optics.camera().unwrap();
        let v = Vector3::from(v);
        let plain = camera.project(&v).unwrap();
        let real = optics.way(&camera, bv, temperature_c).project(&v).unwrap();
        [real.x - plain.x, real.y - plain.y]
    }

    /// Each term alone, by hand, at x = 0.1, y = -0.05 (f = 2903.7 px).
    #[test]
    fn terms_of_the_map() {
        let v = [0.1, -0.05, 1.0];
        let f = Optics::default().camera().unwrap().focal_length_px()[0];
        let r2 = 0.0125;
        let near = |got: [f64; 2], want: [f64; 2]| {
            assert!(
                (got[0] - want[0]).abs() < 1e-9 && (got[1] - want[1]).abs() < 1e-9,
                "{got:?} {want:?}"
            );
        };
        near(shift(&Optics::default(), v, 1.9, None), [0.0; 2]);
        let k = Optics {
            k1: 1e-3,
            k2: 2e-3,
            ..Optics::default()
        };
        let radial = 1e-3 * r2 + 2e-3 * r2 * r2;
        near(
            shift(&k, v, 0.6, None),
            [f * radial * 0.1, -f * radial * 0.05],
        );
        let p = Optics {
            p1: 1e-3,
            ..Optics::default()
        };
        near(
            shift(&p, v, 0.6, None),
            [f * 2e-3 * 0.1 * -0.05, f * 1e-3 * (r2 + 2.0 * 0.0025)],
        );
        let c = Optics {
            lateral_colour_ppm_per_mag: 100.0,
            ..Optics::default()
        };
        near(shift(&c, v, 1.6, None), [f * 1e-4 * 0.1, -f * 1e-4 * 0.05]);
        let t = Optics {
            node: Some("tube".into()),
            focal_ppm_per_c: 10.0,
            ..Optics::default()
        };
        near(
            shift(&t, v, 0.6, Some(25.0)),
            [f * 5e-5 * 0.1, -f * 5e-5 * 0.05],
        );
        let tilt = Optics {
            tilt_deg: [0.0, 1.0],
            ..Optics::default()
        };
        let scale = 1.0 / (1.0 + 0.1 * 1_f64.to_radians().tan()) - 1.0;
        near(
            shift(&tilt, v, 0.6, None),
            [f * scale * 0.1, -f * scale * 0.05],
        );
    }

    #[test]
    fn width_follows_colour_and_focus() {
        let optics = Optics {
            psf_colour_px_per_mag: 0.1,
            node: Some("tube".into()),
            defocus_px_per_c: 0.05,
            ..Optics::default()
        };
        let camera = optics.camera().unwrap();
        let at = Pixel { x: 0.0, y: 0.0 };
        let sigma = |bv, t| optics.way(&camera, bv, Some(t)).spot(at).sigma_px;
        assert!((sigma(1.6, 20.0) - 0.8).abs() < 1e-12);
        assert!((sigma(0.6, 30.0) - 0.7_f64.hypot(0.5)).abs() < 1e-12);
    }
}
