"""Times pyHarm (package pyharm-os) on the curve of the massless blade couple that `cargo bench --bench peers_harmonic_balance` times for
Stickslip.

Reads a JSON list of cases from standard input (harmonics: the highest; samples per period; jacobian of the friction, "analytical" or
"jax"; from, to: the range, Hz; points) and writes one line of JSON per case: the median of the seconds that pyHarm's continuation takes
over the range, the number of points it kept and of those converged, and the frequencies and amplitudes of blade 1 (half of peak to
peak, m) of the converged ones.

pyHarm's Jenkins element is the element of the model: a spring `k` in series with a slider that holds up to `mu * N0`. It follows three
periods from a slider at rest and keeps the last one; slip begins and ends at samples. Mass, damping and stiffness of the blades are
matrices of one substructure, the cheapest form that pyHarm has for them. Imports, the system's assembly and compilation (Numba's and
JAX's) are not in the time.
"""

import json
import logging
import os
import statistics
import sys
import time
import warnings

# one core, as for Stickslip; Numba's functions here are serial, and the caller sets OMP_NUM_THREADS for BLAS
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import numpy as np
from pyHarm import Maestro

# pyHarm would log a banner per system; Numba warns of matrix products with strides, within pyHarm
logging.disable(logging.CRITICAL)
warnings.filterwarnings("ignore")

M, K, B, KT, FT, F0 = 0.182, 105103.0, 0.2, 1e4, 2.0, 10.0
# norm of the residual, N, below which a point is solved: pyHarm's own, 1e-9 of the excitation
RESIDUAL = 1e-8
# runs per case, of which the median counts
RUNS = 3


def couple(case, points):
    begin, end = 2 * np.pi * case["from"], 2 * np.pi * case["to"]
    step = (end - begin) / (case["points"] - 1)
    return Maestro({
        "system": {
            "type": "Base",
            # the motion has odd harmonics only: half the unknowns, which Stickslip leaves out by itself
            "nh": list(range(1, case["harmonics"] + 1, 2)),
            "nti": case["samples"],
        },
        "substructures": {
            "blades": {
                "matrix": {"M": M * np.eye(2), "C": B * np.eye(2), "K": K * np.eye(2)},
                "nnodes": 2, "nmodes": 0, "ndofs": 1, "matching": [0],
            },
        },
        "connectors": {
            # the slip limit is mu * N0
            "shroud": {"type": "Jenkins", "connect": {"blades": [0], "INTERNAL": [1]}, "dirs": [0],
                       "mu": 1.0, "N0": FT, "k": KT,
                       # "analytical" is pyHarm's default; "jax" (its automatic derivative, in single precision, which Newton's method
                       # survives) takes half the time of it with few harmonics and more with many: both are measured
                       "jac": case["jacobian"]},
            "force": {"type": "CosinusForcing", "connect": {"blades": [0]}, "dirs": [0], "amp": F0},
        },
        "analysis": {
            "curve": {
                "study": "frf", "puls_inf": begin, "puls_sup": end, "sign_ds": 1,
                # the fastest of its solvers here: stopped by the residual alone. Its Newton at given frequencies takes up to 15 % longer;
                # SciPy's hybr, the default, twice as long, and with one and fifteen harmonics it converges nowhere beyond 121 Hz
                "solver": "MoorePenrose", "solver_options": {"tol_residual": RESIDUAL},
                # the defaults; the secant takes as long as the tangent, the previous solution longer
                "predictor": "tangent", "corrector": "arc_length",
                # displacements are centimetres and frequencies hundreds of rad/s, so the arc length is that of the frequency: a constant
                # step gives the points of Stickslip's curve, nearly. Its adaptive step takes fewer points, and 10 to 40 % longer for each
                "stepsizer": "constant", "ds0": step, "ds_max": step, "ds_min": 1e-3 * step,
                # so many points, those of failed steps included, or the end of the range
                "stopper": "solnumber", "stopper_options": {"max_solutions": points},
                # a line per point in the log takes time
                "verbose": False, "predictor_options": {"verbose": False},
            },
        },
    })


def run(case, points):
    """The seconds of one continuation, the system, and its points."""
    maestro = couple(case, points)
    begin = time.perf_counter()
    maestro.operate()
    seconds = time.perf_counter() - begin
    return seconds, maestro.system, maestro.nls["curve"].SolList


def amplitude(order, cosine, coefficients):
    """Half of peak to peak of a sum of harmonics: the largest and smallest of 1024 values, each refined by Newton's method."""

    def value(t, derivative):
        phase = np.outer(t, order) + np.where(cosine, 0.0, -np.pi / 2) + derivative * np.pi / 2
        return np.cos(phase) @ (coefficients * order**derivative)

    t = 2 * np.pi * np.arange(1024) / 1024
    x = value(t, 0)
    ends = t[[np.argmax(x), np.argmin(x)]]
    for _ in range(3):
        ends = ends - value(ends, 1) / value(ends, 2)
    largest, smallest = value(ends, 0)
    return (largest - smallest) / 2


def measure(case):
    run(case, 3)  # compiles
    runs = [run(case, case["points"]) for _ in range(RUNS)]
    _, system, points = runs[-1]
    # the first point counts as accepted whatever its residual
    good = [p for p in points if p.flag_accepted and np.linalg.norm(p.R[:-1]) < RESIDUAL]
    blade = system.expl_dofs[system.expl_dofs.node_num == 0]
    order, cosine = blade.harm.to_numpy(float), (blade.cs == "c").to_numpy()
    return {
        "seconds": statistics.median(seconds for seconds, _, _ in runs),
        "points": len(points),
        "converged": len(good),
        "hertz": [p.x[-1] / (2 * np.pi) for p in good],
        "amplitudes": [amplitude(order, cosine, p.x[blade.index]) for p in good],
    }


for case in json.load(sys.stdin):
    try:
        result = measure(case)
    except Exception as error:  # whatever it is, it belongs into the table
        result = {"error": f"{type(error).__name__}: {error}"}
    print(json.dumps(result), flush=True)
