//! What the closed loop leaves on disk, read back by the Arrow reader; and the star catalogue.

mod common;

use std::fs::File;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use common::repository;
use focal_plane::ra_dec;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use telemetry::{DarkMap, Output, StarResiduals, hipparcos};

#[test]
fn residual_tables_have_the_columns_of_the_format() {
    let dir = tempfile::tempdir().unwrap();
    let output = Output::new(&dir.path().join("out")).unwrap();
    let stars = StarResiduals {
        t_s: vec![0.0, 0.5],
        slot: vec![3, 4],
        star_id: vec![1 << 60, -7],
        x_px: vec![1.5, 2.5],
        y_px: vec![-1.0, f64::NAN],
        before_arcsec: [vec![1.0, 2.0], vec![3.0, 4.0]],
        after_arcsec: [vec![0.5, 1.0], vec![1.5, f64::NAN]],
        fold: vec![0, 4],
        outlier: vec![false, true],
    };
    stars.write(&output).unwrap();
    let map = DarkMap {
        x_px: vec![0.5],
        y_px: vec![-3.5],
        dn: vec![12.25],
        sigma_dn: vec![1e-12],
    };
    map.write(&output).unwrap();
    output.commit().unwrap();

    let file = File::open(dir.path().join("out/residuals_stars.parquet")).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .unwrap()
        .build()
        .unwrap();
    let batches: Vec<_> = reader.map(Result::unwrap).collect();
    let batch = &batches[0];
    let names: Vec<String> = batch
        .schema()
        .fields()
        .iter()
        .map(|f| f.name().clone())
        .collect();
    assert_eq!(
        names.join(", "),
        "t_s, slot, star_id, x_px, y_px, before_x_arcsec, before_y_arcsec, after_x_arcsec, after_y_arcsec, fold, outlier"
    );
    let ids = batch.column(2).as_primitive::<Int64Type>();
    assert_eq!(ids.values(), &[1 << 60, -7]);
    let after_y = batch.column(8).as_primitive::<Float64Type>();
    assert_eq!(after_y.iter().collect::<Vec<_>>(), [Some(1.5), None]);
    assert!(batch.column(10).as_boolean().value(1));
    let map = std::fs::read_to_string(dir.path().join("out/dark_map.csv")).unwrap();
    assert_eq!(map, "x_px,y_px,dn,sigma_dn\n0.5,-3.5,12.25,1e-12\n");
}

/// Places at J2000.0 by SIMBAD (ICRS), h m s and deg ' ". The catalogue's own errors are below
/// 1 mas there, the digits below end at 1 mas, and the parallactic and perspective terms that the
/// linear motion of 8.75 years leaves out are below 5 mas for Vega; 20 mas is the gate. The
/// binary motion of Sirius (5 arcsec a period of 50 years) is in its catalogue motion only at
/// 1991: 50 mas.
#[test]
fn bright_stars_are_in_their_places() {
    let table = repository("fixtures/hip2/hip2_hp_lt_6.5.csv");
    let catalogue = hipparcos::read(File::open(table).unwrap()).unwrap();
    assert_eq!(catalogue.len(), 7982);
    assert_eq!(catalogue.epoch_year().to_bits(), 1991.25_f64.to_bits());
    let hms = |h: f64, m: f64, s: f64| 15.0 * (h + m / 60.0 + s / 3600.0);
    let dms = |d: f64, m: f64, s: f64| d + m / 60.0 + s / 3600.0;
    for (hip, ra_deg, dec_deg, gate_mas) in [
        (
            91_262,
            hms(18.0, 36.0, 56.336_35),
            dms(38.0, 47.0, 1.2802),
            20.0,
        ),
        (
            32_349,
            hms(6.0, 45.0, 8.917_28),
            -dms(16.0, 42.0, 58.0171),
            50.0,
        ),
        (
            27_989,
            hms(5.0, 55.0, 10.305_36),
            dms(7.0, 24.0, 25.4304),
            20.0,
        ),
    ] {
        let index = catalogue.index_of(hip).unwrap();
        let (ra, dec) = ra_dec(&catalogue.direction_at(index, 2000.0));
        let east = (ra.deg() - ra_deg) * dec.rad().cos() * 3.6e6;
        let north = (dec.deg() - dec_deg) * 3.6e6;
        assert!(
            east.hypot(north) < gate_mas,
            "HIP {hip}: {east} mas east, {north} mas north"
        );
    }
    // Barnard's star, Hp 9.5, is too faint for this subset
    assert_eq!(catalogue.index_of(87_937), None);
    assert!(catalogue.stars().iter().all(|star| star.mag < 6.5));
}

#[test]
fn a_faulty_star_is_named() {
    let good = std::fs::read_to_string(repository("fixtures/hip2/hip2_hp_lt_6.5.csv")).unwrap();
    let faulty: String = good
        .lines()
        .take(5)
        .collect::<Vec<_>>()
        .join("\n")
        .replace("0.269159455", "zero");
    let error = hipparcos::read(faulty.as_bytes()).unwrap_err().to_string();
    for part in ["line 5", "ra_deg", "\"zero\""] {
        assert!(error.contains(part), "{error}");
    }
    let error = hipparcos::read(&b"hip,plx_mas\n1,2\n"[..])
        .unwrap_err()
        .to_string();
    assert!(error.contains("ra_deg_icrs_ep1991.25"), "{error}");
}
