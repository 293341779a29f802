//! Which window belongs to which star row, and whether there is anything in it.
//!
//! Not physics: bookkeeping.

use std::collections::HashMap;

use focal_plane::StarFrames;
use telemetry::WindowTable;

use crate::sample::{on_a_detector, read_enough};

/// The window of each star row, by time and slot, as its place in the table. `None` where there is none, or none that
/// can be used: its first pixel lies on no detector, or half of its pixels or more have no value.
#[must_use]
pub fn windows_of_rows(frames: &StarFrames, windows: &WindowTable) -> Vec<Option<usize>> {
    let key = |t_s: f64, slot: i32| (t_s.to_bits(), slot);
    let at: HashMap<(u64, i32), usize> = (0..windows.len())
        .filter(|&i| usable(windows, i))
        .map(|i| (key(windows.t_s[i], windows.slot[i]), i))
        .collect();
    (0..frames.frames())
        .flat_map(|k| frames.rows_of(k).map(move |row| (k, row)))
        .map(|(k, row)| at.get(&key(frames.t_s[k], frames.slot[row])).copied())
        .collect()
}

fn usable(windows: &WindowTable, i: usize) -> bool {
    let unread = |p: &usize| windows.unread.get(*p).copied().unwrap_or(false);
    let values = windows.window(i);
    let read = (0..values.len()).filter(|p| !unread(p)).map(|p| values[p]);
    on_a_detector([windows.x0_px[i], windows.y0_px[i]]) && read_enough(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of four rows one has no window, one a window without a place and one a window of which half is not read.
    #[test]
    fn a_window_without_place_or_values_is_none() {
        let mut frames = StarFrames::new();
        let mut windows = WindowTable {
            size: [2, 2],
            unread: vec![false; 4],
            ..WindowTable::default()
        };
        for (k, x0_px) in [10.0, f64::NAN, 10.0, 10.0].into_iter().enumerate() {
            let t_s = k as f64;
            frames.begin(t_s);
            frames.push(3, 7, 11.0, 11.0);
            // half a step late: of no row
            windows.t_s.push(if k == 3 { t_s + 0.5 } else { t_s });
            windows.slot.push(3);
            windows.x0_px.push(x0_px);
            windows.y0_px.push(10.0);
            windows.background.push(1.0);
            let other = if k == 2 { f64::NAN } else { 2.0 };
            windows.pixels.extend([2.0, 2.0, other, other]);
        }
        let found = windows_of_rows(&frames, &windows);
        assert_eq!(found, [Some(0), None, None, None]);
        windows.unread = vec![false, false, true, true];
        let found = windows_of_rows(&frames, &windows);
        assert_eq!(found, [Some(0), None, Some(2), None]);
    }
}
