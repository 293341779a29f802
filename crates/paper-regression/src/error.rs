//! What can go wrong.

/// An error of the regression.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PaperError {
    /// A scenario cannot be simulated.
    #[error(transparent)]
    Scenario(#[from] scenarios::ScenarioError),
    /// A fit failed.
    #[error(transparent)]
    Fogm(#[from] fogm_fit::FogmError),
    /// A spectrum cannot be made.
    #[error(transparent)]
    Spectra(#[from] spectra::SpectraError),
    /// A tracker model cannot be made.
    #[error(transparent)]
    Tracker(#[from] star_tracker::TrackerError),
    /// A distortion field cannot be drawn.
    #[error(transparent)]
    Distortion(#[from] distortion::DistortionError),
    /// An assessment cannot be made.
    #[error(transparent)]
    Assess(#[from] assess::AssessError),
    /// A frame has no attitude.
    #[error("frame {frame} of {name} has no attitude")]
    NoAttitude {
        /// Which trial.
        name: String,
        /// Which frame.
        frame: usize,
    },
    /// A preset is not of the kind that a claim is about.
    #[error("preset {name} has {what}")]
    Preset {
        /// Which preset.
        name: String,
        /// What is wrong with it.
        what: &'static str,
    },
}
