//! A bundle that is written as it grows is the one in memory, and nothing depends on how it is cut.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use focal_plane::{Catalogue, CatalogueStar, UniformRotation};
use imager::{
    Background, Bracket, ImagerError, Instrument, Node, Reference, Run, Sensor, frames, write,
};
use nalgebra::Vector3;
use telemetry::{Bundle, BundleWriter, TableFormat};

/// Twelve stars about the pole, of magnitudes 2 to 5.
fn sky() -> Catalogue {
    let star = |k: i32| CatalogueStar {
        id: i64::from(k),
        ra_deg: 30.0 * f64::from(k),
        dec_deg: 84.0 + 0.4 * f64::from(k),
        mag: 2.0 + 0.25 * f64::from(k),
        bv: 0.1 * f64::from(k),
        ..CatalogueStar::default()
    };
    Catalogue::new(2000.0, (0..12).map(star).collect()).unwrap()
}

/// Something of everything: pixels with traits, hits, heater, clock, wander, images.
fn busy() -> Instrument {
    let text = r#"
format = "boresight-world/1"
[shutter]
row_time_s = 20e-6
[detector]
prnu = 0.01
dsnu_e_s = 100.0
warm_share = 0.02
warm_e_s = 2000.0
telegraph_share = 0.5
telegraph_s = 20.0
column_e = 3.0
particles = { hits_px_s = 1e-3, charge_e_px = 500.0, length_px = 3.0 }
trailing = { traps_e = 0.01, knee_e = 300.0, release_px = 2.0 }
[clock]
delay_s = 0.01
jitter_s = 1e-3
step_s = 1e-3
[readout]
images = true
position_step_px = 1e-4
quaternion_step = 1e-9
[thermal]
node = [{ name = "plate", tau_s = 100.0, around_c = 14.0, heater_rise_c = 12.0, on_below_c = 19.5, off_above_c = 20.5 }]
sensor = [{ channel = "plate_c", node = "plate", noise_c = 0.02 }, { channel = "plate_on", node = "plate" }]
[bracket]
node = "plate"
arcsec_per_c = [3.0, 0.0, 1.0]
[orbit]
radius_km = 7000.0
reported = true
[reference]
white_arcsec = [1.0, 1.0, 5.0]
wander_arcsec = [2.0, 2.0, 2.0]
"#;
    Instrument::parse(text, "busy.toml", &[]).unwrap()
}

fn drift() -> UniformRotation {
    UniformRotation {
        rate_rad_s: Vector3::new(3e-5, -2e-5, 1e-5),
        ..UniformRotation::default()
    }
}

/// 700 frames are three chunks of work; the tables read back are those in memory.
#[test]
fn what_is_written_is_what_is_in_memory() {
    let (instrument, truth, sky) = (busy(), drift(), sky());
    let run = Run {
        frames: 700,
        seed: 5,
        ..Run::default()
    };
    let whole = frames(&instrument, &truth, &sky, &run).unwrap();
    let dir = tempfile::tempdir().unwrap();
    for format in TableFormat::ALL {
        let to = dir.path().join(format!("{format:?}"));
        let writer = BundleWriter::new(&to, format).unwrap();
        let summary = write(&instrument, &truth, &sky, &run, writer, &|_| ()).unwrap();
        let read = Bundle::read(&to).unwrap();
        assert_eq!(read.stars, whole.stars);
        assert_eq!(read.attitude, whole.attitude);
        assert_eq!(read.images, whole.images);
        assert_eq!(read.reference, whole.reference);
        assert_eq!(read.housekeeping, whole.housekeeping);
        assert_eq!(read.catalog, whole.catalog);
        assert_eq!(
            summary.star_rows,
            whole.stars.as_ref().unwrap().rows() as u64
        );
        assert!(to.join("truth.json").is_file());
    }
}

/// A run's first frames do not know how many follow; another draw has other noise and the same pixels.
#[test]
fn a_longer_run_begins_alike_and_a_draw_is_another() {
    let (instrument, truth, sky) = (busy(), drift(), sky());
    let of = |frames_of: u64, draw: u64| {
        let run = Run {
            frames: frames_of,
            draw,
            ..Run::default()
        };
        frames(&instrument, &truth, &sky, &run)
            .unwrap()
            .stars
            .unwrap()
    };
    let (short, long, other) = (of(100, 0), of(300, 0), of(100, 1));
    let n = short.rows();
    assert_eq!(short.x_px[..n], long.x_px[..n]);
    let differ = short
        .x_px
        .iter()
        .zip(&other.x_px)
        .filter(|(a, b)| a.to_bits() != b.to_bits())
        .count();
    assert!(differ > n / 2, "{differ} of {n}");
}

/// The reference rides on the other side of the bracket, and its error is what it says: white and wander
/// of 700 samples, the latter correlated over 200 of them.
#[test]
fn the_reference_bends_and_errs() {
    let (mut instrument, truth, sky) = (Instrument::default(), drift(), sky());
    instrument.thermal.node = vec![Node {
        name: "bracket".into(),
        tau_s: 1.0,
        around_c: 21.0,
        ..busy().thermal.node[0].clone()
    }];
    instrument.thermal.node[0].heater_rise_c = 0.0;
    instrument.bracket = Bracket {
        node: Some("bracket".into()),
        arcsec_per_c: [30.0, 0.0, -10.0],
        ..Bracket::default()
    };
    instrument.reference = Some(Reference::default());
    let run = Run {
        frames: 20,
        ..Run::default()
    };
    let bundle = frames(&instrument, &truth, &sky, &run).unwrap();
    let reference = bundle.reference.unwrap();
    // one before the first frame, one at or after the last
    assert!(reference.t_s[0] < 0.0 && reference.t_s[reference.t_s.len() - 1] >= 9.5);
    for (t, q) in reference.t_s.iter().zip(&reference.q) {
        let true_q = focal_plane::AttitudeSource::attitude(&truth, *t).unwrap();
        let turn = focal_plane::rotation_vector(&true_q, q);
        let arcsec = turn.map(|a| focal_plane::Angle::from_rad(a).arcsec());
        // one degree above straight: the tracker is turned against the reference by this
        assert!(
            (arcsec - Vector3::new(30.0, 0.0, -10.0)).norm() < 1e-3,
            "{arcsec}"
        );
    }
}

/// Housekeeping has what sits on the nodes and nothing else, and covers the frames.
#[test]
fn housekeeping_covers_the_frames() {
    let run = Run {
        frames: 300,
        ..Run::default()
    };
    let bundle = frames(&busy(), &drift(), &sky(), &run).unwrap();
    let housekeeping = bundle.housekeeping.unwrap();
    let names: Vec<&str> = housekeeping.channels.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        ["plate_c", "plate_on", "vx_km_s", "vy_km_s", "vz_km_s"]
    );
    let t = &housekeeping.t_s;
    assert!(t[0] < 0.0 && t[t.len() - 1] >= 149.5);
    let switch = &housekeeping.channels["plate_on"];
    assert!(switch.contains(&0.0) && switch.contains(&1.0));
}

/// White 2 and wander 3 arcsec of 100 s: the sum's spread, and the correlation of neighbours
/// `9 exp(-0.5/100)/13`. 20000 samples are 100 times the correlation time: 5 sqrt(2/100) of the wander's share.
#[test]
fn the_reference_errs_as_it_says() {
    let sky = sky();
    let instrument = Instrument {
        reference: Some(Reference {
            white_arcsec: [2.0, 0.0, 0.0],
            wander_arcsec: [3.0, 0.0, 0.0],
            ..Reference::default()
        }),
        ..Instrument::default()
    };
    let run = Run {
        frames: 20_000,
        ..Run::default()
    };
    let truth = UniformRotation::default();
    let reference = frames(&instrument, &truth, &sky, &run)
        .unwrap()
        .reference
        .unwrap();
    let identity = nalgebra::UnitQuaternion::identity();
    let arcsec =
        |q| focal_plane::Angle::from_rad(focal_plane::rotation_vector(q, &identity).x).arcsec();
    let error: Vec<f64> = reference.q.iter().map(arcsec).collect();
    let n = error.len() as f64;
    let variance = error.iter().map(|e| e * e).sum::<f64>() / n;
    let lag = error.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n;
    let gate = 9.0 * 5.0 * (2.0_f64 / 100.0).sqrt();
    assert!((variance - 13.0).abs() < gate, "{variance}");
    // what differs between them is white: 5 sqrt(2/n) of 4 and its products with the wander
    let white = variance - lag - 9.0 * (1.0 - (-0.5_f64 / 100.0).exp());
    assert!(
        (white - 4.0).abs() < 5.0 * (4.0 * 2.0_f64.sqrt() + 6.0) / n.sqrt(),
        "{white}"
    );
    let declared = reference.sigma_arcsec.unwrap()[7];
    assert!((declared[0] - 13.0_f64.sqrt()).abs() < 1e-12);
}

/// Without noise a draw is like another: the pixels are those of the seed.
#[test]
fn pixels_belong_to_the_seed() {
    let (truth, sky) = (drift(), sky());
    let mut instrument = Instrument::default();
    instrument.detector.photon_noise = false;
    instrument.detector.read_noise_e = 0.0;
    instrument.detector.prnu = 0.05;
    let of = |seed: u64, draw: u64| {
        let run = Run {
            frames: 5,
            seed,
            draw,
            ..Run::default()
        };
        frames(&instrument, &truth, &sky, &run)
            .unwrap()
            .stars
            .unwrap()
            .x_px
    };
    assert_eq!(of(1, 0), of(1, 1));
    assert_ne!(of(1, 0), of(2, 0));
}

#[test]
fn mistakes_are_named() {
    let (truth, sky) = (drift(), sky());
    let said = |instrument: &Instrument, run: &Run| {
        frames(instrument, &truth, &sky, run)
            .unwrap_err()
            .to_string()
    };
    let one = Run::default();
    let mut wrong = Instrument::default();
    wrong.detector.read_noise_e = -1.0;
    assert!(said(&wrong, &one).contains("detector.read_noise_e = -1"));
    let mut wrong = Instrument::default();
    wrong.bracket.node = Some("brackett".into());
    assert!(said(&wrong, &one).contains("`brackett`"));
    let mut wrong = Instrument::default();
    wrong.thermal.sensor = vec![Sensor {
        channel: "a_c".into(),
        node: "none".into(),
        noise_c: 0.0,
        step_c: 0.0,
    }];
    assert!(said(&wrong, &one).contains("`none`"));
    let mut wrong = Instrument::default();
    wrong.clock.step_s = 1.0;
    assert!(said(&wrong, &one).contains("clock.step_s"));
    let mut dark = Instrument::default();
    dark.stars.limiting_mag = 1.0;
    let none = frames(&dark, &truth, &sky, &one);
    assert!(matches!(none, Err(ImagerError::NothingSeen { frames: 1 })));
    let grey = Instrument {
        background: Background {
            sky_e_s: f64::NAN,
            ..Background::default()
        },
        ..Instrument::default()
    };
    assert!(said(&grey, &one).contains("background.sky_e_s"));
}
