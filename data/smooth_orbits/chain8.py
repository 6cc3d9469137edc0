"""Chain of eight blades with seven massless arctan joints: reference orbit by SciPy integration.

    m x_i'' + b x_i' + k_i x_i + F_i - F_(i-1) = F0 cos(w t) if i = 1 else 0,      F_0 = F_8 = 0,      i = 1..8
    F_j' = kt [u_j' - (1/alpha) tan(pi F_j / (2 Ft_j))],                   u_j = x_j - x_(j+1), j = 1..7
    k_i = 105103 (1 + 0.002 (i - 4.5)) N/m,   Ft_j = 1 + 0.5 j N

Integrated in z_j, F_j = Ft_j (2/pi) atan(sinh z_j):  z_j' = kt (pi/(2 Ft_j)) cosh(z_j) [u_j' - sinh(z_j)/alpha].
State: x_1..x_8, v_1..v_8, z_1..z_7. Writes chain8.csv. Run: python chain8.py
"""
import csv
import time
from math import cos, pi
from pathlib import Path

import numpy as np

from periodic import Flow, half_period_jacobian, refined_maximum, symmetric_orbit

N = 8
m, b, kt, alpha, f = 0.182, 0.2, 1.0e4, 25000.0, 121.3
FORCES = (10.0, 60.0)  # N; in both cases joint 1 slips and the others only creep
F0 = FORCES[0]
w, T = 2 * pi * f, 1 / f
k = 105103.0 * (1 + 0.002 * (np.arange(1, N + 1) - 4.5))
Ft = 1 + 0.5 * np.arange(1, N)
c, g = Ft * 2 / pi, kt * pi / (2 * Ft)
SAMPLES = 8192


def rhs(t, y):
    x, v, z = y[:N], y[N:2 * N], y[2 * N:3 * N - 1]
    sh = np.sinh(z)
    F = c * np.arctan(sh)
    a = -b * v - k * x
    a[:-1] -= F
    a[1:] += F
    a[0] += F0 * cos(w * t)
    return np.concatenate([v, a / m, g * np.cosh(z) * (v[:-1] - v[1:] - sh / alpha)])


BASE = np.zeros((3 * N - 1, 3 * N - 1))
BASE[:N, N:2 * N] = np.eye(N)
BASE[N:2 * N, :N] = -np.diag(k) / m
BASE[N:2 * N, N:2 * N] = -b / m * np.eye(N)
J_ = np.arange(N - 1)


def jac(t, y):
    v, z = y[N:2 * N], y[2 * N:3 * N - 1]
    sh, ch = np.sinh(z), np.cosh(z)
    J = BASE.copy()
    d = c / ch / m
    J[N + J_, 2 * N + J_] = -d
    J[N + J_ + 1, 2 * N + J_] = d
    J[2 * N + J_, N + J_] = g * ch
    J[2 * N + J_, N + J_ + 1] = -g * ch
    J[2 * N + J_, 2 * N + J_] = g * (sh * (v[:-1] - v[1:] - sh / alpha) - ch * ch / alpha)
    return J


M_ = 3 * N - 1  # then: 7 losses in the sliders, 7 loop areas, work in, viscous loss, 16 Fourier integrals


def rhs_all(t, y):
    v, z = y[N:2 * N], y[2 * N:M_]
    sh = np.sinh(z)
    F = c * np.arctan(sh)
    co, si = np.cos(w * t), np.sin(w * t)
    return np.concatenate([rhs(t, y), F * sh / alpha, F * (v[:-1] - v[1:]), [F0 * co * v[0], b * (v @ v)], y[:N] * co, y[:N] * si])


def jac_all(t, y):
    v, z = y[N:2 * N], y[2 * N:M_]
    sh, ch = np.sinh(z), np.cosh(z)
    F = c * np.arctan(sh)
    co, si = np.cos(w * t), np.sin(w * t)
    n = M_ + 2 * (N - 1) + 2 + 2 * N
    J = np.zeros((n, n))
    J[:M_, :M_] = jac(t, y)
    J[M_ + J_, 2 * N + J_] = (c / ch * sh + F * ch) / alpha
    J[M_ + 7 + J_, 2 * N + J_] = c / ch * (v[:-1] - v[1:])
    J[M_ + 7 + J_, N + J_] = F
    J[M_ + 7 + J_, N + J_ + 1] = -F
    J[M_ + 14, N] = F0 * co
    J[M_ + 15, N:2 * N] = 2 * b * v
    J[M_ + 16 + np.arange(N), np.arange(N)] = co
    J[M_ + 24 + np.arange(N), np.arange(N)] = si
    return J


def measure(x0, scale, method, rtol, atol):
    e = scale[:N].max()
    # each integral keeps to its own size: joint losses to Ft_j times the stroke of their joint (here the blade's own scale)
    stroke = np.maximum(scale[:N - 1], scale[1:N])
    scale_all = np.concatenate([scale, Ft * stroke, Ft * stroke, [F0 * e, F0 * e], np.tile(scale[:N], 2) * T])
    t = np.linspace(0, T, SAMPLES + 1)
    y = Flow(rhs_all, jac_all, scale_all, method, rtol, atol).at(t, np.concatenate([x0, np.zeros(len(scale_all) - M_)]))
    d = np.array([rhs(tt, yy[:M_]) for tt, yy in zip(t, y)])
    out = {"amplitude": [], "phase": [], "loss": y[-1, M_:M_ + 7], "area": y[-1, M_ + 7:M_ + 14]}
    for i in range(N):
        high, _ = refined_maximum(t, y[:, i], y[:, N + i], d[:, N + i])
        low, _ = refined_maximum(t, -y[:, i], -y[:, N + i], -d[:, N + i])
        out["amplitude"].append(0.5 * (high + low))
        out["phase"].append(float(np.degrees(np.angle(y[-1, M_ + 16 + i] - 1j * y[-1, M_ + 24 + i]))))
    out["amplitude"], out["phase"] = np.array(out["amplitude"]), np.array(out["phase"])
    out["work"], out["viscous"] = y[-1, M_ + 14], y[-1, M_ + 15]
    out["gap"] = abs(out["work"] - out["viscous"] - out["loss"].sum()) / out["work"]
    out["peak_force"] = np.abs(c * np.arctan(np.sinh(y[:, 2 * N:M_]))).max(0)
    return out


def solve(force):
    """The orbit at the force amplitude `force`: rows of the table."""
    global F0
    F0 = force
    start = time.time()
    guess = np.concatenate([np.full(N, 0.01), np.full(N, 7.0), np.full(N - 1, 5.0)])
    x = np.zeros(M_)
    for attempt in range(8):
        x = Flow(rhs, jac, guess, rtol=1e-7, atol=1e-9).over(0, 300 * T, x)
        y = Flow(rhs, jac, guess, rtol=1e-7, atol=1e-9).at(np.linspace(0, T, 513), x)
        print(f"   {300 * (attempt + 1)} periods from rest: change in a period {np.max(abs(y[-1] - x) / np.abs(y).max(0)):.2e}  {time.time() - start:.0f} s", flush=True)
        try:
            x0, _, J, _ = symmetric_orbit(Flow(rhs, jac, np.abs(y).max(0), rtol=1e-10, atol=1e-13), x, T / 2, tolerance=1e-9, verbose=True)
            break
        except RuntimeError as stall:
            print("  ", stall, flush=True)
    scale = np.abs(Flow(rhs, jac, guess, rtol=1e-10, atol=1e-13).at(np.linspace(0, T, 513), x0)).max(0)
    found = {}
    for method, rtol, atol in [("LSODA", 1e-10, 1e-13), ("LSODA", 1e-12, 1e-15), ("Radau", 1e-8, 1e-11), ("Radau", 1e-10, 1e-13)]:
        mark = time.time()
        flow = Flow(rhs, jac, scale, method, rtol, atol)
        x0, size, J, _ = symmetric_orbit(flow, x0, T / 2, jacobian=J, tolerance=1e-12 if method == "LSODA" else 1e-13)
        full = np.max(np.abs(flow.over(0, T, x0) - x0) / scale)
        out = measure(x0, scale, method, rtol, atol)
        found[method, rtol] = x0, size, out
        print(f"{method} rtol={rtol:g}: residual {size:.1e} full {full:.1e} gap {out['gap']:.1e}  {time.time() - mark:.0f} s\n"
              f"   {out['amplitude']}\n   {out['loss']}", flush=True)
    x0, size, out = found["Radau", 1e-10]
    J = half_period_jacobian(Flow(rhs, jac, scale, "LSODA", 1e-12, 1e-15), x0, T / 2)
    multipliers = np.sort(abs(np.linalg.eigvals(J)))[::-1]
    print("multipliers", multipliers)
    y = Flow(rhs, jac, scale, "LSODA", 1e-11, 1e-14).at(np.arange(301) * T, x0)
    drift = np.max(np.abs(y - x0) / scale, axis=1).max()
    off = x0.copy()
    off[:2 * N] *= 1.01
    y = Flow(rhs, jac, scale, "LSODA", 1e-10, 1e-13).at(np.arange(1201) * T, off)
    back = np.max(np.abs(y - x0) / scale, axis=1)
    print(f"free run 300 periods: drift {drift:.2e}; from 1 % off: after 0, 300, 600, 1200 periods {back[[0, 300, 600, 1200]]}")

    def difference(name, key):
        return np.max([abs(found[q][2][name] / out[name] - 1) for q in key], axis=0)

    rest = {"lsoda": [("LSODA", 1e-12)], "radau": [("Radau", 1e-8)]}
    rows = []
    for name, label, unit in [("amplitude", "blade_amplitude", "m"), ("phase", "blade_phase", "deg"), ("loss", "joint_loss", "J"), ("peak_force", "joint_peak_force", "N")]:
        for i in range(len(out[name])):
            rows.append([force, label, i + 1, float(out[name][i]), unit] + [float(difference(name, q)[i]) for q in rest.values()])
    for label, value, unit in [("work_in", out["work"], "J"), ("viscous_loss", out["viscous"], "J"), ("energy_gap", out["gap"], "1"), ("periodicity_residual", size, "1"),
                               ("free_run_drift_300_periods", drift, "1"), ("largest_half_period_multiplier", multipliers[0], "1")]:
        rows.append([force, label, "", float(value), unit, "", ""])
    F_at_0 = c * np.arctan(np.sinh(x0[2 * N:]))
    for label, values, unit in [("x_at_0", x0[:N], "m"), ("v_at_0", x0[N:2 * N], "m/s"), ("F_at_0", F_at_0, "N")]:
        rows += [[force, label, i + 1, float(value), unit, "", ""] for i, value in enumerate(values)]
    print(f"{time.time() - start:.0f} s")
    return rows


def main():
    rows = []
    for force in FORCES:
        rows += solve(force)
        with open(Path(__file__).with_name("chain8.csv"), "w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["force_N", "quantity", "number", "value", "unit", "difference_lsoda_1e-12", "difference_radau_1e-8"])
            writer.writerows(rows)


if __name__ == "__main__":
    main()
