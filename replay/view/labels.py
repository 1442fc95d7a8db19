"""Words for the numbers of enumerations, and how grave an event is."""

from __future__ import annotations

from typing import Final

from replay.schemas import filter_pb2, gnss_pb2, sights_pb2, solution_pb2
from replay.view.palette import OUTAGE, Ink

SIGMA: Final = "\N{GREEK SMALL LETTER SIGMA}"
BOUNDS: Final = f"±3{SIGMA}"
TIMES: Final = "\N{MULTIPLICATION SIGN}"
NONE: Final = "\N{EN DASH}"
MINUS: Final = "\N{MINUS SIGN}"
BODY_AXES: Final = ("x forward", "y right", "z down")
LOCAL_AXES: Final = ("east", "north", "up")
ATTITUDE_ANGLES: Final = ("roll", "pitch", "heading")

_ACRONYMS: Final = ("GNSS", "IMU", "PPP", "RTK", "DGNSS")
_INFO, _WARN, _ERROR, _CRITICAL = "INFO", "WARN", "ERROR", "CRITICAL"
_LEVELS: Final[dict[int, str]] = {
    filter_pb2.EVENT_KIND_MEASUREMENT_REJECTED: _WARN,
    filter_pb2.EVENT_KIND_OUTAGE_BEGIN: _WARN,
    filter_pb2.EVENT_KIND_IMU_GAP: _WARN,
    filter_pb2.EVENT_KIND_RESET: _WARN,
    filter_pb2.EVENT_KIND_TOO_FEW_SATELLITES: _WARN,
    filter_pb2.EVENT_KIND_NOT_CONVERGED: _WARN,
    filter_pb2.EVENT_KIND_NO_EPHEMERIS: _WARN,
    filter_pb2.EVENT_KIND_CHAIN_BROKEN: _WARN,
    filter_pb2.EVENT_KIND_AMBIGUITIES_LOST: _WARN,
    filter_pb2.EVENT_KIND_CLOCK_JUMP: _WARN,
    filter_pb2.EVENT_KIND_BASE_LOST: _WARN,
    filter_pb2.EVENT_KIND_PRODUCT_LACKING: _WARN,
    filter_pb2.EVENT_KIND_PRODUCT_CONTINUED: _WARN,
    filter_pb2.EVENT_KIND_FRAMES_DIFFER: _ERROR,
    filter_pb2.EVENT_KIND_TIME_BACKWARD: _ERROR,
    filter_pb2.EVENT_KIND_NOT_FINITE: _CRITICAL,
}
_GREY: Final = Ink((150, 150, 150), (150, 150, 150))
QUALITY_INKS: Final = {
    "unknown": _GREY,
    "single": Ink((214, 120, 60), (214, 120, 60)),
    "DGNSS": Ink((220, 170, 60), (220, 170, 60)),
    "PPP float": Ink((190, 190, 70), (190, 190, 70)),
    "PPP fixed": Ink((90, 190, 110), (90, 190, 110)),
    "RTK float": Ink((200, 180, 60), (200, 180, 60)),
    "RTK fixed": Ink((60, 170, 90), (60, 170, 90)),
    "fused": Ink((80, 150, 220), (80, 150, 220)),
    "no fix": OUTAGE,
}
STATUS_INKS: Final = {
    "unknown": _GREY,
    "aided": Ink((60, 170, 90), (60, 170, 90)),
    "outage": OUTAGE,
    "single": QUALITY_INKS["single"],
    "DGNSS": QUALITY_INKS["DGNSS"],
    "float": QUALITY_INKS["RTK float"],
    "fixed": QUALITY_INKS["RTK fixed"],
    "chained": QUALITY_INKS["fused"],
}
SYSTEMS: Final = {
    "G": "GPS", "R": "GLONASS", "E": "Galileo", "C": "BeiDou", "J": "QZSS", "S": "SBAS",
    "I": "NavIC",
}  # fmt: skip


def _words(name: str, prefix: str) -> str:
    parts = name.removeprefix(prefix).split("_")
    words = " ".join(word if word in _ACRONYMS else word.lower() for word in parts)
    return words.replace("non holonomic", "non-holonomic")


def quality(number: int) -> str:
    """Word for a FixQuality."""
    names = {v.number: v.name for v in gnss_pb2.FixQuality.DESCRIPTOR.values}
    return _words(names.get(number, str(number)), "FIX_QUALITY_")


def status(number: int) -> str:
    """Word for a SolutionStatus; predicted and updated rows alternate and are both `aided`."""
    if number in (solution_pb2.SOLUTION_STATUS_PREDICTED, solution_pb2.SOLUTION_STATUS_UPDATED):
        return "aided"
    names = {v.number: v.name for v in solution_pb2.SolutionStatus.DESCRIPTOR.values}
    return _words(names.get(number, "unknown"), "SOLUTION_STATUS_")


def system(letter: str) -> str:
    """Name of a satellite system by its RINEX letter."""
    return SYSTEMS.get(letter, letter)


def detector(number: int) -> str:
    """Word for a SlipDetector."""
    names = {v.number: v.name for v in sights_pb2.SlipDetector.DESCRIPTOR.values}
    return _words(names.get(number, str(number)), "SLIP_DETECTOR_")


def measurement_kind(number: int) -> str:
    """Word for a MeasurementKind."""
    names = {v.number: v.name for v in filter_pb2.MeasurementKind.DESCRIPTOR.values}
    return _words(names.get(number, str(number)), "MEASUREMENT_KIND_")


def measurement_axis(number: int) -> str:
    """Word for a MeasurementAxis; empty for a scalar measurement."""
    names = {v.number: v.name for v in filter_pb2.MeasurementAxis.DESCRIPTOR.values}
    word = _words(names.get(number, str(number)), "MEASUREMENT_AXIS_")
    return "" if word == "none" else word


def measurement_unit(number: int) -> str:
    """Unit of an innovation of a MeasurementKind."""
    units: dict[int, str] = {
        filter_pb2.MEASUREMENT_KIND_POSITION: "m",
        filter_pb2.MEASUREMENT_KIND_PSEUDORANGE: "m",
        filter_pb2.MEASUREMENT_KIND_CARRIER_PHASE: "m",
        filter_pb2.MEASUREMENT_KIND_TIME_DIFFERENCED_PHASE: "m",
        filter_pb2.MEASUREMENT_KIND_DISPLACEMENT: "m",
        filter_pb2.MEASUREMENT_KIND_VELOCITY: "m/s",
        filter_pb2.MEASUREMENT_KIND_ZERO_VELOCITY: "m/s",
        filter_pb2.MEASUREMENT_KIND_NON_HOLONOMIC: "m/s",
        filter_pb2.MEASUREMENT_KIND_DOPPLER: "m/s",
        filter_pb2.MEASUREMENT_KIND_ZERO_ANGULAR_RATE: "rad/s",
        filter_pb2.MEASUREMENT_KIND_HEADING: "rad",
    }
    return units.get(number, "as measured")


def event_kind(number: int) -> str:
    """Word for an EventKind."""
    names = {v.number: v.name for v in filter_pb2.EventKind.DESCRIPTOR.values}
    return _words(names.get(number, str(number)), "EVENT_KIND_")


def event_level(number: int) -> str:
    """How grave an EventKind is: INFO, WARN, ERROR or CRITICAL."""
    return _LEVELS.get(number, _INFO)
