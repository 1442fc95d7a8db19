"""What is changed against case 1 of Lee (2010): one thing at a time.

Runs of one log share it. The flight ends before its fourth line, so that all of it takes
minutes.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from replay import batch
from replay.batch.study import Member, Variant
from replay.simulate.imu import IMU_GRADES

_LEE: Final = Path(batch.__file__).parent / "lee2010"
SCENARIO: Final = _LEE / "case1.toml"
_MASTER: Final = "mref"
_LINES: Final = 3  # of the seven
# Middle of these lines [deg], and the mean distance of the flight from the master [km].
_MIDDLE: Final = {"latitude": 35.3127, "longitude": 128.5841}
_DISTANCE_KM: Final = 58.4

AS_IS: Final = "as-is"
PLAIN, SINGLE, ALONE, FITTED = "network", "single", "no-imu", "fitted"
# What is true of the sky of case 1: errors of orbits of 1 m are 5e-8 of a baseline, and errors
# that are each satellite's own change in proportion to the distance.
FITTED_SETTINGS: Final = ("integers.orbit_sigma=5e-8", "interpolation.curvature=1e-13")
REFERENCES: Final = {"references-3": ("ref1", "ref2"), "references-2": ("ref1",)}
METHODS: Final = {
    "lim": "LIM, plane",
    "lcm": "LCM, combination",
    "dim": "DIM, distances",
    "lsc": "LSC, collocation",
}
DISTANCES_KM: Final = (30, 100, 150)

# A wave is a medium-scale travelling disturbance; a front is a storm's edge with a slope of
# 10 ppm, which comes from the north-west and passes the master while the aircraft flies.
IONOSPHERES: Final[dict[str, dict[str, Any]]] = {
    "quiet": {
        "alpha": [1.1176e-8, 1.4901e-8, -5.9605e-8, -1.1921e-7],
        "beta": [1.1674e5, 1.4746e5, -1.3107e5, -3.9322e5],
        "scale": 1.0,
        "residual": "0.02 m",
        "gradient": "0.2 ppm",
    },
    **{
        f"wave-{cm}cm": {
            "wave": {"amplitude": f"{cm / 100:g} m", "length": "150 km", "speed": "150 m/s",
                     "direction": "160 deg"},
        }
        for cm in (1, 10, 30)
    },
    "front": {
        "front": {"height": "1 m", "width": "100 km", "speed": "100 m/s",
                  "direction": "135 deg", "place": "-150 km"},
    },
}  # fmt: skip
IMUS: Final = ("industrial", "consumer")


@dataclasses.dataclass(frozen=True, slots=True)
class Setting:
    """One value of what a sweep changes.

    Attributes
    ----------
    text : str
        As a person reads it.
    member : str
    runs : tuple of str
        Variants of the member.
    """

    text: str
    member: str
    runs: tuple[str, ...] = (PLAIN,)


@dataclasses.dataclass(frozen=True, slots=True)
class Sweep:
    """What is changed, and its values."""

    title: str
    settings: tuple[Setting, ...]


_BOTH: Final = (PLAIN, SINGLE)
_ALL: Final = (PLAIN, FITTED, SINGLE)
SWEEPS: Final = (
    Sweep(
        "reference stations",
        (
            Setting("4", AS_IS),
            Setting("3", AS_IS, ("references-3",)),
            Setting("2", AS_IS, ("references-2",)),
            Setting("1", AS_IS, (SINGLE,)),
        ),
    ),
    Sweep(
        "distance from the master",
        (
            Setting("30 km", "30km", _BOTH),
            Setting("58 km", AS_IS, _ALL),
            *(Setting(f"{km} km", f"{km}km", _ALL) for km in DISTANCES_KM[1:]),
        ),
    ),
    Sweep(
        "ionosphere",
        (
            Setting("quiet", "quiet", _BOTH),
            Setting("as in case 1", AS_IS, _BOTH),
            Setting("wave of 1 cm", "wave-1cm", _BOTH),
            Setting("wave of 10 cm", "wave-10cm", _BOTH),
            Setting("wave of 30 cm", "wave-30cm", _BOTH),
            Setting("front of 1 m", "front", _BOTH),
        ),
    ),
    Sweep(
        "inertial unit",
        (
            Setting("tactical", AS_IS),
            Setting("MEMS, industrial", "industrial"),
            Setting("MEMS, consumer", "consumer"),
            Setting("none", AS_IS, (ALONE,)),
        ),
    ),
    Sweep(
        "interpolation",
        tuple(
            Setting(words, AS_IS, (PLAIN if name == "lim" else name,))
            for name, words in METHODS.items()
        ),
    ),
)


def members() -> tuple[Member, ...]:
    """Logs and the runs over each."""
    plain, single = _variant(PLAIN), _variant(SINGLE)
    both = (plain, single)
    fitted = _variant(FITTED, FITTED_SETTINGS)
    far = (plain, fitted, single)
    flight = {"segments": _segments()}
    stations = {
        name: _variant(name, (f"network.stations=[{', '.join(map(repr, others))}]",))
        for name, others in REFERENCES.items()
    }
    methods = [_variant(name, (f"interpolation.method={name}",)) for name in METHODS]
    alone = _variant(ALONE, pipeline="network-rtk")
    return (
        _member(AS_IS, (plain, *stations.values(), *methods[1:], alone, fitted, single), flight),
        *(
            _member(f"{km}km", both if km == DISTANCES_KM[0] else far, flight, _moved(km))
            for km in DISTANCES_KM
        ),
        *(
            _member(name, both, flight, {"sky": {"ionosphere": table}})
            for name, table in IONOSPHERES.items()
        ),
        *(_member(name, (plain,), flight, _imu(name)) for name in IMUS),
    )


def _variant(
    name: str, settings: tuple[str, ...] = (), pipeline: str = "network-ins-tc"
) -> Variant:
    mode = SINGLE if name == SINGLE else PLAIN
    return Variant(name, pipeline, (f"mode={mode}", f"name={name}", *settings),
                   cost=1.0 if name == SINGLE else 2.0)  # fmt: skip


def _member(label: str, variants: tuple[Variant, ...], *tables: Mapping[str, Any]) -> Member:
    return Member(label, SCENARIO, tables, variants)


def _segments() -> list[dict[str, Any]]:
    """Manoeuvres up to the turn after the last line that is flown."""
    table = tomllib.loads(SCENARIO.read_text(encoding="utf-8"))
    segments: list[dict[str, Any]] = table["segments"]
    ends = [i for i, item in enumerate(segments) if item.get("to") == "50 m/s"]
    return segments[: ends[_LINES - 1]]


def _moved(distance_km: int) -> dict[str, Any]:
    """Stations and start, in latitude and longitude from the master as many times as far.

    The flight is of the same size, so it is its middle that is moved.
    """
    factor = distance_km / _DISTANCE_KM
    place = tomllib.loads(SCENARIO.read_text(encoding="utf-8"))["start"]
    start: dict[str, str] = {}
    sky = tomllib.loads((_LEE / "sky.toml").read_text(encoding="utf-8"))
    receivers: list[dict[str, Any]] = sky["receivers"]
    master = next(item for item in receivers if item["name"] == _MASTER)
    moved = [dict(item) for item in receivers]
    for axis, middle in _MIDDLE.items():
        origin = _degrees(master[axis])
        shift = (factor - 1.0) * (middle - origin)
        start[axis] = f"{_degrees(place[axis]) + shift:.9f} deg"
        for item in moved:
            if axis in item:
                away = _degrees(item[axis]) - origin
                item[axis] = f"{origin + factor * away:.9f} deg"
    return {"start": start, "receivers": moved}


def _degrees(text: str) -> float:
    """Number of degrees of "35.72 deg"."""
    number, unit = text.split()
    if unit != "deg":
        raise ValueError(f"{text} is not in degrees")
    return float(number)


def _imu(grade: str) -> dict[str, Any]:
    """Errors of a grade in the place of all that the scenario has."""
    table = tomllib.loads(SCENARIO.read_text(encoding="utf-8"))
    errors = {
        name: "1 h" if name.endswith("_tau") else 0.0 for name in table["imu"]["errors"]
    } | dict(IMU_GRADES[grade])
    return {"imu": {"grade": grade, "errors": errors}}
