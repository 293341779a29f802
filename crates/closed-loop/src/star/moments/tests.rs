//! The one pass against dense algebra on every row.

use crate::declared::OnCentroids;
use coloured_noise::Coloured;
use effects::{AttitudeRows, Candidate, Coefficient, Effect, EffectError, StarRows, Surroundings};
use focal_plane::{ARCSEC_PER_RAD, Camera, Pixel, PointsMut, StarFrames, VectorsMut};
use telemetry::Model;

use super::*;
use crate::search::empirical::{Empirical, Variable};
use crate::star::data::{Inputs, StarData};
use crate::star::frame_rotation::rotation_row;
use crate::star::layout::Filled;
use crate::star::nuisance::StarNuisance;

/// The camera turns about an axis by a function of time.
#[derive(Debug)]
struct Turn {
    coefficients: Vec<Coefficient>,
    /// Told as what it is, or row by row.
    whole: bool,
    at: fn(f64) -> f64,
}

impl Turn {
    fn by(at: fn(f64) -> f64, whole: bool) -> Self {
        Self {
            coefficients: ["x", "y", "z"]
                .map(|n| Coefficient::new(n, "arcsec", 1.0))
                .to_vec(),
            whole,
            at,
        }
    }

    fn wave(t_s: f64) -> f64 {
        (0.9 * t_s).sin() + 0.1 * t_s
    }
}

impl Candidate for Turn {
    fn id(&self) -> &'static str {
        "turn"
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        true
    }
    fn turns_camera(&self) -> bool {
        self.whole
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let n = rows.len();
        for i in 0..n {
            let [x, y] = camera.rotation_jacobian(Pixel {
                x: rows.x_px[i],
                y: rows.y_px[i],
            });
            for axis in 0..3 {
                let g = (self.at)(rows.t_s[i]) / ARCSEC_PER_RAD;
                out.x[axis * n + i] = x[axis] * g;
                out.y[axis * n + i] = y[axis] * g;
            }
        }
        true
    }
    fn attitude_columns(&self, rows: &AttitudeRows<'_>, out: VectorsMut<'_>) -> bool {
        let n = rows.len();
        for (k, t) in rows.t_s.iter().enumerate() {
            let g = (self.at)(*t) / ARCSEC_PER_RAD;
            out.x[k] = g;
            out.y[n + k] = g;
            out.z[2 * n + k] = g;
        }
        true
    }
    fn realise(&self, _: &[f64], _: &Surroundings<'_>) -> Result<Box<dyn Effect>, EffectError> {
        Err(EffectError::UnknownEffect {
            id: "turn".to_owned(),
            nearest: String::new(),
        })
    }
}

/// Stars that drift, their number changing, one row an outlier; `single`: frames of one star. In a long run the
/// last star comes late, so that its columns are zero in the first rows of a block.
fn data(single: bool, number: usize) -> StarData {
    let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
    let mut frames = StarFrames::new();
    for k in 0..number {
        let t = 0.5 * k as f64 + if k > 25 { 3.0 } else { 0.0 };
        frames.begin(t);
        let late = number > 100 && k < 20;
        let stars = if late || k % 7 == 3 { 4 } else { 5 };
        for s in 0..stars {
            let angle = 1.3 * f64::from(s);
            frames.push(
                s,
                i64::from(s) + 10,
                (90.0 + 70.0 * f64::from(s)) * angle.cos() + 0.8 * t,
                (90.0 + 70.0 * f64::from(s)) * angle.sin() - 1.1 * t,
            );
        }
    }
    let mut data = StarData::prepare(&Inputs {
        camera: &camera,
        frames: &frames,
        reference: None,
        catalogue: None,
        phase: &OnCentroids::default(),
        effects: &[],
    });
    data.free_attitude = false;
    data.free_directions = false;
    data.outlier[17] = true;
    if single {
        for frame in [5, 31] {
            for row in data.frames.rows_of(frame).skip(1) {
                data.outlier[row] = true;
            }
        }
    }
    data
}

/// Weights that differ from row to row.
fn weights(data: &StarData) -> Vec<f64> {
    (0..data.t_s.len())
        .map(|r| 0.7 + 0.15 * (r % 5) as f64)
        .collect()
}

/// Every column of every row that counts, x and y of a row together, and the rotation
/// columns of each, weighed.
fn dense(columns: &StarColumns<'_>) -> (DMatrix<f64>, Vec<(usize, Vector3<f64>)>) {
    let data = columns.data;
    let layout = columns.layout();
    let mut filled = Filled::default();
    columns.fill(0..data.frames.frames(), &layout, &mut filled);
    let mut lines = Vec::new();
    let mut turns = Vec::new();
    for frame in 0..data.frames.frames() {
        for row in data.frames.rows_of(frame).filter(|&r| !data.outlier[r]) {
            for axis in 0..2 {
                let mut line = vec![0.0; layout.width()];
                for k in 0..layout.shared {
                    line[layout.shared_at(k, axis)] = filled.shared[(k, row)];
                }
                for (k, &place) in layout.own.iter().enumerate() {
                    line[place] = filled.own[axis][(row, k)];
                }
                let weight = columns.weight[row];
                line.iter_mut().for_each(|v| *v *= weight);
                lines.push(line);
                turns.push((frame, weight * Vector3::from(rotation_row(data, row)[axis])));
            }
        }
    }
    let c = DMatrix::from_fn(lines.len(), layout.width(), |i, j| lines[i][j]);
    (c, turns)
}

/// Runs `check` on the pass and on the same columns row by row.
fn with_both(
    single: bool,
    check: impl Fn(&StarMoments, &DMatrix<f64>, &[(usize, Vector3<f64>)], &StarData),
) {
    with_blocks(single, 40, Folds::cut, check);
}

/// As [`with_both`], of so many frames in the blocks of these folds.
fn with_blocks(
    single: bool,
    frames: usize,
    folds: impl Fn(usize) -> Folds,
    check: impl Fn(&StarMoments, &DMatrix<f64>, &[(usize, Vector3<f64>)], &StarData),
) {
    with_pass(single, frames, folds, None, check);
}

/// As [`with_blocks`], of rotations with a prior of this precision, where there is one.
fn with_pass(
    single: bool,
    frames: usize,
    folds: impl Fn(usize) -> Folds,
    drawn: Option<[f64; 3]>,
    check: impl Fn(&StarMoments, &DMatrix<f64>, &[(usize, Vector3<f64>)], &StarData),
) {
    let data = data(single, frames);
    let model = Model::parse(
        "format = \"boresight-model/1\"\n[tracker]\npixels = [1024, 1024]\nfov_deg = [20.0, 20.0]\n\
         [noise]\ntemporal_arcsec = 7.0\ndistortion_arcsec = 3.0\ndistortion_order = 2\n",
        "model.toml",
        &[],
    )
    .unwrap();
    let nuisance = StarNuisance::declared(&model, &data);
    let ids = data.stars.iter().map(|s| s.id).collect();
    let sparse = Empirical::new(Variable::Star(ids), [0.0, 1.0], true).unwrap();
    let [whole, rowwise] = [true, false].map(|whole| Turn::by(Turn::wave, whole));
    let residual: [Vec<f64>; 2] = std::array::from_fn(|axis| {
        (0..data.t_s.len())
            .map(|r| (1.7 * r as f64 + axis as f64).sin() + 0.2)
            .collect()
    });
    let residuals = [residual];
    let [second, both] =
        [&[2][..], &[1, 2]].map(|orders| effects::harmonics_of(&data.camera, orders));
    let one: [&dyn Candidate; 4] = [&whole, &*second, &sparse, &*both];
    let two: [&dyn Candidate; 4] = [&rowwise, &*second, &sparse, &*both];
    let weight = weights(&data);
    let columns = |candidates| StarColumns {
        data: &data,
        nuisance: &nuisance,
        candidates,
        residuals: &residuals,
        motion: None,
        weight: &weight,
    };
    let folds = folds(data.frames.frames());
    let bins = Bins::cut(&data.frames.t_s, &folds, MOST_BINS);
    let keep = drawn.map_or(Keep::Bins(&bins), Keep::Drawn);
    let moments = StarMoments::accumulate(&columns(&one), &folds, keep);
    let (c, turns) = dense(&columns(&two));
    check(&moments, &c, &turns, &data);
}

fn close(ours: &DMatrix<f64>, dense: &DMatrix<f64>) {
    let off = (ours - dense).norm() / dense.norm();
    assert!(off < 1e-11, "off by {off} of the whole");
}

/// Of several chunks, by weight, without outliers.
#[test]
fn two_forms_are_as_far_apart_as_their_columns() {
    let data = data(true, 171);
    let model = Model::parse(
        "format = \"boresight-model/1\"\n[noise]\ntemporal_arcsec = 7.0\n",
        "model.toml",
        &[],
    )
    .unwrap();
    let one = Empirical::new(Variable::Slot(vec![1, 2]), [0.0, 1.0], true).unwrap();
    let two = data.stars.iter().map(|s| s.id).take(2).collect();
    let other = Empirical::new(Variable::Star(two), [0.0, 1.0], true).unwrap();
    let candidates: [&dyn Candidate; 2] = [&one, &other];
    let columns = StarColumns {
        data: &data,
        nuisance: &StarNuisance::declared(&model, &data),
        candidates: &candidates,
        residuals: &[],
        motion: None,
        weight: &weights(&data),
    };
    let values = [0.3, -1.2, 0.7, 2.0];
    let (c, _) = dense(&columns);
    let first = c.ncols() - 2 * values.len();
    let apart = DVector::from_fn(c.nrows(), |i, _| {
        let each = values.iter().enumerate();
        each.map(|(j, v)| v * (c[(i, first + j)] - c[(i, first + values.len() + j)]))
            .sum::<f64>()
    });
    let (ours, dense) = (columns.distance(&values), apart.norm_squared());
    assert!((ours - dense).abs() < 1e-11 * dense, "{ours} {dense}");
}

/// Sums of a thousand products: rounding alone.
#[test]
fn products_are_those_of_every_row() {
    for single in [false, true] {
        with_both(single, |moments, c, _, _| {
            let all: Vec<usize> = (0..moments.width()).collect();
            let (sum, scalars) = moments.white_of(&all).total();
            close(&sum, &(c.transpose() * c));
            assert!((scalars - c.nrows() as f64).abs() < 0.5);
            let some = [1, 4, 0, all.len() - 1];
            let (sum, _) = moments.white_of(&some).total();
            close(
                &sum,
                &(c.transpose() * c).select_rows(&some).select_columns(&some),
            );
        });
    }
}

/// A block of many chunks, of which the last is cut short, and more turns than are held at once.
#[test]
fn long_blocks_are_no_different() {
    let noise = CommonNoise {
        centroid: 4.0,
        reference: [Coloured {
            white: 0.5,
            slow: 1.5,
            tau_s: 8.0,
        }; 3],
    };
    for folds in [Folds::whole, Folds::cut] {
        with_blocks(true, 171, folds, |moments, c, _, _| {
            let all: Vec<usize> = (0..moments.width()).collect();
            let dense = c.transpose() * c;
            close(&moments.white_of(&all).total().0, &dense);
            close(&moments.white_in_all(&all).total().0, &dense);
            let some = [1, 4, 0, all.len() - 1];
            for columns in [&all[..], &some] {
                let blocks = moments.under(columns, &noise);
                let sum = moments.under_in_all(columns, &noise);
                close(&sum.total().0, &blocks.total().0);
                assert!((sum.total().1 - blocks.total().1).abs() < 1e-9);
                assert!((sum.log_scale - blocks.log_scale).abs() < 1e-9);
            }
        });
    }
}

/// The same of a reference with white noise alone, frame by frame: with frames of one star, and more frames
/// than are held at once.
#[test]
fn white_noise_of_a_reference_is_weighed_as_its_covariance_says() {
    let precision = [0.3, 5.0, 80.0];
    for (single, frames) in [(false, 40), (true, 171)] {
        with_pass(
            single,
            frames,
            Folds::cut,
            Some(precision),
            |moments, c, turns, _| {
                let covariance = DMatrix::from_fn(c.nrows(), c.nrows(), |i, j| {
                    let ((a, u), (b, v)) = (turns[i], turns[j]);
                    let shared = (0..3).map(|k| u[k] * v[k] / precision[k]).sum::<f64>();
                    f64::from(u8::from(i == j)) + if a == b { shared } else { 0.0 }
                });
                let factor = covariance.cholesky().unwrap();
                let grams = moments.clone().white();
                let (sum, scalars) = grams.total();
                close(&sum, &(c.transpose() * factor.solve(c)));
                assert!((scalars - c.nrows() as f64).abs() < 0.5);
                let half = 0.5 * factor.ln_determinant();
                assert!((grams.log_scale + half).abs() < 1e-9 * half);
            },
        );
    }
}

/// Noise of the stars and slow errors of the reference.
fn shared_noise() -> CommonNoise {
    CommonNoise {
        centroid: 4.0,
        reference: [(0.5, 1.5, 8.0), (0.0, 0.7, 2.0), (3.0, 9.0, 30.0)]
            .map(|(white, slow, tau_s)| Coloured { white, slow, tau_s }),
    }
}

/// Covariance of rows that see these rotations in these frames.
fn covariance(
    noise: &CommonNoise,
    turns: &[(usize, Vector3<f64>)],
    data: &StarData,
) -> DMatrix<f64> {
    DMatrix::from_fn(turns.len(), turns.len(), |i, j| {
        let ((a, u), (b, v)) = (turns[i], turns[j]);
        let apart = (data.frames.t_s[a] - data.frames.t_s[b]).abs();
        let shared = (0..3).map(|k| {
            let n = noise.reference[k];
            let white = if a == b { n.white * n.white } else { 0.0 };
            u[k] * v[k] * (white + n.slow * n.slow * (-apart / n.tau_s).exp())
        });
        let own = if i == j { noise.centroid.powi(2) } else { 0.0 };
        own + shared.sum::<f64>()
    })
}

/// The same of the rows of all folds but one, which knows nothing of them: with the covariance of those rows alone.
#[test]
fn a_fold_that_is_left_out_is_a_gap() {
    let noise = shared_noise();
    with_both(false, |moments, c, turns, data| {
        let folds = Folds::cut(data.frames.frames());
        let all: Vec<usize> = (0..moments.width()).collect();
        for (fold, frames) in folds.fold_ranges().into_iter().enumerate() {
            let other = |i: &usize| !frames.contains(&turns[*i].0);
            let rows: Vec<usize> = (0..c.nrows()).filter(other).collect();
            let turns: Vec<_> = rows.iter().map(|&i| turns[i]).collect();
            let factor = covariance(&noise, &turns, data).cholesky().unwrap();
            let c = c.select_rows(&rows);
            let mut grams = moments.under_without(&all, &noise, Some(fold));
            let mut blocks = folds.fold_of_block.iter().map(|of| *of != fold);
            grams.gram.retain(|_| blocks.next() == Some(true));
            grams.known = None;
            let (sum, _) = grams.total();
            close(&sum, &(c.transpose() * factor.solve(&c)));
        }
    });
}

/// Generalised least squares with the whole covariance of all rows; bins hold one frame
/// here, so that nothing is approximated. Its likelihood has the determinant too.
#[test]
fn noise_that_frames_share_is_weighed_as_its_covariance_says() {
    let noise = shared_noise();
    with_both(false, |moments, c, turns, data| {
        let factor = covariance(&noise, turns, data).cholesky().unwrap();
        let all: Vec<usize> = (0..moments.width()).collect();
        let grams = moments.under(&all, &noise);
        let (sum, scalars) = grams.total();
        close(&sum, &(c.transpose() * factor.solve(c)));
        assert!((scalars - c.nrows() as f64).abs() < 0.5);
        let half = 0.5 * factor.ln_determinant();
        assert!(
            (grams.log_scale + half).abs() < 1e-9 * half,
            "{}",
            grams.log_scale
        );
    });
}

/// With an attitude of its own for every frame: what no rotation of the frame explains,
/// frames of one star left out.
#[test]
fn a_free_attitude_leaves_what_no_rotation_explains() {
    for single in [false, true] {
        let data = data(single, 40);
        let nuisance = StarNuisance::declared(&Model::default(), &data);
        let residual: [Vec<f64>; 2] =
            std::array::from_fn(|a| data.modelled[a].iter().map(|v| (0.3 * v).sin()).collect());
        let columns = StarColumns {
            data: &data,
            nuisance: &nuisance,
            candidates: &[],
            residuals: &[residual],
            motion: None,
            weight: &weights(&data),
        };
        let folds = Folds::cut(data.frames.frames());
        let (sum, scalars) = StarMoments::accumulate(&columns, &folds, Keep::Free)
            .white()
            .total();
        let (c, turns) = dense(&columns);
        let (mut dense, mut count) = (DMatrix::zeros(c.ncols(), c.ncols()), 0);
        for frame in 0..data.frames.frames() {
            let rows: Vec<usize> = (0..turns.len()).filter(|&i| turns[i].0 == frame).collect();
            if rows.len() < 4 {
                continue;
            }
            let own = c.select_rows(&rows);
            let a = DMatrix::from_fn(rows.len(), 3, |i, k| turns[rows[i]].1[k]);
            let q = a.qr().q();
            let left = &own - &q * (q.transpose() * &own);
            dense += left.transpose() * &left;
            count += rows.len() - 3;
        }
        // the misalignment is a rotation: nothing of it is left, and no rounding of its sums
        assert!((0..3).all(|k| sum.column(k).norm() <= 0.0));
        let scale = c.norm_squared();
        assert!((sum - dense).norm() < 1e-11 * scale);
        assert!((scalars - count as f64).abs() < 0.5);
    }
}

/// What every star adds to the sums beside free attitudes is all of it: to rounding.
#[test]
fn parts_of_stars_are_the_whole() {
    let data = data(true, 40);
    let model = "format = \"boresight-model/1\"\n[noise]\ntemporal_arcsec = 7.0\n\
                 distortion_arcsec = 3.0\ndistortion_order = 2\n";
    let nuisance = StarNuisance::declared(&Model::parse(model, "model.toml", &[]).unwrap(), &data);
    let turn = Turn::by(Turn::wave, true);
    let waves = effects::harmonics_of(&data.camera, &[1, 2]);
    let candidates: [&dyn Candidate; 2] = [&turn, &*waves];
    let residual = std::array::from_fn(|axis| {
        let rows = 0..data.t_s.len();
        rows.map(|r| (1.7 * r as f64 + axis as f64).sin()).collect()
    });
    let weight = weights(&data);
    let columns = StarColumns {
        data: &data,
        nuisance: &nuisance,
        candidates: &candidates,
        residuals: &[residual],
        motion: None,
        weight: &weight,
    };
    let folds = Folds::cut(data.frames.frames());
    let whole = StarMoments::accumulate(&columns, &folds, Keep::Free).white();
    for count in [3, 5] {
        let parts = crate::star::by_star::parts(&columns, count);
        assert_eq!(parts.len(), count);
        let sum = BlockGrams {
            scalars: vec![0.0; count],
            gram: parts,
            ..whole.clone()
        };
        close(&sum.total().0, &whole.total().0);
    }
}

/// What turns the camera, put in place or beside the others by the moments of frames, is what another pass makes of it:
/// to rounding, white and under a slow error. A turn that every bin holds has nothing left in R. Bins of three frames.
#[test]
fn what_turns_the_camera_needs_no_other_pass() {
    let data = data(false, 171);
    let model = "format = \"boresight-model/1\"\n[noise]\ntemporal_arcsec = 7.0\n\
                 distortion_arcsec = 3.0\ndistortion_order = 2\n";
    let nuisance = StarNuisance::declared(&Model::parse(model, "model.toml", &[]).unwrap(), &data);
    let turns: [fn(f64) -> f64; 3] = [Turn::wave, |t_s| (1.7 * t_s).cos(), |_| 1.0];
    let [wave, faster, rest] = turns.map(|at| Turn::by(at, true));
    let waves = effects::harmonics_of(&data.camera, &[1, 2]);
    let residual = std::array::from_fn(|axis| {
        let rows = 0..data.t_s.len();
        rows.map(|r| (1.7 * r as f64 + axis as f64).sin()).collect()
    });
    let (weight, residuals) = (weights(&data), [residual]);
    let none = StarColumns {
        data: &data,
        nuisance: &nuisance,
        candidates: &[],
        residuals: &residuals,
        motion: None,
        weight: &weight,
    };
    let folds = Folds::cut(data.frames.frames());
    let bins = Bins::cut(&data.frames.t_s, &folds, 60);
    let pass = |candidates: &[&dyn Candidate]| {
        let columns = StarColumns { candidates, ..none };
        StarMoments::accumulate(&columns, &folds, Keep::BinsAndFrames(&bins))
    };
    let turned = |turn: &Turn| -> Vec<DMatrix<f64>> {
        let turning: [&dyn Candidate; 1] = [turn];
        let columns = StarColumns {
            candidates: &turning,
            ..none
        };
        let blocks = folds.blocks.iter();
        blocks.map(|b| columns.turns(b.clone())).collect()
    };
    let same = |ours: &StarMoments, other: &StarMoments| {
        let all: Vec<usize> = (0..other.width()).collect();
        let (a, b) = (ours.white_of(&all), other.white_of(&all));
        close(&a.total().0, &b.total().0);
        let noise = shared_noise();
        let (a, b) = (ours.under(&all, &noise), other.under(&all, &noise));
        close(&a.total().0, &b.total().0);
        assert!((a.total().1 - b.total().1).abs() < 0.5);
        assert!((a.log_scale - b.log_scale).abs() < 1e-9);
    };
    let first = none.layout().width() - 1;
    let before = pass(&[&wave, &*waves, &wave]);
    assert!(before.is_by_frame());
    for turn in [&faster, &rest] {
        let other = pass(&[turn, &*waves, &wave]);
        let which: Vec<usize> = (first..first + 3).collect();
        let ours = before.clone().with_turns(&which, &turned(turn));
        same(&ours, &other);
        // and once more, by the moments that were put in place
        let last = first + 3 + waves.coefficients().len();
        let which: Vec<usize> = (last..last + 3).collect();
        same(
            &ours.with_turns(&which, &turned(turn)),
            &pass(&[turn, &*waves, turn]),
        );
        let beside = before.narrowed(first, 1).beside_turns(1, &turned(turn));
        same(&beside, &pass(&[turn]));
        if std::ptr::eq(turn, &rest) {
            let nothing = DMatrix::from(beside.rest()).columns(first, 3).norm();
            assert!(nothing <= 0.0, "{nothing}");
        }
    }
}

/// Frames of one star have no rotation of their own: what they hold is in no frame's moments.
#[test]
fn frames_without_an_attitude_ask_for_another_pass() {
    let data = data(true, 40);
    let model = "format = \"boresight-model/1\"\n[noise]\ntemporal_arcsec = 7.0\n";
    let folds = Folds::cut(data.frames.frames());
    let bins = Bins::cut(&data.frames.t_s, &folds, MOST_BINS);
    let columns = StarColumns {
        data: &data,
        nuisance: &StarNuisance::declared(&Model::parse(model, "model.toml", &[]).unwrap(), &data),
        candidates: &[],
        residuals: &[[data.t_s.clone(), data.t_s.clone()]],
        motion: None,
        weight: &weights(&data),
    };
    let moments = StarMoments::accumulate(&columns, &folds, Keep::BinsAndFrames(&bins));
    assert!(!moments.is_by_frame());
}
