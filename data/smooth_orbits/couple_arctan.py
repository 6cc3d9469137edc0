"""Blade couple joined by one arctan friction contact: reference orbits by SciPy integration.

    M x1'' + b x1' + k x1 + Ft (2/pi) atan(alpha (x1' - x2')) = F0 cos(w t)         M = m - m1/2
    m1 x2'' + kt (x2 - x3) - Ft (2/pi) atan(alpha (x1' - x2')) = 0
    M x3'' + b x3' + k x3 - kt (x2 - x3) = 0

State integrated: (x1, v1, r, g, x3, v3), r = x1 - x2, g = v1 - v2, so that the tiny creep speed g of the sticking contact is not
a difference of two large numbers. Writes couple_arctan.csv beside this file. Run: python couple_arctan.py
"""
import csv
import sys
import time
from math import atan, cos, pi
from pathlib import Path

import numpy as np

from periodic import Flow, half_period_jacobian, refined_maximum, symmetric_orbit

m, m1, k, b, kt, F0, alpha = 0.182, 0.00182, 105103.0, 0.2, 1.0e4, 10.0, 25000.0
M = m - 0.5 * m1
POINTS = [(2.0, 121.25, 300), (4.0, 120.75, 2000), (8.0, 121.00, 300)]  # Ft [N], f [Hz], periods of the free-run check
SAMPLES = 8192  # per period


def equations(Ft, w):
    c = Ft * 2.0 / pi

    def rhs(t, z):
        x1, v1, r, g, x3, v3 = z[:6]
        friction = c * atan(alpha * g)
        spring = kt * (x1 - r - x3)
        a1 = (F0 * cos(w * t) - b * v1 - k * x1 - friction) / M
        a2 = (friction - spring) / m1
        a3 = (spring - b * v3 - k * x3) / M
        return [v1, a1, g, a1 - a2, v3, a3]

    def jac(t, z):
        g = z[3]
        d = c * alpha / (1.0 + (alpha * g) ** 2)
        a1 = np.array([-k, -b, 0.0, -d, 0.0, 0.0]) / M
        a2 = np.array([-kt, 0.0, kt, d, kt, 0.0]) / m1
        a3 = np.array([kt, 0.0, -kt, 0.0, -kt - k, -b]) / M
        return np.array([[0, 1, 0, 0, 0, 0], a1, [0, 0, 0, 1, 0, 0], a1 - a2, [0, 0, 0, 0, 0, 1], a3])

    return rhs, jac


def with_integrals(Ft, w):
    """The same equations with the integrals that the results need, carried as states 6..14:
    friction loss, work of the drive, viscous loss, then int x_i cos, int x_i sin (i = 1, 2, 3)."""
    rhs, jac = equations(Ft, w)
    c = Ft * 2.0 / pi

    def rhs_all(t, z):
        x1, v1, r, g, x3, v3 = z[:6]
        x2 = x1 - r
        co, si = np.cos(w * t), np.sin(w * t)
        return rhs(t, z) + [c * atan(alpha * g) * g, F0 * co * v1, b * (v1 * v1 + v3 * v3),
                            x1 * co, x1 * si, x2 * co, x2 * si, x3 * co, x3 * si]

    def jac_all(t, z):
        x1, v1, r, g, x3, v3 = z[:6]
        co, si = np.cos(w * t), np.sin(w * t)
        J = np.zeros((15, 15))
        J[:6, :6] = jac(t, z)
        J[6, 3] = c * (atan(alpha * g) + alpha * g / (1.0 + (alpha * g) ** 2))
        J[7, 1] = F0 * co
        J[8, 1], J[8, 5] = 2 * b * v1, 2 * b * v3
        J[9, 0], J[10, 0] = co, si
        J[11, 0], J[11, 2], J[12, 0], J[12, 2] = co, -co, si, -si
        J[13, 4], J[14, 4] = co, si
        return J

    return rhs_all, jac_all


def measure(Ft, f, x0, scale, method, rtol, atol, samples=SAMPLES):
    """Everything reported about the orbit through x0 at t = 0."""
    w, T = 2 * pi * f, 1 / f
    rhs, _ = equations(Ft, w)
    rhs_all, jac_all = with_integrals(Ft, w)
    e = F0 * scale[0]
    scale_all = np.concatenate([scale, [e, e, e], np.repeat([scale[0], scale[0], scale[4]], 2) * T])
    flow = Flow(rhs_all, jac_all, scale_all, method, rtol, atol)
    t = np.linspace(0, T, samples + 1)
    z = flow.at(t, np.concatenate([x0, np.zeros(9)]))
    d = np.array([rhs(tt, zz) for tt, zz in zip(t, z[:, :6])])
    # extrema of x and of -x
    out = {}
    for name, x, v, a in [("x1", z[:, 0], z[:, 1], d[:, 1]), ("x2", z[:, 0] - z[:, 2], z[:, 1] - z[:, 3], d[:, 1] - d[:, 3]),
                          ("x3", z[:, 4], z[:, 5], d[:, 5])]:
        high, _ = refined_maximum(t, x, v, a)
        low, _ = refined_maximum(t, -x, -v, -a)
        out[f"{name}_amplitude_m"] = 0.5 * (high + low)
    end = z[-1]
    for i, name in enumerate(["x1", "x2", "x3"]):
        X = 2 / T * (end[9 + 2 * i] - 1j * end[10 + 2 * i])
        out[f"{name}_phase_deg"] = float(np.degrees(np.angle(X)))
        out[f"{name}_first_harmonic_m"] = abs(X)
    out["friction_loss_J"], out["work_in_J"], out["viscous_loss_J"] = end[6], end[7], end[8]
    out["energy_gap"] = abs(end[7] - end[6] - end[8]) / end[7]
    out["creep_fraction"] = float(np.mean(np.abs(alpha * z[:-1, 3]) < 100))  # share of the period with |g| < 4 mm/s
    return out


def main():
    rows = []
    for Ft, f, periods in POINTS:
        start = time.time()
        w, T = 2 * pi * f, 1 / f
        rhs, jac = equations(Ft, w)
        guess = np.array([0.03, 22.0, 0.03, 22.0, 0.01, 7.0])
        # from rest, 400 periods at a time, until Newton's method takes over
        x = np.zeros(6)
        for _ in range(6):
            x = Flow(rhs, jac, guess, rtol=1e-8, atol=1e-10).over(0, 400 * T, x)
            z = Flow(rhs, jac, guess, rtol=1e-8, atol=1e-10).at(np.linspace(0, T, 513), x)
            try:
                x0, _, J, _ = symmetric_orbit(Flow(rhs, jac, np.abs(z).max(0), rtol=1e-10, atol=1e-13), x, T / 2, tolerance=1e-9)
                break
            except RuntimeError as stall:
                print("  ", stall, flush=True)
        scale = np.abs(Flow(rhs, jac, guess, rtol=1e-10, atol=1e-13).at(np.linspace(0, T, 513), x0)).max(0)
        found = {}
        for method, rtol, atol in [("LSODA", 1e-10, 1e-13), ("LSODA", 1e-12, 1e-15), ("LSODA", 3e-13, 1e-16), ("Radau", 1e-9, 1e-12), ("Radau", 1e-11, 1e-14)]:
            mark = time.time()
            flow = Flow(rhs, jac, scale, method, rtol, atol)
            x0, size, J, history = symmetric_orbit(flow, x0, T / 2, jacobian=J, tolerance=1e-12 if method == "LSODA" else 1e-14)
            one = flow.over(0, T, x0)
            out = measure(Ft, f, x0, scale, method, rtol, atol)
            found[method, rtol] = x0, size, out
            print(f"Ft={Ft} f={f} {method} rtol={rtol:g}: residual {size:.2e}, full period {np.max(abs(one - x0) / scale):.2e}, "
                  + " ".join(f"{out[n]:.12e}" for n in ["x1_amplitude_m", "x2_amplitude_m", "x3_amplitude_m", "friction_loss_J"])
                  + f" gap {out['energy_gap']:.1e}  {time.time() - mark:.1f} s", flush=True)
        x0, size, out = found["Radau", 1e-11]
        names = [n for n in out if n.endswith(("_m", "_J"))]

        def difference(other):
            return max(abs(found[other][2][n] / out[n] - 1) for n in names)

        J = half_period_jacobian(Flow(rhs, jac, scale, "Radau", 1e-11, 1e-14), x0, T / 2)
        multipliers = np.sort(abs(np.linalg.eigvals(J)))[::-1]
        print("   half-period multipliers", multipliers)
        # free run from the orbit: does the motion stay?
        flow = Flow(rhs, jac, scale, "LSODA", 1e-11, 1e-14)
        z = flow.at(np.arange(periods + 1) * T, x0)
        drift = np.max(np.abs(z - x0) / scale, axis=1)
        finer = measure(Ft, f, x0, scale, "Radau", 1e-11, 1e-14, 3 * SAMPLES)
        print("   amplitudes with a grid three times finer change by", max(abs(finer[n] / out[n] - 1) for n in names[:3]))
        radau = Flow(rhs, jac, scale, "Radau", 1e-9, 1e-12).at(np.arange(301) * T, x0)
        drift_radau = np.max(np.abs(radau - x0) / scale, axis=1)
        # and does a neighbour come back? 1 % off, the same number of periods
        z2 = flow.at(np.arange(periods + 1) * T, x0 * 1.01)
        off = np.max(np.abs(z2 - x0) / scale, axis=1)
        print(f"   free run {periods} periods: drift max {drift.max():.2e} (Radau, 300 periods: {drift_radau.max():.2e}), at the end {drift[-1]:.2e}; from 1 % off: {off[0]:.2e} -> {off[-1]:.2e}")
        row = {"Ft_N": Ft, "frequency_Hz": f, "alpha_s_per_m": alpha}
        row.update({n: v for n, v in out.items()})
        state = [x0[0], x0[1], x0[0] - x0[2], x0[1] - x0[3], x0[4], x0[5]]
        for n, v in zip(["x1_0_m", "v1_0_m_per_s", "x2_0_m", "v2_0_m_per_s", "x3_0_m", "v3_0_m_per_s"], state):
            row[n] = v
        row["slide_0_m"], row["slide_speed_0_m_per_s"] = x0[2], x0[3]
        row["periodicity_residual"] = size
        row["difference_lsoda_3e-13"] = difference(("LSODA", 3e-13))
        row["difference_lsoda_1e-12"] = difference(("LSODA", 1e-12))
        row["difference_lsoda_1e-10"] = difference(("LSODA", 1e-10))
        row["difference_radau_1e-9"] = difference(("Radau", 1e-9))
        row["largest_half_period_multiplier"] = multipliers[0]
        row["second_half_period_multiplier"] = multipliers[1]
        row["free_run_periods"] = periods
        row["free_run_drift"] = drift.max()
        row["free_run_drift_radau_300"] = drift_radau.max()
        row["disturbed_run_distance_first"] = off[0]
        row["disturbed_run_distance_last"] = off[-1]
        rows.append(row)
        print(f"   {time.time() - start:.0f} s", flush=True)
        with open(Path(__file__).with_name("couple_arctan.csv"), "w", newline="") as file:
            writer = csv.DictWriter(file, row.keys(), lineterminator="\n")
            writer.writeheader()
            writer.writerows([{n: (repr(float(v)) if not isinstance(v, int) else v) for n, v in r.items()} for r in rows])


if __name__ == "__main__":
    main()
