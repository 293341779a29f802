//! All trials, over all seeds, on some threads.
//!
//! Each task is worked on by one thread, and its result put where it belongs: the numbers do not depend
//! on how many there are.
//!
//! Not physics: the order of the work.

use std::io::Write as _;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use telemetry::{Output, TableFormat};

use crate::residual::Residuals;
use crate::settings::silent;
use crate::{BlindError, Floor, Score, Trial, score};

/// How much is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan<'a> {
    /// Seeds of a trial; one with windows has a quarter, at least one, and a simulated one four times as
    /// many: what happens once in a hundred has to be counted.
    pub seeds: u64,
    /// Threads.
    pub jobs: usize,
    /// Folder that every bundle is kept in, with the model that its loop is closed with, if any.
    pub keep: Option<&'a Path>,
}

impl Plan<'_> {
    /// Seeds of one trial.
    #[must_use]
    pub fn seeds_of(&self, trial: &Trial) -> u64 {
        if trial.has_images() {
            (self.seeds / 4).max(1)
        } else if trial.world().is_none() {
            4 * self.seeds
        } else {
            self.seeds
        }
    }
}

/// Scores of one trial, seed by seed.
pub type Done = Vec<Score>;

/// Closes the loop on every seed of every trial and scores it; `progress` hears how many are done, of how
/// many.
///
/// # Errors
///
/// The first, in the order of trials and seeds, that a rendering, the loop or a bundle's file gives.
pub fn run(
    trials: &[Trial],
    plan: Plan<'_>,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<Done>, BlindError> {
    let mut tasks: Vec<(usize, u64)> = Vec::new();
    for (k, trial) in trials.iter().enumerate() {
        tasks.extend((0..plan.seeds_of(trial)).map(|seed| (k, seed)));
    }
    // what takes long goes first, so that no thread is left with it at the end
    let mut order: Vec<usize> = (0..tasks.len()).collect();
    order.sort_by_key(|&at| !trials[tasks[at].0].has_images());
    let results: Mutex<Vec<Option<Result<Score, BlindError>>>> =
        Mutex::new(tasks.iter().map(|_| None).collect());
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || -> Result<(), BlindError> {
        // the crates below use the threads of the pool that calls them: one each
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|e| BlindError::Threads(e.to_string()))?;
        loop {
            let Some(&at) = order.get(next.fetch_add(1, Ordering::Relaxed)) else {
                return Ok(());
            };
            let (k, seed) = tasks[at];
            let result = pool.install(|| one(&trials[k], seed, plan.keep));
            if let Ok(mut results) = results.lock() {
                results[at] = Some(result);
            }
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, tasks.len());
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..plan.jobs.max(1)).map(|_| scope.spawn(work)).collect();
        threads.into_iter().try_for_each(|thread| {
            let ended = thread.join();
            ended.unwrap_or_else(|_| Err(BlindError::Threads("it panicked".to_owned())))
        })
    })?;
    let results = results.into_inner().unwrap_or_default();
    let mut out: Vec<Done> = trials.iter().map(|_| Vec::new()).collect();
    for (&(k, _), result) in tasks.iter().zip(results) {
        out[k].extend(result.transpose()?);
    }
    Ok(out)
}

fn one(trial: &Trial, seed: u64, keep: Option<&Path>) -> Result<Score, BlindError> {
    let bundle = trial.bundle(seed)?;
    if let Some(folder) = keep {
        let folder = folder.join(format!("{}.{seed}", trial.name));
        let output = Output::new(&folder)?;
        bundle.write_to(&output, TableFormat::Parquet)?;
        let model = trial.model.to_toml();
        output.write("model.toml", |to| to.write_all(model.as_bytes()))?;
        output.commit()?;
    }
    // all that the loop is given
    let closed = closed_loop::close(&trial.model, &bundle, &|_| ());
    let closed = closed.map_err(|reason| BlindError::Close {
        world: trial.name.clone(),
        seed,
        reason: Box::new(reason),
    })?;
    let mut floor = None;
    if let (Some(world), Some(figures)) = (trial.world(), &closed.stars) {
        let clean = world.render(&silent(&world.instrument), seed)?;
        if let (Some(noisy), Some(clean)) = (Residuals::of(&bundle), Residuals::of(&clean)) {
            floor = Floor::of(&noisy, &clean, figures);
        }
    }
    Ok(score(&closed.report, &trial.truth, floor))
}
