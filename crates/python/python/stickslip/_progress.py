"""A progress bar of tqdm, if it is installed."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any


def bar(name: str) -> Callable[[int, int | None], object] | None:
    """Returns a function of the finished and of all points that draws a bar; ``None`` without tqdm."""
    try:
        tqdm = importlib.import_module("tqdm.auto").tqdm
    except ImportError:
        return None
    return _Bar(tqdm(desc=name, unit="point", leave=False))


class _Bar:
    def __init__(self, line: Any) -> None:
        self._line = line

    def __call__(self, done: int, total: int | None) -> None:
        self._line.total = total
        self._line.update(done - self._line.n)

    def _stickslip_close(self) -> None:
        self._line.close()
