"""Normalised innovations against the normal distribution that they should have."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from replay.evaluate.geometry import Floats
from replay.view.charts import Chart, draw
from replay.view.filter_panels import innovation_groups
from replay.view.gather import RunData
from replay.view.labels import SIGMA
from replay.view.palette import Ink, run_ink

_EDGE: Final = 5.0
_STEP: Final = 0.25
_COLUMNS: Final = 3


def histogram_chart(data: RunData) -> Chart | None:
    """A histogram per run and kind of measurement; None without innovations."""
    groups = [
        (f"{run.name}: {kind}" if len(data.runs) > 1 else kind, run_ink(index), values)
        for index, run in enumerate(data.runs)
        if run.innovations is not None
        for kind, values in innovation_groups(run.innovations).items()
        if len(values)
    ]
    if not groups:
        return None
    rows = -(-len(groups) // _COLUMNS)

    def paint(figure: Figure) -> None:
        axes = figure.subplots(rows, _COLUMNS, squeeze=False)
        for group, ax in itertools.zip_longest(groups, axes.flat):
            if group is None:
                ax.set_visible(False)
            else:
                _histogram(ax, *group)

    return Chart(
        draw(1.9 * rows + 0.3, "histogram", paint),
        "Innovations over their standard deviation, rejected ones included, against the normal "
        f"distribution (line). The outermost bars hold all beyond ±{_EDGE:g}.",
    )


def _histogram(ax: Axes, title: str, ink: Ink, values: Floats) -> None:
    edges = np.arange(-_EDGE, _EDGE + _STEP / 2, _STEP)
    counts, _ = np.histogram(np.clip(values, -_EDGE, _EDGE), edges)
    density = counts / (len(values) * _STEP)
    ax.stairs(density, edges, fill=True, color=ink.hexadecimal, alpha=0.45)
    grid = np.linspace(-_EDGE, _EDGE, 101)
    ax.plot(grid, stats.norm.pdf(grid), color="#222222", linewidth=1.0)
    beyond = 100.0 * float(np.mean(np.abs(values) > 3.0))
    ax.set_title(f"{title[0].upper()}{title[1:]} [{SIGMA}]")
    ax.text(
        0.98, 0.96,
        f"n {len(values)}\nmean {values.mean():+.2f}\nstd {values.std():.2f}\n"
        f">3{SIGMA} {beyond:.1f} %",
        transform=ax.transAxes, ha="right", va="top", fontsize=7, color="#5b616b",
    )  # fmt: skip
    ax.set_yticks([])
    ax.set_xlim(-_EDGE, _EDGE)
