"""Conversion of tables to other libraries, which are imported on demand."""

from __future__ import annotations

import importlib
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ._core import Table

#: Number of table rows in a notebook, half from each end.
SHOWN = 10


class Mapped(dict[str, Any]):
    """Class that a table reports to code that tests for a dictionary. It has no instances."""


def to_arrow(table: Table) -> Any:
    return importlib.import_module("pyarrow").table(table)


def to_pandas(table: Table) -> Any:
    return importlib.import_module("pandas").DataFrame({name: table[name] for name in table.columns})


class _Stream:
    """A table that only offers its Arrow stream, because polars copies the columns of mappings."""

    def __init__(self, table: Table) -> None:
        self._table = table

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._table.__arrow_c_stream__(requested_schema)


def to_polars(table: Table) -> Any:
    return importlib.import_module("polars").DataFrame(_Stream(table))


def to_array(table: Table, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
    """Returns an array of the table's shape.

    It contains real numbers, or objects if a column contains other values.
    """
    if copy is False:
        raise ValueError("a table stores its columns separately: an array of it is always a copy")
    columns = [table[name] for name in table.columns]
    if any(column.dtype.kind not in "fiu" for column in columns):
        columns = [column.astype(object) for column in columns]
    whole: NDArray[Any] = np.stack(columns, axis=1) if columns else np.empty(table.shape)
    wanted = dtype or (whole.dtype if whole.dtype.kind == "O" else float)
    return whole.astype(wanted)


def to_html(table: Table) -> str:
    """Returns the first and the last rows for a notebook."""
    rows, _ = table.shape
    half = SHOWN // 2
    shown = list(range(rows)) if rows <= SHOWN else [*range(half), None, *range(rows - half, rows)]
    head = "".join(f"<th>{escape(name)}</th>" for name in table.columns)
    lines = [f"<tr><th></th>{head}</tr>"]
    for index in shown:
        values = ["…"] * len(table.columns) if index is None else [_cell(value) for value in table.row(index).values()]
        cells = "".join(f"<td>{escape(value)}</td>" for value in values)
        lines.append(f"<tr><th>{'…' if index is None else index}</th>{cells}</tr>")
    return f"<div><p><code>{escape(table.name)}</code>, {rows} rows</p><table>{''.join(lines)}</table></div>"


def _cell(value: Any) -> str:
    if value is None or value != value:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
