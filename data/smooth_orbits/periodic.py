"""Periodic orbits of odd-symmetric driven systems, by SciPy integration only.

The systems here are odd: if x(t) solves x' = f(t, x), so does -x(t + T/2). Their symmetric periodic orbit is the solution of

    R(x0) = P(x0) + x0 = 0,      P = flow over half a period,

found by Newton's method. The derivative of P is taken by central differences of the flow, so nothing but the
integrator of SciPy and the right-hand side enters. R = 0 stays a regular equation where the joint (nearly) sticks:
there the full-period map has a multiplier next to 1, the half-period map too, and R' next to 2.
"""
import numpy as np
from scipy.integrate import odeint, solve_ivp


class Flow:
    """Integrates x' = rhs(t, x) with one method and one pair of tolerances.

    method   "LSODA": scipy.integrate.odeint (ODEPACK's LSODA, quick because it returns only what is asked for);
             "Radau": scipy.integrate.solve_ivp(method="Radau"), the implicit Runge-Kutta method of order 5.
    rtol     relative tolerance
    atol     absolute tolerance as a fraction of `scale`, the typical size of each state
    """

    def __init__(self, rhs, jac, scale, method="LSODA", rtol=1e-12, atol=1e-14):
        self.rhs, self.jac, self.method, self.rtol = rhs, jac, method, rtol
        self.scale = np.array(scale, float)
        self.atol = atol * self.scale

    def at(self, times, x0):
        """States at the increasing `times`, starting from x0 at times[0]: array (len(times), len(x0))."""
        times = np.asarray(times, float)
        if self.method == "LSODA":
            states, info = odeint(self.rhs, x0, times, Dfun=self.jac, tfirst=True, rtol=self.rtol, atol=self.atol,
                                  mxstep=2_000_000, full_output=True, tcrit=[times[-1]])
            if info["message"] != "Integration successful.":
                raise RuntimeError(info["message"])
            self.steps = int(info["nst"][-1])
            return states
        solution = solve_ivp(self.rhs, (times[0], times[-1]), x0, method=self.method, t_eval=times, jac=self.jac,
                             rtol=self.rtol, atol=self.atol)
        if not solution.success:
            raise RuntimeError(solution.message)
        self.steps = len(solution.t)
        return solution.y.T

    def over(self, t0, t1, x0):
        return self.at([t0, t1], x0)[-1]


def half_period_jacobian(flow, x0, half, relative_step=1e-6):
    """dP/dx0 by central differences."""
    n = len(x0)
    columns = np.empty((n, n))
    for i in range(n):
        h = relative_step * flow.scale[i]
        up, down = np.array(x0, float), np.array(x0, float)
        up[i] += h
        down[i] -= h
        columns[:, i] = (flow.over(0.0, half, up) - flow.over(0.0, half, down)) / (up[i] - down[i])
    return columns


def symmetric_orbit(flow, x0, half, jacobian=None, tolerance=1e-12, limit=30, verbose=False, refresh=0.1):
    """Newton on P(x0) + x0 = 0. Returns (x0, relative residual, dP/dx0, residual history).

    The residual is max |R_i| / scale_i. The Jacobian is renewed only when an iteration gains less than `refresh`.
    Ends when the residual is below `tolerance`, or, below 1e-9, no longer falls with a fresh Jacobian.
    """
    x0 = np.array(x0, float)
    eye = np.eye(len(x0))
    s = flow.scale
    residual = flow.over(0.0, half, x0) + x0
    size = np.max(np.abs(residual) / s)
    history = [size]
    fresh = False
    if jacobian is None:
        jacobian, fresh = half_period_jacobian(flow, x0, half), True
    for _ in range(limit):
        if size < tolerance:
            break
        step = np.linalg.solve((jacobian + eye) * s[None, :] / s[:, None], -residual / s) * s
        weight = 1.0
        while True:
            trial = x0 + weight * step
            trial_residual = flow.over(0.0, half, trial) + trial
            trial_size = np.max(np.abs(trial_residual) / s)
            if trial_size < size or weight < 1e-3:
                break
            weight *= 0.5
        if verbose:
            print(f"    residual {size:.3e} -> {trial_size:.3e}  weight {weight:g}", flush=True)
        if trial_size >= size:
            if fresh and size < 1e-9:
                break
            if fresh:
                raise RuntimeError(f"Newton stalls at {size:.3e}")
            jacobian, fresh = half_period_jacobian(flow, x0, half), True
            continue
        gain = trial_size / size
        x0, residual, size, fresh = trial, trial_residual, trial_size, False
        history.append(size)
        if gain > refresh and size > 1e-9:
            jacobian, fresh = half_period_jacobian(flow, x0, half), True
    if size > 1e-8:
        raise RuntimeError(f"Newton ends at {size:.3e}")
    return x0, size, jacobian, history


def refined_maximum(times, x, v, a):
    """Largest value of x on a fine grid, refined between nodes by the quintic that takes x, v, a at both ends.

    Only intervals where v changes sign, or nodes at the ends, can hold it. Returns (max, time)."""
    best, when = -np.inf, None
    for k in range(len(times) - 1):
        if x[k] > best:
            best, when = x[k], times[k]
        if not (v[k] > 0.0 >= v[k + 1]):
            continue
        h = times[k + 1] - times[k]
        # p(s) = sum c_j s^j on 0 <= s <= 1
        c0, c1, c2 = x[k], h * v[k], 0.5 * h * h * a[k]
        r0 = x[k + 1] - c0 - c1 - c2
        r1 = h * v[k + 1] - c1 - 2 * c2
        r2 = h * h * a[k + 1] - 2 * c2
        c3 = 10 * r0 - 4 * r1 + 0.5 * r2
        c4 = -15 * r0 + 7 * r1 - r2
        c5 = 6 * r0 - 3 * r1 + 0.5 * r2
        p = np.polynomial.Polynomial([c0, c1, c2, c3, c4, c5])
        roots = p.deriv().roots()
        roots = roots.real[(abs(roots.imag) < 1e-9) & (roots.real > -1e-9) & (roots.real < 1 + 1e-9)]
        for s in roots:
            if p(s) > best:
                best, when = p(s), times[k] + s * h
    return best, when
