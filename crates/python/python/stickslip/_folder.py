"""The folder of a campaign: what stands in it, its lock, and which of its parts are whole.

``campaign.json`` holds the study, ``parts/`` for each batch of units one Parquet file for each table, ``done/`` what is to be said of a batch with
the sizes and checksums of its parts, written last: a batch without it counts as never computed. ``lock`` is held by the campaign that writes.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ._errors import StickslipError

#: The version of the folder's layout.
FORMAT = 2


class CampaignError(StickslipError):
    """A campaign that cannot begin or go on."""


class Batch(NamedTuple):
    """Units ``start`` to ``stop`` (excluded), and what is to be said of them."""

    start: int
    stop: int
    told: dict[str, Any]

    @property
    def stem(self) -> str:
        """The name of its files."""
        return stem(self.start, self.stop)


def stem(start: int, stop: int) -> str:
    """The name of the files of a batch: sorted by name they are sorted by units."""
    return f"{start:012}-{stop:012}"


def write(path: Path, data: bytes) -> None:
    """Writes a file that is there whole or not at all, also after a power failure."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    with open(aside, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(aside, path)


def lock(out: Path) -> Any:
    """Locks the folder for the campaign that writes into it; ``release()`` frees it, and so does the end of the process."""
    from ._core import _lock

    held = _lock(out / "lock")
    if held is None:
        raise CampaignError(f"another campaign is writing into {out}: wait for its end, or choose another folder")
    return held


def keep(out: Path, start: int, stop: int, told: Mapping[str, Any], tables: Mapping[str, bytes]) -> None:
    """Keeps a batch: its tables, then what is to be said of it."""
    parts = {}
    for name, data in tables.items():
        folder = out / "parts" / name
        folder.mkdir(exist_ok=True)
        write(folder / f"{stem(start, stop)}.parquet", data)
        parts[name] = {"bytes": len(data), "crc32": zlib.crc32(data)}
    write(out / "done" / f"{stem(start, stop)}.json", json.dumps({**told, "parts": parts}).encode())


def read(out: Path, units: int, *, checksums: bool = False) -> tuple[list[Batch], list[Path]]:
    """The batches that are whole, by rising units, and the files in ``done/`` that stand for none.

    A batch is whole where its parts have their sizes, and with ``checksums`` their contents. Of two batches that hold a unit the first counts.
    """
    batches: list[Batch] = []
    useless: list[Path] = []
    at = 0
    for file in sorted((out / "done").glob("*.json")):
        batch = _batch(file)
        if batch is None or batch.start < at or batch.stop > units or not _is_whole(out, batch, checksums):
            useless.append(file)
        else:
            batches.append(batch)
            at = batch.stop
    return batches, useless


def clear(out: Path) -> None:
    """Removes what an interrupted writer left aside."""
    for folder in (out, out / "done", *(out / "parts").iterdir()):
        for file in folder.glob(".*.*"):
            if file.suffix[1:].isdigit():
                file.unlink()


def missing(batches: list[Batch], units: int) -> Iterator[tuple[int, int]]:
    """The ranges of units that no batch holds."""
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
