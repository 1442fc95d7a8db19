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
from replay.log.columns import Columns, concatenate
from replay.view.outages import find_outages
from replay.view.uncertainty import Sigmas, join_sigmas, sigmas_of

Batches = Iterable[Mapping[str, Columns]]
ImuConsumer = Callable[[Columns], None]

KEPT = (
    channels.GNSS_FIX,
    channels.GNSS_OBS,
    channels.TRUTH,
    channels.FILTER_STATE,
    channels.FILTER_INNOVATIONS,
    channels.FILTER_EVENTS,
    channels.SOLUTION,
)


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


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunData:
    """A run log as the views need it; every channel in the order of valid time.

    Attributes
    ----------
    truth : Columns or None
    fixes, observations : mapping of receiver to Columns
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

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last valid time of all channels; None for an empty log."""
        if not self.stats:
            return None
        values = self.stats.values()
        return min(s.first_ns for s in values), max(s.last_ns for s in values)


def gather(
    batches: Batches,
    metadata: Mapping[str, Mapping[str, str]],
    *,
    on_imu: ImuConsumer | None = None,
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
    return RunData(
        truth=whole.get(channels.TRUTH.topic),
        fixes=fixes,
        observations=_by_part(whole, channels.GNSS_OBS, "receiver"),
        runs=runs,
        stats={topic: stats[topic] for topic in sorted(stats)},
        outages=find_outages(
            metadata, (fix.valid_time_ns for fix in fixes.values()), max(ends, default=None)
        ),
        metadata=metadata,
    )


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
    solutions = _by_part(whole, channels.SOLUTION, "run")
    states = _by_part(whole, channels.FILTER_STATE, "run")
    innovations = _by_part(whole, channels.FILTER_INNOVATIONS, "run")
    events = _by_part(whole, channels.FILTER_EVENTS, "run")
    names = sorted({*solutions, *states, *innovations, *events, *sigmas})
    return tuple(
        Run(
            name,
            solutions.get(name),
            states.get(name),
            sigmas.get(name),
            innovations.get(name),
            events.get(name),
        )
        for name in names
    )
