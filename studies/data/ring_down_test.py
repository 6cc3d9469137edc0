"""Makes ring_down_test.csv: acceleration of a beam with a lap joint after a blow, with noise of 1 m/s^2."""

import numpy as np
from scipy.integrate import solve_ivp

MASS, SPRING, DAMPING = 2.0, 80e3, 0.8  # kg, N/m, N s/m
STIFFNESS, LIMIT = 20e3, 3.0  # N/m, N
START = 0.2  # m/s

time = np.arange(400) / 500


def slide(state, direction):
    """Time derivative of displacement, velocity and friction force; direction 0 is stick."""
    x, v, f = state
    return [v, -(SPRING * x + DAMPING * v + f) / MASS, 0.0 if direction else STIFFNESS * v]


# from event to event: a sticking joint reaches its limit, a slipping one reverses
state, now, direction = np.array([0.0, START, 0.0]), 0.0, 0
response = np.empty(time.size)
while True:
    event = (lambda t, y: abs(y[2]) - LIMIT) if direction == 0 else (lambda t, y: y[1])
    event.terminal, event.direction = True, 1 if direction == 0 else -direction
    run = solve_ivp(
        lambda t, y: slide(y, direction), (now, time[-1]), state, rtol=1e-10, atol=1e-13, events=event, dense_output=True
    )
    inside = (time >= now) & (time <= run.t[-1])
    if inside.any():
        x, v, f = run.sol(time[inside])
        response[inside] = -(SPRING * x + DAMPING * v + f) / MASS
    if run.status != 1:
        break
    state, now = run.y[:, -1], run.t[-1]
    state[2] = np.clip(state[2], -LIMIT, LIMIT)
    direction = int(np.sign(state[1])) if direction == 0 else 0

response += 1.0 * np.random.default_rng(3).standard_normal(time.size)
rows = np.c_[time, response]
np.savetxt("ring_down_test.csv", rows, fmt=["%.3f", "%.2f"], delimiter=",", header="time_s,acceleration_m_per_s2", comments="")
