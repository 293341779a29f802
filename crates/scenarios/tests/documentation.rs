//! The scenario on the page of the format is read and simulated.

use std::path::Path;

use scenarios::{Scenario, simulate};

#[test]
fn the_example_of_the_page_makes_a_bundle() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats/scenario.md");
    let page = std::fs::read_to_string(page).unwrap();
    let example = page
        .split("```toml\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next())
        .unwrap();
    let bundle = simulate(&Scenario::parse(example, "scenario.md").unwrap()).unwrap();
    assert_eq!(bundle.stars.unwrap().frames(), 120);
    assert!(bundle.reference.unwrap().sigma_arcsec.is_some());
    assert!(bundle.rates.is_some() && bundle.catalog.is_some());
    let channels = bundle.housekeeping.unwrap().channels;
    let names: Vec<&str> = channels.keys().map(String::as_str).collect();
    assert_eq!(names, ["bracket_c", "vx_km_s", "vy_km_s", "vz_km_s"]);
}
