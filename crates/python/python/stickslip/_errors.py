"""The exceptions of the package; their text equals that of the command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class StickslipError(Exception):
    """Base class of all exceptions of the package."""


class StudyError(StickslipError, ValueError):
    """A study cannot be read or run: location in the file, expected value, remedy."""

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
        #: The wrong key.
        self.key = key
        #: The error and the expected value, in one line.
        self.reason = reason
        #: The remedy.
        self.help = help

    def __reduce__(self) -> tuple[Callable[..., StudyError], tuple[str, dict[str, Any]]]:
        return (_study_error, (str(self), self.__dict__))


def _study_error(message: str, attributes: dict[str, Any]) -> StudyError:
    return StudyError(message, **attributes)


class ModelError(StickslipError, ValueError):
    """A model, a law or a quantity is invalid."""


class MethodError(StickslipError, ValueError):
    """A method cannot solve a model; the text names the methods that can."""


class OrbitError(StickslipError, ArithmeticError):
    """No orbit was found: the progress of the method, and suggestions."""


class ReportError(StickslipError, OSError):
    """Results cannot be written."""
