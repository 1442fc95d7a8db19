"""The one door to Rerun: whole columns on the `gps_time` timeline, in strict mode.

Per-row logging costs several hundred times as much (tools/bench/view.py), so
nothing here takes a row. Times are `datetime64[ns]`, because Rerun reads
integers as seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import rerun as rr

from replay.evaluate.outages import Span
from replay.time import to_datetime64
from replay.view.outages import inside
from replay.view.palette import OUTAGE, TRUTH, Rgb
from replay.view.panels import Curve, Panel, Shape

TIMELINE: Final = "gps_time"
ROWS_PER_CHUNK: Final = 65_536  # what the viewer's own compaction aims at

Times = npt.NDArray[np.int64]
ColumnsOfRows = Callable[[slice], Iterable[rr.ComponentColumn]]


def radius(points: float) -> float:
    """A radius in points of the screen, which Rerun writes as a negative number."""
    return -points


def entity(path: str) -> str:
    """Path with what a person chose (names of runs and receivers) escaped part by part."""
    return "/".join(rr.escape_entity_path_part(part) for part in path.split("/"))


class Sink:
    """A recording that takes columns and static values.

    Parameters
    ----------
    recording : rerun.RecordingStream
        Its automatic timelines are switched off.
    """

    def __init__(self, recording: rr.RecordingStream) -> None:
        self.recording = recording
        rr.set_log_time_enabled(False, recording=recording)
        rr.set_log_tick_enabled(False, recording=recording)

    def static(self, path: str, *values: rr.AsComponents) -> None:
        """Values that hold at all times."""
        self.recording.log(entity(path), *values, static=True, strict=True)

    def columns(self, path: str, times_ns: Times, make: ColumnsOfRows) -> None:
        """Rows of one entity.

        Parameters
        ----------
        path : str
        times_ns : int64 array (n,), GPS ns
        make : callable
            Gives the component columns of a slice of the rows.
        """
        for start in range(0, len(times_ns), ROWS_PER_CHUNK):
            rows = slice(start, min(start + ROWS_PER_CHUNK, len(times_ns)))
            index = rr.TimeColumn(TIMELINE, timestamp=to_datetime64(times_ns[rows]))
            self.recording.send_columns(entity(path), [index], make(rows), strict=True)

    def scalars(self, path: str, times_ns: Times, values: npt.NDArray[np.float64]) -> None:
        """Values (n,) or (n, k) of a plot."""
        width = 1 if values.ndim == 1 else values.shape[1]

        def make(rows: slice) -> Iterable[rr.ComponentColumn]:
            flat = np.ascontiguousarray(values[rows]).reshape(-1)
            column = rr.Scalars.columns(scalars=flat)
            return column if width == 1 else column.partition([width] * (len(flat) // width))

        self.columns(path, times_ns, make)

    def panel(self, panel: Panel, root: str, outages: Sequence[Span]) -> None:
        """All curves of a panel.

        Parameters
        ----------
        panel : Panel
        root : str
            Path that the panel's key is put under.
        outages : sequence of Span
            Where curves that ask for it are drawn again in red.
        """
        for curve in panel.curves:
            path = f"{root}/{panel.key}/{curve.key}"
            self.scalars(path, curve.times_ns, panel.linear(curve.values))
            self.static(path, _style(curve))
            if curve.outage_red:
                self._again_in_outages(path, curve, inside(curve.times_ns, outages))

    def _again_in_outages(self, path: str, curve: Curve, hit: npt.NDArray[np.bool_]) -> None:
        """The rows in outages once more, in red on top.

        Not a number ends each piece, so that no line joins one outage to the next.
        """
        rows = np.flatnonzero(hit)
        if len(rows) == 0:
            return
        ends = np.append(np.flatnonzero(np.diff(rows) > 1), len(rows) - 1) + 1
        times = np.insert(curve.times_ns[rows], ends, curve.times_ns[rows[ends - 1]] + 1)
        values = np.insert(curve.values[rows], ends, np.nan)
        self.scalars(f"{path}_in_outage", times, values)
        style = rr.SeriesLines(names=f"{curve.label}, outage", colors=rgba(OUTAGE.dark), widths=2.2)
        self.static(f"{path}_in_outage", style)


def rgba(*colors: Rgb, alpha: int = 255) -> npt.NDArray[np.uint32]:
    """Colours as numbers 0xRRGGBBAA."""
    return np.asarray([r << 24 | g << 16 | b << 8 | alpha for r, g, b in colors], dtype=np.uint32)


def _style(curve: Curve) -> rr.AsComponents:
    color = rgba(curve.ink.dark)
    if curve.shape is Shape.BAND:
        return rr.SeriesLines(
            names=[f"{curve.label} lower", f"{curve.label} upper"],
            colors=np.repeat(color, 2),
            widths=[1.0, 1.0],
        )
    if curve.shape is Shape.LINE:
        width = 0.8 if curve.ink is TRUTH else 2.0  # a thin truth shows within a wide solution
        return rr.SeriesLines(names=curve.label, colors=color, widths=width)
    crosses = curve.shape is Shape.CROSSES
    return rr.SeriesPoints(
        names=curve.label,
        colors=color,
        markers=rr.components.MarkerShape.Cross if crosses else rr.components.MarkerShape.Circle,
        marker_sizes=5.0 if crosses else 1.8,
    )
