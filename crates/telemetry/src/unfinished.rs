//! What this process began to write and has not finished. Ctrl-C has to take it away: no destructor runs then.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// All of this process.
static ALL: Mutex<Vec<Remains>> = Mutex::new(Vec::new());

/// A partial file or folder, and the folders that were made for it, outermost first.
#[derive(Clone, Debug, PartialEq)]
struct Remains {
    partial: PathBuf,
    made: Vec<PathBuf>,
}

impl Remains {
    fn remove(&self) {
        // nothing to do about a failure while an error is on its way, or the end
        let _ = fs::remove_dir_all(&self.partial).or_else(|_| fs::remove_file(&self.partial));
        for path in self.made.iter().rev() {
            let _ = fs::remove_dir(path);
        }
    }
}

/// Something that is being written. Unless it is finished, dropping it leaves the disk as it was.
#[derive(Debug)]
pub(crate) struct Unfinished(Remains);

impl Unfinished {
    /// To be made at `partial`; `made` are the folders that will be made for it, outermost first.
    pub(crate) fn begin(partial: PathBuf, made: Vec<PathBuf>) -> Self {
        let remains = Remains { partial, made };
        all().push(remains.clone());
        Self(remains)
    }

    pub(crate) fn partial(&self) -> &Path {
        &self.0.partial
    }

    /// It stands where it belongs.
    pub(crate) fn finish(self) {
        self.forget();
    }

    /// Whether it was unfinished until now.
    fn forget(&self) -> bool {
        let mut all = all();
        let at = all.iter().position(|other| *other == self.0);
        at.map(|at| all.swap_remove(at)).is_some()
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if self.forget() {
            self.0.remove();
        }
    }
}

fn all() -> std::sync::MutexGuard<'static, Vec<Remains>> {
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes away all that this process began to write and has not finished: what a handler of Ctrl-C calls before it ends
/// the process.
pub fn remove_unfinished() {
    all().drain(..).for_each(|remains| remains.remove());
}
