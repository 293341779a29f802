//! What is painted inside a panel.
//!
//! Not physics: drawing.

use crate::{Colour, Scale};

/// One thing that is painted; NaN is never shown, and breaks a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    pub(crate) name: Option<String>,
    pub(crate) colour: Colour,
    pub(crate) opacity: f64,
    pub(crate) shape: Shape,
    /// Whether the ranges of the axes follow it.
    pub(crate) ranges: bool,
}

/// Its form.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape {
    /// Lines of one look: of a hundred draws, say. Each is its x and y.
    Lines {
        /// The lines.
        lines: Vec<[Vec<f64>; 2]>,
        /// Width, px.
        width: f64,
        /// Whether dashed.
        dashed: bool,
    },
    /// The area between two curves.
    Band {
        /// Places.
        x: Vec<f64>,
        /// Lower curve.
        low: Vec<f64>,
        /// Upper curve.
        high: Vec<f64>,
    },
    /// Points, with bars of an error if it is not empty.
    Points {
        /// Places.
        x: Vec<f64>,
        /// Values.
        y: Vec<f64>,
        /// 1 sigma of each value, or nothing.
        sigma: Vec<f64>,
        /// Radius, px.
        radius: f64,
    },
    /// Arrows at `x, y` with components in a unit of their own.
    Arrows {
        /// Places.
        x: Vec<f64>,
        /// Places.
        y: Vec<f64>,
        /// Along x.
        dx: Vec<f64>,
        /// Along y.
        dy: Vec<f64>,
        /// Unit of the components: the legend shows an arrow of a round number of it.
        unit: String,
        /// What a long arrow stands for; `None`: what nine tenths of these stay below.
        long: Option<f64>,
    },
    /// Cells of one size, coloured by their value; a bar beside the panel has the scale.
    Cells {
        /// Centres.
        x: Vec<f64>,
        /// Centres.
        y: Vec<f64>,
        /// Width and height.
        size: [f64; 2],
        /// Values.
        value: Vec<f64>,
        /// Colours.
        scale: Scale,
        /// Name and unit of the values.
        label: String,
    },
    /// A vertical line across the panel.
    VerticalRule {
        /// Place.
        x: f64,
    },
    /// A horizontal line across the panel.
    HorizontalRule {
        /// Place.
        y: f64,
    },
}

impl Mark {
    fn new(shape: Shape, colour: Colour) -> Self {
        Self {
            name: None,
            colour,
            opacity: 1.0,
            shape,
            ranges: true,
        }
    }

    /// A line through `x, y`.
    ///
    /// # Panics
    ///
    /// If the slices differ in length; so for every mark.
    #[must_use]
    pub fn line(x: &[f64], y: &[f64], colour: Colour) -> Self {
        assert_eq!(x.len(), y.len(), "one y for each x");
        Self::lines(vec![[x.to_vec(), y.to_vec()]], 1.6, colour)
    }

    /// Thin lines of one look over the same `x`: the draws of an ensemble.
    ///
    /// # Panics
    ///
    /// As [`line`](Self::line).
    #[must_use]
    pub fn draws(x: &[f64], draws: &[Vec<f64>], colour: Colour) -> Self {
        assert!(draws.iter().all(|y| y.len() == x.len()), "one y for each x");
        let lines = draws.iter().map(|y| [x.to_vec(), y.clone()]).collect();
        Self::lines(lines, 0.7, colour)
    }

    /// Lines of any number and width, px.
    #[must_use]
    pub fn lines(lines: Vec<[Vec<f64>; 2]>, width: f64, colour: Colour) -> Self {
        let shape = Shape::Lines {
            lines,
            width,
            dashed: false,
        };
        Self::new(shape, colour)
    }

    /// The area between `low` and `high`.
    ///
    /// # Panics
    ///
    /// As [`line`](Self::line).
    #[must_use]
    pub fn band(x: &[f64], low: &[f64], high: &[f64], colour: Colour) -> Self {
        assert!(
            x.len() == low.len() && x.len() == high.len(),
            "two values for each x"
        );
        let shape = Shape::Band {
            x: x.to_vec(),
            low: low.to_vec(),
            high: high.to_vec(),
        };
        Self {
            opacity: 0.25,
            ..Self::new(shape, colour)
        }
    }

    /// Points of `radius` px.
    ///
    /// # Panics
    ///
    /// As [`line`](Self::line).
    #[must_use]
    pub fn points(x: &[f64], y: &[f64], radius: f64, colour: Colour) -> Self {
        assert_eq!(x.len(), y.len(), "one y for each x");
        let shape = Shape::Points {
            x: x.to_vec(),
            y: y.to_vec(),
            sigma: vec![],
            radius,
        };
        Self::new(shape, colour)
    }

    /// Points with bars of 1 sigma.
    ///
    /// # Panics
    ///
    /// As [`line`](Self::line).
    #[must_use]
    pub fn with_errors(x: &[f64], y: &[f64], sigma: &[f64], colour: Colour) -> Self {
        assert!(
            x.len() == y.len() && x.len() == sigma.len(),
            "one error for each value"
        );
        let shape = Shape::Points {
            x: x.to_vec(),
            y: y.to_vec(),
            sigma: sigma.to_vec(),
            radius: 2.2,
        };
        Self::new(shape, colour)
    }

    /// Arrows of `dx, dy` in `unit`.
    ///
    /// # Panics
    ///
    /// As [`line`](Self::line).
    #[must_use]
    pub fn arrows(at: [&[f64]; 2], d: [&[f64]; 2], unit: &str, colour: Colour) -> Self {
        let n = at[0].len();
        assert!(
            at[1].len() == n && d[0].len() == n && d[1].len() == n,
            "one arrow for each place"
        );
        let shape = Shape::Arrows {
            x: at[0].to_vec(),
            y: at[1].to_vec(),
            dx: d[0].to_vec(),
            dy: d[1].to_vec(),
            unit: unit.to_owned(),
            long: None,
        };
        Self::new(shape, colour)
    }

    /// Cells of `size` around `x, y`, coloured by `value`; `label` is the value's name and unit.
    ///
    /// # Panics
    ///
    /// As [`line`](Self::line).
    #[must_use]
    pub fn cells(
        at: [&[f64]; 2],
        size: [f64; 2],
        value: &[f64],
        scale: Scale,
        label: &str,
    ) -> Self {
        assert!(
            at[0].len() == value.len() && at[1].len() == value.len(),
            "one value for each place"
        );
        let shape = Shape::Cells {
            x: at[0].to_vec(),
            y: at[1].to_vec(),
            size,
            value: value.to_vec(),
            scale,
            label: label.to_owned(),
        };
        Self::new(shape, Colour::INK)
    }

    /// A vertical line at `x`.
    #[must_use]
    pub fn vertical(x: f64, colour: Colour) -> Self {
        Self::new(Shape::VerticalRule { x }, colour)
    }

    /// A horizontal line at `y`.
    #[must_use]
    pub fn horizontal(y: f64, colour: Colour) -> Self {
        Self::new(Shape::HorizontalRule { y }, colour)
    }

    /// The same with an entry in the legend.
    #[must_use]
    pub fn named(self, name: &str) -> Self {
        Self {
            name: Some(name.to_owned()),
            ..self
        }
    }

    /// The same at another opacity, 0 to 1.
    #[must_use]
    pub fn at_opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    /// The same, cut off at the frame where it is larger than the other marks.
    #[must_use]
    pub fn beyond_the_frame(self) -> Self {
        Self {
            ranges: false,
            ..self
        }
    }

    /// The same line, dashed; other marks are as they are.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        if let Shape::Lines { dashed, .. } = &mut self.shape {
            *dashed = true;
        }
        self
    }

    /// The same line at another width, px; other marks are as they are.
    #[must_use]
    pub fn wide(mut self, px: f64) -> Self {
        if let Shape::Lines { width, .. } = &mut self.shape {
            *width = px;
        }
        self
    }

    /// The same arrows, a long one standing for `value`: arrows of several panels can be compared. Other
    /// marks are as they are, and so are arrows of a value that is not positive.
    #[must_use]
    pub fn to_scale(mut self, value: f64) -> Self {
        if let Shape::Arrows { long, .. } = &mut self.shape {
            *long = (value > 0.0 && value.is_finite()).then_some(value);
        }
        self
    }

    /// All x and all y that the axes must show.
    pub(crate) fn extent(&self, axis: usize) -> Box<dyn Iterator<Item = f64> + '_> {
        fn of(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
            values.iter().copied()
        }
        match (&self.shape, axis) {
            (Shape::Lines { lines, .. }, _) => Box::new(
                lines
                    .iter()
                    .flat_map(move |line| line[axis].iter().copied()),
            ),
            (Shape::Band { x, .. }, 0) | (Shape::Points { x, .. } | Shape::Arrows { x, .. }, 0) => {
                Box::new(of(x))
            }
            (Shape::Band { low, high, .. }, _) => Box::new(of(low).chain(of(high))),
            (Shape::Points { y, sigma, .. }, _) if !sigma.is_empty() => {
                let pairs = y.iter().zip(sigma);
                Box::new(pairs.flat_map(|(y, s)| [*y, y - s, y + s]))
            }
            (Shape::Points { y, .. } | Shape::Arrows { y, .. }, _) => Box::new(of(y)),
            (Shape::Cells { x, y, size, .. }, _) => {
                let half = 0.5 * size[axis];
                let at = if axis == 0 { x } else { y };
                Box::new(at.iter().flat_map(move |v| [v - half, v + half]))
            }
            (Shape::VerticalRule { x }, 0) => Box::new(std::iter::once(*x)),
            (Shape::HorizontalRule { y }, 1) => Box::new(std::iter::once(*y)),
            _ => Box::new(std::iter::empty()),
        }
    }
}
