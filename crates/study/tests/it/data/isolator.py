#!/usr/bin/env python3
"""Writes `isolator.csv`, an earthquake-like record, and `isolator_motion.csv`, the motion under it.

A deck of 1000 kg on springs of 10 kN/m in x and y, with an elastic slider of 200 kN/m and 600 N in
the plane. SciPy's `solve_ivp` integrates from row to row of the record and ends at every change
between stick and slip. In slip, the force f turns with the velocity v: f' = kt (v - (n v) n), with
n = f/|f|.
"""

import os

import numpy as np
from scipy.integrate import solve_ivp

FOLDER = os.path.dirname(os.path.abspath(__file__))
MASS, SPRING, STIFFNESS, LIMIT = 1000.0, 1e4, 2e5, 600.0
STEP, ROWS = 0.02, 401


def record():
    """Noise through a filter of the ground at 1.5 Hz, under an envelope, in m/s^2."""
    rng = np.random.default_rng(7)
    frequency = np.fft.rfftfreq(2048, STEP)
    ratio = frequency / 1.5
    ground = (1 + 1.2j * ratio) / (1 - ratio**2 + 1.2j * ratio)
    time = STEP * np.arange(ROWS)
    envelope = (time / 1.5) ** 2 * np.exp(2 * (1 - time / 1.5))
    columns = [time]
    for size in (1.2, 0.8):
        noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(2048)) * ground * (frequency < 12))[:ROWS]
        columns.append(size * envelope * noise / noise.std())
    return np.round(np.column_stack(columns), 5)


def slope(time, y, ground, slips):
    x, v, f = y[:2], y[2:4], y[4:]
    rate = STIFFNESS * v
    if slips:
        n = f / np.linalg.norm(f)
        rate = STIFFNESS * (v - (n @ v) * n)
    return np.concatenate([v, -ground(time) - (SPRING * x + f) / MASS, rate])


def motion(rows):
    ends = lambda time, y, *_: y[4:] @ y[4:] / LIMIT**2 - 1
    ends.terminal, ends.direction = True, 1
    stops = lambda time, y, *_: y[4:] @ y[2:4]
    stops.terminal, stops.direction = True, -1
    y, slips, switches, kept = np.zeros(6), False, 0, [np.zeros(6)]
    for i in range(len(rows) - 1):
        (begin, *a), (end, *b) = rows[i], rows[i + 1]
        a, b = np.array(a), np.array(b)
        ground = lambda time: a + (b - a) * (time - begin) / (end - begin)
        time = begin
        while time < end:
            part = solve_ivp(slope, (time, end), y, args=(ground, slips), method="DOP853", rtol=1e-11, atol=1e-12, events=stops if slips else ends)
            time, y = part.t[-1], part.y[:, -1]
            if part.status == 1:
                slips, switches = not slips, switches + 1
        kept.append(y)
    return np.array(kept), switches


if __name__ == "__main__":
    rows = record()
    head = "time_s,east_m_per_s2,north_m_per_s2"
    np.savetxt(os.path.join(FOLDER, "isolator.csv"), rows, fmt=["%.2f", "%.5f", "%.5f"], delimiter=",", header=head, comments="")
    found, switches = motion(rows)
    kept = np.column_stack([rows[:, 0], found])[::25]
    head = "time_s,east_m,north_m,east_m_per_s,north_m_per_s,east_N,north_N"
    np.savetxt(os.path.join(FOLDER, "isolator_motion.csv"), kept, fmt=["%.2f"] + 6 * ["%.9g"], delimiter=",", header=head, comments="")
    print(f"{switches} switches, largest displacement {np.linalg.norm(found[:, :2], axis=1).max():.6f} m")
