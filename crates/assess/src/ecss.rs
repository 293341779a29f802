//! The pointing error indices of ECSS over sliding windows.
//!
//! ```text
//! APE, AKE  e(t)                                        at every instant
//! MPE       mean of e over a window dt                  sliding, frame by frame
//! RPE       e(t) - mean over the window around t
//! PDE       difference of the means of two windows that begin `apart` from each other
//! ```
//!
//! Each is told as the value that its size stays below for 68.27 % and for 99.73 % of the time, each axis
//! for itself: the *temporal* interpretation, one tracker over one record. `e` is the tracker's error of
//! knowledge, its mean removed (nothing here knows a constant misalignment): that is the AKE. The same
//! numbers are the APE, and so on, of a spacecraft whose control follows the tracker without an error of
//! its own; control errors come on top.
//!
//! Source: ECSS-E-ST-60-10C, Control performance (2008), Sections 3.2 and 4.2 and Annex A.

/// Shares of time, those of one and three sigma of a Gaussian.
pub const SHARES: [f64; 2] = [0.682_7, 0.997_3];

/// An index about the tracker's axes, arcsec, at both of [`SHARES`].
pub type Index = [[f64; 3]; 2];

/// All indices.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Ecss {
    /// How the statistics are to be read.
    pub interpretation: &'static str,
    /// Window, s.
    pub window_s: f64,
    /// Distance of the two windows of the PDE, s.
    pub apart_s: f64,
    /// Absolute knowledge error.
    pub ake_arcsec: Index,
    /// Absolute performance error of a control that follows the tracker.
    pub ape_arcsec: Index,
    /// Mean performance error.
    pub mpe_arcsec: Index,
    /// Relative performance error.
    pub rpe_arcsec: Index,
    /// Performance drift error; `None` where no two whole windows are so far apart.
    pub pde_arcsec: Option<Index>,
}

/// Computes all indices of an error series.
///
/// # Panics
/// If times and values differ in number.
#[must_use]
pub fn ecss(t_s: &[f64], error: &[Vec<f64>; 3], step_s: f64, window_s: f64, apart_s: f64) -> Ecss {
    let mut out = Ecss {
        interpretation: "temporal",
        window_s,
        apart_s,
        ake_arcsec: [[0.0; 3]; 2],
        ape_arcsec: [[0.0; 3]; 2],
        mpe_arcsec: [[0.0; 3]; 2],
        rpe_arcsec: [[0.0; 3]; 2],
        pde_arcsec: Some([[0.0; 3]; 2]),
    };
    for axis in 0..3 {
        let e = &error[axis];
        assert_eq!(t_s.len(), e.len(), "one time for each value");
        let mean = e.iter().sum::<f64>() / e.len() as f64;
        let e: Vec<f64> = e.iter().map(|x| x - mean).collect();
        let means = sliding_means(t_s, &e, step_s, window_s);
        let relative: Vec<f64> = e
            .iter()
            .zip(&means)
            .filter_map(|(e, m)| m.map(|m| e - m))
            .collect();
        let mut drift = Vec::new();
        for (k, m) in means.iter().enumerate() {
            let later = t_s.partition_point(|t| *t < t_s[k] + apart_s - 0.5 * step_s);
            if let (Some(m), Some(Some(n))) = (m, means.get(later))
                && (t_s[later] - t_s[k] - apart_s).abs() <= 0.5 * step_s
            {
                drift.push(n - m);
            }
        }
        let whole: Vec<f64> = means.iter().flatten().copied().collect();
        for (k, share) in SHARES.into_iter().enumerate() {
            out.ake_arcsec[k][axis] = below(&e, share);
            out.mpe_arcsec[k][axis] = below(&whole, share);
            out.rpe_arcsec[k][axis] = below(&relative, share);
            if drift.is_empty() {
                out.pde_arcsec = None;
            } else if let Some(pde) = &mut out.pde_arcsec {
                pde[k][axis] = below(&drift, share);
            }
        }
    }
    out.ape_arcsec = out.ake_arcsec;
    out
}

/// Mean over the window around each frame; `None` where it is not whole.
fn sliding_means(t_s: &[f64], e: &[f64], step_s: f64, window_s: f64) -> Vec<Option<f64>> {
    let mut sum = vec![0.0; e.len() + 1];
    for (k, e) in e.iter().enumerate() {
        sum[k + 1] = sum[k] + e;
    }
    let half = 0.5 * window_s;
    let (first, last) = (t_s[0], t_s[t_s.len() - 1]);
    (0..e.len())
        .map(|k| {
            let inside =
                t_s[k] - half >= first - 0.5 * step_s && t_s[k] + half <= last + 0.5 * step_s;
            let from = t_s.partition_point(|t| *t < t_s[k] - half - 1e-6 * step_s);
            let to = t_s.partition_point(|t| *t <= t_s[k] + half + 1e-6 * step_s);
            let n = to - from;
            // an outlier or two may be missing, no more
            let whole = inside && (n as f64 + 0.1 * n as f64 + 1.0) * step_s >= window_s;
            whole.then(|| (sum[to] - sum[from]) / n as f64)
        })
        .collect()
}

/// The size that a share of the values stays below; NaN without values.
fn below(x: &[f64], share: f64) -> f64 {
    let mut size: Vec<f64> = x.iter().map(|x| x.abs()).collect();
    size.sort_by(f64::total_cmp);
    let Some(last) = size.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = share * last as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of the length"
    )]
    let k = at.floor() as usize;
    let next = size[(k + 1).min(last)];
    size[k] + (next - size[k]) * (at - k as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(f: impl Fn(f64) -> f64) -> (Vec<f64>, [Vec<f64>; 3]) {
        let t: Vec<f64> = (0..10_000).map(|k| 0.1 * f64::from(k)).collect();
        let x: Vec<f64> = t.iter().map(|t| f(*t)).collect();
        (t, [x.clone(), x.clone(), x])
    }

    /// A ramp of 1 arcsec/s over 1000 s: the mean over a window is the ramp in its middle, so the RPE is
    /// zero there, the PDE of windows 50 s apart is 50, and the AKE is uniform over 0 to 500.
    #[test]
    fn a_ramp_drifts_and_has_no_relative_error() {
        let (t, e) = series(|t| t);
        let got = ecss(&t, &e, 0.1, 10.0, 50.0);
        assert!(got.rpe_arcsec[1][0] < 1e-6, "{:?}", got.rpe_arcsec);
        let pde = got.pde_arcsec.unwrap();
        assert!((pde[0][2] - 50.0).abs() < 1e-6);
        // steps of 0.1 arcsec
        assert!((got.ake_arcsec[0][1] - 0.6827 * 500.0).abs() < 0.2);
        assert_eq!(got.ake_arcsec, got.ape_arcsec);
    }

    /// A square wave of period 2 s and height 3 within windows of 10 s: the mean is zero to a sample in a
    /// hundred, the relative error is the wave.
    #[test]
    fn what_is_fast_is_relative() {
        let (t, e) = series(|t| {
            if (t + 0.05).rem_euclid(2.0) < 1.0 {
                3.0
            } else {
                -3.0
            }
        });
        let got = ecss(&t, &e, 0.1, 10.0, 50.0);
        assert!(got.mpe_arcsec[1][0] < 0.07 && (got.rpe_arcsec[0][0] - 3.0).abs() < 0.07);
        assert!(got.pde_arcsec.unwrap()[1][0] < 0.07);
    }

    #[test]
    fn windows_longer_than_the_record_have_no_mean() {
        let (t, e) = series(|t| t.sin());
        let got = ecss(&t, &e, 0.1, 2000.0, 50.0);
        assert!(got.mpe_arcsec[0][0].is_nan() && got.pde_arcsec.is_none());
    }
}
