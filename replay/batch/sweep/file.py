"""The file of a sweep, and the cases that it stands for."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from replay.configuration import Section, Table, build, literal, merge
from replay.engine.manifest import package_version
from replay.engine.pipelines import find_pipeline
from replay.engine.transforms import Transform
from replay.errors import ConfigurationError, ReplayError, UsageError
from replay.simulate import load_scenario

SEED: Final = "seed"
_SCENARIO: Final = "scenario"
_SETTINGS: Final = "settings"
_KEY_DIGITS: Final = 16
_READ_BYTES: Final = 1 << 20


class SweepFile(Section, frozen=True):
    """What a person writes.

    Attributes
    ----------
    name, about : str
    log, scenario : tuple of str
        Inputs: logs, and scenarios to simulate; relative to the file.
    over : dict
        Goes over every scenario, key by key.
    transform : dict
        Of :class:`replay.engine.transforms.Transform`, for every case.
    pipeline : tuple of str
    then : tuple of str
        Pipelines that go over each run's log after it, one over the other's, as `smooth`;
        what is measured is the last.
    settings : tuple of str
        `section.key=value`, for every case; of the first pipeline.
    grid : dict of str to list
        Every combination of values is a case. A key is one of a transform (`imu_rate`),
        `scenario.KEY` (`scenario.imu.grade`), `settings.KEY` (`settings.filter.states`), or
        `seed`, which is that of the scenario and of the added noise.
    figures : tuple of str
        Patterns of figures that are kept, as `position_error_m.*.rms`; none for all.
    table : tuple of str
        Figures that the table shows.
    fixed_truth_only : bool
        As for `replay evaluate`.
    """

    name: str = ""
    about: str = ""
    log: tuple[str, ...] = ()
    scenario: tuple[str, ...] = ()
    over: dict[str, Any] = msgspec.field(default_factory=dict)
    transform: dict[str, Any] = msgspec.field(default_factory=dict)
    pipeline: tuple[str, ...] = ()
    then: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()
    grid: dict[str, list[Any]] = msgspec.field(default_factory=dict)
    figures: tuple[str, ...] = ()
    table: tuple[str, ...] = ()
    fixed_truth_only: bool = False


@dataclasses.dataclass(frozen=True, slots=True)
class Source:
    """Where a case's log comes from.

    Attributes
    ----------
    path : Path
        A log, or a scenario.
    simulated : bool
    tables : tuple of mapping
        Go over the scenario.
    digest : str
        Of all that decides the log.
    """

    path: Path
    simulated: bool
    tables: tuple[Mapping[str, Any], ...]
    digest: str

    @property
    def name(self) -> str:
        """For a person: the folder of a scenario, the name of a log."""
        folder = self.path.parent.name
        return folder if self.path.stem == _SCENARIO and folder else self.path.stem


@dataclasses.dataclass(frozen=True, slots=True)
class Case:
    """One run.

    Attributes
    ----------
    key : str
        Of everything that decides the row, but for the code.
    sweep : str
    grid : dict of str to str or float
        Where it stands in the grid.
    source : Source
    transform : dict
        Empty for the log as it is.
    pipeline : str
    settings : tuple of str
    figures : tuple of str
    fixed_truth_only : bool
    then : tuple of str
        Pipelines over the run's log.
    measure : str
        `module:function` that measures the last log: see :mod:`replay.batch.sweep.measure`;
        empty for figures of the evaluation.
    """

    key: str
    sweep: str
    grid: dict[str, str | float]
    source: Source
    transform: dict[str, Any]
    pipeline: str
    settings: tuple[str, ...]
    figures: tuple[str, ...]
    fixed_truth_only: bool
    then: tuple[str, ...] = ()
    measure: str = ""

    @property
    def label(self) -> str:
        """For a person."""
        words = [f"{name}={word(value)}" for name, value in self.grid.items()]
        return ", ".join([self.source.name, self.pipeline, *words])

    @property
    def partition(self) -> tuple[str, str | float]:
        """The grid's first key and its value; the pipeline where there is no grid."""
        return next(iter(self.grid.items()), ("pipeline", self.pipeline))


def load_sweep(path: Path) -> SweepFile:
    """Sweep of a TOML file.

    Raises
    ------
    UsageError
        Where it cannot be read.
    ConfigurationError
        For an unknown key, or a sweep without inputs, pipelines or values.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"the sweep cannot be read: {error}", where=str(path)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"the sweep is no TOML: {error}", where=str(path)) from error
    try:
        sweep = build(SweepFile, [{"name": path.stem}, table])
        _check(sweep)
    except ConfigurationError as error:
        mend = error.mend.replace("`replay pipelines NAME` lists", "see `replay sweep --help` for")
        raise ConfigurationError(error.what, where=str(path), mend=mend) from error
    return sweep


def _check(sweep: SweepFile) -> None:
    if not (sweep.log or sweep.scenario):
        raise ConfigurationError(
            "a sweep needs logs", mend='write scenario = ["../drive/scenario.toml"] or log = [...]'
        )
    if not sweep.pipeline:
        raise ConfigurationError("a sweep needs pipelines", mend='write pipeline = ["gnss-ins-lc"]')
    for name in (*sweep.pipeline, *sweep.then):
        find_pipeline(name)
    for key, values in sweep.grid.items():
        if not values:
            raise ConfigurationError(f"grid.{key} has no value", mend="write a list of values")
        labels = [label_of(value) for value in values]
        if len(set(labels)) < len(labels):
            raise ConfigurationError(f"grid.{key} has a value twice", mend="leave one of them out")
        if key.startswith(f"{_SCENARIO}.") and sweep.log:
            raise ConfigurationError(
                f"grid.{key} is about scenarios, and the sweep has logs",
                mend="make two sweeps of it",
            )
        head = key.partition(".")[0]
        if key != SEED and head not in (_SCENARIO, _SETTINGS) and key not in _TRANSFORM_KEYS:
            raise ConfigurationError(
                f"unknown key grid.{key}",
                mend=f"known: {', '.join(_TRANSFORM_KEYS)}, scenario.KEY, settings.KEY",
            )


_TRANSFORM_KEYS: Final = Transform.__struct_fields__


def cases_of(sweep: SweepFile, folder: Path, *, measure: str = "") -> tuple[Case, ...]:
    """Every combination, inputs and pipelines first, the grid's last key the fastest.

    Parameters
    ----------
    sweep : SweepFile
    folder : Path
        What its paths are relative to.
    measure : str
        As :class:`Case` has it.

    Raises
    ------
    UsageError
        Where a log cannot be read.
    """
    inputs = [(folder / name, False) for name in sweep.log]
    inputs += [(folder / name, True) for name in sweep.scenario]
    sources: dict[str, Source] = {}
    cases: list[Case] = []
    for (path, simulated), pipeline in itertools.product(inputs, sweep.pipeline):
        for values in itertools.product(*sweep.grid.values()):
            point = dict(zip(sweep.grid, values, strict=True))
            cases.append(_case(sweep, path, simulated, pipeline, point, sources, measure))
    return tuple(cases)


def _case(
    sweep: SweepFile,
    path: Path,
    simulated: bool,
    pipeline: str,
    point: Mapping[str, Any],
    sources: dict[str, Source],
    measure: str,
) -> Case:
    over: Table = {}
    merge(over, sweep.over)
    transform = dict(sweep.transform)
    settings = list(sweep.settings)
    for key, value in point.items():
        head, _, rest = key.partition(".")
        if key == SEED:
            over[SEED] = transform[SEED] = value
        elif head == _SCENARIO:
            merge(over, _nested(rest, value))
        elif head == _SETTINGS:
            settings.append(f"{rest}={value if isinstance(value, str) else literal(value)}")
        else:
            transform[key] = _words(key, value)
    source = _source(path, simulated, over if simulated else {}, sources)
    if set(transform) <= {SEED}:  # a seed alone does nothing
        transform = {}
    decides = {
        "source": source.digest,
        "transform": transform,
        "pipeline": pipeline,
        "settings": settings,
        "figures": sweep.figures,
        "fixed_truth_only": sweep.fixed_truth_only,
        "package": package_version(),
    }
    if sweep.then:
        decides["then"] = sweep.then
    if measure:
        decides["measure"] = measure
    return Case(
        _digest(decides),
        sweep.name,
        {key: label_of(value) for key, value in point.items()},
        source,
        transform,
        pipeline,
        tuple(settings),
        sweep.figures,
        sweep.fixed_truth_only,
        sweep.then,
        measure,
    )


def _source(
    path: Path, simulated: bool, over: Mapping[str, Any], sources: dict[str, Source]
) -> Source:
    place = json.dumps([str(path), over], sort_keys=True, default=str)
    if place not in sources:
        tables = (over,) if over else ()
        digest = _scenario_digest(path, tables) if simulated else _file_digest(path)
        sources[place] = Source(path, simulated, tables, digest)
    return sources[place]


def _scenario_digest(path: Path, tables: Sequence[Mapping[str, Any]]) -> str:
    try:
        scenario = load_scenario(path, tables)
    except ReplayError:
        # The case fails when it is run, and its row says why.
        return _digest([str(path), _file_digest(path), list(tables)])
    flown = scenario.settings.trajectory.log
    moves = _file_digest(scenario.folder / flown) if flown else ""
    return _digest([scenario.to_toml(), moves])


def _file_digest(path: Path) -> str:
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while part := file.read(_READ_BYTES):
                digest.update(part)
    except OSError as error:
        raise UsageError(f"an input of the sweep cannot be read: {error}", where=str(path)) from (
            error
        )
    return digest.hexdigest()


def _digest(value: Any) -> str:
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:_KEY_DIGITS]


def _nested(dotted: str, value: Any) -> Table:
    table: Table = {}
    inner = table
    *outer, last = dotted.split(".")
    for name in outer:
        inner[name] = {}
        inner = inner[name]
    inner[last] = value
    return table


def _words(key: str, value: Any) -> Any:
    """A value of a transform; one word, or none, stands for a list."""
    default = getattr(Transform(), key)
    if isinstance(default, tuple) and isinstance(value, str):
        return [value] if value else []
    return value


def label_of(value: Any) -> str | float:
    """A grid's value as a column holds it."""
    if isinstance(value, bool):
        return literal(value)
    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, list):
        return "; ".join(str(item) for item in value) or "none"
    return str(value) or "none"


def word(value: str | float) -> str:
    """A grid's value as a person writes it: whole numbers without a point, none cut short."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return repr(value) if isinstance(value, float) else value
