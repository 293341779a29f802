//! What a bundle does not determine, in words.
//!
//! Not physics: the tables that are there, and what has to be estimated without the others.

use telemetry::{Bundle, Model};

use crate::error::CloseError;

/// The same error, and of unknowns that cannot be told apart what they are.
pub(crate) fn in_words(error: CloseError, model: &Model, bundle: &Bundle) -> CloseError {
    if !matches!(error, CloseError::Singular) {
        return error;
    }
    let mut unknown = Vec::new();
    let (table, rows, frames) = match (&bundle.stars, &bundle.attitude) {
        (Some(stars), _) => {
            match &bundle.reference {
                None => unknown.push("the attitude of every frame (no table reference)"),
                Some(_) => unknown.push("the misalignment to table reference"),
            }
            if bundle.catalog.is_none() {
                unknown.push("the direction of every star (no table catalog)");
            }
            ("stars", stars.rows(), stars.frames())
        }
        (None, attitude) => {
            unknown.push("the misalignment to table reference");
            let rows = attitude.as_ref().map_or(0, |a| a.t_s.len());
            ("attitude", rows, rows)
        }
    };
    let distortion = model.noise.distortion_arcsec;
    if bundle.stars.is_some() && distortion.is_some_and(|size| size > 0.0) {
        unknown.push("the distortion that the model declares");
    }
    CloseError::Undetermined {
        table,
        rows,
        frames,
        unknown: unknown.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use focal_plane::StarFrames;

    #[test]
    fn what_is_missing_is_said() {
        let mut stars = StarFrames::new();
        stars.begin(0.0);
        stars.push(1, 17, 10.0, 20.0);
        stars.push(2, 18, 30.0, 20.0);
        let bundle = Bundle {
            stars: Some(stars),
            ..Bundle::default()
        };
        let told = in_words(CloseError::Singular, &Model::default(), &bundle).to_string();
        for part in [
            "table stars",
            "2 rows in 1 frames",
            "no table reference",
            "no table catalog",
        ] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
