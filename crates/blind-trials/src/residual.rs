//! Star residuals of a bundle, row by row, with nothing estimated.
//!
//! ```text
//! r = measured place - projection of q_ref(t) u        px; without a reference, measured place alone
//! ```
//!
//! Made for differences between two bundles of the same run: what both share goes out.
//!
//! Source: `focal_plane::Camera::project`; the attitude convention of the house.

use std::collections::BTreeMap;

use focal_plane::{AttitudeSource, Pixel};
use telemetry::Bundle;

/// Residuals of one bundle, frame by frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Residuals {
    /// First row of each frame, and the number of rows.
    pub(crate) first_row: Vec<usize>,
    pub(crate) t_s: Vec<f64>,
    pub(crate) slot: Vec<i32>,
    pub(crate) star_id: Vec<i64>,
    /// px
    pub(crate) r: Vec<[f64; 2]>,
    /// d(x, y)/d(rotation), px per rad.
    pub(crate) jacobian: Vec<[[f64; 3]; 2]>,
    /// arcsec per px along x and y.
    pub(crate) scale: [f64; 2],
    /// Whether a reference has been taken off.
    pub(crate) against_reference: bool,
}

/// A row's name: its frame, counted from the first, and slot.
pub(crate) type Name = (usize, i32);

impl Residuals {
    /// `None` for a bundle without stars, catalogue or camera, or with a star that the catalogue lacks.
    pub(crate) fn of(bundle: &Bundle) -> Option<Self> {
        let (stars, catalogue) = (bundle.stars.as_ref()?, bundle.catalog.as_ref()?);
        let camera = bundle.camera.as_ref()?;
        let reference = match &bundle.reference {
            Some(table) => Some(table.series_with_gaps().ok()?),
            None => None,
        };
        let year = bundle.meta.julian_year(0.0).unwrap_or(2000.0);
        let directions = catalogue.directions_at(year);
        let mut out = Self {
            first_row: vec![0],
            scale: camera.arcsec_per_px(),
            against_reference: reference.is_some(),
            ..Self::default()
        };
        for frame in 0..stars.frames() {
            let t = stars.t_s[frame];
            let attitude = reference.as_ref().map(|series| series.attitude(t));
            // outside the reference: a frame without rows
            let known = !matches!(attitude, Some(None));
            for row in stars.rows_of(frame).filter(|_| known) {
                let measured = Pixel {
                    x: stars.x_px[row],
                    y: stars.y_px[row],
                };
                let (mut r, mut at) = ([measured.x, measured.y], measured);
                if let Some(Some(q)) = attitude {
                    let u = directions[catalogue.index_of(stars.star_id[row])?];
                    at = camera.project(&(q * u))?;
                    r = [measured.x - at.x, measured.y - at.y];
                }
                out.t_s.push(t);
                out.slot.push(stars.slot[row]);
                out.star_id.push(stars.star_id[row]);
                out.r.push(r);
                out.jacobian.push(camera.rotation_jacobian(at));
            }
            out.first_row.push(out.r.len());
        }
        Some(out)
    }

    pub(crate) fn frames(&self) -> usize {
        self.first_row.len() - 1
    }

    pub(crate) fn rows_of(&self, frame: usize) -> std::ops::Range<usize> {
        self.first_row[frame]..self.first_row[frame + 1]
    }

    /// Difference to another bundle of the same run, a row each of `self`; `None` in a row that the other
    /// does not have. Frames are matched by their order, as stamps may be what differs.
    pub(crate) fn minus(&self, other: &Self) -> Vec<Option<[f64; 2]>> {
        let mut places: BTreeMap<(Name, i64), [f64; 2]> = BTreeMap::new();
        for frame in 0..other.frames() {
            for row in other.rows_of(frame) {
                let name = (frame, other.slot[row]);
                places.insert((name, other.star_id[row]), other.r[row]);
            }
        }
        let mut out = Vec::with_capacity(self.r.len());
        for frame in 0..self.frames() {
            for row in self.rows_of(frame) {
                let name = (frame, self.slot[row]);
                let theirs = places.get(&(name, self.star_id[row]));
                out.push(theirs.map(|p| [self.r[row][0] - p[0], self.r[row][1] - p[1]]));
            }
        }
        out
    }
}
