//! The command as a user meets it: exit codes, streams, files.

#[path = "../../telemetry/tests/common/flight_data.rs"]
mod flight_data;

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use flight_data::flight_data;
use serde_json::Value;

type Done = Result<(), Box<dyn std::error::Error>>;

fn boresight() -> Command {
    Command::new(env!("CARGO_BIN_EXE_boresight"))
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

/// Runs a command that has to succeed; what it says for machines.
fn answer(command: &mut Command) -> Result<Value, Box<dyn std::error::Error>> {
    let done = command.arg("--json").output()?;
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{said}");
    Ok(serde_json::from_slice(&done.stdout)?)
}

/// A copy of the example's bundle that a test may break.
fn example_bundle(to: &Path) -> std::io::Result<PathBuf> {
    let bundle = to.join("bundle");
    fs::create_dir(&bundle)?;
    for entry in fs::read_dir(fixtures().join("example/bundle"))? {
        let entry = entry?;
        fs::copy(entry.path(), bundle.join(entry.file_name()))?;
    }
    Ok(bundle)
}

/// The example carries a rolling shutter of 30 us a line, five sigma of its own
/// estimate on either side; the model file does not declare it.
#[test]
fn without_arguments_the_example_is_explained() -> Done {
    let report = answer(boresight().arg("close"))?;
    assert_eq!(report["format"], "boresight-report/1");
    assert_eq!(report["verdict"], "explained");
    let effects = report["effects"].as_array().ok_or("effects")?;
    assert_eq!(effects.len(), 1);
    assert_eq!(effects[0]["id"], "rolling_shutter");
    let line_time = &effects[0]["parameters"]["line_time_s"];
    let (value, sigma) = (
        line_time["value"].as_f64().ok_or("value")?,
        line_time["sigma"].as_f64().ok_or("sigma")?,
    );
    assert!((value - 30e-6).abs() < 5.0 * sigma, "{value} +- {sigma}");
    for axis in 0..2 {
        let rms = |when: &str| report[when]["star_rms_arcsec"][axis].as_f64();
        assert!(rms("after") < rms("before"));
    }
    Ok(())
}

#[test]
fn results_are_whole_and_the_model_can_be_used_again() -> Done {
    let dir = tempfile::tempdir()?;
    let out = dir.path().join("results");
    let done = boresight().arg("close").arg("--out").arg(&out).output()?;
    assert!(done.status.success());
    let text = String::from_utf8(done.stdout)?;
    assert!(text.contains("before") && text.contains("rolling_shutter"));
    assert!(
        done.stderr.is_empty(),
        "no progress where stderr is no terminal"
    );
    for file in [
        "report.json",
        "report.html",
        "summary.txt",
        "model.toml",
        "residuals_stars.parquet",
        "residuals_attitude.parquet",
    ] {
        assert!(fs::metadata(out.join(file))?.len() > 0, "{file}");
    }
    assert_eq!(
        fs::read_dir(dir.path())?.count(),
        1,
        "nothing beside the results"
    );
    the_page_is_true_to_the_report(&out)?;
    // with what was found declared, nothing is left to find
    let bundle = example_bundle(dir.path())?;
    let model = out.join("model.toml");
    let report = answer(boresight().arg("close").args([&model, &bundle]))?;
    assert_eq!(report["verdict"], "consistent");
    // and who asks for a term without a cause hears that there is none
    let mut asked = boresight();
    asked
        .args(["close", "--add-empirical"])
        .args([&model, &bundle]);
    let said = String::from_utf8(asked.output()?.stdout)?;
    assert!(said.contains("--add-empirical added nothing"), "{said}");
    Ok(())
}

/// Six stars at rest, each misplaced by up to four pixels: `mag` describes them, and some term of the place gains, but its
/// parameters are not told beside the misalignment. What does not stand as an effect has to is not added.
#[test]
fn a_term_that_does_not_stand_is_not_added() -> Done {
    let dir = tempfile::tempdir()?;
    let write = |name: &str, text: String| fs::write(dir.path().join(name), text);
    let focal_px = 2900.0_f64;
    // where each star is, and where its centroid is
    let stars: [[f64; 4]; 6] = [
        [-374.5, 466.2, -375.7, 466.1],
        [242.2, -421.4, 243.0, -417.5],
        [-461.0, 338.9, -464.9, 339.3],
        [68.9, 80.0, 66.8, 77.0],
        [-302.4, -275.8, -304.1, -277.8],
        [-169.3, -135.7, -172.8, -132.6],
    ];
    let mut catalogue = "star_id,ra_deg,dec_deg,mag,bv\n".to_owned();
    for (k, [x, y, ..]) in stars.iter().enumerate() {
        let (ra, dec) = (y.atan2(*x), focal_px.atan2(x.hypot(*y)));
        let (ra, dec) = (ra.to_degrees().rem_euclid(360.0), dec.to_degrees());
        catalogue += &format!("{k},{ra},{dec},4.{k},0.5\n");
    }
    let mut reference = "t_s,qx,qy,qz,qw\n".to_owned();
    let mut rows = "t_s,slot,star_id,x_px,y_px\n".to_owned();
    for t in 0..30_i32 {
        reference += &format!("{t},0,0,0,1\n");
        for (k, [.., x, y]) in (0..).zip(stars) {
            // noise enough: no two rows are alike
            let noise = |n: i32| 0.02 * (f64::from((7 * t + 11 * k + n) % 13) / 6.0 - 1.0);
            rows += &format!("{t},{k},{k},{},{}\n", x + noise(0), y + noise(5));
        }
    }
    let tracker =
        format!("pixels = [1024, 1024]\nfocal_length_px = {focal_px}\npixel_centre = 0.5\n");
    write(
        "bundle.toml",
        format!("format = \"boresight-bundle/1\"\n[tracker]\n{tracker}"),
    )?;
    write("catalog.csv", catalogue)?;
    write("reference.csv", reference)?;
    write("stars.csv", rows)?;
    let noise = "temporal_arcsec = 5.0\ncentroid_arcsec = 0.0\n";
    let model = format!("format = \"boresight-model/1\"\nkind = \"pbm\"\n[noise]\n{noise}");
    write("model.toml", model)?;
    let mut close = boresight();
    close.args(["close", "--add-empirical"]);
    let report = answer(close.arg(dir.path().join("model.toml")).arg(dir.path()))?;
    assert_eq!(report["verdict"], "unexplained");
    assert_eq!(report["unattributed"]["depends_on"][0]["variable"], "star");
    assert_eq!(report["effects"], Value::Array(Vec::new()));
    Ok(())
}

/// The page of a real run, with ensembles of both models, says what its `report.json` says.
fn the_page_is_true_to_the_report(out: &Path) -> Done {
    let page = fs::read_to_string(out.join("report.html"))?;
    let report: Value = serde_json::from_slice(&fs::read(out.join("report.json"))?)?;
    let mut numbers = 0;
    for piece in page.split("<data value=\"").skip(1) {
        let mut parts = piece.split('"');
        let value: f64 = parts.next().ok_or("value")?.parse()?;
        let key = parts.nth(1).ok_or("key")?;
        let wanted = report.pointer(key).and_then(Value::as_f64);
        let wanted = wanted.ok_or_else(|| format!("no {key}"))?;
        // text is read back to within a unit of the last place
        assert!((wanted - value).abs() <= 4e-16 * value.abs(), "{key}");
        numbers += 1;
    }
    assert!(numbers > 60, "{numbers}");
    // the declared model lacks the effect: its cost about the boresight is the larger one
    let costs = page
        .split("Log-PSD cost about X, Y, Z: ")
        .nth(1)
        .and_then(|rest| rest.split('<').next())
        .ok_or("ensembles of both models")?;
    let costs: Vec<f64> = costs
        .split([' ', ','])
        .filter_map(|word| word.parse().ok())
        .collect();
    assert_eq!(costs.len(), 6, "{costs:?}");
    assert!(costs[2] > costs[5], "{costs:?}");
    Ok(())
}

/// Exit 2, one message that names the place, and nothing left behind.
fn refuses(bundle: &Path, words: &[&str]) -> Done {
    let dir = tempfile::tempdir()?;
    let out = dir.path().join("results");
    let done = boresight()
        .arg("close")
        .arg(fixtures().join("example/model.toml"))
        .arg(bundle)
        .arg("--out")
        .arg(&out)
        .output()?;
    let message = String::from_utf8(done.stderr)?;
    assert_eq!(done.status.code(), Some(2), "{message}");
    assert!(done.stdout.is_empty());
    for word in words {
        assert!(message.contains(word), "no {word:?} in: {message}");
    }
    assert!(
        !out.exists() && fs::read_dir(dir.path())?.count() == 0,
        "output left behind"
    );
    Ok(())
}

#[test]
fn a_word_in_a_number_is_named_by_file_line_and_column() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = example_bundle(dir.path())?;
    fs::remove_file(bundle.join("housekeeping.csv.gz"))?;
    fs::write(
        bundle.join("rates.csv"),
        "t_s,wx_rad_s,wy_rad_s,wz_rad_s\n0.0,0,0,0\n0.5,0,fast,0\n",
    )?;
    refuses(&bundle, &["rates.csv", "3", "wy_rad_s", "fast"])
}

#[test]
fn a_missing_column_is_named() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = example_bundle(dir.path())?;
    fs::remove_file(bundle.join("reference.csv.gz"))?;
    fs::write(bundle.join("reference.csv"), "t_s,qx,qy,qz\n0.0,0,0,0\n")?;
    refuses(&bundle, &["reference.csv", "qw"])
}

#[test]
fn a_key_that_does_not_exist_names_the_nearest() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = example_bundle(dir.path())?;
    let toml = fs::read_to_string(bundle.join("bundle.toml"))?;
    fs::write(
        bundle.join("bundle.toml"),
        toml.replace("sample_rate_hz", "sample_rate_herz"),
    )?;
    refuses(
        &bundle,
        &["bundle.toml", "sample_rate_herz", "sample_rate_hz"],
    )
}

#[test]
fn an_empty_folder_is_no_bundle() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = dir.path().join("bundle");
    fs::create_dir(&bundle)?;
    refuses(&bundle, &["bundle.toml"])
}

/// Effects that were asked about are answered in the order asked, one that the bundle cannot show with
/// what is missing; an id that does not exist is one message with all that do.
#[test]
fn hypotheses_are_answered_by_name() -> Done {
    let asked = [
        "dark_map",
        "exposure_smear",
        "rolling_shutter",
        "velocity_aberration",
    ];
    let mut command = boresight();
    command.arg("close");
    for id in asked {
        command.args(["--test", id]);
    }
    let report = answer(&mut command)?;
    let answers = report["hypotheses"].as_array().ok_or("hypotheses")?;
    let ids: Vec<&str> = answers.iter().filter_map(|h| h["id"].as_str()).collect();
    assert_eq!(ids, asked);
    let [dark_map, smear, shutter, aberration] = answers.as_slice() else {
        return Err("four".into());
    };
    assert_eq!(dark_map["observable"], false);
    let reason = dark_map["reason"].as_str().ok_or("reason")?;
    assert!(reason.contains("images"), "{reason}");
    // no channel tells a velocity, but an orbit would turn the camera: 1 km/s by 0.69 arcsec, which changes over
    // three quarters of an hour by about itself
    assert_eq!(aberration["observable"], true);
    let speed = aberration["sizes"][0]["detectable"]
        .as_f64()
        .ok_or("speed")?;
    assert!((100.0..2000.0).contains(&speed), "{speed}");
    assert_eq!(
        (&smear["observable"], &smear["added"]),
        (&true.into(), &false.into())
    );
    let size = &smear["sizes"][0];
    assert_eq!(size["parameter"], "exposure_s");
    // 0.58 s: three quarters of an hour of slews of some 0.1 deg/s
    let seen = size["detectable"].as_f64().ok_or("detectable")?;
    assert!((0.1..2.0).contains(&seen), "{seen}");
    assert_eq!(
        (&shutter["added"], &shutter["significant"]),
        (&true.into(), &true.into())
    );
    let pointer = "/parameters/line_time_s/value";
    assert_eq!(
        Some(&shutter["sizes"][0]["value"]),
        report["effects"][0].pointer(pointer)
    );
    // the declared model's residual holds nothing else: what was added explains it at its own size
    let share = shutter["variance_share"].as_f64().ok_or("share")?;
    let most = shutter["variance_share_at_most"].as_f64().ok_or("most")?;
    assert!(
        0.03 < share && share < most && most < 0.06,
        "{share} {most}"
    );

    let unknown = boresight()
        .args(["close", "--test", "turn-around"])
        .output()?;
    let message = String::from_utf8(unknown.stderr)?;
    assert_eq!(unknown.status.code(), Some(2));
    assert!(unknown.stdout.is_empty());
    assert!(
        message.contains("`turn-around`") && message.contains("exposure_smear"),
        "{message}"
    );
    Ok(())
}

#[test]
fn usage_errors_exit_with_two() -> Done {
    for arguments in [
        &["clos"][..],
        &["close", "model.toml"],
        &["close", "--threads", "0"],
    ] {
        let done = boresight().args(arguments).output()?;
        assert_eq!(done.status.code(), Some(2), "{arguments:?}");
        assert!(done.stdout.is_empty());
    }
    Ok(())
}

#[test]
fn the_numbers_do_not_depend_on_the_threads() -> Done {
    let run = |threads: &str| {
        boresight()
            .args(["close", "--json", "--threads", threads])
            .output()
    };
    assert_eq!(run("1")?.stdout, run("3")?.stdout);
    Ok(())
}

#[test]
fn a_simulated_bundle_closes() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = dir.path().join("bundle");
    let done = boresight()
        .args(["simulate", "--quiet", "--tables", "parquet"])
        .arg(fixtures().join("scenarios/example.toml"))
        .arg("--out")
        .arg(&bundle)
        .output()?;
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    assert!(done.stdout.is_empty());
    let model = fixtures().join("example/model.toml");
    let report = answer(boresight().arg("close").args([&model, &bundle]))?;
    assert_eq!(report["effects"][0]["id"], "rolling_shutter");
    Ok(())
}

/// A printed preset is a scenario that `simulate` reads; a wrong name is answered with the nearest.
#[test]
fn a_preset_is_printed_edited_and_simulated() -> Done {
    let dir = tempfile::tempdir()?;
    let printed = boresight()
        .args(["simulate", "--print-preset", "pitt"])
        .output()?;
    let same = boresight()
        .args(["simulate", "--preset", "pitt", "--print-preset"])
        .output()?;
    assert!(printed.status.success() && printed.stdout == same.stdout);
    let text = String::from_utf8(printed.stdout)?;
    let edited = text.replacen("duration_s = 10440.0", "duration_s = 5.0", 1);
    assert_ne!(text, edited);
    let (file, out) = (dir.path().join("mine.toml"), dir.path().join("bundle"));
    fs::write(&file, edited)?;
    let done = boresight()
        .arg("simulate")
        .arg(&file)
        .arg("--out")
        .arg(&out)
        .output()?;
    assert!(done.status.success());
    assert!(String::from_utf8(done.stdout)?.starts_with("50 frames, 700 star rows"));
    let wrong = boresight()
        .args(["simulate", "--preset", "ith", "--out"])
        .arg(&out)
        .output()?;
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8(wrong.stderr)?.contains("`iht`"));
    Ok(())
}

/// Nothing but quaternions, whatever the source calls their columns.
#[test]
fn assess_reads_quaternions_under_any_name() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = dir.path().join("bundle");
    fs::create_dir(&bundle)?;
    fs::write(
        bundle.join("bundle.toml"),
        "format = \"boresight-bundle/1\"\n[columns.attitude]\nt_s = \"TIME\"\nqx = \"Q1\"\nqy = \"Q2\"\nqz = \"Q3\"\nqw = \"Q4\"\n",
    )?;
    // a turn of 3 deg/s about z, and an error of 10 arcsec that changes sign from frame to frame
    let mut table = "TIME,Q1,Q2,Q3,Q4\n".to_owned();
    for k in 0..600_i32 {
        let t = 0.5 * f64::from(k);
        let error = if (k * k) % 7 < 3 { 10.0 } else { -10.0 };
        let half = 0.5 * (-3.0 * t + error / 3600.0).to_radians();
        table.push_str(&format!("{t},0,0,{:.12},{:.12}\n", half.sin(), half.cos()));
    }
    fs::write(bundle.join("attitude.csv"), table)?;
    let got = answer(boresight().arg("assess").arg(&bundle))?;
    assert_eq!(got["format"], "boresight-assess/1");
    assert_eq!(got["method"], "rigid_rotator");
    let total = got["total_arcsec"][2].as_f64().ok_or("total")?;
    // +10 in five of seven frames: 10 sqrt(1 - (3/7)^2), less the rate that the fit takes off
    assert!((total - 9.035).abs() < 0.05, "{total}");
    let rpm = got["rotator"]["spin_rpm"].as_f64().ok_or("rpm")?;
    assert!((rpm - 0.5).abs() < 1e-4, "{rpm}");
    Ok(())
}

/// The page's example: IMAGE simulated and assessed, with everything that is written.
#[test]
fn the_assessment_of_the_page_is_that_of_the_command() -> Done {
    let page =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/assess.md"))?;
    let dir = tempfile::tempdir()?;
    let lines = page.lines().filter(|l| l.starts_with("boresight "));
    let mut commands = 0;
    for line in lines {
        let words = line.split_whitespace().skip(1);
        let done = boresight().args(words).current_dir(dir.path()).output()?;
        assert!(
            done.status.success(),
            "{line}: {}",
            String::from_utf8_lossy(&done.stderr)
        );
        commands += 1;
    }
    assert_eq!(commands, 2);
    let results = dir.path().join("results");
    for file in [
        "assess.json",
        "summary.txt",
        "noise.svg",
        "residual.svg",
        "residuals_attitude.parquet",
    ] {
        assert!(fs::metadata(results.join(file))?.len() > 0, "{file}");
    }
    let got: Value = serde_json::from_slice(&fs::read(results.join("assess.json"))?)?;
    let text = page
        .split("```json")
        .nth(1)
        .and_then(|t| t.split("```").next())
        .ok_or("json")?;
    let shown: Value = serde_json::from_str(text)?;
    for (key, value) in shown.as_object().ok_or("object")? {
        let Some(values) = value.as_array() else {
            assert_eq!(&got[key], value, "{key}");
            continue;
        };
        for (k, value) in values.iter().enumerate() {
            let (a, b) = (
                got[key][k].as_f64().ok_or("got")?,
                value.as_f64().ok_or("shown")?,
            );
            // the printed digits: three, or two of an uncertainty
            assert!(
                (a - b).abs() <= 0.02 * b.abs().max(0.05) + 0.005,
                "{key}: {a} {b}"
            );
        }
    }
    Ok(())
}

/// Recorded quaternions of two cameras, where the data are.
#[test]
fn assess_takes_the_recorded_cameras() -> Done {
    let Some(bundle) = flight_data("tess-s1-cam1-vs-cam4") else {
        return Ok(());
    };
    let got = answer(boresight().arg("assess").arg(&bundle))?;
    assert_eq!(got["method"], "reference");
    assert_eq!(got["frames"]["frames"], 19227);
    for axis in 0..3 {
        let of = |key: &str| got[key][axis].as_f64().ok_or(key.to_owned());
        assert!(of("inherent_arcsec")? <= of("total_arcsec")?);
        assert!(of("total_arcsec")? < 2.0);
    }
    // a method whose table is missing: one message, exit 2
    let refused = boresight()
        .args(["assess", "--method", "gyro"])
        .arg(&bundle)
        .output()?;
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8(refused.stderr)?.contains("`rates`"));
    Ok(())
}
