"""The folder of a campaign: its files, its lock, and the completeness of its parts.

- ``campaign.json`` contains the study.
- ``parts/`` contains one Parquet file per batch of units and table.
- ``done/`` contains one record per batch, with the identity of the campaign, and the sizes and
  checksums of its parts. The record is written last; a batch without a record counts as not
  computed.
- ``lock`` is locked by the campaign that writes.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ._errors import StickslipError

#: Version of the folder layout.
FORMAT = 3


class CampaignError(StickslipError):
    """A campaign cannot start or continue."""


class Batch(NamedTuple):
    """Units ``start`` to ``stop`` (exclusive), and their record."""

    start: int
    stop: int
    told: dict[str, Any]

    @property
    def stem(self) -> str:
        """Stem of its file names."""
        return stem(self.start, self.stop)


def stem(start: int, stop: int) -> str:
    """Returns the stem of the file names of a batch. Sorting by name sorts by units."""
    return f"{start:012}-{stop:012}"


def write(path: Path, data: bytes) -> None:
    """Writes a file completely or not at all, even in case of a power failure."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    with open(aside, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(aside, path)


def lock(out: Path) -> Any:
    """Locks the folder for a writing campaign, until ``release()`` or the end of the process."""
    from ._core import _lock

    held = _lock(out / "lock")
    if held is None:
        raise CampaignError(f"another campaign is writing into {out}: wait until it ends, or choose another folder")
    return held


def keep(out: Path, start: int, stop: int, told: Mapping[str, Any], tables: Mapping[str, bytes]) -> None:
    """Stores a batch: its tables, then its record."""
    parts = {}
    for name, data in tables.items():
        folder = out / "parts" / name
        folder.mkdir(exist_ok=True)
        write(folder / f"{stem(start, stop)}.parquet", data)
        parts[name] = {"bytes": len(data), "crc32": zlib.crc32(data)}
    write(out / "done" / f"{stem(start, stop)}.json", json.dumps({**told, "parts": parts}).encode())


def read(out: Path, identity: str, units: int, *, checksums: bool = False) -> tuple[list[Batch], list[Path]]:
    """Returns the complete batches by ascending units, and the invalid files in ``done/``.

    A batch is complete if it belongs to the campaign with this identity and its parts have the
    recorded sizes, and with ``checksums`` the recorded contents. If two batches contain the same
    unit, the first one counts.
    """
    batches: list[Batch] = []
    useless: list[Path] = []
    at = 0
    for file in sorted((out / "done").glob("*.json")):
        batch = _batch(file)
        own = batch is not None and batch.told.get("campaign") == identity
        if batch is None or not own or batch.start < at or batch.stop > units or not _is_whole(out, batch, checksums):
            useless.append(file)
        else:
            batches.append(batch)
            at = batch.stop
    return batches, useless


def clear(out: Path) -> None:
    """Removes temporary files of an interrupted writer."""
    for folder in (out, out / "done", *(out / "parts").iterdir()):
        for file in folder.glob(".*.*"):
            if file.suffix[1:].isdigit():
                file.unlink()


def missing(batches: list[Batch], units: int) -> Iterator[tuple[int, int]]:
    """Returns the ranges of units that are in no batch."""
    at = 0
    for batch in batches:
        if batch.start > at:
            yield at, batch.start
        at = batch.stop
    if at < units:
        yield at, units


def _batch(file: Path) -> Batch | None:
    start, _, stop = file.stem.partition("-")
    if not (start.isdigit() and stop.isdigit() and int(start) < int(stop)):
        return None
    try:
        told = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError):
        return None
    return Batch(int(start), int(stop), told) if isinstance(told, dict) else None


def _is_whole(out: Path, batch: Batch, checksums: bool) -> bool:
    parts = batch.told.get("parts")
    if not isinstance(parts, dict):
        return False
    for name, part in parts.items():
        file = out / "parts" / name / f"{batch.stem}.parquet"
        try:
            if file.stat().st_size != part["bytes"] or (checksums and zlib.crc32(file.read_bytes()) != part["crc32"]):
                return False
        except (OSError, KeyError, TypeError):
            return False
    return True
