"""The exceptions of the package; their text is what the command prints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class StickslipError(Exception):
    """What all exceptions of the package are."""


class StudyError(StickslipError, ValueError):
    """A study that cannot be read or run: where in its file, what was expected, what to do."""

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        column: int | None = None,
        key: str | None = None,
        reason: str | None = None,
        help: str | None = None,
    ) -> None:
        super().__init__(message)
        #: Name of the file.
        self.file = file
        #: Line and column of the wrong value, from 1; ``None`` for a file that cannot be read.
        self.line = line
        self.column = column
        #: The key that is wrong.
        self.key = key
        #: What is wrong and what was expected, in one line.
        self.reason = reason
        #: What to do.
        self.help = help

    def __reduce__(self) -> tuple[Callable[..., StudyError], tuple[str, dict[str, Any]]]:
        return (_study_error, (str(self), self.__dict__))


def _study_error(message: str, attributes: dict[str, Any]) -> StudyError:
    return StudyError(message, **attributes)


class ModelError(StickslipError, ValueError):
    """A model, a law or a quantity that is refused."""


class MethodError(StickslipError, ValueError):
    """A model that a method cannot take; says which methods can."""


class OrbitError(StickslipError, ArithmeticError):
    """No orbit was found: how far the method got, and what to try."""


class ReportError(StickslipError, OSError):
    """Results that cannot be written."""
