"""Dual arrays: arrays with derivatives, which operators and NumPy functions propagate."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

UNKNOWN = "the derivative of numpy.{} is unknown: provide `derivatives` of the law"

#: Derivatives of functions of one argument x, in terms of x and the value y.
_ONE: dict[Any, Callable[..., Any]] = {
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
    np.arccosh: lambda x, y: 1.0 / np.sqrt(x * x - 1.0),
    np.arctanh: lambda x, y: 1.0 / (1.0 - x * x),
    np.exp2: lambda x, y: np.log(2.0) * y,
    np.log2: lambda x, y: 1.0 / (np.log(2.0) * x),
    np.log10: lambda x, y: 1.0 / (np.log(10.0) * x),
    np.deg2rad: lambda x, y: np.pi / 180.0,
    np.rad2deg: lambda x, y: 180.0 / np.pi,
    np.floor: lambda x, y: 0.0,
    np.ceil: lambda x, y: 0.0,
}


def _power(x: Any, n: Any, y: Any) -> Any:
    with np.errstate(divide="ignore", invalid="ignore"):
        by_base = np.where(n == 0, 0.0, n * np.power(x, np.where(n == 0, 1.0, n - 1.0)))
        by_exponent = np.where(x > 0, y * np.log(np.where(x > 0, x, 1.0)), 0.0)
    return by_base, by_exponent


#: Partial derivatives of functions of two arguments, in terms of the arguments and the value.
_TWO: dict[Any, Callable[..., Any]] = {
    np.add: lambda a, b, y: (1.0, 1.0),
    np.subtract: lambda a, b, y: (1.0, -1.0),
    np.multiply: lambda a, b, y: (b, a),
    np.divide: lambda a, b, y: (1.0 / b, -y / b),
    np.power: _power,
    np.float_power: _power,
    np.arctan2: lambda a, b, y: (b / (a * a + b * b), -a / (a * a + b * b)),
    np.hypot: lambda a, b, y: tuple(np.divide(x, y, out=np.zeros_like(y), where=y > 0.0) for x in (a, b)),
    np.maximum: lambda a, b, y: (np.where(a >= b, 1.0, 0.0), np.where(a >= b, 0.0, 1.0)),
    np.minimum: lambda a, b, y: (np.where(a <= b, 1.0, 0.0), np.where(a <= b, 0.0, 1.0)),
    np.fmax: lambda a, b, y: (np.where(a >= b, 1.0, 0.0), np.where(a >= b, 0.0, 1.0)),
    np.fmin: lambda a, b, y: (np.where(a <= b, 1.0, 0.0), np.where(a <= b, 0.0, 1.0)),
    np.heaviside: lambda a, b, y: (0.0, np.where(a == 0.0, 1.0, 0.0)),
    np.remainder: lambda a, b, y: (1.0, -np.floor(a / b)),
    np.copysign: lambda a, b, y: (np.sign(a) * np.where(np.signbit(b), -1.0, 1.0), 0.0),
}

#: Functions without a derivative; their value alone is used.
_PLAIN: set[Any] = {
    np.greater,
    np.greater_equal,
    np.less,
    np.less_equal,
    np.equal,
    np.not_equal,
    np.isfinite,
    np.isnan,
    np.isinf,
    np.signbit,
}


class Dual(np.lib.mixins.NDArrayOperatorsMixin):
    """Values of any shape, with derivatives with respect to arguments: (arguments, *shape)."""

    __array_priority__ = 1000
    # assignments change a dual array
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: Any, slope: Any) -> None:
        self.value: Any = np.asarray(value, float)
        self.slope: Any = np.asarray(slope, float)

    @classmethod
    def seeded(cls, arguments: Any) -> Dual:
        """Returns the arguments (arguments, n) as dual arrays with unit derivatives."""
        count, n = arguments.shape
        return cls(arguments, np.eye(count)[:, :, None] + np.zeros((count, count, n)))

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.value.shape)

    @property
    def ndim(self) -> int:
        return int(self.value.ndim)

    @property
    def size(self) -> int:
        return int(self.value.size)

    @property
    def dtype(self) -> Any:
        return self.value.dtype

    @property
    def T(self) -> Dual:  # noqa: N802 (NumPy's name)
        return self.transpose()

    def __len__(self) -> int:
        return len(self.value)

    def __iter__(self) -> Iterator[Dual]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"Dual({self.value!r})"

    def __getitem__(self, index: Any) -> Dual:
        return Dual(self.value[index], self.slope[_behind(index, self)])

    def __setitem__(self, index: Any, value: Any) -> None:
        self.value[index] = value.value if isinstance(value, Dual) else value
        self.slope[_behind(index, self)] = value.slope if isinstance(value, Dual) else 0.0

    def __bool__(self) -> bool:
        raise TypeError("a law must treat all points alike: use numpy.where instead of if")

    def __float__(self) -> float:
        raise TypeError("the derivative of a law would be lost: use NumPy's functions instead of float() and math")

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise TypeError("the derivative of a law would be lost: combine rows with numpy.stack instead of numpy.array")

    def __pow__(self, exponent: Any) -> Any:
        # a quarter of the time of a cubic law, compared with a general exponent
        if isinstance(exponent, (int, float)) and exponent >= 1:
            return Dual(self.value**exponent, exponent * self.value ** (exponent - 1) * self.slope)
        return super().__pow__(exponent)

    def copy(self) -> Dual:
        return Dual(self.value.copy(), self.slope.copy())

    def sum(self, axis: Any = None, keepdims: bool = False) -> Dual:
        return _sum(self, axis=axis, keepdims=keepdims)

    def mean(self, axis: Any = None, keepdims: bool = False) -> Dual:
        total = _sum(self, axis=axis, keepdims=keepdims)
        return total * (total.value.size / self.value.size)  # type: ignore[no-any-return]

    def reshape(self, *shape: Any) -> Dual:
        wanted = shape[0] if len(shape) == 1 and isinstance(shape[0], (tuple, list)) else shape
        return Dual(self.value.reshape(wanted), self.slope.reshape((len(self.slope), *self.value.reshape(wanted).shape)))

    def transpose(self, *axes: Any) -> Dual:
        order = axes[0] if len(axes) == 1 and isinstance(axes[0], (tuple, list)) else axes or tuple(range(self.ndim))[::-1]
        return Dual(self.value.transpose(order), self.slope.transpose((0, *(1 + axis % self.ndim for axis in order))))

    def clip(self, low: Any = None, high: Any = None) -> Any:
        return _clip(self, low, high)

    def astype(self, dtype: Any, **_: Any) -> Dual:
        if np.dtype(dtype).kind != "f":
            raise TypeError(f"a law's arrays are real, and cannot become {np.dtype(dtype).name}")
        return self.copy()

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **options: Any) -> Any:
        out = options.pop("out", None)
        if method != "__call__" or options:
            if method == "reduce" and function is np.add:
                return _sum(inputs[0], axis=options.get("axis", 0), keepdims=options.get("keepdims", False))
            raise TypeError(UNKNOWN.format(f"{function.__name__}.{method}"))
        answer = _matmul(*inputs) if function is np.matmul else _applied(function, inputs)
        if out is None:
            return answer
        (into,) = out
        if not isinstance(into, Dual):
            raise TypeError("the derivative of a law would be lost in an array of numbers: create the array with numpy.zeros_like of an argument")
        into[...] = answer
        return into

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        known = _FUNCTIONS.get(function)
        if known is None:
            raise TypeError(UNKNOWN.format(function.__name__))
        return known(*arguments, **options)


def _behind(index: Any, dual: Dual) -> Any:
    """Returns the index for derivatives, whose first axis is that of the arguments."""
    if isinstance(index, tuple):
        return (slice(None), *index)
    return (slice(None), index)


def _value(one: Any) -> Any:
    return one.value if isinstance(one, Dual) else np.asarray(one)


def _arguments(parts: Sequence[Any]) -> int:
    return next(len(one.slope) for one in parts if isinstance(one, Dual))


def _slope(one: Any, count: int) -> Any:
    return one.slope if isinstance(one, Dual) else np.zeros((count, *np.shape(one)))


def _lifted(slope: Any, ndim: int) -> Any:
    """Reshapes derivatives for broadcasting to ``ndim`` axes after the axis of arguments."""
    return slope.reshape((len(slope),) + (1,) * (ndim - (slope.ndim - 1)) + slope.shape[1:])


def _applied(function: Any, inputs: Sequence[Any]) -> Any:
    values = [_value(one) for one in inputs]
    value = function(*values)
    if function in _PLAIN:
        return value
    if function in _ONE:
        factors: Any = (_ONE[function](*values, value),)
    elif function in _TWO:
        factors = _TWO[function](*values, value)
    else:
        raise TypeError(UNKNOWN.format(function.__name__))
    ndim = np.ndim(value)
    slope: Any = sum(factor * _lifted(one.slope, ndim) for factor, one in zip(factors, inputs) if isinstance(one, Dual))
    return Dual(value, _spread(slope, np.shape(value)))


def _spread(slope: Any, shape: tuple[int, ...]) -> Any:
    """Broadcasts derivatives to the shape of an array; the result is writable."""
    return slope if slope.shape[1:] == shape else np.broadcast_to(slope, (len(slope), *shape)).copy()


def _matmul(a: Any, b: Any) -> Dual:
    """Returns the matrix product of two arrays, at least one of which is dual."""
    value = np.matmul(_value(a), _value(b))
    slope: Any = 0.0
    if isinstance(a, Dual):
        slope = slope + np.stack([np.matmul(part, _value(b)) for part in a.slope])
    if isinstance(b, Dual):
        slope = slope + np.stack([np.matmul(_value(a), part) for part in b.slope])
    return Dual(value, slope)


def _sum(dual: Any, axis: Any = None, dtype: Any = None, out: Any = None, keepdims: Any = False, **_: Any) -> Dual:
    axes = tuple(range(dual.ndim)) if axis is None else tuple(one % dual.ndim for one in np.atleast_1d(axis))
    keep = bool(keepdims) and keepdims is not np._NoValue
    return Dual(dual.value.sum(axis=axes, keepdims=keep), dual.slope.sum(axis=tuple(1 + one for one in axes), keepdims=keep))


def _joined(join: Callable[..., Any]) -> Callable[..., Dual]:
    """Wraps a function that joins arrays along an axis."""

    def joined(parts: Any, axis: int = 0, **_: Any) -> Dual:
        parts = list(parts)
        count = _arguments(parts)
        values = [_value(part) for part in parts]
        whole = join(values, axis=axis)
        slopes = [join([np.broadcast_to(_slope(part, count)[k], np.shape(v)) for part, v in zip(parts, values)], axis=axis) for k in range(count)]
        return Dual(whole, np.stack(slopes))

    return joined


_concatenate = _joined(np.concatenate)


def _vstack(parts: Any, **_: Any) -> Dual:
    return _concatenate([part[None] if np.ndim(_value(part)) == 1 else part for part in map(_at_least_1d, parts)])


def _at_least_1d(part: Any) -> Any:
    part = part if isinstance(part, Dual) else np.asarray(part, float)
    return part if part.ndim else part.reshape(1)


def _where(condition: Any, *both: Any) -> Any:
    if len(both) != 2:
        raise TypeError(UNKNOWN.format("where without two arrays"))
    condition, count = _value(condition), _arguments(both) if any(isinstance(one, Dual) for one in both) else 0
    value = np.where(condition, _value(both[0]), _value(both[1]))
    if not count:
        return value
    slopes = [_lifted(_slope(one, count), value.ndim) for one in both]
    return Dual(value, _spread(np.where(condition, *slopes), value.shape))


def _clip(value: Any, low: Any = None, high: Any = None, a_min: Any = None, a_max: Any = None, **options: Any) -> Any:
    low = low if low is not None else options.get("min", a_min)
    high = high if high is not None else options.get("max", a_max)
    if low is not None:
        value = np.maximum(value, low)
    return value if high is None else np.minimum(value, high)


def _filled(number: float) -> Callable[..., Dual]:
    def filled(like: Dual, *_: Any, **__: Any) -> Dual:
        return Dual(np.full(like.value.shape, number), np.zeros_like(like.slope))

    return filled


def _full(like: Dual, fill_value: Any, **_: Any) -> Dual:
    out = _filled(0.0)(like)
    out[...] = fill_value
    return out


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    if ord not in (None, 2) or axis is None:
        raise TypeError(UNKNOWN.format("linalg.norm other than the length along an axis"))
    length = np.sqrt(np.sum(_value(x) ** 2, axis=axis, keepdims=True))
    # the norm has no derivative at zero; the value 0 is used there
    share = np.divide(_value(x), length, out=np.zeros_like(_value(x)), where=length > 0.0)
    slope = np.sum(share * x.slope, axis=1 + axis % x.ndim, keepdims=keepdims)
    return Dual(length if keepdims else np.squeeze(length, axis=axis), slope)


def _dot(a: Any, b: Any, **_: Any) -> Any:
    return a * b if not np.ndim(_value(a)) or not np.ndim(_value(b)) else _matmul(a, b)


def _einsum(subscripts: str, *operands: Any, **_: Any) -> Dual:
    count, values = _arguments(operands), [_value(one) for one in operands]
    slopes = []
    for k in range(count):
        terms = [
            np.einsum(subscripts, *values[:at], one.slope[k], *values[at + 1 :]) for at, one in enumerate(operands) if isinstance(one, Dual)
        ]
        slopes.append(sum(terms))
    return Dual(np.einsum(subscripts, *values), np.stack(slopes))


def _shaped(function: Callable[..., Any]) -> Callable[..., Dual]:
    """Wraps a function that rearranges values, and applies it to each derivative."""

    def shaped(dual: Dual, *arguments: Any, **options: Any) -> Dual:
        return Dual(function(dual.value, *arguments, **options), np.stack([function(part, *arguments, **options) for part in dual.slope]))

    return shaped


def _interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None) -> Any:
    if isinstance(xp, Dual) or isinstance(fp, Dual) or period is not None:
        raise TypeError(UNKNOWN.format("interp by its table or with a period"))
    xp, fp = np.asarray(xp, float), np.asarray(fp, float)
    at = np.clip(np.searchsorted(xp, x.value, side="right") - 1, 0, len(xp) - 2)
    rise = np.where((x.value >= xp[0]) & (x.value < xp[-1]), ((fp[1:] - fp[:-1]) / (xp[1:] - xp[:-1]))[at], 0.0)
    return Dual(np.interp(x.value, xp, fp, left, right), rise * x.slope)


def _select(conditions: Any, choices: Any, default: Any = 0.0) -> Any:
    for condition, choice in list(zip(conditions, choices))[::-1]:
        default = _where(condition, choice, default)
    return default


#: Implementations of NumPy functions, other than operators, for dual arrays.
_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _where,
    np.clip: _clip,
    np.select: _select,
    np.sum: _sum,
    np.mean: lambda dual, axis=None, **options: dual.mean(axis=axis, keepdims=options.get("keepdims", False)),
    np.stack: _joined(np.stack),
    np.concatenate: _concatenate,
    np.vstack: _vstack,
    np.zeros_like: _filled(0.0),
    np.empty_like: _filled(0.0),
    np.ones_like: _filled(1.0),
    np.full_like: _full,
    np.dot: _dot,
    np.einsum: _einsum,
    np.linalg.norm: _norm,
    np.interp: _interp,
    np.copy: lambda dual, **_: dual.copy(),
    np.shape: lambda dual: dual.shape,
    np.ndim: lambda dual: dual.ndim,
    np.size: lambda dual, axis=None: np.size(dual.value, axis),
    np.real: lambda dual: dual,
    np.atleast_1d: _at_least_1d,
    np.atleast_2d: lambda dual: dual if dual.ndim > 1 else dual.reshape(1, -1),
    **{
        function: _shaped(function)
        for function in (
            np.reshape,
            np.transpose,
            np.squeeze,
            np.ravel,
            np.expand_dims,
            np.broadcast_to,
            np.flip,
            np.roll,
            np.take,
            np.diff,
            np.cumsum,
        )
    },
}
