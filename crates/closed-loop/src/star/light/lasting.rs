//! An error of the reference that lasts from frame to frame, as the frames around tell it.
//!
//! ```text
//! e_k = s_k + w_k      s: first-order Gauss-Markov, variance T, time tau      w: white, variance W
//! y_k = e_k + n_k      what the stars of a frame say of it
//!
//! s_k | y_j, j < k     m_f, v_f: Kalman filter        s_k | y_j, j > k    m_b, v_b: the same backwards
//! 1/q = 1/v_f + 1/v_b - 1/T                           p = q (m_f/v_f + m_b/v_b)
//! ```
//!
//! The frame itself is not in p: `e_k = p +- sqrt(q + W)` before its own stars are asked.
//!
//! Source: Fraser & Potter 1969 (two-filter smoother); Brown & Hwang 2012, ch. 4 (Gauss-Markov process).

use coloured_noise::Coloured;

use crate::star::frame_rotation::Turns;

/// Nats by which an error that lasts is likelier than one that is new in every frame.
const BEYOND_DOUBT: f64 = 4.0;
/// Frames of which the mean shows what lasts.
const TOGETHER: usize = 16;
/// Sigmas of what chance makes of the stars' own noise.
const BEYOND_CHANCE: f64 = 3.0;
/// Frames by which an error is known well enough.
const ENOUGH: usize = 1024;

/// The error about one axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lasting {
    slow: Coloured,
    /// Variance of what a frame says of the lasting part, of rows of weight 1, arcsec^2.
    frame: f64,
    /// The part of that which is the reference's.
    own: f64,
}

impl Lasting {
    /// About an axis, where the rotations say beyond doubt that it lasts.
    pub(super) fn of(turns: &Turns, t_s: &[f64], axis: usize) -> Option<Self> {
        if !shows(turns, axis, TOGETHER) {
            return None;
        }
        let known = turns.frames.iter().take(ENOUGH);
        let (y, count): (Vec<f64>, Vec<f64>) = known
            .map(|turn| {
                let known = turn.as_ref();
                known.map_or((0.0, 0.0), |t| (t.theta[axis], t.variance[axis].recip()))
            })
            .unzip();
        let t_s = &t_s[..y.len()];
        let slow = Coloured::fit_above(turns.noise.sqrt(), t_s, &y, &count);
        let frame =
            turns.noise + turns.reference[axis] * count.iter().sum::<f64>() / y.len() as f64;
        let white = Coloured {
            white: frame.sqrt(),
            ..Coloured::WHITE
        };
        let likely = |law: &Coloured| law.log_likelihood(t_s, &y, &count);
        (slow.slow > 0.0 && likely(&slow) > likely(&white) + BEYOND_DOUBT).then(|| {
            let frame = slow.white * slow.white;
            let own = (frame - turns.noise).max(0.0);
            Self { slow, frame, own }
        })
    }

    /// The error in each frame before its own stars are asked, arcsec, and its variance.
    pub(super) fn around(&self, axis: usize, turns: &Turns, t_s: &[f64]) -> Vec<(f64, f64)> {
        let all = self.slow.slow * self.slow.slow;
        let before = self.one_way(axis, turns, t_s, 0..t_s.len());
        let mut after = self.one_way(axis, turns, t_s, (0..t_s.len()).rev());
        after.reverse();
        let both = before.iter().zip(&after).zip(&turns.frames);
        both.map(|(((m_f, v_f), (m_b, v_b)), turn)| {
            let q = (v_f.recip() + v_b.recip() - all.recip()).recip();
            let white = turn.as_ref().map_or(0.0, |t| self.own * t.variance[axis]);
            (q * (m_f / v_f + m_b / v_b), q + white)
        })
        .collect()
    }

    /// The lasting part in each frame by those gone through before it, with its variance.
    fn one_way(
        &self,
        axis: usize,
        turns: &Turns,
        t_s: &[f64],
        order: impl Iterator<Item = usize>,
    ) -> Vec<(f64, f64)> {
        let all = self.slow.slow * self.slow.slow;
        let (mut mean, mut variance) = (0.0, all);
        let mut last: Option<usize> = None;
        order
            .map(|k| {
                if let Some(j) = last.replace(k) {
                    let keep = (-(t_s[k] - t_s[j]).abs() / self.slow.tau_s).exp();
                    mean *= keep;
                    variance = all - keep * keep * (all - variance);
                }
                let told = (mean, variance);
                if let Some(turn) = &turns.frames[k] {
                    let gain = variance / (variance + self.frame * turn.variance[axis]);
                    mean += gain * (turn.theta[axis] - mean);
                    variance *= 1.0 - gain;
                }
                told
            })
            .collect()
    }
}

/// Whether means of `together` frames scatter about an axis by more than the stars' noise and chance.
pub(super) fn shows(turns: &Turns, axis: usize, together: usize) -> bool {
    let parts = turns.frames.chunks_exact(together);
    let (mut beyond, mut count) = (0.0, 0.0);
    for part in parts {
        let known = part.iter().flatten();
        let (sum, variance) = known.fold((0.0, 0.0), |(sum, variance), t| {
            (
                sum + t.theta[axis],
                variance + t.variance[axis] * turns.noise,
            )
        });
        if variance > 0.0 {
            beyond += sum * sum / variance - 1.0;
            count += 1.0;
        }
    }
    beyond > BEYOND_CHANCE * f64::sqrt(2.0 * count)
}
