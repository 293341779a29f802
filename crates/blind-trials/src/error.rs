//! What can go wrong.

/// An error of the trials.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BlindError {
    /// A folder or file cannot be read.
    #[error("{file}: {reason}")]
    Read {
        /// Which.
        file: String,
        /// What the operating system says.
        reason: String,
    },
    /// A world does not say with which model its loop is closed.
    #[error("{world}: [truth] names no model")]
    NoModel {
        /// Which world.
        world: String,
    },
    /// A world cannot be rendered.
    #[error("{world}: {reason}")]
    Imager {
        /// Which world.
        world: String,
        /// Why.
        reason: Box<imager::ImagerError>,
    },
    /// A scenario, or the motion of a world, is wrong.
    #[error(transparent)]
    Scenario(#[from] scenarios::ScenarioError),
    /// A model cannot be read.
    #[error(transparent)]
    Telemetry(#[from] telemetry::TelemetryError),
    /// The loop gave up.
    #[error("{world}, seed {seed}: {reason}")]
    Close {
        /// Which world.
        world: String,
        /// Which seed, from 0.
        seed: u64,
        /// Why.
        reason: Box<closed_loop::CloseError>,
    },
    /// No trial has such a name.
    #[error("no world is called {name}; there are {known}")]
    NoWorld {
        /// What was asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// Threads cannot be started.
    #[error("cannot start a thread: {0}")]
    Threads(String),
}
