//! What each variable moves a star by: the columns of one row.

use effects::{PixelWave, StarRows};
use focal_plane::{Camera, PointsMut};

use super::{
    ACROSS, AT_REST, BENT, DIRECTION, Empirical, FIELDS, HARMONICS, OF_A_PAIR, PRODUCTS, SIZE,
    SQUARES, legendre,
};

/// The columns of a term, one row at a time.
pub(super) struct Columns<'o, 'r> {
    out: PointsMut<'o>,
    rows: &'r StarRows<'r>,
    count: usize,
    /// Whether it is a pair that a motion takes part in by its size: what stands between has no column.
    in_pair: bool,
    per_arcsec: [f64; 2],
    /// Of the detector, px.
    half: [f64; 2],
    /// The row, and what multiplies all of it.
    i: usize,
    times: f64,
}

impl<'o, 'r> Columns<'o, 'r> {
    /// All zero.
    pub(super) fn new(
        term: &Empirical,
        camera: &Camera,
        rows: &'r StarRows<'r>,
        out: PointsMut<'o>,
    ) -> Self {
        let count = term.coefficients.len();
        assert_eq!(out.x.len(), count * rows.len(), "one block a coefficient");
        out.x.fill(0.0);
        out.y.fill(0.0);
        Self {
            out,
            rows,
            count,
            in_pair: term.has_size(),
            per_arcsec: camera.arcsec_per_px().map(|s| 1.0 / s),
            half: camera.half_size_px(),
            i: 0,
            times: 1.0,
        }
    }

    /// Row `i`, all of which is multiplied by `times`.
    pub(super) fn row(&mut self, i: usize, times: f64) -> &mut Self {
        (self.i, self.times) = (i, times);
        self
    }

    /// Where the star stands, -1 to 1 on the detector.
    fn place(&self) -> [f64; 2] {
        let [half_x, half_y] = self.half;
        let rows = self.rows;
        [rows.x_px[self.i] / half_x, rows.y_px[self.i] / half_y]
    }

    fn put(&mut self, k: usize, dx: f64, dy: f64) {
        let k = if !self.in_pair || k < OF_A_PAIR {
            k
        } else if (SIZE..BENT).contains(&k) {
            k - SIZE + OF_A_PAIR
        } else {
            self.count
        };
        if k < self.count {
            let at = k * self.rows.len() + self.i;
            self.out.x[at] = self.times * dx * self.per_arcsec[0];
            self.out.y[at] = self.times * dy * self.per_arcsec[1];
        }
    }

    /// `g` along each axis.
    fn shift(&mut self, k: usize, g: f64) {
        self.put(k, g, 0.0);
        self.put(k + 1, 0.0, g);
    }

    /// What has two values, or is one place or time.
    pub(super) fn whole(&mut self, value: f64) {
        self.shift(0, value);
    }

    /// One of many.
    pub(super) fn one_of(&mut self, which: Option<usize>) {
        if let Some(k) = which {
            self.shift(2 * k, 1.0);
        }
    }

    pub(super) fn position(&mut self, z: f64) {
        for (k, g) in legendre(z).into_iter().enumerate() {
            self.shift(2 * k, g);
        }
    }

    /// By the phase along `axis`: along it, and across.
    pub(super) fn phase(&mut self, axis: usize, wave: &PixelWave) {
        let [along_x, along_y] = [1.0 - axis as f64, axis as f64];
        let orders = || wave.orders().enumerate();
        let across = 2 * HARMONICS;
        let count = self.count;
        for (k, [sin, cos]) in orders().take(HARMONICS.min(count.div_ceil(2))) {
            self.put(2 * k, sin * along_x, sin * along_y);
            self.put(2 * k + 1, cos * along_x, cos * along_y);
        }
        for (k, [sin, cos]) in orders().take(ACROSS.min(count.saturating_sub(across))) {
            self.put(across + 2 * k, sin * along_y, sin * along_x);
            self.put(across + 2 * k + 1, cos * along_y, cos * along_x);
        }
    }

    /// By the products of the first waves along both axes.
    pub(super) fn phases(&mut self, x: &PixelWave, y: &PixelWave) {
        let (Some(x), Some(y)) = (x.orders().next(), y.orders().next()) else {
            return;
        };
        let products = x.into_iter().flat_map(|x| y.map(|y| x * y));
        for (k, product) in products.enumerate() {
            self.put(k, product, 0.0);
            self.put(PRODUCTS + k, 0.0, product);
        }
    }

    /// By the place within the window, scaled, each axis its own.
    pub(super) fn window(&mut self, off: [f64; 2]) {
        for (axis, off) in off.into_iter().enumerate() {
            for (k, g) in legendre(off).into_iter().enumerate() {
                self.put(2 * k + axis, g * (1.0 - axis as f64), g * axis as f64);
            }
        }
    }

    /// By a motion (a, b), in units of the largest; `middle` of its size.
    pub(super) fn motion(&mut self, [a, b]: [f64; 2], middle: f64) {
        let [x, y] = self.place();
        let square = a * a + b * b;
        self.put(0, a, b);
        self.put(1, -b, a);
        self.put(2, a, -b);
        self.put(3, b, a);
        self.put(4, y * a, y * b);
        self.put(5, x * a, x * b);
        for (k, square) in [square, a * a - b * b, a * b].into_iter().enumerate() {
            self.shift(SQUARES + 2 * k, square);
        }
        let size = square.sqrt();
        self.shift(SIZE, size - middle);
        self.put(BENT, size * a, size * b);
        self.put(BENT + 1, -size * b, size * a);
        let speed = (square + AT_REST * AT_REST).sqrt();
        self.put(DIRECTION, a / speed, b / speed);
        self.put(DIRECTION + 1, -b / speed, a / speed);
    }

    /// The scale from an instant on: `z` is zero before.
    pub(super) fn scale_since(&mut self, z: f64) {
        let [x, y] = self.place();
        self.put(0, x * z, y * z);
        self.put(1, x, y);
    }

    /// By one number: a shift along each axis, a roll and a scale of each order. Of the time only what bends turns: what
    /// turns whole frames to and fro is what a slow error of the reference does.
    pub(super) fn number(&mut self, z: f64, is_time: bool) {
        let [x, y] = self.place();
        let orders = self.count.div_ceil(FIELDS);
        for (k, g) in legendre(z).into_iter().enumerate().take(orders) {
            if k == 0 || !is_time {
                self.shift(FIELDS * k, g);
                self.put(FIELDS * k + 2, -y * g, x * g);
            }
            self.put(FIELDS * k + 3, x * g, y * g);
        }
    }
}
