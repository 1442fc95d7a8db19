"""Studies: logs that are simulated, run and measured in parallel, then told in one place.

A study is a list of members. A member is a scenario with what goes over it, and the runs
over its log. Members are independent, so each is one task of one process; processes are
spawned, not forked, so that they are alike on every system.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Final

from replay.configuration import parse_assignments
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.errors import UsageError
from replay.log.reader import LogReader
from replay.simulate import simulate

INPUT: Final = "input"


@dataclasses.dataclass(frozen=True, slots=True)
class Variant:
    """One run over the log of a member.

    Attributes
    ----------
    name : str
        Of the run's file: "network".
    pipeline : str
    settings : tuple of str
        `section.key=value`, over the defaults of the pipeline and of the log.
    """

    name: str
    pipeline: str
    settings: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True)
class Member:
    """One log and the runs over it.

    Attributes
    ----------
    label : str
        Which case: members of one label differ by their seed alone.
    scenario : Path
    tables : tuple of mapping
        Go over the scenario's, key by key.
    variants : tuple of Variant
    number : int
        Of the seed: 0 is the scenario's own.
    """

    label: str
    scenario: Path
    tables: tuple[Mapping[str, Any], ...]
    variants: tuple[Variant, ...]
    number: int = 0

    @property
    def folder(self) -> str:
        """Name of the folder of its logs."""
        return self.label if self.number == 0 else f"{self.label}-seed{self.number}"


@dataclasses.dataclass(frozen=True, slots=True)
class Done:
    """A member that was run.

    Attributes
    ----------
    member : Member
    logs : dict of str to Path
        By variant; "input" is the log that they ran over. Those that were not kept are gone.
    figures : dict of str to object
        By variant, what the study measured.
    losses : tuple of str
        What was lost on the way.
    elapsed_s : float, s
    """

    member: Member
    logs: dict[str, Path]
    figures: dict[str, Any]
    losses: tuple[str, ...]
    elapsed_s: float


Measure = Callable[[Path, Variant], Any]
Told = Callable[[Done], None]


@dataclasses.dataclass(frozen=True, slots=True)
class Options:
    """What a person chose.

    Attributes
    ----------
    folder : Path
        Where everything is written.
    seeds : int
        How many members of each label.
    labels : tuple of str
        Those that are wanted; none for all.
    jobs : int
        Processes.
    keep_logs : bool
        Whether the logs of the first seed stay; those of further seeds never do.
    """

    folder: Path
    seeds: int = 1
    labels: tuple[str, ...] = ()
    jobs: int = 2
    keep_logs: bool = True


@dataclasses.dataclass(frozen=True, slots=True)
class Study:
    """A study by name.

    Attributes
    ----------
    name : str
    about : str
        One line for a person.
    members : callable
        Members of the first seed, in order.
    measure : callable
        Figures of one run; of the top level of a module, as another process calls it.
    present : callable
        Writes tables, report and recording; gives the files written, by what they are.
    """

    name: str
    about: str
    members: Callable[[], Sequence[Member]]
    measure: Measure
    present: Callable[[Sequence[Done], Options], Mapping[str, Path]]


def chosen_members(study: Study, options: Options) -> tuple[Member, ...]:
    """Members of the labels and seeds that are wanted, all of one seed before the next.

    Raises
    ------
    UsageError
        For an unknown label, or no seed or process.
    """
    if options.seeds < 1 or options.jobs < 1:
        raise UsageError("seeds and jobs are 1 or more")
    members = study.members()
    known = [member.label for member in members]
    labels: set[str] = set()
    for label in options.labels:
        full = label if label in known else f"case{label}"
        if full not in known:
            raise UsageError(f"no case {label!r}", mend=f"known: {', '.join(known)}")
        labels.add(full)
    wanted = [m for m in members if not labels or m.label in labels]
    return tuple(_of_seed(member, number) for number in range(options.seeds) for member in wanted)


def _of_seed(member: Member, number: int) -> Member:
    from replay.simulate import load_scenario

    if number == 0:
        return member
    seed = load_scenario(member.scenario, member.tables).settings.seed + number
    return dataclasses.replace(member, tables=(*member.tables, {"seed": seed}), number=number)


def run_study(study: Study, options: Options, *, told: Told | None = None) -> tuple[Done, ...]:
    """Simulate, run and measure every member; in the order of members.

    Parameters
    ----------
    study : Study
    options : Options
    told : callable, optional
        Called with each member as it is done, in the order in which they are.

    Raises
    ------
    ReplayError
        Where a member cannot be made or run; those that have begun are finished.
    """
    members = chosen_members(study, options)
    options.folder.mkdir(parents=True, exist_ok=True)
    found: dict[int, Done] = {}
    for place, done in _all(study, members, options):
        found[place] = done
        if told is not None:
            told(done)
    return tuple(found[place] for place in range(len(members)))


def _all(study: Study, members: Sequence[Member], options: Options) -> Iterator[tuple[int, Done]]:
    jobs = min(options.jobs, len(members))
    if jobs == 1:
        for place, member in enumerate(members):
            yield place, run_member(member, options.folder, study.measure)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        tasks = {
            pool.submit(run_member, member, options.folder, study.measure): place
            for place, member in enumerate(members)
        }
        try:
            for task in as_completed(tasks):
                yield tasks[task], task.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def run_member(member: Member, folder: Path, measure: Measure) -> Done:
    """Simulate the log of a member, run every variant over it and measure each."""
    begin = time.monotonic()
    place = folder / "logs" / member.folder
    place.mkdir(parents=True, exist_ok=True)
    logs = {INPUT: place / f"{INPUT}.mcap"}
    simulate(member.scenario, logs[INPUT], tables=member.tables)
    figures: dict[str, Any] = {}
    losses: list[str] = []
    for variant in member.variants:
        logs[variant.name] = place / f"{variant.name}.mcap"
        with LogReader(logs[INPUT]) as reader:
            tables = [parse_assignments(variant.settings)]
            job = make_job(reader, variant.pipeline, tables=tables)
            result = replay_log(reader, logs[variant.name], job)
        losses += [f"{member.folder}, {variant.name}: {loss}" for loss in result.losses.losses]
        figures[variant.name] = measure(logs[variant.name], variant)
    if member.number > 0:
        discard_logs(logs)
    return Done(member, logs, figures, tuple(losses), time.monotonic() - begin)


def discard_logs(logs: Mapping[str, Path]) -> None:
    """Remove logs, and their folders where they are empty then."""
    for path in logs.values():
        path.unlink(missing_ok=True)
    for folder in {path.parent for path in logs.values()}:
        for empty in (folder, folder.parent):
            if empty.is_dir() and not any(empty.iterdir()):
                empty.rmdir()


def find_study(name: str) -> Study:
    """Study of a name.

    Raises
    ------
    UsageError
        Where there is none.
    """
    if name not in STUDIES:
        raise UsageError(f"no study {name!r}", mend=f"known: {', '.join(STUDIES)}")
    return STUDIES[name]()


def _lee2010() -> Study:
    from replay.batch.lee2010.run import STUDY

    return STUDY


STUDIES: Final[dict[str, Callable[[], Study]]] = {"lee2010": _lee2010}
"""Studies by name; each is imported when it is asked for."""
