"""Loop areas of a single friction element moved by u = a cos(w t), without and with a contact mass.

massless, arctan   F' = kt [u' - (1/alpha) tan(pi F/(2 Ft))]; integrated in z, F = Ft (2/pi) atan(sinh z):
                   z' = kt (pi/(2 Ft)) cosh(z) [u' - sinh(z)/alpha]
massive, arctan    m1 x'' + kt (x - u) + Ft (2/pi) atan(alpha x') = 0
massive, Coulomb   m1 x'' + kt (x - u) + Ft sgn(x') = 0, with stops; piecewise closed form, switches by bracketed roots
The area W = integral of F du over a period (F the force in the spring) = friction loss per period.
Writes element_loops.csv. Run: python element_loops.py
"""
import csv
import time
from math import acos, atan, cos, cosh, pi, sin, sinh, sqrt
from pathlib import Path

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from periodic import Flow, half_period_jacobian, symmetric_orbit

Ft, alpha, m1 = 1.0e-3, 25000.0, 0.002
CASES = [(kt, a) for kt in (1.0, 5.0) for a in (1.25e-3, 2.0e-3, 2.75e-3)]
c = Ft * 2 / pi


# ---------------------------------------------------------------- arctan
def massless(kt, a, w):
    g = kt * pi / (2 * Ft)

    def rhs(t, y):
        z = y[0]
        return [g * cosh(z) * (-a * w * sin(w * t) - sinh(z) / alpha)]

    def jac(t, y):
        z = y[0]
        return np.array([[g * (sinh(z) * (-a * w * sin(w * t) - sinh(z) / alpha) - cosh(z) ** 2 / alpha)]])

    def rhs_area(t, y):
        du = -a * w * sin(w * t)
        return rhs(t, y) + [c * atan(sinh(y[0])) * du]

    def jac_area(t, y):
        return np.array([[jac(t, y)[0, 0], 0.0], [c / cosh(y[0]) * (-a * w * sin(w * t)), 0.0]])

    return rhs, jac, rhs_area, jac_area, [1.0]


def massive(kt, a, w):
    def rhs(t, y):
        return [y[1], (kt * (a * cos(w * t) - y[0]) - c * atan(alpha * y[1])) / m1]

    def jac(t, y):
        return np.array([[0, 1], [-kt / m1, -c * alpha / (1 + (alpha * y[1]) ** 2) / m1]])

    def rhs_area(t, y):
        return rhs(t, y) + [c * atan(alpha * y[1]) * y[1]]

    def jac_area(t, y):
        s = alpha * y[1]
        J = np.zeros((3, 3))
        J[:2, :2] = jac(t, y)
        J[2, 1] = c * (atan(s) + s / (1 + s * s))
        return J

    return rhs, jac, rhs_area, jac_area, [a, a * w]


def arctan_area(kind, kt, a, w, method, rtol, atol):
    rhs, jac, rhs_area, jac_area, scale = kind(kt, a, w)
    T = 2 * pi / w
    n = len(scale)
    # first periods from rest, loosely
    x = Flow(rhs, jac, scale, "Radau", 1e-6, 1e-9).over(-5 * T, 0, np.zeros(n)) if n == 2 else \
        Flow(rhs, jac, scale, "Radau", 1e-6, 1e-9).over(-2 * T - T / 4, 0, np.zeros(n))
    flow = Flow(rhs, jac, scale, method, rtol, atol)
    x0, size, J, _ = symmetric_orbit(flow, x, T / 2, tolerance=1e-11 if method == "LSODA" else 1e-13)
    full = Flow(rhs_area, jac_area, scale + [4 * Ft * a], method, rtol, atol)
    end = full.over(0, T, np.append(x0, 0.0))
    return end[-1], size, np.max(np.abs(end[:-1] - x0) / scale), x0, J


# ---------------------------------------------------------------- Coulomb with mass and stops
class Coulomb:
    """Exact motion: in slip x = U cos(wt) - s d + A cos(wn (t - t0)) + B sin(wn (t - t0))."""

    def __init__(self, kt, a, w):
        self.kt, self.a, self.w, self.d = kt, a, w, Ft / kt
        self.wn = sqrt(kt / m1)
        self.U = a / (1 - (w / self.wn) ** 2)

    def advance(self, t, x, v, t_end, log=None):
        """State (x, v) at t_end, friction loss on the way, number of stops and of reversals."""
        a, w, wn, d, U = self.a, self.w, self.wn, self.d, self.U
        loss, stops, reversals = 0.0, 0, 0
        s = 0 if v == 0 else (1 if v > 0 else -1)
        while t < t_end:
            if s == 0:
                # stuck: until |u - x| = d, going outward; else slips at once
                gap = a * cos(w * t) - x
                if abs(gap) > d * (1 + 1e-12):
                    s = 1 if gap > 0 else -1
                    continue
                best, side = np.inf, 0
                for sign in (1, -1):
                    q = (x + sign * d) / a
                    if abs(q) >= 1:
                        continue
                    # u passes x + sign d going outward: u' sign > 0, u' = -a w sin(wt)
                    phase = acos(q) if sign < 0 else -acos(q)
                    when = phase / w
                    period = 2 * pi / w
                    when += np.ceil((t - when) / period - 1e-13) * period
                    if when < best:
                        best, side = when, sign
                if best >= t_end:
                    return x, 0.0, loss, stops, reversals
                t, s = max(best, t), side
                continue
            # slip with sign s from (t, x, v)
            A = x - U * cos(w * t) + s * d
            B = (v + U * w * sin(w * t)) / wn
            t0 = t

            def speed(q, A=A, B=B, s=s, t0=t0):
                return s * (-U * w * sin(w * (t0 + q)) + wn * (B * cos(wn * q) - A * sin(wn * q)))

            def place(q):
                return U * cos(w * (t0 + q)) - s * d + A * cos(wn * q) + B * sin(wn * q)

            span = t_end - t0
            h = 2 * pi / wn / 240
            q, before = 1e-3 * h, None
            last = speed(q)
            if last <= 0:  # leaves with zero speed and rounding noise: look a little later
                q = 1e-2 * h
                last = speed(q)
                if last <= 0:
                    raise RuntimeError("slip does not start in its own direction")
            found = None
            while q < span:
                q2 = min(q + h, span)
                now = speed(q2)
                if now <= 0:
                    found = brentq(speed, q, q2, xtol=1e-16, rtol=1e-15)
                    break
                if before is not None and before[1] > last < now:  # a dip: might touch zero between the samples
                    dip = minimize_scalar(speed, bounds=(before[0], q2), method="bounded", options={"xatol": 1e-14})
                    if dip.fun <= 0:
                        found = brentq(speed, before[0], dip.x, xtol=1e-16, rtol=1e-15)
                        break
                before, q, last = (q, last), q2, now
            end = span if found is None else found
            new = place(end)
            loss += Ft * abs(new - x)
            if found is None:
                return new, s * speed(end), loss, stops, reversals
            if log is not None:
                log.append((t0, t0 + end, x, new))
            t, x, v = t0 + end, new, 0.0
            if abs(a * cos(w * t) - x) <= d:
                stops, s = stops + 1, 0
            else:
                reversals, s = reversals + 1, (1 if a * cos(w * t) > x else -1)
        return x, v, loss, stops, reversals


def coulomb_study(kt, a, w, scan=1001):
    """Periodic motions of the massive Coulomb element, two ways: by running from several starts, and as roots of the half-period
    condition x(t + T/2) = -x(t) over all sticking places at a phase where the motion found sticks."""
    e = Coulomb(kt, a, w)
    T = 2 * pi / w
    runs = []  # (start, loss in the first periods, final loss, period in T, state at the end, final loss in the first half period)
    for t0, x, v, name in [(-T / 4, 0.0, 0.0, "rest, u = 0"), (0.0, 0.0, 0.0, "rest, u = a"), (0.0, 2 * a, 0.0, "x = 2 a"), (0.0, 0.0, 5 * a * w, "v = 5 a w")]:
        first = e.advance(t0, x, v, t0 + T)[2]
        x, v = e.advance(t0, x, v, 0.0)[:2] if t0 < 0 else (x, v)
        seen = []
        for n in range(60):
            before = x
            x, v, loss, stops, reversals = e.advance(0.0, x, v, T)
            seen.append((x, v, loss))
        period = next((p for p in range(1, 30) if abs(seen[-1][0] - seen[-1 - p][0]) < 1e-14 and abs(seen[-1][1] - seen[-1 - p][1]) < 1e-13), 0)
        runs.append((name, first, [q[2] for q in seen[:3]], loss, period, stops, reversals, x, v))
    # is it symmetric?
    xh, vh = e.advance(0.0, x, v, T / 2)[:2]
    asymmetry = max(abs(xh + x) / a, abs(vh + v) / (a * w))
    # phase in the middle of the longest stop
    n = 720
    stuck = [e.advance(0.0, x, v, T * (i + 0.5) / n)[1] == 0.0 for i in range(n)]
    best = max(((i, j) for i in range(n) for j in [next((q for q in range(n) if not stuck[(i + q) % n]), n)] if not stuck[i - 1]), key=lambda q: q[1])
    section = T * ((best[0] + 0.5 * best[1]) % n) / n
    if section > T / 2:
        section -= T / 2
    at = e.advance(0.0, x, v, section)[0]
    u = a * cos(w * section)
    fun = lambda q: e.advance(section, q, 0.0, section + T / 2)[0] + q
    starts = np.linspace(u - e.d, u + e.d, scan)
    ends = [e.advance(section, q, 0.0, section + T / 2)[:2] for q in starts]
    R = np.array([q[0] for q in ends]) + starts
    roots = []
    for i in range(scan - 1):
        if R[i] == 0 or R[i] * R[i + 1] < 0:
            q = starts[i] if R[i] == 0 else brentq(fun, starts[i], starts[i + 1], xtol=1e-18, rtol=1e-15)
            end = e.advance(section, q, 0.0, section + T / 2)
            if end[1] == 0.0 and abs(end[0] + q) < 1e-15:  # else a jump, or not at rest after half a period
                roots.append((q, e.advance(section, q, 0.0, section + T)[2]))
    return runs, asymmetry, section / T, at, roots


def main():
    begin = time.time()
    rows = []
    for kind in (massless, massive):
        for w in (0.5, 1.0, 2 * pi, 10.0) if kind is massless else (1.0, 2 * pi):
            for kt, a in CASES:
                results = {}
                for method, rtol, atol in [("Radau", 1e-11, 1e-14), ("Radau", 1e-9, 1e-12), ("LSODA", 1e-11, 1e-14)]:
                    try:
                        results[method, rtol] = arctan_area(kind, kt, a, w, method, rtol, atol)
                    except RuntimeError as why:
                        print("    failed:", kind.__name__, method, rtol, why)
                W, size, full, x0, J = results["Radau", 1e-11]
                rest = [abs(results[q][0] / W - 1) if q in results else float("nan") for q in [("Radau", 1e-9), ("LSODA", 1e-11)]]
                big = np.max(np.abs(np.linalg.eigvals(J)))
                print(f"{kind.__name__:9s} w={w:.4f} kt={kt} a={a * 1e3} mm  W = {W * 1e6:.10f} uJ  residual {size:.1e}/{full:.1e}  "
                      f"others {rest[0]:.1e} {rest[1]:.1e}  multiplier {big:.2e}", flush=True)
                rows.append([kind.__name__, "arctan", kt, a, w, W, 4 * Ft * (a - Ft / kt), size, *rest, big, "one orbit, period T"])
    print(f"{time.time() - begin:.0f} s", flush=True)
    # the arctan element with mass and growing alpha must tend to the Coulomb one (slowly, not monotonically)
    global alpha
    keep = alpha
    for alpha in (1e9, 1e11):
        line = [arctan_area(massive, kt, a, 1.0, "Radau", 1e-10, 1e-13)[0] for kt, a in CASES]
        print(f"massive arctan alpha = {alpha:g} s/m, w = 1: W =", *[f"{W * 1e6:.7f}" for W in line], "uJ", flush=True)
        rows += [["massive", f"arctan, alpha = {alpha:g} s/m", kt, a, 1.0, W, 4 * Ft * (a - Ft / kt), "", "", "", "", "limit check"] for (kt, a), W in zip(CASES, line)]
    alpha = keep
    w = 1.0
    for kt, a in CASES:
        runs, asymmetry, section, at, roots = coulomb_study(kt, a, w)
        print(f"massive Coulomb kt={kt} a={a * 1e3} mm, asymmetry {asymmetry:.1e}, section at {section:.4f} T")
        for q in runs:
            print(f"    {q[0]:12s} first period {q[1] * 1e6:.4f} uJ, then {[round(p * 1e6, 4) for p in q[2]]}, W = {q[3] * 1e6:.10f} uJ, period {q[4]} T, {q[5]} stops, {q[6]} reversals")
        print(f"    symmetric orbits among {1001} sticking places:", [f"W = {q[1] * 1e6:.10f} uJ, {abs(q[0] - at):.1e} m from the run" for q in roots], flush=True)
        W = roots[0][1] if len(roots) == 1 else runs[0][3]
        spread = max(abs(q[3] / W - 1) for q in runs)
        rows.append(["massive", "coulomb", kt, a, w, W, 4 * Ft * (a - Ft / kt), asymmetry, "", "", "",
                     f"{len(roots)} symmetric orbit; runs from {len(runs)} starts end in it (loss within {spread:.0e}); {runs[0][5]} stops and {runs[0][6]} reversals a period"])
    with open(Path(__file__).with_name("element_loops.csv"), "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["element", "law", "kt_N_per_m", "a_m", "omega_rad_per_s", "W_J", "W_massless_coulomb_J", "periodicity_residual",
                         "difference_radau_1e-9", "difference_lsoda_1e-11", "largest_half_period_multiplier", "remark"])
        for r in rows:
            writer.writerow([repr(float(q)) if isinstance(q, float) else q for q in r])
    print(f"{time.time() - begin:.0f} s")


if __name__ == "__main__":
    main()
