"""Linear limits and stick/slip borders of the blade couple, by NumPy linear algebra.

Stuck couple (contact mass riding on blade 1), complex amplitudes:
    [k + kt - (M + m1) w^2 + j w b, -kt; -kt, k + kt - M w^2 + j w b] [X1; X3] = [F0; 0],   M = m - m1/2
Force in the contact: F_st = (kt - m1 w^2) X1 - kt X3 (amplitude |F_st|). The couple stays stuck where |F_st(w)| <= Ft.
Free couple (Ft = 0): X1 = F0 / (k - M w^2 + j w b).
Writes stick_borders.csv. Run: python stick_borders.py
"""
import csv
from math import pi
from pathlib import Path

import numpy as np
from scipy.optimize import brentq, minimize_scalar

m, k, b, kt, F0 = 0.182, 105103.0, 0.2, 1.0e4, 10.0


def stuck(f, m1):
    w = 2 * pi * f
    M = m - 0.5 * m1
    K = np.array([[k + kt - (M + m1) * w * w + 1j * w * b, -kt], [-kt, k + kt - M * w * w + 1j * w * b]])
    return np.linalg.solve(K, np.array([F0, 0.0]))


def force(f, m1):
    w = 2 * pi * f
    X1, X3 = stuck(f, m1)
    return abs((kt - m1 * w * w) * X1 - kt * X3)


def extremum(fun, f, sign):
    """Stationary value of fun next to f: where the central difference quotient vanishes (to rounding)."""
    h = 1e-4
    slope = lambda x: sign * (fun(x + h) - fun(x - h))
    x = brentq(slope, f - 2e-3, f + 2e-3, xtol=1e-13)
    return x, fun(x)


def main():
    rows = []
    add = lambda what, m1, Ft, f, value, unit: rows.append([what, m1, Ft, f, value, unit])
    grid = np.linspace(110.0, 135.0, 250001)
    for m1 in (0.00182, 0.00091):
        M = m - 0.5 * m1
        free = lambda f: F0 / abs(k - M * (2 * pi * f) ** 2 + 2j * pi * f * b)
        for what, fun in [("free_peak_x1", free), ("stuck_peak_x1", lambda f: abs(stuck(f, m1)[0])), ("stuck_peak_x3", lambda f: abs(stuck(f, m1)[1]))]:
            values = np.array([fun(f) for f in grid[::20]])
            add(what, m1, "", *extremum(fun, grid[::20][values.argmax()], -1), "m")
        values = np.array([force(f, m1) for f in grid])
        inner = np.flatnonzero((values[1:-1] - values[:-2]) * (values[2:] - values[1:-1]) < 0) + 1
        for i in inner:
            kind = "contact_force_maximum" if values[i] > values[i - 1] else "contact_force_minimum"
            add(kind, m1, "", *extremum(lambda f: force(f, m1), grid[i], -1), "N")
        for Ft in (1.0, 2.0, 4.0, 6.0, 8.0):
            for i in np.flatnonzero((values[:-1] - Ft) * (values[1:] - Ft) < 0):
                f = brentq(lambda f: force(f, m1) - Ft, grid[i], grid[i + 1], xtol=1e-13)
                add("slip_begins_going_up" if values[i] < Ft else "slip_ends_going_up", m1, Ft, f, force(f, m1), "N")
        for f in (120.0, 120.75, 121.0, 121.25, 121.5):
            X1, X3 = stuck(f, m1)
            add("stuck_x1", m1, "", f, abs(X1), "m")
            add("stuck_x3", m1, "", f, abs(X3), "m")
            add("contact_force", m1, "", f, force(f, m1), "N")
            add("free_x1", m1, "", f, free(f), "m")
    with open(Path(__file__).with_name("stick_borders.csv"), "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["quantity", "m1_kg", "Ft_N", "frequency_Hz", "value", "unit"])
        for r in rows:
            writer.writerow([repr(float(x)) if isinstance(x, float) else x for x in r])
            print(*[f"{x:.10g}" if isinstance(x, float) else x for x in r])


if __name__ == "__main__":
    main()
