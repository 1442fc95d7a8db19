"""Studies: logs that are simulated, run and measured in parallel, then told in one place.

A study is a list of members. A member is a scenario with what goes over it, and the runs
over its log. To simulate the log is one task of one process, and so is each run over it with
its figures: a log is read where it was written, and only figures and what is to be drawn
come back.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path
from typing import Any, Final

from replay.batch.workers import Workers
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
    cost : float
        How long it takes beside other variants: longer ones begin first.
    """

    name: str
    pipeline: str
    settings: tuple[str, ...] = ()
    cost: float = 1.0


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
        Of all its tasks, which may have been done beside each other.
    pictures : dict of str to object
        By variant, what the study draws; empty but for the first seed.
    """

    member: Member
    logs: dict[str, Path]
    figures: dict[str, Any]
    losses: tuple[str, ...]
    elapsed_s: float
    pictures: dict[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, slots=True)
class Measured:
    """What a study takes from one run.

    Attributes
    ----------
    figures : object
    picture : object
        What is drawn of it; of the first seed alone.
    """

    figures: Any
    picture: Any = None


Measure = Callable[[Path, Variant], Measured]
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
    scheduler : str
        Address of a running Dask scheduler, for a study that is a sweep; empty for none.
    """

    folder: Path
    seeds: int = 1
    labels: tuple[str, ...] = ()
    jobs: int = 2
    keep_logs: bool = True
    scheduler: str = ""


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
        Writes tables, report and recording with the help of workers; gives the files written,
        by what they are.
    """

    name: str
    about: str
    members: Callable[[], Sequence[Member]]
    measure: Measure
    present: Callable[[Sequence[Done], Options, Workers], Mapping[str, Path]]


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


def run_study(
    study: Study, options: Options, *, workers: Workers | None = None, told: Told | None = None
) -> tuple[Done, ...]:
    """Simulate, run and measure every member; in the order of members.

    Parameters
    ----------
    study : Study
    options : Options
    workers : Workers, optional
        Those that do it; without them as many as `options` says, for this alone.
    told : callable, optional
        Called with each member as it is done, in the order in which they are.

    Raises
    ------
    ReplayError
        Where a member cannot be made or run; tasks that have begun are finished.
    """
    members = chosen_members(study, options)
    options.folder.mkdir(parents=True, exist_ok=True)
    if workers is not None:
        return _Schedule(study, members, options, workers).run(told)
    with Workers(options.jobs) as own:
        return _Schedule(study, members, options, own).run(told)


@dataclasses.dataclass(slots=True)
class _Begun:
    """A member whose log is being made or was made."""

    member: Member
    logs: dict[str, Path]
    waiting: list[Variant]
    found: dict[str, _Ran]
    elapsed_s: float = 0.0

    @property
    def complete(self) -> bool:
        return len(self.found) == len(self.member.variants)


@dataclasses.dataclass(frozen=True, slots=True)
class _Ran:
    """One run over a log, measured."""

    measured: Measured
    losses: tuple[str, ...]
    elapsed_s: float


class _Schedule:
    """Which task is next: another log while few are waiting for their runs, else the costliest."""

    def __init__(
        self, study: Study, members: Sequence[Member], options: Options, workers: Workers
    ) -> None:
        self._study = study
        self._members = members
        self._options = options
        self._workers = workers
        self._begun: dict[int, _Begun] = {}
        self._done: dict[int, Done] = {}
        self._tasks: dict[Future[Any], tuple[int, Variant | None]] = {}

    def run(self, told: Told | None) -> tuple[Done, ...]:
        """All members, in their order."""
        while len(self._done) < len(self._members):
            while len(self._tasks) < self._workers.jobs and self._begin_one():
                pass
            ready, _ = wait(self._tasks, return_when=FIRST_COMPLETED)
            for task in sorted(ready, key=lambda task: self._tasks[task][0]):
                place, variant = self._tasks.pop(task)
                done = self._finish(place, variant, task.result())
                if done is not None and told is not None:
                    told(done)
        return tuple(self._done[place] for place in range(len(self._members)))

    def _begin_one(self) -> bool:
        next_member = len(self._begun)
        logs_waiting = next_member - len(self._done)
        if next_member < len(self._members) and logs_waiting <= self._workers.jobs:
            member = self._members[next_member]
            log = self._options.folder / "logs" / member.folder / f"{INPUT}.mcap"
            log.parent.mkdir(parents=True, exist_ok=True)
            self._begun[next_member] = _Begun(member, {INPUT: log}, [], {})
            self._tasks[self._workers.submit(_make_log, member, log)] = next_member, None
            return True
        ready = [(p, v) for p, begun in self._begun.items() for v in begun.waiting]
        if not ready:
            return False
        place, variant = min(ready, key=lambda item: (-item[1].cost, item[0]))
        begun = self._begun[place]
        begun.waiting.remove(variant)
        source, target = begun.logs[INPUT], begun.logs[variant.name]
        measure = self._study.measure
        task = self._workers.submit(_run_variant, source, target, variant, measure)
        self._tasks[task] = place, variant
        return True

    def _finish(self, place: int, variant: Variant | None, result: Any) -> Done | None:
        begun = self._begun[place]
        if variant is None:
            begun.elapsed_s += result
            begun.waiting += begun.member.variants
            for known in begun.member.variants:
                begun.logs[known.name] = begun.logs[INPUT].with_name(f"{known.name}.mcap")
        else:
            begun.elapsed_s += result.elapsed_s
            begun.found[variant.name] = result
        if not begun.complete:
            return None
        self._done[place] = _whole(begun, self._options)
        return self._done[place]


def _whole(begun: _Begun, options: Options) -> Done:
    member = begun.member
    first = member.number == 0
    if not first or not options.keep_logs:
        discard_logs(begun.logs)
    names = [variant.name for variant in member.variants]
    return Done(
        member,
        begun.logs,
        {name: begun.found[name].measured.figures for name in names},
        tuple(
            f"{member.folder}, {name}: {loss}"
            for name in names
            for loss in begun.found[name].losses
        ),
        begun.elapsed_s,
        {name: begun.found[name].measured.picture for name in names} if first else {},
    )


def _make_log(member: Member, log: Path) -> float:
    begin = time.monotonic()
    simulate(member.scenario, log, tables=member.tables)
    return time.monotonic() - begin


def _run_variant(source: Path, target: Path, variant: Variant, measure: Measure) -> _Ran:
    begin = time.monotonic()
    with LogReader(source) as reader:
        job = make_job(reader, variant.pipeline, tables=[parse_assignments(variant.settings)])
        result = replay_log(reader, target, job)
    measured = measure(target, variant)
    losses = tuple(str(loss) for loss in result.losses.losses)
    return _Ran(measured, losses, time.monotonic() - begin)


def discard_logs(logs: Mapping[str, Path]) -> None:
    """Remove logs, and their folders where they are empty then."""
    for path in logs.values():
        path.unlink(missing_ok=True)
    for folder in {path.parent for path in logs.values()}:
        for empty in (folder, folder.parent):
            if empty.is_dir() and not any(empty.iterdir()):
                empty.rmdir()
