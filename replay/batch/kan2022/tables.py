"""Tables 2 and 3 of Kan (2022) and its drifts, ours beside the published, and the paired tests.

A root mean square is of one run; over several seeds the mean of them is told with its standard
deviation among seeds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import msgspec
import numpy as np

from replay.batch.kan2022 import published
from replay.batch.kan2022.claim import Comparison, claim_said, comparisons
from replay.batch.kan2022.measure import ATTITUDE, BEFORE, POSITION, QUANTITIES, VELOCITY
from replay.batch.kan2022.plan import ALONE, REFERENCE
from replay.batch.kan2022.runs import (
    UNITS,
    Kind,
    Rms,
    Runs,
    drift_sizes_cm,
    drifts_cm,
    greatest_drifts_cm,
    improvement_percent,
    rms_of,
)
from replay.evaluate.geometry import Floats
from replay.evaluate.statistics import ANGLES, LOCAL_AXES
from replay.view.labels import NONE
from replay.view.markup import Table

SETTLED_S: Final = 600.0
_PUBLISHED, _OURS = "published", "ours"
_DIGITS: Final = {POSITION: 2, VELOCITY: 2, ATTITUDE: 3}


def method_said(kind: Kind) -> str:
    """How samples of a kind were made fewer; nothing at the log's own rate."""
    return {"integrate": "integrated", "decimate": "decimated"}.get(kind.method, "")


def accuracy_tables(runs: Runs) -> list[Table]:
    """Tables 2 and 3 of each unit, against truth, settled, and against the reference."""
    made: list[Table] = []
    for grade in runs.grades():
        for outage in (False, True):
            for since_s, against_reference in ((0.0, False), (SETTLED_S, False), (0.0, True)):
                table = accuracy_table(
                    runs,
                    grade,
                    outage=outage,
                    since_s=since_s,
                    against_reference=against_reference,
                )
                if table.rows:
                    made.append(table)
    return made


def accuracy_table(
    runs: Runs,
    grade: str,
    *,
    outage: bool,
    since_s: float = 0.0,
    against_reference: bool = False,
) -> Table:
    """Root mean squares of PPP and of each rate, and how much better than PPP each is."""
    alone = rms_of(
        runs, Kind(ALONE, outage=outage), since_s=since_s, against_reference=against_reference
    )
    rows: list[tuple[str, ...]] = []
    whole = since_s == 0.0 and grade == runs.grades()[0]
    for kind in (Kind(ALONE, outage=outage), *runs.tight(grade, outage=outage)):
        found = rms_of(runs, kind, since_s=since_s, against_reference=against_reference)
        if whole:
            rows += _published_row(kind)
        if found is None:
            continue
        better = (
            [f"{v:.1f}" for v in improvement_percent(found.mean(POSITION), alone.mean(POSITION))]
            if alone is not None and kind.run != ALONE
            else [NONE] * 3
        )
        rows.append(
            (
                kind.words(),
                method_said(kind),
                _OURS,
                *_means(found, POSITION),
                *better,
                *_means(found, VELOCITY),
                *_means(found, ATTITUDE),
                f"{100.0 * float(np.mean(found.availability)):.1f}",
            )
        )
        if len(found.seeds) > 1:
            spreads = [_spreads(found, quantity) for quantity in (POSITION, VELOCITY, ATTITUDE)]
            rows.append(("", "", "± seeds", *spreads[0], *[""] * 3, *spreads[1], *spreads[2], ""))
    span = f", from {since_s:.0f} s after the first common epoch" if since_s else ""
    what = "the smoothed reference" if against_reference else "the simulator's truth"
    return Table(
        (
            "run", "samples", "",
            *(f"{axis} [cm]" for axis in LOCAL_AXES),
            *(f"{axis} better [%]" for axis in LOCAL_AXES),
            *(f"{axis} [cm/s]" for axis in LOCAL_AXES), *(f"{angle} [deg]" for angle in ANGLES),
            "epochs [%]",
        ),
        tuple(rows) if any(row[2] == _OURS for row in rows) else (),
        caption=f"Table {3 if outage else 2}. {grade}"
        f"{', with the partial outages' if outage else ''}{span}: root mean squares against {what}."
        " ± seeds: standard deviation among seeds. Better: than PPP alone in the same column, of"
        " the means. Epochs: at which there is a"
        " position; the figures of PPP alone are of those.",
        text_columns=3,
    )  # fmt: skip


def _published_row(kind: Kind) -> list[tuple[str, ...]]:
    if kind.method == "decimate":
        return []
    rate, out = kind.rate_hz, kind.outage
    position: Sequence[float | None]
    if kind.run == ALONE:
        position = published.OUTAGE_PPP_CM if out else ()
        better: Sequence[float] = ()
    else:
        position = (published.OUTAGE_POSITION_CM if out else published.POSITION_CM).get(rate, ())
        better = (
            published.OUTAGE_IMPROVEMENT_PERCENT if out else published.IMPROVEMENT_PERCENT
        ).get(rate, ())
    velocity = () if out else published.VELOCITY_CM_S.get(rate, ())
    attitude = () if out else published.ATTITUDE_DEG.get(rate, ())
    if not (position or velocity):
        return []
    cells = [
        *_told(position, 2), *_told(better, 1), *_told(velocity, 2), *_told(attitude, 3), NONE
    ]  # fmt: skip
    return [(kind.words(), "", _PUBLISHED, *cells)]


def _told(values: Sequence[float | None], digits: int) -> list[str]:
    if not values:
        return [NONE] * 3
    return [NONE if value is None else f"{value:.{digits}f}" for value in values]


def _means(found: Rms, quantity: str) -> list[str]:
    return [_cell(value, None, _DIGITS[quantity]) for value in found.mean(quantity)]


def _spreads(found: Rms, quantity: str) -> list[str]:
    spread = found.spread(quantity)
    if spread is None:
        return [""] * 3
    return [_cell(value, None, _DIGITS[quantity]) for value in spread]


def _cells(found: Rms, quantity: str) -> list[str]:
    digits = _DIGITS[quantity]
    mean, spread = found.mean(quantity), found.spread(quantity)
    return [_cell(mean[i], None if spread is None else spread[i], digits) for i in range(3)]


def _cell(mean: float, spread: float | None, digits: int) -> str:
    if not math.isfinite(mean):
        return NONE
    text = f"{mean:.{digits}f}"
    return text if spread is None or not math.isfinite(spread) else f"{text} ± {spread:.{digits}f}"


def reference_table(runs: Runs) -> Table:
    """How far the reference is from the simulator's truth."""
    found = rms_of(runs, Kind(REFERENCE))
    rows: list[tuple[str, ...]] = []
    if found is not None:
        for quantity, names in QUANTITIES.items():
            cells = _cells(found, quantity)
            unit = UNITS[quantity][0]
            rows += [(f"{n} [{unit}]", c) for n, c in zip(names, cells, strict=True)]
    return Table(
        ("component", "rms"),
        tuple(rows),
        caption="The reference itself against the simulator's truth.",
    )


def drift_table(runs: Runs, grade: str) -> Table:
    """Figures 10 and 11 as numbers."""
    rows: list[tuple[str, ...]] = []
    first = grade == runs.grades()[0]
    for kind in runs.tight(grade, outage=True):
        if first and kind.rate_hz in published.DRIFT_CM and kind.method == "integrate":
            values = _told(published.DRIFT_CM[kind.rate_hz], 1)
            rows.append((kind.words(), "", _PUBLISHED, *values, *[NONE] * 7))
        sizes = drift_sizes_cm(runs, kind)
        greatest = greatest_drifts_cm(runs, kind)
        known = np.isfinite(sizes).all(axis=1)
        if not known.any():
            continue
        rows.append(
            (
                kind.words(), method_said(kind), _OURS, *_over_seeds(sizes[known]),
                *_over_seeds(drift_sizes_cm(runs, kind, added=True)[known, :3]),
                *[f"{value:.1f}" for value in np.nanmax(greatest[known], axis=0)],
            )
        )  # fmt: skip
    return Table(
        (
            "run", "samples", "", *(f"{axis} [cm]" for axis in LOCAL_AXES), "in space [cm]",
            *(f"added {axis} [cm]" for axis in LOCAL_AXES),
            *(f"most {axis} [cm]" for axis in LOCAL_AXES),
        ),
        tuple(rows),
        caption=f"Figures 10 and 11. {grade}: position difference at the end of an outage, before"
        " the first epoch with all satellites: root mean square over the outages of a seed, mean ±"
        " standard deviation over seeds. Added: the same less the difference just before the"
        " outage, which PPP has not converged from yet. Most: in any outage of any seed.",
        text_columns=3,
    )  # fmt: skip


def _over_seeds(values: Floats) -> list[str]:
    spread = np.std(values, axis=0, ddof=1) if len(values) > 1 else [None] * values.shape[1]
    return [_cell(m, s, 1) for m, s in zip(np.mean(values, axis=0), spread, strict=True)]


def comparison_table(runs: Runs, grade: str, *, added: bool = True) -> Table:
    """Whether the drift differs: each pair of kinds over the seeds."""
    rows = [_comparison_row(item) for item in comparisons(runs, grade, added=added)]
    what = "what the outage added, in space" if added else "difference at its end, in space"
    return Table(
        ("drift of", "less that of", "seeds", "mean [cm]", "95 % from", "to", "smaller in", "p",
         "p, Holm"),
        tuple(rows),
        caption=f"{grade}: {what}, paired over seeds: a seed has the same motion, observations and"
        " errors of the unit whatever the rate. Interval of the mean difference after Student; p of"
        " no difference, and adjusted for all rows after Holm.",
        text_columns=2,
    )  # fmt: skip


def _comparison_row(item: Comparison) -> tuple[str, ...]:
    pair = item.pair
    several = math.isfinite(pair.low)
    return (
        f"{item.first.words()} {method_said(item.first)}",
        f"{item.second.words()} {method_said(item.second)}",
        str(pair.count),
        f"{pair.mean:+.2f}",
        f"{pair.low:+.2f}" if several else NONE,
        f"{pair.high:+.2f}" if several else NONE,
        f"{pair.smaller} of {pair.count}",
        f"{pair.probability:.3f}" if several else NONE,
        f"{item.adjusted:.3f}" if several else NONE,
    )


def aim_table(runs: Runs) -> Table:
    """What was to be reached, and what was."""
    grade = runs.grades()[0] if runs.grades() else ""
    rows: list[tuple[str, ...]] = []
    for kind in runs.tight(grade, outage=False)[:1]:
        found = rms_of(runs, kind)
        if found is not None:
            aim = published.POSITION_CM[200]
            rows.append(_aim(f"position rms, {kind.words()}", aim, found.mean(POSITION)))
    best = [min(drift[i] for drift in published.DRIFT_CM.values()) for i in range(3)]
    for kind in runs.tight(grade, outage=True):
        sizes = drift_sizes_cm(runs, kind)
        sizes = sizes[np.isfinite(sizes).all(axis=1)]
        if len(sizes):
            words = f"drift after the outage, {kind.words()} {method_said(kind)}"
            rows.append(_aim(words, best, np.mean(sizes, axis=0)[:3]))
    return Table(
        ("aim: at or below the paper's", *(f"{a} [cm]" for a in LOCAL_AXES), "reached"),
        tuple(rows),
        caption="Ours / the paper's: its 200 Hz for the position, its best rate of each axis for"
        " the drift.",
    )


def _aim(words: str, aim: Sequence[float], ours: Floats) -> tuple[str, ...]:
    reached = [bool(value <= limit) for value, limit in zip(ours, aim, strict=True)]
    cells = [f"{value:.1f} / {limit:.1f}" for value, limit in zip(ours, aim, strict=True)]
    return words, *cells, "yes" if all(reached) else f"{sum(reached)} of 3"


def all_tables(runs: Runs) -> list[Table]:
    """Every table that has rows."""
    made = [aim_table(runs)]
    tables = accuracy_tables(runs)
    made += tables
    made.append(reference_table(runs))
    for grade in runs.grades():
        made.append(drift_table(runs, grade))
        made += [comparison_table(runs, grade, added=added) for added in (True, False)]
    return [table for table in made if table.rows]


def seeds_said(runs: Runs) -> str:
    """How many seeds the figures are of."""
    count = len(runs.seeds)
    if count == 1:
        return (
            "One seed, that of the scenario: nothing can be said of chance. --seeds 10 tells more."
        )
    return f"{count} seeds: the scenario's own and those that follow it."


def to_json(runs: Runs, name: str, rows_lost: Sequence[str] = ()) -> bytes:
    """Every table and figure, signs and all, and the published ones."""
    content = {
        "study": name,
        "seeds": runs.seeds,
        "claim": {grade: claim_said(runs, grade) for grade in runs.grades()},
        "published": _published(),
        "contradictions": list(published.CONTRADICTIONS),
        "failed": list(runs.failed),
        "losses": list(rows_lost),
        "tables": [
            {"caption": t.caption, "head": list(t.head), "rows": [list(row) for row in t.rows]}
            for t in all_tables(runs)
        ],
        "kinds": [_kind_figures(runs, kind) for kind in runs.kinds],
        "comparisons": {
            grade: [_comparison_figures(item) for item in comparisons(runs, grade)]
            for grade in runs.grades()
        },
    }
    return msgspec.json.format(msgspec.json.encode(_finite(content)), indent=2) + b"\n"


def _published() -> dict[str, Any]:
    return {
        "position_cm": published.POSITION_CM,
        "improvement_percent": published.IMPROVEMENT_PERCENT,
        "velocity_cm_s": published.VELOCITY_CM_S,
        "attitude_deg": published.ATTITUDE_DEG,
        "outage_position_cm": published.OUTAGE_POSITION_CM,
        "outage_improvement_percent": published.OUTAGE_IMPROVEMENT_PERCENT,
        "outage_ppp_cm": published.OUTAGE_PPP_CM,
        "drift_cm": published.DRIFT_CM,
    }


def _kind_figures(runs: Runs, kind: Kind) -> dict[str, Any]:
    found: dict[str, Any] = {
        "run": kind.run, "unit": kind.grade, "samples": kind.method, "rate_hz": kind.rate_hz,
        "outages": kind.outage,
    }  # fmt: skip
    for name, since_s, against_reference in (
        ("against_truth", 0.0, False),
        ("against_truth_settled", SETTLED_S, False),
        ("against_reference", 0.0, True),
    ):
        rms = rms_of(runs, kind, since_s=since_s, against_reference=against_reference)
        if rms is None or (against_reference and kind.run == REFERENCE):
            continue
        found[name] = {
            "seeds": rms.seeds,
            "position_cm": rms.values[POSITION].tolist(),
            "velocity_cm_s": rms.values[VELOCITY].tolist(),
            "attitude_deg": rms.values[ATTITUDE].tolist(),
            "availability": rms.availability.tolist(),
        }
    if kind.outage:
        found["drift_cm"] = drifts_cm(runs, kind).tolist()
        found["before_cm"] = drifts_cm(runs, kind, figure=BEFORE).tolist()
    return found


def _comparison_figures(item: Comparison) -> dict[str, Any]:
    pair = item.pair
    return {
        "first": {"rate_hz": item.first.rate_hz, "samples": item.first.method},
        "second": {"rate_hz": item.second.rate_hz, "samples": item.second.method},
        "pairs": pair.count,
        "mean_cm": pair.mean,
        "low_cm": pair.low,
        "high_cm": pair.high,
        "smaller": pair.smaller,
        "p": pair.probability,
        "p_holm": item.adjusted,
    }


def _finite(value: Any) -> Any:
    """The same with null where a number is none, which JSON has no word for."""
    if isinstance(value, Mapping):
        return {str(key): _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    if isinstance(value, float):  # numpy's too
        return float(value) if math.isfinite(value) else None
    return value
