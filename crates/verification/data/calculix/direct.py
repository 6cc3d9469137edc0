"""Solves the sector under an engine order directly with SciPy, from the matrices beside: python3 direct.py

`[Z, Bᴴ; B, 0]`: both sides of the sector are kept, and Lagrange's multipliers hold `x_high = exp(j e θ) R x_low`.
"""
import csv, gzip, os
import numpy as np
from scipy.sparse import bmat, coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

COUNT, ORDER = 12, 2  # sectors, engine order
DAMPING = 8.0, 2e-7  # Rayleigh damping, 1/s and s
HERTZ = 1332.6, 1346.0  # beside a resonance and at one
NODES = 740, 721, 609, 466, 215  # where a blade is driven along z; the other corner of the tip, an edge, the foot, the disk
HERE = os.path.dirname(os.path.abspath(__file__))
read = lambda name: csv.DictReader(open(os.path.join(HERE, name)))


def matrix(name):
    with gzip.open(os.path.join(HERE, name), "rt") as file:
        row, column, value = np.loadtxt(file).T
    row, column = row.astype(int) - 1, column.astype(int) - 1
    upper = coo_matrix((value, (row, column))).tocsc()
    return upper + upper.T - csc_matrix((upper.diagonal(), (np.arange(upper.shape[0]),) * 2))


stiffness, mass = matrix("sector.sti.gz"), matrix("sector.mas.gz")
rows = {name.strip(): row for row, name in enumerate(open(os.path.join(HERE, "sector.dof")))}
angle, scale, n = 2 * np.pi / COUNT, abs(stiffness).max(), stiffness.shape[0]
turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
ties, at = [], 0
for pair in read("sector_boundary.csv"):
    for k in range(3):
        ties.append((at, rows[f"{pair['high']}.{k + 1}"], scale))
        ties += [(at, rows[f"{pair['low']}.{i + 1}"], -scale * turn[k, i] * np.exp(1j * ORDER * angle)) for i in range(3)]
        at += 1
i, k, value = zip(*ties)
tie = coo_matrix((value, (i, k)), (at, n)).tocsc()
force = np.zeros(n + at, complex)
force[rows[f"{NODES[0]}.3"]] = 1
text = "frequency_Hz,node,ux_re,uy_re,uz_re,ux_im,uy_im,uz_im\n"
for hertz in HERTZ:
    omega = 2 * np.pi * hertz
    dynamic = stiffness * (1 + 1j * omega * DAMPING[1]) + mass * (1j * omega * DAMPING[0] - omega**2)
    whole = bmat([[dynamic, tie.conj().T], [tie, None]], format="csc")
    factor = splu(whole)
    x = factor.solve(force)
    x += factor.solve(force - whole @ x)
    for node in NODES:
        u = [x[rows[f"{node}.{k}"]] for k in (1, 2, 3)]
        text += f"{hertz},{node}," + ",".join(f"{v:.13e}" for v in [z.real for z in u] + [z.imag for z in u]) + "\n"
with open(os.path.join(HERE, "sector_direct.csv"), "w") as file:
    file.write(text)
