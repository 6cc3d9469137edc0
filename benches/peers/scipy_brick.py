"""The block of steel of `cargo bench --bench reduction` with SciPy: SuperLU and ARPACK.

Reads JSON from standard input, `{"elements": [50, 20, 18], "modes": 20, "held": true}`, and writes one line of JSON: degrees of freedom, seconds of one
processor for the factor and for the modes with it, memory (MB), and the eigenvalues (rad²/s²) that `crates/stickslip/tests/it/reduction` holds modes against.
"""

import json
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import resource
import sys
import time

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as la

E, NU, RHO = 210e9, 0.3, 7850.0
EDGE = 0.005


def element():
    """Stiffness (directions inner) and mass (one direction) of a cube, by strain-displacement matrices in Voigt's notation."""
    lame, shear = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    elastic = np.zeros((6, 6))
    elastic[:3, :3] = lame
    elastic += np.diag([2 * shear] * 3 + [shear] * 3)
    signs = np.array([[(c >> i & 1) * 2 - 1 for i in range(3)] for c in range(8)], float)
    k, m = np.zeros((24, 24)), np.zeros((8, 8))
    for gauss in signs / np.sqrt(3):
        parts = (1 + signs * gauss) / 2
        shape = parts.prod(1)
        slope = np.empty((8, 3))
        for d in range(3):
            others = [i for i in range(3) if i != d]
            slope[:, d] = signs[:, d] / EDGE * parts[:, others].prod(1)
        b = np.zeros((6, 24))
        for c in range(8):
            x, y, z = slope[c]
            b[:, 3 * c : 3 * c + 3] = [[x, 0, 0], [0, y, 0], [0, 0, z], [y, x, 0], [0, z, y], [z, 0, x]]
        k += b.T @ elastic @ b * EDGE**3 / 8
        m += RHO * np.outer(shape, shape) * EDGE**3 / 8
    return k, np.kron(m, np.eye(3))


def brick(nx, ny, nz, held):
    k, m = element()
    x, y, z = np.meshgrid(range(nx), range(ny), range(nz), indexing="ij")
    first = np.stack([x.ravel(), y.ravel(), z.ravel()], 1)
    corners = np.array([[c >> i & 1 for i in range(3)] for c in range(8)])
    at = first[:, None, :] + corners[None]
    node = (at[..., 2] * (ny + 1) + at[..., 1]) * (nx + 1) + at[..., 0]
    rows = (3 * node[..., None] + np.arange(3)).reshape(len(first), 24)
    i, j = np.repeat(rows, 24, axis=1).ravel(), np.tile(rows, (1, 24)).ravel()
    n = 3 * (nx + 1) * (ny + 1) * (nz + 1)
    stiffness = sp.coo_matrix((np.tile(k.ravel(), len(first)), (i, j)), (n, n)).tocsc()
    mass = sp.coo_matrix((np.tile(m.ravel(), len(first)), (i, j)), (n, n)).tocsc()
    if held:
        keep = np.flatnonzero(np.arange(n) // 3 % (nx + 1) > 0)
        stiffness, mass = stiffness[keep][:, keep], mass[keep][:, keep]
    return stiffness, mass


def main():
    case = json.load(sys.stdin)
    held, count = case.get("held", True), case["modes"]
    stiffness, mass = brick(*case["elements"], held)
    now = time.process_time()
    # a free block has no inverse at zero; -1e8 is far below its first elastic mode
    shift = 0.0 if held else -1e8
    factor = la.splu(sp.csc_matrix(stiffness - shift * mass), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    factored = time.process_time() - now
    inverse = la.LinearOperator(stiffness.shape, factor.solve)
    values = la.eigsh(stiffness, count, mass, sigma=shift, OPinv=inverse, tol=1e-13)[0]
    result = {
        "dofs": stiffness.shape[0],
        "factor_s": factored,
        "modes_s": time.process_time() - now,
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
        "values": [float(f"{value:.12e}") for value in np.sort(values)],
    }
    print(json.dumps(result))


main()
