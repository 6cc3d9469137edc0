"""Times SciPy on the orbits of the paper's blade couple that `cargo bench --bench peers` times for Stickslip.

Reads a JSON list of cases from standard input (Ft in N, frequency in Hz, alpha in s/m, start: the state of the neighbouring orbit,
(x, v) in SI) and writes, per case and integrator, the seconds that Newton's method on the half-period map takes from that start to a
residual of 1e-9, with the derivative from finite differences, and the amplitude of blade 1 that it finds.
"""

import json
import sys
import time

import numpy as np
from scipy.integrate import solve_ivp

M, M1, K, B, KT, F0 = 0.182, 0.00182, 105103.0, 0.2, 1e4, 10.0
MASS = np.array([M - M1 / 2, M1, M - M1 / 2])
TOLERANCE = 1e-9
RESIDUAL = 1e-9


def slope(t, z, ft, alpha, omega):
    x, v = z[:3], z[3:]
    friction = ft * 2 / np.pi * np.arctan(alpha * (v[0] - v[1]))
    spring = KT * (x[1] - x[2])
    force = np.array([
        F0 * np.cos(omega * t) - B * v[0] - K * x[0] - friction,
        friction - spring,
        spring - B * v[2] - K * x[2],
    ])
    return np.concatenate((v, force / MASS))


def half(z, case, method, dense=False):
    omega = 2 * np.pi * case["hertz"]
    scale = np.array([1e-2] * 3 + [10.0] * 3)
    run = solve_ivp(slope, (0, np.pi / omega), z, method=method, rtol=TOLERANCE, atol=TOLERANCE * 1e-3 * scale,
                    args=(case["ft"], case["alpha"], omega), dense_output=dense)
    if not run.success:
        raise RuntimeError(run.message)
    return run if dense else run.y[:, -1]


def orbit(case, method):
    z = np.array(case["start"])
    weight = np.array([1e-2] * 3 + [10.0] * 3)
    for _ in range(12):
        gap = z + half(z, case, method)
        if np.max(np.abs(gap) / weight) < RESIDUAL:
            run = half(z, case, method, dense=True)
            t = np.linspace(0, run.t[-1], 4001)
            return float(np.max(np.abs(run.sol(t)[0])))
        jacobian = np.empty((6, 6))
        for k in range(6):
            step = 1e-6 * weight[k]
            shifted = z.copy()
            shifted[k] += step
            jacobian[:, k] = (shifted + half(shifted, case, method) - gap) / step
        z = z - np.linalg.solve(jacobian, gap)
    raise RuntimeError(f"residual {np.max(np.abs(gap) / weight):.1e} after 12 iterations")


for case in json.load(sys.stdin):
    for method in ("LSODA", "Radau"):
        begin = time.perf_counter()
        try:
            result = {"amplitude": orbit(case, method)}
        except RuntimeError as error:
            result = {"error": str(error)}
        print(json.dumps({"method": method, "seconds": time.perf_counter() - begin, **result}), flush=True)
