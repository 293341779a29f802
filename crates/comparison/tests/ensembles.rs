//! Models flown along simulated bundles: the model that made a bundle agrees with it, another one does not,
//! and the difference is where it should be.

use comparison::{CompareSettings, ComparisonError, FitSettings, compare, fit};
use scenarios::{Scenario, simulate};
use telemetry::report::{ComparedAxis, ComparedBand, StarSource};
use telemetry::{AttitudeTable, Bundle, HemAxes, HemAxis, Model, ModelKind};

type Done = Result<(), Box<dyn std::error::Error>>;

const SCENARIO: &str = r#"
format = "boresight-model/1"
kind = "pbm"
title = "a slow drift"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
update_rate_hz = 4.0
max_stars = 8
[noise]
temporal_arcsec = 7.0
centroid_arcsec = 6.0
distortion_arcsec = 3.0
[motion]
kind = "hold"
start = { ra_deg = 83.0, dec_deg = -1.0 }
drift_arcsec_s = [0.9, -0.6, 0.0]
[sky]
kind = "generated"
[run]
duration_s = 2000.0
seed = 5
[reference]
rate_hz = 4.0
"#;

fn made() -> Result<(Model, Bundle), Box<dyn std::error::Error>> {
    let scenario = Scenario::parse(SCENARIO, "drift.toml")?;
    let bundle = simulate(&scenario)?;
    Ok((scenario.model, bundle))
}

fn settings(draws: u64) -> CompareSettings {
    CompareSettings { draws, seed: 77 }
}

fn axes(of: &telemetry::report::ComparedModel) -> [&ComparedAxis; 3] {
    [&of.axes.x, &of.axes.y, &of.axes.z]
}

/// The hybrid model of `sigma_HSF`, `tau`, `sigma_TN` about every axis, else as `model`.
fn hybrid(model: &Model, [sigma_hsf_arcsec, tau_hsf_s, sigma_tn_arcsec]: [f64; 3]) -> Model {
    let one = HemAxis {
        sigma_hsf_arcsec,
        tau_hsf_s,
        sigma_tn_arcsec,
    };
    Model {
        kind: ModelKind::Hem,
        hem: Some(HemAxes {
            x: one,
            y: one,
            z: one,
        }),
        ..model.clone()
    }
}

/// Error of a band and its 1 sigma, dB.
fn error_of(band: &ComparedBand) -> Result<[f64; 2], Box<dyn std::error::Error>> {
    match (band.error_db, band.sigma_db) {
        (Some(error), Some(sigma)) => Ok([error, sigma]),
        _ => Err(format!("2000 s at 4 Hz reach every band: {band:?}").into()),
    }
}

/// The cost is the mean of some 35 squares of unit variance, 1 +- 0.35, with a long tail: the logarithm of a
/// density of two degrees of freedom is below -6 sigma once in 3000 bins (it is Gumbel's), which is one more
/// in the mean. Three such bins at once are 4; wrong models are above 10.
const COST: f64 = 4.0;

/// A bundle against the model that made it, other draws of it. Errors of bands are within 5 of their own sigma.
#[test]
fn a_bundle_agrees_with_the_model_that_made_it() -> Done {
    let (model, bundle) = made()?;
    let compared = compare(&model, &[], &bundle, &settings(100), &|_| ())?;
    assert_eq!(compared.report.model.stars, StarSource::Telemetry);
    for axis in axes(&compared.report.model) {
        assert!(
            (0.2..COST).contains(&axis.log_psd_cost),
            "{}",
            axis.log_psd_cost
        );
        assert!(axis.above_3_sigma < 0.2, "{}", axis.above_3_sigma);
        for band in &axis.bands {
            let [error, sigma] = error_of(band)?;
            assert!(error.abs() < 5.0 * sigma, "{band:?}");
        }
    }
    Ok(())
}

/// Half as much noise again is 10 log10 2.25 = 3.52 dB less of measured over modelled in the white band, and
/// known there to a tenth of a dB; the triangle's share leaves some of it out, at most a tenth.
#[test]
fn too_much_declared_noise_is_seen_where_it_is() -> Done {
    let (mut model, bundle) = made()?;
    model.noise.temporal_arcsec = Some(1.5 * 7.0);
    let compared = compare(&model, &[], &bundle, &settings(32), &|_| ())?;
    for axis in axes(&compared.report.model) {
        let white = axis.bands.last().ok_or("a last band")?;
        let [error, sigma] = error_of(white)?;
        assert!(
            (-3.52 - 5.0 * sigma..-3.0).contains(&error),
            "{error} +- {sigma}"
        );
        assert!(axis.log_psd_cost > 10.0, "{}", axis.log_psd_cost);
    }
    Ok(())
}

/// A hybrid model with distortion, beside the physical one: the distortion only adds, and the model beside
/// does not change the numbers of the first.
#[test]
fn models_stand_side_by_side() -> Done {
    let (model, bundle) = made()?;
    let hybrid = hybrid(&model, [0.01, 40.0, 0.2]);
    let alone = compare(&model, &[], &bundle, &settings(16), &|_| ())?;
    let both = compare(
        &model,
        std::slice::from_ref(&hybrid),
        &bundle,
        &settings(16),
        &|_| (),
    )?;
    assert_eq!(alone.report.model, both.report.model);
    assert_eq!(both.report.others.len(), 1);
    let flown = &both.models[1];
    let plain = flown
        .without_distortion
        .as_ref()
        .ok_or("without distortion")?;
    for axis in 0..3 {
        let (with, without) = (flown.axes[axis].mean(), plain[axis].mean());
        // the same noise in both: what is left is the distortion, at the low end
        assert!(
            with[0] > without[0],
            "axis {axis}: {} {}",
            with[0],
            without[0]
        );
        let last = with.len() - 1;
        assert!((with[last] / without[last] - 1.0).abs() < 0.05);
    }
    assert!(both.models[0].without_distortion.is_none());
    Ok(())
}

/// A bundle with attitude and reference alone: stars are made up, or taken from a catalogue where there is
/// one, and the white noise is that of the same number of stars within a factor of two.
#[test]
fn stars_are_found_where_the_bundle_has_none() -> Done {
    let (model, mut bundle) = made()?;
    bundle.stars = None;
    let by_catalogue = compare(&model, &[], &bundle, &settings(8), &|_| ())?;
    assert_eq!(by_catalogue.report.model.stars, StarSource::Catalogue);
    bundle.catalog = None;
    let made_up = compare(&model, &[], &bundle, &settings(8), &|_| ())?;
    assert_eq!(made_up.report.model.stars, StarSource::Generated);
    for axis in axes(&made_up.report.model).into_iter().take(2) {
        let white = axis.bands.last().and_then(|b| b.error_db).ok_or("error")?;
        assert!(white.abs() < 3.0, "{white}");
    }
    Ok(())
}

/// The reference's own error is part of the residual: 3 arcsec with 20 s are far above the model's noise at the
/// low end, and a model that declares them agrees again.
#[test]
fn an_error_of_the_reference_is_declared_or_seen() -> Done {
    let text =
        format!("{SCENARIO}wander_arcsec = [3.0, 3.0, 3.0]\nwander_tau_s = [20.0, 20.0, 20.0]\n");
    let scenario = Scenario::parse(&text, "drift.toml")?;
    let (mut model, bundle) = (scenario.model.clone(), simulate(&scenario)?);
    let without = compare(&model, &[], &bundle, &settings(32), &|_| ())?;
    let low = without.report.model.axes.x.bands[1]
        .error_db
        .ok_or("error")?;
    assert!(low > 6.0, "{low}");
    let declared = "format = \"boresight-model/1\"\nkind = \"pbm\"\n[[effect]]\nid = \"reference_error\"\nsigma_x_arcsec = 3\ntau_x_s = 20\nsigma_y_arcsec = 3\ntau_y_s = 20\nsigma_z_arcsec = 3\ntau_z_s = 20\n";
    model.effects = Model::parse(declared, "effect.toml", &[])?.effects;
    let with = compare(&model, &[], &bundle, &settings(100), &|_| ())?;
    assert!(with.report.notes.is_empty(), "{:?}", with.report.notes);
    for axis in axes(&with.report.model) {
        assert!(axis.log_psd_cost < COST, "{}", axis.log_psd_cost);
        for band in &axis.bands {
            let [error, sigma] = error_of(band)?;
            assert!(error.abs() < 5.0 * sigma, "{band:?}");
        }
    }
    Ok(())
}

/// One thread or four: the same numbers.
#[test]
fn threads_change_nothing() -> Done {
    let (model, bundle) = made()?;
    let with = |threads: usize| -> Result<_, Box<dyn std::error::Error>> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()?;
        Ok(pool.install(|| compare(&model, &[], &bundle, &settings(8), &|_| ()))?)
    };
    assert_eq!(with(1)?.report, with(4)?.report);
    Ok(())
}

/// A draw of the hybrid model has the spectrum of its own process: the variance of the draws is that of
/// FOGM and white noise, 16 draws of 8000 samples with some 2000 s / 80 s independent pieces each.
#[test]
fn a_hybrid_draw_has_the_variance_of_its_process() -> Done {
    let (model, bundle) = made()?;
    let hybrid = Model {
        noise: telemetry::ModelNoise::default(),
        ..hybrid(&model, [3.0, 10.0, 4.0])
    };
    let compared = compare(&hybrid, &[], &bundle, &settings(16), &|_| ())?;
    assert_eq!(compared.report.model.stars, StarSource::None);
    for axis in axes(&compared.report.model) {
        // one draw: 100 independent pieces of the FOGM, so 9 (1 +- 0.14) of 25
        assert!(
            (axis.model_std_arcsec / 5.0 - 1.0).abs() < 5.0 * 0.026,
            "{}",
            axis.model_std_arcsec
        );
    }
    Ok(())
}

/// A reference that is a copy of the attitude leaves rounding, of which there is nothing to say.
#[test]
fn a_residual_of_rounding_is_refused() -> Done {
    let (model, mut bundle) = made()?;
    let reference = bundle.reference.as_ref().ok_or("a reference")?;
    // a constant misalignment of an arcminute besides, so that nothing is exactly zero
    let turn =
        nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::new(2e-4, -1e-4, 1e-4));
    bundle.attitude = Some(AttitudeTable {
        t_s: reference.t_s.clone(),
        q: reference.q.iter().map(|q| turn * q).collect(),
    });
    let fitted = fit(&bundle, &FitSettings::default());
    assert!(matches!(
        fitted,
        Err(ComparisonError::NoScatter { axis: "x", .. })
    ));
    let compared = compare(&model, &[], &bundle, &settings(8), &|_| ());
    assert!(matches!(
        compared,
        Err(ComparisonError::NoScatter { axis: "x", .. })
    ));
    Ok(())
}

#[test]
fn what_cannot_be_compared_says_so() -> Done {
    let (model, mut bundle) = made()?;
    let few = compare(&model, &[], &bundle, &settings(7), &|_| ());
    assert!(matches!(few, Err(ComparisonError::TooFewDraws { got: 7 })));
    let empty = Model {
        kind: ModelKind::Hem,
        hem: None,
        ..model.clone()
    };
    assert!(compare(&empty, &[], &bundle, &settings(8), &|_| ()).is_err());
    let silent = Model {
        noise: telemetry::ModelNoise::default(),
        ..model.clone()
    };
    let alike = compare(&silent, &[], &bundle, &settings(8), &|_| ());
    assert!(matches!(alike, Err(ComparisonError::NoNoise { .. })));
    bundle.reference = None;
    let error = compare(&model, &[], &bundle, &settings(8), &|_| ())
        .err()
        .ok_or("no reference")?;
    assert!(error.to_string().contains("reference"), "{error}");
    Ok(())
}
