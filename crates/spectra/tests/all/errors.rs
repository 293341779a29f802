//! What is refused, and how it is said.
use spectra::{
    Allan, AllanData, AllanKind, Detrend, LombScargle, LombScargleSettings, Multitaper,
    MultitaperSettings, PowerLaw, Psd, SpectraError, Welch, WelchSettings, Window, continuous_runs,
    mean_rate_hz, periodogram, whole,
};

#[test]
fn settings_without_meaning() {
    let settings = WelchSettings::half_overlap(16, 1.0);
    let whole = WelchSettings {
        overlap: 16,
        ..settings.clone()
    };
    assert_eq!(
        Welch::new(whole).unwrap_err(),
        SpectraError::Overlap {
            overlap: 16,
            segment: 16
        }
    );
    let rate = WelchSettings {
        fs_hz: -1.0,
        ..settings
    };
    assert!(matches!(
        Welch::new(rate),
        Err(SpectraError::NotPositive { name: "fs_hz", .. })
    ));
    assert!(matches!(
        Welch::new(WelchSettings::half_overlap(1, 1.0)),
        Err(SpectraError::TooShort { got: 1, need: 2 })
    ));
    let multitaper = MultitaperSettings::new(100, 4.0, 1.0);
    let tapers = Multitaper::new(MultitaperSettings {
        tapers: 9,
        ..multitaper.clone()
    });
    assert_eq!(
        tapers.unwrap_err(),
        SpectraError::Tapers {
            got: 9,
            least: 2,
            most: 8
        }
    );
    let transform = Multitaper::new(MultitaperSettings {
        transform: 99,
        ..multitaper
    });
    assert_eq!(
        transform.unwrap_err(),
        SpectraError::Transform {
            transform: 99,
            samples: 100
        }
    );
    for nw in [0.0, 50.0, f64::NAN] {
        let band = Multitaper::new(MultitaperSettings::new(100, nw, 1.0));
        assert!(
            matches!(band, Err(SpectraError::Bandwidth { samples: 100, .. })),
            "{nw}"
        );
    }
}

#[test]
fn series_that_cannot_be_used() {
    let welch = Welch::new(WelchSettings::half_overlap(16, 1.0)).unwrap();
    assert_eq!(
        welch.process(&[0.0; 15]).unwrap_err(),
        SpectraError::TooShort { got: 15, need: 16 }
    );
    let outside = welch.process_runs(&[0.0; 20], &[0..16, 5..40]);
    assert_eq!(
        outside.unwrap_err(),
        SpectraError::Run {
            start: 5,
            end: 40,
            samples: 20
        }
    );
    let unequal = welch.process_cross(&[0.0; 20], &[0.0; 21], &whole(&[0.0; 20]));
    assert_eq!(
        unequal.unwrap_err(),
        SpectraError::Unequal {
            first: 20,
            second: 21
        }
    );
    let infinite = periodogram(&[1.0, f64::INFINITY], 1.0, Window::Hann, Detrend::None);
    assert!(matches!(
        infinite,
        Err(SpectraError::NotFinite { index: 1, .. })
    ));
    let multitaper = Multitaper::new(MultitaperSettings::new(100, 4.0, 1.0)).unwrap();
    assert_eq!(
        multitaper.process(&[0.0; 99]).unwrap_err(),
        SpectraError::WrongLength {
            got: 99,
            planned: 100
        }
    );
    let back = mean_rate_hz(&[0.0, 2.0, 1.0]);
    assert_eq!(
        back.unwrap_err(),
        SpectraError::NotIncreasing {
            index: 2,
            time_s: 1.0
        }
    );
    assert!(continuous_runs(&[0.0, 1.0], &[0.0], 1.0, 0.1).is_err());
    let settings = LombScargleSettings {
        first_hz: 0.0,
        step_hz: 1.0,
        bins: 3,
        floating_mean: true,
        fs_hz: 1.0,
    };
    assert!(matches!(
        LombScargle::new(&[0.0, 1.0, 2.0, 3.0], settings),
        Err(SpectraError::NotPositive {
            name: "first_hz",
            ..
        })
    ));
    let allan = Allan::new(
        AllanData::Angle,
        AllanKind::Classic,
        PowerLaw::WhiteAngle,
        1.0,
    )
    .unwrap();
    for factor in [0, 5] {
        assert_eq!(
            allan.process(&[0.0; 10], &[factor]).unwrap_err(),
            SpectraError::Factor { factor, most: 4 }
        );
    }
}

/// Zeros have a spectrum of zeros, no coherence, no lines, and still their degrees of freedom.
#[test]
fn zeros_are_a_series() -> Result<(), SpectraError> {
    let zeros = [0.0; 64];
    let multitaper = Multitaper::new(MultitaperSettings::for_lines(64, 3.0, 1.0))?;
    let spectrum = multitaper.process(&zeros)?;
    assert!(
        spectrum.psd.iter().all(|p| p.abs() < 1e-300) && spectrum.dof.iter().all(|d| *d >= 1.0)
    );
    assert!(
        multitaper
            .find_lines(&zeros, 0.5, 3, &mut multitaper.make_scratch())?
            .is_empty()
    );
    let welch = Welch::new(WelchSettings::half_overlap(16, 1.0))?;
    let coherence = welch
        .process_cross(&zeros, &zeros, &whole(&zeros))?
        .coherence();
    assert!(coherence.iter().all(|c| c.abs() < 1e-300));
    assert!(Psd::default().step_hz().is_none());
    Ok(())
}
