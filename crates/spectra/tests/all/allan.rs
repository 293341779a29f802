//! Allan deviations: the published test suite, theory, degrees of freedom.
use spectra::{Allan, AllanData, AllanKind, PowerLaw, SpectraError, allan_edf};

use crate::cases::{mean_and_error, share, white};

/// NIST SP 1065, Tables 30 and 31: 1000 numbers of a congruential generator, to the seven digits printed.
#[test]
fn nist_test_suite() -> Result<(), SpectraError> {
    let mut state = 1_234_567_890_u64;
    let rates: Vec<f64> = (0..1000)
        .map(|_| {
            let value = state as f64 / 2_147_483_647.0;
            state = 16_807 * state % 2_147_483_647;
            value
        })
        .collect();
    let cases = [
        (
            AllanKind::Classic,
            [2.922_319e-1, 9.965_736e-2, 3.897_804e-2],
        ),
        (
            AllanKind::Overlapping,
            [2.922_319e-1, 9.159_953e-2, 3.241_343e-2],
        ),
    ];
    for (kind, expected) in cases {
        let allan = Allan::new(AllanData::Rate, kind, PowerLaw::WhiteRate, 1.0)?;
        let got = allan.process(&rates, &[1, 10, 100])?.deviation;
        for (g, e) in got.iter().zip(expected) {
            assert!((g / e - 1.0).abs() < 2e-7, "{kind:?}: {g} {e}");
        }
    }
    Ok(())
}

/// The same series as rates and as their sum gives the same deviations.
#[test]
fn rates_and_angles_agree() -> Result<(), SpectraError> {
    let rates = white(500, 8);
    let mut angles = vec![3.0];
    for r in &rates {
        angles.push(angles[angles.len() - 1] + r / 4.0);
    }
    for kind in [AllanKind::Classic, AllanKind::Overlapping] {
        let of = |data| Allan::new(data, kind, PowerLaw::WhiteRate, 4.0);
        let factors = of(AllanData::Rate)?.octaves(500);
        assert_eq!(factors, [1, 2, 4, 8, 16, 32, 64, 128]);
        let a = of(AllanData::Rate)?.process(&rates, &factors)?;
        let b = of(AllanData::Angle)?.process(&angles, &factors)?;
        assert_eq!(
            (&a.tau_s, &a.differences, &a.edf),
            (&b.tau_s, &b.differences, &b.edf)
        );
        for (x, y) in a.deviation.iter().zip(&b.deviation) {
            assert!((x / y - 1.0).abs() < 1e-12);
        }
    }
    Ok(())
}

/// A series of rates whose noise follows `law`, with the Allan variance at factor `m` (1 Hz). White angle: `3/tau^2`
/// of unit variance; white rate: `1/tau`; random walk of the rate, continuous, `tau/3`.
fn simulated(law: PowerLaw, samples: usize, seed: u64) -> Vec<f64> {
    let e = white(2 * samples, seed);
    match law {
        PowerLaw::WhiteAngle => (0..samples).map(|n| e[n + 1] - e[n]).collect(),
        PowerLaw::WhiteRate => e[..samples].to_vec(),
        _ => {
            // the rate r walks; its mean over a step is r + e/2 + g/sqrt(12)
            let mut rate = 0.0;
            e.chunks_exact(2)
                .map(|pair| {
                    let mean = rate + 0.5 * pair[0] + pair[1] / 12_f64.sqrt();
                    rate += pair[0];
                    mean
                })
                .collect()
        }
    }
}

/// Expectation exact; variance as `edf` says; the band covers as often as it says, within 0.02 for a
/// variance that is not quite chi-squared.
#[test]
fn deviation_and_its_confidence() -> Result<(), SpectraError> {
    let laws = [
        PowerLaw::WhiteAngle,
        PowerLaw::WhiteRate,
        PowerLaw::RandomWalkRate,
    ];
    for law in laws {
        for kind in [AllanKind::Classic, AllanKind::Overlapping] {
            for m in [1_usize, 2, 15] {
                let tau = m as f64;
                let truth = match law {
                    PowerLaw::WhiteAngle => 3.0 / (tau * tau),
                    PowerLaw::WhiteRate => 1.0 / tau,
                    _ => tau / 3.0,
                };
                let allan = Allan::new(AllanData::Rate, kind, law, 1.0)?;
                let (mut ratios, mut spreads, mut inside) = (vec![], vec![], 0);
                for seed in 0..600 {
                    let got = allan.process(&simulated(law, 200, seed), &[m])?;
                    let band = got.confidence(0.9)?;
                    inside +=
                        usize::from(band.lower[0] <= truth.sqrt() && truth.sqrt() <= band.upper[0]);
                    let ratio = got.deviation[0].powi(2) / truth;
                    ratios.push(ratio);
                    spreads.push((ratio - 1.0).powi(2) * got.edf[0] / 2.0);
                }
                let what = format!("{law:?} {kind:?} {m}");
                share(inside, 600, 0.9, 0.02, &what);
                let [mean, error] = mean_and_error(&ratios);
                assert!(
                    (mean - 1.0).abs() < 5.0 * error,
                    "{what}: {mean} +- {error}"
                );
                let [mean, error] = mean_and_error(&spreads);
                assert!(
                    (mean - 1.0).abs() < 5.0 * error,
                    "{what}: spread {mean} +- {error}"
                );
            }
        }
    }
    Ok(())
}

/// One difference has one degree of freedom; overlapping ones are never fewer than classic ones.
#[test]
fn degrees_of_freedom_are_bounded() {
    let laws = [
        PowerLaw::WhiteAngle,
        PowerLaw::FlickerAngle,
        PowerLaw::WhiteRate,
        PowerLaw::FlickerRate,
        PowerLaw::RandomWalkRate,
    ];
    for law in laws {
        assert!((allan_edf(law, AllanKind::Overlapping, 20, 41) - 1.0).abs() < 1e-12);
        for m in [2, 9, 50, 400] {
            let classic = allan_edf(law, AllanKind::Classic, m, 1001);
            let overlapping = allan_edf(law, AllanKind::Overlapping, m, 1001);
            assert!(
                classic >= 1.0 && overlapping >= 0.999 * classic,
                "{law:?} {m}: {classic} {overlapping}"
            );
            assert!(overlapping <= (1001 - 2 * m) as f64);
        }
    }
}
