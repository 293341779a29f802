//! Where the files of a bundle come from: a folder, or memory (an example inside a binary).
//!
//! Source: telemetry bundle format (docs/formats/bundle.md).

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// An opened file.
#[derive(Debug)]
pub enum Source {
    /// On disk.
    File(File),
    /// In memory.
    Memory(Cow<'static, [u8]>),
}

/// A set of files without sub-folders.
pub trait Files {
    /// Names of the files, in any order.
    ///
    /// # Errors
    ///
    /// What the operating system says.
    fn names(&self) -> io::Result<Vec<String>>;

    /// Opens one of them.
    ///
    /// # Errors
    ///
    /// What the operating system says; `NotFound` for a name that does not exist.
    fn open(&self, name: &str) -> io::Result<Source>;

    /// What to call the set in messages: the path of the folder, for instance.
    fn label(&self) -> String;

    /// What to call one of its files in messages.
    fn file_label(&self, name: &str) -> String {
        format!("{}/{name}", self.label())
    }
}

/// A folder on disk.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// A folder that is looked at when it is read.
    #[must_use]
    pub fn at(path: &Path) -> Self {
        Self { path: path.into() }
    }
}

impl Files for Folder {
    fn names(&self) -> io::Result<Vec<String>> {
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&self.path)? {
            let entry = entry?;
            // a name that is no UTF-8 cannot be a file of the format
            if let Ok(name) = entry.file_name().into_string()
                && entry.path().is_file()
            {
                names.push(name);
            }
        }
        Ok(names)
    }

    fn open(&self, name: &str) -> io::Result<Source> {
        File::open(self.path.join(name)).map(Source::File)
    }

    fn label(&self) -> String {
        self.path.display().to_string()
    }

    fn file_label(&self, name: &str) -> String {
        self.path.join(name).display().to_string()
    }
}

/// Files in memory, by name.
///
/// ```
/// use telemetry::{Bundle, MemoryFiles};
/// let files = MemoryFiles::new("example")
///     .with("bundle.toml", "format = \"boresight-bundle/1\"\n")
///     .with("attitude.csv", "t_s,qx,qy,qz,qw\n0.0,0,0,0,1\n0.5,0,0,0,1\n");
/// let bundle = Bundle::read_from(&files)?;
/// assert_eq!(bundle.attitude.map(|a| a.t_s), Some(vec![0.0, 0.5]));
/// # Ok::<(), telemetry::TelemetryError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct MemoryFiles {
    label: String,
    files: BTreeMap<String, Cow<'static, [u8]>>,
}

impl MemoryFiles {
    /// No files yet; `label` names the set in messages.
    #[must_use]
    pub fn new(label: &str) -> Self {
        Self {
            label: label.into(),
            files: BTreeMap::new(),
        }
    }

    /// With one more file, text or bytes that live as long as the program (`include_bytes!`).
    #[must_use]
    pub fn with<B: AsRef<[u8]> + ?Sized>(mut self, name: &str, content: &'static B) -> Self {
        self.files
            .insert(name.into(), Cow::Borrowed(content.as_ref()));
        self
    }

    /// Adds or replaces a file.
    pub fn insert(&mut self, name: &str, content: Vec<u8>) {
        self.files.insert(name.into(), Cow::Owned(content));
    }

    /// Takes a file out.
    pub fn remove(&mut self, name: &str) -> Option<Cow<'static, [u8]>> {
        self.files.remove(name)
    }

    /// The content of a file.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&[u8]> {
        self.files.get(name).map(AsRef::as_ref)
    }
}

impl Files for MemoryFiles {
    fn names(&self) -> io::Result<Vec<String>> {
        Ok(self.files.keys().cloned().collect())
    }

    fn open(&self, name: &str) -> io::Result<Source> {
        self.files
            .get(name)
            .cloned()
            .map(Source::Memory)
            .ok_or_else(|| io::ErrorKind::NotFound.into())
    }

    fn label(&self) -> String {
        self.label.clone()
    }
}
