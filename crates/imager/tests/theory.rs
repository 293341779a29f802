//! Rendered and read out, against closed forms that share nothing with the rendering.
//!
//! `docs/imager.md` shows the figures that these tests print (`-- --nocapture`).
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use core::f64::consts::{PI, TAU};

use centroid::GaussianPsf;
use focal_plane::{
    Angle, AttitudeSource, Camera, Catalogue, CatalogueStar, Pixel, SPEED_OF_LIGHT_M_S,
    UniformRotation, ra_dec, rotation_from_vector,
};
use imager::{BackgroundLevel, CentroidForm, Instrument, Run, frames};
use nalgebra::{UnitQuaternion, Vector3};
use telemetry::Bundle;

/// Light and geometry alone: no noise, steps of 1e-3 electrons, and an exposure of a millionth of a
/// second in which nothing moves. A star of magnitude 0 gives 1e6 electrons.
fn silent(window: usize) -> Instrument {
    let mut instrument = Instrument::default();
    instrument.shutter.exposure_s = 1e-6;
    let detector = &mut instrument.detector;
    detector.electrons_s_mag0 = 1e12;
    detector.photon_noise = false;
    detector.read_noise_e = 0.0;
    detector.gain_e_per_dn = 1e-3;
    detector.bits = 32;
    detector.full_well_e = 1e9;
    let readout = &mut instrument.readout;
    readout.window = [window; 2];
    readout.hysteresis_px = 0.0;
    readout.background = BackgroundLevel::Fixed;
    readout.background_dn = Some(100.0);
    instrument.stars.separation_px = 0.0;
    instrument.stars.followed = 400;
    instrument
}

/// A star of magnitude 0 where a tracker with the identity as attitude has it at `at`.
fn star_at(id: i64, at: Pixel, camera: &Camera) -> CatalogueStar {
    let (ra, dec) = ra_dec(&camera.direction(at));
    CatalogueStar {
        id,
        ra_deg: ra.deg().rem_euclid(360.0),
        dec_deg: dec.deg(),
        ..CatalogueStar::default()
    }
}

fn sky(places: &[[f64; 2]], camera: &Camera) -> Catalogue {
    let star = |(k, &[x, y]): (usize, &[f64; 2])| {
        star_at(i64::try_from(k).unwrap(), Pixel { x, y }, camera)
    };
    Catalogue::new(2000.0, places.iter().enumerate().map(star).collect()).unwrap()
}

fn render(
    instrument: &Instrument,
    truth: &dyn AttitudeSource,
    places: &[[f64; 2]],
    run: &Run,
) -> Bundle {
    let camera = instrument.optics.camera().unwrap();
    frames(instrument, truth, &sky(places, &camera), run).unwrap()
}

/// Measured minus where the pinhole has the star at the time of its frame, by star: frame after frame.
fn errors(bundle: &Bundle, truth: &dyn AttitudeSource, star_id: i64) -> Vec<[f64; 2]> {
    let (stars, camera) = (
        bundle.stars.as_ref().unwrap(),
        bundle.camera.as_ref().unwrap(),
    );
    let catalogue = bundle.catalog.as_ref().unwrap();
    let u = catalogue.direction_at(catalogue.index_of(star_id).unwrap(), 2000.0);
    let mut found = Vec::new();
    for k in 0..stars.frames() {
        let true_at = camera
            .project(&(truth.attitude(stars.t_s[k]).unwrap() * u))
            .unwrap();
        let rows = stars
            .rows_of(k)
            .filter(|&row| stars.star_id[row] == star_id);
        found.extend(rows.map(|row| [stars.x_px[row] - true_at.x, stars.y_px[row] - true_at.y]));
    }
    found
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// A slow turn about y, X pixels in `frames` frames at 2 Hz.
fn crossing(px: f64, frames: u32, camera: &Camera) -> UniformRotation {
    let rate = px / camera.focal_length_px()[0] / (f64::from(frames) / 2.0);
    UniformRotation {
        rate_rad_s: Vector3::new(0.0, -rate, 0.0),
        ..UniformRotation::default()
    }
}

/// Poisson's sum over the first moment of a Gaussian integrated over pixels (the pixel's sinc vanishes at
/// all harmonics, its slope does not): with x from a pixel's centre,
/// `error = sum_k (-1)^k exp(-2 pi^2 s^2 k^2) sin(2 pi k x)/(pi k)`. In 15 x 15 pixels the cut is beyond 7 px
/// (3e-12 of the light at s = 1); steps of 1e-3 of 1e6 electrons leave 2e-8 px, the polynomial of the way less.
#[test]
fn the_s_curve_is_that_of_poissons_sum() {
    for sigma in [0.35, 0.45, 0.6, 1.0] {
        let mut instrument = silent(15);
        instrument.optics.psf_sigma_px = sigma;
        let camera = instrument.optics.camera().unwrap();
        let truth = crossing(1.0, 40, &camera);
        let run = Run {
            frames: 40,
            ..Run::default()
        };
        let bundle = render(&instrument, &truth, &[[10.5, -30.3], [11.0, 200.0]], &run);
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        let stars = bundle.stars.as_ref().unwrap();
        for (k, [got, got_y]) in errors(&bundle, &truth, 0).into_iter().enumerate() {
            let row = stars
                .rows_of(k)
                .find(|&row| stars.star_id[row] == 0)
                .unwrap();
            let curve = |x: f64| -> f64 {
                let term = |k: i32| {
                    let order = f64::from(k);
                    let size = (-2.0 * (PI * sigma * order).powi(2)).exp() / (PI * order);
                    if k % 2 == 0 {
                        size * (TAU * order * x).sin()
                    } else {
                        -size * (TAU * order * x).sin()
                    }
                };
                (1..12).map(term).sum()
            };
            // centres are at halves
            let want = curve(stars.x_px[row] - got - 0.5);
            let want_y = curve(stars.y_px[row] - got_y - 0.5);
            worst = worst.max((got - want).abs()).max((got_y - want_y).abs());
            largest = largest.max(got.abs());
        }
        println!("s-curve: sigma {sigma} px, largest {largest:.2e} px, off by {worst:.1e} px");
        assert!(worst < 1e-6, "sigma {sigma}: {worst}");
    }
}

/// A window that cuts the spot off: the closed form of crate `centroid`, which sums error functions. The
/// window is about the pixel of the star.
#[test]
fn a_small_window_is_that_of_the_closed_form() {
    for (sigma, window) in [(0.8, 5_u32), (0.6, 3), (1.2, 7)] {
        let mut instrument = silent(window as usize);
        instrument.optics.psf_sigma_px = sigma;
        let camera = instrument.optics.camera().unwrap();
        let truth = crossing(1.0, 40, &camera);
        let run = Run {
            frames: 40,
            ..Run::default()
        };
        // on y the star stays in the middle of its pixel
        let bundle = render(&instrument, &truth, &[[10.5, 0.5], [11.0, 200.0]], &run);
        let form = GaussianPsf::new(sigma, window).unwrap();
        let stars = bundle.stars.as_ref().unwrap();
        for (k, [got, _]) in errors(&bundle, &truth, 0).into_iter().enumerate() {
            let row = stars
                .rows_of(k)
                .find(|&row| stars.star_id[row] == 0)
                .unwrap();
            let offset = (stars.x_px[row] - got).rem_euclid(1.0) - 0.5;
            if offset.abs() > 0.499 {
                continue; // the window may be about either pixel
            }
            let want = form.error_px(offset);
            assert!(
                (got - want).abs() < 1e-6,
                "{sigma} in {window} at {offset}: {got} {want}"
            );
        }
    }
}

/// Share of pixel k of a Gaussian at x (from the first edge), and its slope by x: closed forms.
fn share(k: usize, x: f64, sigma: f64) -> [f64; 2] {
    let edge = |e: f64| libm::erf((e - x) / (sigma * 2_f64.sqrt()));
    let slope = |e: f64| (-0.5 * ((e - x) / sigma).powi(2)).exp() / (sigma * TAU.sqrt());
    let (a, b) = (k as f64, k as f64 + 1.0);
    [0.5 * (edge(b) - edge(a)), slope(a) - slope(b)]
}

/// Fisher information on x of a spot of `light` electrons at (x, y) in n x n pixels with a read noise.
fn information(n: usize, [x, y]: [f64; 2], sigma: f64, light: f64, read_e: f64) -> f64 {
    let mut sum = 0.0;
    for r in 0..n {
        for c in 0..n {
            let ([gx, dx], [gy, _]) = (share(c, x, sigma), share(r, y, sigma));
            sum += (light * dx * gy).powi(2) / (light * gx * gy + read_e * read_e);
        }
    }
    sum
}

/// Scatter along x of one star that rests at `at`, over many frames.
fn scatter(instrument: &Instrument, at: [f64; 2], count: u64) -> f64 {
    let still = UniformRotation::default();
    let run = Run {
        frames: count,
        seed: 7,
        ..Run::default()
    };
    let bundle = render(instrument, &still, &[at, [300.0, 200.0]], &run);
    let x: Vec<f64> = errors(&bundle, &still, 0).iter().map(|e| e[0]).collect();
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    rms(&x.iter().map(|x| x - mean).collect::<Vec<_>>())
}

/// Photon noise: the first moment of a well sampled spot is efficient. Var = (s^2 + 1/12)/N for the
/// moment, 1/information for the bound; their ratio at s = 1 is 1.007 (sampling). 8000 frames give the scatter
/// to 0.8 %: 5 sigma are 4 %.
#[test]
fn photon_noise_reaches_the_bound() {
    let (sigma, light, n) = (1.0, 2e4, 13);
    let mut instrument = silent(n);
    instrument.optics.psf_sigma_px = sigma;
    instrument.detector.electrons_s_mag0 = light * 1e6;
    instrument.detector.photon_noise = true;
    let got = scatter(&instrument, [10.3, -20.6], 8000);
    let moment = ((sigma * sigma + 1.0 / 12.0) / light).sqrt();
    let half = (n - 1) as f64 / 2.0;
    let bound = information(n, [half + 0.3, half + 0.4], sigma, light, 0.0).powf(-0.5);
    println!("photon noise: {got:.6} px; first moment {moment:.6}, bound {bound:.6}");
    let error = 5.0 / 16_000_f64.sqrt();
    assert!((got / moment - 1.0).abs() < error, "{got} against {moment}");
    assert!(
        (1.0 - error..1.0 + error + 0.01).contains(&(got / bound)),
        "{got} against {bound}"
    );
}

/// Read noise: a first moment pays for every pixel of the window, `r sqrt(sum x^2) / N`; a centroid under the
/// spot's own Gaussian is efficient (its weight is the slope of the spot, up to the pixel: 1 % at s = 1).
#[test]
fn read_noise_of_the_moment_and_the_bound_of_the_weighted() {
    let (sigma, light, n, read_e) = (1.0, 2e4, 9, 12.0);
    let mut instrument = silent(n);
    instrument.optics.psf_sigma_px = sigma;
    instrument.detector.electrons_s_mag0 = light * 1e6;
    instrument.detector.read_noise_e = read_e;
    instrument.detector.bias_dn = 1e6;
    instrument.readout.background_dn = Some(1e6);
    let got = scatter(&instrument, [10.5, -20.5], 8000);
    // sum of (x - centre)^2 over the window, and the scatter of the flux times an offset of 0
    let squares: f64 = (0..n).map(|k| (k as f64 - 4.0).powi(2)).sum::<f64>() * n as f64;
    let moment = read_e * squares.sqrt() / light;
    instrument.readout.centroid = CentroidForm::Weighted;
    instrument.readout.weight_px = (sigma * sigma + 1.0 / 12.0_f64).sqrt();
    let weighted = scatter(&instrument, [10.5, -20.5], 8000);
    // noise without photons: every pixel has the same
    let mut sum = 0.0;
    for r in 0..n {
        for c in 0..n {
            sum += (light * share(c, 4.5, sigma)[1] * share(r, 4.5, sigma)[0]).powi(2);
        }
    }
    let bound = read_e / sum.sqrt();
    println!(
        "read noise: moment {got:.5} px, theory {moment:.5}; weighted {weighted:.5}, bound {bound:.5}"
    );
    let error = 5.0 / 16_000_f64.sqrt();
    assert!((got / moment - 1.0).abs() < error, "{got} against {moment}");
    let over = weighted / bound;
    assert!(
        (1.0 - error..1.0 + error + 0.01).contains(&over),
        "{weighted} against {bound}"
    );
}

/// Swings about y: x = f tan(a sin w t) for a star at the boresight.
#[derive(Clone, Copy, Debug)]
struct Swing {
    amplitude_rad: f64,
    w_rad_s: f64,
}

impl AttitudeSource for Swing {
    fn attitude(&self, t_s: f64) -> Option<UnitQuaternion<f64>> {
        let angle = self.amplitude_rad * (self.w_rad_s * t_s).sin();
        Some(rotation_from_vector(&Vector3::new(0.0, angle, 0.0)))
    }

    fn rate_rad_s(&self, t_s: f64) -> Option<Vector3<f64>> {
        let rate = self.amplitude_rad * self.w_rad_s * (self.w_rad_s * t_s).cos();
        Some(Vector3::new(0.0, -rate, 0.0))
    }

    fn span_s(&self) -> [f64; 2] {
        [f64::NEG_INFINITY, f64::INFINITY]
    }
}

/// Averaged over T a swing loses `a T^2/24 - a'''' T^4/1920 ...`: for a sinus exactly the factor
/// `sin(wT/2)/(wT/2)`. At constant rate nothing moves. The polynomial through five instants is good to
/// `(wT/2)^5/1920` of the amplitude, 1e-6 px here; f tan(angle) is linear to 1e-6 of 6 px.
#[test]
fn smear_and_turn_around_are_the_mean_of_the_path() {
    let mut instrument = silent(25);
    let (exposure_s, w) = (0.4, 1.9);
    instrument.shutter.exposure_s = exposure_s;
    instrument.detector.electrons_s_mag0 = 2.5e6;
    let f = instrument.optics.camera().unwrap().focal_length_px()[0];
    let truth = Swing {
        amplitude_rad: 6.0 / f,
        w_rad_s: w,
    };
    let run = Run {
        frames: 40,
        rate_hz: 7.3,
        ..Run::default()
    };
    let bundle = render(&instrument, &truth, &[[0.0, 0.0], [200.0, 150.0]], &run);
    let stars = bundle.stars.as_ref().unwrap();
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (k, [got, _]) in errors(&bundle, &truth, 0).into_iter().enumerate() {
        let x = 6.0 * (w * stars.t_s[k]).sin();
        let half = 0.5 * w * exposure_s;
        let exact = x * (half.sin() / half - 1.0);
        let series =
            -w * w * x * exposure_s.powi(2) / 24.0 + w.powi(4) * x * exposure_s.powi(4) / 1920.0;
        assert!(
            (exact - series).abs() < 6.0 * half.powi(6) / 5040.0 * 1.01,
            "the series itself"
        );
        worst = worst.max((got - exact).abs());
        largest = largest.max(exact.abs());
    }
    println!("turn-around: largest {largest:.4} px, off by {worst:.1e} px");
    // beside the polynomial: the S-curve of sigma 0.7, 2e-5, washed out by the way
    assert!(worst < 3e-5, "{worst}");
}

/// A star that moves by L while it is exposed is wider by `L^2/12`.
#[test]
fn a_trail_has_the_second_moment_of_a_bar() {
    let mut instrument = silent(25);
    instrument.shutter.exposure_s = 0.5;
    instrument.detector.electrons_s_mag0 = 2e6;
    instrument.readout.images = true;
    let f = instrument.optics.camera().unwrap().focal_length_px()[0];
    let rate_px_s = 9.0;
    let truth = UniformRotation {
        rate_rad_s: Vector3::new(0.0, rate_px_s / f, 0.0),
        ..UniformRotation::default()
    };
    let bundle = render(
        &instrument,
        &truth,
        &[[0.3, 0.2], [200.0, 150.0]],
        &Run::default(),
    );
    let (images, stars) = (
        bundle.images.as_ref().unwrap(),
        bundle.stars.as_ref().unwrap(),
    );
    let row = (0..stars.rows())
        .find(|&row| stars.star_id[row] == 0)
        .unwrap();
    let window = images.window(row);
    let moment = |along_x: bool| -> f64 {
        let mut sums = [0.0; 2];
        for (k, v) in window.iter().enumerate() {
            let v = v - 100.0;
            let d = if along_x {
                images.x0_px[row] + (k % 25) as f64 - stars.x_px[row]
            } else {
                images.y0_px[row] + (k / 25) as f64 - stars.y_px[row]
            };
            sums[0] += v;
            sums[1] += v * d * d;
        }
        sums[1] / sums[0]
    };
    let still = 0.49 + 1.0 / 12.0;
    let trail = still + (rate_px_s * 0.5_f64).powi(2) / 12.0;
    println!(
        "trail: {:.5} px2 along, {trail:.5}; {:.5} across, {still:.5}",
        moment(true),
        moment(false)
    );
    // aliasing of the second moment: 4 s^2 exp(-2 pi^2 s^2) = 1.2e-4 across, less along
    assert!((moment(true) - trail).abs() < 3e-4 && (moment(false) - still).abs() < 3e-4);
}

/// Row y is exposed y row times after row 0: the star is found at `x(t + row_time y)`. Along y the light
/// falls on each row at that row's own time, so that the image is squeezed by `1/(1 + v_y row_time)` about
/// it: `y = y0/(1 - v_y row_time)`, exactly, for a way at constant speed.
#[test]
fn a_rolling_shutter_shifts_by_rate_times_row_time() {
    let mut instrument = silent(15);
    let row_time_s = 50e-6;
    instrument.shutter.row_time_s = row_time_s;
    instrument.shutter.exposure_s = 1e-3;
    instrument.detector.electrons_s_mag0 = 1e9;
    let f = instrument.optics.camera().unwrap().focal_length_px()[0];
    let v_px_s = 12.0;
    for along_x in [true, false] {
        let axis = if along_x { Vector3::y() } else { -Vector3::x() };
        // stars move against the rate
        let truth = UniformRotation {
            rate_rad_s: -axis * (v_px_s / f),
            ..UniformRotation::default()
        };
        let places = [[3.2, 400.6], [1.7, -350.2], [2.4, 0.1]];
        let bundle = render(&instrument, &truth, &places, &Run::default());
        for (id, [_, y]) in (0..).zip(places) {
            let [dx, dy] = errors(&bundle, &truth, id)[0];
            // 1 + (y/f)^2: what the turn moves a star by there; exact to second order in the turn
            let v = if along_x {
                v_px_s
            } else {
                v_px_s * (1.0 + (y / f).powi(2))
            };
            let s = v * row_time_s;
            let want = if along_x { s * y } else { s * y / (1.0 - s) };
            let (moved, still) = if along_x { (dx, dy) } else { (dy, dx) };
            println!("rolling shutter: y {y}, moved {moved:.5} px, theory {want:.5}");
            // aliasing 2e-5; across the way x y/f^2 of the speed, 4e-5 px for the first star
            assert!(
                (moved - want).abs() < 5e-5 && still.abs() < 8e-5,
                "{moved} {want} {still}"
            );
        }
    }
}

/// Pixels that differ by p rms move a centroid by `p sqrt(sum (x_i - x)^2 share_i^2)`: 380 stars at
/// places of their own, 5/sqrt(2 380) of the scatter along x.
#[test]
fn prnu_has_the_variance_of_its_sum() {
    let mut instrument = silent(7);
    instrument.detector.prnu = 0.01;
    let sigma = instrument.optics.psf_sigma_px;
    // 20 x 19 windows that do not touch, at phases of an irrational step
    let places: Vec<[f64; 2]> = (0..380_i32)
        .map(|k| {
            let (c, r) = (f64::from(k % 20), f64::from(k / 20));
            [
                c * 50.0 - 475.0 + (f64::from(k) * 0.618).fract(),
                r * 50.0 - 450.0 + (f64::from(k) * 0.414).fract(),
            ]
        })
        .collect();
    let still = UniformRotation::default();
    let moved = render(
        &instrument,
        &still,
        &places,
        &Run {
            seed: 3,
            ..Run::default()
        },
    );
    instrument.detector.prnu = 0.0;
    let plain = render(
        &instrument,
        &still,
        &places,
        &Run {
            seed: 3,
            ..Run::default()
        },
    );
    let ids: Vec<i64> = (0..380).collect();
    let (mut got, mut variance) = (Vec::new(), 0.0);
    for (&id, place) in ids.iter().zip(&places) {
        got.push(errors(&moved, &still, id)[0][0] - errors(&plain, &still, id)[0][0]);
        let [x, y] = place.map(|p| 3.0 + p.rem_euclid(1.0));
        for r in 0..7 {
            for c in 0..7 {
                let light = share(c, x, sigma)[0] * share(r, y, sigma)[0];
                variance += (0.01 * light * (c as f64 + 0.5 - x)).powi(2) / 380.0;
            }
        }
    }
    let (got, want) = (rms(&got), variance.sqrt());
    println!("prnu 1 %: {:.3e} px rms, theory {want:.3e}", got);
    assert!(
        (got / want - 1.0).abs() < 5.0 / 760_f64.sqrt(),
        "{got} {want}"
    );
}

/// A tracker that moves across its boresight at 30 km/s believes that it points v/c ahead: 20.6 arcsec.
/// The field beyond the boresight adds (v/c)^2 and, by its size, 1e-2 of the turn about y.
#[test]
fn aberration_turns_the_attitude() {
    let mut instrument = silent(9);
    instrument.orbit.velocity_km_s = [30.0, 0.0, 0.0];
    let still = UniformRotation::default();
    let places = [
        [0.0, 0.0],
        [300.0, 10.0],
        [-300.0, 20.0],
        [20.0, 300.0],
        [10.0, -300.0],
    ];
    let bundle = render(&instrument, &still, &places, &Run::default());
    let shift = errors(&bundle, &still, 0)[0][0];
    let f = bundle.camera.as_ref().unwrap().focal_length_px()[0];
    let want = 30e3 / SPEED_OF_LIGHT_M_S;
    // S-curve 2e-5 px
    assert!((shift - f * want).abs() < 5e-5, "{shift} px");
    let q = bundle.attitude.as_ref().unwrap().q[0];
    let turn = focal_plane::rotation_vector(&q, &UnitQuaternion::identity());
    println!(
        "aberration: {:.3} arcsec about y",
        Angle::from_rad(turn.y).arcsec()
    );
    assert!(
        (turn.y / want - 1.0).abs() < 0.01 && turn.x.abs() < 0.01 * want,
        "{turn}"
    );
}

/// Clipping at full well and at the converter flattens a bright star and leaves a faint one.
#[test]
fn charge_is_clipped_and_counted() {
    let mut instrument = silent(9);
    instrument.detector.full_well_e = 5e4;
    instrument.detector.gain_e_per_dn = 2.0;
    instrument.detector.bits = 14;
    instrument.readout.images = true;
    let still = UniformRotation::default();
    let bundle = render(
        &instrument,
        &still,
        &[[0.5, 0.5], [200.0, 150.0]],
        &Run::default(),
    );
    let most = |id: i64| {
        let stars = bundle.stars.as_ref().unwrap();
        let row = (0..stars.rows())
            .find(|&row| stars.star_id[row] == id)
            .unwrap();
        bundle
            .images
            .as_ref()
            .unwrap()
            .window(row)
            .iter()
            .copied()
            .fold(0.0, f64::max)
    };
    // 1e6 electrons: far above 5e4 electrons, 25100 DN, and above the converter's 16383
    assert!((most(0) - 16_383.0).abs() < 1e-9);
    instrument.detector.bits = 16;
    let bundle = render(
        &instrument,
        &still,
        &[[0.5, 0.5], [200.0, 150.0]],
        &Run::default(),
    );
    let window = bundle.images.as_ref().unwrap().window(0);
    let full = window
        .iter()
        .filter(|v| (**v - 25_100.0).abs() < 1e-9)
        .count();
    assert!(full >= 5, "{full} pixels are full");
    assert!(window.iter().all(|v| v.fract() == 0.0), "whole numbers");
}

/// The raw windows of one frame, light alone.
fn windows(instrument: &Instrument) -> Vec<f64> {
    let still = UniformRotation::default();
    let places = [[0.5, 0.5], [1.5, 200.5]];
    let bundle = render(instrument, &still, &places, &Run::default());
    bundle.images.unwrap().pixels
}

/// A response that bends by n at full well, `q (1 - n q/full well)`, and offsets that go with the
/// column: two windows above each other, one column apart, share them. Steps of 1e-3 electrons.
#[test]
fn response_bends_and_columns_differ() {
    let mut instrument = silent(9);
    instrument.readout.images = true;
    instrument.detector.full_well_e = 1e6;
    let plain = windows(&instrument);
    instrument.detector.nonlinearity = 0.1;
    for (bent, plain) in windows(&instrument).iter().zip(&plain) {
        let q = (plain - 100.0) * 1e-3;
        let want = q * (1.0 - 0.1 * q / 1e6);
        assert!(((bent - 100.0) * 1e-3 - want).abs() < 2e-3, "{bent} {want}");
    }
    instrument.detector.nonlinearity = 0.0;
    instrument.detector.column_e = 20.0;
    instrument.detector.bias_dn = 1e6;
    let striped = windows(&instrument);
    let offset = |window: usize, row: usize, column: usize| {
        let k = 81 * window + 9 * row + column;
        (striped[k] - 1e6 - (plain[k] - 100.0)) * 1e-3
    };
    let mut largest = 0.0_f64;
    for column in 1..9 {
        let first = offset(0, 0, column);
        largest = largest.max(first.abs());
        assert!((offset(0, 5, column) - first).abs() < 3e-3);
        assert!((offset(1, 3, column - 1) - first).abs() < 3e-3);
    }
    // eight normal numbers of 20: all below 2 with a chance of 1e-9
    assert!(largest > 2.0, "{largest}");
}

/// Two stars of one frame have noise of their own: correlation below 5/sqrt(n).
#[test]
fn noise_of_two_windows_is_independent() {
    let mut instrument = silent(7);
    instrument.detector.read_noise_e = 50.0;
    instrument.detector.bias_dn = 1e6;
    instrument.readout.background_dn = Some(1e6);
    let still = UniformRotation::default();
    let run = Run {
        frames: 2000,
        ..Run::default()
    };
    let bundle = render(&instrument, &still, &[[0.5, 0.5], [300.5, 200.5]], &run);
    let x = |id: i64| {
        errors(&bundle, &still, id)
            .iter()
            .map(|e| e[0])
            .collect::<Vec<f64>>()
    };
    let (a, b) = (x(0), x(1));
    let product = a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>() / 2000.0;
    let correlation = product / (rms(&a) * rms(&b));
    assert!(correlation.abs() < 5.0 / 2000_f64.sqrt(), "{correlation}");
}
