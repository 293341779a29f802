//! The expected light of one window: stars that move while it is exposed, and the sky.
//!
//! ```text
//! light of pixel (c, r) = sum over stars  flux T  mean over row r's exposure of share(c, r; place(t'))  +  sky T
//! ```
//!
//! In photo-electrons, before sensitivity and noise.
//!
//! Source: this crate's `spot`, `path` and `optics`.

use focal_plane::{Camera, Pixel};
use nalgebra::{UnitQuaternion, Vector3};

use crate::optics::Way;
use crate::path::{NODES, Plan};

/// A window that is exposed: attitudes at the plan's instants, and where it lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exposed<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) attitude: &'a [UnitQuaternion<f64>; NODES],
    pub(crate) corner: [i32; 2],
    pub(crate) columns: usize,
}

/// Adds one star, `light` electrons in all, to a window.
pub(crate) fn add_star(
    exposed: Exposed<'_>,
    camera: &Camera,
    way: &Way,
    direction: &Vector3<f64>,
    light: f64,
    window: &mut [f64],
) {
    let half = camera.half_size_px();
    let mut place = [[0.0; 2]; NODES];
    let mut middle = Pixel { x: 0.0, y: 0.0 };
    for (k, q) in exposed.attitude.iter().enumerate() {
        let Some(at) = way.project(&(q * direction)) else {
            return;
        };
        if k == NODES / 2 {
            middle = at;
        }
        place[k] = [
            at.x + half[0] - f64::from(exposed.corner[0]),
            at.y + half[1] - f64::from(exposed.corner[1]),
        ];
    }
    let (spot, columns) = (way.spot(middle), exposed.columns);
    let global = exposed.plan.global();
    exposed
        .plan
        .integrate(&place, spot.sigma_px, |row, at, weight| {
            if global {
                spot.add_window(at, columns, light * weight, window);
            } else {
                let row_of = &mut window[row * columns..(row + 1) * columns];
                spot.add_row(at, row, light * weight, row_of);
            }
        });
}

/// Place of the middle of a window's row, centred px.
pub(crate) fn row_y(camera: &Camera, corner: [i32; 2], row: f64) -> f64 {
    f64::from(corner[1]) + row + 0.5 - camera.half_size_px()[1]
}
