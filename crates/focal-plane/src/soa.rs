//! Views on structures of arrays: one slice for each component.
//!
//! Kernels read and write whole columns, so that the compiler can treat several stars with one
//! instruction. The views hold no memory; the caller owns it.
//!
//! ```
//! use focal_plane::{Camera, PointsMut, Vectors};
//! let camera = Camera::from_focal_length_px([1024, 1024], 2903.7)?;
//! let (x, y, z) = ([0.0, 0.01], [0.0, 0.02], [1.0, -1.0]);
//! let (mut px, mut py) = ([0.0; 2], [0.0; 2]);
//! camera.project_into(
//!     Vectors { x: &x, y: &y, z: &z },
//!     PointsMut { x: &mut px, y: &mut py },
//! );
//! assert_eq!([px[0], py[0]], [0.0, 0.0]);
//! assert!(px[1].is_nan()); // behind the camera
//! # Ok::<(), focal_plane::CameraError>(())
//! ```
//!
//! Not physics: layout of memory only.

macro_rules! views {
    ($shared:ident, $exclusive:ident, $what:literal, $($field:ident: $doc:literal),+) => {
        #[doc = concat!("Shared view on ", $what, "; all slices have one length.")]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $shared<'a> {
            $(#[doc = $doc] pub $field: &'a [f64],)+
        }

        #[doc = concat!("Exclusive view on ", $what, "; all slices have one length.")]
        #[derive(Debug, PartialEq)]
        pub struct $exclusive<'a> {
            $(#[doc = $doc] pub $field: &'a mut [f64],)+
        }

        impl<'a> $shared<'a> {
            /// Number of elements.
            ///
            /// # Panics
            ///
            /// If the slices differ in length.
            #[must_use]
            pub fn len(&self) -> usize {
                let lengths = [$(self.$field.len()),+];
                assert!(
                    lengths.iter().all(|&n| n == lengths[0]),
                    "columns of different lengths: {lengths:?}"
                );
                lengths[0]
            }

            /// Whether there is no element.
            ///
            /// # Panics
            ///
            /// If the slices differ in length.
            #[must_use]
            pub fn is_empty(&self) -> bool {
                self.len() == 0
            }

            /// The elements of a range.
            ///
            /// # Panics
            ///
            /// If the range reaches beyond a slice.
            #[must_use]
            pub fn range(&self, range: std::ops::Range<usize>) -> Self {
                Self { $($field: &self.$field[range.clone()]),+ }
            }
        }

        impl $exclusive<'_> {
            /// Number of elements.
            ///
            /// # Panics
            ///
            /// If the slices differ in length.
            #[must_use]
            pub fn len(&self) -> usize {
                self.as_shared().len()
            }

            /// Whether there is no element.
            ///
            /// # Panics
            ///
            /// If the slices differ in length.
            #[must_use]
            pub fn is_empty(&self) -> bool {
                self.len() == 0
            }

            /// The same view with a shorter life, to hand out more than once.
            #[must_use]
            pub fn reborrow(&mut self) -> $exclusive<'_> {
                $exclusive { $($field: &mut *self.$field),+ }
            }

            /// A reading view on the same memory.
            #[must_use]
            pub fn as_shared(&self) -> $shared<'_> {
                $shared { $($field: &*self.$field),+ }
            }

            /// The elements of a range.
            ///
            /// # Panics
            ///
            /// If the range reaches beyond a slice.
            #[must_use]
            pub fn range(&mut self, range: std::ops::Range<usize>) -> $exclusive<'_> {
                $exclusive { $($field: &mut self.$field[range.clone()]),+ }
            }
        }
    };
}

views!(Points, PointsMut, "points of a plane",
    x: "Along the columns.", y: "Along the rows.");
views!(Vectors, VectorsMut, "vectors in space",
    x: "First component.", y: "Second component.", z: "Third component.");
views!(Quaternions, QuaternionsMut, "unit quaternions, scalar `w`, Hamilton",
    x: "`i` component.", y: "`j` component.", z: "`k` component.", w: "Scalar component.");

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "values are copied, not computed")]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "columns of different lengths: [2, 1]")]
    fn unequal_columns_are_a_bug() {
        let _ = Points {
            x: &[0.0, 1.0],
            y: &[0.0],
        }
        .len();
    }

    #[test]
    fn views_share_memory() {
        let (mut x, mut y) = ([1.0, 2.0], [3.0, 4.0]);
        let mut points = PointsMut {
            x: &mut x,
            y: &mut y,
        };
        points.reborrow().x[0] = 5.0;
        points.range(1..2).y[0] = 6.0;
        assert_eq!(points.as_shared().range(0..1).x, [5.0]);
        assert_eq!((points.len(), points.is_empty()), (2, false));
        assert_eq!(y, [3.0, 6.0]);
    }
}
