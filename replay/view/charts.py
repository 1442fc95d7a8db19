"""Panels on paper: matplotlib figures as SVG text that is the same bytes each time."""

from __future__ import annotations

import dataclasses
import io
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from replay.evaluate.geometry import Floats
from replay.evaluate.outages import Span
from replay.time import seconds_between
from replay.view.palette import OUTAGE, TRUTH
from replay.view.panels import Curve, Panel, Shape
from replay.view.sink import Times
from replay.view.thinning import Rows, band_rows, dot_stride, line_rows

Painter = Callable[[Figure], None]
WIDTH_IN: Final = 9.6
_BINS: Final = 240  # of a panel as wide as the page
_MOST_DOTS: Final = 900
_FEWER_DOTS: Final = 450  # in a panel beside others
_MOST_COLUMNS: Final = 3
_NO_METADATA: Final = {"Date": None, "Creator": None, "Format": None, "Type": None}
_LONG_S: Final = 7200.0
_STYLE: Final[dict[Any, Any]] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.edgecolor": "#8a8f98",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.unicode_minus": True,
    "grid.color": "#e4e6ea",
    "grid.linewidth": 0.6,
    "xtick.color": "#5b616b",
    "ytick.color": "#5b616b",
    "legend.frameon": False,
    "path.simplify": True,
}


@dataclasses.dataclass(frozen=True, slots=True)
class Chart:
    """A figure of the report.

    Attributes
    ----------
    svg : str
        An `<svg>` element.
    caption : str
        Text below it.
    """

    svg: str
    caption: str


@dataclasses.dataclass(frozen=True, slots=True)
class Clock:
    """Elapsed time of the x axis.

    Attributes
    ----------
    start_ns, end_ns : int, GPS ns
    """

    start_ns: int
    end_ns: int

    @property
    def in_minutes(self) -> bool:
        """Whether the run is so long that minutes read better."""
        return (self.end_ns - self.start_ns) / 1e9 > _LONG_S

    @property
    def label(self) -> str:
        """Title of the axis."""
        return f"time since start [{'min' if self.in_minutes else 's'}]"

    def elapsed(self, times_ns: Times | int) -> Floats:
        """Times on the axis."""
        return seconds_between(times_ns, self.start_ns) / (60.0 if self.in_minutes else 1.0)


def panels_chart(
    panels: Sequence[Panel],
    clock: Clock,
    outages: Sequence[Span],
    *,
    caption: str,
    columns: int | None = None,
) -> Chart:
    """Panels in rows, as they say, or stacked.

    Parameters
    ----------
    panels : sequence of Panel
        At least one.
    clock : Clock
    outages : sequence of Span
        Shaded.
    caption : str
        What is to be said; what was thinned is added.
    columns : int or None
        Panels beside each other; None follows the rows of the panels.
    """
    rows = _grid(panels, columns)
    width = max(len(row) for row in rows)
    height = sum(1.55 for _ in rows) + 0.55
    pen = _Pen(clock, _BINS // width, _MOST_DOTS if width == 1 else _FEWER_DOTS)
    with _figure(height) as figure:
        axes = figure.subplots(len(rows), width, sharex=True, squeeze=False)
        for row, line in itertools.zip_longest(rows, axes):
            for item, ax in itertools.zip_longest(row, line):
                if item is None:
                    ax.set_visible(False)
                    continue
                _draw_panel(ax, item, pen, outages)
        for column in range(width):
            last = max(i for i, row in enumerate(rows) if len(row) > column)
            axes[last, column].set_xlabel(clock.label)
            axes[last, column].tick_params(labelbottom=True)
        _legend(figure, [ax for ax in axes.flat if ax.get_visible()])
        return Chart(_svg(figure, panels[0].key), " ".join([caption, *pen.notes]).strip())


def _grid(panels: Sequence[Panel], columns: int | None) -> list[list[Panel]]:
    if columns is not None:
        return _chunks(panels, columns)
    groups = itertools.groupby(panels, key=lambda panel: (panel.section, panel.row))
    return [chunk for _, group in groups for chunk in _chunks(list(group), _MOST_COLUMNS)]


def _chunks(panels: Sequence[Panel], size: int) -> list[list[Panel]]:
    return [list(panels[i : i + size]) for i in range(0, len(panels), size)]


@dataclasses.dataclass(slots=True)
class _Pen:
    """How finely to draw, and notes of what was left out for it."""

    clock: Clock
    bins: int
    most_dots: int
    notes: dict[str, None] = dataclasses.field(default_factory=dict)

    def rows(self, curve: Curve) -> Rows:
        """Rows of a curve to draw."""
        count = len(curve.times_ns)
        if curve.shape is Shape.CROSSES:
            return np.arange(count, dtype=np.int64)
        if curve.shape is Shape.DOTS:
            stride = dot_stride(count, self.most_dots)
            if stride > 1:
                self.notes[
                    f"Of each satellite at most {self.most_dots} dots are drawn."
                    if curve.group
                    else f"Of the dots of “{curve.label}” 1 in {stride} is drawn."
                ] = None
            return np.arange(0, count, stride, dtype=np.int64)
        band = curve.shape is Shape.BAND
        rows = band_rows(curve.values, self.bins) if band else line_rows(curve.values, self.bins)
        if len(rows) < count:
            self.notes[
                f"Lines keep the first, least, greatest and last row of each of {self.bins} spans."
            ] = None
        return rows

    def note_beyond(self, item: Panel) -> None:
        """Say how many points a cut axis leaves out of the picture."""
        if item.limits is None:
            return
        low, high = item.limits
        beyond = sum(
            int(np.count_nonzero((curve.values < low) | (curve.values > high)))
            for curve in item.curves
            if curve.shape is not Shape.BAND
        )
        if beyond:
            self.notes[f"{item.title}: {beyond} points lie beyond the axis."] = None


def _draw_panel(ax: Axes, item: Panel, pen: _Pen, outages: Sequence[Span]) -> None:
    clock = pen.clock
    for outage in outages:
        ax.axvspan(
            float(clock.elapsed(outage.start_ns)),
            float(clock.elapsed(outage.end_ns)),
            color=OUTAGE.hexadecimal,
            alpha=0.10,
            linewidth=0.0,
            label="outage",
        )
    for curve in item.curves:
        _draw_curve(ax, curve, pen)
    ax.set_title(item.heading)
    ax.set_xlim(float(clock.elapsed(clock.start_ns)), float(clock.elapsed(clock.end_ns)))
    if item.logarithmic:
        ax.set_yscale("log")
    else:
        ax.yaxis.set_major_locator(MaxNLocator(5))
    ax.margins(y=0.06)
    if item.limits is not None:
        ax.set_ylim(*item.limits)
        pen.note_beyond(item)


def _draw_curve(ax: Axes, curve: Curve, pen: _Pen) -> None:
    color, label = curve.ink.hexadecimal, curve.group or curve.label
    rows = pen.rows(curve)
    x, y = pen.clock.elapsed(curve.times_ns[rows]), curve.values[rows]
    if curve.shape is Shape.BAND:
        ax.fill_between(x, y[:, 0], y[:, 1], color=color, alpha=0.35, linewidth=0.0, label=label)
    elif curve.shape is Shape.LINE:
        truth = curve.ink is TRUTH  # wide and pale, so that it shows below a solution
        width, alpha = (2.2, 0.45) if truth else (0.9, 1.0)
        ax.plot(x, y, color=color, linewidth=width, alpha=alpha, label=label)
    else:
        crosses = curve.shape is Shape.CROSSES
        marker, size, edge = ("x", 4.0, 0.9) if crosses else (".", 3.0, 0.0)
        ax.plot(x, y, marker, color=color, markersize=size, markeredgewidth=edge, label=label)


def _legend(figure: Figure, axes: Sequence[Axes]) -> None:
    """One legend above all panels."""
    entries: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if entries:
        figure.legend(
            list(entries.values()), list(entries), loc="outside upper left",
            ncols=min(len(entries), 6), handlelength=1.4, columnspacing=1.6, markerscale=2.0,
        )  # fmt: skip


@contextmanager
def _figure(height_in: float) -> Iterator[Figure]:
    with mpl.rc_context(_STYLE):
        yield Figure(figsize=(WIDTH_IN, height_in), layout="constrained")


def _svg(figure: Figure, salt: str) -> str:
    """The figure as an element: no date, no XML head, ids only where something refers to them."""
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": f"replay.view {salt}"}):
        FigureCanvasSVG(figure)
        figure.savefig(
            buffer,
            format="svg",
            metadata=_NO_METADATA,
        )
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'(<g) id="[A-Za-z]+_?\d*"', r"\1", text)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"|(<svg)', r"\1\2", text, count=1)
    return _smaller(text)


def _smaller(svg: str) -> str:
    """The same picture in half the bytes: hundredths of a point, and a dot's style told once."""
    svg = re.sub(  # not between tags, where the numbers of an axis stand
        r"(>[^<]+<)|(\d\.\d\d)\d+", lambda found: found.group(1) or found.group(2), svg
    )
    svg = re.sub(r"\s*\nL ", " ", svg)  # pairs after a move are lines anyway
    svg = re.sub(r"\n\s*", "\n", svg)
    run = r'(<use [^>]*?) style="([^"]*)"/>\n(?:<use [^>]*? style="\2"/>\n)+'

    def told_once(found: re.Match[str]) -> str:
        style = found.group(2)
        return f'<g style="{style}">' + found.group().replace(f' style="{style}"', "") + "</g>\n"

    return re.sub(run, told_once, svg).strip()


def draw(height_in: float, salt: str, paint: Painter) -> str:
    """An `<svg>` element of a figure that `paint` fills."""
    with _figure(height_in) as figure:
        paint(figure)
        return _svg(figure, salt)
