//! Points and faces of masses and bodies: second views of their nodes.
//!
//! A face has axes along its tangents and its normal. In a plane it has one tangent: the axis
//! across the plane times the normal.

use super::body::{Body, TRANSLATIONS};
use super::place::{Frame, Place};
use super::{ElementFault, Mass, Model};
use crate::structure::reduction::Row;

/// A point or a face of a mass or a body, in the terms of the user.
///
/// # Example
/// A wedge rests on a face that is inclined by 30 degrees, 5 mm from its centre of mass.
/// ```
/// use stickslip::model::{Body, Model, View};
/// let wedge = Body::in_plane("wedge", 0.02, 1e-6, ["x", "z"]);
/// let model = Model { bodies: vec![wedge], ..Model::default() };
/// let face = View {
///     offset: Some([0.0, 0.0, 5e-3]),
///     normal: Some([0.5, 0.0, 0.75f64.sqrt()]),
///     ..View::new("face", "wedge")
/// };
/// let place = model.view(&face).unwrap();
/// assert_eq!(place.directions, ["t", "n"]);
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct View {
    /// Identifier of the place.
    pub name: String,
    /// Name of the mass or the body.
    pub of: String,
    /// Position relative to the centre of mass of a body, m.
    pub offset: Option<[f64; 3]>,
    /// Normal of a face, of any length. `None` for a point.
    pub normal: Option<[f64; 3]>,
    /// First tangent of a face in space; see [`Frame::new`].
    pub tangent: Option<[f64; 3]>,
    /// Names of the directions. By default, those of the body, or `t`, `n` and `t1`, `t2`, `n`
    /// for a face.
    pub directions: Option<Vec<String>>,
}

impl View {
    /// Creates a view without offset and normal.
    pub fn new(name: impl Into<String>, of: impl Into<String>) -> Self {
        View { name: name.into(), of: of.into(), ..View::default() }
    }
}

/// The element to which a view belongs.
enum Viewed<'a> {
    Mass(&'a Mass),
    Body(&'a Body),
}

impl Viewed<'_> {
    /// Returns the indices of x, y, z along which it moves, in the order of its directions.
    /// Returns `None` for a mass with other directions or with only one.
    fn axes(&self) -> Option<Vec<usize>> {
        let axes: Option<Vec<usize>> = match self {
            Viewed::Mass(mass) => {
                mass.directions.iter().map(|along| TRANSLATIONS.iter().position(|axis| axis == along)).collect()
            }
            Viewed::Body(body) => Some(body.axes()),
        };
        axes.filter(|axes| axes.len() > 1)
    }

    /// Returns the displacement of the point at `offset` along a unit vector, as a row.
    fn row(&self, axes: &[usize], offset: [f64; 3], along: &[f64; 3]) -> Row {
        match self {
            Viewed::Mass(_) => axes.iter().enumerate().map(|(at, axis)| (at, along[*axis])).collect(),
            Viewed::Body(body) => body.row(offset, *along),
        }
    }
}

impl Model {
    /// Returns the place of a point or a face of a mass or a body of this model.
    ///
    /// # Errors
    /// [`ElementFault`]: the element does not exist or has no such point or face.
    pub fn view(&self, view: &View) -> Result<Place, ElementFault> {
        let View { name, of, offset, normal, .. } = view;
        let body = || self.bodies.iter().find(|body| body.name == *of).map(Viewed::Body);
        let Some(viewed) = self.masses.iter().find(|mass| mass.name == *of).map(Viewed::Mass).or_else(body) else {
            let help = "name a [[body]], or a [[mass]] with `directions`";
            return Err(ElementFault::new("of", format!("there is no mass and no body `{of}`"), help));
        };
        match (&viewed, offset, normal) {
            (Viewed::Mass(_), Some(_), _) => {
                let message = format!("`{of}` is a point mass and does not rotate: all its points move alike");
                Err(ElementFault::new("offset", message, "use a [[body]] with its inertia, or remove `offset`"))
            }
            (Viewed::Body(_), None, None) => {
                let help =
                    "add offset = [\"3 mm\", 0, \"-2 mm\"], the position of the point relative to the centre of mass";
                Err(ElementFault::new("name", "a place of a body needs `offset`, `normal` or both".to_owned(), help))
            }
            (Viewed::Body(body), Some(offset), None) => point(view, body.point(name, *offset)),
            _ => face(view, &viewed),
        }
    }
}

/// Returns a point of a body with all its directions or those that are named.
fn point(view: &View, point: Place) -> Result<Place, ElementFault> {
    if view.tangent.is_some() {
        let message = "a local frame needs a normal; only `tangent` is stated".to_owned();
        return Err(ElementFault::new("tangent", message, "add normal = [0, 0, 1]"));
    }
    let Some(named) = &view.directions else { return Ok(point) };
    let mut rows = Vec::with_capacity(named.len());
    for along in named {
        let Some(at) = point.directions.iter().position(|own| own == along) else {
            let message = format!(
                "points of `{}` move along {}; `{along}` is not one of these directions",
                view.of,
                point.directions.join(", ")
            );
            let help = "use these directions; rotations are places of the body itself and apply to all its points";
            return Err(ElementFault::new("directions", message, help));
        };
        rows.push(point.rows[at].clone());
    }
    Ok(Place { directions: named.clone(), rows, ..point })
}

fn face(view: &View, viewed: &Viewed<'_>) -> Result<Place, ElementFault> {
    let of = &view.of;
    let Some(axes) = viewed.axes() else {
        let moves = match viewed {
            Viewed::Mass(mass) if !mass.directions.is_empty() => mass.directions.join(", "),
            _ => "one direction without a name".to_owned(),
        };
        let message =
            format!("a rotated face of `{of}` needs directions among x, y, z, but the mass moves along {moves}");
        return Err(ElementFault::new("of", message, "give the mass directions = [\"x\", \"z\"], or all three"));
    };
    let Some(normal) = view.normal else {
        return Err(ElementFault::new(
            "normal",
            "a rotated face needs its normal".to_owned(),
            "add normal = [0, 0, 1]",
        ));
    };
    let missing = (0..TRANSLATIONS.len()).find(|axis| !axes.contains(axis));
    let tangent = match missing {
        None => view.tangent,
        Some(axis) if normal[axis] != 0.0 => {
            let axis = TRANSLATIONS[axis];
            let message = format!("`{of}` does not move along {axis}, but the normal has a component along it");
            return Err(ElementFault::new("normal", message, "set that component to 0"));
        }
        Some(axis) => {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut tangent = [0.0; 3];
            (tangent[next], tangent[last]) = (-normal[last], normal[next]);
            Some(tangent)
        }
    };
    let frame = Frame::new(normal, tangent).map_err(|cause| {
        let help = "a valid example is normal = [0, 0, 1] with tangent = [1, 0, 0]";
        ElementFault::new("normal", cause.to_string(), help)
    })?;
    let row = |along: &[f64; 3]| viewed.row(&axes, view.offset.unwrap_or_default(), along);
    let [first, second, normal] = frame.axes();
    let (rows, names) = match missing {
        None => (vec![row(first), row(second), row(normal)], &["t1", "t2", "n"][..]),
        Some(_) => (vec![row(first), row(normal)], &["t", "n"][..]),
    };
    let named = view.directions.clone();
    let directions = named.unwrap_or_else(|| names.iter().map(|&name| name.to_owned()).collect());
    if directions.len() != rows.len() {
        let message = format!("{} names in `directions` for {}", directions.len(), names.join(", "));
        return Err(ElementFault::new(
            "directions",
            message,
            "name each tangent and the normal, or remove `directions`",
        ));
    }
    Ok(Place { name: view.name.clone(), directions, rows, frame: None, view_of: Some(of.clone()) })
}
