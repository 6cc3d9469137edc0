"""Makes blade_sweeps.csv: settled response of a blade with a damper under four forces, with noise of 1 %."""

import numpy as np

MASS, SPRING, DAMPING = 0.3, 170e3, 3.0  # kg, N/m, N s/m
STIFFNESS, LIMIT = 50e3, 12.0  # N/m, N
STEPS, SETTLE = 800, 150  # steps per period, periods of the transient

rows = []
for force in (3.0, 9.0, 16.0, 22.0):
    frequency = np.linspace(110, 140, 25)
    omega = 2 * np.pi * frequency
    h = 2 * np.pi / omega / STEPS

    def slope(phase, x, v, f):
        slips = (f * v > 0) & (abs(f) >= LIMIT)
        return v, (force * np.cos(phase) - SPRING * x - DAMPING * v - f) / MASS, np.where(slips, 0, STIFFNESS * v)

    state, sums = [np.zeros(frequency.size)] * 3, np.zeros(frequency.size, complex)
    for n in range((SETTLE + 1) * STEPS):
        phase, step = 2 * np.pi * n / STEPS, 2 * np.pi / STEPS
        if n >= SETTLE * STEPS:
            sums += 2 / STEPS * state[0] * np.exp(-1j * phase)
        one = slope(phase, *state)
        two = slope(phase + step / 2, *(s + h / 2 * k for s, k in zip(state, one)))
        three = slope(phase + step / 2, *(s + h / 2 * k for s, k in zip(state, two)))
        four = slope(phase + step, *(s + h * k for s, k in zip(state, three)))
        state = [s + h / 6 * (a + 2 * b + 2 * c + d) for s, a, b, c, d in zip(state, one, two, three, four)]
        state[2] = np.clip(state[2], -LIMIT, LIMIT)
    rows += [(len(rows) // 25 + 1, f, force, 1e6 * abs(s)) for f, s in zip(frequency, sums)]

rows = np.array(rows)
rows[:, 3] *= 1 + 0.01 * np.random.default_rng(8).standard_normal(len(rows))
head = "sweep,frequency_Hz,force_N,amplitude_um"
np.savetxt("blade_sweeps.csv", rows, fmt=["%d", "%.2f", "%.1f", "%.2f"], delimiter=",", header=head, comments="")
