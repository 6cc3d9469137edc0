//! Methods: from a system and a drive frequency to an orbit.
//!
//! A method is named with options in a study file; [`TABLE`] lists them. To add one: write its file, then one line in [`TABLE`].

use crate::dimension::Dimension;
use std::collections::BTreeMap;

/// An option of a method: a key in `[method]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodOption {
    /// Key in `[method]`.
    pub key: &'static str,
    /// Physical dimension.
    pub dimension: Dimension,
    /// Whether it is a count: a whole number from 1.
    pub count: bool,
    /// One line, with what happens when it is absent.
    pub doc: &'static str,
}

/// Options of a method that were given, by key, SI.
pub type Options = BTreeMap<String, f64>;

/// A row of the table of methods.
#[derive(Debug, Clone, Copy)]
pub struct MethodInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line of what it is.
    pub summary: &'static str,
    /// Its options, all optional.
    pub options: &'static [MethodOption],
}

/// Every method there is.
pub const TABLE: &[MethodInfo] = &[
    MethodInfo { name: "auto", summary: "event-driven for exact laws, shooting for smooth laws", options: &[] },
    MethodInfo {
        name: "event-driven",
        summary: "exact: closed-form motion between switches, Newton on the period",
        options: &[],
    },
    MethodInfo {
        name: "shooting",
        summary: "smooth laws: Newton on the period of a stiff integration, exact sensitivities",
        options: &[
            MethodOption {
                key: "tolerance",
                dimension: Dimension::NONE,
                count: false,
                doc: "relative error per step of the integration; 1e-9 when absent",
            },
            MethodOption {
                key: "width",
                dimension: Dimension::VELOCITY,
                count: false,
                doc: "replaces exact laws by smooth ones that change sign over this velocity; exact laws are refused when absent",
            },
        ],
    },
];

/// The method with this name.
pub fn find(name: &str) -> Option<&'static MethodInfo> {
    TABLE.iter().find(|method| method.name == name)
}
