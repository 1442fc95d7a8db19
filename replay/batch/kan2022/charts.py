"""Charts of the study that are no plots over the day: path, drifts, greatest drifts, pairs."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from replay.batch.kan2022 import published
from replay.batch.kan2022.claim import comparisons
from replay.batch.kan2022.figures import Shown, drift_curves, rate_ink
from replay.batch.kan2022.measure import PATH, POSITION
from replay.batch.kan2022.plan import DECIMATE, INTEGRATE
from replay.batch.kan2022.runs import Kind, Run, Runs, greatest_drifts_cm
from replay.evaluate.geometry import Floats, enu_axes, turn_back
from replay.evaluate.statistics import LOCAL_AXES
from replay.time import seconds_between
from replay.view.charts import Chart, draw
from replay.view.frame import LocalFrame
from replay.view.palette import BOUND, OUTAGE, TRUTH, run_ink

_WIDE: Final = 0.8  # of the bars of a rate together
_APART: Final = 50.0  # greatest to least, from which on an axis is logarithmic
_SOFT: Final = "#5b616b"


def path_ecef_m(run: Run) -> Floats:
    """True path (n, 3) at the epochs of a run, m, ECEF."""
    return np.column_stack([run.series[name] for name in PATH])


def solution_ecef_m(run: Run) -> Floats:
    """Solution's path (n, 3), m, ECEF: the true one and its errors."""
    path = path_ecef_m(run)
    return np.asarray(path + turn_back(enu_axes(path), run.errors(POSITION)))


def trajectory_chart(found: Shown) -> Chart | None:
    """Figure 2: the path from above, the outages on it."""
    runs = [*found.drawn(outage=True), *found.drawn(outage=False)]
    if not runs:
        return None
    run = runs[0]
    path = path_ecef_m(run)
    known = np.isfinite(path).all(axis=1)
    path, times = path[known], run.times_ns[known]
    frame = LocalFrame.at(path[0])
    enu = frame.enu(path)

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        ax.plot(enu[:, 0], enu[:, 1], color=TRUTH.hexadecimal, linewidth=1.2, label="true path")
        for number, span in enumerate(found.spans(), 1):
            hit = (times >= span.start_ns) & (times <= span.end_ns)
            ax.plot(enu[hit, 0], enu[hit, 1], color=OUTAGE.hexadecimal, linewidth=3.0,
                    label="outage" if number == 1 else None)  # fmt: skip
            if hit.any():
                middle = enu[hit][np.count_nonzero(hit) // 2]
                ax.annotate(str(number), (middle[0], middle[1]), xytext=(7, 7),
                            textcoords="offset points", color=OUTAGE.hexadecimal)  # fmt: skip
        ax.plot(enu[0, 0], enu[0, 1], "o", color="#222222", markerfacecolor="white", label="start")
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_xlabel("east [m]")
        ax.set_ylabel("north [m]")
        figure.legend(loc="outside upper left", ncols=4, handlelength=1.4)

    latitude, longitude, _ = frame.origin_geodetic
    return Chart(
        draw(5.0, "kan2022 trajectory", paint),
        f"Local east and north of the start (latitude {latitude:.5f}°, longitude {longitude:.5f}°),"
        " equal scales. Red: the places of the partial outages.",
    )


def drift_chart(found: Shown, method: str) -> Chart | None:
    """Figure 10: differences along the time in each outage, of one way to make samples fewer."""
    spans = found.spans()
    kinds = found.of_method(method, outage=True) if spans else []
    if not kinds or (method == DECIMATE and len(kinds) == 1):
        return None
    rates = _rates(kinds)

    def paint(figure: Figure) -> None:
        axes = figure.subplots(len(spans), 3, squeeze=False, sharex=True)
        for row, (span, line) in enumerate(zip(spans, axes, strict=True)):
            for kind in kinds:
                times, values = drift_curves(found, kind, span)
                elapsed = seconds_between(times, span.start_ns)
                for index, ax in enumerate(line):
                    ax.plot(elapsed, values[:, index],
                            color=rate_ink(rates, kind.rate_hz).hexadecimal,
                            linewidth=1.2)  # fmt: skip
            for axis, ax in zip(LOCAL_AXES, line, strict=True):
                ax.set_title(f"Outage {row + 1}, {axis} [cm]")
                ax.axhline(0.0, color=BOUND.hexadecimal, linewidth=0.6)
        for ax in axes[-1]:
            ax.set_xlabel("time since the outage began [s]")
        figure.legend(handles=_handles(kinds), loc="outside upper left", ncols=6)

    return Chart(
        draw(1.9 * len(spans) + 0.7, f"kan2022 drift {method}", paint),
        f"{found.grade}, seed {found.seed}: estimate less truth with three satellites left. The"
        " last point is the prediction for the first epoch with all of them.",
    )


def greatest_chart(found: Shown) -> Chart | None:
    """Figure 11: greatest differences of each rate and axis, over all seeds."""
    kinds = found.runs.tight(found.grade, outage=True)
    if not kinds:
        return None
    rates = _rates(kinds)
    width = _WIDE / 3

    def paint(figure: Figure) -> None:
        axes = figure.subplots(1, 3, sharey=True)
        for index, (axis, ax) in enumerate(zip(LOCAL_AXES, axes, strict=True)):
            for kind in kinds:
                values = greatest_drifts_cm(found.runs, kind)[:, index]
                values = values[np.isfinite(values)]
                if len(values) == 0:
                    continue
                hollow = kind.method == DECIMATE
                at = rates.index(kind.rate_hz) + (0.0 if hollow else -width)
                _bar(ax, at, values, width, rate_ink(rates, kind.rate_hz).hexadecimal, hollow)
            for place, rate in enumerate(rates):
                if rate in published.DRIFT_CM:
                    ax.plot([place + width], [published.DRIFT_CM[rate][index]], "D",
                            color=_SOFT, markersize=5)  # fmt: skip
            ax.set_xticks(range(len(rates)), [f"{rate} Hz" for rate in rates])
            ax.set_title(f"{axis} [cm]")
            ax.grid(visible=False, axis="x")
            ax.set_axisbelow(True)
        sizes = np.concatenate([greatest_drifts_cm(found.runs, kind) for kind in kinds])
        if np.nanmax(sizes) > _APART * np.nanmin(sizes) > 0.0:
            axes[0].set_yscale("log")
        figure.legend(
            handles=[
                Patch(color=_SOFT, label="ours, integrated"),
                Patch(facecolor="white", edgecolor=_SOFT, label="ours, decimated"),
                Line2D([], [], marker="D", linestyle="", color=_SOFT, label="the paper's"),
            ],
            loc="outside upper left", ncols=3,
        )  # fmt: skip

    return Chart(
        draw(3.0, "kan2022 greatest", paint),
        f"{found.grade}: greatest position difference in any outage of a seed; the mean over seeds,"
        " the bar's whisker from the least seed to the greatest.",
    )


def _bar(ax: Axes, at: float, values: Floats, width: float, color: str, hollow: bool) -> None:
    mean = float(np.mean(values))
    ax.bar(at, mean, 0.92 * width, edgecolor=color, facecolor="white" if hollow else color,
           linewidth=1.2)  # fmt: skip
    if len(values) > 1:
        ax.plot([at, at], [values.min(), values.max()], color="#222222", linewidth=0.9)


def comparison_chart(runs: Runs, grade: str) -> Chart | None:
    """Paired differences of the drift in space, with their intervals."""
    found = comparisons(runs, grade)
    if not found or len(runs.seeds) == 1:
        return None

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        labels: list[str] = []
        for place, item in enumerate(found):
            color = run_ink(0 if item.first.method == INTEGRATE else 3).hexadecimal
            ax.plot([item.pair.low, item.pair.high], [place, place], color=color, linewidth=2.0)
            ax.plot([item.pair.mean], [place], "o", color=color, markersize=5)
            word = {INTEGRATE: "integrated", DECIMATE: "decimated"}
            labels.append(
                f"{item.first.rate_hz} Hz {word[item.first.method]}"
                f" less {item.second.rate_hz} Hz"
                + (" integrated" if item.second.rate_hz == item.first.rate_hz else "")
            )
        ax.axvline(0.0, color=BOUND.hexadecimal, linewidth=0.8)
        ax.set_yticks(range(len(labels)), labels)
        ax.invert_yaxis()
        ax.set_xlabel("difference of what an outage added, in space [cm]")

    return Chart(
        draw(0.32 * len(found) + 0.9, f"kan2022 pairs {grade}", paint),
        f"{grade}: mean of the paired differences over {len(runs.seeds)} seeds with its 95 %"
        " interval. Left of nought the first drifts less.",
    )


def _rates(kinds: list[Kind]) -> list[int]:
    return sorted({kind.rate_hz for kind in kinds}, reverse=True)


def _handles(kinds: list[Kind]) -> list[Line2D]:
    rates = _rates(kinds)
    return [
        Line2D([], [], color=rate_ink(rates, rate).hexadecimal, label=f"{rate} Hz")
        for rate in rates
    ]
