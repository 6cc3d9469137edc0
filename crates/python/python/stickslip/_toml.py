"""Conversion of a dictionary to a study file."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def text(tables: Mapping[str, Any]) -> str:
    """Returns the text of a study file with these tables and keys.

    >>> print(text({"schema": 1, "parameters": {"Ft": "2 N"}, "mass": [{"name": "a", "mass": 0.1}]}), end="")
    schema = 1
    [parameters]
    Ft = "2 N"
    [[mass]]
    name = "a"
    mass = 0.1
    """
    lines, below = [], []
    for key, value in tables.items():
        if isinstance(value, Mapping):
            below += [f"[{_key(key)}]", *_entries(value)]
        elif _is_list(value) and value and all(isinstance(one, Mapping) for one in value):
            for one in value:
                below += [f"[[{_key(key)}]]", *_entries(one)]
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    return "\n".join([*lines, *below, ""])


def _entries(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {_value(value)}" for key, value in table.items()]


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _text(value: str) -> str:
    # a JSON string is a TOML string, except for surrogate pairs and the byte 7f
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_entries(value)) + " }" if value else "{}"
    if hasattr(value, "tolist"):  # NumPy's arrays and numbers
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if _is_list(value):
        return "[" + ", ".join(_value(one) for one in value) + "]"
    raise TypeError(f"a study holds strings, numbers, flags, lists and tables, found {type(value).__name__}")
