"""A run with or without a network of reference stations, from its log to its figures."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from replay import channels
from replay.engine.manifest import MANIFEST, read_manifest
from replay.errors import MissingChannelError
from replay.evaluate.errors_enu import Errors, attitude_errors, of_antenna, position_errors
from replay.evaluate.network import (
    Closure,
    EpochIntegers,
    IntegerTruth,
    LaneIntegers,
    baseline_integers,
    closures,
    epoch_integers,
)
from replay.evaluate.network_residuals import (
    DoubleResiduals,
    Observed,
    ResidualFigures,
    residual_figures,
    rover_residuals,
)
from replay.evaluate.read import Metadata, RunChannels, own_run, read_channels, run_names
from replay.evaluate.status import updated
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.time import NS_PER_S

SETTLING_S: Final = 120.0
_CM: Final = 100.0
_ARC_MINUTES: Final = float(np.degrees(1.0) * 60.0)
_NORTHWARD: Final = (("north", 1), ("east", 0), ("height", 2))
_ANGLES: Final = (("heading", 2), ("pitch", 1), ("roll", 0))


class MeanStd(msgspec.Struct, frozen=True):
    """Mean and standard deviation about it, in the unit of the group."""

    mean: float
    std: float


class StationFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Integers between reference stations.

    Attributes
    ----------
    baselines : dict of dict of LaneIntegers
        By baseline and signal.
    closures : tuple of Closure
        Of every triangle of the baselines.
    """

    baselines: dict[str, dict[str, LaneIntegers]]
    closures: tuple[Closure, ...]


class NetworkFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of one run.

    Attributes
    ----------
    run : str
    since_s, until_s : float, s
        Span that the figures are of, from the first solution of the log.
    settling_s : float, s
        Of it, how long after the first row with attitude (or the first row of all) it begins.
    rows : int
        Epochs of GNSS in the span whose error is known.
    position_cm : dict of MeanStd
        "north", "east", "height".
    attitude_arcmin : dict of MeanStd
        "heading", "pitch", "roll"; empty where the run has no attitude.
    epochs : EpochIntegers or None
    stations : StationFigures or None
        None where the run has no network.
    residuals : dict of ResidualFigures
        By signal.
    """

    run: str
    since_s: float
    until_s: float
    settling_s: float
    rows: int
    position_cm: dict[str, MeanStd]
    attitude_arcmin: dict[str, MeanStd]
    epochs: EpochIntegers | None = None
    stations: StationFigures | None = None
    residuals: dict[str, ResidualFigures] = {}


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class NetworkRun:
    """Channels of one run.

    Attributes
    ----------
    data : RunChannels
        Solution, truth and what else evaluations read.
    ambiguities : Columns of replay.DoubleDifferenceAmbiguity, or None
    integers, residuals, errors : mapping of baseline to Columns
        Ambiguities, residuals and filtered errors between reference stations.
    corrections : Columns of replay.NetworkCorrection, or None
        Of the rover.
    signal_truth : mapping of receiver to Columns of replay.SignalTruth
    observed : mapping of receiver to Observed
        Those receivers of which everything is known.
    stations : mapping of receiver to float64 array (3,), m
        ECEF positions that the receivers state.
    rover, master : str
    """

    data: RunChannels
    ambiguities: Columns | None
    integers: Mapping[str, Columns]
    residuals: Mapping[str, Columns]
    errors: Mapping[str, Columns]
    corrections: Columns | None
    signal_truth: Mapping[str, Columns]
    observed: Mapping[str, Observed]
    stations: Mapping[str, np.ndarray[tuple[int], np.dtype[np.float64]]]
    rover: str
    master: str

    @property
    def truth(self) -> IntegerTruth | None:
        """True integers of rover less master."""
        return _pair_truth(self.signal_truth, self.rover, self.master)


def read_network_run(
    run_log: Path, *, rover: str = "", master: str = "", run: str | None = None
) -> NetworkRun:
    """Channels of a run in a log.

    Parameters
    ----------
    run_log : Path
    rover, master : str
        Names of receivers; empty for those of the run's configuration.
    run : str, optional
        Its name; may be left out where the log has one, or one of its manifest's name.

    Raises
    ------
    MissingChannelError
        Where the log has no solution or no truth.
    """
    with LogReader(run_log) as reader:
        metadata = {key: dict(values) for key, values in reader.metadata.items()}
        configured = _configuration(metadata, str(run_log))
        receivers = configured.get("gnss", {})
        rover = rover or str(receivers.get("receiver", "")) or "rover"
        master = master or str(receivers.get("base", "")) or "base"
        known = run_names(list(reader.channels))
        name = run or (known[0] if len(known) == 1 else own_run(metadata))
        if name not in known or channels.TRUTH.topic not in reader.channels:
            raise MissingChannelError(
                f"the log has no truth, or no solution of {name or 'a run'}",
                where=str(run_log),
                mend=f"it has solutions of {', '.join(known) or 'none'}",
            )
        found = read_channels(
            reader,
            (
                channels.SOLUTION.at(run=name),
                channels.TRUTH.topic,
                channels.FILTER_RESOLUTION.at(run=name),
                channels.FILTER_AMBIGUITIES.at(run=name),
                channels.NETWORK_CORRECTIONS.at(rover=rover),
                *(channels.GNSS_OBS.at(receiver=side) for side in (rover, master)),
                *(channels.CORRECTIONS.at(receiver=side) for side in (rover, master)),
            ),
            (
                channels.NETWORK_AMBIGUITIES,
                channels.NETWORK_RESIDUALS,
                channels.NETWORK_ERRORS,
                channels.SIGNAL_TRUTH,
                channels.RECEIVER,
            ),
        )
    truth = _by_part(found, channels.SIGNAL_TRUTH, "receiver")
    observed: dict[str, Observed] = {}
    for side in (rover, master):
        observations = found.get(channels.GNSS_OBS.at(receiver=side))
        corrections = found.get(channels.CORRECTIONS.at(receiver=side))
        if observations is not None and corrections is not None and side in truth:
            observed[side] = Observed(observations, corrections, truth[side])
    stations = {
        station: info["approximate_position_ecef_m"][0].astype(np.float64)
        for station, info in _by_part(found, channels.RECEIVER, "receiver").items()
        if len(info) and bool(info.is_present("approximate_position_ecef_m")[0])
    }
    arm = configured.get("antenna", {}).get("lever_arm")
    return NetworkRun(
        data=RunChannels(
            run=name,
            solution=found[channels.SOLUTION.at(run=name)],
            truth=found[channels.TRUTH.topic],
            resolution=found.get(channels.FILTER_RESOLUTION.at(run=name)),
            antenna_arm_m=np.array(arm, dtype=np.float64) if arm else None,
            metadata=metadata,
        ),
        ambiguities=found.get(channels.FILTER_AMBIGUITIES.at(run=name)),
        integers=_by_part(found, channels.NETWORK_AMBIGUITIES, "baseline"),
        residuals=_by_part(found, channels.NETWORK_RESIDUALS, "baseline"),
        errors=_by_part(found, channels.NETWORK_ERRORS, "baseline"),
        corrections=found.get(channels.NETWORK_CORRECTIONS.at(rover=rover)),
        signal_truth=truth,
        observed=observed,
        stations={station: place for station, place in stations.items() if station != rover},
        rover=rover,
        master=master,
    )


def _configuration(metadata: Metadata, where: str) -> dict[str, Any]:
    """The configuration in a run's manifest; empty where there is none."""
    if MANIFEST not in metadata:
        return {}
    return tomllib.loads(read_manifest(metadata, where).configuration)


def _by_part(
    found: Mapping[str, Columns], spec: channels.ChannelSpec, part: str
) -> dict[str, Columns]:
    return {spec.parts(t)[part]: columns for t, columns in found.items() if spec.matches(t)}


def network_figures(run: NetworkRun, *, settling_s: float = SETTLING_S) -> NetworkFigures:
    """Figures of a run.

    Parameters
    ----------
    run : NetworkRun
    settling_s : float, s
        Left out at the beginning, from the first row with attitude.

    Raises
    ------
    MissingChannelError
        Where the solution ends before the settling does.
    """
    solution = ordered(run.data.solution)
    since_ns = settled_ns(solution, settling_s)
    if len(solution) == 0 or int(solution.valid_time_ns[-1]) < since_ns:
        raise MissingChannelError(
            f"the run {run.data.run} has no solution {settling_s:g} s after its alignment",
            mend="look at the run's events; a shorter log needs a shorter settling",
        )
    position, attitude = solution_errors(run, since_ns)
    start_ns = int(solution.valid_time_ns[0])
    resolution = run.data.resolution
    return NetworkFigures(
        run=run.data.run,
        since_s=(since_ns - start_ns) / NS_PER_S,
        until_s=(int(solution.valid_time_ns[-1]) - start_ns) / NS_PER_S,
        settling_s=settling_s,
        rows=len(position),
        position_cm=_columns(position, _NORTHWARD, _CM),
        attitude_arcmin=_columns(attitude, _ANGLES, _ARC_MINUTES),
        epochs=(
            epoch_integers(
                resolution, run.ambiguities, run.truth, position=position, since_ns=since_ns
            )
            if resolution is not None
            else None
        ),
        stations=station_figures(run.integers, run.signal_truth) if run.integers else None,
        residuals=_since(run, since_ns),
    )


def read_stations(run_log: Path) -> StationFigures:
    """Figures of the stations of a log, which needs no rover."""
    with LogReader(run_log) as reader:
        kinds = (channels.NETWORK_AMBIGUITIES, channels.SIGNAL_TRUTH)
        found = read_channels(reader, (), kinds)
    return station_figures(
        _by_part(found, channels.NETWORK_AMBIGUITIES, "baseline"),
        _by_part(found, channels.SIGNAL_TRUTH, "receiver"),
    )


def station_figures(
    integers: Mapping[str, Columns], signal_truth: Mapping[str, Columns]
) -> StationFigures:
    """Figures of the integers of baselines "MASTER-STATION" between reference stations."""
    found: dict[str, dict[str, LaneIntegers]] = {}
    for name, rows in integers.items():
        master, _, station = name.partition("-")
        found[name] = baseline_integers(rows, _pair_truth(signal_truth, station, master))
    return StationFigures(baselines=found, closures=closures(integers))


def _pair_truth(known: Mapping[str, Columns], station: str, master: str) -> IntegerTruth | None:
    """True integers of a pair of receivers; None where the log has none of both."""
    if station in known and master in known:
        return IntegerTruth(known[station], known[master])
    return None


def _since(run: NetworkRun, since_ns: int) -> dict[str, ResidualFigures]:
    residuals = double_residuals(run)
    if residuals is None:
        return {}
    keep = residuals.times_ns >= since_ns
    return residual_figures(
        DoubleResiduals(*(getattr(residuals, f.name)[keep] for f in dataclasses.fields(residuals)))
    )


def double_residuals(run: NetworkRun) -> DoubleResiduals | None:
    """Rover's true double-difference residuals; None where the log does not tell them."""
    rover, master = run.observed.get(run.rover), run.observed.get(run.master)
    if rover is None or master is None:
        return None
    if run.corrections is not None and len(run.corrections):
        return rover_residuals(rover, master, run.corrections)
    if run.ambiguities is not None and len(run.ambiguities):
        return rover_residuals(rover, master, run.ambiguities, corrected=False)
    return None


def ordered(solution: Columns) -> Columns:
    """Rows in the order of time; rows of one time keep theirs."""
    return solution.take(np.argsort(solution.valid_time_ns, kind="stable"))


def settled_ns(solution: Columns, settling_s: float = SETTLING_S) -> int:
    """GPS ns from which a run counts: some time after its first row with attitude."""
    times = solution.valid_time_ns[~of_antenna(solution)]
    if len(times) == 0:
        times = solution.valid_time_ns
    return (int(times[0]) if len(times) else 0) + round(settling_s * NS_PER_S)


def solution_errors(run: NetworkRun, since_ns: int) -> tuple[Errors, Errors]:
    """Errors of position (east, north, up) [m] and attitude (roll, pitch, heading) [rad].

    At the epochs of GNSS from `since_ns` on.
    """
    solution = ordered(run.data.solution)
    keep = updated(solution) & (solution.valid_time_ns >= since_ns)
    position = position_errors(solution, run.data.truth, antenna_arm_m=run.data.antenna_arm_m)
    attitude = attitude_errors(solution, run.data.truth)
    return position.take(keep[position.rows]), attitude.take(keep[attitude.rows])


def _columns(
    errors: Errors, names: tuple[tuple[str, int], ...], factor: float
) -> dict[str, MeanStd]:
    if len(errors) == 0:
        return {}
    values = errors.values * factor
    return {
        name: MeanStd(float(np.mean(values[:, i])), float(np.std(values[:, i])))
        for name, i in names
    }
