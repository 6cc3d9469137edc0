"""Laws written in Python: force and rates over arrays, with exact derivatives (`_dual.py`)."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from . import _core
from ._dual import Dual

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._core import Law, _Quantity

    _Array = NDArray[np.float64]

#: Relative step of central differences: the cube root of machine epsilon, where they are most
#: accurate.
DIFFERENCE = 1e-5


@overload
def rate_law(
    function: Callable[..., Any],
    *,
    states: int = ...,
    directions: int = ...,
    parameters: Mapping[str, _Quantity] | None = ...,
    derivatives: Callable[..., Any] | None = ...,
    scale: float | str = ...,
    state_scale: float | str = ...,
    odd: bool = ...,
    passive: bool = ...,
    name: str | None = ...,
) -> Law: ...


@overload
def rate_law(
    function: None = None,
    *,
    states: int = ...,
    directions: int = ...,
    parameters: Mapping[str, _Quantity] | None = ...,
    derivatives: Callable[..., Any] | None = ...,
    scale: float | str = ...,
    state_scale: float | str = ...,
    odd: bool = ...,
    passive: bool = ...,
    name: str | None = ...,
) -> Callable[[Callable[..., Any]], Law]: ...


def rate_law(
    function: Callable[..., Any] | None = None,
    *,
    states: int = 0,
    directions: int = 1,
    parameters: Mapping[str, _Quantity] | None = None,
    derivatives: Callable[..., Any] | None = None,
    scale: float | str = math.inf,
    state_scale: float | str = 1.0,
    odd: bool = False,
    passive: bool = False,
    name: str | None = None,
) -> Law | Callable[[Callable[..., Any]], Law]:
    """Creates a law in rate form: ``f, dz = function(u, v, z)``.

    ``u`` (m) and ``v = u'`` (m/s) are arrays over n points in time. Their shape is (n,) for one
    direction, otherwise (directions, n). ``z`` has the shape (states, n), in your units. The function
    returns the force ``f`` (N, in the shape of ``u``) and the rates ``dz`` (states, n), or ``f`` alone
    without states. A list of rows may replace an array, and a number may replace a row.

    The function must consist of operators and NumPy functions that act equally on all points. Its
    derivatives are then exact, computed with dual arrays.

    - ``parameters``: names and values, numbers in SI units or strings with units. The function
      receives them as keyword arguments. ``Model.set`` and ``vary`` use the names ``JOINT.NAME``.
    - ``derivatives(u, v, z)``: returns the derivatives instead of dual arrays. The shape is
      (directions + states, 2 directions + states, n): rows are ``f`` and ``dz``, columns are ``u``,
      ``v`` and ``z``. :meth:`Law.check_derivatives` compares them with difference quotients.
    - ``scale``: magnitude of the forces in N, such as a slip limit, as a number or the name of a
      parameter.
    - ``state_scale``: magnitude of the states, as a number or the name of a parameter.
    - ``odd``: ``f(-u) = -f(u)`` for whole histories.
    - ``passive``: two motions never gain energy from their difference.

    ``odd`` and ``passive`` speed up the solution, but a wrong value gives wrong orbits. Do not set them
    if you are not sure.

    Harmonic balance, shooting and transients can use the law. The function can be used as a decorator.

    >>> import numpy as np, stickslip
    >>> @stickslip.rate_law(states=1, parameters={"stiffness": "10 N/mm", "limit": "2 N"}, scale="limit", odd=True)
    ... def dahl(u, v, z, stiffness, limit):
    ...     return limit * z[0], stiffness / limit * (v - abs(v) * z)
    >>> dahl
    <stickslip.Law dahl, stiffness=10000, limit=2>
    >>> dahl.check_derivatives() < 1e-6
    True
    """
    if function is None:
        return lambda function: rate_law(
            function,
            states=states,
            directions=directions,
            parameters=parameters,
            derivatives=derivatives,
            scale=scale,
            state_scale=state_scale,
            odd=odd,
            passive=passive,
            name=name,
        )
    if not callable(function):
        raise TypeError(f"a law is a function of u, v, z, found {function!r}")
    kernel = _Kernel(function, derivatives, directions, states, tuple(parameters or ()))
    law = _core._rate_law(
        name or kernel.name,
        kernel,
        directions=directions,
        states=states,
        parameters=dict(parameters or {}),
        state_scale=state_scale,
        scale=scale,
        odd=odd,
        passive=passive,
    )
    if odd:
        kernel.must_be_odd(law)
    return law


def _by_name(module: str, name: str) -> Any:
    """Returns the object with this name in a module, for pickles."""
    found: Any = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return found


class _Kernel:
    """A law as called from Rust.

    It takes arguments (rows, n) and the values of parameters, and returns (directions + states, n).
    """

    def __init__(
        self, function: Callable[..., Any], derivatives: Callable[..., Any] | None, directions: int, states: int, parameters: tuple[str, ...]
    ) -> None:
        self._function, self._derivatives = function, derivatives
        self._directions, self._states, self._parameters = int(directions), int(states), parameters
        self.name = str(getattr(function, "__name__", "law"))

    def pickled(self, law: Law) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        """Returns the pickle of a law: the module that contains it, and its name there."""
        module, name = getattr(self._function, "__module__", None), getattr(self._function, "__qualname__", "")
        try:
            found = _by_name(module or "", name)
        except (ImportError, AttributeError, ValueError):
            found = None
        if isinstance(found, _core.Law) and found._kernel is self:
            return _renewed, (module, name, law.parameters)
        message = (
            f"law `{law.name}` cannot be pickled: decorate its function at module level, "
            "or assign the law to a module-level variable with the name of its function"
        )
        raise _pickling_error(message)

    def _call(self, u: Any, v: Any, z: Any, values: Sequence[float]) -> list[Any]:
        """Returns the rows of forces and rates."""
        if self._directions == 1:
            u, v = u[0], v[0]
        force, rates = self._parts(self._function(u, v, z, **dict(zip(self._parameters, values))))
        return self._rows(force, self._directions, "force") + self._rows(rates, self._states, "rates")

    def _parts(self, answer: Any) -> tuple[Any, Any]:
        """Splits the return value of the function into force and rates."""
        pair = answer if isinstance(answer, tuple) else (answer, ())
        if pair[0] is None:
            raise TypeError(f"`{self.name}` returned None: return the force, or force and rates")
        if len(pair) != 2 or (self._states > 0) != (answer is pair):
            wanted = f"(force, rates) for its {self._states} states" if self._states else "the force alone, as it has states=0"
            raise TypeError(f"`{self.name}` must return {wanted}, but returned {len(pair) if answer is pair else 1} value(s)")
        return pair[0], pair[1]

    def _rows(self, answer: Any, count: int, what: str) -> list[Any]:
        """Splits a return value into rows, each a number or an array over n points."""
        if isinstance(answer, (list, tuple)):
            rows = list(answer)
            if count == 1 and rows and all(np.ndim(row) == 0 for row in rows):
                rows = [np.asarray(rows, float)]
        else:
            array = answer if isinstance(answer, Dual) else np.asarray(answer, float)
            if array.ndim <= 1 and count == 1:
                return [array]
            rows = [array[i] for i in range(len(array))] if array.ndim == 2 else [array]
        if len(rows) != count:
            raise ValueError(f"`{self.name}` returned {len(rows)} {what} for its {count} {'states' if what == 'rates' else 'directions'}")
        return rows

    def must_be_odd(self, law: Law) -> None:
        """Tests the property `odd` at several points."""
        n, shape = 13, (self._directions, 13)
        size = np.logspace(-6.0, 0.0, n)
        u, v = size * np.where(np.arange(n) % 2, 1.0, -1.0) + np.zeros(shape), 10.0 * size[::-1] + np.zeros(shape)
        z = law._state_scale * np.linspace(-0.9, 0.7, n) + np.zeros((self._states, n))
        values = tuple(law.parameters.values())
        with np.errstate(all="ignore"):
            there, back = self.value(u, v, z, values)[0], self.value(-u, -v, -z, values)[0]
        if not np.allclose(back, -there, rtol=1e-9, atol=1e-12 * np.nanmax(np.abs(there), initial=0.0), equal_nan=True):
            raise ValueError(f"`{self.name}` is not odd: its value at -u, -v, -z is not the negative value; remove odd=True")

    def value(self, u: _Array, v: _Array, z: _Array, values: Sequence[float]) -> tuple[_Array]:
        rows = self._call(u, v, z, values)
        out = np.empty((len(rows), u.shape[1]))
        for into, row in zip(out, rows):
            into[...] = row.value if isinstance(row, Dual) else row
        return (out,)

    def linearize(self, u: _Array, v: _Array, z: _Array, values: Sequence[float]) -> tuple[_Array, _Array]:
        n, d = u.shape[1], self._directions
        arguments, rows = 2 * d + self._states, d + self._states
        if self._derivatives is not None:
            inner = (u[0], v[0]) if d == 1 else (u, v)
            given = np.asarray(self._derivatives(*inner, z, **dict(zip(self._parameters, values))), float)
            return self.value(u, v, z, values)[0], np.broadcast_to(given, (rows, arguments, n)).reshape(rows * arguments, n)
        duals = Dual.seeded(np.concatenate([u, v, z]))
        out, slopes = np.empty((rows, n)), np.zeros((rows, arguments, n))
        for row, answer in enumerate(self._call(duals[:d], duals[d : 2 * d], duals[2 * d :], values)):
            if isinstance(answer, Dual):
                out[row], slopes[row] = answer.value, answer.slope
            else:
                out[row] = np.asarray(answer, float)  # a constant
        return out, slopes.reshape(rows * arguments, n)

    def check_derivatives(self, law: Law, u: ArrayLike | None, v: ArrayLike | None, z: ArrayLike | None, tolerance: float) -> float:
        """Returns the largest error of a derivative; see `Law.check_derivatives`."""
        d, m = self._directions, self._states
        sizes = np.repeat([1e-3, 1.0, 0.9 * law._state_scale], [d, d, m])
        instants = self._instants(sizes, u, v, z)
        n = instants.shape[1]
        values = tuple(law.parameters.values())

        def split(arguments: _Array) -> tuple[_Array, _Array, _Array]:
            return arguments[:d], arguments[d : 2 * d], arguments[2 * d :]

        out, slopes = self.linearize(*split(instants), values)
        slopes = slopes.reshape(d + m, 2 * d + m, n)
        worst = (0.0, "")
        for argument in range(2 * d + m):
            step = np.zeros_like(instants)
            step[argument] = DIFFERENCE * (np.max(np.abs(instants[argument])) or sizes[argument])
            width = (instants + step)[argument] - (instants - step)[argument]
            ahead, behind = self.value(*split(instants + step), values)[0], self.value(*split(instants - step), values)[0]
            quotient = (ahead - behind) / width
            # rounding error of a difference quotient
            rounding = 10.0 * np.finfo(float).eps * np.abs(out).max(axis=1, keepdims=True) / width
            size = np.maximum(np.abs(slopes[:, argument]), np.abs(quotient)).max(axis=1, keepdims=True)
            error = np.maximum(np.abs(slopes[:, argument] - quotient) - rounding, 0.0) / np.where(size > 0.0, size, 1.0)
            row, at = np.unravel_index(np.argmax(np.where(np.isnan(error), np.inf, error)), error.shape)
            if not error[row, at] <= worst[0]:
                names = (self._row_name(int(row)), self._argument_name(argument))
                where = f"{names[0]} by {names[1]} is {slopes[row, argument, at]:.6g}, but the difference quotient is {quotient[row, at]:.6g}"
                worst = (float(error[row, at]), f"{where}, at u = {instants[0, at]:.4g} m, v = {instants[d, at]:.4g} m/s")
        if not worst[0] <= tolerance:
            raise ValueError(f"the derivative of `{self.name}` is wrong: {worst[1]}")
        return worst[0]

    def _instants(self, sizes: _Array, *given: ArrayLike | None) -> _Array:
        """Returns arguments (rows, n): the given ones, and random values up to ``sizes`` for the others."""
        n = max([1] + [np.shape(one)[-1] for one in given if one is not None and np.ndim(one)])
        n = n if n > 1 else 64
        random = np.random.default_rng(1)
        instants: _Array = sizes[:, None] * random.uniform(0.1, 1.0, (len(sizes), n)) * random.choice([-1.0, 1.0], (len(sizes), n))
        counts = (self._directions, self._directions, self._states)
        for name, one, count, end in zip("uvz", given, counts, np.cumsum(counts)):
            if one is None:
                continue
            try:
                instants[end - count : end] = np.asarray(one, float)
            except ValueError:
                raise ValueError(f"`{name}` must have the shape ({count}, {n}) or ({n},), found {np.shape(one)}") from None
        return instants

    def _row_name(self, row: int) -> str:
        if row >= self._directions:
            return f"rate {row - self._directions}"
        return "the force" if self._directions == 1 else f"force {row}"

    def _argument_name(self, argument: int) -> str:
        d = self._directions
        if argument >= 2 * d:
            return f"z[{argument - 2 * d}]"
        name = "u" if argument < d else "v"
        return name if d == 1 else f"{name}[{argument % d}]"


def _renewed(module: str, name: str, parameters: dict[str, float]) -> Law:
    """Recreates the law of a pickle with its values."""
    law: Law = _by_name(module, name)
    return law._with(parameters)


def _pickling_error(message: str) -> Exception:
    return importlib.import_module("pickle").PicklingError(message)  # type: ignore[no-any-return]
