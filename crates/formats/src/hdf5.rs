//! HDF5: MATLAB `.mat` of version 7.3 and files of h5py. Full matrices are
//! datasets, sparse matrices are groups.
//!
//! MATLAB stores numbers by columns, so HDF5 shows its matrices transposed; a dataset with the
//! attribute `MATLAB_class` is transposed back. A sparse matrix is a group with the datasets
//! `data`, `ir`, `jc` and the number of rows as attribute `MATLAB_sparse`.
//! Source: HDF5 File Format Specification 3.0 (by the crate `hdf5-pure`);
//! MathWorks documentation of `save`, `-v7.3`.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;

use hdf5_pure::{AttrValue, DType, Dataset, File, Group};

use crate::error::{Error, ErrorKind, Location};
use crate::format::{COMPLEX, Format, Item};
use crate::inflate::DecompressionLimit;
use crate::matrix::{DenseLayout, StorageOrder, Symmetry, TripletBuilder, for_each_compressed, from_dense};

pub(crate) const FORMAT: Format = Format {
    name: "hdf5",
    summary: "MATLAB (.mat) of version 7.3, `save -v7.3`, and datasets of h5py (.h5)",
    // The superblock is at the beginning or, after a user block such as
    // MATLAB's, at 512, 1024 or 2048.
    sniff: is_hdf5,
    open,
};

const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Maximum depth of nested groups.
const DEPTH: usize = 8;

/// Count of numbers that any dataset may have, stored or not, and any chunk.
/// Chunks of h5py are not larger.
const MIN_NUMBER_LIMIT: u64 = 1 << 17;

/// Maximum number of bytes that deflate packs into one.
const DEFLATE: u64 = 1032;

/// Maximum number of listed members of a file.
const MEMBERS: usize = 10_000;

/// Maximum number of groups visited, because links may form cycles.
const GROUPS: usize = 1000;

/// Returns whether the content is HDF5.
pub(crate) fn is_hdf5(bytes: &[u8]) -> bool {
    [0, 512, 1024, 2048].iter().any(|&at| bytes.get(at..).is_some_and(|rest| rest.starts_with(MAGIC)))
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let file = catching_panics(Location::File, || File::from_bytes(bytes.to_vec()))?;
    let mut items = Vec::new();
    let root = Rc::new(file.root());
    Traversal { limit: DecompressionLimit::for_file(bytes.len()), groups: 0, items: &mut items }
        .visit_group(&root, "", DEPTH)?;
    Ok(items)
}

/// Calls the crate `hdf5-pure`, and converts its errors and panics. For damaged files it adds
/// numbers without a check (0.47, positions of chunks) and may panic.
pub(crate) fn catching_panics<T>(
    location: Location,
    ask: impl FnOnce() -> Result<T, hdf5_pure::Error>,
) -> Result<T, Error> {
    // The data it was working on is dropped with the error, so no inconsistent
    // state remains visible.
    let answer = catch_unwind(AssertUnwindSafe(ask));
    let problem = match answer {
        Ok(Ok(answer)) => return Ok(answer),
        Ok(Err(error)) => error.to_string(),
        Err(_) => "the file is inconsistent".into(),
    };
    let problem = format!("the HDF5 file cannot be read: {problem}");
    let remedy = "save or copy the file again; if this fails in MATLAB, save without -v7.3";
    Err(Error::new(ErrorKind::Malformed, location, problem, remedy))
}

/// A traversal of the groups of a file.
struct Traversal<'w, 'a> {
    limit: DecompressionLimit,
    /// Number of groups visited so far.
    groups: usize,
    items: &'w mut Vec<Item<'a>>,
}

impl Traversal<'_, '_> {
    /// Adds the contents of a group and of its subgroups.
    fn visit_group(&mut self, group: &Rc<Group>, path: &str, depth: usize) -> Result<(), Error> {
        self.groups += 1;
        let here = || Location::Variable(path.to_string());
        // MATLAB stores the parts of cells and objects in the groups `#refs#` and `#subsystem#`.
        let own = |name: &String| !name.starts_with('#');
        let full = |name: &str| if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
        for name in catching_panics(here(), || group.datasets())?.into_iter().filter(own) {
            if self.items.len() >= MEMBERS || self.groups >= GROUPS {
                return Ok(());
            }
            let dataset = catching_panics(Location::Variable(full(&name)), || group.dataset(&name))?;
            self.items.push(dense_item(dataset, full(&name), self.limit)?);
        }
        for name in catching_panics(here(), || group.groups())?.into_iter().filter(own) {
            if self.items.len() >= MEMBERS || self.groups >= GROUPS {
                return Ok(());
            }
            let location = || Location::Variable(full(&name));
            let inner = Rc::new(catching_panics(location(), || group.group(&name))?);
            let attributes = catching_panics(location(), || inner.attrs())?;
            if attributes.contains_key("OCTAVE_NEW_FORMAT") {
                // Octave transposes its matrices without marking them.
                self.items.push(Item::not_a_matrix(
                    full(&name),
                    "a matrix in the form of Octave's `save -hdf5`, which is not supported (use `save -v7`)",
                ));
            } else if let Some(rows) = attributes.get("MATLAB_sparse") {
                let rows = whole(rows).ok_or_else(|| {
                    let problem = "the attribute MATLAB_sparse does not contain the number of rows".into();
                    Error::new(ErrorKind::Malformed, location(), problem, "save the file again")
                })?;
                self.items.push(sparse_item(inner, full(&name), rows, self.limit)?);
            } else if depth > 0 {
                self.visit_group(&inner, &full(&name), depth - 1)?;
            }
        }
        Ok(())
    }
}

/// Returns a count from an attribute.
fn whole(value: &AttrValue) -> Option<usize> {
    match value {
        AttrValue::U64(value) => usize::try_from(*value).ok(),
        AttrValue::I64(value) => usize::try_from(*value).ok(),
        AttrValue::U64Array(values) => usize::try_from(*values.first()?).ok(),
        AttrValue::I64Array(values) => usize::try_from(*values.first()?).ok(),
        AttrValue::U32(value) => usize::try_from(*value).ok(),
        AttrValue::I32(value) => usize::try_from(*value).ok(),
        _ => None,
    }
}

fn dense_item(dataset: Dataset, name: String, limit: DecompressionLimit) -> Result<Item<'static>, Error> {
    let location = Location::Variable(name.clone());
    let note = match catching_panics(location.clone(), || dataset.dtype())? {
        DType::Compound(fields) if fields.iter().any(|(field, _)| field == "imag" || field == "i") => Some(COMPLEX),
        DType::F32 | DType::F64 => None,
        DType::I8 | DType::I16 | DType::I32 | DType::I64 | DType::U8 | DType::U16 | DType::U32 | DType::U64 => None,
        DType::String | DType::VariableLengthString => Some("text"),
        DType::ObjectReference => Some("a cell array or an object"),
        _ => Some("data of a non-numeric type"),
    };
    let attributes = catching_panics(location.clone(), || dataset.attrs())?;
    let note = note.or_else(|| matlab_note(&attributes));
    if let Some(note) = note {
        return Ok(Item::not_a_matrix(name, note));
    }
    let matlab = attributes.contains_key("MATLAB_class");
    let shape = sizes(&dataset, &location)?;
    let (rows, columns) = match shape[..] {
        [] => (1, 1),
        [rows] => (rows, 1),
        [columns, rows] if matlab => (rows, columns),
        [rows, columns] => (rows, columns),
        _ => return Ok(Item::not_a_matrix(name, format!("an array of {} dimensions", shape.len()))),
    };
    Ok(Item::new(name.clone(), rows, columns, move || {
        let values = numbers(&dataset, limit, &name, Dataset::read_f64)?;
        if rows.checked_mul(columns) != Some(values.len()) {
            let problem = format!("the dataset has {} numbers, but its size is {rows} x {columns}", values.len());
            return Err(Error::new(ErrorKind::Count, Location::Variable(name.clone()), problem, "save the file again"));
        }
        let order = if matlab { StorageOrder::Columns } else { StorageOrder::Rows };
        from_dense(DenseLayout { rows, columns, order }, &Location::Variable(name.clone()), |at| Ok(values[at]))
    }))
}

/// Returns MATLAB's description of a dataset that is not a matrix.
pub(crate) fn matlab_note(attributes: &HashMap<String, AttrValue>) -> Option<&'static str> {
    if attributes.contains_key("MATLAB_empty") {
        return Some("empty");
    }
    match attributes.get("MATLAB_class")? {
        AttrValue::AsciiString(class) | AttrValue::String(class) if class == "char" => Some("text"),
        AttrValue::AsciiString(class) | AttrValue::String(class) if class == "cell" => Some("a cell array"),
        _ => None,
    }
}

pub(crate) fn sizes(dataset: &Dataset, location: &Location) -> Result<Vec<usize>, Error> {
    let shape = catching_panics(location.clone(), || dataset.shape())?;
    shape.into_iter().map(usize::try_from).collect::<Result<_, _>>().map_err(|_| too_large(location.clone()))
}

fn too_large(location: Location) -> Error {
    let problem = "the dataset states more numbers than a file of this size can contain".into();
    Error::new(
        ErrorKind::TooLarge,
        location,
        problem,
        "save the file again; if its size is correct, save it without compression",
    )
}

/// Reads all numbers of a dataset.
pub(crate) fn numbers<T>(
    dataset: &Dataset,
    limit: DecompressionLimit,
    name: &str,
    read: impl Fn(&Dataset) -> Result<Vec<T>, hdf5_pure::Error>,
) -> Result<Vec<T>, Error> {
    let location = Location::Variable(name.to_string());
    // A chunk is decompressed as a whole, even if the dataset ends within it.
    let chunk = catching_panics(location.clone(), || dataset.chunk_shape())?.unwrap_or_default();
    let product = |sizes: &[u64]| sizes.iter().try_fold(1_u64, |product, &size| product.checked_mul(size));
    let shape = catching_panics(location.clone(), || dataset.shape())?;
    // The stored size of a dataset in chunks. The index of some kinds of chunks cannot be queried.
    let stored = match chunk[..] {
        [] => None,
        _ => catching_panics(location.clone(), || dataset.chunks())
            .ok()
            .map(|chunks| chunks.iter().map(|one| one.storage_size).sum()),
    };
    let room = stored
        .map_or(u64::MAX, |stored: u64| stored.saturating_mul(DEFLATE))
        .max(MIN_NUMBER_LIMIT)
        .min(limit.numbers());
    let count = product(&shape).filter(|&count| count <= room);
    if count.is_none_or(|count| product(&chunk).is_none_or(|chunk| chunk > count.max(MIN_NUMBER_LIMIT))) {
        return Err(too_large(location));
    }
    catching_panics(location, || read(dataset))
}

fn sparse_item(group: Rc<Group>, name: String, rows: usize, limit: DecompressionLimit) -> Result<Item<'static>, Error> {
    let location = Location::Variable(name.clone());
    let part = move |part: &str| catching_panics(location.clone(), || group.dataset(part));
    let pointers = sizes(&part("jc")?, &Location::Variable(name.clone()))?;
    let columns = pointers.first().copied().unwrap_or_default().saturating_sub(1);
    Ok(Item::new(name.clone(), rows, columns, move || {
        let whole = |name_of: &str| -> Result<Vec<usize>, Error> {
            let found = numbers(&part(name_of)?, limit, &name, Dataset::read_u64)?;
            Ok(found.into_iter().map(|index| usize::try_from(index).unwrap_or(usize::MAX)).collect())
        };
        let pointers = whole("jc")?;
        let mut triplets = TripletBuilder::new(rows, columns, 0, Location::File)?;
        // A matrix without entries has neither rows nor values.
        if pointers.last().is_some_and(|&count| count > 0) {
            let (inner, values) = (whole("ir")?, numbers(&part("data")?, limit, &name, Dataset::read_f64)?);
            for_each_compressed(&pointers, &inner, &values, columns, |column, row, value| {
                triplets.push(row, column, value, Location::Variable(name.clone()))
            })?;
        }
        triplets.finish(Symmetry::General)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_the_library_is_an_error() {
        let found = catching_panics::<()>(Location::Byte(3), || panic!("attempt to add with overflow, on purpose"));
        assert_eq!(found.map_err(|error| (error.kind, error.location)), Err((ErrorKind::Malformed, Location::Byte(3))));
        let found = catching_panics(Location::File, || File::from_bytes(vec![0; 600])).map(|_| ());
        assert_eq!(found.map_err(|error| error.kind), Err(ErrorKind::Malformed));
    }
}
