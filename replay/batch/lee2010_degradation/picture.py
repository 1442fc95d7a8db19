"""The picture of the study: a row of small charts for each thing that is changed."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from replay.batch.lee2010_degradation.figures import ATTITUDE, POSITION, Row
from replay.batch.lee2010_degradation.members import FITTED, SINGLE
from replay.view.charts import Chart, draw
from replay.view.palette import REJECTED, Ink, run_ink

_INKS: Final[dict[str, Ink]] = {
    "north": run_ink(2), "east": run_ink(0), "height": run_ink(1),
    "heading": run_ink(3), "pitch": run_ink(4), "roll": run_ink(5),
}  # fmt: skip
_RIGHT: Final = run_ink(0).faint()
_APART: Final = 0.2  # between the three marks of a run, in settings
_WIDE: Final = 0.7  # of the bars of a setting together
_LETTERS: Final = 46  # below a chart
_SOFT: Final = "#5b616b"
_KINDS: Final = (
    ("network", "o", True),
    ("network, settings fitted to this sky", "s", True),
    ("master alone", "o", False),
)


def picture_chart(rows: Sequence[Row]) -> Chart:
    """Errors of position and attitude, and epochs fixed, along what is changed."""
    sweeps = list(dict.fromkeys(row.sweep for row in rows))

    def paint(figure: Figure) -> None:
        axes = figure.subplots(len(sweeps), 3, squeeze=False, sharey="col")
        for sweep, (left, middle, right) in zip(sweeps, axes, strict=True):
            own = [row for row in rows if row.sweep is sweep]
            texts = [s.text for s in sweep.settings if any(row.setting is s for row in own)]
            _errors(left, own, texts, POSITION)
            _errors(middle, own, texts, ATTITUDE)
            _bars(right, own, texts)
            left.set_title(f"{_sentence(sweep.title)}: position [cm]")
            middle.set_title("attitude [arc-min]")
            right.set_title("epochs fixed [%]")
            for ax in (left, middle, right):
                wrapped = [
                    textwrap.fill(text, _LETTERS // len(texts), break_long_words=False)
                    for text in texts
                ]
                ax.set_xticks(range(len(texts)), wrapped, fontsize=7)
                ax.set_xlim(-0.6, len(texts) - 0.4)
                ax.grid(visible=False, axis="x")
                ax.set_axisbelow(True)
        figure.legend(
            handles=_handles(), loc="outside upper left", ncols=6, handlelength=1.4,
            columnspacing=1.4,
        )  # fmt: skip

    return Chart(
        draw(1.85 * len(sweeps) + 0.6, "degradation", paint),
        "Root mean squares about the truth, logarithmic, in the span of the table; a run has three"
        " marks. Bars: epochs of the rover with fixed integers, the wrong ones of them red, from"
        " left to right in the order of the marks' kinds.",
    )


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _kind(row: Row) -> int:
    return {FITTED: 1, SINGLE: 2}.get(row.variant, 0)


def _errors(ax: Axes, rows: Sequence[Row], texts: Sequence[str], names: Sequence[str]) -> None:
    for row in rows:
        _, marker, filled = _KINDS[_kind(row)]
        for index, name in enumerate(names):
            value = row.about_truth(name)
            if value is None:
                continue
            color = _INKS[name].hexadecimal
            at = texts.index(row.setting.text) + (index - 1) * _APART
            ax.plot([at], [value], marker, color=color, markersize=4.5, markeredgewidth=1.0,
                    markerfacecolor=color if filled else "white")  # fmt: skip
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(10.0))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _bars(ax: Axes, rows: Sequence[Row], texts: Sequence[str]) -> None:
    for place, text in enumerate(texts):
        own = [row for row in rows if row.setting.text == text]
        width = _WIDE / len(own)
        for index, row in enumerate(own):
            fixed, wrong = (100.0 * share for share in row.shares)
            at = place + (index - 0.5 * (len(own) - 1)) * width
            right = fixed - wrong
            if fixed == 0.0:
                ax.text(at, 2.0, "0", ha="center", fontsize=6.5, color=_SOFT)
                continue
            hollow = _kind(row) == 2
            ax.bar(at, right, 0.9 * width, edgecolor=run_ink(0).hexadecimal, linewidth=0.8,
                   facecolor="white" if hollow else _RIGHT.hexadecimal)  # fmt: skip
            ax.bar(at, wrong, 0.9 * width, bottom=right, color=REJECTED.hexadecimal)
    ax.set_ylim(0.0, 105.0)


def _handles() -> list[Line2D | Patch]:
    found: list[Line2D | Patch] = [
        Line2D([], [], marker="o", linestyle="", color=ink.hexadecimal, markersize=5, label=name)
        for name, ink in _INKS.items()
    ]
    found += [
        Line2D([], [], marker=marker, linestyle="", color=_SOFT, markersize=5, label=words,
               markerfacecolor=_SOFT if filled else "white")
        for words, marker, filled in _KINDS
    ]  # fmt: skip
    found.append(Patch(color=REJECTED.hexadecimal, label="fixed, but wrong"))
    return found
