"""Rows of the study as runs, and what is counted of them: root mean squares, drifts.

Every figure of a seed is of the same epochs for all its runs: from the first at which each of
them has a solution. PPP alone has no position where it has fewer than four satellites: such
epochs are counted as unavailable, and its root mean square is of the others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq

from replay.batch.kan2022.measure import (
    ATTITUDE,
    BEFORE,
    END,
    MOST,
    OUTAGES,
    POSITION,
    QUANTITIES,
    SATELLITES,
    TIME,
    UPDATED,
    VELOCITY,
)
from replay.batch.kan2022.plan import ALONE, INTEGRATE, REFERENCE, TIGHT, kind_of
from replay.batch.sweep.file import Case
from replay.batch.sweep.rows import ERROR, FIGURE, SERIES, read_series, row_path
from replay.evaluate.geometry import Floats
from replay.evaluate.outages import Span
from replay.evaluate.statistics import LOCAL_AXES
from replay.time import NS_PER_S

_CM: Final = 100.0
_FEWEST_SATELLITES: Final = 4
_NONE: Final = "none"
UNITS: Final = {POSITION: ("cm", _CM), VELOCITY: ("cm/s", _CM), ATTITUDE: ("deg", 1.0)}


@dataclasses.dataclass(frozen=True, slots=True, order=True)
class Kind:
    """Runs that differ by their seed alone.

    Attributes
    ----------
    run : str
        "alone", "tight" or "reference".
    grade : str
        Inertial unit; empty but for "tight".
    method : str
        How samples were made fewer: "integrate", "decimate"; empty but for "tight".
    rate_hz : int
        0 but for "tight".
    outage : bool
    """

    run: str
    grade: str = ""
    method: str = ""
    rate_hz: int = 0
    outage: bool = False

    def words(self) -> str:
        """For a legend."""
        return {ALONE: "PPP", REFERENCE: "reference"}.get(self.run, f"{self.rate_hz} Hz")


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One row.

    Attributes
    ----------
    kind : Kind
    seed : int
    figures : mapping of str to float
    series : mapping of str to array (n,)
        As :mod:`replay.batch.kan2022.measure` names them.
    """

    kind: Kind
    seed: int
    figures: Mapping[str, float]
    series: Mapping[str, npt.NDArray[Any]]

    @property
    def times_ns(self) -> npt.NDArray[np.int64]:
        """Epochs (n,), GPS ns."""
        return np.asarray(self.series[TIME], dtype=np.int64)

    def errors(self, quantity: str) -> Floats:
        """Errors (n, 3) against truth, in the quantity's unit; NaN where there is none."""
        names = [f"{quantity}.{axis}" for axis in QUANTITIES[quantity]]
        values = np.column_stack([self.series[name].astype(np.float64) for name in names])
        if self.kind.run == ALONE:
            values[~self.usable] = np.nan
        return values

    @property
    def usable(self) -> npt.NDArray[np.bool_]:
        """Epochs (n,) at which GNSS alone gives a position."""
        mask: npt.NDArray[np.bool_] = self.series[UPDATED] > 0.0
        if SATELLITES in self.series:
            mask = mask & (self.series[SATELLITES] >= _FEWEST_SATELLITES)
        return mask

    def against(self, other: Run, quantity: str) -> Floats:
        """Errors (n, 3) against another run's solution in the place of truth."""
        values = self.errors(quantity)
        reference = np.full_like(values, np.nan)
        _, own, theirs = np.intersect1d(self.times_ns, other.times_ns, return_indices=True)
        reference[own] = other.errors(quantity)[theirs]
        difference = values - reference
        if quantity == ATTITUDE:
            difference = (difference + 180.0) % 360.0 - 180.0
        return np.asarray(difference)

    def spans(self) -> tuple[Span, ...]:
        """Outages that were cut."""
        ends = np.asarray(self.series.get(OUTAGES, ()), dtype=np.int64).reshape(-1, 2)
        return tuple(Span(int(start), int(end), cut=True) for start, end in ends)

    def outages(self) -> list[dict[str, float]]:
        """Figures of each outage: "east.end_m"; empty where the drift is not known."""
        heads = [f"outage.{number}." for number in range(1, len(self.spans()) + 1)]
        return [
            {n.removeprefix(head): v for n, v in self.figures.items() if n.startswith(head)}
            for head in heads
        ]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """All runs that went well.

    Attributes
    ----------
    runs : tuple of Run
    failed : tuple of str
        What is missing, and why.
    """

    runs: tuple[Run, ...]
    failed: tuple[str, ...] = ()

    @property
    def seeds(self) -> list[int]:
        """Ascending."""
        return sorted({run.seed for run in self.runs})

    @property
    def kinds(self) -> list[Kind]:
        """In the order of rows."""
        return list(dict.fromkeys(run.kind for run in self.runs))

    def find(self, kind: Kind, seed: int) -> Run | None:
        """The run of a kind and a seed."""
        return next((r for r in self.runs if r.kind == kind and r.seed == seed), None)

    def tight(self, grade: str, *, outage: bool) -> list[Kind]:
        """Kinds with an inertial unit: integrated by falling rate, then decimated."""
        found = [
            k for k in self.kinds if k.run == TIGHT and k.grade == grade and k.outage == outage
        ]
        return sorted(found, key=lambda kind: (kind.method != INTEGRATE, -kind.rate_hz))

    def grades(self) -> list[str]:
        """Inertial units, in the order of rows."""
        return list(dict.fromkeys(kind.grade for kind in self.kinds if kind.run == TIGHT))

    def begin_ns(self, seed: int) -> int:
        """First epoch at which every run of a seed has a position."""
        return max(_first(run) for run in self.runs if run.seed == seed)


def _first(run: Run) -> int:
    known = np.isfinite(run.errors(POSITION)).all(axis=1)
    return int(run.times_ns[known][0]) if known.any() else 0


def load_runs(cases: Iterable[Case], folder: Path) -> Runs:
    """Runs of the rows of cases."""
    runs: list[Run] = []
    failed: list[str] = []
    for case in cases:
        path = row_path(folder, case)
        if not path.exists():
            failed.append(f"{case.label}: no row")
            continue
        names = [n for n in pq.read_schema(path).names if not n.startswith(SERIES)]
        row = pq.read_table(path, columns=names, partitioning=None).to_pylist()[0]
        if row[ERROR]:
            failed.append(f"{case.label}: {row[ERROR]}")
            continue
        figures = {
            name.removeprefix(FIGURE): float(value)
            for name, value in row.items()
            if name.startswith(FIGURE) and isinstance(value, float)
        }
        grid = case.grid
        run, unit = kind_of(case.sweep)
        kind = Kind(
            run,
            unit,
            str(grid.get("imu_method", "")),
            int(float(grid.get("imu_rate", 0))),
            grid.get("outage", _NONE) != _NONE,
        )
        runs.append(Run(kind, int(float(grid["seed"])), figures, read_series(path)))
    return Runs(tuple(runs), tuple(failed))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Rms:
    """Root mean squares of a kind, a row per seed.

    Attributes
    ----------
    seeds : tuple of int
    values : dict of quantity to float64 array (seeds, 3)
        In cm, cm/s, deg; NaN where there is none.
    availability : float64 array (seeds,)
        Share of the epochs at which there is a position.
    """

    seeds: tuple[int, ...]
    values: dict[str, Floats]
    availability: Floats

    def mean(self, quantity: str) -> Floats:
        """Over the seeds (3,)."""
        return np.asarray(np.mean(self.values[quantity], axis=0))

    def spread(self, quantity: str) -> Floats | None:
        """Standard deviation over the seeds (3,); None of one."""
        if len(self.seeds) == 1:
            return None
        return np.asarray(np.std(self.values[quantity], axis=0, ddof=1))


def rms_of(
    runs: Runs, kind: Kind, *, since_s: float = 0.0, against_reference: bool = False
) -> Rms | None:
    """Root mean squares of a kind; None where no seed has it.

    Parameters
    ----------
    runs : Runs
    kind : Kind
    since_s : float, s
        After the first epoch that all runs of a seed share.
    against_reference : bool
        Whether the reference's solution stands in the place of truth.
    """
    seeds: list[int] = []
    values: dict[str, list[Floats]] = {quantity: [] for quantity in QUANTITIES}
    availability: list[float] = []
    for seed in runs.seeds:
        run = runs.find(kind, seed)
        reference = runs.find(Kind(REFERENCE), seed) if against_reference else None
        if run is None or (against_reference and reference is None):
            continue
        keep = run.times_ns >= runs.begin_ns(seed) + round(since_s * NS_PER_S)
        if not keep.any():
            continue
        seeds.append(seed)
        for quantity in QUANTITIES:
            errors = run.errors(quantity)
            if reference is not None:
                errors = run.against(reference, quantity)
            values[quantity].append(root_mean_square(errors[keep]) * UNITS[quantity][1])
        known = np.isfinite(run.errors(POSITION)[keep]).all(axis=1)
        availability.append(float(np.mean(known)))
    if not seeds:
        return None
    return Rms(tuple(seeds), {q: np.array(v) for q, v in values.items()}, np.array(availability))


def root_mean_square(errors: Floats) -> Floats:
    """Of each column of finite rows (n, 3); NaN where there is none."""
    known = errors[np.isfinite(errors).all(axis=1)]
    if len(known) == 0:
        return np.full(errors.shape[1], np.nan)
    return np.asarray(np.sqrt(np.mean(known * known, axis=0)))


def improvement_percent(tight: Floats, alone: Floats) -> Floats:
    """How much smaller the one is than the other [%]."""
    return np.asarray(100.0 * (1.0 - tight / alone))


def drifts_cm(runs: Runs, kind: Kind, *, figure: str = END) -> Floats:
    """Drifts (seeds, outages, 3) [cm], signed where the figure is; NaN where there is none."""
    per_seed: list[list[list[float]]] = []
    for seed in runs.seeds:
        run = runs.find(kind, seed)
        outages = run.outages() if run is not None else []
        per_seed.append(
            [[o.get(f"{axis}.{figure}", np.nan) for axis in LOCAL_AXES] for o in outages]
        )
    most = max((len(item) for item in per_seed), default=0)
    values = np.full((len(per_seed), most, 3), np.nan)
    for row, item in enumerate(per_seed):
        if item:
            values[row, : len(item)] = item
    return values * _CM


def drift_sizes_cm(runs: Runs, kind: Kind, *, added: bool = False) -> Floats:
    """Sizes (seeds, 4) [cm]: east, north, up and in space, rms over the outages of a seed.

    Of the differences at the ends; with `added` of these less those just before the outages.
    """
    drift = drifts_cm(runs, kind)
    if added:
        drift = drift - drifts_cm(runs, kind, figure=BEFORE)
    if drift.shape[1] == 0:
        return np.full((len(runs.seeds), 4), np.nan)
    squares = np.mean(drift * drift, axis=1)
    return np.asarray(np.sqrt(np.column_stack([squares, squares.sum(axis=1)])))


def greatest_drifts_cm(runs: Runs, kind: Kind) -> Floats:
    """Greatest errors (seeds, 3) [cm] in any outage of a seed."""
    most = drifts_cm(runs, kind, figure=MOST)
    if most.shape[1] == 0:
        return np.full((len(runs.seeds), 3), np.nan)
    return np.asarray(np.max(most, axis=1))


def first_with(runs: Runs, kinds: Sequence[Kind]) -> int | None:
    """First seed of which every one of the kinds is there."""
    for seed in runs.seeds:
        if all(runs.find(kind, seed) is not None for kind in kinds):
            return seed
    return None
