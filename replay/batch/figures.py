"""Key figures of an evaluation, rounded so that they read well in a text diff."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from replay.evaluate import Evaluation

Number = int | float
Figures = dict[str, dict[str, Number]]

LENGTH_DIGITS: Final = 4  # m, m/s, deg: a tenth of a millimetre
RATIO_DIGITS: Final = 3  # means of normalised squares
TIME_DIGITS: Final = 2  # s
_UNIT_DIGITS: Final = {"_m": LENGTH_DIGITS, "_m_s": LENGTH_DIGITS, "_deg": LENGTH_DIGITS}
# Sums may come out otherwise in their last bits elsewhere, which can turn a rounding.
_ROUNDING: Final = 1.5


def key_figures(evaluation: Evaluation) -> Figures:
    """Figures by group and name; what truth does not have is not in them.

    Parameters
    ----------
    evaluation : Evaluation

    Returns
    -------
    dict of group to dict of name to number
        The group's name ends in the unit: `position_rms_m`.
    """
    figures: Figures = {}
    for name, statistics in (
        ("position_rms_m", evaluation.position_error_m),
        ("position_rms_all_m", evaluation.position_error_all_m),
        ("velocity_rms_m_s", evaluation.velocity_error_m_s),
        ("attitude_rms_deg", evaluation.attitude_error_deg),
    ):
        if statistics is not None:
            figures[name] = {a: round(s.rms, LENGTH_DIGITS) for a, s in statistics.items()}
    figures |= _gnss_figures(evaluation)
    nees = evaluation.nees
    blocks = {"position": nees.position, "velocity": nees.velocity, "attitude": nees.attitude}
    means = {name: block.mean for name, block in blocks.items() if block is not None}
    figures["nees_mean"] = {name: round(mean, RATIO_DIGITS) for name, mean in means.items()}
    for kind, axes in (evaluation.nis or {}).items():
        figures[f"nis_mean_{kind}"] = {a: round(c.mean, RATIO_DIGITS) for a, c in axes.items()}
    for number, outage in enumerate(evaluation.outages, 1):
        found = {
            "start_s": outage.start_s,
            "duration_s": outage.duration_s,
            "east_m": outage.east_drift_m,
            "north_m": outage.north_drift_m,
            "up_m": outage.up_drift_m,
            "horizontal_m": outage.horizontal_drift_m,
            "heading_deg": outage.heading_drift_deg,
        }
        figures[f"drift_outage_{number:02d}"] = _known(found)
    summary = evaluation.outage_summary
    figures["drift_outages"] = {
        "count": summary.count,
        **_known(
            {
                "horizontal_median_m": summary.horizontal_median_m,
                "horizontal_rms_m": summary.horizontal_rms_m,
                "horizontal_max_m": summary.horizontal_max_m,
            }
        ),
    }
    counts = evaluation.counts
    rows = {
        "solution_rows": counts.solution_rows,
        "compared_rows": counts.compared_rows,
        "epoch_rows": counts.epoch_rows,
        "position_updates": counts.position_updates,
        "position_rejections": counts.position_rejections,
    }
    figures["counts"] = {name: count for name, count in rows.items() if count is not None}
    return {name: group for name, group in figures.items() if group}


def _gnss_figures(evaluation: Evaluation) -> Figures:
    """What only a run over observations has: changes of position, satellites, integers."""
    figures: Figures = {}
    if evaluation.geometry is None and evaluation.ambiguities is None:
        return figures
    for name, statistics in (
        ("position_change_rms_m", evaluation.position_change_error_m),
        ("position_change_std_m", evaluation.position_change_error_m),
        ("position_fixed_rms_m", evaluation.position_error_fixed_m),
    ):
        if statistics is not None:
            figure = "std" if "_std_" in name else "rms"
            figures[name] = {
                a: round(float(getattr(s, figure)), LENGTH_DIGITS) for a, s in statistics.items()
            }
    if evaluation.geometry is not None:
        for name, spreads in (
            ("satellites_mean", evaluation.geometry.satellites),
            ("pdop_mean", evaluation.geometry.pdop),
        ):
            figures[name] = {s: round(found.mean, RATIO_DIGITS) for s, found in spreads.items()}
    found = evaluation.ambiguities
    if found is not None:
        figures["epoch_share"] = {n: round(s, RATIO_DIGITS) for n, s in found.share.items()}
        counts = {"wrong": found.wrong_fixes, "longest_wrong_run": found.longest_wrong_run}
        figures["fixes"] = {n: count for n, count in counts.items() if count is not None}
    if evaluation.availability is not None:
        figures["availability"] = {"share": round(evaluation.availability.share, RATIO_DIGITS)}
    return figures


def moved(
    recorded: Mapping[str, Mapping[str, Number]],
    found: Mapping[str, Mapping[str, Number]],
    *,
    same_bits: bool = False,
) -> list[tuple[str, Number | None, Number | None]]:
    """Figures that differ: name, recorded, found; None where there is none.

    Parameters
    ----------
    recorded, found : mapping of group to mapping of name to number
    same_bits : bool
        Whether both are of the same rows: then a last digit may differ by rounding.
    """
    changes: list[tuple[str, Number | None, Number | None]] = []
    for group in _either(recorded, found):
        before, after = recorded.get(group, {}), found.get(group, {})
        for name in _either(before, after):
            old, new = before.get(name), after.get(name)
            if old == new:
                continue
            if same_bits and old is not None and new is not None:
                step = 10.0 ** -_digits(group, name)
                if isinstance(new, float) and abs(new - old) < _ROUNDING * step:
                    continue
            changes.append((f"{group}.{name}", old, new))
    return changes


def _known(values: Mapping[str, float | None]) -> dict[str, Number]:
    return {n: round(v, _digits("", n)) for n, v in values.items() if v is not None}


def _digits(group: str, name: str) -> int:
    """Digits after the point, by the unit at the end of a figure's name or its group's."""
    if name.endswith("_s") and not name.endswith("_m_s"):
        return TIME_DIGITS
    for text in (name, group):
        for unit, digits in _UNIT_DIGITS.items():
            if text.endswith(unit):
                return digits
    return RATIO_DIGITS


def _either(first: Mapping[str, object], second: Mapping[str, object]) -> list[str]:
    return [*first, *(name for name in second if name not in first)]
