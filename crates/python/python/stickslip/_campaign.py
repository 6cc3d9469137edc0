"""Campaigns: computation of a study on many processes or machines, stored batch by batch.

No unit is computed twice. `_folder.py` describes the folder of a campaign.
"""

from __future__ import annotations

import hashlib
import importlib
import io
import itertools
import json
import multiprocessing
import operator
import os
import pickle
import signal
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, SupportsIndex, overload

import numpy as np

from . import _folder
from ._folder import FORMAT, CampaignError
from ._progress import bar

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._core import Result, Study

    _Progress = bool | Callable[[int, int], object] | None
    _Percent = float | Sequence[float] | NDArray[np.float64]

#: Target duration of a batch in s: a Dask task costs a few milliseconds, and a killed worker
#: loses one batch.
BATCH_SECONDS = 5.0
#: Number of waiting or running batches per worker thread: no thread is idle, and batch sizes
#: stay up to date.
AHEAD = 2
#: Maximum growth factor from one batch to the next, because costs differ along a curve.
GROWTH = 4
#: Maximum number of attempts per batch; later attempts use another worker if there is one.
TRIES = 2
#: Name of the worker processes.
WORKER = "stickslip-campaign"
#: Error message for a script without the `__main__` guard.
GUARD = (
    'a script must start a campaign under `if __name__ == "__main__":`, because every worker process imports the script; '
    "a script from standard input cannot start a campaign"
)


def campaign(
    study: Study,
    *,
    out: str | os.PathLike[str],
    client: Any = None,
    processes: SupportsIndex | None = None,
    seconds: float = BATCH_SECONDS,
    progress: _Progress = None,
    retry: bool = True,
) -> Campaign:
    """Computes the units of ``study`` that are missing in ``out``. Returns the :class:`Campaign`.

    - ``client``: a Dask client (``distributed.Client``). Its workers need this package, but not this
      folder.
    - ``processes``: number of processes on this machine if there is no client; by default all cores.
      A script must then start the campaign under ``if __name__ == "__main__":``.
    - ``seconds``: target duration of a batch. The batch size follows the measured cost.
    - ``progress``: ``True`` for a bar of tqdm, or a function of the number of finished units and of
      all units.
    - ``retry``: ``False`` does not repeat units that failed in an earlier call.

    A failed unit is repeated once, on another worker if possible. If it fails again, it is stored with
    the reason: :attr:`Campaign.failed`.

    After an interruption, a kill or a loss of workers, the next call resumes the campaign. The results
    are the same, bit for bit equal to those of the command. Missing or damaged parts are computed
    again, with a warning. Only one campaign at a time can write into a folder; a second one is refused.
    """
    from ._core import Study as Known

    _must_not_be_a_worker()
    if not isinstance(study, Known):
        raise TypeError(f'`study` must be a stickslip.Study, such as Study.from_file("couple.toml") gives, found {study!r}')
    if processes is not None and _count(processes) < 1:
        raise ValueError(f"`processes` must be a whole number from 1, found {processes!r}")
    if isinstance(seconds, str) or not seconds > 0:
        raise ValueError(f"`seconds`, the duration of a batch, must be more than zero, found {seconds!r}")
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(f"`out` must be a folder for the parts of the campaign, and {out} is a file")
    folder.mkdir(parents=True, exist_ok=True)
    held = _folder.lock(folder)
    try:
        begun = Campaign._begin(study, folder, retry=bool(retry))
        if not begun.is_complete:
            workers = _Dask(client, study) if client is not None else _Local(processes, study)
            _run(begun, workers, float(seconds), progress)
        finished = Campaign(folder)
    finally:
        held.release()
    if finished.failed:
        unit, reason = next(iter(finished.failed.items()))
        warnings.warn(f"{len(finished.failed)} of {finished.units} units failed, the first is unit {unit}: {reason}", stacklevel=2)
    return finished


def _count(value: SupportsIndex) -> int:
    """Returns a whole number, or 0 for other values."""
    try:
        return operator.index(value)
    except TypeError:
        return 0


def _must_not_be_a_worker() -> None:
    """Refuses a campaign in a worker process that imports the script of its parent."""
    process = multiprocessing.current_process()
    if getattr(process, "_inheriting", False):
        if process.name == WORKER:
            raise SystemExit(1)  # the parent process reports the reason
        raise CampaignError(GUARD)


def _run(begun: Campaign, workers: _Workers, seconds: float, progress: _Progress) -> None:
    todo = begun._missing()
    total, done = begun.units, begun.units - sum(stop - start for start, stop in todo)
    report = _progress(progress, begun.name)
    whole = False
    try:
        _compute(begun, workers, todo, seconds, lambda units: report and report(done + units, total))
        whole = True
    finally:
        workers.close(at_once=not whole)
        if report is not None and hasattr(report, "_stickslip_close"):
            report._stickslip_close()


def _progress(progress: _Progress, name: str) -> Callable[[int, int], object] | None:
    if callable(progress):
        return progress
    if progress:
        return bar(name)
    return None


class _Batches:
    """The ranges of units to compute, in batches whose size follows the measured cost."""

    def __init__(self, todo: Iterable[tuple[int, int]], seconds: float) -> None:
        self._todo, self._seconds = deque(todo), seconds
        self._size = 1
        self._cost: float | None = None

    def measured(self, units: int, seconds: float) -> None:
        """Records the number of units and the duration of a finished batch."""
        cost = seconds / units
        # expensive units dominate the estimate: a long batch is acceptable, and so is a short one
        self._cost = cost if self._cost is None else max(cost, 0.7 * self._cost + 0.3 * cost)
        wanted = int(self._seconds / max(self._cost, 1e-9))
        self._size = max(1, min(wanted, GROWTH * self._size))

    def next(self, threads: int) -> tuple[int, int] | None:
        """Returns the next range for one of ``threads`` threads; ``None`` after the last."""
        if not self._todo:
            return None
        left = sum(stop - start for start, stop in self._todo)
        # smaller batches towards the end let all threads finish together
        size = max(1, min(self._size, -(-left // (2 * threads))))
        start, stop = self._todo.popleft()
        if stop - start > size:
            self._todo.appendleft((start + size, stop))
            stop = start + size
        return start, stop


class _Workers(Protocol):
    """Interface of workers that compute batches."""

    @property
    def threads(self) -> int:
        """Number of batches computed in parallel."""

    def submit(self, start: int, stop: int, tries: int, avoid: str | None) -> Any:
        """Starts a batch, if possible not on worker ``avoid``, and returns its future."""

    def wait(self, running: list[Any]) -> Iterable[Any]:
        """Waits, and returns one or more finished futures."""

    def answer(self, future: Any) -> dict[str, Any]:
        """Returns the result of a batch, or raises its exception."""

    def close(self, at_once: bool) -> None:
        """Shuts down, either at once or after the running batches."""


def _compute(
    campaign: Campaign, workers: _Workers, todo: Iterable[tuple[int, int]], seconds: float, tell: Callable[[int], object]
) -> None:
    batches, units = _Batches(todo, seconds), 0
    running: dict[Any, tuple[int, int, int]] = {}

    def begin(start: int, stop: int, tries: int = 0, avoid: str | None = None) -> None:
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
            except CampaignError:
                raise
            except Exception as error:  # any error of a worker, including its death
                tries, where = tries + 1, getattr(error, "where", None)
                if tries < TRIES:
                    begin(start, stop, tries, where)
                elif stop - start > 1:
                    # one unit causes the failure: bisection finds it, with one attempt per half
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


#: Recently checked studies of a worker by their pickles, because a check prepares every case.
_STUDIES: dict[bytes, Study] = {}
_MOST_STUDIES = 4


def _pickled(study: Study) -> bytes:
    """Pickled study for a worker, with a checksum of the files that it reads."""
    return pickle.dumps((study, study._files))


def _unpickled(pickled: bytes) -> Study:
    """Returns the checked study on a worker."""
    study, files = pickle.loads(pickled)
    if study._files != files:
        raise CampaignError("the files of [structure] or [[data]] contain other matrices or data than at the start of the campaign")
    return study  # type: ignore[no-any-return]


def _work(pickled: bytes, start: int, stop: int) -> dict[str, Any]:
    """Computes units on a worker. Returns the tables as Parquet, and the record of the batch."""
    pyarrow, parquet = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    study = _STUDIES.get(pickled)
    if study is None:
        while len(_STUDIES) >= _MOST_STUDIES:
            _STUDIES.pop(next(iter(_STUDIES)))
        study = _unpickled(pickled)
        study._batch(0, 0)  # checks the study, so that the check does not count as batch time
        _STUDIES[pickled] = study
    begin = time.perf_counter()
    batch = study._batch(start, stop)
    tables = {}
    for table in batch["tables"]:
        data = io.BytesIO()
        parquet.write_table(pyarrow.table(table), data, compression="zstd")
        tables[table.name] = data.getvalue()
    return {"told": batch["told"], "points": batch["points"], "tables": tables, "seconds": time.perf_counter() - begin}


class _Failed(Exception):
    """An error on a worker, with the address of the worker."""

    def __init__(self, reason: str, where: str | None) -> None:
        super().__init__(reason)
        self.where = where


def _work_on_dask(pickled: bytes, start: int, stop: int) -> dict[str, Any]:
    """Computes units on a Dask worker; an error is returned with the worker's address."""
    try:
        return _work(pickled, start, stop)
    except Exception as error:
        return {"error": _reason(error), "where": importlib.import_module("distributed").get_worker().address}


#: Validity of the number of a cluster's threads in s, because clusters grow and shrink.
KNOWN_SECONDS = 2.0


class _Dask:
    """Workers of a Dask cluster."""

    def __init__(self, client: Any, study: Study) -> None:
        self._client, self._name, self._study = client, study.name, _pickled(study)
        self._finished = importlib.import_module("distributed").as_completed([], with_results=False)
        self._running: set[Any] = set()
        self._known, self._threads = float("-inf"), 1

    @property
    def threads(self) -> int:
        """Number of threads of all workers, at least one."""
        if time.monotonic() > self._known + KNOWN_SECONDS:
            self._known, self._threads = time.monotonic(), max(1, sum(self._client.nthreads().values()))
        return self._threads

    def submit(self, start: int, stop: int, tries: int, avoid: str | None) -> Any:
        others = [worker for worker in self._client.nthreads() if worker != avoid]
        elsewhere = {"workers": others, "allow_other_workers": True} if avoid and others else {}
        # the dashboard shows the name
        key = f"stickslip-{self._name}-{start}-{stop}-{tries}-{time.monotonic_ns()}"
        future = self._client.submit(_work_on_dask, self._study, start, stop, key=key, pure=False, retries=0, **elsewhere)
        self._finished.add(future)
        self._running.add(future)
        return future

    def wait(self, running: list[Any]) -> Iterable[Any]:
        return [next(self._finished)]

    def answer(self, future: Any) -> dict[str, Any]:
        self._running.discard(future)
        try:
            answer = future.result()
        except Exception as error:  # the worker died
            raise _Failed(_reason(error), getattr(getattr(error, "last_worker", None), "address", None)) from error
        future.release()
        if "error" in answer:
            raise _Failed(answer["error"], answer["where"])
        return answer  # type: ignore[no-any-return]

    def close(self, at_once: bool) -> None:
        self._finished.clear()
        self._client.cancel(list(self._running))


class _Worker(SpawnProcess):
    """A worker process. Its name identifies it while it imports the script of its parent."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **{**options, "name": WORKER})


class _Spawn(SpawnContext):
    """Starts new processes: a fork would inherit the locks of this process, but not its threads."""

    Process = _Worker


def _leave_ctrl_c_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _ready(pickled: bytes) -> None:
    """Checks that a process can compute batches of this study."""
    importlib.import_module("pyarrow.parquet")
    _unpickled(pickled)


class _Local:
    """Worker processes on this machine."""

    def __init__(self, processes: SupportsIndex | None, study: Study) -> None:
        self.threads = os.cpu_count() or 1 if processes is None else operator.index(processes)
        self._study = _pickled(study)
        self._pool: ProcessPoolExecutor | None = None

    def _begun(self) -> ProcessPoolExecutor:
        """Starts new processes.

        An error that prevents one process from working affects all of them. It is not a failure of a
        unit, and ends the campaign.
        """
        pool = ProcessPoolExecutor(self.threads, mp_context=_Spawn(), initializer=_leave_ctrl_c_to_the_parent)
        self._pool = pool
        try:
            pool.submit(_ready, self._study).result()
        except BrokenProcessPool:
            raise CampaignError(f"a worker process ended before it started to compute: {GUARD}") from None
        except Exception as error:
            raise CampaignError(f"worker processes cannot compute this study: {_reason(error)}") from error
        return pool

    def submit(self, start: int, stop: int, tries: int, avoid: str | None) -> Any:
        for _ in range(2):
            try:
                return (self._pool or self._begun()).submit(_work, self._study, start, stop)
            except BrokenProcessPool:
                # a process died, and all running batches fail; new processes replace it
                self.close(at_once=True)
        raise CampaignError("worker processes cannot be started on this machine")

    def wait(self, running: list[Future[dict[str, Any]]]) -> Iterable[Any]:
        return wait(running, return_when=FIRST_COMPLETED).done

    def answer(self, future: Future[dict[str, Any]]) -> dict[str, Any]:
        return future.result()

    def close(self, at_once: bool) -> None:
        pool, self._pool = self._pool, None
        if pool is None:
            return
        if at_once:
            for process in list((getattr(pool, "_processes", None) or {}).values()):
                process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


class Campaign:
    """The results of a complete or unfinished campaign in its folder.

    ``campaign.table("curve")`` reads all parts lazily. :meth:`result` loads them and draws the figure
    of the study.
    """

    def __init__(self, out: str | os.PathLike[str]) -> None:
        self.folder = Path(out)
        try:
            head = json.loads((self.folder / "campaign.json").read_text("utf-8"))
        except FileNotFoundError:
            raise CampaignError(f"{self.folder} contains no campaign: campaign.json is missing") from None
        except ValueError as error:
            raise CampaignError(f"{self.folder / 'campaign.json'} cannot be read: {error}; remove this file and start the campaign again, which keeps its parts") from None
        if not isinstance(head, dict) or head.get("format") != FORMAT:
            found = head.get("format") if isinstance(head, dict) else None
            raise CampaignError(f"{self.folder} has the format {found}, but this version reads {FORMAT}")
        self._head: dict[str, Any] = head
        self._done, self._useless = _folder.read(self.folder, self._identity, self.units)

    @classmethod
    def _begin(cls, study: Study, out: Path, *, retry: bool = False) -> Campaign:
        """Opens the campaign of a study in a locked folder, and removes incomplete files."""
        head = {
            "format": FORMAT,
            "version": study.version,
            "name": study.name,
            "kind": study.kind,
            "units": study.units,
            "study": list(study.__reduce__()[1][:4]),  # without data in memory, which only `identify` has
            "files": study._files,
        }
        head = json.loads(json.dumps(head))
        for folder in ("parts", "done"):
            (out / folder).mkdir(parents=True, exist_ok=True)
        if not (out / "campaign.json").exists():
            _folder.write(out / "campaign.json", json.dumps(head, indent=1).encode())
        there = cls(out)
        if lies := _difference(there._head, head):
            raise CampaignError(f"{out} contains the campaign of {lies}; choose another folder, or remove that campaign")
        _folder.clear(out)
        batches, useless = _folder.read(out, there._identity, there.units, checksums=True)
        if useless:
            count = there.units - sum(batch.stop - batch.start for batch in batches)
            message = f"{len(useless)} batches in {out} have damaged or missing parts or belong to another campaign: their units are computed again; {count} units remain"
            warnings.warn(message, stacklevel=3)
        failed = [batch for batch in batches if retry and batch.told.get("failed")]
        for file in [*useless, *(out / "done" / f"{batch.stem}.json" for batch in failed)]:
            file.unlink()
        return cls(out)

    def _missing(self) -> list[tuple[int, int]]:
        return list(_folder.missing(self._done, self.units))

    def _keep(self, start: int, stop: int, answer: dict[str, Any]) -> None:
        tables = answer.pop("tables")
        _folder.keep(self.folder, start, stop, {"campaign": self._identity, **answer}, tables)

    @property
    def _identity(self) -> str:
        """Checksum of all that determines the rows: records of another campaign are not used."""
        determining = [self._head["version"], self._head["study"][1:], self._head["files"]]
        return hashlib.sha256(json.dumps(determining).encode()).hexdigest()

    @property
    def name(self) -> str:
        """Name of the study."""
        return str(self._head["name"])

    @property
    def units(self) -> int:
        """Number of units of the study."""
        return int(self._head["units"])

    @property
    def study(self) -> Study:
        """The study of the campaign."""
        from ._core import _study

        file, text, overrides, method = self._head["study"]
        return _study(file, text, [tuple(one) for one in overrides], method)

    @property
    def is_complete(self) -> bool:
        """``True`` if every unit was computed or has failed."""
        return not self._missing()

    @property
    def damaged(self) -> int:
        """Batches with damaged or missing parts. The next call of `campaign` repeats their units."""
        return len(self._useless)

    @property
    def failed(self) -> dict[int, str]:
        """Failed units, with the reason."""
        return {batch.start: batch.told["failed"] for batch in self._done if batch.told.get("failed")}

    @property
    def points(self) -> dict[str, int]:
        """Number of points by status."""
        points: dict[str, int] = {}
        for batch in self._done:
            for status, count in batch.told.get("points", {}).items():
                points[status] = points.get(status, 0) + count
        return points

    @property
    def seconds(self) -> float:
        """Total computing time of the workers in s."""
        return float(sum(batch.told.get("seconds", 0.0) for batch in self._done))

    @property
    def tables(self) -> list[str]:
        """Names of the tables."""
        return sorted(folder.name for folder in (self.folder / "parts").iterdir() if folder.is_dir())

    def files(self, table: str) -> list[Path]:
        """Returns the Parquet files of a table, in the order of the units."""
        folder = self.folder / "parts" / table
        found = [folder / f"{batch.stem}.parquet" for batch in self._done if table in batch.told["parts"]]
        if not found:
            raise CampaignError(f"unknown table `{table}`; the tables are {', '.join(self.tables) or 'none yet'}")
        return found

    def table(self, name: str | None = None, *, library: Literal["polars", "pyarrow"] = "polars") -> Any:
        """Returns all parts of a table in order, read lazily.

        The type is ``polars.LazyFrame``, or ``pyarrow.dataset.Dataset`` with ``library="pyarrow"``.
        ``name`` is by default the main table of the study.
        """
        files = self.files(name or self._main())
        if library == "polars":
            return importlib.import_module("polars").scan_parquet(files)
        if library == "pyarrow":
            return importlib.import_module("pyarrow.dataset").dataset([str(file) for file in files], format="parquet")
        raise ValueError(f"library must be polars or pyarrow, found {library!r}")

    def _main(self) -> str:
        return next((name for name in self.study.tables if name in self.tables), "")

    def _column(self, column: str, table: str | None) -> NDArray[np.float64]:
        read = self.table(table, library="pyarrow").to_table(columns=[column])
        return np.asarray(read[column].to_numpy(), float)

    @overload
    def percentiles(self, column: str, percent: _Percent = ..., *, by: None = None, table: str | None = None) -> Any: ...

    @overload
    def percentiles(
        self, column: str, percent: _Percent = ..., *, by: str, table: str | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

    def percentiles(self, column: str, percent: _Percent = (5, 50, 95), *, by: str | None = None, table: str | None = None) -> Any:
        """Returns percentiles of a column over all points with a value.

        With ``by``, the percentiles are computed for each value of another column. Returns an array
        (percent), or the values of ``by`` (n) and an array (n, percent).
        """
        values = self._column(column, table)
        if by is None:
            return np.nanpercentile(values, percent)
        groups, where = np.unique(self._column(by, table), return_inverse=True)
        order = np.argsort(where, kind="stable")
        parts = np.split(values[order], np.cumsum(np.bincount(where))[:-1])
        return groups, np.array([np.nanpercentile(part, percent) for part in parts])

    def exceedance(self, column: str, levels: ArrayLike, *, table: str | None = None) -> NDArray[np.float64]:
        """Returns the fraction of points above each level, without points that have no value."""
        from .statistics import exceedance

        return exceedance(self._column(column, table), levels)

    def sensitivity(self, column: str, inputs: Iterable[str], *, table: str | None = None) -> dict[str, float]:
        """Returns first-order Sobol indices of a column with respect to columns of inputs.

        See :func:`stickslip.statistics.first_order`.
        """
        from .statistics import first_order

        return {one: first_order(self._column(one, table), self._column(column, table)) for one in inputs}

    def plot(
        self, column: str, *, by: str, percent: Sequence[float] = (5, 25, 50, 75, 95), table: str | None = None, axes: Any = None
    ) -> Any:
        """Draws percentiles of a column over another column as bands with matplotlib."""
        x, bands = self.percentiles(column, percent, by=by, table=table)
        if axes is None:
            _, axes = importlib.import_module("matplotlib.pyplot").subplots(layout="constrained")
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

    def result(self) -> Result:
        """Loads all parts and draws the figure of the study.

        The :class:`Result` equals that of :meth:`Study.run`, and its files equal those of the command.
        """
        from ._core import _joined

        if not self.is_complete or self.failed:
            open_units = "units whose parts are damaged or missing" if self.damaged else "units that were not computed yet"
            lacks = "units that failed" if self.is_complete else open_units
            raise CampaignError(f"{self.folder} has {lacks}: the result is incomplete; read its tables instead")
        study = self.study
        tables = []
        for name in study.tables:
            if name in self.tables:
                whole = self.table(name, library="pyarrow").to_table()
                columns = [(column, str(whole.schema.field(column).type), _plain(whole[column])) for column in whole.column_names]
                tables.append((name, columns))
        return _joined(study, tables, [batch.told["told"] for batch in self._done], self.seconds)

    def __repr__(self) -> str:
        done = sum(batch.stop - batch.start for batch in self._done)
        counts = ((len(self.failed), "failed"), (self.damaged, "batches damaged"))
        lost = "".join(f", {count} {what}" for count, what in counts if count)
        return f"<stickslip.Campaign {self.name}: {done} of {self.units} units{lost}, in {self.folder}>"


def _difference(theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> str | None:
    """Describes the difference between the campaign in a folder and this one.

    The path of the study file may differ.
    """
    (_, text, overrides, method), (_, our_text, our_overrides, our_method) = theirs["study"], ours["study"]
    if theirs["version"] != ours["version"]:
        return f"another version: {theirs['version']}; this version is {ours['version']}"
    if text != our_text:
        lines = itertools.zip_longest(text.splitlines(), our_text.splitlines(), fillvalue="")
        changed = next(((line, one, other) for line, (one, other) in enumerate(lines, 1) if one != other), None)
        where = "its line endings differ" if changed is None else "its line {} is `{}`, but the line of this study is `{}`".format(*changed)
        return f"another study: {where}"
    if overrides != our_overrides:
        words = ", ".join(f"{name} = {value}" for name, value in overrides) or "none of them set"
        return f"the same study with other values of parameters ({words})"
    if method != our_method:
        return f"the same study with another method ({method or 'its own'})"
    if theirs["files"] != ours["files"]:
        return "a study with other matrices or data: the files of [structure] or [[data]] have changed"
    return None


def _plain(column: Any) -> Any:
    """Converts a column for Rust: to an array of numbers, or to a list."""
    kind = str(column.type)
    if kind == "double":
        return column.to_numpy()
    return column.to_pylist()
