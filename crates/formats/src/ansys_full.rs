//! ANSYS `.full`: the assembled matrices of an analysis, in binary records.
//!
//! A record consists of its length in words of 4 bytes, a word of flags, its data, and a
//! trailing word. The file begins with a standard header of 100 words. At word 103 follows the
//! header of the matrices, which points to their first records. A matrix has two records for
//! every row: the columns and the values. The file includes constrained rows, which the reader
//! removes; the other rows have names `node.direction`.
//!
//! Source: ANSYS Mechanical APDL Programmer's Reference, chapter 1: the
//! standard header and the full stiffness-mass file (fdfull).

use std::rc::Rc;

use crate::bytes::{ByteCursor, ByteOrder};
use crate::error::{Error, ErrorKind, Location};
use crate::format::{Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::names::direction;

pub(crate) const FORMAT: Format = Format {
    name: "ansys-full",
    summary: "ANSYS (.full), binary: stiffness, mass and damping of a modal analysis",
    sniff: |bytes| order(bytes).is_some(),
    open,
};

/// First word of the header of the matrices.
const HEADER: usize = 103;

/// Flags of a record.
const INTEGERS: u32 = 1 << 31;
const SHORT: u32 = 1 << 30;

/// Items of the header of the matrices by their positions, counted from zero.
#[derive(Debug, Clone, Copy)]
enum HeaderItem {
    Origin = 0,
    Equations = 1,
    Lumped = 10,
    Unsymmetric = 13,
    Stiffness = 18,
    Constraints = 20,
    Mass = 26,
    Damping = 28,
    Dofs = 35,
    /// The number of items.
    Count = 37,
}

/// Returns the byte order, if the file has a standard header of a full file.
fn order(bytes: &[u8]) -> Option<ByteOrder> {
    [ByteOrder::Little, ByteOrder::Big].into_iter().find(|&order| {
        let mut words = ByteCursor::new(bytes, order);
        let mut word = || words.u32().ok();
        // Words of the standard header, and its item for the kind of file: 4 for `.full`.
        (word(), word().is_some(), word()) == (Some(100), true, Some(4))
    })
}

/// Moves to a word of the file.
fn seek(file: &mut ByteCursor, word: usize) -> Result<(), Error> {
    file.seek(word.saturating_mul(4))
}

/// Reads the next record: its flags and its data.
fn record<'a>(file: &mut ByteCursor<'a>) -> Result<(u32, ByteCursor<'a>), Error> {
    let location = file.clone();
    let words = file.u32()? as usize;
    let flags = file.u32()?;
    if flags & (0x3f << 24) != 0 {
        let problem = format!("the record is compressed (flags {flags:#x}), which is not supported");
        let remedy = "switch off compression with /FCOMP before the solution, or export with HBMAT";
        return Err(Error::new(ErrorKind::Unsupported, location.location(), problem, remedy));
    }
    let data = file.take(words.saturating_mul(4))?;
    file.skip(4);
    Ok((flags, ByteCursor::new(data, file.order)))
}

/// Reads the next record as integers.
fn integers(file: &mut ByteCursor) -> Result<Vec<i64>, Error> {
    let location = file.clone();
    let (flags, mut data) = record(file)?;
    if flags & INTEGERS == 0 {
        return Err(location.malformed("a record of whole numbers", format!("one with flags {flags:#x}")));
    }
    match flags & SHORT {
        0 => (0..data.remaining() / 4).map(|_| data.i32().map(i64::from)).collect(),
        _ => (0..data.remaining() / 2).map(|_| data.i16().map(i64::from)).collect(),
    }
}

/// Reads the next record as real numbers.
fn reals(file: &mut ByteCursor) -> Result<Vec<f64>, Error> {
    let location = file.clone();
    let (flags, mut data) = record(file)?;
    if flags & INTEGERS != 0 {
        return Err(location.malformed("a record of real numbers", format!("one with flags {flags:#x}")));
    }
    match flags & SHORT {
        0 => (0..data.remaining() / 8).map(|_| data.f64()).collect(),
        _ => (0..data.remaining() / 4).map(|_| data.f32().map(f64::from)).collect(),
    }
}

/// The data that the matrices of a file share.
struct System<'a> {
    file: ByteCursor<'a>,
    /// Number of equations in the file, including the constrained ones.
    equations: usize,
    /// The constrained equations.
    constrained: Vec<usize>,
    /// Names of all equations, or `None` if the numbers of degrees of freedom do not match.
    names: Option<Vec<String>>,
    lumped: bool,
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let order = order(bytes).unwrap_or(ByteOrder::Little);
    let mut file = ByteCursor::new(bytes, order);
    seek(&mut file, HEADER)?;
    let header = integers(&mut file)?;
    if header.len() < HeaderItem::Count as usize {
        return Err(file.malformed(&format!("a header of at least {} items", HeaderItem::Count as usize), header.len()));
    }
    let refuse = |problem: &str| {
        Err(Error::new(ErrorKind::Unsupported, file.location(), problem.into(), "export with HBMAT instead"))
    };
    if header[HeaderItem::Origin as usize] > 0 {
        return refuse("the file comes from the frontal solver, which is not supported");
    }
    if header[HeaderItem::Unsymmetric as usize] != 0 {
        return refuse("the matrices are unsymmetric, which is not supported");
    }
    if header[HeaderItem::Constraints as usize] != 0 {
        return refuse("the file has constraint equations that are not applied to its matrices");
    }
    let long = |at: usize| {
        let value = (header[at] as u32 as u64) | ((header[at + 1] as u32 as u64) << 32);
        usize::try_from(value).ok().filter(|&value| value > 0)
    };
    let equations = usize::try_from(header[HeaderItem::Equations as usize])
        .map_err(|_| file.malformed("a number of equations", "less than 0"))?;
    let labels = integers(&mut file)?;
    let nodes = integers(&mut file)?;
    let (mut constrained, mut names) = (Vec::new(), None);
    if let Some(at) = long(HeaderItem::Dofs as usize) {
        seek(&mut file, at)?;
        let counts = integers(&mut file)?;
        let dofs = integers(&mut file)?;
        if dofs.len() != equations {
            return Err(file.malformed(&format!("{equations} degrees of freedom"), dofs.len()));
        }
        constrained = (0..equations).filter(|&equation| dofs[equation] < 0).collect();
        names = names_of(&labels, &nodes, &counts, &dofs);
    }
    let left = equations - constrained.len();
    let system =
        Rc::new(System { file, equations, constrained, names, lumped: header[HeaderItem::Lumped as usize] != 0 });
    let kinds = [
        ("stiffness", HeaderItem::Stiffness as usize),
        ("mass", HeaderItem::Mass as usize),
        ("damping", HeaderItem::Damping as usize),
    ];
    let items = kinds.into_iter().filter_map(|(name, at)| {
        let (start, system) = (long(at)?, system.clone());
        Some(Item::new(name, left, left, move || read(&system, name, start)))
    });
    Ok(items.collect())
}

/// Returns the names of all equations: those of the first node, then of the second, and so on.
fn names_of(labels: &[i64], nodes: &[i64], counts: &[i64], dofs: &[i64]) -> Option<Vec<String>> {
    // A degree of freedom is given by its number, or by its position among those of the analysis.
    let label = |dof: i64| {
        let location = usize::try_from(dof - 1).ok();
        if labels.contains(&dof) { Some(dof) } else { labels.get(location?).copied() }
    };
    let mut left = dofs.iter();
    let mut names = Vec::with_capacity(dofs.len());
    for (node, &count) in nodes.iter().zip(counts) {
        for _ in 0..count {
            names.push(format!("{node}.{}", direction(label(left.next()?.checked_abs()?)?)));
        }
    }
    (left.next().is_none()).then_some(names)
}

fn read(system: &System, name: &str, start: usize) -> Result<Matrix, Error> {
    let mut file = system.file.clone();
    seek(&mut file, start)?;
    let mut triplets = TripletBuilder::new(system.equations, system.equations, 0, Location::File)?;
    if name == "mass" && system.lumped {
        let location = file.location();
        let diagonal = reals(&mut file)?;
        if diagonal.len() != system.equations {
            let problem = format!("the file has {} masses for {} equations", diagonal.len(), system.equations);
            return Err(Error::new(
                ErrorKind::Count,
                location,
                problem,
                "switch off lumped masses (LUMPM), or export with HBMAT",
            ));
        }
        for (at, value) in diagonal.into_iter().enumerate() {
            triplets.push(at, at, value, location.clone())?;
        }
    } else {
        for row in 0..system.equations {
            let location = file.clone();
            let (columns, values) = (integers(&mut file)?, reals(&mut file)?);
            if columns.len() != values.len() {
                let problem =
                    format!("the file has {} columns and {} values in row {}", columns.len(), values.len(), row + 1);
                return Err(Error::new(
                    ErrorKind::Count,
                    location.location(),
                    problem,
                    "the file is damaged; solve again",
                ));
            }
            for (column, value) in columns.into_iter().zip(values) {
                let column = usize::try_from(column - 1).map_err(|_| location.malformed("a column from 1", column))?;
                triplets.push(row, column, value, location.location())?;
            }
        }
    }
    let matrix = triplets.finish(Symmetry::Symmetric)?;
    let matrix = match &system.names {
        Some(names) => matrix.with_names(names.clone())?,
        None => matrix,
    };
    matrix.without_rows(&system.constrained)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{list_bytes, read_bytes};

    /// A file written record by record. Each call returns the first word of the record.
    #[derive(Default)]
    struct Writer(Vec<u8>);

    impl Writer {
        fn record(&mut self, flags: u32, data: &[u8]) -> i32 {
            let start = self.0.len() / 4;
            self.0.extend((data.len() as u32 / 4).to_le_bytes());
            self.0.extend(flags.to_le_bytes());
            self.0.extend(data);
            self.0.extend([0; 4]);
            start as i32
        }

        fn integers(&mut self, values: &[i32]) -> i32 {
            self.record(INTEGERS, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>())
        }

        fn reals(&mut self, values: &[f64]) -> i32 {
            self.record(0, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>())
        }
    }

    /// Two nodes, 7 and 5, with directions 1 and 6. The first equation is
    /// constrained. `change` edits the header.
    fn file(change: impl Fn(&mut [i32])) -> Vec<u8> {
        let mut file = Writer::default();
        let mut standard = [0; 100];
        standard[0] = 4;
        file.integers(&standard);
        file.integers(&[0; 100]);
        file.integers(&[1, 6]);
        file.integers(&[7, 5]);
        let mut header = [0; 100];
        (header[HeaderItem::Origin as usize], header[HeaderItem::Equations as usize]) = (-4, 4);
        header[HeaderItem::Stiffness as usize] = file.integers(&[1]);
        file.reals(&[1.0]);
        for (columns, values) in [(&[3, 2][..], &[-5.0, 9.0][..]), (&[4, 3], &[0.5, 8.0]), (&[4], &[7.0])] {
            file.integers(columns);
            file.reals(values);
        }
        header[HeaderItem::Mass as usize] = file.reals(&[1.0, 2.0, 3.0, 4.0]);
        header[HeaderItem::Lumped as usize] = 1;
        header[HeaderItem::Dofs as usize] = file.integers(&[2, 2]);
        // Given by position and by number.
        file.integers(&[-1, 2, 1, 6]);
        change(&mut header);
        let at = (HEADER + 2) * 4;
        for (word, value) in header.iter().enumerate() {
            file.0[at + 4 * word..at + 4 * word + 4].copy_from_slice(&value.to_le_bytes());
        }
        file.0
    }

    #[test]
    fn constrained_rows_are_left_out_and_others_named() -> Result<(), Error> {
        let bytes = file(|_| ());
        let listed: Vec<_> = list_bytes(&bytes, None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["stiffness (3 x 3)", "mass (3 x 3)"]);
        let stiffness = read_bytes(&bytes, None, Some("stiffness"))?;
        assert_eq!(stiffness.names(), Some(&["7.rz", "5.x", "5.rz"].map(String::from)[..]));
        let expected = [(0, 0, 9.0), (1, 0, -5.0), (1, 1, 8.0), (2, 1, 0.5), (2, 2, 7.0)];
        assert_eq!(stiffness.entries(), Matrix::new(3, 3, Symmetry::Symmetric, expected)?.entries());
        assert_eq!(read_bytes(&bytes, None, Some("mass"))?.get(2, 2), 4.0);
        Ok(())
    }

    #[test]
    fn unsupported_files_are_refused() {
        let check = |change: fn(&mut [i32]), kind| {
            let found = read_bytes(&file(change), None, Some("stiffness")).map(|_| ());
            assert_eq!(found.map_err(|e| e.kind), Err(kind));
        };
        check(|header| header[HeaderItem::Origin as usize] = 4, ErrorKind::Unsupported);
        check(|header| header[HeaderItem::Unsymmetric as usize] = 1, ErrorKind::Unsupported);
        check(|header| header[HeaderItem::Constraints as usize] = 1, ErrorKind::Unsupported);
        check(|header| header[HeaderItem::Stiffness as usize + 1] = 1, ErrorKind::Truncated);
        check(|header| header[HeaderItem::Equations as usize] = 5, ErrorKind::Malformed);
        check(|header| header[HeaderItem::Equations as usize] = -5, ErrorKind::Malformed);
        let mut packed = file(|_| ());
        packed[HEADER * 4 + 7] = 0xa0;
        assert_eq!(read_bytes(&packed, None, None).map_err(|e| e.kind), Err(ErrorKind::Unsupported));
    }
}
