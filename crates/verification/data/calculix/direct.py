"""Solves the blade, and the sector under an engine order, directly with SciPy, from the matrices beside: python3 direct.py

`[Z, Bᴴ; B, 0]`: both sides of the sector are kept, and Lagrange's multipliers hold `x_high = exp(j e θ) R x_low`.
"""
import csv, gzip, os
import numpy as np
from scipy.sparse import bmat, coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

COUNT, ORDER = 12, 2  # sectors, engine order
HERE = os.path.dirname(os.path.abspath(__file__))
read = lambda name: csv.DictReader(open(os.path.join(HERE, name)))


def matrix(name):
    with gzip.open(os.path.join(HERE, name), "rt") as file:
        row, column, value = np.loadtxt(file).T
    row, column = row.astype(int) - 1, column.astype(int) - 1
    upper = coo_matrix((value, (row, column))).tocsc()
    return upper + upper.T - csc_matrix((upper.diagonal(), (np.arange(upper.shape[0]),) * 2))


def responses(name, damping, hertz, nodes, tie=None):
    """Displacements of the nodes under 1 N along z at the first of them, with Rayleigh damping (1/s, s); rows of a CSV file."""
    stiffness, mass = matrix(f"{name}.sti.gz"), matrix(f"{name}.mas.gz")
    rows = {row_name.strip(): row for row, row_name in enumerate(open(os.path.join(HERE, f"{name}.dof")))}
    tie = tie(rows, stiffness) if tie else None
    force = np.zeros(stiffness.shape[0] + (tie.shape[0] if tie is not None else 0), complex)
    force[rows[f"{nodes[0]}.3"]] = 1
    text = "frequency_Hz,node,ux_re,uy_re,uz_re,ux_im,uy_im,uz_im\n"
    for f in hertz:
        omega = 2 * np.pi * f
        whole = stiffness * (1 + 1j * omega * damping[1]) + mass * (1j * omega * damping[0] - omega**2)
        if tie is not None:
            whole = bmat([[whole, tie.conj().T], [tie, None]], format="csc")
        factor = splu(whole.tocsc())
        x = factor.solve(force)
        x += factor.solve(force - whole @ x)
        for node in nodes:
            u = [x[rows[f"{node}.{k}"]] for k in (1, 2, 3)]
            text += f"{f},{node}," + ",".join(f"{v:.13e}" for v in [z.real for z in u] + [z.imag for z in u]) + "\n"
    with open(os.path.join(HERE, f"{name}_direct.csv"), "w") as file:
        file.write(text)


def sides(rows, stiffness):
    """Both sides of the sector move alike, turned and later."""
    angle, scale, n = 2 * np.pi / COUNT, abs(stiffness).max(), stiffness.shape[0]
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    ties, at = [], 0
    for pair in read("sector_boundary.csv"):
        for k in range(3):
            ties.append((at, rows[f"{pair['high']}.{k + 1}"], scale))
            ties += [(at, rows[f"{pair['low']}.{i + 1}"], -scale * turn[k, i] * np.exp(1j * ORDER * angle)) for i in range(3)]
            at += 1
    i, k, value = zip(*ties)
    return coo_matrix((value, (i, k)), (at, n)).tocsc()


# driven, the other corner of the tip, both edges, the middle, the foot; on both sides of the three lowest resonances
responses("blade", (5.0, 1e-7), (451.3, 462.81, 2054.9, 2096.4, 3158.8, 3238.2), (900, 865, 655, 681, 449, 236))
# driven, the other corner of the tip, an edge, the foot, the disk; beside a resonance and at one
responses("sector", (8.0, 2e-7), (1332.6, 1346.0), (740, 721, 609, 466, 215), sides)
