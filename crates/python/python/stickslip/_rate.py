"""Laws written in Python: force and rates as a function of arrays, with exact derivatives by dual arrays."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from . import _core


def rate_law(
    function: Callable | None = None,
    *,
    states: int = 0,
    directions: int = 1,
    derivatives: Callable | None = None,
    scale: float = math.inf,
    state_scale: float = 1.0,
    odd: bool = False,
    passive: bool = False,
    name: str | None = None,
):
    """A law in rate form: ``f, dz = function(u, v, z)``.

    ``u`` (m) and ``v = u'`` (m/s) are arrays of n instants, of shape (n,) for one direction, else (directions, n); ``z`` has shape (states, n), in
    your units. Return the force ``f`` (N, the shape of ``u``) and the rates ``dz`` (states, n), or ``f`` alone without states. Write them with
    operators and NumPy's functions: derivatives are then exact, by dual arrays.

    ``derivatives(u, v, z)`` returns them instead: shape (directions + states, 2 directions + states, n), row by row those of ``f`` and ``dz`` by
    ``u``, ``v`` and ``z``.
    ``scale``: the size of its forces, N, such as a slip limit; ``state_scale``: that of its states. ``odd``: ``f(-u) = -f(u)`` for whole histories;
    ``passive``: two motions under it never gain energy from their difference. Claim neither where you are not sure: they speed up, and wrong
    claims make wrong orbits.

    The law lives in harmonic balance, shooting and transients. Usable as a decorator.

    >>> import numpy as np, stickslip
    >>> stiffness, limit = 1e4, 2.0
    >>> @stickslip.rate_law(states=1, scale=limit, odd=True)
    ... def dahl(u, v, z):
    ...     return limit * z[0], (stiffness / limit * (v - abs(v) * z[0]))[None]
    >>> dahl
    <stickslip.Law dahl>
    """
    if function is None:
        return lambda function: rate_law(
            function,
            states=states,
            directions=directions,
            derivatives=derivatives,
            scale=scale,
            state_scale=state_scale,
            odd=odd,
            passive=passive,
            name=name,
        )
    if not callable(function):
        raise TypeError(f"a law is a function of u, v, z, found {function!r}")
    kernel = _Kernel(function, derivatives, directions, states)
    if odd:
        kernel.must_be_odd(state_scale)
    return _core._rate_law(
        name or str(getattr(function, "__name__", "law")),
        kernel.value,
        kernel.linearise,
        directions=directions,
        states=states,
        state_scale=state_scale,
        scale=scale,
        odd=odd,
        passive=passive,
    )


class _Kernel:
    """A law as Rust calls it: arguments (rows, n), answers (directions + states, n)."""

    def __init__(self, function, derivatives, directions: int, states: int) -> None:
        self._function, self._derivatives = function, derivatives
        self._directions, self._states = directions, states

    def _call(self, u, v, z) -> list:
        """The rows of forces and rates."""
        if self._directions == 1:
            u, v = u[0], v[0]
        force, rates = self._parts(self._function(u, v, z))
        forces = [force] if self._directions == 1 else [force[i] for i in range(self._directions)]
        return forces + [rates[i] for i in range(self._states)]

    def _parts(self, answer) -> tuple:
        """Force and rates of what the function returned."""
        name = getattr(self._function, "__name__", "law")
        pair = answer if isinstance(answer, tuple) else (answer, ())
        if pair[0] is None:
            raise TypeError(f"`{name}` returned None: return the force, or force and rates")
        if len(pair) != 2 or (self._states > 0) != (answer is pair):
            wanted = f"(force, rates) for its {self._states} states" if self._states else "the force alone, as it has states=0"
            raise TypeError(f"`{name}` must return {wanted}, and returned {len(pair) if answer is pair else 1} of them")
        force, rates = pair
        if hasattr(rates, "__len__") and len(rates) != self._states:
            raise ValueError(f"`{name}` returned {len(rates)} rates for its {self._states} states")
        return force, rates

    def must_be_odd(self, state_scale: float) -> None:
        """Tries the claim at some instants: who is not odd there is not odd."""
        n, shape = 13, (self._directions, 13)
        size = np.logspace(-6.0, 0.0, n)
        u, v = size * np.where(np.arange(n) % 2, 1.0, -1.0) + np.zeros(shape), 10.0 * size[::-1] + np.zeros(shape)
        z = state_scale * np.linspace(-0.9, 0.7, n) + np.zeros((self._states, n))
        with np.errstate(all="ignore"):
            there, back = self.value(u, v, z)[0], self.value(-u, -v, -z)[0]
        if not np.allclose(back, -there, rtol=1e-9, atol=1e-12 * np.nanmax(np.abs(there), initial=0.0), equal_nan=True):
            name = getattr(self._function, "__name__", "law")
            raise ValueError(f"`{name}` is not odd: its answer to -u, -v, -z is not the negative one; leave out odd=True")

    def value(self, u, v, z):
        rows = self._call(u, v, z)
        n = u.shape[1]
        return (np.stack([np.broadcast_to(np.asarray(row, float), (n,)) for row in rows]),)

    def linearise(self, u, v, z):
        n, arguments = u.shape[1], 2 * self._directions + self._states
        rows = self._directions + self._states
        if self._derivatives is not None:
            values = self.value(u, v, z)[0]
            inner = (u[0], v[0]) if self._directions == 1 else (u, v)
            slopes = np.asarray(self._derivatives(*inner, z), float)
            return values, np.broadcast_to(slopes, (rows, arguments, n)).reshape(rows * arguments, n)
        seeds = np.eye(arguments)[:, :, None]
        duals = [Dual(value, seed + np.zeros(n)) for value, seed in zip([*u, *v, *z], seeds)]
        d = self._directions
        answers = self._call(DualRows(duals[:d]), DualRows(duals[d : 2 * d]), DualRows(duals[2 * d :]))
        values, slopes = np.empty((rows, n)), np.zeros((rows, arguments, n))
        for row, answer in enumerate(answers):
            if isinstance(answer, Dual):
                values[row], slopes[row] = answer.value, answer.slope
            else:
                values[row] = np.asarray(answer, float)  # it depends on nothing
        return values, slopes.reshape(rows * arguments, n)


class DualRows:
    """Some dual arrays, by their number."""

    def __init__(self, rows: list) -> None:
        self._rows = rows

    def __getitem__(self, index):
        return self._rows[index] if not isinstance(index, tuple) else self._rows[index[0]][index[1:]]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self):
        return iter(self._rows)


#: Derivatives of functions of one argument x, from x and their value y.
_ONE = {
    np.negative: lambda x, y: -1.0,
    np.positive: lambda x, y: 1.0,
    np.absolute: lambda x, y: np.sign(x),
    np.fabs: lambda x, y: np.sign(x),
    np.sign: lambda x, y: 0.0,
    np.square: lambda x, y: 2.0 * x,
    np.sqrt: lambda x, y: 0.5 / y,
    np.cbrt: lambda x, y: 1.0 / (3.0 * y * y),
    np.reciprocal: lambda x, y: -y * y,
    np.exp: lambda x, y: y,
    np.expm1: lambda x, y: y + 1.0,
    np.log: lambda x, y: 1.0 / x,
    np.log1p: lambda x, y: 1.0 / (1.0 + x),
    np.sin: lambda x, y: np.cos(x),
    np.cos: lambda x, y: -np.sin(x),
    np.tan: lambda x, y: 1.0 + y * y,
    np.arcsin: lambda x, y: 1.0 / np.sqrt(1.0 - x * x),
    np.arccos: lambda x, y: -1.0 / np.sqrt(1.0 - x * x),
    np.arctan: lambda x, y: 1.0 / (1.0 + x * x),
    np.sinh: lambda x, y: np.cosh(x),
    np.cosh: lambda x, y: np.sinh(x),
    np.tanh: lambda x, y: 1.0 - y * y,
    np.arcsinh: lambda x, y: 1.0 / np.sqrt(1.0 + x * x),
}


def _power(x, n, y):
    with np.errstate(divide="ignore", invalid="ignore"):
        by_base = np.where(n == 0, 0.0, n * np.power(x, np.where(n == 0, 1.0, n - 1.0)))
        by_exponent = np.where(x > 0, y * np.log(np.where(x > 0, x, 1.0)), 0.0)
    return by_base, by_exponent


#: Derivatives of functions of two arguments by both, from the arguments and their value.
_TWO = {
    np.add: lambda a, b, y: (1.0, 1.0),
    np.subtract: lambda a, b, y: (1.0, -1.0),
    np.multiply: lambda a, b, y: (b, a),
    np.divide: lambda a, b, y: (1.0 / b, -y / b),
    np.power: _power,
    np.float_power: _power,
    np.arctan2: lambda a, b, y: (b / (a * a + b * b), -a / (a * a + b * b)),
    np.hypot: lambda a, b, y: (a / y, b / y),
    np.maximum: lambda a, b, y: (np.where(a >= b, 1.0, 0.0), np.where(a >= b, 0.0, 1.0)),
    np.minimum: lambda a, b, y: (np.where(a <= b, 1.0, 0.0), np.where(a <= b, 0.0, 1.0)),
    np.copysign: lambda a, b, y: (np.sign(a) * np.where(np.signbit(b), -1.0, 1.0), 0.0),
}

#: Functions without a derivative, of which the value is what is asked for.
_PLAIN = {
    np.greater,
    np.greater_equal,
    np.less,
    np.less_equal,
    np.equal,
    np.not_equal,
    np.isfinite,
    np.isnan,
    np.signbit,
}


class Dual(np.lib.mixins.NDArrayOperatorsMixin):
    """Values of shape (n,) with their derivatives by some arguments, (arguments, n)."""

    __array_priority__ = 1000

    def __init__(self, value, slope) -> None:
        self.value, self.slope = value, slope

    @property
    def shape(self):
        return np.shape(self.value)

    def __len__(self) -> int:
        return len(self.value)

    def __getitem__(self, index):
        if index is None or index == (None,) or index == (None, slice(None)):
            return DualRows([self])
        if index is Ellipsis or index == slice(None):
            return self
        raise TypeError("a law acts on all instants alike: it takes none of them out of an array; use numpy.where")

    def __array_ufunc__(self, function, method, *inputs, **options):
        if method != "__call__" or options:
            return NotImplemented
        values = [one.value if isinstance(one, Dual) else np.asarray(one) for one in inputs]
        value = function(*values)
        if function in _PLAIN:
            return value
        if function in _ONE:
            factors = (_ONE[function](*values, value),)
        elif function in _TWO:
            factors = _TWO[function](*values, value)
        else:
            raise TypeError(f"no derivative of numpy.{function.__name__} is known: give the law's `derivatives`")
        slope = sum(factor * one.slope for factor, one in zip(factors, inputs) if isinstance(one, Dual))
        return Dual(value, slope)

    def __array_function__(self, function, types, arguments, options):
        if function is np.where and len(arguments) == 3 and not options:
            condition, *both = arguments
            values = [one.value if isinstance(one, Dual) else one for one in both]
            slopes = [one.slope if isinstance(one, Dual) else 0.0 for one in both]
            return Dual(np.where(condition, *values), np.where(condition, *slopes))
        if function is np.clip and len(arguments) == 3 and not options:
            value, low, high = arguments
            return np.minimum(np.maximum(value, low), high)
        if function in (np.stack, np.array, np.vstack) and len(arguments) == 1 and not options:
            return DualRows(list(arguments[0]))
        if function in (np.zeros_like, np.ones_like):
            return function(self.value)
        raise TypeError(f"no derivative of numpy.{function.__name__} is known: give the law's `derivatives`")
