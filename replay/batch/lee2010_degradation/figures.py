"""Figures of one run, and of one row of the table: the mean over the seeds of a run."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Final

import msgspec
import numpy as np

from replay.batch.lee2010_degradation.members import SWEEPS, Setting, Sweep
from replay.batch.study import Done
from replay.evaluate.network_run import MeanStd, NetworkFigures

POSITION: Final = ("north", "east", "height")
ATTITUDE: Final = ("heading", "pitch", "roll")


class RunFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of one run.

    Attributes
    ----------
    distance_km : float, km
        Mean distance of the rover's true path from the master.
    network : NetworkFigures
    """

    distance_km: float
    network: NetworkFigures


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """What the table and the picture say of one run.

    Attributes
    ----------
    sweep : Sweep
    setting : Setting
    variant : str
    runs : tuple of RunFigures
        One of each seed.
    """

    sweep: Sweep
    setting: Setting
    variant: str
    runs: tuple[RunFigures, ...]

    def both(self, name: str) -> MeanStd | None:
        """Mean by its size and standard deviation, "north" [cm] to "roll" [arc-min]."""
        found = self._each(name)
        if not found:
            return None
        return MeanStd(
            float(np.mean([abs(item.mean) for item in found])),
            float(np.mean([item.std for item in found])),
        )

    def about_truth(self, name: str) -> float | None:
        """Root mean square about the truth, in the same unit."""
        found = self._each(name)
        if not found:
            return None
        return float(np.mean([math.hypot(item.mean, item.std) for item in found]))

    def _each(self, name: str) -> list[MeanStd]:
        every = [{**r.network.position_cm, **r.network.attitude_arcmin} for r in self.runs]
        return [item[name] for item in every if name in item]

    @property
    def distance_km(self) -> float:
        """Of the seeds, mean distance from the master."""
        return float(np.mean([run.distance_km for run in self.runs]))

    @property
    def shares(self) -> tuple[float, float]:
        """Of the epochs, those fixed and those fixed wrongly; 0 to 1."""
        known = [run.network.epochs for run in self.runs if run.network.epochs is not None]
        epochs = sum(item.epochs for item in known)
        if epochs == 0:
            return 0.0, 0.0
        fixed, wrong = (sum(getattr(item, n) for item in known) for n in ("fixed", "wrong"))
        return fixed / epochs, wrong / epochs

    @property
    def stations(self) -> tuple[float, int] | None:
        """Between the stations: share of the rows that are fixed, and how many are wrong."""
        lanes = [
            lane
            for run in self.runs
            if run.network.stations is not None
            for signals in run.network.stations.baselines.values()
            for lane in signals.values()
        ]
        rows = sum(lane.rows for lane in lanes)
        if rows == 0:
            return None
        return sum(lane.fixed for lane in lanes) / rows, sum(lane.wrong for lane in lanes)

    def residual_cm(self, after: bool) -> float | None:
        """Of the first signal, rms before or after the corrections."""
        known = [r for run in self.runs for r in list(run.network.residuals.values())[:1]]
        values = [item.after_rms_m if after else item.before_rms_m for item in known]
        sizes = [value for value in values if value is not None]
        return 100.0 * float(np.mean(sizes)) if sizes else None


def rows_of(done: Sequence[Done]) -> list[Row]:
    """Rows whose runs were made, in the order of sweeps."""
    found: dict[tuple[str, str], list[RunFigures]] = {}
    for member in sorted(done, key=lambda item: item.member.number):
        figures: Mapping[str, RunFigures] = member.figures
        for variant, item in figures.items():
            found.setdefault((member.member.label, variant), []).append(item)
    return [
        Row(sweep, setting, variant, tuple(found[setting.member, variant]))
        for sweep in SWEEPS
        for setting in sweep.settings
        for variant in setting.runs
        if (setting.member, variant) in found
    ]
