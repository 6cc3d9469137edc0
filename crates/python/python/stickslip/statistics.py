"""Statistics of samples: exceedance and sensitivity. All take arrays, whatever they come from."""

from __future__ import annotations

import numpy as np

#: Most values of an input that are looked at together in `first_order`: fewer make the mean of each group better, more follow the curve better.
MOST_GROUPS = 48


def exceedance(values, levels):
    """The share of the values that are above each of the levels; NaN counts for nothing.

    >>> from stickslip.statistics import exceedance
    >>> exceedance([1.0, 2.0, 3.0, 4.0], [0.0, 2.0, 3.5]).tolist()
    [1.0, 0.5, 0.25]
    """
    values = np.sort(np.asarray(values, float))
    values = values[~np.isnan(values)]
    above = len(values) - np.searchsorted(values, np.asarray(levels, float), side="right")
    return above / max(len(values), 1)


def first_order(values, output, *, groups=None) -> float:
    """First-order Sobol index of an input, from any sample of independent inputs: the variance of ``E[output | input]`` over that of ``output``.

    The sample is cut into groups of neighbouring values of the input, and the scatter of the means that the rest of the inputs leaves in finite
    groups is subtracted. Good to about ``1/sqrt(n)``. Source: Plischke, Borgonovo, Smith (2013).
    """
    values, output = np.asarray(values, float), np.asarray(output, float)
    there = ~(np.isnan(values) | np.isnan(output))
    values, output = values[there], output[there]
    n = len(values)
    groups = groups or int(min(MOST_GROUPS, max(2, np.cbrt(n))))
    if n < 2 * groups or np.ptp(output) == 0.0 or np.ptp(values) == 0.0:
        return 0.0
    order = np.argsort(values, kind="stable")
    parts = np.array_split(output[order], groups)
    mean = output.mean()
    between = sum(len(part) * (part.mean() - mean) ** 2 for part in parts) / n
    within = sum(part.var(ddof=1) for part in parts) / n
    return float(max(0.0, between - within) / output.var())


def sobol(function, bounds, *, count=1024, seed=0):
    """First-order and total Sobol indices of ``function`` over independent uniform inputs.

    ``function`` takes an array (n, inputs) and returns n values: one vectorised call for all points. ``bounds``: pairs of lowest and highest, or
    functions from (0, 1) to values such as ``scipy.stats.norm(2, 0.2).ppf``. Takes ``count (inputs + 2)`` points; ``count`` is a power of two.
    Returns a dictionary with arrays ``first`` and ``total`` (inputs). Needs SciPy. Source: Saltelli et al. (2010), with Jansen's total index.
    """
    from scipy.stats import qmc

    d = len(bounds)
    if count < 2 or count & (count - 1):
        raise ValueError(f"count must be a power of two, found {count}")
    both = qmc.Sobol(2 * d, seed=seed).random(count)
    # the quantile of 0 or 1 may be infinite
    both = np.clip(both, 1e-9, 1 - 1e-9)

    def scaled(points):
        columns = []
        for i, bound in enumerate(bounds):
            columns.append(bound(points[:, i]) if callable(bound) else bound[0] + (bound[1] - bound[0]) * points[:, i])
        return np.column_stack(columns)

    a, b = both[:, :d], both[:, d:]
    mixed = [np.column_stack([b[:, k] if k == i else a[:, k] for k in range(d)]) for i in range(d)]
    values = np.asarray(function(scaled(np.concatenate([a, b, *mixed]))), float).reshape(d + 2, count)
    fa, fb, fm = values[0], values[1], values[2:]
    variance = np.concatenate([fa, fb]).var()
    return {
        "first": (fb * (fm - fa)).mean(axis=1) / variance,
        "total": 0.5 * ((fa - fm) ** 2).mean(axis=1) / variance,
    }
