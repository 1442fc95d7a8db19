"""One pass over a log: what the views need, and no more.

Inertial samples go through to whoever draws them, covariances are cut down to
standard deviations and payload bytes are dropped, so that an hour at 200 Hz
with 60 states stays within some hundred megabytes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping

import numpy as np
import numpy.typing as npt

from replay import channels
from replay.evaluate.outages import Span
from replay.evaluate.station import Reference, reference_rows
from replay.evaluate.status import updated
from replay.log.columns import Columns, concatenate
from replay.view.outages import find_outages
from replay.view.uncertainty import Sigmas, join_sigmas, sigmas_of

Batches = Iterable[Mapping[str, Columns]]
ImuConsumer = Callable[[Columns], None]

KEPT = (
    channels.GNSS_FIX,
    channels.GNSS_OBS,
    channels.TRUTH,
    channels.SATELLITES,
    channels.CORRECTIONS,
    channels.GNSS_EVENTS,
    channels.SLIPS,
    channels.DISPLACEMENT,
    channels.RECEIVER,
    channels.NETWORK_RESIDUALS,
    channels.NETWORK_ERRORS,
    channels.NETWORK_CORRECTIONS,
    channels.FILTER_STATE,
    channels.FILTER_INNOVATIONS,
    channels.FILTER_CLOCKS,
    channels.FILTER_GEOMETRY,
    channels.FILTER_TROPOSPHERE,
    channels.FILTER_IONOSPHERE,
    channels.FILTER_BIASES,
    channels.FILTER_PHASES,
    channels.FILTER_AMBIGUITIES,
    channels.FILTER_RESOLUTION,
    channels.FILTER_EVENTS,
    channels.SOLUTION,
)


_OF_RUNS = (channels.SOLUTION, channels.FILTER_GEOMETRY, channels.FILTER_CLOCKS)


@dataclasses.dataclass(slots=True)
class ChannelStats:
    """What passed on one channel.

    Attributes
    ----------
    count : int
        Rows.
    first_ns, last_ns : int, GPS ns
        Earliest and latest valid time.
    """

    count: int = 0
    first_ns: int = 0
    last_ns: int = 0

    def add(self, times_ns: npt.NDArray[np.int64]) -> None:
        """Count the rows of one batch."""
        first, last = int(times_ns.min()), int(times_ns.max())
        self.first_ns = min(self.first_ns, first) if self.count else first
        self.last_ns = max(self.last_ns, last) if self.count else last
        self.count += len(times_ns)

    @property
    def rate_hz(self) -> float | None:
        """Mean rate; None for fewer than two rows or rows of a single time."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / span_ns if span_ns > 0 else None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Channels of one run; None for a channel that is missing or empty."""

    name: str
    solution: Columns | None = None
    state: Columns | None = None
    sigmas: Sigmas | None = None
    innovations: Columns | None = None
    events: Columns | None = None
    clocks: Columns | None = None
    geometry: Columns | None = None
    ambiguities: Columns | None = None
    resolution: Columns | None = None
    troposphere: Columns | None = None
    ionosphere: Columns | None = None
    biases: Columns | None = None
    phases: Columns | None = None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunData:
    """A run log as the views need it; every channel in the order of valid time.

    Attributes
    ----------
    truth : Columns or None
    fixes, observations : mapping of receiver to Columns
    satellites, corrections, slips, displacements, gnss_events : mapping of receiver to Columns
        What stages said of a receiver's satellites.
    receivers : mapping of receiver to Columns
        What is stated of receivers.
    network_residuals, network_errors : mapping of baseline to Columns
        Between reference stations, as found and as filtered.
    network_corrections : mapping of rover to Columns
    runs : tuple of Run
        In the order of their names.
    stats : mapping of topic to ChannelStats
        Every topic that had rows, in the order of topics.
    outages : tuple of Span
    metadata : mapping
        Metadata records of the log.
    """

    truth: Columns | None
    fixes: Mapping[str, Columns]
    observations: Mapping[str, Columns]
    runs: tuple[Run, ...]
    stats: Mapping[str, ChannelStats]
    outages: tuple[Span, ...]
    metadata: Mapping[str, Mapping[str, str]]
    satellites: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    corrections: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    slips: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    displacements: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    gnss_events: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    receivers: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    network_residuals: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    network_errors: Mapping[str, Columns] = dataclasses.field(default_factory=dict)
    network_corrections: Mapping[str, Columns] = dataclasses.field(default_factory=dict)

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last valid time to show; None for an empty log.

        Of all channels, but of a run over observations that of the runs: orbits and a base
        may begin long before.
        """
        if not self.stats:
            return None
        over_observations = any(run.geometry is not None for run in self.runs)
        values = [
            stats
            for topic, stats in self.stats.items()
            if not over_observations or channels.find(topic) in _OF_RUNS
        ]
        return min(s.first_ns for s in values), max(s.last_ns for s in values)


def gather(
    batches: Batches,
    metadata: Mapping[str, Mapping[str, str]],
    *,
    on_imu: ImuConsumer | None = None,
    reference: Reference | None = None,
) -> RunData:
    """Read batches to their end.

    Parameters
    ----------
    batches : iterable of mapping of topic to Columns
        Topics that this package does not know are counted and passed over.
    metadata : mapping
        Metadata records of the log.
    on_imu : callable or None
        Gets each batch of inertial samples as it comes.
    reference : "mean", or tuple of 3 float (m, ECEF), or None
        Where the receiver stands still, instead of the log's truth; "mean": of the first run.

    Returns
    -------
    RunData
    """
    stats: dict[str, ChannelStats] = {}
    parts: dict[str, list[Columns]] = {}
    sigmas: dict[str, list[Sigmas]] = {}
    for batch in batches:
        for topic, columns in batch.items():
            if len(columns) == 0:
                continue
            stats.setdefault(topic, ChannelStats()).add(columns.valid_time_ns)
            if not columns.values:  # not decoded: of another schema than the topic promises
                continue
            spec = channels.find(topic)
            if spec is channels.IMU and on_imu is not None:
                on_imu(columns)
            elif spec is channels.FILTER_COVARIANCE:
                sigmas.setdefault(spec.parts(topic)["run"], []).append(sigmas_of(columns))
            elif spec in KEPT:
                parts.setdefault(topic, []).append(dataclasses.replace(columns, payloads=None))
    whole = {topic: _in_order(concatenate(parts[topic])) for topic in sorted(parts)}
    fixes = _by_part(whole, channels.GNSS_FIX, "receiver")
    runs = _runs(whole, {name: join_sigmas(sigmas[name]) for name in sorted(sigmas)})
    ends = [int(r.solution.valid_time_ns[-1]) for r in runs if r.solution is not None]
    solutions = [run.solution for run in runs if run.solution is not None]
    given = None if reference is None or not solutions else reference_rows(solutions[0], reference)
    return RunData(
        truth=whole.get(channels.TRUTH.topic) if given is None else given,
        fixes=fixes,
        observations=_by_part(whole, channels.GNSS_OBS, "receiver"),
        runs=runs,
        stats={topic: stats[topic] for topic in sorted(stats)},
        outages=find_outages(metadata, _position_times(fixes, runs), max(ends, default=None)),
        metadata=metadata,
        satellites=_by_part(whole, channels.SATELLITES, "receiver"),
        corrections=_by_part(whole, channels.CORRECTIONS, "receiver"),
        slips=_by_part(whole, channels.SLIPS, "receiver"),
        displacements=_by_part(whole, channels.DISPLACEMENT, "receiver"),
        gnss_events=_by_part(whole, channels.GNSS_EVENTS, "receiver"),
        receivers=_by_part(whole, channels.RECEIVER, "receiver"),
        network_residuals=_by_part(whole, channels.NETWORK_RESIDUALS, "baseline"),
        network_errors=_by_part(whole, channels.NETWORK_ERRORS, "baseline"),
        network_corrections=_by_part(whole, channels.NETWORK_CORRECTIONS, "rover"),
    )


def _position_times(
    fixes: Mapping[str, Columns], runs: Iterable[Run]
) -> list[npt.NDArray[np.int64]]:
    """Times of positions: those of fixes, else the updated rows of runs over observations."""
    if fixes:
        return [fix.valid_time_ns for fix in fixes.values()]
    return [
        run.solution.valid_time_ns[updated(run.solution)]
        for run in runs
        if run.solution is not None and run.geometry is not None
    ]


def _in_order(columns: Columns) -> Columns:
    times = columns.valid_time_ns
    if bool((times[1:] >= times[:-1]).all()):
        return columns
    return columns.take(np.argsort(times, kind="stable"))


def _by_part(
    whole: Mapping[str, Columns], spec: channels.ChannelSpec, part: str
) -> dict[str, Columns]:
    return {
        spec.parts(topic)[part]: columns for topic, columns in whole.items() if spec.matches(topic)
    }


def _runs(whole: Mapping[str, Columns], sigmas: Mapping[str, Sigmas]) -> tuple[Run, ...]:
    of = {
        field: _by_part(whole, spec, "run")
        for field, spec in (
            ("solution", channels.SOLUTION),
            ("state", channels.FILTER_STATE),
            ("innovations", channels.FILTER_INNOVATIONS),
            ("events", channels.FILTER_EVENTS),
            ("clocks", channels.FILTER_CLOCKS),
            ("geometry", channels.FILTER_GEOMETRY),
            ("ambiguities", channels.FILTER_AMBIGUITIES),
            ("resolution", channels.FILTER_RESOLUTION),
            ("troposphere", channels.FILTER_TROPOSPHERE),
            ("ionosphere", channels.FILTER_IONOSPHERE),
            ("biases", channels.FILTER_BIASES),
            ("phases", channels.FILTER_PHASES),
        )
    }
    names = sorted({name for found in of.values() for name in found} | set(sigmas))
    return tuple(
        Run(
            name,
            sigmas=sigmas.get(name),
            **{field: found[name] for field, found in of.items() if name in found},
        )
        for name in names
    )
