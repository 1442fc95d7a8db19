"""Tables and tiles of an evaluation, whatever of it is there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from replay.view.labels import MINUS, NONE
from replay.view.markup import Table
from replay.view.station_figures import station_tables, station_tiles

_STATISTICS: Final = ("mean", "std", "rms", "p95", "max")
_ERRORS: Final = (
    ("position_error_m", "Position", "m"),
    ("position_change_error_m", "Position change", "m"),
    ("position_error_fixed_m", "Position, fixed", "m"),
    ("velocity_error_m_s", "Velocity", "m/s"),
    ("attitude_error_deg", "Attitude", "deg"),
)
_WITH_OUTAGES: Final = (
    ("position_error_all_m", "Position", "m"),
    ("velocity_error_all_m_s", "Velocity", "m/s"),
    ("attitude_error_all_deg", "Attitude", "deg"),
)
_OUTAGES: Final = (
    (("start_s",), "start [s]", 1),
    (("end_s",), "end [s]", 1),
    (("duration_s",), "duration [s]", 1),
    (("horizontal_drift_m",), "horizontal [m]", 2),
    (("drift_3d_m",), "3D [m]", 2),
    (("east_drift_m", "east"), "east [m]", 2),
    (("north_drift_m", "north"), "north [m]", 2),
    (("up_drift_m", "up"), "up [m]", 2),
    (("horizontal_max_m",), "worst horizontal [m]", 2),
    (("heading_drift_deg",), "heading [deg]", 2),
)
_TILES: Final = (
    ("Horizontal RMS", "position_error_m", "horizontal", "rms", "m"),
    ("Up RMS", "position_error_m", "up", "rms", "m"),
    ("3D 95 %", "position_error_m", "3d", "p95", "m"),
    ("Heading RMS", "attitude_error_deg", "heading", "rms", "deg"),
)
_WORDS: Final = {"3d": "3D", "nees": "NEES", "nis": "NIS", "none": ""}
_TOLD: Final = {key for key, *_ in _ERRORS + _WITH_OUTAGES} | {
    "outages", "run", "start_ns", "geometry", "ambiguities", "availability", "station",
}  # fmt: skip
_SYSTEMS: Final = {
    "gps": "GPS", "glonass": "GLONASS", "galileo": "Galileo", "beidou": "BeiDou", "qzss": "QZSS",
}  # fmt: skip


def number(value: Any, decimals: int) -> str:
    """A number for a table; a dash where there is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return NONE
    return f"{value:.{decimals}f}".replace("-", MINUS)


def headline(evaluation: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Label, value and unit of the figures that matter most."""
    found = [
        (label, number(value, 3), unit)
        for label, quantity, axis, statistic, unit in _TILES
        if (value := _at(evaluation, quantity, axis, statistic)) is not None
    ]
    drifts = [
        drift
        for outage in _list(evaluation.get("outages"))
        if isinstance(drift := outage.get("horizontal_drift_m"), int | float)
    ]
    for label, quantity, key in (
        ("Fixed", "ambiguities", "share"), ("Available", "availability", "share"),
    ):  # fmt: skip
        share = _at(evaluation, quantity, key, *(["fixed"] if quantity == "ambiguities" else []))
        if share is not None:
            found.append((label, number(100.0 * share, 1), "%"))
    found += station_tiles(_mapping(evaluation.get("station")))
    if drifts:
        found.append(("Worst horizontal drift in outages", number(max(drifts), 2), "m"))
    return found


def tables(evaluation: Mapping[str, Any]) -> list[Table]:
    """Errors, outages, consistency, then all else as names and values."""
    every = any(key in evaluation for key, *_ in _WITH_OUTAGES)
    first = "error against truth at updates outside outages" if every else "error against truth"
    return [
        *_error_table(evaluation, _ERRORS, first),
        *_error_table(evaluation, _WITH_OUTAGES, "error against truth at all rows"),
        *_outage_table(evaluation),
        *_geometry_table(evaluation),
        *_ambiguity_table(evaluation),
        *station_tables(_mapping(evaluation.get("station"))),
        *_consistency_table(evaluation),
        *_other_table(evaluation),
    ]


def _error_table(
    evaluation: Mapping[str, Any], quantities: Sequence[tuple[str, str, str]], title: str
) -> list[Table]:
    rows = [
        (
            f"{name} {_WORDS.get(axis, axis)} [{unit}]",
            *(number(figures.get(statistic), 3) for statistic in _STATISTICS),
        )
        for quantity, name, unit in quantities
        for axis, figures in _mapping(evaluation.get(quantity)).items()
        if isinstance(figures, Mapping)
    ]
    head = (title, "mean", "std", "RMS", "95 %", "greatest")
    return [Table(head, tuple(rows))] if rows else []


def _outage_table(evaluation: Mapping[str, Any]) -> list[Table]:
    outages = _list(evaluation.get("outages"))
    columns = [item for item in _OUTAGES if any(k in outage for outage in outages for k in item[0])]
    if not columns:
        return []
    rows = tuple(
        (
            str(i),
            *(
                number(next((outage[k] for k in keys if k in outage), None), decimals)
                for keys, _, decimals in columns
            ),
        )
        for i, outage in enumerate(outages, start=1)
    )
    return [Table(("outage, drift at its end", *(label for _, label, _ in columns)), rows)]


def _geometry_table(evaluation: Mapping[str, Any]) -> list[Table]:
    """Satellites used and PDOP by system."""
    geometry = _mapping(evaluation.get("geometry"))
    pdops = _mapping(geometry.get("pdop"))
    rows = tuple(
        (
            _SYSTEMS.get(system, system),
            *(number(counts.get(key), digits) for key, digits in (("mean", 1), ("min", 0))),
            *(number(_at(pdops, system, key), 2) for key in ("median", "mean", "p95", "max")),
            _plain(_mapping(pdops.get(system)).get("count")),
        )
        for system, counts in _mapping(geometry.get("satellites")).items()
    )
    head = (
        "satellites used, PDOP", "mean", "fewest", "PDOP median", "mean", "95 %", "greatest",
        "epochs with PDOP",
    )  # fmt: skip
    return [Table(head, rows)] if rows else []


def _ambiguity_table(evaluation: Mapping[str, Any]) -> list[Table]:
    """Statuses of epochs, wrong fixes, ratios, availability, as names and values."""
    found = _mapping(evaluation.get("ambiguities"))
    rows: list[tuple[str, str]] = [
        (f"epochs {name} [%]", number(100.0 * float(share), 1))
        for name, share in _mapping(found.get("share")).items()
    ]
    if found:
        limit = number(found.get("wrong_fix_limit_m"), 2)
        rows += [
            ("fixed epochs with truth", _plain(found.get("fixed_with_truth"))),
            (f"wrong fixes, over {limit} m horizontally", _plain(found.get("wrong_fixes"))),
            ("most wrong fixes in a row", _plain(found.get("longest_wrong_run"))),
            ("attempts at integers", _plain(found.get("attempts"))),
            ("attempts that fixed", _plain(found.get("accepted"))),
            ("ratio, median", number(_at(found, "ratio", "median"), 2)),
        ]
    available = _mapping(evaluation.get("availability"))
    if available:
        rows += [
            ("epochs of observation", _plain(available.get("observation_epochs"))),
            ("of these with a solution", _plain(available.get("solution_epochs"))),
        ]
    return (
        [Table(("ambiguities and availability" if found else "availability", ""), tuple(rows))]
        if rows
        else []
    )


def _consistency_table(evaluation: Mapping[str, Any]) -> list[Table]:
    """NEES and NIS: the mean should be the dimension, and 95 % lie inside."""
    rows = tuple(
        (
            name,
            _plain(found.get("dimension")),
            _plain(found.get("count")),
            number(found.get("mean"), 2),
            " to ".join(number(bound, 2) for bound in found.get("bounds_95", ())),
            number(100.0 * float(found["inside_fraction"]), 1),
            _plain(found.get("rejected")),
        )
        for name, found in _consistencies(evaluation, "")
    )
    head = ("consistency", "dimension", "count", "mean", "95 % of means", "inside [%]", "rejected")
    return [Table(head, rows)] if rows else []


def _consistencies(value: Any, name: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if _is_consistency(value):
        yield name, value
    else:
        for key, item in _mapping(value).items():
            yield from _consistencies(item, f"{name} {_word(key)}".strip())


def _is_consistency(value: Any) -> bool:
    return isinstance(_mapping(value).get("inside_fraction"), int | float)


def _other_table(evaluation: Mapping[str, Any]) -> list[Table]:
    rest = {key: value for key, value in evaluation.items() if key not in _TOLD}
    rows = tuple(_leaves(rest, ""))
    return [Table(("figure", "value"), rows, text_columns=2)] if rows else []


def _leaves(value: Any, name: str) -> Iterator[tuple[str, str]]:
    """Names joined by spaces, and values as text, down to the last level."""
    if _is_consistency(value):
        return  # told in a table of its own
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, f"{name} {_word(key)}".strip())
    elif isinstance(value, list | tuple):
        yield name, ", ".join(_plain(item) for item in value)
    else:
        yield name, _plain(value)


def _word(key: str) -> str:
    return _WORDS.get(key, str(key).replace("_", " "))


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.5g}".replace("-", MINUS) if math.isfinite(value) else NONE
    return NONE if value is None else str(value)


def _at(value: Any, *keys: str) -> float | None:
    for key in keys:
        value = _mapping(value).get(key)
    return value if isinstance(value, int | float) else None


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _list(value: Any) -> list[Mapping[str, Any]]:
    return [item for item in value if isinstance(item, Mapping)] if isinstance(value, list) else []
