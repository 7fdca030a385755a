//! A body that is divided once, in files: the ranks of later runs read their parts, and none of them holds the whole mesh.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::setup_ranks::{ExchangeError, SetupRanks};
use super::{Setup, SimulationError};
use crate::app::case::Case;
use crate::app::checkpoint::division_of;
use crate::app::plausibility::Examination;
use crate::checksum::Fnv;
use crate::input::{InputError, InputErrors};
use crate::las::{Comm, Message, RealBackend};
use crate::output;
use crate::sealed_file::{self, Seal, SealError};
use crate::tissue::micro_scale::TissueField;
use crate::tissue::two_scale::{pack, unpack};

/// The file that describes the division, written last.
const HEADER: &str = "body.bin";
/// The file with the materials that depend on the mesh, for the ranks of the RVEs.
const FIELDS: &str = "fields.bin";
/// The most parts: their numbers in the names of files have five digits.
const MOST_PARTS: usize = 100_000;

fn part_name(rank: usize) -> String {
    format!("part-{rank:05}.bin")
}

/// The files of a divided body.
#[derive(Debug)]
pub struct BodyFiles {
    folder: PathBuf,
    /// What to do with a file that cannot be used.
    cure: String,
    header: Header,
}

/// What a division depends on, and its files.
#[derive(Debug, Deserialize, Serialize)]
struct Header {
    program: String,
    backend: String,
    /// The case without what may change.
    case: String,
    /// The files that the mesh and the fields of the case come from, with the hash of each.
    sources: Vec<(String, u64)>,
    parts: Vec<Listed>,
    fields: Option<Listed>,
}

/// The length and the hash of a file, which distinguish it from that of another division.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
struct Listed {
    bytes: u64,
    hash: u64,
}

/// What [`BodyFiles::create`] has written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DivisionReport {
    /// The number of elements of the body.
    pub elements: usize,
    /// The size of the largest file, bytes.
    pub largest: u64,
    /// The warnings of the readers and of the examination of the case.
    pub warnings: Vec<String>,
}

impl BodyFiles {
    /// Reads a case, divides its body among `ranks` ranks, and writes the parts to a folder. An earlier division there is
    /// replaced once the body has been divided. Runs on backend `B` with as many ranks of the body can read the parts.
    ///
    /// # Errors
    /// Returns [`SimulationError`] if there are fewer than two or more than 100 000 ranks, if an input file cannot be read or
    /// does not match the case, if the body cannot be divided, or if a file cannot be written or would replace one that is
    /// not part of a division.
    pub fn create<B: RealBackend, N: RealBackend>(
        context: B::Context,
        of_rves: N::Context,
        case: &Case,
        ranks: usize,
        folder: &Path,
    ) -> Result<DivisionReport, SimulationError<B::Error>> {
        if !(2..=MOST_PARTS).contains(&ranks) {
            let problem = format!("its body is to be divided among {ranks} ranks");
            let (expected, cure) =
                (format!("2 to {MOST_PARTS} ranks"), "a body on one rank needs no division: run it without");
            return Err(InputErrors::from(InputError::in_file(&case.file, problem, expected, cure)).into());
        }
        let files = FileRanks::new(folder, ranks);
        files.earlier()?;
        // A file that changes after this is noticed by the run.
        let sources = hashes(case)?;
        let setup = Setup::<B, TissueField<N>>::with_material(context, case.clone(), &files, |materials, mesh| {
            TissueField::new(of_rves, materials, mesh)
        })?;
        let FileRanks { parts, fields, .. } = files;
        let header = Header {
            program: env!("CARGO_PKG_VERSION").into(),
            backend: B::NAME.into(),
            case: division_of(case).text,
            sources,
            parts: parts.into_inner(),
            fields: fields.get(),
        };
        let largest = header.parts.iter().map(|part| part.bytes).max().unwrap_or(0);
        header.write(folder)?;
        let mut warnings = setup.warnings().to_vec();
        warnings.extend(setup.floppy_networks(Examination::Quick).warnings);
        Ok(DivisionReport { elements: setup.mesh().whole().elements, largest, warnings })
    }

    /// Opens the files of a division for a run, on one rank, which gives them to the others ([`BodyFiles::on_all`]).
    ///
    /// # Errors
    /// Returns [`InputErrors`] if there is no division, or if it is one of another case, backend or number of ranks.
    pub fn open(folder: &Path, case: &Case, backend: &str, ranks: usize) -> Result<Self, InputErrors> {
        if folder.is_file() {
            let cure = "name the folder that `biotissue divide` has written";
            return Err(invalid(folder, "is a file", cure));
        }
        let (case_file, out) = (case.file.display(), folder.display());
        let cure = format!("divide the body again: `biotissue divide {case_file} --ranks {ranks} --out {out}`");
        let other = |problem: String| invalid(&folder.join(HEADER), problem, &cure);
        let content = sealed_file::read(&folder.join(HEADER)).map_err(|error| other(reason(error)))?;
        let undecodable = |error| other(format!("its content cannot be decoded: {error}"));
        let header: Header = postcard::from_bytes(&content).map_err(undecodable)?;
        match header.difference_from(case, backend, ranks)? {
            Some(difference) => Err(other(difference)),
            None => Ok(Self { folder: folder.to_owned(), cure, header }),
        }
    }

    /// Gives the files that one rank, `root`, has opened to all ranks, so that they agree on the division. Collective.
    ///
    /// # Errors
    /// Returns the reason as text if the communication fails.
    pub fn on_all<C: Comm>(opened: Option<Self>, comm: &C, root: usize, folder: &Path) -> Result<Self, String> {
        let message = match &opened {
            Some(files) => pack(&(&files.cure, &files.header)).map_err(|error| error.to_string())?,
            None => Message::new(),
        };
        let message = comm.broadcast(root, message).map_err(|error| error.to_string())?;
        let (cure, header) = unpack(&message).map_err(|error| error.to_string())?;
        Ok(Self { folder: folder.to_owned(), cure, header })
    }

    /// Reads the part of a rank.
    pub(super) fn part(&self, rank: usize) -> Result<Message, InputErrors> {
        self.read(&part_name(rank), self.header.parts.get(rank).copied())
    }

    /// Reads the materials that depend on the mesh.
    pub(super) fn fields(&self) -> Result<Message, InputErrors> {
        self.read(FIELDS, self.header.fields)
    }

    /// Reads a file, and compares it with the one that the division has listed.
    fn read(&self, name: &str, listed: Option<Listed>) -> Result<Message, InputErrors> {
        let path = self.folder.join(name);
        let invalid = |problem: String| invalid(&path, problem, &self.cure);
        let size = fs::metadata(&path).map_err(|error| invalid(format!("cannot be read: {error}")))?.len();
        let mut message = Message::zeros((size as usize).saturating_sub(sealed_file::HEAD + sealed_file::TAIL));
        let (mut read, content) = (0, message.bytes_mut());
        let seal = sealed_file::verify_by(&path, |block| {
            // A file that grows meanwhile does not match its hash.
            if let Some(place) = content.get_mut(read..read + block.len()) {
                place.copy_from_slice(block);
            }
            read += block.len();
        });
        let seal = seal.map_err(|error| invalid(reason(error)))?;
        match listed == Some(seal.into()) {
            true => Ok(message),
            false => Err(invalid(format!("belongs to another division than {HEADER}"))),
        }
    }

    /// Returns the error of a file whose content another build of this program has written.
    pub(super) fn undecodable(&self, error: &postcard::Error) -> InputErrors {
        invalid(&self.folder.join(HEADER), format!("has parts that cannot be decoded: {error}"), &self.cure)
    }
}

impl From<Seal> for Listed {
    fn from(Seal { bytes, hash }: Seal) -> Self {
        Self { bytes, hash }
    }
}

impl Header {
    /// Returns the first difference between this division and one for a run.
    fn difference_from(&self, case: &Case, backend: &str, ranks: usize) -> Result<Option<String>, InputErrors> {
        let (own, parts) = (env!("CARGO_PKG_VERSION"), self.parts.len());
        if self.program != own {
            return Ok(Some(format!("was written by version {}; this is {own}", self.program)));
        }
        if self.backend != backend {
            return Ok(Some(format!("was made for the backend {}, not for {backend}", self.backend)));
        }
        if parts != ranks {
            return Ok(Some(format!("has {parts} parts, and the body has {ranks} ranks")));
        }
        if let Some(difference) = division_of(case).difference_from(&self.case) {
            return Ok(Some(format!("was made for another case: {difference}")));
        }
        let now = hashes(case)?;
        let changed = self.sources.iter().zip(&now).find(|(before, now)| before != now);
        Ok(changed.map(|((name, _), _)| format!("was made with another content of {name}")))
    }

    /// Writes the header of a division whose other files have been written.
    fn write(&self, folder: &Path) -> Result<(), InputErrors> {
        let path = folder.join(HEADER);
        let content = postcard::to_allocvec(self).map_err(io::Error::other);
        let written = output::sync_folder(folder)
            .and(content)
            .and_then(|content| sealed_file::write(&path, |out| out.write_all(&content)))
            .and_then(|_| output::sync_folder(folder));
        written.map_err(|error| unwritable(&path, &error))
    }
}

fn invalid(path: &Path, problem: impl Into<String>, cure: &str) -> InputErrors {
    InputError::in_file(path, problem, "a division of this body by `biotissue divide`", cure).into()
}

fn unwritable(path: &Path, error: &io::Error) -> InputErrors {
    let cure = "check the name, its permissions and the space on the disk, or name another folder";
    InputError::in_file(path, format!("cannot be written: {error}"), "a folder for the parts of the body", cure).into()
}

fn reason(error: SealError) -> String {
    match error {
        SealError::Unreadable(error) => format!("cannot be read: {error}"),
        SealError::Damaged(defect) => defect,
        SealError::Version(found) => {
            format!("has version {found} of the format; this program reads version {}", sealed_file::VERSION)
        }
    }
}

/// Returns the name and the hash of each file that the mesh and the fields of a case come from, once for each use.
fn hashes(case: &Case) -> Result<Vec<(String, u64)>, InputErrors> {
    let hash = |path: &Path| -> io::Result<u64> {
        let (mut file, mut hash, mut block) = (fs::File::open(path)?, Fnv::new(), vec![0; 1 << 16]);
        loop {
            match file.read(&mut block) {
                Ok(0) => return Ok(hash.finish()),
                Ok(read) => hash.add_bytes(&block[..read]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    };
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    // Several fields may be in one file.
    let mut known = BTreeMap::new();
    let hashed = division_of(case).files.into_iter().map(|path| {
        let hash = match known.get(&path) {
            Some(&hash) => hash,
            None => hash(&path).map_err(|error| InputError::unreadable(&path, &error))?,
        };
        let named = (name(&path), hash);
        known.insert(path, hash);
        Ok(named)
    });
    hashed.collect()
}

/// Ranks that are files: what one of them would receive is written.
struct FileRanks<'a> {
    folder: &'a Path,
    count: usize,
    /// Whether an earlier division has been removed.
    is_empty: Cell<bool>,
    parts: RefCell<Vec<Listed>>,
    fields: Cell<Option<Listed>>,
}

impl<'a> FileRanks<'a> {
    fn new(folder: &'a Path, count: usize) -> Self {
        Self { folder, count, is_empty: Cell::new(false), parts: RefCell::default(), fields: Cell::new(None) }
    }

    fn write(&self, name: &str, message: &Message) -> Result<Listed, InputErrors> {
        if !self.is_empty.get() {
            self.remove_earlier()?;
            self.is_empty.set(true);
        }
        let path = self.folder.join(name);
        let written = sealed_file::write(&path, |out| out.write_all(message.bytes()));
        written.map(Listed::from).map_err(|error| unwritable(&path, &error))
    }

    /// Makes the folder, and removes the files of an earlier division, first its header: without one, parts are no
    /// division.
    fn remove_earlier(&self) -> Result<(), InputErrors> {
        fs::create_dir_all(self.folder).map_err(|error| unwritable(self.folder, &error))?;
        let remove = |path: &PathBuf| fs::remove_file(path).map_err(|error| unwritable(path, &error));
        self.earlier()?.iter().try_for_each(remove)
    }

    /// Returns the files of an earlier division, its header first, and those that an interrupted one has left.
    ///
    /// # Errors
    /// Returns [`InputErrors`] if another file has the name of one that will be written.
    fn earlier(&self) -> Result<Vec<PathBuf>, InputErrors> {
        let entries = match fs::read_dir(self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(unwritable(self.folder, &error)),
        };
        let mut earlier = Vec::new();
        for entry in entries {
            let path = entry.map_err(|error| unwritable(self.folder, &error))?.path();
            let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
            let (of, is_temporary) = (output::final_name(name), output::final_name(name) != name);
            let Some(rank) = rank_of(of) else { continue };
            if is_ours(&path).map_err(|error| unwritable(&path, &error))? {
                earlier.push(path);
            } else if rank < self.count && !is_temporary {
                return Err(unwritable(&path, &io::Error::other("another file has this name")));
            }
        }
        earlier.sort_unstable_by_key(|path| !path.ends_with(HEADER));
        Ok(earlier)
    }
}

/// Returns the rank that a file of a division belongs to, 0 for those of all ranks; `None` for another file.
fn rank_of(name: &str) -> Option<usize> {
    if name == HEADER || name == FIELDS {
        return Some(0);
    }
    let rank = name.strip_prefix("part-")?.strip_suffix(".bin")?.parse().ok()?;
    (part_name(rank) == name).then_some(rank)
}

/// Returns true if a file begins like those of a division.
fn is_ours(path: &Path) -> io::Result<bool> {
    if !path.is_file() {
        return Ok(false);
    }
    let mut begin = Vec::new();
    fs::File::open(path)?.take(sealed_file::HEAD as u64).read_to_end(&mut begin)?;
    Ok(begin.len() == sealed_file::HEAD && sealed_file::is_begin(&begin))
}

impl SetupRanks for FileRanks<'_> {
    fn rank(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        self.count
    }

    fn send(&self, rank: usize, message: Message) -> Result<(), ExchangeError> {
        let listed = self.write(&part_name(rank), &message)?;
        self.parts.borrow_mut().push(listed);
        Ok(())
    }

    fn receive(&self) -> Result<Message, ExchangeError> {
        Ok(Message::new())
    }

    fn send_to_rves(&self, message: &Message) -> Result<(), ExchangeError> {
        self.fields.set(Some(self.write(FIELDS, message)?));
        Ok(())
    }

    fn are_files(&self) -> bool {
        true
    }
}
