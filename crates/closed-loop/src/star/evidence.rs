//! Star measurements as evidence, at one noise.
//!
//! Where every frame's attitude is a free unknown, its three angles are eliminated
//! exactly (a Schur complement, [`crate::star::moments`]); where the reference has a
//! slow error, the rotations that the stars share are weighed by it, and by its white noise
//! where it has that alone.
//!
//! Source: [M23] Fig. 4 for what a residual is.

use std::ops::Range;
use std::sync::Arc;

use block_regression::{BlockGrams, Folds};
use coloured_noise::CommonNoise;
use effects::Candidate;
use focal_plane::AttitudeSource;
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use crate::bins::Bins;
use crate::evidence::{Amplitudes, Evidence, Residuals};
use crate::motion::{Around, source};
use crate::situation::Situation;
use crate::star::by_star::by_star;
use crate::star::changes;
use crate::star::columns::{CHUNK_FRAMES, StarColumns};
use crate::star::data::StarData;
use crate::star::frame_rotation::{rotation_of, rotation_row};
use crate::star::layout::Filled;
use crate::star::moments::{Keep, MOST_BINS, MOST_RESTLESS_BINS, StarMoments};
use crate::star::nuisance::StarNuisance;
use crate::star::reference_noise;
use crate::star::slow_price::SlowPrice;
use crate::star::weights;

/// Blocks of which those of a long run are made where fewer do.
const JOINED: usize = 3;
/// Chunks of frames whose shifts are held at once.
const SHIFTED: usize = 256;

/// Star measurements as evidence.
#[derive(Clone)]
pub(crate) struct StarEvidence<'a> {
    pub(crate) data: &'a StarData,
    pub(crate) nuisance: StarNuisance,
    /// Residual variants: one, or one a fold and a last one for all data.
    pub(crate) residuals: Arc<Vec<[Vec<f64>; 2]>>,
    pub(crate) motion: Option<&'a dyn AttitudeSource>,
    /// Whether the motion is known between the samples, not attitudes alone.
    pub(crate) resolved: bool,
    /// Whether what acts around a frame's time follows the samples around it, with their error.
    pub(crate) own_paths: bool,
    /// First guess of the noise of a centroid, per axis, arcsec.
    pub(crate) sigma_guess_arcsec: f64,
    /// Noise that the stars of a frame share; `None`: white.
    pub(crate) noise: Option<CommonNoise>,
    /// Weight of each row.
    pub(crate) weight: Arc<Vec<f64>>,
    /// Where the reference has white noise: [`reference_noise::White`].
    pub(crate) drawn: Option<[f64; 3]>,
    /// What a slow error of the reference pays.
    pub(crate) slow_price: SlowPrice,
    /// What is in every fit, described but not named: nuisance without a prior.
    pub(crate) kept: Vec<Arc<dyn Candidate>>,
}

impl<'a> StarEvidence<'a> {
    /// `residuals` against the declared model, under white noise.
    pub(crate) fn new(
        data: &'a StarData,
        situation: &Situation<'_>,
        residuals: Vec<[Vec<f64>; 2]>,
        motion: Option<&'a Around>,
    ) -> Self {
        let temporal = situation.model.noise.temporal_arcsec.filter(|s| *s > 0.0);
        // where windows are sent, centroids are formed anew, with another noise
        let (weight, white) = if situation.windows.is_some() {
            (vec![1.0; data.t_s.len()], None)
        } else {
            let changes = changes::of(data);
            let weight = weights::of(data, &changes);
            let white = reference_noise::white(data, &changes, &weight);
            (weight, white)
        };
        Self {
            data,
            nuisance: StarNuisance::declared(situation.model, data),
            residuals: Arc::new(residuals),
            motion: source(motion),
            resolved: motion.is_some_and(Around::resolved),
            own_paths: motion.is_some_and(Around::has_own_paths),
            // circular to per axis
            sigma_guess_arcsec: temporal.map_or(1.0, |s| s / std::f64::consts::SQRT_2),
            noise: None,
            weight: Arc::new(weight),
            drawn: white.and_then(|white| white.precision),
            slow_price: SlowPrice::of(situation, white.as_ref()),
            kept: Vec::new(),
        }
    }

    /// The folds in fewer blocks, where the run is long.
    pub(crate) fn coarser(&self, folds: &Folds) -> Option<Folds> {
        self.data.is_long().then(|| folds.coarser(JOINED))
    }

    /// Whether the centroids were learned outside each fold.
    pub(crate) fn learned(&self) -> bool {
        self.residuals.len() > 1
    }

    /// The same evidence under a noise that frames share.
    pub(crate) fn with_noise(&self, noise: &CommonNoise) -> Self {
        Self {
            sigma_guess_arcsec: 1.0,
            noise: Some(*noise),
            ..self.clone()
        }
    }

    /// What a variance of 1 of its scalars is, arcsec^2 of rows of weight 1.
    pub(crate) fn unit_arcsec2(&self) -> f64 {
        self.noise.map_or(1.0, |n| n.centroid * n.centroid)
    }

    /// The same evidence with `kept` in every fit.
    pub(crate) fn keeping(&self, kept: &[Arc<dyn Candidate>]) -> Self {
        Self {
            kept: kept.to_vec(),
            ..self.clone()
        }
    }

    /// What is kept, then `candidates`.
    pub(super) fn all<'b>(&'b self, candidates: &[&'b dyn Candidate]) -> Vec<&'b dyn Candidate> {
        let kept = self.kept.iter().map(AsRef::as_ref);
        kept.chain(candidates.iter().copied()).collect()
    }

    /// One pass over the data that serves every noise.
    pub(crate) fn moments(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> StarMoments {
        self.moments_keeping(folds, candidates, |bins| Keep::Bins(bins))
    }

    /// The same, with every frame's moments where there is room.
    pub(crate) fn moments_by_frame(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
    ) -> StarMoments {
        self.moments_keeping(folds, candidates, |bins| Keep::BinsAndFrames(bins))
    }

    /// What candidates that turn the camera turn the frames of each block by, arcsec: three rows a frame.
    pub(crate) fn turns(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> Vec<DMatrix<f64>> {
        let columns = self.bare_columns(candidates);
        let blocks = folds.blocks.par_iter();
        blocks.map(|frames| columns.turns(frames.clone())).collect()
    }

    fn moments_keeping(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        keep: impl for<'k> Fn(&'k Bins) -> Keep<'k>,
    ) -> StarMoments {
        let most = match self.drawn {
            Some(_) => MOST_RESTLESS_BINS,
            None => MOST_BINS,
        };
        let bins = Bins::cut(&self.data.frames.t_s, folds, most);
        let all = self.all(candidates);
        StarMoments::accumulate(&self.columns(&all), folds, keep(&bins))
    }

    /// All of these products under its noise, or white.
    pub(crate) fn under(&self, moments: &StarMoments) -> BlockGrams {
        self.under_of(moments, &(0..moments.width()).collect::<Vec<_>>())
    }

    /// Those of some of the columns.
    pub(crate) fn under_of(&self, moments: &StarMoments, columns: &[usize]) -> BlockGrams {
        match &self.noise {
            Some(noise) => moments.under(columns, noise),
            None => moments.white_of(columns),
        }
    }

    fn columns<'b>(&'b self, candidates: &'b [&'b dyn Candidate]) -> StarColumns<'b> {
        StarColumns {
            data: self.data,
            nuisance: &self.nuisance,
            candidates,
            residuals: &self.residuals,
            motion: self.motion,
            weight: &self.weight,
        }
    }

    /// The same without residuals.
    pub(super) fn bare_columns<'b>(
        &'b self,
        candidates: &'b [&'b dyn Candidate],
    ) -> StarColumns<'b> {
        StarColumns {
            residuals: &[],
            ..self.columns(candidates)
        }
    }

    /// The residual variant of a fold.
    pub(super) fn residual(&self, fold: usize) -> &[Vec<f64>; 2] {
        &self.residuals[if self.residuals.len() == 1 { 0 } else { fold }]
    }

    /// As [`Evidence::residuals`], of several amplitudes in one pass.
    pub(crate) fn residuals_of<const N: usize>(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: [&Amplitudes; N],
    ) -> [Residuals; N] {
        let data = self.data;
        let all = self.all(candidates);
        let columns = self.bare_columns(&all);
        let layout = columns.layout();
        let rows = data.t_s.len();
        let mut out = amplitudes.map(|_| Residuals {
            axes: vec![vec![0.0; rows]; 2],
            modelled: vec![vec![0.0; rows]; 2],
        });
        let whole: Vec<[DVector<f64>; N]> = (0..folds.count)
            .map(|f| amplitudes.map(|a| a.of_fold(f)))
            .collect();
        let chunks = chunks_of(folds);
        let shift = |filled: &mut Filled, (fold, frames): &(usize, Range<usize>)| {
            columns.fill(frames.clone(), &layout, filled);
            let each = whole[*fold].each_ref();
            each.map(|whole| columns.shift(frames.clone(), &layout, filled, whole))
        };
        // some at a time: all would be as large again as what comes of them
        let shifts = chunks.chunks(SHIFTED).flat_map(|some| {
            let shifts = some.par_iter().map_init(Filled::default, shift);
            shifts.collect::<Vec<[[DVector<f64>; 2]; N]>>()
        });
        for ((fold, frames), shifts) in chunks.iter().zip(shifts) {
            let first = data.frames.first_row[frames.start];
            for (out, shift) in out.iter_mut().zip(shifts) {
                for axis in 0..2 {
                    for (i, s) in shift[axis].iter().enumerate() {
                        out.modelled[axis][first + i] = *s;
                        out.axes[axis][first + i] = self.residual(*fold)[axis][first + i] - s;
                    }
                }
                if data.free_attitude {
                    for frame in frames.clone() {
                        remove_attitude(data, frame, &mut out.axes);
                    }
                }
            }
        }
        out
    }
}

impl Evidence for StarEvidence<'_> {
    fn precision(&self) -> DMatrix<f64> {
        let own = self.nuisance.precision();
        let kept: usize = self.kept.iter().map(|c| c.coefficients().len()).sum();
        let all = own.nrows() + kept;
        own.resize(all, all, 0.0)
    }

    fn relative(&self) -> Range<usize> {
        if self.data.free_attitude {
            self.nuisance.directions()
        } else {
            0..0
        }
    }

    fn residual_columns(&self) -> usize {
        self.residuals.len()
    }

    fn variance_guess(&self) -> f64 {
        self.sigma_guess_arcsec * self.sigma_guess_arcsec
    }

    fn grams(&self, folds: &Folds, candidates: &[&dyn Candidate]) -> BlockGrams {
        if self.noise.is_some() {
            return self.under(&self.moments(folds, candidates));
        }
        let keep = match self.drawn {
            _ if self.data.free_attitude => Keep::Free,
            Some(precision) => Keep::Drawn(precision),
            None => Keep::None,
        };
        let all = self.all(candidates);
        let columns = self.columns(&all);
        BlockGrams {
            by_source: by_star(&columns, folds),
            ..StarMoments::accumulate(&columns, folds, keep).white()
        }
    }

    fn residuals(
        &self,
        folds: &Folds,
        candidates: &[&dyn Candidate],
        amplitudes: &Amplitudes,
    ) -> Residuals {
        let noise = self.noise.as_ref();
        let told = noise.map(|noise| self.to_predict(noise, folds, candidates, amplitudes));
        let amplitudes = told.as_ref().unwrap_or(amplitudes);
        let [out] = self.residuals_of(folds, candidates, [amplitudes]);
        out
    }

    fn distance(&self, one: &dyn Candidate, other: &dyn Candidate, values: &[f64]) -> f64 {
        let both = [one, other];
        self.bare_columns(&both).distance(values) / self.unit_arcsec2()
    }
}

/// Frames of each fold, some at a time.
pub(super) fn chunks_of(folds: &Folds) -> Vec<(usize, Range<usize>)> {
    let each = folds.fold_ranges().into_iter().enumerate();
    let chunks = each.flat_map(|(fold, frames)| {
        let end = frames.end;
        let starts = frames.step_by(CHUNK_FRAMES);
        starts.map(move |at| (fold, at..(at + CHUNK_FRAMES).min(end)))
    });
    chunks.collect()
}

/// Takes from a frame's residuals the rotation that its stars (outliers aside)
/// agree on; a frame whose attitude cannot be solved has no residual: NaN.
fn remove_attitude(data: &StarData, frame: usize, residual: &mut [Vec<f64>]) {
    let theta = rotation_of(data, frame, residual);
    for row in data.frames.rows_of(frame) {
        let jacobian = rotation_row(data, row);
        for axis in 0..2 {
            residual[axis][row] = theta.map_or(f64::NAN, |t| {
                residual[axis][row] - Vector3::from(jacobian[axis]).dot(&t)
            });
        }
    }
}
