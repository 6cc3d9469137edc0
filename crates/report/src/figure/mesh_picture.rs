//! A picture of a mesh as PNG: its outer faces with their edges, seen from one corner, and the
//! nodes of its sets in colours.

use crate::figure::colour::PALETTE;
use crate::figure::png::draw_on;
use crate::output::result_file::ReportError;
use resvg::tiny_skia::{FillRule, Paint, PathBuilder, Pixmap, Stroke, Transform};
use std::fmt::Write;
use stickslip_formats::mesh::{Members, Mesh};

/// Settings of the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct PictureSettings {
    /// Width and height, pixels. Default 1600 by 1200: half a page in print.
    pub size: [f64; 2],
    /// Margins at the left, top, right and bottom, pixels. Default: room for the title, the legend
    /// and the axes.
    margins: [f64; 4],
    /// Horizontal and vertical angle of the view, degrees. Default: x points to the right, z up.
    view: [f64; 2],
    /// Largest number of sets in the legend. Default 12: as many as have room.
    pub sets: usize,
    /// Largest number of characters of a name in the legend. Default 22: the width of the legend.
    name_length: usize,
    /// Number of faces above which edges are thin. Default 5000: faces of about 15 pixels.
    many_faces: usize,
    /// Product of faces and nodes of sets above which nodes behind another part are drawn too.
    /// Default 1e8: a second.
    tests: usize,
}

impl Default for PictureSettings {
    fn default() -> Self {
        PictureSettings {
            size: [1600.0, 1200.0],
            margins: [60.0, 90.0, 380.0, 150.0],
            view: [-60.0, 25.0],
            sets: 12,
            name_length: 22,
            many_faces: 5_000,
            tests: 100_000_000,
        }
    }
}

/// The direction of the view: unit vectors to the right, up, and towards the viewer.
pub(super) struct View([[f64; 3]; 3]);

impl View {
    fn new(angles: [f64; 2]) -> View {
        let [(sin, cos), (rise, level)] = angles.map(|angle| angle.to_radians().sin_cos());
        View([[-sin, cos, 0.0], [-cos * rise, -sin * rise, level], [cos * level, sin * level, rise]])
    }

    pub fn of(&self, vector: [f64; 3]) -> [f64; 3] {
        self.0.map(|axis| axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2])
    }
}

/// A face in the view.
struct SeenFace {
    corners: Vec<usize>,
    depth: f64,
    /// Unit normal; its last component is the cosine of the angle to the view.
    normal: [f64; 3],
}

impl SeenFace {
    /// Returns whether it is in front of a point, by more than `tolerance`.
    fn hides(&self, point: &[f64; 3], seen: &[[f64; 3]], tolerance: f64) -> bool {
        let count = self.corners.len();
        let mut sides = (0..count).map(|corner| {
            let [a, b] = [corner, (corner + 1) % count].map(|corner| seen[self.corners[corner]]);
            (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])
        });
        let first = sides.next().unwrap_or(0.0);
        let origin = seen[self.corners[0]];
        let across = self.normal[0] * (point[0] - origin[0]) + self.normal[1] * (point[1] - origin[1]);
        let front = origin[2] - across / self.normal[2];
        sides.all(|side| side * first > 0.0) && front > point[2] + tolerance
    }
}

/// A picture in progress: the outer faces are drawn.
pub(super) struct Canvas {
    pub settings: PictureSettings,
    pub view: View,
    pixels: Pixmap,
    /// Positions of the nodes in the view.
    seen: Vec<[f64; 3]>,
    faces: Vec<SeenFace>,
}

/// An entry of the legend: a name, a number of nodes, and the colour of its marks.
pub(super) struct PictureLegendEntry {
    pub name: String,
    pub count: usize,
    pub colour: &'static str,
}

fn failed(reason: &dyn std::fmt::Display) -> ReportError {
    ReportError::encode("picture of the mesh", reason)
}

impl Canvas {
    /// Draws the outer faces of a mesh.
    pub fn new(mesh: &Mesh) -> Result<Canvas, ReportError> {
        let settings = PictureSettings::default();
        let view = View::new(settings.view);
        let seen: Vec<[f64; 3]> = mesh.nodes().iter().map(|node| view.of(node.position)).collect();
        let mut pixels = Pixmap::new(settings.size[0] as u32, settings.size[1] as u32)
            .ok_or_else(|| failed(&"the image has no size"))?;
        pixels.fill(resvg::tiny_skia::Color::WHITE);
        let faces = faces(mesh, &seen);
        let edge = if faces.len() > settings.many_faces { 0.5 } else { 1.2 };
        let mut canvas = Canvas { settings, view, pixels, seen, faces };
        let at = canvas.pixels_of(&canvas.seen);
        for face in &canvas.faces {
            polygon(&mut canvas.pixels, &at, face, edge);
        }
        if canvas.faces.is_empty() {
            canvas.dots(&at, "#888888", 1.5);
        }
        Ok(canvas)
    }

    /// Returns the pixels of points in the view.
    pub fn pixels_of(&self, seen: &[[f64; 3]]) -> Vec<[f32; 2]> {
        let place = placement(&self.seen, self.settings);
        seen.iter().map(|point| place(point).map(|x| x as f32)).collect()
    }

    /// Draws a dot at each of these pixels.
    pub fn dots(&mut self, at: &[[f32; 2]], colour: &str, radius: f32) {
        for [x, y] in at {
            let mut path = PathBuilder::new();
            path.push_circle(*x, *y, radius);
            let Some(path) = path.finish() else { continue };
            self.pixels.fill_path(&path, &paint(colour), FillRule::Winding, Transform::identity(), None);
        }
    }

    /// Draws a circle around each of these pixels.
    pub fn circles(&mut self, at: &[[f32; 2]], colour: &str, radius: f32) {
        for [x, y] in at {
            let mut path = PathBuilder::new();
            path.push_circle(*x, *y, radius);
            self.stroke(path, colour);
        }
    }

    /// Draws lines between pairs of pixels.
    pub fn lines(&mut self, ends: &[[[f32; 2]; 2]], colour: &str) {
        for [[x, y], [to_x, to_y]] in ends {
            let mut path = PathBuilder::new();
            path.move_to(*x, *y);
            path.line_to(*to_x, *to_y);
            self.stroke(path, colour);
        }
    }

    fn stroke(&mut self, path: PathBuilder, colour: &str) {
        let Some(path) = path.finish() else { return };
        let stroke = Stroke { width: 2.5, ..Stroke::default() };
        self.pixels.stroke_path(&path, &paint(colour), &stroke, Transform::identity(), None);
    }

    /// Adds title, legend, extent and axes, and returns the picture as PNG.
    pub fn finish(mut self, mesh: &Mesh, title: &str, legend: &[PictureLegendEntry]) -> Result<Vec<u8>, ReportError> {
        draw_on(&labels(mesh, title, legend, &self.view, self.settings), &mut self.pixels)?;
        self.pixels.encode_png().map_err(|error| failed(&error))
    }
}

/// Returns a picture of a mesh with its sets and a title.
///
/// # Errors
/// [`ReportError`] if the picture cannot be drawn.
pub fn mesh_picture(mesh: &Mesh, title: &str) -> Result<Vec<u8>, ReportError> {
    let mut canvas = Canvas::new(mesh)?;
    let seen = &canvas.seen;
    // nodes behind the body are hidden
    let mut visible = vec![canvas.faces.is_empty(); seen.len()];
    canvas.faces.iter().flat_map(|face| &face.corners).for_each(|node| visible[*node] = true);
    let shown: Vec<(String, Vec<usize>)> = mesh
        .sets()
        .iter()
        .filter(|set| !matches!(set.members, Members::Elements(_)))
        .map(|set| (set.name.clone(), mesh.nodes_of(&set.name).unwrap_or_default()))
        .filter(|(_, nodes)| !nodes.is_empty() && nodes.len() < seen.len())
        .collect();
    let extent = seen.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let count: usize = shown.iter().map(|(_, nodes)| nodes.len()).sum();
    let is_tested = count * canvas.faces.len() <= canvas.settings.tests;
    let tested = &canvas.faces[..if is_tested { canvas.faces.len() } else { 0 }];
    let is_hidden = |node: usize| tested.iter().any(|face| face.hides(&seen[node], seen, 1e-6 * extent));
    let unhidden = |(_, nodes): &(String, Vec<usize>)| {
        let nodes = nodes.iter().filter(|node| visible[**node] && !is_hidden(**node));
        canvas.pixels_of(&nodes.map(|node| seen[*node]).collect::<Vec<_>>())
    };
    let dots: Vec<Vec<[f32; 2]>> = shown.iter().take(canvas.settings.sets).map(unhidden).collect();
    // small sets are drawn over large ones that contain them
    let mut order: Vec<usize> = (0..dots.len()).collect();
    order.sort_by_key(|number| std::cmp::Reverse(shown[*number].1.len()));
    for number in order {
        canvas.dots(&dots[number], colour(number), 5.0);
    }
    let entry = |(number, (name, nodes)): (usize, &(String, Vec<usize>))| PictureLegendEntry {
        name: name.clone(),
        count: nodes.len(),
        colour: colour(number),
    };
    let legend: Vec<PictureLegendEntry> = shown.iter().enumerate().map(entry).collect();
    canvas.finish(mesh, title, &legend)
}

/// Returns the map from the view to pixels.
fn placement(seen: &[[f64; 3]], settings: PictureSettings) -> impl Fn(&[f64; 3]) -> [f64; 2] {
    let range = |axis: usize| {
        seen.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], point| {
            [low.min(point[axis]), high.max(point[axis])]
        })
    };
    let ranges = [range(0), range(1)];
    let PictureSettings { size, margins: [left, top, right, bottom], .. } = settings;
    let room = [size[0] - left - right, size[1] - top - bottom];
    let scale = [0, 1].map(|axis| room[axis] / (ranges[axis][1] - ranges[axis][0]));
    let scale = scale.into_iter().filter(|scale| scale.is_finite()).fold(f64::INFINITY, f64::min);
    let scale = if scale.is_finite() { scale } else { 1.0 };
    let middle = ranges.map(|[low, high]| 0.5 * (low + high));
    move |point: &[f64; 3]| {
        [left + 0.5 * room[0] + scale * (point[0] - middle[0]), top + 0.5 * room[1] - scale * (point[1] - middle[1])]
    }
}

/// Returns the outer faces of solids that are towards the viewer, and the faces of shells, from the
/// farthest to the nearest.
fn faces(mesh: &Mesh, seen: &[[f64; 3]]) -> Vec<SeenFace> {
    let corners = |nodes: &[usize]| nodes[..if nodes.len().is_multiple_of(3) { 3 } else { 4 }].to_vec();
    let solids = mesh.outer_faces().into_iter().map(|face| corners(&face.nodes));
    let shells = mesh.elements().iter().enumerate().filter(|(_, element)| !element.shape.is_solid());
    let shells = shells.map(|(index, element)| {
        mesh.element_nodes(index)[..element.shape.family.corners()].iter().map(|node| *node as usize).collect()
    });
    let mut faces: Vec<SeenFace> = solids
        .map(|corners| (corners, true))
        .chain(shells.map(|corners: Vec<usize>| (corners, false)))
        .filter(|(corners, _)| corners.len() > 2)
        .map(|(corners, is_outward)| {
            let [a, b, c] = [0, 1, corners.len() - 1].map(|corner| seen[corners[corner]]);
            let [u, v] = [b, c].map(|other| [0, 1, 2].map(|axis| other[axis] - a[axis]));
            let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let size = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
            // a shell is seen from both sides
            let size = if is_outward || normal[2] > 0.0 { size } else { -size };
            let depth = corners.iter().map(|node| seen[*node][2]).sum::<f64>() / corners.len() as f64;
            SeenFace { corners, depth, normal: normal.map(|x| x / size) }
        })
        .filter(|face| face.normal[2] > 1e-6)
        .collect();
    faces.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    faces
}

fn polygon(canvas: &mut Pixmap, at: &[[f32; 2]], face: &SeenFace, edge: f32) {
    let mut path = PathBuilder::new();
    for (corner, node) in face.corners.iter().enumerate() {
        let [x, y] = at[*node];
        if corner == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    path.close();
    let Some(path) = path.finish() else { return };
    // faces towards the viewer are lighter
    let light = (205.0 + 45.0 * face.normal[2]) as u8;
    let mut paint = Paint::default();
    paint.set_color_rgba8(light, light, light.saturating_add(4), 255);
    canvas.fill_path(&path, &paint, FillRule::Winding, Transform::identity(), None);
    paint.set_color_rgba8(110, 115, 125, 255);
    let stroke = Stroke { width: edge, ..Stroke::default() };
    canvas.stroke_path(&path, &paint, &stroke, Transform::identity(), None);
}

fn paint(colour: &str) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    let [red, green, blue] = [1, 3, 5].map(|from| u8::from_str_radix(&colour[from..from + 2], 16).unwrap_or(0));
    paint.set_color_rgba8(red, green, blue, 255);
    paint
}

pub(super) fn colour(number: usize) -> &'static str {
    PALETTE[number % PALETTE.len()][0]
}

/// Returns title, legend, extent and axes as SVG.
fn labels(mesh: &Mesh, title: &str, legend: &[PictureLegendEntry], view: &View, settings: PictureSettings) -> String {
    let PictureSettings { size: [width, height], margins, .. } = settings;
    let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
    let mut svg = format!("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\">");
    let mut text = |x: f64, y: f64, size: u32, text: &str| {
        let _ = write!(svg, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"#222222\">{}</text>", escaped(text));
    };
    text(margins[0], 52.0, 30, title);
    // six significant digits
    let short = |x: f64| format!("{x:.5e}").parse::<f64>().unwrap_or(x);
    let extent = mesh.extent().map_or_else(String::new, |ranges| {
        let of = |(axis, range): (&str, &std::ops::Range<f64>)| {
            format!("{axis} {} to {}", short(range.start), short(range.end))
        };
        ["x", "y", "z"].into_iter().zip(&ranges).map(of).collect::<Vec<_>>().join(", ")
    });
    let count = format!("{} nodes, {} elements", mesh.nodes().len(), mesh.elements().len());
    text(margins[0] + 150.0, height - 40.0, 22, &format!("{count}; {extent}"));
    let (left, mut y) = (width - margins[2] + 50.0, margins[1] + 20.0);
    let mut marks = String::new();
    for PictureLegendEntry { name, count, colour } in legend.iter().take(settings.sets) {
        let mut short: String = name.chars().take(settings.name_length).collect();
        if short.len() < name.len() {
            short.push('…');
        }
        text(left + 24.0, y, 22, &format!("{short} ({count})"));
        let _ = write!(marks, "<circle cx=\"{left}\" cy=\"{}\" r=\"8\" fill=\"{colour}\"/>", y - 7.0);
        y += 36.0;
    }
    if legend.len() > settings.sets {
        text(left, y, 22, &format!("and {} more", legend.len() - settings.sets));
    }
    // the axes at the bottom on the left
    let origin = [margins[0] + 55.0, height - 75.0];
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let mut unit = [0.0; 3];
        unit[axis] = 1.0;
        let [x, y, _] = view.of(unit);
        let end = [origin[0] + 50.0 * x, origin[1] - 50.0 * y];
        text(end[0] + 10.0 * x - 6.0, end[1] - 10.0 * y + 7.0, 22, name);
        let _ = write!(
            marks,
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"#222222\" stroke-width=\"2.5\"/>",
            origin[0], origin[1], end[0], end[1]
        );
    }
    svg + &marks + "</svg>"
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use stickslip_formats::mesh::read_bytes;

    /// Returns the number of pixels of a PNG that have exactly a colour.
    pub fn pixels(png: &[u8], colour: &str) -> f64 {
        let picture = Pixmap::decode_png(png).unwrap();
        let rgb = [1, 3, 5].map(|from| u8::from_str_radix(&colour[from..from + 2], 16).unwrap());
        picture.pixels().iter().filter(|p| [p.red(), p.green(), p.blue()] == rgb).count() as f64
    }

    pub const BRICK: &str = "*NODE\n1,0,0,0\n2,2,0,0\n3,2,1,0\n4,0,1,0\n5,0,0,1\n6,2,0,1\n7,2,1,1\n8,0,1,1\n\
        *ELEMENT,TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n*NSET,NSET=TOP\n5,6,7,8\n*NSET,NSET=BOTTOM\n1,2,3,4\n";

    /// The top is seen, the bottom is behind the body, and every face has its shade.
    #[test]
    fn visible_nodes_of_sets_are_coloured() {
        let mesh = read_bytes(BRICK.as_bytes()).unwrap();
        let picture = mesh_picture(&mesh, "brick <1>").unwrap();
        let count = |colour: &str| pixels(&picture, colour);
        // a dot has a radius of 5 pixels, the mark in the legend one of 8
        let (dot, mark) = (25.0 * std::f64::consts::PI, 64.0 * std::f64::consts::PI);
        let top = count(colour(0));
        assert!(top > 4.0 * dot * 0.7 + mark * 0.8 && top < 4.0 * dot * 1.2 + mark * 1.2, "{top}");
        // one corner of the bottom is hidden
        let bottom = count(colour(1));
        assert!(bottom > 3.0 * dot * 0.7 + mark * 0.8 && bottom < 3.0 * dot * 1.2 + mark * 1.2, "{bottom}");
    }

    #[test]
    fn a_mesh_of_nodes_alone_has_dots() {
        let mesh = read_bytes(b"*NODE\n1,0,0,0\n2,1,1,1\n3,0,1,0\n").unwrap();
        assert!(!mesh_picture(&mesh, "nodes").unwrap().is_empty());
    }
}
