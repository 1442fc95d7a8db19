"""Studies that are sweeps: many runs over transformed logs, whose rows are all that is kept.

Such a study goes on where it stopped: a case that has a row in the folder is not run again,
unless the row is an error. What is told is told from the rows.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from replay.batch.study import Options
from replay.batch.sweep import run as sweep
from replay.batch.sweep.file import Case
from replay.batch.workers import Workers
from replay.errors import UsageError

ROWS: Final = "rows"

Present = Callable[[Sequence[Case], Options, Workers], Mapping[str, Path]]


@dataclasses.dataclass(frozen=True, slots=True)
class SweepStudy:
    """A study by name.

    Attributes
    ----------
    name : str
    about : str
        One line for a person.
    cases : callable
        Cases of the options: seeds and labels.
    present : callable
        Writes tables, report and recording from the rows in the folder's `rows` with the help
        of workers; gives the files written, by what they are.
    """

    name: str
    about: str
    cases: Callable[[Options], Sequence[Case]]
    present: Present


def rows_folder(options: Options) -> Path:
    """Folder of the rows."""
    return options.folder / ROWS


def sweep_options(options: Options) -> sweep.Options:
    """Options of the sweep that a study is."""
    return sweep.Options(
        rows_folder(options), options.jobs, options.scheduler, resume=True, retry=True
    )


def study_cases(study: SweepStudy, options: Options) -> tuple[Sequence[Case], int]:
    """Cases of a study, and how many of them are to be run.

    Raises
    ------
    UsageError
        For an unknown label, or no seed or process.
    """
    if options.seeds < 1 or options.jobs < 1:
        raise UsageError("seeds and jobs are 1 or more")
    cases = study.cases(options)
    return cases, len(sweep.pending_cases(cases, sweep_options(options)))


def run_sweep_study(
    cases: Sequence[Case], options: Options, *, told: sweep.Told | None = None
) -> sweep.Swept:
    """Run the cases that have no row yet.

    Raises
    ------
    UsageError
        Where the folder or the scheduler is off; what goes wrong in a case stands in its row.
    """
    return sweep.run_sweep(None, cases, sweep_options(options), told=told)
