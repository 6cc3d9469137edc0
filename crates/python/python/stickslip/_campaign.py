"""Campaigns: the units of a study on many processes or machines, kept part by part, so that nothing is computed twice.

A campaign's folder holds ``campaign.json`` (the study), ``parts/`` (for each batch of units one Parquet file for each table) and ``done/`` (what is
to be said of a batch, written last: a batch without it counts as never computed).
"""

from __future__ import annotations

import io
import json
import os
import pickle
import time
from collections import deque
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from ._errors import StickslipError

if TYPE_CHECKING:
    from ._core import Study

#: The version of the folder's layout.
FORMAT = 1
#: How long a batch should take, s: a task of Dask costs some milliseconds, and what a killed worker loses is one batch.
BATCH_SECONDS = 5.0
#: Batches that wait or run for each thread of the workers: enough that none is idle, few enough to keep the sizes up to date.
AHEAD = 2
#: Largest growth of a batch from one to the next: costs differ along a curve.
GROWTH = 4
#: Times that a batch is tried, the later ones elsewhere where there is an elsewhere.
TRIES = 2


class CampaignError(StickslipError):
    """A campaign that cannot begin or go on."""


def campaign(study, *, out, client=None, processes=None, seconds=BATCH_SECONDS, progress=None, retry=False):
    """Computes all units of ``study`` that ``out`` does not hold yet, and returns the :class:`Campaign`.

    ``client``: a Dask client (``distributed.Client``); workers need this package, not this folder. Without one ``processes`` processes of this
    machine compute (all cores if that is not said); start it then under ``if __name__ == "__main__":`` in a script.
    ``seconds``: how long a batch should take; its size follows the measured cost. ``progress``: ``True`` for a bar by tqdm, or a function of the
    units done and of all.

    A unit that fails is tried once more, elsewhere, and is then kept with its reason: :attr:`Campaign.failed`; ``retry=True`` tries those again. A campaign that was interrupted,
    killed or short of workers goes on when it is called again, and ends with the same numbers, which are those of the command bit for bit.
    """
    from ._core import Study as Known

    if not isinstance(study, Known):
        raise TypeError(f'`study` must be a stickslip.Study, such as Study.from_file("couple.toml") gives, found {study!r}')
    if processes is not None and (not isinstance(processes, int) or processes < 1):
        raise ValueError(f"`processes` must be a whole number from 1, found {processes!r}")
    if not seconds > 0:
        raise ValueError(f"`seconds` that a batch takes must be more than zero, found {seconds!r}")
    if Path(out).exists() and not Path(out).is_dir():
        raise NotADirectoryError(f"`out` must be a folder for the parts of the campaign, and {out} is a file")
    begun = Campaign._begin(study, Path(out))
    if retry and begun.failed:
        begun._forget_failed()
        begun = Campaign(out)
    todo = begun._missing()
    if not todo:
        return begun
    total, done = begun.units, begun.units - sum(stop - start for start, stop in todo)
    report = _progress(progress, study.name)
    workers = _Dask(client, study) if client is not None else _Local(processes, study)
    try:
        _compute(begun, workers, todo, seconds, lambda units: report and report(done + units, total))
    finally:
        workers.close()
        if hasattr(report, "_stickslip_close"):
            report._stickslip_close()
    return Campaign(out)


def _progress(progress, name: str):
    if progress is True:
        from ._progress import bar

        return bar(name)
    return progress or None


class _Batches:
    """The ranges to compute, in batches of a size that follows what units cost."""

    def __init__(self, todo, seconds: float) -> None:
        self._todo, self._seconds = deque(todo), seconds
        self._size = 1
        self._cost: float | None = None

    def measured(self, units: int, seconds: float) -> None:
        """Units of a batch that is done, and what they took."""
        cost = seconds / units
        # the dear ones count: a batch may last long, and may be short
        self._cost = cost if self._cost is None else max(cost, 0.7 * self._cost + 0.3 * cost)
        wanted = int(self._seconds / max(self._cost, 1e-9))
        self._size = max(1, min(wanted, GROWTH * self._size))

    def next(self, threads: int):
        """The next range for one of so many threads; ``None`` if there is no more."""
        if not self._todo:
            return None
        left = sum(stop - start for start, stop in self._todo)
        # towards the end smaller, so that all threads end together
        size = max(1, min(self._size, -(-left // (2 * threads))))
        start, stop = self._todo.popleft()
        if stop - start > size:
            self._todo.appendleft((start + size, stop))
            stop = start + size
        return start, stop


def _compute(campaign: Campaign, workers, todo, seconds: float, tell) -> None:
    batches, units = _Batches(todo, seconds), 0
    running: dict = {}

    def begin(start, stop, tries=0, avoid=None):
        running[workers.submit(start, stop, tries, avoid)] = (start, stop, tries)

    while True:
        while len(running) < AHEAD * workers.threads:
            batch = batches.next(workers.threads)
            if batch is None:
                break
            begin(*batch)
        if not running:
            return
        for future in workers.wait(list(running)):
            if future not in running:
                continue
            start, stop, tries = running.pop(future)
            try:
                answer = workers.answer(future)
            except Exception as error:  # whatever a worker or its death makes of it
                tries, where = tries + 1, getattr(error, "where", None)
                if tries < TRIES:
                    begin(start, stop, tries, where)
                elif stop - start > 1:
                    # one of them is to blame: halves find it, each with the last try
                    middle = (start + stop) // 2
                    begin(start, middle, tries - 1, where)
                    begin(middle, stop, tries - 1, where)
                else:
                    campaign._keep(start, stop, {"tables": {}, "failed": _reason(error), "tries": tries})
                    units += 1
                    tell(units)
                continue
            answer["tries"] = tries + 1
            campaign._keep(start, stop, answer)
            batches.measured(stop - start, answer["seconds"])
            units += stop - start
            tell(units)


def _reason(error: BaseException) -> str:
    if isinstance(error, _Failed):
        return str(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


#: The studies that a worker has checked, by their pickles: checking prepares every case. The last few are kept.
_STUDIES: dict[bytes, Study] = {}
_MOST_STUDIES = 4


def _pickled(study: Study) -> bytes:
    """What a worker needs, and by which it sees that the files which it reads are the same."""
    return pickle.dumps((study, study._matrices))


def _work(pickled: bytes, start: int, stop: int) -> dict:
    """Computes units on a worker: the tables as Parquet, and what is to be said of them."""
    import pyarrow
    import pyarrow.parquet

    study = _STUDIES.get(pickled)
    if study is None:
        while len(_STUDIES) >= _MOST_STUDIES:
            _STUDIES.pop(next(iter(_STUDIES)))
        study, matrices = pickle.loads(pickled)
        if study._matrices != matrices:
            raise CampaignError("the files of [structure] hold other matrices than where the campaign began")
        study._batch(0, 0)  # checks it: no cost of a batch
        _STUDIES[pickled] = study
    begin = time.perf_counter()
    batch = study._batch(start, stop)
    tables = {}
    for table in batch["tables"]:
        data = io.BytesIO()
        pyarrow.parquet.write_table(pyarrow.table(table), data, compression="zstd")
        tables[table.name] = data.getvalue()
    return {"told": batch["told"], "points": batch["points"], "tables": tables, "seconds": time.perf_counter() - begin}


class _Failed(Exception):
    """What went wrong on a worker, and on which."""

    def __init__(self, reason: str, where: str | None) -> None:
        super().__init__(reason)
        self.where = where


def _work_on_dask(pickled: bytes, start: int, stop: int) -> dict:
    """The same, but an error comes back with the worker's address."""
    from distributed import get_worker

    try:
        return _work(pickled, start, stop)
    except Exception as error:
        return {"error": _reason(error), "where": get_worker().address}


#: How long the number of a cluster's threads is taken as known, s; clusters grow and shrink.
KNOWN_SECONDS = 2.0


class _Dask:
    """Workers of a Dask cluster."""

    def __init__(self, client, study) -> None:
        from distributed import as_completed

        self._client, self._name, self._study = client, study.name, _pickled(study)
        self._finished = as_completed([], with_results=False)
        self._running: set = set()
        self._known, self._threads = float("-inf"), 1

    @property
    def threads(self) -> int:
        """Threads of all workers; one while there is none yet."""
        if time.monotonic() > self._known + KNOWN_SECONDS:
            self._known, self._threads = time.monotonic(), max(1, sum(self._client.nthreads().values()))
        return self._threads

    def submit(self, start: int, stop: int, tries: int, avoid):
        others = [worker for worker in self._client.nthreads() if worker != avoid]
        elsewhere = {"workers": others, "allow_other_workers": True} if avoid and others else {}
        # the name is what the dashboard shows
        key = f"stickslip-{self._name}-{start}-{stop}-{tries}-{time.monotonic_ns()}"
        future = self._client.submit(_work_on_dask, self._study, start, stop, key=key, pure=False, retries=0, **elsewhere)
        self._finished.add(future)
        self._running.add(future)
        return future

    def wait(self, _running):
        return [next(self._finished)]

    def answer(self, future):
        self._running.discard(future)
        try:
            answer = future.result()
        except Exception as error:  # the worker itself is gone
            raise _Failed(_reason(error), getattr(getattr(error, "last_worker", None), "address", None)) from error
        future.release()
        if "error" in answer:
            raise _Failed(answer["error"], answer["where"])
        return answer

    def close(self) -> None:
        self._finished.clear()
        self._client.cancel(list(self._running))


class _Local:
    """Processes of this machine."""

    def __init__(self, processes, study) -> None:
        self.threads = processes or os.cpu_count() or 1
        self._study = _pickled(study)
        self._pool: ProcessPoolExecutor | None = None

    def submit(self, start: int, stop: int, tries: int, _avoid):
        import multiprocessing
        from concurrent.futures.process import BrokenProcessPool

        for _ in range(2):
            if self._pool is None:
                # a fork would have the locks of this process, and none of its threads
                self._pool = ProcessPoolExecutor(self.threads, mp_context=multiprocessing.get_context("spawn"))
            try:
                return self._pool.submit(_work, self._study, start, stop)
            except BrokenProcessPool:
                # a process died, and all that ran fails; new ones take over
                self._pool.shutdown(wait=False)
                self._pool = None
        raise CampaignError("processes of this machine cannot be started")

    def wait(self, running):
        from concurrent.futures import FIRST_COMPLETED, wait

        return wait(running, return_when=FIRST_COMPLETED).done

    def answer(self, future):
        return future.result()

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)


def _write(path: Path, data: bytes) -> None:
    """Writes a file that is there whole or not at all, also after a fall of the machine."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    with open(aside, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(aside, path)


class Campaign:
    """The results of a campaign in its folder, whole or as far as it is.

    ``campaign.table("curve")`` reads all parts lazily; :meth:`result` joins them and draws the figure of the study.
    """

    def __init__(self, out) -> None:
        self.folder = Path(out)
        try:
            head = json.loads((self.folder / "campaign.json").read_text("utf-8"))
        except FileNotFoundError:
            raise CampaignError(f"{self.folder} holds no campaign: there is no campaign.json in it") from None
        except ValueError as error:
            raise CampaignError(f"{self.folder / 'campaign.json'} cannot be read: {error}") from None
        if head.get("format") != FORMAT:
            raise CampaignError(f"{self.folder} has the format {head.get('format')}, and this version reads {FORMAT}")
        self._head = head
        self._done = sorted(self._read_done())

    @classmethod
    def _begin(cls, study, out: Path) -> Campaign:
        head = {
            "format": FORMAT,
            "version": study.version,
            "name": study.name,
            "kind": study.kind,
            "units": study.units,
            "study": list(study.__reduce__()[1]),
            "matrices": study._matrices,
        }
        head = json.loads(json.dumps(head))
        if (out / "campaign.json").exists():
            there = cls(out)
            # the file may have moved
            for key, what in (("version", lambda head: head["version"]), ("study", lambda head: head["study"][1:])):
                if what(there._head) != what(head):
                    found = f": version {there._head['version']}, and this is {head['version']}" if key == "version" else ""
                    raise CampaignError(f"{out} holds the campaign of another {key}{found}; choose another folder, or remove that one")
            if there._head.get("matrices") != head["matrices"]:
                raise CampaignError(f"{out} holds a campaign with other matrices: the files of [structure] have changed; choose another folder")
            return there
        for folder in ("parts", "done"):
            (out / folder).mkdir(parents=True, exist_ok=True)
        _write(out / "campaign.json", json.dumps(head, indent=1).encode())
        return cls(out)

    def _read_done(self):
        """Ranges that are kept: start, stop, file."""
        for file in (self.folder / "done").glob("*-*.json"):
            start, _, stop = file.stem.partition("-")
            if start.isdigit() and stop.isdigit():
                yield int(start), int(stop), file

    def _missing(self) -> list[tuple[int, int]]:
        missing, at = [], 0
        for start, stop, _ in [*self._done, (self.units, self.units, None)]:
            if start < at:
                raise CampaignError(f"{self.folder / 'done'} holds unit {start} twice: two campaigns wrote into it")
            if start > at:
                missing.append((at, start))
            at = max(at, stop)
        return missing

    def _keep(self, start: int, stop: int, answer: dict) -> None:
        stem = f"{start:012}-{stop:012}"
        for name, data in answer.pop("tables").items():
            folder = self.folder / "parts" / name
            folder.mkdir(exist_ok=True)
            _write(folder / f"{stem}.parquet", data)
        _write(self.folder / "done" / f"{stem}.json", json.dumps(answer).encode())

    @property
    def name(self) -> str:
        """Name of the study."""
        return self._head["name"]

    @property
    def units(self) -> int:
        """Units of the study."""
        return self._head["units"]

    @property
    def study(self):
        """The study, as it was computed."""
        from ._core import _study

        file, text, overrides, method = self._head["study"]
        return _study(file, text, [tuple(one) for one in overrides], method)

    @property
    def is_complete(self) -> bool:
        """Whether every unit was computed or given up."""
        return not self._missing()

    def _told(self) -> list[tuple[int, int, dict]]:
        return [(start, stop, json.loads(file.read_text("utf-8"))) for start, stop, file in self._done]

    @property
    def failed(self) -> dict[int, str]:
        """Units that were given up, with the reason."""
        return {start: told["failed"] for start, _, told in self._told() if told.get("failed")}

    def _forget_failed(self) -> None:
        for unit in self.failed:
            (self.folder / "done" / f"{unit:012}-{unit + 1:012}.json").unlink()

    @property
    def points(self) -> dict[str, int]:
        """Points by status."""
        points: dict[str, int] = {}
        for _, _, told in self._told():
            for status, count in told.get("points", {}).items():
                points[status] = points.get(status, 0) + count
        return points

    @property
    def seconds(self) -> float:
        """Time that the workers spent on it, s."""
        return sum(told.get("seconds", 0.0) for _, _, told in self._told())

    @property
    def tables(self) -> list[str]:
        """Names of the tables."""
        return sorted(folder.name for folder in (self.folder / "parts").iterdir() if folder.is_dir())

    def files(self, table: str) -> list[Path]:
        """The Parquet files of a table, in the order of the units."""
        folder = self.folder / "parts" / table
        files = [folder / f"{file.stem}.parquet" for _, _, file in self._done]
        found = [file for file in files if file.exists()]
        if not found:
            raise CampaignError(f"there is no table `{table}`, there are {', '.join(self.tables) or 'none yet'}")
        return found

    def table(self, name=None, *, library="polars"):
        """All parts of a table, lazily and in order: a ``polars.LazyFrame``, or with ``library="pyarrow"`` a ``pyarrow.dataset.Dataset``.

        ``name`` is the main table of the study without it.
        """
        files = self.files(name or self._main())
        if library == "polars":
            import polars

            return polars.scan_parquet(files)
        if library == "pyarrow":
            import pyarrow.dataset

            return pyarrow.dataset.dataset([str(file) for file in files], format="parquet")
        raise ValueError(f"library must be polars or pyarrow, found {library!r}")

    def _main(self) -> str:
        return next((name for name in self.study.tables if name in self.tables), "")

    def _column(self, column, table):
        import numpy as np
        import pyarrow.dataset  # noqa: F401

        read = self.table(table, library="pyarrow").to_table(columns=[column])
        return np.asarray(read[column].to_numpy(), float)

    def percentiles(self, column: str, percent=(5, 50, 95), *, by=None, table=None):
        """Percentiles of a column over all points that have a value; with ``by`` at each value of another column.

        Returns an array (percent), or the values of ``by`` (n) and an array (n, percent).
        """
        import numpy as np

        values = self._column(column, table)
        if by is None:
            return np.nanpercentile(values, percent)
        groups, where = np.unique(self._column(by, table), return_inverse=True)
        order = np.argsort(where, kind="stable")
        parts = np.split(values[order], np.cumsum(np.bincount(where))[:-1])
        return groups, np.array([np.nanpercentile(part, percent) for part in parts])

    def exceedance(self, column: str, levels, *, table=None):
        """The share of points whose value is above each of the levels; points without a value count for nothing."""
        from .statistics import exceedance

        return exceedance(self._column(column, table), levels)

    def sensitivity(self, column: str, inputs, *, table=None):
        """First-order Sobol indices of a column by the given columns of inputs, see :func:`stickslip.statistics.first_order`."""
        from .statistics import first_order

        return {one: first_order(self._column(one, table), self._column(column, table)) for one in inputs}

    def plot(self, column: str, *, by, percent=(5, 25, 50, 75, 95), table=None, axes=None):
        """Percentiles of a column over another one as bands, drawn with matplotlib; returns its ``Figure``."""
        import matplotlib.pyplot as plt

        x, bands = self.percentiles(column, percent, by=by, table=table)
        if axes is None:
            _, axes = plt.subplots(layout="constrained")
        half = len(percent) // 2
        for low in range(half):
            high = len(percent) - 1 - low
            label = f"{percent[low]} % to {percent[high]} %"
            axes.fill_between(x, bands[:, low], bands[:, high], alpha=0.25, color="C0", linewidth=0, label=label)
        if len(percent) % 2:
            axes.plot(x, bands[:, half], color="C0", label=f"{percent[half]} %")
        axes.set_xlabel(by)
        axes.set_ylabel(column)
        axes.legend()
        return axes.figure

    def result(self):
        """All parts joined in memory, with the figure of the study: the :class:`Result` that :meth:`Study.run` gives, and the files that the
        command writes.
        """
        from ._core import _joined

        if not self.is_complete or self.failed:
            lacks = "units that failed" if self.is_complete else "units that were not computed yet"
            raise CampaignError(f"{self.folder} has {lacks}: there is no whole result; read its tables instead")
        import pyarrow.dataset  # noqa: F401

        study, told = self.study, self._told()
        tables = []
        for name in study.tables:
            if name in self.tables:
                whole = self.table(name, library="pyarrow").to_table()
                columns = [(column, str(whole.schema.field(column).type), _plain(whole[column])) for column in whole.column_names]
                tables.append((name, columns))
        return _joined(study, tables, [one["told"] for _, _, one in told], self.seconds)

    def __repr__(self) -> str:
        done = sum(stop - start for start, stop, _ in self._done)
        failed = len(self.failed)
        lost = f", {failed} failed" if failed else ""
        return f"<stickslip.Campaign {self.name}: {done} of {self.units} units{lost}, in {self.folder}>"


def _plain(column):
    """A column as Rust takes it: an array of numbers, or a list."""
    kind = str(column.type)
    if kind == "double":
        return column.to_numpy()
    return column.to_pylist()
