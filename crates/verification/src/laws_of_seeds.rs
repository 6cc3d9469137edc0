//! The laws of random systems and random studies.

/// Names of the laws from which a seed chooses. A law that is added to the table does not belong
/// here, so that a seed keeps its system; the conformance tests run every law of the table.
pub const LAWS_OF_SEEDS: &[&str] = &[
    "coulomb",
    "coulomb-arctan",
    "stribeck",
    "stribeck-arctan",
    "jenkins",
    "jenkins-arctan",
    "iwan",
    "dahl",
    "bouc-wen",
    "valanis",
    "lugre",
    "coulomb-2d",
    "coulomb-2d-arctan",
    "jenkins-2d",
    "jenkins-2d-arctan",
    "friction-contact",
    "gap",
    "cubic",
];
