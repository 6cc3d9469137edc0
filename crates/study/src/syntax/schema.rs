//! Schema 1 of the study file: every table and key, once, as data.
//!
//! The reader checks files against this table. The documentation and the JSON Schema for
//! editors are generated from it. Laws come from [`stickslip::law::TABLE`], methods from
//! [`stickslip::method::TABLE`] and study kinds from [`crate::kinds::TABLE`].

use crate::case::sample::{DESIGNS, DISTRIBUTIONS, WITHIN};
use crate::case::substructure::REDUCTIONS;
use crate::compile::templates;
use crate::kinds;
use crate::kinds::kind::Kind;
use crate::syntax::key::DAMPING_RATIO;
use crate::syntax::signal_keys::{FORCE_SIGNAL, GROUND_SIGNAL};
use serde_json::{Map, Value, json};
use stickslip::dimension::Dimension;
use stickslip::{law, method};

pub use crate::syntax::key::{
    ADAPTIVE_RANGE, Bounds, END_POINTS_RANGE, FREQUENCY_RANGE, Key, MAX_CASES, MAX_MASSES, MAX_POINTS, PARAMETER_RANGE,
    Presence, VERSION, ValueType, default, optional, required, unsupported,
};

/// Largest number of elements in one list (`[[spring]]`, …), repetitions included.
pub const MAX_ELEMENTS: usize = 40_000;

/// Largest size of a study file, bytes.
pub const MAX_FILE_BYTES: u64 = 4 * 1024 * 1024;

/// The top-level keys of the file.
pub const FILE: &[Key] = &[
    required("schema", ValueType::Count(VERSION, VERSION), "version of the file format", "1"),
    optional(
        "title",
        ValueType::Text,
        "title of the figure; default: the file's name",
        "\"Response of the blade couple\"",
    ),
    optional("source", ValueType::Text, "source of the study: a paper, a figure", "\"Den Hartog (1931), Fig. 5\""),
    optional("parameters", ValueType::Parameters, "quantities by name, for use in expressions", "{ Ft = \"2 N\" }"),
    optional(
        "model",
        ValueType::Table(MODEL),
        "a template of a model instead of the lists below",
        "{ template = \"blade-couple\" }",
    ),
    optional(
        "structure",
        ValueType::Table(STRUCTURE),
        "a structure given by its matrices, from a finite-element program; masses, springs and joints can be added \
         at its places",
        "{ stiffness = \"blade.sti\", mass = \"blade.mas\", dofs = \"blade.dof\", units = \"mm-t-s\" }",
    ),
    optional(
        "place",
        ValueType::List(PLACE),
        "places of the structure, points of bodies, or rotated faces of masses; joints, forces and results refer to \
         them",
        "[]",
    ),
    optional("mass", ValueType::List(MASS), "point masses with one or several displacements", "[]"),
    optional("body", ValueType::List(BODY), "rigid bodies with rotations; their points are [[place]]s", "[]"),
    optional("spring", ValueType::List(SPRING), "springs and dampers", "[]"),
    optional("joint", ValueType::List(JOINT), "friction joints and contacts between places", "[]"),
    optional(
        "contact",
        ValueType::List(CONTACT),
        "contacts between faces of the mesh of [structure]; each node of the first face becomes a joint",
        "[]",
    ),
    optional(
        "disk",
        ValueType::Table(DISK),
        "the model is one sector of a bladed disk, with `next.NAME` for the place of that name in the next sector",
        "{ sectors = 24 }",
    ),
    optional(
        "force",
        ValueType::List(FORCE),
        "forces amplitude * cos(harmonic * Omega * t + phase); they add up",
        "[]",
    ),
    optional("motion", ValueType::List(MOTION), "imposed motions of a place; they add up", "[]"),
    optional(
        "data",
        ValueType::Tables(DATA),
        "tables of measured or given numbers, from files",
        "[{ name = \"sweep\", file = \"sweep.csv\" }]",
    ),
    required("study", ValueType::Study, "the results to compute", "{ kind = \"response\", frequency = \"121 Hz\" }"),
    optional(
        "sample",
        ValueType::Sample,
        "uncertain parameters: runs the study for values drawn from distributions",
        "{ count = 1000, of = { Ft = { normal = [\"2 N\", \"0.2 N\"] } } }",
    ),
    optional("method", ValueType::Method, "method that finds the orbits", "{ kind = \"event-driven\" }"),
    optional("figure", ValueType::Table(FIGURE), "appearance of the figure", "{ overlay = true }"),
];

/// The keys of `[figure]`.
pub const FIGURE: &[Key] = &[
    optional(
        "overlay",
        ValueType::Flag,
        "true: all values of the last varied parameter in one panel, with a panel for every mass; false: a panel for \
         every case, with all masses; absent: true for one mass or more than six cases",
        "true",
    ),
    optional(
        "panels",
        ValueType::Choice(panel_names),
        "one panel for each case, or for each mass; takes precedence over `overlay`",
        "\"cases\"",
    ),
    optional("only", ValueType::Names, "the masses or joints that are shown; absent: all", "[\"blade1\"]"),
    default(
        "references",
        ValueType::Flag,
        "false",
        "adds the linear responses with all joints free and all joints stuck to a response. If they differ between \
         cases, each has the colour of its case; with more than seven cases only the first and the last are shown. \
         Percentiles of draws have no references",
        "true",
    ),
    optional("x", ValueType::Choice(scale_names), "scale of the horizontal axis", "\"log\""),
    optional("y", ValueType::Choice(scale_names), "scale of the vertical axis", "\"log\""),
    optional("x_unit", ValueType::Text, "unit of the horizontal axis", "\"kHz\""),
    optional("y_unit", ValueType::Text, "unit of the vertical axis", "\"mm\""),
];

fn panel_names() -> Vec<(&'static str, &'static str)> {
    vec![("cases", "every case, with a curve for every mass"), ("masses", "every mass, with a curve for every case")]
}

fn scale_names() -> Vec<(&'static str, &'static str)> {
    vec![("linear", "equal differences have equal lengths"), ("log", "equal ratios have equal lengths")]
}

/// The keys of `[[data]]`.
pub const DATA: &[Key] = &[
    required("name", ValueType::Name, "name of the table, for the keys that use it", "\"sweep\""),
    required(
        "file",
        ValueType::Text,
        "file in the folder of the study file: CSV and other text, Universal File Format, MATLAB, HDF5, NumPy, WAV; \
         recognized by its content",
        "\"sweep.csv\"",
    ),
    optional(
        "columns",
        ValueType::Texts,
        "the column for each use, if it has another name: `force = \"F\"`; a unit in brackets \
         applies to a column without one: `force = \"F [kN]\"`",
        "{ frequency = \"frequency_Hz\", force = \"F [kN]\" }",
    ),
];

/// The keys of a fitted parameter.
pub(crate) const FIT_RANGE: &[Key] = &[
    required("from", ValueType::Quantity(Dimension::NONE, Bounds::Finite), "smallest value", "\"0.1 N\""),
    required("to", ValueType::Quantity(Dimension::NONE, Bounds::Finite), "largest value", "\"20 N\""),
    default("scale", ValueType::Choice(scale_names), "linear", "log for a parameter whose ratios count", "\"log\""),
];

const MODEL: &[Key] = &[
    required("template", ValueType::Choice(template_names), "name of the template", "\"blade-couple\""),
    optional("law", ValueType::Law, "replaces the law of every joint", "{ kind = \"coulomb\", limit = \"2 N\" }"),
];

/// The keys of `[structure]`.
pub const STRUCTURE: &[Key] = &[
    required(
        "stiffness",
        ValueType::File,
        "file of the stiffness matrix, in the folder of the study file; its format is recognized by its content",
        "\"blade.sti\"",
    ),
    required("mass", ValueType::File, "file of the mass matrix", "\"blade.mas\""),
    optional(
        "stiffened",
        ValueType::Table(STIFFENED),
        "stress stiffening by rotation: a second stiffness file, exported with the stress of the speed `at`; its \
         added stiffness is scaled with the square of the speed",
        "{ file = \"blade_6000.sti\", at = \"6000 rpm\", speed = \"speed\" }",
    ),
    optional("damping", ValueType::File, "file of a damping matrix", "\"blade.dam\""),
    optional(
        "dofs",
        ValueType::Text,
        "file with the names of the rows: CSV `row,name`, CalculiX .dof, ANSYS .mapping; absent: the names in the \
         matrix files, or numbers from 1",
        "\"blade.dof\"",
    ),
    required(
        "units",
        ValueType::Choice(unit_sets),
        "units of the numbers in these files; all other quantities of the study state their own units",
        "\"mm-t-s\"",
    ),
    optional(
        "stress",
        ValueType::File,
        "file of a matrix that gives stresses, its rows, from the displacements of all rows of the stiffness matrix, its \
         columns; `stress.csv` has the largest stresses of the period of an `orbit`, or the amplitudes in `modes` and \
         `nodal-diameter`",
        "\"blade_stress.mtx\"",
    ),
    optional(
        "stress_rows",
        ValueType::Text,
        "CSV file `row,name` with the names of the rows of `stress`; absent: their numbers from 1",
        "\"stress_rows.csv\"",
    ),
    optional(
        "mesh",
        ValueType::Text,
        "file of the mesh with the nodes of these rows, for `set`, for sets in `nodes`, and for [[contact]]: input deck \
         of Abaqus or CalculiX, Gmsh, Nastran, Ansys archive, VTK .vtu",
        "\"blade.inp\"",
    ),
    optional(
        "modal_damping",
        ValueType::Quantity(Dimension::NONE, Bounds::AtLeastZero),
        "damping ratio of every mode up to the largest frequency of interest, see `reduce`; above, the ratio grows \
         with the frequency",
        "\"0.5 %\"",
    ),
    optional(
        "rayleigh",
        ValueType::Table(RAYLEIGH),
        "Rayleigh damping, proportional to mass and stiffness",
        "{ mass = \"1 /s\", stiffness = \"1e-6 s\" }",
    ),
    optional(
        "reduce",
        ValueType::TableOrFalse(REDUCE),
        "reduction of the structure. Absent: with all modes up to five times the highest excitation frequency; with \
         joints up to fifteen times, if these are at most 60 modes; a structure of up to 100 rows is not reduced if \
         `event-driven` accepts the laws of its joints. false: no reduction",
        "{ up_to = \"5 kHz\" }",
    ),
    optional(
        "reduced",
        ValueType::Table(REDUCED),
        "if the files are already a reduced model, as written by `stickslip reduce`: its error, which is added to \
         every `reduction_error`",
        "{ error = 2e-6, up_to = \"5 kHz\" }",
    ),
    optional(
        "keep_reductions",
        ValueType::Text,
        "folder that keeps every reduction of this structure, except of a disk with unequal blades: later runs read \
         it, if matrices, places and request are equal; it may be deleted at any time",
        "\"reduced\"",
    ),
];

/// The keys of an entry for a file that has several matrices, or a format that is not
/// recognized by content.
pub(crate) const FILE_KEYS: &[Key] = &[
    required("file", ValueType::Text, "path of the file", "\"blade.mat\""),
    optional("name", ValueType::Text, "name of the matrix, if the file has several", "\"K\""),
    optional("format", ValueType::Choice(format_names), "format, if it is not recognized by the content", "\"matlab\""),
];

const STIFFENED: &[Key] = &[
    FILE_KEYS[0],
    FILE_KEYS[1],
    FILE_KEYS[2],
    required(
        "at",
        ValueType::Quantity(Dimension::FREQUENCY, Bounds::Positive),
        "speed of rotation of that export",
        "\"6000 rpm\"",
    ),
    required(
        "speed",
        ValueType::Quantity(Dimension::FREQUENCY, Bounds::AtLeastZero),
        "speed of rotation in the study, an expression of a parameter",
        "\"speed\"",
    ),
];

fn format_names() -> Vec<(&'static str, &'static str)> {
    stickslip_formats::TABLE.iter().map(|format| (format.name, format.summary)).collect()
}

/// 1/s, the dimension of a decay rate, which is not a frequency.
const DECAY_RATE: Dimension = Dimension { kg: 0, m: 0, s: -1, rad: 0 };

const RAYLEIGH: &[Key] = &[
    default(
        "mass",
        ValueType::Quantity(DECAY_RATE, Bounds::AtLeastZero),
        "0 /s",
        "factor of the mass matrix",
        "\"1 /s\"",
    ),
    default(
        "stiffness",
        ValueType::Quantity(Dimension::TIME, Bounds::AtLeastZero),
        "0 s",
        "factor of the stiffness matrix",
        "\"1e-6 s\"",
    ),
];

const REDUCE: &[Key] = &[
    optional(
        "up_to",
        ValueType::Quantity(Dimension::FREQUENCY, Bounds::Positive),
        "largest frequency of interest, including all relevant harmonics of the excitation; the reduction takes as \
         many modes as `tolerance` requires",
        "\"5 kHz\"",
    ),
    optional("modes", ValueType::Count(1, 600), "number of modes, instead of `up_to`", "50"),
    optional(
        "orders",
        ValueType::Count(1, 3),
        "orders of residual vectors in addition to `modes`: 1 is the static flexibility of the omitted modes, each \
         further order adds two terms of its series in the squared frequency; absent: 1",
        "2",
    ),
    default(
        "tolerance",
        ValueType::Quantity(Dimension::NONE, Bounds::Positive),
        "1e-4",
        "largest relative error of the response at the places up to `up_to`",
        "1e-6",
    ),
    optional(
        "kind",
        ValueType::Choice(reduction_kinds),
        "kind of reduction; absent: the one that is small and accurate enough",
        "\"rubin\"",
    ),
];

const REDUCED: &[Key] = &[
    required(
        "error",
        ValueType::Quantity(Dimension::NONE, Bounds::AtLeastZero),
        "largest relative error of the response at the places",
        "2e-6",
    ),
    required(
        "up_to",
        ValueType::Quantity(Dimension::FREQUENCY, Bounds::Positive),
        "frequency up to which this error holds",
        "\"5 kHz\"",
    ),
];

fn unit_sets() -> Vec<(&'static str, &'static str)> {
    crate::syntax::unit_sets::TABLE.iter().map(|set| (set.name, set.summary)).collect()
}

fn reduction_kinds() -> Vec<(&'static str, &'static str)> {
    REDUCTIONS.iter().map(|(name, summary, _)| (*name, *summary)).collect()
}

/// The key of a tangent of a face.
const TANGENT: Key = optional(
    "tangent",
    ValueType::Vector(Dimension::NONE),
    "a vector whose projection onto the face is the first tangent",
    "[1, 0, 0]",
);

const PLACE: &[Key] = &[
    required("name", ValueType::Name, "name, for joints, forces and results", "\"tip\""),
    optional(
        "of",
        ValueType::Name,
        "the [[body]] of which it is a point or a face, with `offset`, `normal` or both; or the [[mass]] of which it \
         is a rotated face, with `normal`; needs no [structure]",
        "\"damper\"",
    ),
    optional(
        "dof",
        ValueType::Row,
        "its one row, by the name `node.direction`, or by the number from 1 if rows have no names",
        "\"1353.y\"",
    ),
    optional(
        "dofs",
        ValueType::Rows,
        "the rows of a node, one for each direction, a normal last",
        "[\"188.x\", \"188.y\", \"188.z\"]",
    ),
    optional(
        "nodes",
        ValueType::Rows,
        "one node, several nodes, or sets of the mesh: each direction is the mean of their rows `node.direction`",
        "[\"188\", \"189\"]",
    ),
    optional(
        "set",
        ValueType::Text,
        "a set of the mesh: each of its nodes is a place `NAME_NODE`, such as `tip_17`",
        "\"PADS\"",
    ),
    optional(
        "sum",
        ValueType::Weights,
        "a weighted sum of rows, or a list of such sums, one for each direction",
        "{ \"188.x\" = 0.5, \"189.x\" = 0.5 }",
    ),
    optional(
        "directions",
        ValueType::Names,
        "names of its directions; absent: those in the names of the rows, with a normal t1, t2, n",
        "[\"x\", \"y\", \"z\"]",
    ),
    optional(
        "normal",
        ValueType::Vector(Dimension::NONE),
        "normal of a local frame, with components along x, y, z; the directions are then two tangents and the normal",
        "[0, \"-sin(a)\", \"cos(a)\"]",
    ),
    TANGENT,
    optional(
        "offset",
        ValueType::Vector(Dimension::LENGTH),
        "for a place of a [[body]]: position of the point relative to the centre of mass, along x, y, z",
        "[\"3 mm\", 0, \"-2 mm\"]",
    ),
    REPEAT,
];

/// The key that every entry of a list has.
const REPEAT: Key = optional(
    "repeat",
    ValueType::Repeat,
    "repeats the entry for i = 1 to 12: `{i}` in its names, `i` in its expressions; with `wrap = true`, `{i+1}` \
     restarts after the last value",
    "{ i = 12, wrap = true }",
);

const MASS: &[Key] = &[
    required("name", ValueType::Name, "name of the place, for springs, joints and forces", "\"blade1\""),
    required(
        "mass",
        ValueType::Quantity(Dimension::MASS, Bounds::AtLeastZero),
        "mass; moments of inertia in kg m^2 make a model of rotation, with N m/rad, N m s/rad, N m and rad",
        "\"182 g\"",
    ),
    optional(
        "directions",
        ValueType::Names,
        "directions of motion, if there is more than one: each is a place `name.direction`; a normal is the last",
        "[\"x\", \"z\"]",
    ),
    REPEAT,
];

const BODY: &[Key] = &[
    required(
        "name",
        ValueType::Name,
        "name; the places of its centre of mass are `name.x` and so on, its rotations `name.rx`, `name.ry`, `name.rz`",
        "\"damper\"",
    ),
    required("mass", ValueType::Quantity(Dimension::MASS, Bounds::Positive), "mass", "\"12 g\""),
    required(
        "inertia",
        ValueType::Quantities(Dimension::INERTIA, Bounds::Finite),
        "moments of inertia about the centre of mass: one value for a body with one rotation, otherwise a list with \
         one value for each rotation; in space also the six entries xx, yy, zz, xy, yz, zx of the inertia matrix, \
         where xy is minus the integral of x y",
        "\"300 g mm^2\"",
    ),
    required(
        "directions",
        ValueType::Names,
        "displacements: two of x, y, z for a plane body, which rotates about the third axis, or all three for a body \
         in space with three rotations; name rotations rx, ry, rz to keep only those",
        "[\"x\", \"z\"]",
    ),
    optional(
        "position",
        ValueType::Vector(Dimension::LENGTH),
        "position of the centre of mass in the coordinates of the mesh, for a [[contact]] with the body",
        "[\"60 mm\", 0, \"5 mm\"]",
    ),
    REPEAT,
];

const SPRING: &[Key] = &[
    required(
        "between",
        ValueType::Pair,
        "the two places that it connects; `ground` is the fixed frame",
        "[\"blade1\", \"ground\"]",
    ),
    optional(
        "stiffness",
        ValueType::Quantity(Dimension::STIFFNESS, Bounds::AtLeastZero),
        "stiffness; between rotations of bodies in N m/rad; optional if damping is given",
        "\"105103 N/m\"",
    ),
    optional(
        "damping",
        ValueType::Quantity(Dimension::DAMPING, Bounds::Finite),
        "viscous damping in parallel; a value in percent is a `damping_ratio`; between rotations in N m s/rad",
        "\"0.2 kg/s\"",
    ),
    optional(
        DAMPING_RATIO,
        ValueType::Quantity(Dimension::NONE, Bounds::AtLeastZero),
        "instead of `damping`: damping ratio zeta of this spring with the mass at its end, c = 2 zeta sqrt(k m); \
         between two masses m is m1 m2/(m1 + m2)",
        "\"2 %\"",
    ),
    REPEAT,
];

const JOINT: &[Key] = &[
    required("name", ValueType::Name, "name, for results", "\"shroud\""),
    required(
        "between",
        ValueType::Pair,
        "the two places, or nodes with the law's directions, between which the joint acts",
        "[\"blade1\", \"contact\"]",
    ),
    required("law", ValueType::Law, "friction law", "{ kind = \"coulomb\", limit = \"2 N\" }"),
    REPEAT,
];

const CONTACT: &[Key] = &[
    required(
        "name",
        ValueType::Name,
        "name; its joints are `NAME_NODE`, their places `NAME_NODE_a` and `_b`",
        "\"pad\"",
    ),
    required(
        "between",
        ValueType::Rows,
        "two sets of the mesh, or one and \"ground\" or a [[body]]; the nodes of the first meet the faces of the \
         second, or points of the body; on a disk `next.SET` is the set of the next sector",
        "[\"PADS\", \"ground\"]",
    ),
    required(
        "law",
        ValueType::Law,
        "law with stiffnesses, forces and dampings per area: N/mm^3, MPa; each joint has them times the area of its node",
        "{ kind = \"friction-contact\", tangential = \"20 N/mm^3\", normal = \"30 N/mm^3\", friction = 0.3, preload = \"2 MPa\" }",
    ),
    TANGENT,
    optional(
        "preload",
        ValueType::Table(PRELOAD),
        "preload of each node from a static step, instead of `preload` in the law",
        "{ data = \"static\", total = \"2 kN\" }",
    ),
    optional(
        "distance",
        ValueType::Quantity(Dimension::LENGTH, Bounds::Positive),
        "largest distance of a node from the second face; absent: a tenth of the square root of the mean area of its \
         faces",
        "\"0.5 mm\"",
    ),
];

/// The keys of `preload` in `[[contact]]`.
const PRELOAD: &[Key] = &[
    required(
        "data",
        ValueType::Text,
        "name of the [[data]] with the columns `node`, and `pressure` or `force`; positive values press the faces \
         together, and nodes without a row have no preload; a column `gap` opens the nodes without pressure",
        "\"static\"",
    ),
    default(
        "scale",
        ValueType::Quantity(Dimension::NONE, Bounds::AtLeastZero),
        "1",
        "factor of all values, for studies over the preload",
        "\"load/2\"",
    ),
    optional(
        "total",
        ValueType::Quantity(Dimension::FORCE, Bounds::Positive),
        "normal force of the whole contact in the static step; the forces of the joints before `scale` must sum to it \
         within 2 %",
        "\"2 kN\"",
    ),
];

/// The keys of `[disk]`.
const DISK: &[Key] = &[
    required(
        "sectors",
        ValueType::Quantity(Dimension::NONE, Bounds::Positive),
        "number of sectors, 2 or more; places of sector n are called `NAME_n`, from 0",
        "24",
    ),
    optional(
        "boundary",
        ValueType::Text,
        "for a sector given by matrices: a CSV file with the columns low, high: the nodes of one side and their \
         counterparts on the other; the high side is the low side of the next sector",
        "\"sector_boundary.csv\"",
    ),
    optional(
        "nodes",
        ValueType::Text,
        "coordinates of the nodes of the sector: a CSV file with the columns node, x, y, z, or a mesh, such as an \
         input deck with *NODE; checks `boundary`, and replaces it if it is absent",
        "\"sector.inp\"",
    ),
    optional(
        "axis",
        ValueType::Choice(axes),
        "axis of the disk, if the rows are along x, y, z: the next sector is rotated about it by the right-hand \
         rule, towards the high side; absent: the directions of the rows rotate with the sectors",
        "\"z\"",
    ),
    optional(
        "blade",
        ValueType::Text,
        "for a sector given by matrices, for its mistuning: a CSV file with the column node: the nodes of the blade \
         without those of the disk",
        "\"blade_nodes.csv\"",
    ),
    optional(
        "mistuning",
        ValueType::Table(MISTUNING),
        "differences between sectors; absent: all alike, and a travelling wave is solved on one sector",
        "{ of = \"k\", deviation = \"2 %\", seed = 7 }",
    ),
];

fn axes() -> Vec<(&'static str, &'static str)> {
    vec![("x", "the x axis of the matrices"), ("y", "the y axis"), ("z", "the z axis")]
}

const MISTUNING: &[Key] = &[
    required(
        "of",
        ValueType::Names,
        "the quantity that differs: a parameter, a mass, or the two ends of a spring; for a sector given by matrices \
         `blade.frequency`, the cantilever frequencies of the blade, or `blade.stiffness`; it is multiplied by 1 + \
         deviation",
        "\"k\"",
    ),
    optional(
        "deviation",
        ValueType::Quantity(Dimension::NONE, Bounds::AtLeastZero),
        "standard deviation of normally distributed deviations",
        "\"2 %\"",
    ),
    optional(
        "seed",
        ValueType::Quantity(Dimension::NONE, Bounds::AtLeastZero),
        "seed of the deviations, a whole number: the same deviations on every machine; default: 0",
        "7",
    ),
    optional(
        "file",
        ValueType::Text,
        "instead of `deviation` and `seed`: a CSV file with the columns sector, deviation, in the folder of the \
         study file",
        "\"pattern.csv\"",
    ),
];

const ENGINE_ORDER: Key = optional(
    "engine_order",
    ValueType::Quantity(Dimension::NONE, Bounds::Finite),
    "on a disk: sector n leads by 2 pi engine_order n / sectors, a travelling wave; default: all sectors alike",
    "3",
);

const NODAL_DIAMETER: Key = optional(
    "nodal_diameter",
    ValueType::Quantity(Dimension::NONE, Bounds::Finite),
    "on a disk: the amplitude of sector n is multiplied by cos(2 pi nodal_diameter n / sectors), a standing wave",
    "3",
);

const ONE_SECTOR: Key = optional(
    "sector",
    ValueType::Quantity(Dimension::NONE, Bounds::AtLeastZero),
    "on a disk: acts on this sector only; sectors count from 0",
    "0",
);

const MAX_HARMONIC: i64 = 1_000;

const PHASE: Key =
    default("phase", ValueType::Quantity(Dimension::ANGLE, Bounds::Finite), "0 deg", "phase lead", "\"90 deg\"");

const HARMONIC: Key = default(
    "harmonic",
    ValueType::Count(0, MAX_HARMONIC),
    "1",
    "multiple of the excitation frequency; 0 is constant",
    "3",
);

const FORCE: &[Key] = &[
    required("on", ValueType::Name, "the place on which it acts", "\"blade1\""),
    optional(
        "amplitude",
        ValueType::Quantity(Dimension::FORCE, Bounds::Finite),
        "amplitude; on a rotation of a body the amplitude of a moment in N m; may depend on the excitation frequency, as \
         in \"m_e * frequency^2/(1 rad)^2\"; required without `data`",
        "\"10 N\"",
    ),
    RECORD,
    optional(
        "signal",
        ValueType::Table(FORCE_SIGNAL),
        "in a transient, instead of `amplitude`: a shock, a chirp or a random process",
        "{ kind = \"half-sine\", amplitude = \"50 N\", duration = \"11 ms\" }",
    ),
    RECORD_COLUMN,
    PHASE,
    HARMONIC,
    ENGINE_ORDER,
    NODAL_DIAMETER,
    ONE_SECTOR,
    REPEAT,
];

const RECORD: Key = optional(
    "data",
    ValueType::Text,
    "in a transient, instead of `amplitude`: name of a [[data]] with the column `time`; linear between its rows, zero \
     outside of them",
    "\"record\"",
);

const RECORD_COLUMN: Key = optional("column", ValueType::Text, "column of `data`; default: `force`", "\"force_N\"");

const MOTION: &[Key] = &[
    required(
        "on",
        ValueType::Name,
        "the place: a mass, or a place that exists only by this motion; with `data` also `ground` for its acceleration",
        "\"mover\"",
    ),
    optional(
        "amplitude",
        ValueType::Quantity(Dimension::LENGTH, Bounds::Finite),
        "amplitude; for a rotation of a body an angle; required without `data`",
        "\"2 mm\"",
    ),
    RECORD,
    optional(
        "signal",
        ValueType::Table(GROUND_SIGNAL),
        "in a transient, for the acceleration of `ground`: a shock, a chirp or a random process",
        "{ kind = \"half-sine\", amplitude = \"100 m/s^2\", duration = \"11 ms\" }",
    ),
    optional(
        "column",
        ValueType::Text,
        "column of `data`; default: `displacement`, or `acceleration` for the motion of the ground",
        "\"displacement_m\"",
    ),
    optional(
        "along",
        ValueType::Text,
        "for an acceleration of the ground under masses with directions: the direction",
        "\"x\"",
    ),
    PHASE,
    HARMONIC,
    ENGINE_ORDER,
    NODAL_DIAMETER,
    ONE_SECTOR,
    unsupported(
        "velocity",
        "a place with a constant velocity, such as a belt, is not supported: every motion repeats with the excitation",
        "for a belt of velocity v use kind = \"transient\" and data = \"belt\": a [[data]] with two rows of time and \
         displacement, zero and v times the time",
    ),
    REPEAT,
];

/// The keys of `[study]` that all kinds share.
pub const STUDY: &[Key] = &[
    required("kind", ValueType::Choice(kind_names), "what is computed", "\"response\""),
    optional(
        "vary",
        ValueType::Vary,
        "runs the study for every combination of these parameter values: one value, a list, or `{ from, to, points }`, also with `scale = \"log\"`",
        "{ Ft = [\"2 N\", \"4 N\"] }",
    ),
];

/// The keys of `[sample]`.
pub const SAMPLE: &[Key] = &[
    required("count", ValueType::Count(1, MAX_CASES as i64), "number of values that are drawn", "1000"),
    default(
        "seed",
        ValueType::Count(0, i64::MAX),
        "1",
        "seed of the draws; the same seed gives the same values on every machine",
        "7",
    ),
    required(
        "of",
        ValueType::Distributions,
        "the uncertain parameters and their distributions",
        "{ Ft = { normal = [\"2 N\", \"0.2 N\"] }, k = { uniform = [\"1e5 N/m\", \"1.1e5 N/m\"] } }",
    ),
    default(
        "design",
        ValueType::Choice(design_names),
        "random",
        "distribution of the draws over the parameters",
        "\"sobol\"",
    ),
];

fn design_names() -> Vec<(&'static str, &'static str)> {
    DESIGNS.iter().map(|(name, summary, _)| (*name, *summary)).collect()
}

/// The values of `kind` in `[method]`.
pub const METHOD: &[Key] =
    &[default("kind", ValueType::Choice(method_names), "auto", "the method", "\"event-driven\"")];

fn template_names() -> Vec<(&'static str, &'static str)> {
    templates::TABLE.iter().map(|row| (row.name, row.summary())).collect()
}

fn kind_names() -> Vec<(&'static str, &'static str)> {
    kinds::TABLE.iter().map(|row| (row.info.name, row.info.summary)).collect()
}

fn method_names() -> Vec<(&'static str, &'static str)> {
    method::TABLE.iter().map(|row| (row.name, row.summary)).collect()
}

/// Describes the values that a key takes in a few words, for messages and for the book.
pub fn describe_value(takes: &ValueType) -> String {
    match takes {
        ValueType::Text => "a text in quotes".to_owned(),
        ValueType::Name => "a name in quotes".to_owned(),
        ValueType::Names => "a name in quotes or a list of names".to_owned(),
        ValueType::Pair => "a list of two names of places".to_owned(),
        ValueType::Quantity(dimension, within) => {
            let range = if *within == Bounds::Finite { String::new() } else { format!(", {}", within.description()) };
            format!("{}{range}", crate::syntax::expression::dimension_text(*dimension))
        }
        ValueType::Count(from, to) if from == to => format!("the number {from}"),
        ValueType::Count(from, to) => format!("a whole number from {from} to {to}"),
        ValueType::Flag => "true or false".to_owned(),
        ValueType::Frequencies(keys) => {
            let needed = keys.iter().filter(|key| key.presence == Presence::Required);
            let needed = needed.map(|key| key.name).collect::<Vec<_>>().join(", ");
            let adaptive = if needed.ends_with("points") { "; in a response also { from, to, tolerance }" } else { "" };
            format!("a frequency (Hz or rad/s), a list of them, or {{ {needed} }}{adaptive}")
        }
        ValueType::ByName(dimension) => {
            format!("a table from names to {}", crate::syntax::expression::dimension_text(*dimension))
        }
        ValueType::Table(keys) | ValueType::List(keys) => {
            let taken = keys.iter().filter(|key| key.is_supported());
            let names = crate::syntax::suggest::alternatives(taken.map(|key| key.name)).replace(" or ", ", ");
            let many = matches!(takes, ValueType::List(_));
            format!("{} with the keys {names}", if many { "a list of tables" } else { "a table" })
        }
        ValueType::Tables(keys) => describe_value(&ValueType::List(keys)),
        ValueType::Texts => "a table from names to texts".to_owned(),
        ValueType::Fit => "a table from parameters to { from, to }, with scale = \"log\" for ratios".to_owned(),
        ValueType::Repeat => {
            "a table with a number of repetitions or [first, last] for each index, and `wrap`".to_owned()
        }
        ValueType::Law => "a law: { kind = \"…\", … }".to_owned(),
        ValueType::Choice(words) => {
            format!("one of {}", crate::syntax::suggest::alternatives(words().iter().map(|word| word.0)))
        }
        ValueType::Parameters => "a table of quantities by name".to_owned(),
        ValueType::Vary => {
            "a table from parameters to a value, a list of values, or { from, to, points }, also with scale = \"log\""
                .to_owned()
        }
        ValueType::Over => {
            "a table from two parameters to ranges { from, to, points }, each also with scale = \"log\"".to_owned()
        }
        ValueType::Sample => "a table with `count`, `of`, `seed` and `design`".to_owned(),
        ValueType::Distributions => {
            let all = DISTRIBUTIONS.map(|(name, numbers, _)| format!("{{ {name} = [{numbers}] }}"));
            let all = crate::syntax::suggest::alternatives(all.iter().map(String::as_str));
            format!("a table from parameters to {all}, the first two also with {WITHIN} = [least, most]")
        }
        ValueType::Method => "a table with `kind` and the options of that method".to_owned(),
        ValueType::Study => "a table with `kind` and the keys of that kind".to_owned(),
        ValueType::File => "the path of a file, or { file = …, name = …, format = … }".to_owned(),
        ValueType::TableOrFalse(keys) => format!("{}, or false", describe_value(&ValueType::Table(keys))),
        ValueType::Row => "the name of a row, or its number".to_owned(),
        ValueType::Rows => "a list of names or numbers".to_owned(),
        ValueType::Weights => "a table from names of rows to numbers, or a list of such tables".to_owned(),
        ValueType::Vector(Dimension::NONE) => "a list of three numbers".to_owned(),
        ValueType::Vector(dimension) => {
            format!("a list of three quantities: {}", crate::syntax::expression::dimension_text(*dimension))
        }
        ValueType::Quantities(dimension, within) => {
            let one = describe_value(&ValueType::Quantity(*dimension, *within));
            format!("{one}, or a list of them")
        }
        ValueType::Unsupported(why) => format!("nothing: {why}"),
    }
}

// ------------------------------------------------------------------------------ JSON Schema

const DRAFT: &str = "https://json-schema.org/draft/2020-12/schema";
const NAME_PATTERN: &str = "^[A-Za-z][A-Za-z0-9_.]*$";
/// Pattern of names in entries that may be repeated, with indices in braces.
const REPEATED_PATTERN: &str = "^[A-Za-z]([A-Za-z0-9_.]|\\{[^{}]+\\})*$";

/// Returns the JSON Schema (draft 2020-12) of study files, for editors that complete and check
/// TOML.
pub fn json_schema() -> Value {
    let mut schema = object(FILE);
    schema["$schema"] = json!(DRAFT);
    schema["title"] = json!("Stickslip study");
    schema["$defs"] = json!({
        "quantity": {
            "description": "a quantity with a unit, an expression over [parameters], or a bare number in SI",
            "type": ["string", "number"],
        },
    });
    schema
}

fn object(keys: &[Key]) -> Value {
    let properties: Map<String, Value> = keys.iter().map(|key| (key.name.to_owned(), property(key))).collect();
    let required: Vec<&str> =
        keys.iter().filter(|key| key.presence == Presence::Required).map(|key| key.name).collect();
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}

fn property(key: &Key) -> Value {
    let mut schema = takes_schema(&key.takes);
    let mut doc = key.doc.to_owned();
    if let ValueType::Quantity(..) | ValueType::Frequencies(_) | ValueType::ByName(_) = key.takes {
        doc = format!("{doc}: {}", describe_value(&key.takes));
    }
    if let Presence::Default(value) = key.presence {
        doc = format!("{doc}; default: {value}");
    }
    schema["description"] = json!(doc);
    schema
}

fn takes_schema(takes: &ValueType) -> Value {
    let quantity = || json!({ "$ref": "#/$defs/quantity" });
    match takes {
        ValueType::Text => json!({ "type": "string" }),
        ValueType::Name => json!({ "type": "string", "pattern": REPEATED_PATTERN }),
        ValueType::Names => {
            let name = json!({ "type": "string", "pattern": NAME_PATTERN });
            json!({ "anyOf": [name, { "type": "array", "items": name, "minItems": 1 }] })
        }
        ValueType::Pair => json!({
            "type": "array", "minItems": 2, "maxItems": 2, "items": { "type": "string", "pattern": REPEATED_PATTERN },
        }),
        ValueType::Quantity(..) => quantity(),
        ValueType::Count(from, to) => json!({ "type": "integer", "minimum": from, "maximum": to }),
        ValueType::Flag => json!({ "type": "boolean" }),
        ValueType::Frequencies(keys) => {
            json!({ "anyOf": [quantity(), { "type": "array", "items": quantity(), "minItems": 1 }, object(keys), object(ADAPTIVE_RANGE)] })
        }
        ValueType::ByName(_) | ValueType::Parameters => json!({
            "type": "object", "additionalProperties": quantity(), "propertyNames": { "pattern": NAME_PATTERN },
        }),
        ValueType::Unsupported(_) => json!({ "not": {} }),
        ValueType::File => json!({ "anyOf": [{ "type": "string" }, object(FILE_KEYS)] }),
        ValueType::TableOrFalse(keys) => json!({ "anyOf": [object(keys), { "const": false }] }),
        ValueType::Row => json!({ "type": ["string", "integer"] }),
        ValueType::Rows => json!({ "type": "array", "items": { "type": ["string", "integer"] }, "minItems": 1 }),
        ValueType::Weights => {
            let one = json!({ "type": "object", "additionalProperties": quantity(), "minProperties": 1 });
            json!({ "anyOf": [one, { "type": "array", "items": one, "minItems": 1 }] })
        }
        ValueType::Quantities(..) => {
            json!({ "anyOf": [quantity(), { "type": "array", "items": quantity(), "minItems": 1 }] })
        }
        ValueType::Vector(_) => json!({ "type": "array", "items": quantity(), "minItems": 3, "maxItems": 3 }),
        ValueType::Table(keys) => object(keys),
        ValueType::List(keys) => json!({ "type": "array", "items": object(keys), "maxItems": MAX_ELEMENTS }),
        ValueType::Tables(keys) => json!({ "type": "array", "items": object(keys), "minItems": 1 }),
        ValueType::Texts => json!({ "type": "object", "additionalProperties": { "type": "string" } }),
        ValueType::Fit => json!({
            "type": "object", "additionalProperties": object(FIT_RANGE), "propertyNames": { "pattern": NAME_PATTERN },
        }),
        ValueType::Repeat => json!({
            "type": "object",
            "properties": { "wrap": {
                "description": "values after the last one restart at the first in names: true for all indices, or \
                    the names of the indices",
                "anyOf": [{ "type": "boolean" }, { "type": "string" }, { "type": "array", "items": { "type": "string" } }],
            } },
            "additionalProperties": { "anyOf": [
                { "type": "integer", "minimum": 1, "maximum": MAX_ELEMENTS },
                { "type": "array", "items": { "type": "integer" }, "minItems": 2, "maxItems": 2 },
            ] },
        }),
        ValueType::Law => {
            let one = |row: &&law::LawInfo| {
                let parameters =
                    row.parameters.iter().map(|p| (p.key, p.describe_values(), p.doc, p.default.is_none()));
                kind_object(row.name, row.summary, parameters)
            };
            json!({ "oneOf": law::TABLE.iter().map(one).collect::<Vec<_>>() })
        }
        ValueType::Choice(words) => {
            let one = |(word, summary): (&str, &str)| json!({ "const": word, "description": summary });
            json!({ "oneOf": words().into_iter().map(one).collect::<Vec<_>>() })
        }
        ValueType::Vary => json!({
            "type": "object",
            "additionalProperties": {
                "anyOf": [quantity(), { "type": "array", "items": quantity(), "minItems": 1 }, object(PARAMETER_RANGE)],
            },
        }),
        ValueType::Over => json!({
            "type": "object", "additionalProperties": object(PARAMETER_RANGE), "minProperties": 2, "maxProperties": 2,
        }),
        ValueType::Sample => object(SAMPLE),
        ValueType::Distributions => {
            let numbers = json!({ "type": "array", "items": quantity(), "minItems": 1 });
            let one = |(name, takes, summary): &(&str, &str, &str)| {
                let bounds = json!({ "type": "array", "items": quantity(), "minItems": 2, "maxItems": 2 });
                let mut numbers = numbers.clone();
                numbers["description"] = json!(format!("{summary}: {takes}"));
                json!({
                    "type": "object", "properties": { *name: numbers, WITHIN: bounds }, "required": [name],
                    "additionalProperties": false,
                })
            };
            json!({
                "type": "object", "propertyNames": { "pattern": NAME_PATTERN },
                "additionalProperties": { "oneOf": DISTRIBUTIONS.iter().map(one).collect::<Vec<_>>() },
            })
        }
        ValueType::Method => {
            let one = |row: &method::MethodInfo| {
                let takes = crate::syntax::expression::dimension_text;
                let options = row.options.iter().map(|o| (o.key, takes(o.dimension), o.doc, false));
                let mut schema = kind_object(row.name, row.summary, options);
                for option in row.options.iter().filter(|option| option.count) {
                    schema["properties"][option.key] =
                        json!({ "type": "integer", "minimum": 1, "description": option.doc });
                }
                schema
            };
            let mut all: Vec<Value> = method::TABLE.iter().map(one).collect();
            // `kind` may be absent, which means `auto`
            for schema in all.iter_mut().filter(|schema| schema["properties"]["kind"]["const"] == "auto") {
                schema["required"] = json!([]);
            }
            json!({ "oneOf": all })
        }
        ValueType::Study => {
            let one = |Kind { info: row, .. }: &Kind| {
                let mut schema = object(&[STUDY, row.keys].concat());
                schema["description"] = json!(row.summary);
                schema["properties"]["kind"] = json!({ "const": row.name, "description": row.summary });
                schema
            };
            json!({ "oneOf": kinds::TABLE.iter().map(one).collect::<Vec<_>>() })
        }
    }
}

fn kind_object(
    name: &str,
    summary: &str,
    parameters: impl Iterator<Item = (&'static str, String, &'static str, bool)>,
) -> Value {
    let mut properties = Map::new();
    let mut required = vec!["kind"];
    properties.insert("kind".to_owned(), json!({ "const": name }));
    for (key, takes, doc, must) in parameters {
        let doc = format!("{doc}: {takes}");
        properties.insert(key.to_owned(), json!({ "$ref": "#/$defs/quantity", "description": doc }));
        if must {
            required.push(key);
        }
    }
    json!({
        "type": "object", "description": summary, "properties": properties, "required": required,
        "additionalProperties": false,
    })
}
