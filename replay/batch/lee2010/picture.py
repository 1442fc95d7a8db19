"""What the figures of the study draw of one run; small, as it comes from another process."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np

from replay.evaluate.errors_enu import Errors
from replay.evaluate.geometry import Floats
from replay.evaluate.network_residuals import DoubleResiduals
from replay.evaluate.network_run import (
    NetworkRun,
    double_residuals,
    ordered,
    settled_ns,
    solution_errors,
)
from replay.evaluate.read import Metadata
from replay.evaluate.signal_table import labels
from replay.log.columns import Columns
from replay.view.network_charts import Track
from replay.view.network_panels import satellites_of

# The satellite of the paper's figures 5 and 6.
_FAVOURITE: Final = "G08"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """Errors between two stations: one satellite's.

    Attributes
    ----------
    baseline, satellite : str
    errors, residuals : Columns of replay.NetworkError, of replay.NetworkResidual
    """

    baseline: str
    satellite: str
    errors: Columns
    residuals: Columns


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunPicture:
    """What is drawn of one run.

    Attributes
    ----------
    solution : Columns of replay.Solution
        In the order of time.
    track : Track
        True path, thinned for paper, without a name.
    differences : Errors
        Of position, east, north, up [m], at the epochs of GNSS of the tables' span.
    satellites : list of str
        Those of the channels of the network and of the ambiguities.
    filtered : Filtered or None
        Of the first baseline.
    corrections : Columns of replay.NetworkCorrection, or None
    residuals : DoubleResiduals or None
        Of the rover.
    stations : dict of str to float64 array (3,), m
        ECEF, the master first.
    metadata : mapping
        Of the run's log.
    """

    solution: Columns
    track: Track
    differences: Errors
    satellites: list[str]
    filtered: Filtered | None
    corrections: Columns | None
    residuals: DoubleResiduals | None
    stations: dict[str, Floats]
    metadata: Metadata


def picture_of(run: NetworkRun) -> RunPicture:
    """What is drawn of a run."""
    solution = ordered(run.data.solution)
    known = [*run.errors.values()]
    known += [c for c in (run.corrections, run.ambiguities) if c is not None]
    names = sorted(run.stations, key=lambda name: (name != run.master, name))
    return RunPicture(
        solution=solution,
        track=Track.of("", run.data.truth),
        differences=solution_errors(run, settled_ns(solution))[0],
        satellites=satellites_of(*known),
        filtered=_filtered(run),
        corrections=run.corrections,
        residuals=double_residuals(run),
        stations={name: run.stations[name] for name in names},
        metadata=run.data.metadata,
    )


def _filtered(run: NetworkRun) -> Filtered | None:
    baseline = next((name for name in run.errors if name in run.residuals), None)
    if baseline is None:
        return None
    errors, residuals = run.errors[baseline], run.residuals[baseline]
    satellite = _chosen_satellite(errors)
    chosen = (c.take(labels(c, "satellite") == satellite.encode()) for c in (errors, residuals))
    return Filtered(baseline, satellite, *chosen)


def _chosen_satellite(errors: Columns) -> str:
    """The paper's where it is seen for half of the time, else the one seen longest."""
    names, counts = np.unique(labels(errors, "satellite"), return_counts=True)
    seen = {name.decode(): int(n) for name, n in zip(names.tolist(), counts, strict=True)}
    longest = max(seen, key=lambda name: (seen[name], name))
    return _FAVOURITE if 2 * seen.get(_FAVOURITE, 0) >= seen[longest] else longest
