//! Writes the displacements of all nodes of a mesh for ParaView: `fields.pvd`, a list of instants,
//! and a file `.vtu` of VTK for each. Several orbits or modes have a list each, `fields_1.pvd` ….
//!
//! The point data are `displacement` (m) and `velocity` (m/s). An orbit has `contact` at the nodes
//! of contacts: 0 none, 1 open, 2 touching, 3 sticking, 4 slipping. Contacts between meshes also
//! have `pressure` and `friction` (Pa), and `loss`, the dissipated energy per period and area
//! (J/m²). Nodes that are not in the table are at rest. For a disk, the files have
//! all sectors.
//! Source: VTK file formats, "XML file formats"; ParaView wiki, "ParaView/Data formats", PVD.

use crate::base64::base64;
use crate::fields::{Fields, contact_state, positions};
use crate::output::result_file::{File, Output, ReportError};
use std::fmt::Write;
use std::ops::Range;
use stickslip_formats::mesh::{Mesh, vtk_cell_type};
use stickslip_study::dataset::{Dataset, MeshSource};

/// The output `vtk`.
pub const OUTPUT: Output = Output {
    name: "vtk",
    summary: "the table `fields` on its mesh: fields.pvd and .vtu for ParaView",
    make: files,
    sink: None,
    is_default: true,
};

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    let Some((fields, source)) = Fields::of(dataset) else { return Ok(Vec::new()) };
    let (mut files, orbits) = (Vec::new(), fields.orbits());
    let grid = Grid::new(source, fields.sectors());
    for (number, orbit) in orbits.iter().enumerate() {
        let stem = if orbits.len() == 1 { "fields".to_owned() } else { format!("fields_{}", number + 1) };
        let mut list =
            String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n");
        for (instant, rows) in fields.instants(orbit).into_iter().enumerate() {
            let name = format!("{stem}_{instant:04}.vtu");
            let _ = writeln!(list, "<DataSet timestep=\"{:e}\" part=\"0\" file=\"{name}\"/>", fields.time[rows.start]);
            files.push(File::new(name, grid.file(&fields, rows)));
        }
        list += "</Collection>\n</VTKFile>\n";
        files.push(File::new(format!("{stem}.pvd"), list));
    }
    Ok(files)
}

/// The part of the files that does not depend on time.
struct Grid<'a> {
    mesh: &'a Mesh,
    sectors: usize,
    head: String,
}

impl<'a> Grid<'a> {
    fn new(source: &'a MeshSource, sectors: usize) -> Grid<'a> {
        let mesh = &source.mesh;
        let (nodes, elements) = (mesh.nodes(), mesh.elements());
        let points = (0..sectors).flat_map(|sector| positions(source, sector, sectors));
        let all = (0..sectors * elements.len()).flat_map(|element| {
            let (sector, element) = (element / elements.len(), element % elements.len());
            let first = (sector * nodes.len()) as u32;
            mesh.element_nodes(element).iter().map(move |node| first + node)
        });
        let ends = elements.iter().cycle().take(sectors * elements.len()).scan(0u32, |end, element| {
            *end += element.shape.nodes() as u32;
            Some(*end)
        });
        let types = (0..sectors).flat_map(|_| elements.iter().map(|element| vtk_cell_type(element.shape)));
        let mut head = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\" header_type=\"UInt32\">\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n",
            sectors * nodes.len(),
            sectors * elements.len()
        );
        head += &format!(
            "<Points>\n{}</Points>\n<Cells>\n",
            array("Float64", "Points", 3, points.flatten().flat_map(f64::to_le_bytes))
        );
        head += &array("UInt32", "connectivity", 1, all.flat_map(u32::to_le_bytes));
        head += &array("UInt32", "offsets", 1, ends.flat_map(u32::to_le_bytes));
        head += &array("UInt8", "types", 1, types);
        Grid { mesh, sectors, head: head + "</Cells>\n" }
    }

    /// Returns the file of an instant.
    fn file(&self, fields: &Fields, rows: Range<usize>) -> String {
        let each = self.mesh.nodes().len();
        let count = self.sectors * each;
        let point = |row: usize| {
            let node = i64::try_from(fields.node[row]).ok().and_then(|number| self.mesh.node(number))?;
            Some(fields.sector.map_or(0, |sector| sector[row] as usize) * each + node)
        };
        let points: Vec<(usize, usize)> = rows.filter_map(|row| Some((row, point(row)?))).collect();
        let vectors = |columns: &[&[f64]; 3]| {
            let mut values = vec![[0.0; 3]; count];
            points.iter().for_each(|(row, point)| values[*point] = columns.map(|column| column[*row]));
            values.into_iter().flatten().flat_map(f64::to_le_bytes)
        };
        let mut text = self.head.clone() + "<PointData Vectors=\"displacement\">\n";
        text += &array("Float64", "displacement", 3, vectors(&fields.displacement));
        if let Some(velocity) = &fields.velocity {
            text += &array("Float64", "velocity", 3, vectors(velocity));
        }
        if let Some(states) = fields.contact {
            let mut contact = vec![0u8; count];
            for (row, point) in &points {
                contact[*point] = contact_state(&states[*row]);
            }
            text += &array("UInt8", "contact", 1, contact.into_iter());
        }
        for (name, column) in &fields.per_area {
            let mut values = vec![0.0; count];
            points.iter().for_each(|(row, point)| values[*point] = column[*row]);
            text += &array("Float64", name, 1, values.into_iter().flat_map(f64::to_le_bytes));
        }
        text + "</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
    }
}

/// Returns an array in base64: its size in bytes, then its bytes.
fn array(kind: &str, name: &str, components: usize, bytes: impl Iterator<Item = u8>) -> String {
    let data: Vec<u8> = bytes.collect();
    let size = u32::try_from(data.len()).unwrap_or(u32::MAX);
    let encoded = base64(&[&size.to_le_bytes()[..], &data].concat());
    format!(
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">\n{encoded}\n</DataArray>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use stickslip_formats::mesh::read_bytes;

    #[test]
    fn a_list_for_every_orbit_and_a_file_for_every_instant() {
        let dataset = samples::motions_of_a_tetrahedron();
        let files = files(&dataset).unwrap();
        let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
        let expected = [
            "fields_1_0000.vtu",
            "fields_1_0001.vtu",
            "fields_1.pvd",
            "fields_2_0000.vtu",
            "fields_2_0001.vtu",
            "fields_2.pvd",
        ];
        assert_eq!(names, expected);
        let text = String::from_utf8(files[4].content.clone()).unwrap();
        // the displacements 6 and 7 of the first and the last node
        let bytes: Vec<u8> = [6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0, 0.0, 0.0]
            .iter()
            .flat_map(|x: &f64| x.to_le_bytes())
            .collect();
        assert!(text.contains(&base64(&[&96u32.to_le_bytes()[..], &bytes].concat())));
        assert!(text.contains(&base64(&[4, 0, 0, 0, 0, 0, 0, 4])));
        // the reader of meshes reads it back, in metres
        let back = read_bytes(text.as_bytes()).unwrap();
        assert_eq!((back.nodes().len(), back.elements().len()), (4, 1));
        assert_eq!(back.nodes()[2].position, [0.0, 3e-3, 0.0]);
    }
}
