//! The power that is usual around a frequency: what a line is held against.
//!
//! Not physics: sums over a grid.

/// Which points of a grid are around one of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    /// Grid points in 1/span.
    pub(crate) finer: usize,
    /// Independent frequencies on each side.
    pub(crate) count: usize,
    /// Nearer ones, which hold a line's own power.
    pub(crate) guard: usize,
}

impl Around {
    /// Sum of the `power` around grid point `k`, and how many independent frequencies it is of.
    pub(crate) fn sum(self, power: &[f64], k: usize) -> (f64, f64) {
        let (mut sum, mut count) = (0.0, 0.0);
        for j in self.guard + 1..=self.guard + self.count {
            let off = j * self.finer;
            for at in [k.checked_sub(off), Some(k + off)].into_iter().flatten() {
                if let Some(p) = power.get(at) {
                    sum += p;
                    count += 1.0;
                }
            }
        }
        (sum, count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_both_sides_count_but_for_the_line() {
        let around = Around {
            finer: 2,
            count: 2,
            guard: 1,
        };
        let power: Vec<f64> = (0..12).map(f64::from).collect();
        // 4 and 6 points away: 1 and 9 on one side each of 5; 11 on the other
        assert_eq!(around.sum(&power, 5), (1.0 + 9.0 + 11.0, 3.0));
        assert_eq!(around.sum(&power, 0), (4.0 + 6.0, 2.0));
    }
}
