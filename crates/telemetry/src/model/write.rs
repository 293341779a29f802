//! Writing a model file.
//!
//! Source: model format (docs/formats/model.md).

use std::fmt::Write as _;

use super::{EffectEntry, EffectValue, HemAxis, MODEL_FORMAT, Model, ModelKind};

pub(super) fn write(model: &Model) -> String {
    let mut file = Lines(String::new());
    file.text("format", Some(MODEL_FORMAT));
    file.text(
        "kind",
        Some(match model.kind {
            ModelKind::Pbm => "pbm",
            ModelKind::Hem => "hem",
        }),
    );
    file.text("title", model.title.as_deref());

    let tracker = &model.tracker;
    file.table("tracker", |file| {
        let pixels = tracker.pixels.map(|n| n.map(f64::from));
        file.numbers("pixels", pixels.as_ref().map(<[f64; 2]>::as_slice));
        file.number("focal_length_px", tracker.focal_length_px);
        file.numbers(
            "fov_deg",
            tracker.fov_deg.as_ref().map(<[f64; 2]>::as_slice),
        );
        file.number("pixel_centre", tracker.pixel_centre);
        file.number("update_rate_hz", tracker.update_rate_hz);
        file.number("max_stars", tracker.max_stars.map(f64::from));
        file.number("exposure_s", tracker.exposure_s);
    });
    let noise = &model.noise;
    file.table("noise", |file| {
        file.number("temporal_arcsec", noise.temporal_arcsec);
        file.number("centroid_arcsec", noise.centroid_arcsec);
        file.number("distortion_arcsec", noise.distortion_arcsec);
        file.number("distortion_order", noise.distortion_order.map(f64::from));
        let bias = noise.bias_arcsec.as_ref();
        file.numbers("bias_arcsec", bias.map(<[f64; 3]>::as_slice));
    });
    if let Some(hem) = &model.hem {
        for (name, axis) in [("hem.x", &hem.x), ("hem.y", &hem.y), ("hem.z", &hem.z)] {
            file.table(name, |file| file.axis(axis));
        }
    }
    for effect in &model.effects {
        file.effect(effect);
    }
    file.0
}

struct Lines(String);

impl Lines {
    fn line(&mut self, key: &str, value: &str) {
        // writing to memory does not fail
        let _ = writeln!(self.0, "{} = {value}", bare_or_quoted(key));
    }

    fn text(&mut self, key: &str, text: Option<&str>) {
        if let Some(text) = text {
            self.line(key, &toml::Value::from(text).to_string());
        }
    }

    fn number(&mut self, key: &str, number: Option<f64>) {
        if let Some(number) = number {
            self.line(key, &written(number));
        }
    }

    fn numbers(&mut self, key: &str, numbers: Option<&[f64]>) {
        if let Some(numbers) = numbers {
            let items: Vec<String> = numbers.iter().copied().map(written).collect();
            self.line(key, &format!("[{}]", items.join(", ")));
        }
    }

    /// A table, unless it stays empty.
    fn table(&mut self, name: &str, fill: impl FnOnce(&mut Self)) {
        let before = self.0.len();
        let _ = writeln!(self.0, "\n[{name}]");
        let head = self.0.len();
        fill(self);
        if self.0.len() == head {
            self.0.truncate(before);
        }
    }

    fn axis(&mut self, axis: &HemAxis) {
        self.number("sigma_hsf_arcsec", Some(axis.sigma_hsf_arcsec));
        self.number("tau_hsf_s", Some(axis.tau_hsf_s));
        self.number("sigma_tn_arcsec", Some(axis.sigma_tn_arcsec));
    }

    fn effect(&mut self, effect: &EffectEntry) {
        self.0.push_str("\n[[effect]]\n");
        self.text("id", Some(&effect.id));
        for (key, value) in &effect.parameters {
            match value {
                EffectValue::Number(number) => self.number(key, Some(*number)),
                EffectValue::Text(text) => self.text(key, Some(text)),
                EffectValue::Numbers(numbers) => self.numbers(key, Some(numbers)),
            }
        }
    }
}

fn bare_or_quoted(key: &str) -> String {
    let bare = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'-';
    if !key.is_empty() && key.bytes().all(bare) {
        key.into()
    } else {
        toml::Value::from(key).to_string()
    }
}

/// The shortest digits that read back the same.
fn written(number: f64) -> String {
    let size = number.abs();
    if size != 0.0 && !(1e-4..1e15).contains(&size) {
        format!("{number:e}")
    } else {
        // whole numbers stay whole: ids, counts and pixels are
        format!("{number}")
    }
}
