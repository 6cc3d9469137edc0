"""Tables in other libraries, each of which is imported only when it is asked for."""

from __future__ import annotations


def to_arrow(table):
    import pyarrow

    return pyarrow.table(table)


def to_pandas(table):
    return to_arrow(table).to_pandas()


def to_polars(table):
    import polars

    return polars.DataFrame(table)
