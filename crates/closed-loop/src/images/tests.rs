//! The estimators together, on made-up windows and on measured ones.
//!
//! Not physics: tests.

use super::synthetic::{BACKGROUND, FLUX, Made, Scenario, all, dither, no_hit, nothing, rms};
use super::*;

const FIELD: [[f64; 2]; 4] = [
    [-210.3, 95.2],
    [180.7, 240.4],
    [30.1, -190.8],
    [-60.6, -20.9],
];

fn scenario<'a>() -> Scenario<'a> {
    Scenario {
        frames: 400,
        stars: &FIELD,
        motion: &dither,
        dark: &nothing,
        hit: &no_hit,
        kept: &all,
        size: 6,
        pixel_centre: 0.5,
        seed: 11,
    }
}

fn formed(made: &Made) -> Formed {
    form(
        &made.data,
        &made.windows,
        &Folds::cut(made.data.frames.frames()),
    )
    .unwrap()
}

/// Every row from the variant that was learned outside its fold.
fn out_of_fold(made: &Made, variants: &[[Vec<f64>; 2]]) -> [Vec<f64>; 2] {
    let fold = Folds::cut(made.data.frames.frames()).fold_of_frame();
    let mut out = [Vec::new(), Vec::new()];
    for (k, &f) in fold.iter().enumerate() {
        for row in made.data.frames.rows_of(k) {
            for axis in 0..2 {
                out[axis].push(variants[f][axis][row]);
            }
        }
    }
    out
}

/// A value for every pixel, exponential with mean 25, the same on every call.
fn warm(centre: [f64; 2]) -> f64 {
    let n = ((centre[0] + 700.0) * 2.0) as u64 * 4099 + ((centre[1] + 700.0) * 2.0) as u64;
    let mut z = n.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    let uniform = ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
    -25.0 * (1.0 - uniform).ln()
}

/// (map - truth) over sigma, each against its mean over the pixels of one star.
fn pulls(made: &Made, map: &DarkMap, truth: &dyn Fn([f64; 2]) -> f64) -> Vec<f64> {
    let nearest = |p: &DarkPixel| {
        let distance = |s: &usize| {
            let star = FIELD[*s];
            (p.x_px - star[0]).powi(2) + (p.y_px - star[1]).powi(2)
        };
        (0..made.data.stars.len())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap()
    };
    let mut out = Vec::new();
    for s in 0..made.data.stars.len() {
        let list: Vec<[f64; 2]> = map
            .pixels
            .iter()
            .filter(|p| nearest(p) == s)
            .map(|p| [p.dn - truth([p.x_px, p.y_px]), p.sigma_dn])
            .collect();
        let mean = list.iter().map(|p| p[0]).sum::<f64>() / list.len() as f64;
        out.extend(list.iter().map(|p| (p[0] - mean) / p[1]));
    }
    out
}

fn rms_of(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn probe() {
    for (name, dark) in [
        ("warm", &warm as &dyn Fn([f64; 2]) -> f64),
        ("none", &nothing),
    ] {
        for seed in 0..3 {
            let made = Scenario {
                dark,
                seed,
                frames: 800,
                ..scenario()
            }
            .make();
            let f = formed(&made);
            let table = [made.data.frames.x_px.clone(), made.data.frames.y_px.clone()];
            let p = pulls(&made, &f.map, dark);
            let mut q = p.clone();
            q.sort_by(f64::total_cmp);
            let n = q.len();
            println!(
                "{name} table {:.5} moments {:.5} fitted {:.5} pull {:.3} q {:.2} {:.2} {:.2} rms map {:.3} fwhm {:?} fallback {}",
                rms(&made, &table, &|_| true),
                rms(&made, &out_of_fold(&made, &f.moments), &|_| true),
                rms(&made, &out_of_fold(&made, &f.fitted), &|_| true),
                rms_of(&p),
                q[0],
                q[n / 2],
                q[n - 1],
                f.map.rms_dn(),
                f.fwhm_px,
                f.fallback_rows
            );
        }
    }
}
