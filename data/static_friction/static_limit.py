"""Driven masses on the ground whose friction drops from a static limit Fs to a dynamic one Fc: reference orbits by SciPy integration.

    x_i'' + c x_i' + K x + f_i = F0 cos(w t) if i = 1 else 0,      masses of 1 kg, K = 1 N/m to the ground and kc between neighbours
    x_i' = 0:  |f_i| <= Fs_i,        x_i' != 0:  f_i = Fc_i sgn x_i'

A mass that comes to rest stays while |f_i| <= Fs_i, and then slides with Fc_i. Between switches the equations are smooth and integrated by
DOP853; a switch is a root of its dense output. After SETTLE periods the orbit is that of the next period.
Writes static_limit.csv. Run: python static_limit.py
"""
import csv
from math import cos, pi
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

SETTLE = 300
# (Fc, Fs of every mass), kc, c, F0, w
CASES = {
    "one_slow": ([(0.5, 0.8)], 0.0, 0.05, 1.0, 0.3),
    "one_fast": ([(0.3, 0.6)], 0.0, 0.05, 1.0, 1.4),
    "two": ([(0.4, 0.6), (0.2, 0.35)], 0.7, 0.05, 1.0, 0.55),
}


class Motion:
    def __init__(self, limits, kc, c, F0, w, rtol):
        self.n = len(limits)
        self.limits, self.c, self.F0, self.w, self.rtol = limits, c, F0, w, rtol
        K = np.eye(self.n)
        for i in range(self.n - 1):
            K[i:i + 2, i:i + 2] += kc * np.array([[1, -1], [-1, 1]])
        self.K = K

    def push(self, t, y):
        """What acts on the masses but friction."""
        p = -self.K @ y[:self.n] - self.c * y[self.n:]
        p[0] += self.F0 * cos(self.w * t)
        return p

    def slides(self, t, y):
        """+1, -1, 0 for every mass."""
        p = self.push(t, y)
        out = []
        for i, (_, static) in enumerate(self.limits):
            v = y[self.n + i]
            out.append(int(np.sign(v)) if v != 0.0 else (0 if abs(p[i]) <= static else int(np.sign(p[i]))))
        return out

    def run(self, t, y, end, keep=None):
        s = self.slides(t, y)
        while t < end:
            def rhs(t, y, s=tuple(s)):
                a = self.push(t, y)
                for i, (dynamic, _) in enumerate(self.limits):
                    a[i] = 0.0 if s[i] == 0 else a[i] - s[i] * dynamic
                return np.concatenate([y[self.n:], a])

            events = []
            for i, (_, static) in enumerate(self.limits):
                if s[i] != 0:
                    def event(t, y, i=i, s=s[i]):
                        return s * y[self.n + i]
                else:
                    def event(t, y, i=i, static=static):
                        return static - abs(self.push(t, y)[i])
                event.terminal, event.direction = True, -1
                events.append(event)
            solution = solve_ivp(rhs, (t, end), y, method="DOP853", rtol=self.rtol, atol=1e-14, events=events,
                                 dense_output=True, max_step=0.05 * 2 * pi / self.w)
            if keep is not None:
                keep.append((t, solution.t[-1], solution.sol, list(s)))
            t, y = solution.t[-1], solution.y[:, -1].copy()
            for i in range(self.n):
                if len(solution.t_events[i]):
                    if s[i] != 0:  # it comes to rest, or goes on the other way
                        y[self.n + i] = 0.0
                        p = self.push(t, y)[i]
                        s[i] = 0 if abs(p) <= self.limits[i][1] else int(np.sign(p))
                    else:
                        s[i] = int(np.sign(self.push(t, y)[i]))
        return y


def measure(case, rtol):
    motion = Motion(*CASES[case], rtol)
    T = 2 * pi / motion.w
    y = np.zeros(2 * motion.n)
    for _ in range(SETTLE):
        y = motion.run(0.0, y, T)
    keep = []
    end = motion.run(0.0, y, T, keep)
    out = [("return", 1, float(np.abs(end - y).max()), "m")]
    for i in range(motion.n):
        highest, lowest = -np.inf, np.inf
        for a, b, sol, _ in keep:
            grid = np.linspace(a, b, 400)
            x = sol(grid)[i]
            for sign in (1, -1):
                j = int(np.argmax(sign * x))
                low, high = grid[max(j - 1, 0)], grid[min(j + 1, 399)]
                best = sign * x[j]
                if high > low:
                    found = minimize_scalar(lambda t: -sign * sol(t)[i], bounds=(low, high), method="bounded",
                                            options={"xatol": 1e-10})
                    best = max(best, -found.fun)
                if sign > 0:
                    highest = max(highest, best)
                else:
                    lowest = min(lowest, -best)
        stuck = sum(b - a for a, b, _, s in keep if s[i] == 0)
        loss = 0.0
        for a, b, sol, s in keep:
            loss += s[i] * motion.limits[i][0] * (sol(b)[i] - sol(a)[i])
        before = keep[-1][3][i]
        switches = 0
        for *_, s in keep:
            switches += s[i] != before
            before = s[i]
        out += [("amplitude", i + 1, 0.5 * (highest - lowest), "m"), ("slip_fraction", i + 1, 1 - stuck / T, "1"),
                ("loss", i + 1, loss, "J"), ("switches", i + 1, switches, "1"),
                ("displacement_0", i + 1, float(y[i]), "m"), ("velocity_0", i + 1, float(y[motion.n + i]), "m/s")]
    return out


def main():
    with open(Path(__file__).with_suffix(".csv"), "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["case", "quantity", "mass", "value", "unit", "difference_rtol_1e-9"])
        for case in CASES:
            for fine, coarse in zip(measure(case, 1e-13), measure(case, 1e-9)):
                table.writerow([case, *fine, abs(fine[2] - coarse[2])])


if __name__ == "__main__":
    main()
