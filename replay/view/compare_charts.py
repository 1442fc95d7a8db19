"""Charts of a comparison that are no plots over time: distribution, plan, scenes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from replay.evaluate.compare import Method
from replay.evaluate.errors_enu import Errors
from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.time import NS_PER_S, seconds_between
from replay.view.charts import Chart, draw
from replay.view.compare_panels import span_of
from replay.view.fields import doubles
from replay.view.frame import LocalFrame
from replay.view.palette import TRUTH, Ink, run_ink
from replay.view.scenes import Stretch
from replay.view.thinning import dot_stride

_MOST_POINTS: Final = 2000
_MOST_STEPS: Final = 400  # of a distribution
_MARKED_POINTS: Final = 120  # of a scene: more epochs are a line anyway
_LEAST_M: Final = 1e-4
_PLAN_RATIO: Final = 1.9
_LEAST_HALF_M: Final = 6.0  # of a scene's window
_GAP_INTERVALS: Final = 3.0
_SCENE_COLUMNS: Final = 3


def distribution_chart(methods: Sequence[Method]) -> Chart | None:
    """Shares of epochs within a horizontal error, of position and of its change.

    None where no error is known.
    """
    if not any(len(m.position) for m in methods):
        return None

    def paint(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        _distribution(left, [(m.name, m.position, run_ink(i)) for i, m in enumerate(methods)])
        _distribution(right, [(m.name, m.change, run_ink(i)) for i, m in enumerate(methods)])
        left.set_title("Position")
        right.set_title("Change of position from epoch to epoch")
        left.set_ylabel("epochs within [%]")
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=6, handlelength=1.4)

    return Chart(
        draw(3.4, "distribution", paint),
        "Cumulative distributions of the horizontal error at each method's own epochs; dotted at"
        " 95 %. Epochs without a solution are not in them: see the availability.",
    )


def _distribution(ax: Axes, series: Sequence[tuple[str, Errors, Ink]]) -> None:
    for name, found, ink in series:
        errors = np.sort(np.hypot(found.values[:, 0], found.values[:, 1]))
        if len(errors):
            share = 100.0 * np.arange(1, len(errors) + 1) / len(errors)
            rows = np.unique(np.linspace(0, len(errors) - 1, _MOST_STEPS).astype(np.int64))
            ax.plot(np.maximum(errors[rows], _LEAST_M), share[rows], color=ink.hexadecimal,
                    linewidth=1.4, label=name)  # fmt: skip
    ax.axhline(95.0, color="#8a8f98", linewidth=0.7, linestyle=":")
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_ylim(0.0, 100.5)
    ax.set_xlabel("horizontal error [m]")


def overlay_chart(methods: Sequence[Method], scenes: Sequence[Stretch]) -> Chart:
    """Truth and all methods from above, with the scenes numbered."""
    frame = _frame(methods)

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        paths = [("truth", TRUTH, methods[0].data.truth)]
        paths += [(m.name, run_ink(i), m.data.solution) for i, m in enumerate(methods)]
        for name, ink, columns in paths:
            times, enu = _path(columns, frame)
            stride = dot_stride(len(enu), _MOST_POINTS)
            _line(ax, times[::stride], enu[::stride], ink, name, 1.0)
        truth_times, truth = _path(methods[0].data.truth, frame)
        for number, scene in enumerate(scenes, start=1):
            part = truth[(truth_times >= scene.start_ns) & (truth_times <= scene.end_ns)]
            if len(part):
                ax.annotate(
                    str(number), tuple(part[len(part) // 2, :2].tolist()), xytext=(12, 12),
                    textcoords="offset points", fontsize=9, fontweight="bold",
                    arrowprops={"arrowstyle": "-", "color": "#5b616b", "linewidth": 0.7},
                )  # fmt: skip
        _bound(ax, truth, 0.05, _PLAN_RATIO)
        ax.set_xlabel("east [m]")
        ax.set_ylabel("north [m]")
        figure.legend(loc="outside upper left", ncols=6, handlelength=1.4)

    latitude, longitude, height = frame.origin_geodetic
    return Chart(
        draw(5.4, "overlay", paint),
        f"Plan in local east and north, equal scales, as far as truth goes. Origin: latitude"
        f" {latitude:.8f}°, longitude {longitude:.8f}°, height {height:.2f} m. Numbers are the"
        " scenes below.",
    )


def scenes_chart(methods: Sequence[Method], scenes: Sequence[Stretch]) -> Chart | None:
    """A close plan of each scene; None where there is none."""
    if not scenes:
        return None
    frame = _frame(methods)
    columns = min(len(scenes), _SCENE_COLUMNS)
    lines = -(-len(scenes) // columns)
    start_ns, _ = span_of(methods)

    def paint(figure: Figure) -> None:
        axes = figure.subplots(lines, columns, squeeze=False)
        for ax in list(axes.flat)[len(scenes) :]:
            ax.set_visible(False)
        for number, (scene, ax) in enumerate(zip(scenes, axes.flat, strict=False), start=1):
            times, truth = _path(methods[0].data.truth, frame)
            rows = _within(times, scene)
            _line(ax, times[rows], truth[rows], TRUTH, "truth", 1.0)
            for i, m in enumerate(methods):
                times_m, enu = _path(m.data.solution, frame)
                part = _within(times_m, scene)
                marker = "." if len(part) <= _MARKED_POINTS else ""
                _line(ax, times_m[part], enu[part], run_ink(i), m.name, 1.0, marker)
            _bound(ax, truth[rows], 0.15, 1.0)
            begin, end = (
                float(seconds_between(t, start_ns)) for t in (scene.start_ns, scene.end_ns)
            )
            ax.set_title(f"{number} {scene.title}, {begin:.0f} to {end:.0f} s")
            ax.set_xlabel("east [m]")
        axes[0, 0].set_ylabel("north [m]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=6, handlelength=1.4)

    return Chart(
        draw(3.6 * lines + 0.3, "scenes", paint),
        "Scenes, in seconds as on the time axes, equal scales. What lies further from truth than"
        " the window is not shown.",
    )


def _frame(methods: Sequence[Method]) -> LocalFrame:
    positions = doubles(methods[0].data.truth, "position_ecef_m")
    return LocalFrame.at(positions[np.isfinite(positions).all(axis=1)][0])


def _path(columns: Columns, frame: LocalFrame) -> tuple[np.ndarray, Floats]:
    ecef = doubles(columns, "position_ecef_m")
    finite = np.isfinite(ecef).all(axis=1)
    return columns.valid_time_ns[finite], frame.enu(ecef[finite])


def _within(times: np.ndarray, scene: Stretch) -> np.ndarray:
    return np.flatnonzero((times >= scene.start_ns) & (times <= scene.end_ns))


def _line(
    ax: Axes, times: np.ndarray, enu: Floats, ink: Ink, label: str, width: float, marker: str = ""
) -> None:
    """A path, broken where epochs are missing."""
    steps = np.diff(times)
    if len(steps):
        limit = max(_GAP_INTERVALS * float(np.median(steps)), 1.5 * NS_PER_S)
        enu = np.insert(enu, np.flatnonzero(steps > limit) + 1, np.nan, axis=0)
    truth = ink is TRUTH
    ax.plot(enu[:, 0], enu[:, 1], color=ink.hexadecimal, linewidth=3.0 if truth else width,
            alpha=0.35 if truth else 1.0, marker="" if truth else marker, markersize=3.5,
            label=label)  # fmt: skip


def _bound(ax: Axes, enu: Floats, margin: float, ratio: float) -> None:
    """A window around points with equal scales, `ratio` times as wide as it is high."""
    ax.set_aspect("equal", adjustable="box")
    if len(enu) == 0:
        return
    low, high = enu[:, :2].min(axis=0), enu[:, :2].max(axis=0)
    centre = (low + high) / 2.0
    wide, tall = np.maximum((high - low) / 2.0 * (1.0 + 2.0 * margin), _LEAST_HALF_M)
    tall = max(tall, wide / ratio)
    ax.set_xlim(centre[0] - tall * ratio, centre[0] + tall * ratio)
    ax.set_ylim(centre[1] - tall, centre[1] + tall)
