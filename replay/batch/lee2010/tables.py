"""Tables 1 to 3 of Lee (2010), ours beside the published, and what else was counted.

Over several seeds a figure is told twice: the mean over the seeds, and the worst of them
(least success, greatest mean by size, greatest standard deviation).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from replay.batch.lee2010.published import (
    ATTITUDE_ARCMIN,
    MODES,
    POSITION_CM,
    SUCCESS,
    TITLES,
    Triple,
)
from replay.batch.study import Done
from replay.evaluate.network import LaneIntegers
from replay.evaluate.network_run import MeanStd, NetworkFigures, StationFigures
from replay.view.labels import NONE
from replay.view.markup import Table

_PUBLISHED, _OURS, _MEAN, _WORST = "published", "ours", "ours, mean", "ours, worst"
Cases = Mapping[str, Sequence[Done]]


def by_case(done: Sequence[Done]) -> dict[str, list[Done]]:
    """Members by case, each case's in the order of seeds."""
    found: dict[str, list[Done]] = {}
    for member in done:
        found.setdefault(member.member.label, []).append(member)
    return {label: sorted(found[label], key=lambda m: m.member.number) for label in sorted(found)}


def mode_figures(member: Done, mode: str) -> NetworkFigures | None:
    """Figures of a mode of a member."""
    figures = member.figures.get(mode)
    return figures if isinstance(figures, NetworkFigures) else None


def _stations(member: Done) -> StationFigures | None:
    figures = mode_figures(member, "network")
    return None if figures is None else figures.stations


def seeds_said(cases: Cases) -> str:
    """How many seeds the figures are of."""
    counts = sorted({len(members) for members in cases.values()})
    if counts == [1]:
        return "One seed, that of the scenario."
    told = ", ".join(map(str, counts))
    return (
        f"{told} seeds: the scenario's own and those that follow it. “Mean” is over the seeds"
        " (of means by size), “worst” is the seed furthest off in that column."
    )


def span_said(cases: Cases) -> str:
    """Of which span the figures are."""
    figures = [
        found
        for members in cases.values()
        for member in members
        for mode in MODES
        if (found := mode_figures(member, mode)) is not None
    ]
    if not figures:
        return ""
    first, last = min(f.since_s for f in figures), max(f.until_s for f in figures)
    fewest, most = min(f.rows for f in figures), max(f.rows for f in figures)
    return (
        f"Span: from {figures[0].settling_s:g} s after the filter's alignment ({first:.1f} s after"
        f" its first solution at the earliest) to its end ({last:.1f} s at the latest), at the"
        f" epochs of GNSS: {_range(fewest, most)} epochs a run. What is in the first"
        f" {figures[0].settling_s:g} s is not in the tables; the paper does not say what it left"
        " out."
    )


def _range(low: int, high: int) -> str:
    return f"{low}" if low == high else f"{low} to {high}"


def success_table(cases: Cases) -> Table:
    """Table 1, with the counts that a success rate hides."""
    rows: list[tuple[str, ...]] = []
    for case, members in cases.items():
        found = [
            figures.epochs
            for member in members
            if (figures := mode_figures(member, "network")) is not None and figures.epochs
        ]
        success = [100.0 * item.success for item in found]
        counts = [
            str(sum(getattr(item, name) for item in found))
            for name in ("attempted", "fixed", "whole", "judged", "wrong")
        ]
        ours = _statistic(success, np.mean), _statistic(success, np.min)
        rows.append(
            (
                TITLES.get(case, case),
                f"{SUCCESS[case]:.1f}" if case in SUCCESS else NONE,
                *ours,
                *counts,
                ", ".join(sorted({item.basis for item in found})) or NONE,
            )
        )
    return Table(
        (
            "case", "published [%]", "ours, mean [%]", "ours, worst [%]", "epochs tried",
            "fixed", "all of them fixed", "judged", "wrong", "judged by",
        ),
        tuple(rows),
        caption="Table 1. Success of the ambiguity resolution, each epoch by itself, network mode:"
        " epochs fixed and not wrong, of those at which it was tried. Counts are sums over seeds."
        " Wrong: at least one integer of the epoch is not the one that was simulated.",
    )  # fmt: skip


def _statistic(values: Sequence[float], of: Callable[[Sequence[float]], Any]) -> str:
    return f"{float(of(values)):.2f}" if values else NONE


def position_table(cases: Cases) -> Table:
    """Table 2."""
    return _differences(
        cases, POSITION_CM, ("north", "east", "height"), lambda f: f.position_cm, "cm", 1,
        "Table 2. Coordinate differences, estimate less truth: mean ± standard deviation.",
    )  # fmt: skip


def attitude_table(cases: Cases) -> Table:
    """Table 3."""
    return _differences(
        cases, ATTITUDE_ARCMIN, ("heading", "pitch", "roll"), lambda f: f.attitude_arcmin,
        "arc-min", 2,
        "Table 3. Attitude differences, estimate less truth: mean ± standard deviation.",
    )  # fmt: skip


def _differences(
    cases: Cases,
    published: Mapping[str, Mapping[str, Triple]],
    names: tuple[str, str, str],
    of: Callable[[NetworkFigures], Mapping[str, MeanStd]],
    unit: str,
    digits: int,
    caption: str,
) -> Table:
    rows: list[tuple[str, ...]] = []
    for case, members in cases.items():
        for mode in MODES:
            known = [of(f) for m in members if (f := mode_figures(m, mode)) is not None]
            known = [figures for figures in known if figures]
            lines: list[tuple[str, list[str]]] = []
            if case in published:
                pairs = published[case][mode]
                lines.append((_PUBLISHED, [f"{m:.{digits}f} ± {s:.{digits}f}" for m, s in pairs]))
            several = len(known) > 1
            for words, gather in ((_MEAN, np.mean), (_WORST, np.max)) if several else (
                (_OURS, np.max),
            ):  # fmt: skip
                cells = [
                    f"{gather([abs(f[n].mean) for f in known]):.{digits}f} ± "
                    f"{gather([f[n].std for f in known]):.{digits}f}"
                    if known
                    else NONE
                    for n in names
                ]
                lines.append((words, cells))
            for number, (words, cells) in enumerate(lines):
                head = (TITLES.get(case, case), mode) if number == 0 else ("", "")
                rows.append((*head, words, *cells))
    return Table(
        ("case", "mode", "", *(f"{name} [{unit}]" for name in names)),
        tuple(rows),
        caption=f"{caption} Means by their size, as the paper gives no signs; the signs are in"
        " tables.json.",
        text_columns=3,
    )


def station_table(cases: Cases) -> Table:
    """Integers between reference stations, a row per baseline."""
    rows: list[tuple[str, ...]] = []
    signals: dict[str, None] = {}
    for case, members in cases.items():
        found = [told for m in members if (told := _stations(m)) is not None]
        for baseline in sorted({name for figures in found for name in figures.baselines}):
            lanes = [figures.baselines.get(baseline, {}) for figures in found]
            names = list(dict.fromkeys(name for lane in lanes for name in lane))
            signals |= dict.fromkeys(names)
            known = {name: [lane[name] for lane in lanes if name in lane] for name in names}
            rows.append(
                (
                    TITLES.get(case, case),
                    baseline,
                    " / ".join(_slowest(known[name], "first_fix_s") for name in names),
                    " / ".join(_slowest(known[name], "all_fixed_s") for name in names),
                    " / ".join(_share(known[name]) for name in names),
                    " / ".join(str(sum(k.judged for k in known[name])) for name in names),
                    " / ".join(str(sum(k.wrong for k in known[name])) for name in names),
                )
            )
    order = " / ".join(signals)
    return Table(
        (
            "case", "baseline", "first fixed after [s]", "all fixed after [s]", "rows fixed [%]",
            "judged", "wrong",
        ),
        tuple(rows),
        caption=f"Integers between reference stations, {order}; WL is the wide lane. The paper says"
        " that they were right “within a few seconds”. Times are those of the slowest seed; all"
        " are fixed at the first epoch at which no satellite, however new, is without its integer.",
        text_columns=2,
    )  # fmt: skip


def _slowest(lanes: Sequence[LaneIntegers], name: str) -> str:
    times = [time for lane in lanes if (time := getattr(lane, name)) is not None]
    return f"{max(times):.0f}" if times and len(times) == len(lanes) else "never"


def _share(lanes: Sequence[LaneIntegers]) -> str:
    return f"{100.0 * sum(k.fixed for k in lanes) / max(sum(k.rows for k in lanes), 1):.2f}"


def closure_table(cases: Cases) -> Table:
    """Sums of integers around triangles."""
    rows: list[tuple[str, ...]] = []
    for case, members in cases.items():
        found: dict[str, list[int]] = {}
        for member in members:
            figures = _stations(member)
            for item in figures.closures if figures is not None else ():
                total = found.setdefault(", ".join(item.stations), [0, 0])
                total[0] += item.checked
                total[1] += item.exceptions
        rows += [
            (TITLES.get(case, case), names, str(checked), str(exceptions))
            for names, (checked, exceptions) in found.items()
        ]
    return Table(
        ("case", "triangle", "sums checked", "not nought"),
        tuple(rows),
        caption="Closure: integers of each satellite and signal summed around each triangle of"
        " stations.",
        text_columns=2,
    )


def residual_table(cases: Cases) -> Table:
    """Rover's residuals before and after the corrections."""
    rows: list[tuple[str, ...]] = []
    for case, members in cases.items():
        found = [f.residuals for m in members if (f := mode_figures(m, "network")) is not None]
        for signal in sorted({name for figures in found for name in figures}):
            known = [figures[signal] for figures in found if signal in figures]
            after = [k.after_rms_m for k in known if k.after_rms_m is not None]
            most = [k.after_max_m for k in known if k.after_max_m is not None]
            rows.append(
                (
                    TITLES.get(case, case), signal,
                    f"{100.0 * float(np.mean([k.before_rms_m for k in known])):.1f}",
                    f"{100.0 * max(k.before_max_m for k in known):.1f}",
                    f"{100.0 * float(np.mean(after)):.2f}" if after else NONE,
                    f"{100.0 * max(most):.1f}" if most else NONE,
                    str(sum(k.count for k in known)),
                )
            )  # fmt: skip
    return Table(
        ("case", "signal", "before, rms [cm]", "before, most [cm]", "after, rms [cm]",
         "after, most [cm]", "double differences"),
        tuple(rows),
        caption="The rover's double-difference residuals at its true position with the true"
        " integers, before and after the network's correction: tens of centimetres and “a few"
        " centimetres” in the paper.",
        text_columns=2,
    )  # fmt: skip


def all_tables(cases: Cases) -> list[Table]:
    """Every table that has rows."""
    made = (
        success_table(cases),
        position_table(cases),
        attitude_table(cases),
        residual_table(cases),
        station_table(cases),
        closure_table(cases),
    )
    return [table for table in made if table.rows]


def markdown_of(table: Table) -> str:
    """A table as Markdown, its caption above."""
    lines = [f"**{table.caption}**", ""] if table.caption else []
    lines.append("| " + " | ".join(table.head) + " |")
    marks = ["---" if i < table.text_columns else "---:" for i in range(len(table.head))]
    lines.append("|" + "|".join(marks) + "|")
    lines += ["| " + " | ".join(row) + " |" for row in table.rows]
    return "\n".join(lines)


def to_json(cases: Cases, name: str) -> bytes:
    """Every figure of every member, signs and all, and the published ones."""
    members = [
        {
            "case": case,
            "seed": member.member.number,
            "figures": {
                mode: msgspec.to_builtins(figures) for mode, figures in member.figures.items()
            },
            "success": {
                mode: figures.epochs.success
                for mode in MODES
                if (figures := mode_figures(member, mode)) is not None and figures.epochs
            },
            "losses": list(member.losses),
        }
        for case, done in cases.items()
        for member in done
    ]
    tables = [
        {"caption": t.caption, "head": list(t.head), "rows": [list(row) for row in t.rows]}
        for t in all_tables(cases)
    ]
    content = {
        "study": name,
        "seeds": seeds_said(cases),
        "span": span_said(cases),
        "published": {
            "success_percent": SUCCESS,
            "position_cm": POSITION_CM,
            "attitude_arcmin": ATTITUDE_ARCMIN,
        },
        "tables": tables,
        "members": members,
    }
    return msgspec.json.format(msgspec.json.encode(content), indent=2) + b"\n"
