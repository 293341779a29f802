//! What can go wrong between a bundle and its report.

use focal_plane::CameraError;
use thiserror::Error;

/// Why the loop cannot be closed on this input.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CloseError {
    /// The files themselves are bad.
    #[error(transparent)]
    Telemetry(#[from] telemetry::TelemetryError),
    /// A declared effect cannot be built.
    #[error(transparent)]
    Effect(#[from] effects::EffectError),
    /// Model and bundle describe different cameras.
    #[error(
        "the model's tracker and the bundle's differ: {what} is {model} in the model, {bundle} in the bundle"
    )]
    TrackersDiffer {
        /// The quantity.
        what: &'static str,
        /// As the model has it.
        model: f64,
        /// As the bundle has it.
        bundle: f64,
    },
    /// What model and bundle say of the camera makes none together.
    #[error("the model's tracker over the bundle's: {0}")]
    Camera(#[from] CameraError),
    /// Neither model nor bundle says what the camera is.
    #[error(
        "neither the model nor the bundle gives the tracker's pixels and focal length (or field of view)"
    )]
    NoCamera,
    /// Nothing can be compared with anything.
    #[error("nothing to compare: {0}")]
    NothingToCompare(&'static str),
    /// Too little is left after rows were set aside.
    #[error("table {table}: {frames} usable frames of at least {need} needed ({why})")]
    TooFewFrames {
        /// The table of what was measured.
        table: &'static str,
        /// Frames that remain.
        frames: usize,
        /// The least that is needed.
        need: usize,
        /// Where the others went.
        why: &'static str,
    },
    /// No rows are left of the stars.
    #[error(
        "table stars: of {rows} rows those of {frames} frames are left, and {need} frames are needed at least: {where_to}"
    )]
    NoRowsLeft {
        /// Rows of the table.
        rows: usize,
        /// Frames that have some left.
        frames: usize,
        /// The least that is needed.
        need: usize,
        /// Where the others went.
        where_to: String,
    },
    /// Nothing was measured while the reference was there.
    #[error(
        "table {what} spans {} to {} s and table reference {} to {} s: they have no time in common", measured_s[0], measured_s[1], reference_s[0], reference_s[1]
    )]
    NoOverlap {
        /// The table of what was measured.
        what: &'static str,
        /// Its first and last time, s.
        measured_s: [f64; 2],
        /// Those of the reference, s.
        reference_s: [f64; 2],
    },
    /// The reference's quaternions are in another convention.
    #[error(
        "table {table}, columns qx, qy, qz, qw: these attitudes are {given_deg:.3} deg from table {what}; read as {are} they are {angle_deg:.3} deg from it; expected inertial to tracker, v_tracker = q v_inertial, with the scalar in qw"
    )]
    Convention {
        /// The table that is, or one of the two that may be.
        table: &'static str,
        /// The one that it is held against.
        what: &'static str,
        /// Median angle from it, deg.
        given_deg: f64,
        /// What they seem to be.
        are: &'static str,
        /// Median angle if they are, deg.
        angle_deg: f64,
    },
    /// The stars, or the catalogue, are in another convention.
    #[error(
        "{columns}: the stars of a frame are {given_deg:.3} deg from those of the catalogue, at the attitude that suits them best; read as {are} they are {angle_deg:.3} deg from them; expected {expected}"
    )]
    StarConvention {
        /// Table and columns.
        columns: &'static str,
        /// What they seem to hold.
        are: &'static str,
        /// What the format has there.
        expected: &'static str,
        /// Median angle from the catalogue, deg.
        given_deg: f64,
        /// Median angle if they are that, deg.
        angle_deg: f64,
    },
    /// A declared effect on raw images that are there.
    #[error(
        "the model declares `{id}`, and the bundle has raw images: centroids with a declared map or spot taken off cannot be formed yet; leave the entry out of the model, and it is estimated anew, or the table `images` out of the bundle, whose centroids then stand as they are"
    )]
    DeclaredOnImages {
        /// The effect.
        id: String,
    },
    /// A hypothesis that the catalogue does not have.
    #[error("`{id}` is no effect of the catalogue, which has: {known}")]
    UnknownHypothesis {
        /// What was asked about.
        id: String,
        /// All ids.
        known: String,
    },
    /// The declared unknowns cannot be solved for.
    #[error(
        "the declared unknowns cannot be estimated from this data: the normal equations are singular"
    )]
    Singular,
    /// The same, with what they are.
    #[error(
        "table {table}: {rows} rows in {frames} frames do not determine what has to be estimated from them: {unknown}"
    )]
    Undetermined {
        /// The table of what was measured.
        table: &'static str,
        /// Its rows.
        rows: usize,
        /// Its instants.
        frames: usize,
        /// What is not known, with the tables that would tell it.
        unknown: String,
    },
}

impl CloseError {
    /// Whether it is about what the bundle holds, or does not.
    #[must_use]
    pub fn is_of_bundle(&self) -> bool {
        matches!(
            self,
            Self::TooFewFrames { .. }
                | Self::NoRowsLeft { .. }
                | Self::NoOverlap { .. }
                | Self::NothingToCompare(_)
                | Self::Convention { .. }
                | Self::StarConvention { .. }
                | Self::TrackersDiffer { .. }
                | Self::Camera(_)
                | Self::NoCamera
                | Self::Undetermined { .. }
        )
    }
}
