//! NumPy views of columns: arrays over memory that a Rust value owns, without a copy.
#![allow(unsafe_code)]

use numpy::ndarray::ArrayView1;
use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::prelude::*;

/// Returns a read-only array over `values`, which belong to `owner`.
///
/// # Safety
/// `values` must keep their address and content until `owner` is dropped.
pub unsafe fn array<'py, T: Element>(values: &[T], owner: Bound<'py, PyAny>) -> Bound<'py, PyArray1<T>> {
    // SAFETY: the array holds a reference to `owner`, which keeps the values
    let array = unsafe { PyArray1::borrow_from_array(&ArrayView1::from(values), owner) };
    array.readwrite().make_nonwriteable();
    array
}
