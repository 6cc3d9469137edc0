"""Writes the meshes of the tests: a brick, two wedges and a tetrahedron on one of them, with meshio
and, in the form of Ansys archives, by itself.

The brick fills 0 to 1 along x, y and z, both wedges x from 1 to 2, and the tip of the tetrahedron
is (1.5, 0.5, 2). The set FOOT has the nodes with z = 0. Gmsh writes three bricks of 1 x 1 x 1, apart
from each other, of hexahedra, wedges and tetrahedra, with the group FOOT. Run: python make.py
"""

import itertools
import pathlib

import gmsh
import meshio
import numpy as np

# meshio writes wedges of 15 nodes but does not know their dimension
meshio._mesh.topological_dimension["wedge15"] = 3

EDGES = {
    "hexahedron": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
    "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
}
QUADRATIC = {"hexahedron": "hexahedron20", "wedge": "wedge15", "tetra": "tetra10"}


def model(quadratic):
    low = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)]
    points = low + [(x, y, 1) for x, y, _ in low] + [(1.5, 0.5, 2)]
    elements = [
        ("hexahedron", [0, 1, 2, 3, 6, 7, 8, 9]),
        ("wedge", [1, 4, 5, 7, 10, 11]),
        ("wedge", [1, 5, 2, 7, 11, 8]),
        ("tetra", [7, 10, 11, 12]),
    ]
    points = [tuple(map(float, point)) for point in points]
    cells = []
    for kind, corners in elements:
        nodes = list(corners)
        if quadratic:
            for a, b in EDGES[kind]:
                middle = tuple((np.array(points[corners[a]]) + np.array(points[corners[b]])) / 2)
                if middle not in points:
                    points.append(middle)
                nodes.append(points.index(middle))
        cells.append((QUADRATIC[kind] if quadratic else kind, nodes))
    blocks = [(kind, [nodes for _, nodes in group]) for kind, group in itertools.groupby(cells, key=lambda c: c[0])]
    points = np.array(points)
    foot = np.flatnonzero(points[:, 2] == 0)
    return points, blocks, foot


def brick(kind, nodes):
    """Returns the nodes of an element as those of a brick that repeats nodes, as Ansys writes it."""
    if kind.startswith("hexahedron"):
        return nodes
    wedge = kind.startswith("wedge")
    corners = [0, 1, 2, 2, 3, 4, 5, 5] if wedge else [0, 1, 2, 2, 3, 3, 3, 3]
    if len(nodes) in (4, 6):
        return [nodes[i] for i in corners]
    middles = [6, 7, 2, 8, 9, 10, 5, 11, 12, 13, 14, 14] if wedge else [4, 5, 2, 6, 3, 3, 3, 3, 7, 8, 9, 9]
    return [nodes[i] for i in corners + middles]


def archive(points, blocks, foot, quadratic):
    """Returns an archive of Ansys (CDWRITE)."""
    real = lambda x: f"{x:21.13E}"[1:-2] + "0" + f"{x:21.13E}"[-2:]
    row = lambda numbers: "".join(f"{number:9d}" for number in numbers) + "\n"
    elements = [(kind, nodes) for kind, group in blocks for nodes in group]
    text = "/PREP7\nETBLOCK,        1,        1\n(2i9,19a9)\n"
    text += row([1, 186 if quadratic else 185] + 18 * [0]) + "       -1\n"
    text += f"NBLOCK,6,SOLID,{len(points):10d},{len(points):10d}\n(3i9,6e21.13e3)\n"
    for number, point in enumerate(points, 1):
        text += row([number, 0, 0])[:-1] + "".join(real(x) for x in point) + "\n"
    text += f"N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID,{len(elements):10d},{len(elements):10d}\n(19i9)\n"
    for number, (kind, nodes) in enumerate(elements, 1):
        nodes = [node + 1 for node in brick(kind, list(nodes))]
        numbers = [1, 1, 1, 1, 0, 0, 0, 0, len(nodes), 0, number] + nodes
        text += row(numbers[:19]) + (row(numbers[19:]) if numbers[19:] else "")
    text += f"       -1\nCMBLOCK,FOOT    ,NODE,{len(foot):8d}\n(8i10)\n"
    for begin in range(0, len(foot), 8):
        text += "".join(f"{node + 1:10d}" for node in foot[begin : begin + 8]) + "\n"
    return text


for quadratic in (False, True):
    points, blocks, foot = model(quadratic)
    pathlib.Path(f"{'quadratic' if quadratic else 'linear'}.cdb").write_text(archive(points, blocks, foot, quadratic))
    name = "quadratic" if quadratic else "linear"
    # ids in a set of element sets differ from format to format, so only nodes are named
    mesh = meshio.Mesh(points, blocks, point_sets={"FOOT": foot})
    meshio.write(f"{name}.inp", mesh, file_format="abaqus")
    flags = np.zeros(len(points), dtype=np.int32)
    flags[foot] = 1
    data = meshio.Mesh(points, blocks, point_data={"FOOT": flags})
    meshio.write(f"{name}.vtu", data, file_format="vtu", binary=quadratic)
    plain = meshio.Mesh(points, blocks)
    meshio.write(f"{name}_small.bdf", plain, file_format="nastran", point_format="fixed-small", cell_format="fixed-small")
    meshio.write(f"{name}_large.bdf", plain, file_format="nastran", point_format="fixed-large", cell_format="fixed-small")
    for path in pathlib.Path(".").glob("*.bdf"):
        # meshio appends an underscore to the names of quadratic elements
        path.write_text(path.read_text().replace("_ ", "  "))

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
gmsh.option.setNumber("Mesh.MeshSizeMin", 1)
feet = []
for x, shape in ((0, "hexahedra"), (2, "wedges"), (4, "tetrahedra")):
    corners = [gmsh.model.geo.addPoint(x + dx, dy, 0) for dx, dy in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = [gmsh.model.geo.addLine(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    foot = gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])
    for line in lines:
        gmsh.model.geo.mesh.setTransfiniteCurve(line, 2)
    gmsh.model.geo.mesh.setTransfiniteSurface(foot)
    if shape == "hexahedra":
        gmsh.model.geo.mesh.setRecombine(2, foot)
    layers = {} if shape == "tetrahedra" else {"numElements": [1], "recombine": True}
    gmsh.model.geo.extrude([(2, foot)], 0, 0, 1, **layers)
    feet.append(foot)
gmsh.model.geo.synchronize()
gmsh.model.addPhysicalGroup(2, feet, name="FOOT")
gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="ALL")
gmsh.model.mesh.generate(3)
for order, name in ((1, "linear"), (2, "quadratic")):
    gmsh.model.mesh.setOrder(order)
    for version in (2.2, 4.1):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.write(f"{name}_{str(version).replace('.', '')}.msh")
gmsh.finalize()
