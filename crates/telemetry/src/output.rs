//! Output that appears whole, or not at all: files are written beside their place and renamed.
//!
//! ```text
//! new folder        NAME.<pid>.partial/...   -> NAME             one rename
//! existing folder   DIR/.<pid>.partial/...   -> DIR/...          one rename a file
//! ```
//!
//! Source: report format, "No output file is ever half-written" (docs/formats/report.md).

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::TelemetryError;
use crate::unfinished::Unfinished;

/// A folder being written. Unless [`commit`](Self::commit) is called, dropping it leaves the disk
/// as it was.
///
/// ```
/// use std::io::Write;
/// use telemetry::Output;
/// let base = std::env::temp_dir().join(format!("telemetry-doc-{}", std::process::id()));
/// let output = Output::new(&base.join("results"))?;
/// output.write("a.txt", |to| to.write_all(b"whole"))?;
/// assert!(!base.join("results").exists());
/// output.commit()?;
/// assert_eq!(std::fs::read(base.join("results/a.txt")).expect("is there"), b"whole");
/// # std::fs::remove_dir_all(&base).expect("can be removed");
/// # Ok::<(), telemetry::TelemetryError>(())
/// ```
#[derive(Debug)]
pub struct Output {
    target: PathBuf,
    unfinished: Unfinished,
    existed: bool,
}

impl Output {
    /// Begins to write a folder, which may exist: then files of the same names are replaced.
    ///
    /// # Errors
    ///
    /// A place where no folder can be made, or a file of that name.
    pub fn new(dir: &Path) -> Result<Self, TelemetryError> {
        let refuse = |error: &io::Error| {
            TelemetryError::io(dir.display().to_string(), "write into the folder", error)
        };
        let existed = dir.exists();
        if existed && !dir.is_dir() {
            return Err(refuse(&io::ErrorKind::NotADirectory.into()));
        }
        let mut made = Vec::new();
        if !existed {
            let above = dir.ancestors().skip(1);
            let missing = above.take_while(|path| !path.as_os_str().is_empty() && !path.exists());
            made = missing.map(PathBuf::from).collect();
            made.reverse();
        }
        let output = Self {
            target: dir.into(),
            unfinished: Unfinished::begin(partial_of(dir, existed), made),
            existed,
        };
        // on an error the drop takes away what was made so far
        match fs::create_dir_all(output.unfinished.partial()) {
            Ok(()) => Ok(output),
            Err(error) => Err(refuse(&error)),
        }
    }

    /// The folder that is being written.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Opens a file of the folder for writing.
    ///
    /// # Errors
    ///
    /// What the operating system says.
    pub fn create(&self, name: &str) -> Result<File, TelemetryError> {
        File::create(self.unfinished.partial().join(name))
            .map_err(|error| self.refuse(name, &error))
    }

    /// Writes a file of the folder, buffered.
    ///
    /// # Errors
    ///
    /// What the operating system or the closure says.
    pub fn write(
        &self,
        name: &str,
        content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), TelemetryError> {
        let mut to = BufWriter::new(self.create(name)?);
        content(&mut to)
            .and_then(|()| to.flush())
            .map_err(|error| self.refuse(name, &error))
    }

    fn refuse(&self, name: &str, error: &io::Error) -> TelemetryError {
        let file = self.target.join(name).display().to_string();
        TelemetryError::io(file, "write", error)
    }

    /// Puts everything in its place.
    ///
    /// # Errors
    ///
    /// What the operating system says.
    pub fn commit(self) -> Result<(), TelemetryError> {
        let moved = if self.existed {
            self.move_files()
        } else {
            fs::rename(self.unfinished.partial(), &self.target)
        };
        moved.map_err(|error| {
            TelemetryError::io(self.target.display().to_string(), "write", &error)
        })?;
        self.unfinished.finish();
        Ok(())
    }

    /// As [`commit`](Self::commit), in the place of an earlier run: of its files, of which these are all
    /// names, those that this run did not write are taken away.
    ///
    /// # Errors
    ///
    /// What the operating system says.
    pub fn commit_in_place_of(self, earlier: &[&str]) -> Result<(), TelemetryError> {
        let stale: Vec<PathBuf> = earlier
            .iter()
            .filter(|name| !self.unfinished.partial().join(name).exists())
            .map(|name| self.target.join(name))
            .filter(|path| path.is_file())
            .collect();
        self.commit()?;
        for path in stale {
            fs::remove_file(&path).map_err(|error| {
                TelemetryError::io(path.display().to_string(), "remove", &error)
            })?;
        }
        Ok(())
    }

    fn move_files(&self) -> io::Result<()> {
        let partial = self.unfinished.partial();
        for entry in fs::read_dir(partial)? {
            let entry = entry?;
            fs::rename(entry.path(), self.target.join(entry.file_name()))?;
        }
        fs::remove_dir(partial)
    }
}

/// A place on the same file system, so that a rename is enough.
fn partial_of(target: &Path, inside: bool) -> PathBuf {
    let id = std::process::id();
    if inside {
        return target.join(format!(".{id}.partial"));
    }
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{id}.partial"));
    target.with_file_name(name)
}

/// Writes one file, whole or not at all.
///
/// # Errors
///
/// What the operating system or the closure says; then the file is as it was.
pub fn write_file(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), TelemetryError> {
    let unfinished = Unfinished::begin(partial_of(path, false), Vec::new());
    let partial = unfinished.partial();
    File::create(partial)
        .map(BufWriter::new)
        .and_then(|mut to| content(&mut to).and_then(|()| to.flush()))
        .and_then(|()| fs::rename(partial, path))
        .map_err(|error| TelemetryError::io(path.display().to_string(), "write", &error))?;
    unfinished.finish();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(name: &str) -> PathBuf {
        let dir = std::env::temp_dir().join(format!("telemetry-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).unwrap();
        dir
    }

    fn names(dir: &Path) -> Vec<String> {
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<_> = fs::read_dir(dir).unwrap().map(name).collect();
        names.sort();
        names
            .into_iter()
            .map(|n| n.into_string().unwrap())
            .collect()
    }

    #[test]
    fn nothing_is_left_without_commit() {
        let base = place("drop");
        let output = Output::new(&base.join("a/b")).unwrap();
        output.write("x", |to| to.write_all(b"1")).unwrap();
        drop(output);
        assert!(names(&base).is_empty(), "left: {:?}", names(&base));

        fs::create_dir(base.join("old")).unwrap();
        fs::write(base.join("old/x"), "old").unwrap();
        let output = Output::new(&base.join("old")).unwrap();
        output.write("x", |to| to.write_all(b"new")).unwrap();
        drop(output);
        assert_eq!(names(&base.join("old")), ["x"]);
        assert_eq!(fs::read(base.join("old/x")).unwrap(), b"old");
        fs::remove_dir_all(base).unwrap();
    }

    #[test]
    fn commit_replaces_files_and_keeps_others() {
        let base = place("commit");
        fs::write(base.join("x"), "old").unwrap();
        fs::write(base.join("y"), "mine").unwrap();
        let output = Output::new(&base).unwrap();
        output.write("x", |to| to.write_all(b"new")).unwrap();
        output.commit().unwrap();
        assert_eq!(names(&base), ["x", "y"]);
        assert_eq!(fs::read(base.join("x")).unwrap(), b"new");
        fs::remove_dir_all(base).unwrap();
    }

    #[test]
    fn an_earlier_run_leaves_nothing_behind() {
        let base = place("earlier");
        for name in ["x", "y", "z"] {
            fs::write(base.join(name), "old").unwrap();
        }
        let output = Output::new(&base).unwrap();
        output.write("x", |to| to.write_all(b"new")).unwrap();
        output.commit_in_place_of(&["x", "y", "never"]).unwrap();
        assert_eq!(names(&base), ["x", "z"]);
        assert_eq!(fs::read(base.join("x")).unwrap(), b"new");
        fs::remove_dir_all(base).unwrap();
    }

    #[test]
    fn a_failed_file_leaves_the_old_one() {
        let base = place("file");
        let path = base.join("x");
        write_file(&path, |to| to.write_all(b"old")).unwrap();
        let broken = write_file(&path, |to| {
            to.write_all(b"half")?;
            Err(io::ErrorKind::StorageFull.into())
        });
        assert!(matches!(broken, Err(TelemetryError::Io { .. })));
        assert_eq!(names(&base), ["x"]);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        fs::remove_dir_all(base).unwrap();
    }

    #[test]
    fn a_file_where_the_folder_should_be_is_an_error() {
        let base = place("clash");
        fs::write(base.join("x"), "").unwrap();
        assert!(Output::new(&base.join("x")).is_err());
        assert!(Output::new(&base.join("x/y")).is_err());
        assert_eq!(names(&base), ["x"]);
        fs::remove_dir_all(base).unwrap();
    }
}
