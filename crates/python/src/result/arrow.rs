//! Exports tables through Arrow's C stream interface (PyCapsule protocol).
//!
//! pandas, polars, pyarrow and other libraries read the columns in place. Numbers and counts
//! are not copied. Texts and flags are copied, because Rust stores them differently. NaN
//! becomes null.
//!
//! Source: the Arrow columnar format, "The Arrow C data interface" and "The Arrow C stream
//! interface".
#![allow(unsafe_code)]

use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use std::ffi::{CString, c_char, c_int, c_void};
use std::ptr;
use std::sync::Arc;
use stickslip_study::dataset::{CellValues, Column, Dataset};

#[repr(C)]
struct ArrowSchema {
    format: *const c_char,
    name: *const c_char,
    metadata: *const c_char,
    flags: i64,
    n_children: i64,
    children: *mut *mut ArrowSchema,
    dictionary: *mut ArrowSchema,
    release: Option<unsafe extern "C" fn(*mut ArrowSchema)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct ArrowArray {
    length: i64,
    null_count: i64,
    offset: i64,
    n_buffers: i64,
    n_children: i64,
    buffers: *mut *const c_void,
    children: *mut *mut ArrowArray,
    dictionary: *mut ArrowArray,
    release: Option<unsafe extern "C" fn(*mut ArrowArray)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct ArrowArrayStream {
    get_schema: Option<unsafe extern "C" fn(*mut ArrowArrayStream, *mut ArrowSchema) -> c_int>,
    get_next: Option<unsafe extern "C" fn(*mut ArrowArrayStream, *mut ArrowArray) -> c_int>,
    get_last_error: Option<unsafe extern "C" fn(*mut ArrowArrayStream) -> *const c_char>,
    release: Option<unsafe extern "C" fn(*mut ArrowArrayStream)>,
    private_data: *mut c_void,
}

// SAFETY: its private data is a `StreamData`, which any thread may drop
unsafe impl Send for ArrowArrayStream {}

impl Drop for ArrowArrayStream {
    fn drop(&mut self) {
        // A consumer that took the stream out of the capsule has cleared `release`.
        if let Some(release) = self.release {
            // SAFETY: not released before, and `self` is the stream that it was made for
            unsafe { release(self) }
        }
    }
}

/// Flag of a column with nullable values.
const NULLABLE: i64 = 2;
/// Name that the protocol prescribes for a capsule with a stream.
const STREAM: &std::ffi::CStr = c"arrow_array_stream";

/// Private data of a stream, which delivers one table once.
struct StreamData {
    dataset: Arc<Dataset>,
    table: usize,
    given: bool,
}

/// Returns a capsule with the stream of a table.
pub fn stream<'py>(py: Python<'py>, dataset: Arc<Dataset>, table: usize) -> PyResult<Bound<'py, PyCapsule>> {
    let private = Box::new(StreamData { dataset, table, given: false });
    let stream = ArrowArrayStream {
        get_schema: Some(get_schema),
        get_next: Some(get_next),
        get_last_error: Some(get_last_error),
        release: Some(release_stream),
        private_data: Box::into_raw(private).cast(),
    };
    PyCapsule::new_with_value(py, stream, STREAM)
}

unsafe extern "C" fn get_schema(stream: *mut ArrowArrayStream, out: *mut ArrowSchema) -> c_int {
    // SAFETY: the consumer passes a live stream of this module and memory for a schema
    unsafe {
        let stream = &*(*stream).private_data.cast::<StreamData>();
        let columns = &stream.dataset.tables[stream.table].columns;
        let fields = columns.iter().map(|column| schema(format_of(&column.values), &column.name, NULLABLE, Vec::new()));
        out.write(schema("+s", "", 0, fields.collect()));
    }
    0
}

unsafe extern "C" fn get_next(stream: *mut ArrowArrayStream, out: *mut ArrowArray) -> c_int {
    // SAFETY: the consumer passes a live stream of this module and memory for an array
    unsafe {
        let stream = &mut *(*stream).private_data.cast::<StreamData>();
        if stream.given {
            out.write(end());
            return 0;
        }
        stream.given = true;
        let table = &stream.dataset.tables[stream.table];
        let children = table.columns.iter().map(|column| child(&stream.dataset, column));
        out.write(array(
            table.rows(),
            0,
            ArrayData { children: children.collect(), ..ArrayData::of(&stream.dataset) },
            &[ptr::null()],
        ));
    }
    0
}

unsafe extern "C" fn get_last_error(_: *mut ArrowArrayStream) -> *const c_char {
    ptr::null()
}

unsafe extern "C" fn release_stream(stream: *mut ArrowArrayStream) {
    // SAFETY: the owner calls this once; the private data came from a box
    unsafe {
        drop(Box::from_raw((*stream).private_data.cast::<StreamData>()));
        (*stream).release = None;
    }
}

/// Returns Arrow's format string of a column.
fn format_of(values: &CellValues) -> &'static str {
    match values {
        CellValues::Number(_) => "g",
        CellValues::Integer(_) => "L",
        CellValues::Text(_) => "U",
        CellValues::Flag(_) => "b",
    }
}

/// Private data of a schema.
struct SchemaData {
    _texts: [CString; 2],
    children: Vec<*mut ArrowSchema>,
}

fn schema(format: &str, name: &str, flags: i64, children: Vec<ArrowSchema>) -> ArrowSchema {
    // Column names contain no zero bytes; a name with one would be cut off.
    let text = |text: &str| CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default();
    let texts = [text(format), text(name)];
    let [format, name] = [texts[0].as_ptr(), texts[1].as_ptr()];
    let children: Vec<*mut ArrowSchema> = children.into_iter().map(|child| Box::into_raw(Box::new(child))).collect();
    let mut data = Box::new(SchemaData { _texts: texts, children });
    ArrowSchema {
        format,
        name,
        metadata: ptr::null(),
        flags,
        n_children: data.children.len() as i64,
        children: data.children.as_mut_ptr(),
        dictionary: ptr::null_mut(),
        release: Some(release_schema),
        private_data: Box::into_raw(data).cast(),
    }
}

unsafe extern "C" fn release_schema(schema: *mut ArrowSchema) {
    // SAFETY: the owner calls this once; children that were moved out have no `release`
    unsafe {
        let data = Box::from_raw((*schema).private_data.cast::<SchemaData>());
        for &child in &data.children {
            if let Some(release) = (*child).release {
                release(child);
            }
            drop(Box::from_raw(child));
        }
        (*schema).release = None;
    }
}

/// Private data of an array.
struct ArrayData {
    /// Keeps the numbers and counts alive.
    _dataset: Arc<Dataset>,
    bits: Vec<Vec<u8>>,
    offsets: Vec<i64>,
    text: Vec<u8>,
    buffers: Vec<*const c_void>,
    children: Vec<ArrowArray>,
    addresses: Vec<*mut ArrowArray>,
}

impl ArrayData {
    fn of(dataset: &Arc<Dataset>) -> ArrayData {
        ArrayData {
            _dataset: dataset.clone(),
            bits: Vec::new(),
            offsets: Vec::new(),
            text: Vec::new(),
            buffers: Vec::new(),
            children: Vec::new(),
            addresses: Vec::new(),
        }
    }
}

/// Packs flags into bits, with the first value in the lowest bit.
fn bits(values: impl ExactSizeIterator<Item = bool>) -> Vec<u8> {
    let mut bytes = vec![0; values.len().div_ceil(8).max(1)];
    values.enumerate().filter(|(_, value)| *value).for_each(|(i, _)| bytes[i / 8] |= 1 << (i % 8));
    bytes
}

/// Returns the array of a column.
fn child(dataset: &Arc<Dataset>, column: &Column) -> ArrowArray {
    let mut data = ArrayData::of(dataset);
    let rows = column.values.len();
    let mut nulls = 0;
    // The first buffer is the validity bitmap.
    let mut buffers: Vec<*const c_void> = vec![ptr::null()];
    match &column.values {
        CellValues::Number(values) => {
            nulls = values.iter().filter(|value| value.is_nan()).count();
            if nulls > 0 {
                data.bits.push(bits(values.iter().map(|value| !value.is_nan())));
                buffers[0] = data.bits[0].as_ptr().cast();
            }
            buffers.push(values.as_ptr().cast());
        }
        CellValues::Integer(values) => buffers.push(values.as_ptr().cast()),
        CellValues::Text(values) => {
            data.offsets = std::iter::once(0)
                .chain(values.iter().scan(0, |end, text| {
                    *end += text.len() as i64;
                    Some(*end)
                }))
                .collect();
            data.text = values.iter().flat_map(|text| text.bytes()).collect();
            buffers.extend([data.offsets.as_ptr().cast(), data.text.as_ptr().cast::<c_void>()]);
        }
        CellValues::Flag(values) => {
            nulls = values.iter().filter(|value| value.is_none()).count();
            data.bits.push(bits(values.iter().map(Option::is_some)));
            data.bits.push(bits(values.iter().map(|value| *value == Some(true))));
            buffers[0] = data.bits[0].as_ptr().cast();
            buffers.push(data.bits[1].as_ptr().cast());
        }
    }
    array(rows, nulls, data, &buffers)
}

fn array(rows: usize, nulls: usize, data: ArrayData, buffers: &[*const c_void]) -> ArrowArray {
    let mut data = Box::new(data);
    data.buffers = buffers.to_vec();
    // Each child has a separate allocation, because a consumer may move one out.
    data.addresses =
        std::mem::take(&mut data.children).into_iter().map(|child| Box::into_raw(Box::new(child))).collect();
    ArrowArray {
        length: rows as i64,
        null_count: nulls as i64,
        offset: 0,
        n_buffers: data.buffers.len() as i64,
        n_children: data.addresses.len() as i64,
        buffers: data.buffers.as_mut_ptr(),
        children: data.addresses.as_mut_ptr(),
        dictionary: ptr::null_mut(),
        release: Some(release_array),
        private_data: Box::into_raw(data).cast(),
    }
}

/// Returns the released array that ends a stream.
fn end() -> ArrowArray {
    ArrowArray {
        length: 0,
        null_count: 0,
        offset: 0,
        n_buffers: 0,
        n_children: 0,
        buffers: ptr::null_mut(),
        children: ptr::null_mut(),
        dictionary: ptr::null_mut(),
        release: None,
        private_data: ptr::null_mut(),
    }
}

unsafe extern "C" fn release_array(array: *mut ArrowArray) {
    // SAFETY: the owner calls this once; children that were moved out have no `release`
    unsafe {
        let data = Box::from_raw((*array).private_data.cast::<ArrayData>());
        for &child in &data.addresses {
            if let Some(release) = (*child).release {
                release(child);
            }
            drop(Box::from_raw(child));
        }
        (*array).release = None;
    }
}
