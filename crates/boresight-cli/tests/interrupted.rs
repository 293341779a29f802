//! Ctrl-C: what was half-written goes, and the folders that were made for it.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

type Done = Result<(), Box<dyn std::error::Error>>;

#[test]
fn an_interrupted_run_leaves_nothing_behind() -> Done {
    let world = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/worlds/null_hold.toml");
    let dir = tempfile::tempdir()?;
    // rendering takes seconds, all of them with the folder half-written
    let mut running = Command::new(env!("CARGO_BIN_EXE_boresight"))
        .arg("simulate")
        .arg(&world)
        .arg("--out")
        .arg(dir.path().join("a/b/bundle"))
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()?;
    let begun = || fs::read_dir(dir.path().join("a/b")).is_ok_and(|mut all| all.next().is_some());
    let start = Instant::now();
    while !begun() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(begun(), "it began to write");
    let killed = Command::new("kill")
        .args(["-INT", &running.id().to_string()])
        .status()?;
    assert!(killed.success());
    let ended = running.wait()?;
    assert_eq!(ended.code(), Some(130), "{ended}");
    let left: Vec<_> = fs::read_dir(dir.path())?.collect();
    assert!(left.is_empty(), "{left:?}");
    Ok(())
}
