"""All cases of a sweep that have no row yet, here or on the workers of a Dask cluster."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from replay.batch.sweep.case import failed_row, make_input, run_case
from replay.batch.sweep.file import Case, Source
from replay.batch.sweep.rows import CODE, ERROR, Row, read_rows, row_files, row_path, write_row
from replay.engine.manifest import code_digest
from replay.errors import ExitCode, UsageError

COPY: Final = "sweep.toml"
_INPUTS: Final = ".inputs"
# A run holds the interpreter for seconds and is one array after the other: no look at its stack
# a hundred times a second, and freed pages stay with the process.
_SETTINGS: Final = {
    "distributed.admin.tick.limit": "1h",
    "distributed.worker.profile.enabled": False,
    "distributed.nanny.pre-spawn-environ": {
        "OMP_NUM_THREADS": 1,
        "MKL_NUM_THREADS": 1,
        "OPENBLAS_NUM_THREADS": 1,
    },
}

Told = Callable[[Case, Row], None]
"""Called with each case as it is done."""


@dataclasses.dataclass(frozen=True, slots=True)
class Swept:
    """What became of a sweep.

    Attributes
    ----------
    cases : int
        Of the sweep.
    done : int
        That were run now.
    failed : int
        Rows with an error, of all cases, whenever they were run.
    lossy : int
        Rows of runs that lost something.
    foreign : int
        Rows in the folder that belong to no case of the sweep, as it is now.
    outdated : int
        Rows of its cases that another state of the code made.
    """

    cases: int
    done: int
    failed: int
    lossy: int
    foreign: int
    outdated: int = 0

    @property
    def exit_code(self) -> ExitCode:
        """3 where a case failed or lost something."""
        return ExitCode.LOSS if self.failed or self.lossy else ExitCode.OK


@dataclasses.dataclass(frozen=True, slots=True)
class Options:
    """What a person chose.

    Attributes
    ----------
    folder : Path
        Of the rows.
    jobs : int
        Processes of an own cluster; with one all is done in this process.
    scheduler : str
        Address of a running scheduler, whose workers see the same files; empty for none.
    resume : bool
        Leave cases alone that have a row.
    retry : bool
        With `resume`: run those again whose row is an error.
    threads : bool
        Workers of an own cluster are threads of this process.
    patience_s : float, s
        How long a running scheduler may take to answer.
    """

    folder: Path
    jobs: int = 2
    scheduler: str = ""
    resume: bool = False
    retry: bool = False
    threads: bool = False
    patience_s: float = 10.0


def pending_cases(cases: Sequence[Case], options: Options) -> list[Case]:
    """Cases to run.

    Raises
    ------
    UsageError
        Where the folder has rows and the sweep is not to be resumed.
    """
    if options.jobs < 1:
        raise UsageError("jobs are 1 or more")
    if row_files(options.folder) and not options.resume:
        raise UsageError(
            "the folder holds rows of a sweep",
            where=str(options.folder),
            mend="say --resume to go on with it, or take another folder",
        )
    failed: set[str] = set()
    if options.retry:
        rows = read_rows(options.folder)
        if rows.num_rows:
            found = rows.select(["case", ERROR]).to_pylist()
            failed = {row["case"] for row in found if row[ERROR]}
    return [
        case for case in cases if case.key in failed or not row_path(options.folder, case).exists()
    ]


def run_sweep(
    file: Path | None, cases: Sequence[Case], options: Options, *, told: Told | None = None
) -> Swept:
    """Run those of the cases of a sweep that have no row yet.

    Parameters
    ----------
    file : Path or None
        Copied beside the rows; None where the cases are those of no one file.
    cases : sequence of Case
        Of :func:`replay.batch.sweep.file.cases_of`.
    options : Options
    told : callable, optional

    Raises
    ------
    UsageError
        Where the folder or the scheduler is off; what goes wrong in a case stands in its row.
    """
    pending = pending_cases(cases, options)
    folder = options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if file is not None and (folder / COPY).resolve() != file.resolve():
        shutil.copyfile(file, folder / COPY)
    with _inputs(folder / _INPUTS) as inputs:
        for case, row in _rows(pending, inputs, options):
            write_row(row_path(folder, case), row)
            if told is not None:
                told(case, row)
    return _swept(cases, len(pending), folder)


def _swept(cases: Sequence[Case], done: int, folder: Path) -> Swept:
    table = read_rows(folder)
    known = [name for name in ("case", ERROR, CODE, "losses") if name in table.column_names]
    rows = table.select(known).to_pylist()
    keys = {case.key for case in cases}
    own = [row for row in rows if row["case"] in keys]
    return Swept(
        cases=len(cases),
        done=done,
        failed=sum(bool(row[ERROR]) for row in own),
        lossy=sum(row["losses"] != "[]" for row in own),
        foreign=len(rows) - len(own),
        outdated=sum(row.get(CODE) != code_digest() for row in own),
    )


@contextlib.contextmanager
def _inputs(folder: Path) -> Iterator[Path]:
    """Folder of simulated logs, empty at the start and gone at the end."""
    shutil.rmtree(folder, ignore_errors=True)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _rows(cases: Sequence[Case], inputs: Path, options: Options) -> Iterator[tuple[Case, Row]]:
    """Rows as they are done."""
    if not cases:
        return
    if options.jobs == 1 and not options.scheduler:
        yield from _here(cases, inputs)
    else:
        with _client(options) as client:
            yield from _on_workers(client, cases, inputs)


def _here(cases: Sequence[Case], inputs: Path) -> Iterator[tuple[Case, Row]]:
    made: dict[str, tuple[Path, float, str]] = {}
    left = _Left(cases)
    for case in cases:
        if case.source.digest not in made:
            made[case.source.digest] = make_input(case.source, inputs)
        row = run_case(case, made[case.source.digest])
        left.done(case, made[case.source.digest][0])
        yield case, row


class _Left:
    """Removes a simulated log once its last case is done: many of them are larger than rows."""

    def __init__(self, cases: Sequence[Case]) -> None:
        self._counts = Counter(case.source.digest for case in cases)

    def done(self, case: Case, log: Path) -> None:
        self._counts[case.source.digest] -= 1
        if case.source.simulated and self._counts[case.source.digest] == 0:
            log.unlink(missing_ok=True)


def _on_workers(client: Any, cases: Sequence[Case], inputs: Path) -> Iterator[tuple[Case, Row]]:
    import distributed

    library: Any = distributed  # has no types
    sources: dict[str, Source] = {case.source.digest: case.source for case in cases}
    # Earlier cases first, so that a log is made when its first case is near.
    first = {case.source.digest: -place for place, case in reversed(list(enumerate(cases)))}
    made = {
        digest: client.submit(make_input, source, inputs, pure=False, priority=first[digest])
        for digest, source in sources.items()
    }
    tasks = {
        client.submit(run_case, case, made[case.source.digest], pure=False, priority=-place): case
        for place, case in enumerate(cases)
    }
    left = _Left(cases)
    for task in library.as_completed(list(tasks)):
        case = tasks[task]
        error = task.exception()
        row = task.result() if error is None else failed_row(case, error)
        log = made[case.source.digest]
        if log.status == "finished":
            left.done(case, log.result()[0])
        yield case, row


@contextlib.contextmanager
def _client(options: Options) -> Iterator[Any]:
    """Client of a running scheduler, or of a cluster for as long as the sweep lasts."""
    import dask
    import distributed

    library: Any = distributed  # has no types
    if options.scheduler:
        try:
            client = library.Client(options.scheduler, timeout=options.patience_s)
        except (OSError, ValueError) as error:
            raise UsageError(
                f"no Dask scheduler answers: {error}",
                where=options.scheduler,
                mend="start one with `dask scheduler`, and workers with `dask worker ADDRESS`",
            ) from error
        with client:
            yield client
        return
    with (
        tempfile.TemporaryDirectory(prefix="replay-dask-") as scratch,
        dask.config.set(_SETTINGS),
        library.LocalCluster(
            n_workers=1 if options.threads else options.jobs,
            threads_per_worker=options.jobs if options.threads else 1,
            processes=not options.threads,
            dashboard_address="127.0.0.1:0",
            memory_limit=0,
            local_directory=scratch,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        library.Client(cluster) as client,
    ):
        yield client
