"""Statistics of samples: exceedance and sensitivity. All functions take arrays from any source."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    #: Range of an input: lowest and highest value, or a function from (0, 1) to values.
    _Bound = Sequence[float] | NDArray[Any] | Callable[[NDArray[np.float64]], ArrayLike]

#: Maximum number of groups in `first_order`: fewer groups have more accurate means, more groups
#: follow the curve better.
MOST_GROUPS = 48


def exceedance(values: ArrayLike, levels: ArrayLike) -> NDArray[np.float64]:
    """Returns the fraction of the values above each level.

    NaN is ignored. Without any value, the fraction is NaN.

    >>> from stickslip.statistics import exceedance
    >>> exceedance([1.0, 2.0, 3.0, 4.0], [0.0, 2.0, 3.5]).tolist()
    [1.0, 0.5, 0.25]
    """
    there = np.sort(np.asarray(values, float), axis=None)
    there = there[~np.isnan(there)]
    at = np.asarray(levels, float)
    above = len(there) - np.searchsorted(there, at, side="right")
    return np.asarray(above / len(there) if len(there) else np.full(at.shape, np.nan))


def first_order(values: ArrayLike, output: ArrayLike, *, groups: int | None = None) -> float:
    """Returns the first-order Sobol index of an input from any sample of independent inputs.

    The index is the variance of ``E[output | input]`` divided by that of ``output``. The function
    divides the sample into groups of adjacent values of the input. It subtracts the scatter of the
    group means due to the other inputs. The error is about ``1/sqrt(n)``. Pairs with NaN are
    ignored; without any pair, the index is NaN.

    Source: Plischke, Borgonovo, Smith (2013).
    """
    x, y = np.ravel(np.asarray(values, float)), np.ravel(np.asarray(output, float))
    there = ~(np.isnan(x) | np.isnan(y))
    x, y = x[there], y[there]
    n = len(x)
    if n == 0:
        return float("nan")
    groups = groups or int(min(MOST_GROUPS, max(2, np.cbrt(n))))
    if n < 2 * groups or np.ptp(y) == 0.0 or np.ptp(x) == 0.0:
        return 0.0
    order = np.argsort(x, kind="stable")
    parts = np.array_split(y[order], groups)
    mean = y.mean()
    between = sum(len(part) * (part.mean() - mean) ** 2 for part in parts) / n
    within = sum(part.var(ddof=1) for part in parts) / n
    return float(max(0.0, between - within) / y.var())


def sobol(
    function: Callable[[NDArray[np.float64]], ArrayLike], bounds: Sequence[_Bound], *, count: int = 1024, seed: int = 0
) -> dict[str, NDArray[np.float64]]:
    """Returns first-order and total Sobol indices of ``function`` over independent uniform inputs.

    - ``function`` takes an array (n, inputs) and returns n values; one call computes all points.
    - ``bounds`` are pairs of lowest and highest value, or functions from (0, 1) to values such as
      ``scipy.stats.norm(2, 0.2).ppf``.
    - ``count`` is a power of two. The function evaluates ``count (inputs + 2)`` points.

    The result is a dictionary with arrays ``first`` and ``total`` (inputs). Points with a non-finite
    value are ignored, and a warning states their number. The function requires SciPy.

    Source: Saltelli et al. (2010), for values relative to their mean, with Jansen's total index.

    >>> from stickslip.statistics import sobol
    >>> indices = sobol(lambda p: 121.0 + p[:, 0] + 2 * p[:, 1], [(0, 1), (0, 1)])
    >>> indices["first"].round(2).tolist()
    [0.2, 0.8]
    """
    qmc = importlib.import_module("scipy.stats").qmc
    d = len(bounds)
    if d == 0:
        raise ValueError("`bounds` must contain at least one input")
    if count < 2 or count & (count - 1):
        raise ValueError(f"count must be a power of two, found {count}")
    both = qmc.Sobol(2 * d, seed=seed).random(count)
    # the quantiles of 0 and 1 may be infinite
    both = np.clip(both, 1e-9, 1 - 1e-9)

    def scaled(points: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = []
        for i, bound in enumerate(bounds):
            columns.append(bound(points[:, i]) if callable(bound) else bound[0] + (bound[1] - bound[0]) * points[:, i])
        return np.column_stack(columns)

    a, b = both[:, :d], both[:, d:]
    mixed = [np.column_stack([b[:, k] if k == i else a[:, k] for k in range(d)]) for i in range(d)]
    answer = np.asarray(function(scaled(np.concatenate([a, b, *mixed]))), float)
    if answer.size != (d + 2) * count:
        raise ValueError(f"`function` must return {(d + 2) * count} values, one for each row of its argument, but returned {answer.size}")
    values = answer.reshape(d + 2, count)
    whole = np.isfinite(values)
    if not whole.all():
        lost = values.size - np.count_nonzero(whole)
        message = f"{lost} of {values.size} values of the function are not finite: the indices are computed without these points"
        warnings.warn(message, stacklevel=2)
    pairs = [_indices(values[0][keep], values[1][keep], values[2 + i][keep]) for i in range(d) for keep in [whole[[0, 1, 2 + i]].all(axis=0)]]
    first, total = np.array(pairs).T
    return {"first": first, "total": total}


def _indices(fa: NDArray[np.float64], fb: NDArray[np.float64], mixed: NDArray[np.float64]) -> tuple[float, float]:
    """Returns the first-order and the total index of an input.

    ``mixed`` has this input from the second sample and the other inputs from the first.
    """
    if not len(fa):
        return float("nan"), float("nan")
    # values relative to their mean: a large mean would amplify the sampling error
    mean = np.concatenate([fa, fb]).mean()
    fa, fb, mixed = fa - mean, fb - mean, mixed - mean
    variance = np.concatenate([fa, fb]).var()
    if variance == 0.0:
        return 0.0, 0.0
    return float((fb * (mixed - fa)).mean() / variance), float(0.5 * ((fa - mixed) ** 2).mean() / variance)
