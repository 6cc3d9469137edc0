"""Identification: parameters of a model from measured data, for SciPy, emcee and similar packages."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _toml
from ._core import Residuals, Result, Study, _study
from ._errors import ModelError, StudyError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    _Array = NDArray[np.float64]


@dataclass(frozen=True)
class Identification:
    """Fitted parameters with their covariance, in SI units.

    A parameter at an end of its range, or one that the data do not determine, has no variance (NaN);
    see ``status``.
    """

    #: Names of the fitted parameters.
    names: list[str]
    #: Their values.
    x: _Array
    #: Their covariance.
    cov: _Array
    #: Weighted residuals at ``x``.
    fun: _Array
    #: Derivatives of the residuals, one column for each parameter.
    jac: _Array
    #: ``determined``, ``at-bound`` or ``not-determined``, for each parameter.
    status: list[str]
    #: Variance of the weighted residuals.
    variance: float
    #: The residuals at any parameters.
    residuals: Residuals
    #: Tables, figure and notes, as from :meth:`Study.run`.
    result: Result

    def log_likelihood(self, x: ArrayLike) -> Any:
        """Returns the logarithm of the likelihood at ``x``, up to a constant.

        ``x`` may have several rows of parameters. Outside of the ranges of the parameters, and where
        the model has no residuals, it is minus infinity. The residuals are taken as independent and
        normal, with the variance at the minimum.
        """
        x = np.asarray(x, float)
        found = np.array([self._log_likelihood(row) for row in np.atleast_2d(x)])
        return found[0] if x.ndim == 1 else found

    def gradient(self, x: ArrayLike) -> _Array:
        """Returns the gradient of :meth:`log_likelihood` at one ``x``."""
        x = np.asarray(x, float)
        gradient: _Array = -(self.residuals.jacobian(x).T @ self.residuals.values(x)) / self.variance
        return gradient

    def _log_likelihood(self, x: _Array) -> float:
        low, high = self.residuals.bounds
        if len(x) == len(low) and not (np.all(low <= x) and np.all(x <= high)):
            return -np.inf
        try:
            residuals = self.residuals.values(x)
        except ModelError:
            if len(x) != len(low):
                raise
            return -np.inf
        return -0.5 * float(residuals @ residuals) / self.variance


def identify(
    study: Study | Mapping[str, Any] | str | PathLike[str],
    data: Mapping[str, Mapping[str, ArrayLike]] | None = None,
    *,
    threads: int | None = None,
    progress: Any = None,
) -> Identification:
    """Fits the parameters of a study of kind ``identify``.

    - ``study``: a :class:`Study`, a dictionary, or the path of a study file with one case.
    - ``data``: columns instead of files, by the names that ``file`` has in ``[[data]]``. Other files
      are relative to the study file, or to the working folder.
    - ``threads`` and ``progress``: as in :meth:`Study.run`.

    The values, the standard errors and the tables are those of the command.

    >>> import numpy as np, stickslip
    >>> u = 1e-3 * np.sin(np.linspace(0.0, 12.0, 200))
    >>> study = {
    ...     "schema": 1,
    ...     "data": [{"name": "rig", "file": "rig.csv"}],
    ...     "parameters": {"k": "1 N/mm"},
    ...     "mass": [{"name": "m", "mass": "1 kg"}],
    ...     "spring": [{"between": ["m", "ground"], "stiffness": "k"}],
    ...     "joint": [{"name": "pad", "between": ["m", "ground"], "law": {"kind": "cubic", "stiffness": 1.0}}],
    ...     "study": {
    ...         "kind": "identify",
    ...         "fit": {"k": {"from": "0.1 N/mm", "to": "10 N/mm"}},
    ...         "targets": [{"data": "rig", "is": "loop", "at": "pad"}],
    ...     },
    ... }
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(u.size)
    >>> found = stickslip.identify(study, {"rig.csv": {"displacement_m": u, "force_N": 2500.0 * u + noise}})
    >>> bool(abs(found.x[0] - 2500.0) < 4.0 * found.cov[0, 0] ** 0.5)
    True
    >>> bool(abs(found.gradient(found.x)[0]) * found.cov[0, 0] ** 0.5 < 1e-3)
    True
    """
    if data is not None:
        contents = {file: _csv(file, columns) for file, columns in data.items()}
        if isinstance(study, Study):
            _, (name, text, overrides, method, _) = study.__reduce__()
        elif isinstance(study, Mapping):
            name, text, overrides, method = "study", _toml.text(study), [], None
        else:
            name, text, overrides, method = str(study), Path(study).read_text(encoding="utf-8"), [], None
        study = _study(name, text, overrides, method, contents)
    elif not isinstance(study, Study):
        study = Study.from_dict(study) if isinstance(study, Mapping) else Study.from_file(study)
    if study.kind != "identify" or study.cases != 1:
        raise StudyError(f"`identify` needs a study of kind `identify` with one case, found {study!r}")
    residuals = Residuals(study)
    result = study.run(threads=threads, progress=progress)
    if "parameters" not in result.tables:
        raise StudyError(f"no search ended at a minimum: {result.failures or result.notes}")
    table = result["parameters"]
    x = np.array(table["value"], dtype=float)
    error = np.array(table["standard_error"], dtype=float)
    correlations = np.array(result["correlations"]["correlation"], dtype=float).reshape(x.size, x.size)
    fun = residuals.values(x)
    status = [str(word) for word in table["status"]]
    free = max(1, fun.size - sum(word != "at-bound" for word in status))
    return Identification(
        names=residuals.names,
        x=x,
        cov=correlations * np.outer(error, error),
        fun=fun,
        jac=residuals.jacobian(x),
        status=status,
        variance=float(fun @ fun) / free,
        residuals=residuals,
        result=result,
    )


def _csv(file: str, columns: Mapping[str, ArrayLike]) -> bytes:
    """Returns columns as the text of a CSV file."""
    arrays = {title: np.asarray(values) for title, values in columns.items()}
    for title, array in arrays.items():
        if np.iscomplexobj(array):
            raise ValueError(
                f"column `{title}` of `{file}` is complex; give its real and imaginary parts, or its amplitude and "
                "phase, as two columns"
            )
    lengths = {title: array.shape for title, array in arrays.items()}
    if len(set(lengths.values())) > 1 or any(array.ndim != 1 for array in arrays.values()):
        raise ValueError(f"the columns of `{file}` must be one-dimensional and equally long, found {lengths}")
    text = StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(arrays)
    writer.writerows(zip(*(np.asarray(array, float).tolist() for array in arrays.values())))
    return text.getvalue().encode()
