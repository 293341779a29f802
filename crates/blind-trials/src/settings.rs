//! Which setting of an instrument is behind a parameter of the truth.
//!
//! Not physics: a table of names.

use imager::{Acting, Instrument};

/// The instrument with the setting behind one parameter of an effect times `factor`; `None` where no
/// setting can be turned a little: an instant, a pixel, a spot.
pub(crate) fn turned(
    instrument: &Instrument,
    acting: &Acting,
    name: &str,
    factor: f64,
) -> Option<Instrument> {
    let mut turned = instrument.clone();
    let axis = |name: &str| {
        let first = name.chars().next()?;
        "xyz".find(first)
    };
    match (acting.id.as_str(), name) {
        ("rolling_shutter", "line_time_s") => turned.shutter.row_time_s *= factor,
        ("time_tag_offset", "offset_s") => turned.clock.delay_s *= factor,
        ("exposure_smear", "exposure_s") => {
            // the light stays what it is
            turned.shutter.exposure_s *= factor;
            turned.detector.electrons_s_mag0 /= factor;
        }
        ("velocity_aberration", "scale") => turned.orbit.radius_km *= factor,
        ("focal_length_drift", "ppm_per_c") => turned.optics.focal_ppm_per_c *= factor,
        ("chromatic_shift", "ppm_per_mag") => {
            turned.optics.lateral_colour_ppm_per_mag *= factor;
        }
        ("optical_distortion", "k1") => turned.optics.k1 *= factor,
        ("optical_distortion", "k2") => turned.optics.k2 *= factor,
        ("optical_distortion", "p1") => turned.optics.p1 *= factor,
        ("optical_distortion", "p2") => turned.optics.p2 *= factor,
        ("catalogue_position", "east_arcsec" | "north_arcsec") => {
            let id = acting.selectors.get("star_id")?;
            let mut stars = turned.stars.misplaced.iter_mut();
            let star = stars.find(|star| star.star_id.to_string() == *id)?;
            match name {
                "east_arcsec" => star.east_arcsec *= factor,
                _ => star.north_arcsec *= factor,
            }
        }
        ("thermal_misalignment", "lag_s") => {
            let bracket = turned.bracket.node.clone()?;
            let mut nodes = turned.thermal.node.iter_mut();
            nodes.find(|node| node.name == bracket)?.tau_s *= factor;
        }
        ("thermal_misalignment", name) if name.ends_with("_arcsec_per_unit") => {
            turned.bracket.arcsec_per_c[axis(name)?] *= factor;
        }
        ("step_misalignment", name) if name.ends_with("_arcsec") => {
            let at_s = *acting.values.get("at_s")?;
            let axis = axis(name)?;
            let mut slips = turned.bracket.slip.iter_mut();
            let slip = slips.find(|slip| (slip.at_s - at_s).abs() < 1e-9)?;
            slip.arcsec[axis] *= factor;
        }
        ("hot_pixel", "strength") => {
            for pixel in &mut turned.detector.hot {
                pixel.e_s *= factor;
            }
        }
        _ => return None,
    }
    Some(turned)
}

/// The same instrument without noise of any kind: what is left of a measurement is systematic.
pub(crate) fn silent(instrument: &Instrument) -> Instrument {
    let mut silent = instrument.clone();
    let detector = &mut silent.detector;
    detector.photon_noise = false;
    detector.read_noise_e = 0.0;
    detector.particles = None;
    // steps of the converter far below an electron, the level of no charge and the range as they were
    detector.gain_e_per_dn = 1e-4;
    detector.bits = 32;
    if let Some(reference) = &mut silent.reference {
        reference.white_arcsec = [0.0; 3];
        reference.wander_arcsec = [0.0; 3];
    }
    for sensor in &mut silent.thermal.sensor {
        sensor.noise_c = 0.0;
    }
    silent
}
