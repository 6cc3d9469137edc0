//! Datasets of HDF5 and of MATLAB 7.3 files, by their paths `group.dataset`.

use super::arrays::Array;
use super::matlab::too_many;
use super::{DataFile, DataFormat};
use crate::error::{Error, Location};
use crate::hdf5::{catching_panics, is_hdf5, matlab_note, numbers, sizes};
use crate::inflate::DecompressionLimit;
use hdf5_pure::{DType, Dataset, File, Group};

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "hdf5",
    summary: "HDF5 (.h5) and MATLAB (.mat) of version 7.3: real arrays, in groups and structures",
    sniff: is_hdf5,
    read,
};

/// Maximum depth of nested groups.
const DEPTH: usize = 8;

/// Maximum number of datasets and groups visited, because links may form cycles.
const MEMBERS: usize = 10_000;

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let file = catching_panics(Location::File, || File::from_bytes(bytes.to_vec()))?;
    let limit = DecompressionLimit::for_file(bytes.len());
    let mut walk = GroupWalk { limit, budget: limit.numbers(), members: 0, file: DataFile::default() };
    walk.group(&file.root(), "", DEPTH)?;
    Ok(walk.file)
}

/// A walk through the groups of a file.
struct GroupWalk {
    limit: DecompressionLimit,
    /// Numbers that may still be read.
    budget: u64,
    members: usize,
    file: DataFile,
}

impl GroupWalk {
    fn group(&mut self, group: &Group, path: &str, depth: usize) -> Result<(), Error> {
        let here = || Location::Variable(path.to_owned());
        let full = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        // MATLAB stores the parts of cells and objects in the groups `#refs#` and `#subsystem#`.
        let own = |name: &String| !name.starts_with('#');
        for name in catching_panics(here(), || group.datasets())?.into_iter().filter(own) {
            self.members += 1;
            if self.members > MEMBERS {
                return Ok(());
            }
            let dataset = catching_panics(Location::Variable(full(&name)), || group.dataset(&name))?;
            self.dataset(&dataset, full(&name))?;
        }
        for name in catching_panics(here(), || group.groups())?.into_iter().filter(own) {
            self.members += 1;
            if self.members > MEMBERS || depth == 0 {
                return Ok(());
            }
            let inner = catching_panics(Location::Variable(full(&name)), || group.group(&name))?;
            self.group(&inner, &full(&name), depth - 1)?;
        }
        Ok(())
    }

    fn dataset(&mut self, dataset: &Dataset, name: String) -> Result<(), Error> {
        let location = Location::Variable(name.clone());
        let mut skip = |what: &str| {
            self.file.skipped.push(format!("`{name}` is {what}"));
            Ok(())
        };
        match catching_panics(location.clone(), || dataset.dtype())? {
            DType::F32 | DType::F64 | DType::I8 | DType::I16 | DType::I32 | DType::I64 => {}
            DType::U8 | DType::U16 | DType::U32 | DType::U64 => {}
            DType::Compound(_) => {
                return skip("of complex or compound numbers: save real and imaginary part separately");
            }
            DType::ObjectReference => return skip("a cell or an array of structures: save without -v7.3"),
            _ => return skip("not an array of numbers"),
        }
        let attributes = catching_panics(location.clone(), || dataset.attrs())?;
        if let Some(note) = matlab_note(&attributes) {
            return skip(note);
        }
        let shape = sizes(dataset, &location)?;
        let (first, across) = match shape[..] {
            [] => (1, 1),
            [first] => (first, 1),
            [first, across] => (first, across),
            _ => return skip(&format!("an array of {} dimensions", shape.len())),
        };
        let values = numbers(dataset, self.limit, &name, Dataset::read_f64)?;
        self.budget = self.budget.checked_sub(values.len() as u64).ok_or_else(|| too_many(location))?;
        if values.is_empty() || first.checked_mul(across) != Some(values.len()) {
            return skip("empty, or of another size than stated");
        }
        // HDF5 stores by rows; MATLAB shows its matrices transposed, which makes them the same
        // to an array whose values run along the longer dimension
        match (Array { name, rows: across, real: values, imaginary: Vec::new() }).into_columns() {
            Ok(columns) => self.file.columns.extend(columns),
            Err(why) => self.file.skipped.push(why),
        }
        Ok(())
    }
}
