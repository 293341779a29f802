//! A frame with two axes, and the axes of the pictures that star trackers need.
//!
//! Not physics: drawing.

use crate::{Axis, Mark};

/// A frame with two axes and what is painted in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) marks: Vec<Mark>,
    /// One unit is as long on both axes.
    pub(crate) equal: bool,
    /// The ends of the axes are an edge, which is drawn where more than that is shown.
    pub(crate) edged: bool,
}

impl Panel {
    /// An empty panel.
    #[must_use]
    pub fn new(title: &str, x: Axis, y: Axis) -> Self {
        Self {
            title: title.to_owned(),
            x,
            y,
            marks: vec![],
            equal: false,
            edged: false,
        }
    }

    /// Spectra: frequency in Hz against density in `unit`, both logarithmic.
    #[must_use]
    pub fn psd(title: &str, unit: &str) -> Self {
        let y = Axis::log(&format!("one-sided PSD, {unit}"));
        Self::new(title, Axis::log("frequency, Hz"), y)
    }

    /// A series: time in s against `label`.
    #[must_use]
    pub fn time(title: &str, label: &str) -> Self {
        Self::new(title, Axis::linear("time, s"), Axis::linear(label))
    }

    /// The detector of `half` px to either side of its centre, one px as long on both axes.
    #[must_use]
    pub fn focal_plane(title: &str, half: [f64; 2]) -> Self {
        Self {
            equal: true,
            edged: true,
            ..Self::new(
                title,
                Axis::linear("x, px").over(-half[0], half[0]),
                Axis::linear("y, px").over(-half[1], half[1]),
            )
        }
    }

    /// Position inside a pixel, 0 to 1 from edge to edge, against `label`.
    #[must_use]
    pub fn phase(title: &str, label: &str) -> Self {
        let x = Axis::linear("pixel phase, px from the edge").over(0.0, 1.0);
        Self::new(title, x, Axis::linear(label))
    }

    /// A map of pixels of the detector, in px from its centre.
    #[must_use]
    pub fn map(title: &str) -> Self {
        Self {
            equal: true,
            ..Self::new(title, Axis::linear("x, px"), Axis::linear("y, px"))
        }
    }

    /// The same with one more mark, painted over those before.
    #[must_use]
    pub fn with(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// The same with the x axis from `from` to `to`.
    #[must_use]
    pub fn x_over(mut self, from: f64, to: f64) -> Self {
        self.x = self.x.over(from, to);
        self
    }

    /// The same with the y axis from `from` to `to`.
    #[must_use]
    pub fn y_over(mut self, from: f64, to: f64) -> Self {
        self.y = self.y.over(from, to);
        self
    }

    /// Smallest and largest value on an axis (0 is x) that can be shown there.
    pub(crate) fn data(&self, axis: usize) -> Option<[f64; 2]> {
        let log = if axis == 0 { self.x.log } else { self.y.log };
        let mut ends: Option<[f64; 2]> = None;
        let shown = self
            .marks
            .iter()
            .filter(|mark| mark.ranges)
            .flat_map(|mark| mark.extent(axis))
            .filter(|v| v.is_finite() && (!log || *v > 0.0));
        for v in shown {
            ends = Some(match ends {
                None => [v, v],
                Some([low, high]) => [low.min(v), high.max(v)],
            });
        }
        ends
    }
}
