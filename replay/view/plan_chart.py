"""The trajectory seen from above, with its outages, on paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replay.evaluate.geometry import Floats
from replay.evaluate.outages import Span
from replay.log.columns import Columns
from replay.view.charts import Chart, draw
from replay.view.fields import doubles
from replay.view.frame import LocalFrame
from replay.view.gather import RunData
from replay.view.outages import inside
from replay.view.palette import OUTAGE, TRUTH, Ink, receiver_ink, run_ink
from replay.view.sink import Times
from replay.view.thinning import dot_stride

_MOST_POINTS: Final = 2000
_MOST_FIXES: Final = 1000
_Position = tuple[str, Ink, Floats, Times]


def plan_chart(data: RunData) -> Chart | None:
    """Plan in a local frame; None where the log has no position."""
    truth, fixes, runs = _positions(data)
    all_points = [ecef for _, _, ecef, _ in [*truth, *fixes, *runs]]
    if not all_points:
        return None
    frame = LocalFrame.at(all_points[0][0])
    notes: list[str] = []

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        for label, ink, ecef, _ in fixes:
            stride = dot_stride(len(ecef), _MOST_FIXES)
            if stride > 1:
                notes.append(f"Of the fixes of {label} every {stride}th is drawn.")
            east, north, _ = frame.enu(ecef[::stride]).T
            ax.plot(east, north, "o", color=ink.hexadecimal, markersize=5.0, alpha=0.5,
                    markeredgewidth=0.0, label=label)  # fmt: skip
        for label, ink, ecef, _ in truth:
            _line(ax, frame.enu(ecef), ink, label, 2.6, 0.4, notes)
        for label, ink, ecef, times in runs:
            enu = frame.enu(ecef)
            _line(ax, enu, ink, label, 1.0, 1.0, notes)
            _outages(ax, enu, times, data.outages)
        _ends(ax, frame.enu((runs or truth or fixes)[0][2]))
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_xlabel("east [m]")
        ax.set_ylabel("north [m]")
        ax.margins(0.05)
        figure.legend(loc="outside upper left", ncols=6, handlelength=1.4)

    svg = draw(5.4, "plan", paint)
    latitude, longitude, height = frame.origin_geodetic
    caption = (
        f"Plan in local east and north, equal scales. Origin: latitude {latitude:.8f}°, "
        f"longitude {longitude:.8f}°, height {height:.2f} m. Outages are red and numbered."
    )
    return Chart(svg, " ".join([caption, *dict.fromkeys(notes)]))


def _positions(data: RunData) -> tuple[list[_Position], list[_Position], list[_Position]]:
    def of(label: str, ink: Ink, columns: Columns) -> list[_Position]:
        ecef = doubles(columns, "position_ecef_m")
        finite = np.isfinite(ecef).all(axis=1)
        if not finite.any():
            return []
        return [(label, ink, ecef[finite], columns.valid_time_ns[finite])]

    truth = of("truth", TRUTH, data.truth) if data.truth is not None else []
    fixes = [
        item
        for index, (name, fix) in enumerate(data.fixes.items())
        for item in of(f"GNSS {name}", receiver_ink(index), fix)
    ]
    runs = [
        item
        for index, run in enumerate(data.runs)
        if run.solution is not None
        for item in of(run.name, run_ink(index), run.solution)
    ]
    return truth, fixes, runs


def _line(
    ax: Axes, enu: Floats, ink: Ink, label: str, width: float, alpha: float, notes: list[str]
) -> None:
    stride = dot_stride(len(enu), _MOST_POINTS)
    if stride > 1:
        notes.append(f"The path of {label} has every {stride}th point.")
    rows = np.unique(np.append(np.arange(0, len(enu), stride), len(enu) - 1))
    ax.plot(enu[rows, 0], enu[rows, 1], color=ink.hexadecimal, linewidth=width, alpha=alpha,
            label=label)  # fmt: skip


def _outages(ax: Axes, enu: Floats, times: Times, outages: Sequence[Span]) -> None:
    for number, outage in enumerate(outages, start=1):
        rows = np.flatnonzero(inside(times, [outage]))
        if len(rows) == 0:
            continue
        drawn = rows[:: dot_stride(len(rows), _MOST_POINTS)]
        named = "outage" not in ax.get_legend_handles_labels()[1]
        ax.plot(enu[drawn, 0], enu[drawn, 1], color=OUTAGE.hexadecimal, linewidth=2.2,
                label="outage" if named else None)  # fmt: skip
        middle = enu[rows[len(rows) // 2]]
        ax.annotate(
            str(number), (middle[0], middle[1]), xytext=(7, 7), textcoords="offset points",
            color=OUTAGE.hexadecimal, fontsize=9, fontweight="bold",
        )  # fmt: skip


def _ends(ax: Axes, enu: Floats) -> None:
    for point, marker, label in ((enu[0], "o", "start"), (enu[-1], "s", "end")):
        ax.plot(point[0], point[1], marker, color="#222222", markerfacecolor="white",
                markersize=6.0, markeredgewidth=1.2, label=label)  # fmt: skip
