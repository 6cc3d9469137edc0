"""The blade of `blade.py`: its matrices and study files, the work of each step by SuperLU and ARPACK, and the comparison of frequencies.

`python scipy_blade.py STEP OUT [NX NY NZ]`, where STEP is a function of `STEPS`.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import json
import sys
import tomllib
from pathlib import Path

import numpy as np
import scipy.io
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as la

E, NU, RHO = 210e9, 0.3, 7850.0
SPAN, CHORD, THICKNESS = 0.24, 0.10, 0.02
# what of chord and thickness is left at the tip, and by how much the tip is turned
TAPER, TWIST = 0.7, np.radians(30)
# where along the span the damper touches, and how many nodes along span and chord
PAD, ACROSS = (0.15, 0.3), (4, 4)
# modes of the reduction, and of the comparison with all rows
MODES = 20
# what a reduced frequency may be off by
OFF = 1e-3


def mesh(elements):
    """Coordinates of the nodes, and the eight nodes of every element."""
    x, y, z = np.meshgrid(*(np.linspace(0, 1, n + 1) for n in elements), indexing="ij")
    chord, thick = CHORD * (1 - (1 - TAPER) * x) * (y - 0.5), THICKNESS * (1 - (1 - TAPER) * x) * (z - 0.5)
    cos, sin = np.cos(TWIST * x), np.sin(TWIST * x)
    at = np.stack([SPAN * x, cos * chord - sin * thick, sin * chord + cos * thick], -1).reshape(-1, 3)
    nodes = np.arange(len(at)).reshape(x.shape)
    nx, ny, nz = elements
    corners = [nodes[i : i + nx, j : j + ny, k : k + nz].ravel() for i, j, k in CORNERS]
    return at, nodes, np.stack(corners, 1)


CORNERS = np.array([[c >> i & 1 for i in range(3)] for c in range(8)])


def matrices(at, corners):
    """Stiffness and mass, by 2 x 2 x 2 Gauss points: Zienkiewicz and Taylor, "The Finite Element Method" (2000), Vol. 1, Chap. 8."""
    lame, shear = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    elastic = np.zeros((6, 6))
    elastic[:3, :3] = lame
    elastic += np.diag([2 * shear] * 3 + [shear] * 3)
    signs = 2.0 * CORNERS - 1
    k, m = np.zeros((len(corners), 24, 24)), np.zeros((len(corners), 8, 8))
    for gauss in signs / np.sqrt(3):
        parts = (1 + signs * gauss) / 2
        shape = parts.prod(1)
        local = np.stack([signs[:, d] / 2 * np.delete(parts, d, 1).prod(1) for d in range(3)], 1)
        jacobian = np.einsum("cd,eci->edi", local, at[corners])
        slope = np.linalg.solve(jacobian, np.broadcast_to(local.T, (len(corners), 3, 8)))
        volume = np.linalg.det(jacobian)
        b = np.zeros((len(corners), 6, 8, 3))
        for row, of in enumerate([(0,), (1,), (2,), (0, 1), (1, 2), (0, 2)]):
            for d in of:
                b[:, row, :, d] = slope[:, sum(of) - d if len(of) > 1 else d]
        b = b.reshape(-1, 6, 24)
        k += np.einsum("eri,rs,esj,e->eij", b, elastic, b, volume, optimize=True)
        m += RHO * np.outer(shape, shape) * volume[:, None, None]
    rows = (3 * corners[..., None] + np.arange(3)).reshape(-1, 24)
    i, j, n = np.repeat(rows, 24, 1).ravel(), np.tile(rows, (1, 24)).ravel(), 3 * len(at)
    mass = np.einsum("eab,ij->eaibj", m, np.eye(3)).reshape(-1, 24, 24)
    both = (sp.coo_matrix((each.ravel(), (i, j)), (n, n)).tocsc() for each in (k, mass))
    return [(matrix + matrix.T) / 2 for matrix in both]


def make(out, *elements):
    """Matrices, names of rows, and `[structure]` with its places, reduced and whole."""
    at, nodes, corners = mesh(elements)
    keep = np.flatnonzero(np.repeat(at[:, 0] > 0, 3))
    stiffness, mass = (matrix[keep][:, keep].tocsc() for matrix in matrices(at, corners))
    sp.save_npz(out / "stiffness.npz", stiffness)
    sp.save_npz(out / "mass.npz", mass)
    with open(out / "rows.csv", "w") as file:
        print("row,name", file=file)
        for row, of in enumerate(keep, 1):
            print(f"{row},{of // 3 + 1}.{'xyz'[of % 3]}", file=file)
    nx, ny, _ = elements
    along = np.round(np.linspace(PAD[0] * nx, PAD[1] * nx, ACROSS[0])).astype(int)
    across = np.round(np.linspace(0.2 * ny, 0.8 * ny, ACROSS[1])).astype(int)
    pad = [(i, j) for i in along for j in across]
    tip = nodes[nx, 0, -1]
    places = [f'[[place]]\nname = "tip"\ndof = "{tip + 1}.z"\n']
    for number, (i, j) in enumerate(pad, 1):
        of = nodes[i, j, 0]
        tangent = at[nodes[i + 1, j, 0]] - at[nodes[i - 1, j, 0]]
        normal = np.cross(at[nodes[i, j + 1, 0]] - at[nodes[i, j - 1, 0]], tangent)
        normal, tangent = ((vector / np.linalg.norm(vector)).tolist() for vector in (normal, tangent))
        places.append(f'[[place]]\nname = "p{number}"\nnodes = ["{of + 1}"]\nnormal = {normal}\ntangent = {tangent}\n')
    structure = '''[structure]
stiffness = "stiffness.npz"
mass = "mass.npz"
dofs = "rows.csv"
units = "m-kg-s"
rayleigh = { mass = "20 /s", stiffness = "1e-7 s" }
reduce = REDUCE
'''
    text = "\n".join(places)
    few = structure.replace("REDUCE", f"{{ modes = {MODES} }}") + "\n" + text
    whole = structure.replace("REDUCE", "false") + "\n" + text
    (out / "few.toml").write_text(few)
    (out / "whole.toml").write_text(whole)
    row = {of: row for row, of in enumerate(keep.tolist())}
    ports = [row[3 * nodes[i, j, 0] + d] for i, j in pad for d in range(3)] + [row[3 * tip + 2]]
    (out / "ports.json").write_text(json.dumps(ports))
    print(f"{stiffness.shape[0]} rows, {stiffness.nnz} entries of stiffness, {len(pad)} contact nodes")


def factor(out):
    """Stiffness, mass, and the factor of the stiffness."""
    stiffness, mass = (sp.load_npz(out / f"{name}.npz").tocsc() for name in ("stiffness", "mass"))
    return stiffness, mass, la.splu(stiffness, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})


def modes(out, count=6):
    stiffness, mass, factored = factor(out)
    inverse = la.LinearOperator(stiffness.shape, factored.solve)
    return stiffness, mass, factored, *la.eigsh(stiffness, count, mass, sigma=0, OPinv=inverse)


def reduction(out):
    """Rubin: the modes, and what they leave of the answer to a force at every place."""
    stiffness, mass, factored, values, vectors = modes(out, MODES)
    ports = json.loads((out / "ports.json").read_text())
    loads = np.zeros((stiffness.shape[0], len(ports)))
    loads[ports, range(len(ports))] = 1
    residual = factored.solve(loads) - vectors @ ((vectors.T @ loads) / values[:, None])
    basis = np.hstack([vectors, residual / np.linalg.norm(residual, axis=0)])
    few = [basis.T @ (matrix @ basis) for matrix in (stiffness, mass)]
    np.savez(out / "scipy.npz", values=np.sort(values), stiffness=few[0], mass=few[1])


def compare(out):
    """Frequencies of what `stickslip reduce` wrote against those of all rows by ARPACK."""
    tables = tomllib.loads((out / "few/structure.toml").read_text())
    few = [scipy.io.mmread(out / "few" / tables["structure"][key]) for key in ("stiffness", "mass")]
    few = [matrix.toarray() if sp.issparse(matrix) else matrix for matrix in few]
    reduced = np.sqrt(scipy.linalg.eigvalsh(*few)[:MODES]) / (2 * np.pi)
    whole = np.sqrt(np.load(out / "scipy.npz")["values"]) / (2 * np.pi)
    off = np.abs(reduced / whole - 1).max()
    print(f"{MODES} frequencies, {whole[0]:.1f} to {whole[-1]:.1f} Hz: off by {off:.1e} at most from those of all rows by eigsh")
    if off > OFF:
        sys.exit(f"more than {OFF:.0e}")


STEPS = {step.__name__: step for step in (make, factor, modes, reduction, compare)}

if __name__ == "__main__":
    STEPS[sys.argv[1]](Path(sys.argv[2]), *map(int, sys.argv[3:]))
