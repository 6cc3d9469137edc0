//! Arrays of NumPy: `.npy` and `.npz`, real and complex.

use super::arrays::Array;
use super::{Column, DataFile, DataFormat};
use crate::error::{Error, Location};
use crate::npy::{self, NpyArray};
use crate::npz;

pub(super) const NPY: DataFormat = DataFormat {
    name: "npy",
    summary: "NumPy (.npy): an array of one or two dimensions, real or complex",
    sniff: |bytes| bytes.starts_with(npy::MAGIC),
    read: |bytes| {
        let mut file = DataFile::default();
        push_array("values", bytes, &mut file)?;
        Ok(file)
    },
};

pub(super) const NPZ: DataFormat = DataFormat {
    name: "npz",
    summary: "NumPy (.npz): `numpy.savez`, arrays of one or two dimensions, real or complex",
    sniff: npz::is_zip,
    read: |bytes| {
        let mut file = DataFile::default();
        for npz::MemberContents { name, bytes: contents } in npz::contents(bytes)? {
            push_array(&name, &contents?, &mut file)
                .map_err(|error| error.with_location(Location::Variable(name.clone())))?;
        }
        Ok(file)
    },
};

fn push_array(name: &str, bytes: &[u8], file: &mut DataFile) -> Result<(), Error> {
    if !bytes.starts_with(npy::MAGIC) {
        file.skipped.push(format!("`{name}` is not an array"));
        return Ok(());
    }
    let array = NpyArray::new(bytes)?;
    let rows = match array.shape[..] {
        [] => 1,
        [rows] | [rows, _] => rows,
        _ => {
            file.skipped.push(format!("`{name}` is an array of {} dimensions", array.shape.len()));
            return Ok(());
        }
    };
    let Some(npy::ComplexParts { real, imaginary }) = array.columns()? else {
        file.skipped.push(format!("`{name}` is an array without numbers"));
        return Ok(());
    };
    match (Array { name: name.to_owned(), rows, real, imaginary }).into_columns() {
        Ok(columns) => file.columns.extend::<Vec<Column>>(columns),
        Err(why) => file.skipped.push(why),
    }
    Ok(())
}
