"""What is to be done to a log, as a person writes it and as a manifest repeats it."""

from __future__ import annotations

import dataclasses
import enum
import re
from collections.abc import Sequence
from typing import Annotated, Any, Final

from msgspec import Meta

from replay.configuration import Section, quantity, to_si
from replay.errors import UsageError
from replay.time import NS_PER_S

_SATELLITE: Final = re.compile(r"[GRECJIS]\d\d")
_SIGNAL: Final = re.compile(r"[GRECJIS]\d[A-Z]")
_SYSTEM: Final = re.compile(r"[GRECJIS]")

# Fields that noise can be added to, by channel kind: the field, and what a person may write.
NOISE_FIELDS: Final[dict[str, dict[str, str]]] = {
    "IMU": {
        "angular_rate": "angular_rate_body_rad_s",
        "specific_force": "specific_force_body_m_s2",
    },
    "GNSS_OBS": {
        "pseudorange": "pseudorange_m",
        "carrier_phase": "carrier_phase_cycles",
        "doppler": "doppler_hz",
    },
}
_UNITS: Final = {
    "angular_rate_body_rad_s": "rad/s",
    "specific_force_body_m_s2": "m/s^2",
    "pseudorange_m": "m",
    "carrier_phase_cycles": "cycle",
    "doppler_hz": "Hz",
}


class Method(enum.StrEnum):
    """How inertial samples become fewer."""

    INTEGRATE = "integrate"
    DECIMATE = "decimate"


class Transform(Section, frozen=True):
    """What is done to a log; fields stand in the order in which it is done."""

    remove_systems: Annotated[
        tuple[str, ...], Meta(description="RINEX letters whose observations go, of all receivers")
    ] = ()
    remove_satellites: Annotated[
        tuple[str, ...], Meta(description="RINEX 3 satellites whose observations go, as G05")
    ] = ()
    remove_signals: Annotated[
        tuple[str, ...], Meta(description="system and RINEX 3 signal that go, as G2W")
    ] = ()
    outage: Annotated[
        tuple[str, ...],
        Meta(description="START,SECONDS without GNSS; ,keep=3 or keep=low:3 or keep=G05+G12"),
    ] = ()
    every: Annotated[float, quantity("s", "each outage comes again after so long; 0 for once")] = (
        0.0
    )
    leave_last: Annotated[
        float, quantity("s", "with `every`: what stays whole at the end of the log")
    ] = 30.0
    imu_rate: Annotated[float, quantity("Hz", "of inertial samples; 0 for as they are")] = 0.0
    imu_method: Annotated[
        str, Meta(description="integrate, or decimate: every n-th sample as it stands")
    ] = Method.INTEGRATE.value
    noise: Annotated[
        tuple[str, ...],
        Meta(description="TOPIC.FIELD=DEVIATION of white noise on every sample that is written"),
    ] = ()
    seed: Annotated[int, Meta(description="of the noise")] = 0
    time_offset: Annotated[
        tuple[str, ...], Meta(description="TOPIC=SECONDS added to valid and log times")
    ] = ()

    @property
    def method(self) -> Method:
        """How inertial samples become fewer.

        Raises
        ------
        UsageError
            For an unknown word.
        """
        try:
            return Method(self.imu_method)
        except ValueError:
            known = ", ".join(method.value for method in Method)
            raise UsageError(f"no method {self.imu_method!r}", mend=f"known: {known}") from None

    def check(self) -> None:
        """Refuse words that are no names, and a transform that does nothing.

        Raises
        ------
        UsageError
        """
        for words, pattern, what in (
            (self.remove_systems, _SYSTEM, "system: write its RINEX letter, as R"),
            (self.remove_satellites, _SATELLITE, "satellite: write it as G05"),
            (self.remove_signals, _SIGNAL, "signal: write system, band and attribute, as G2W"),
        ):
            for word in words:
                if pattern.fullmatch(word) is None:
                    raise UsageError(f"{word!r} is no {what.split(':')[0]}", mend=what)
        if not 0.0 <= self.imu_rate < float("inf"):
            raise UsageError(f"imu_rate is {self.imu_rate}", mend="write --imu-rate HERTZ")
        if self.every < 0.0 or self.leave_last < 0.0:
            raise UsageError("seconds between outages, and at the end, are 0 or more")
        if not (0 <= self.seed < 1 << 63):
            raise UsageError(f"seed is {self.seed}", mend="take a whole number, 0 or more")
        _ = self.method

    @property
    def nothing(self) -> bool:
        """Whether it leaves a log as it is."""
        return not (
            self.remove_systems
            or self.remove_satellites
            or self.remove_signals
            or self.outage
            or self.imu_rate
            or self.noise
            or self.time_offset
        )


@dataclasses.dataclass(frozen=True, slots=True)
class NoiseTerm:
    """White noise on one field.

    Attributes
    ----------
    topic, field : str
    deviation : float
        In the field's unit.
    """

    topic: str
    field: str
    deviation: float

    def __str__(self) -> str:
        return f"{self.topic}.{self.field}={self.deviation!r}"


def parse_noise(text: str, kind_of: Any) -> NoiseTerm:
    """`TOPIC.FIELD=DEVIATION`, the field whole or by its name without unit and frame.

    Parameters
    ----------
    text : str
    kind_of : callable
        Name of a topic's kind in `replay.channels`; raises where the log lacks the topic.

    Raises
    ------
    UsageError
    """
    left, sign, value = text.rpartition("=")
    topic, dot, name = left.rpartition(".")
    if not (sign and dot):
        raise UsageError(
            f"{text!r} is no noise", mend='write --noise "/imu/raw.angular_rate=0.1 deg/s"'
        )
    fields = NOISE_FIELDS.get(kind_of(topic), {})
    if not fields:
        raise UsageError(
            f"no noise can be added to {topic}",
            mend="it can be added to inertial samples and observations",
        )
    field = fields.get(name, name)
    if field not in fields.values():
        raise UsageError(f"no noise for {name} of {topic}", mend=f"known: {', '.join(fields)}")
    deviation = _deviation(value.strip(), _UNITS[field], text)
    if not 0.0 <= deviation < float("inf"):
        raise UsageError(f"{text!r}: a deviation is 0 or more")
    return NoiseTerm(topic, field, deviation)


def _deviation(value: str, unit: str, name: str) -> float:
    if unit != "cycle":
        return to_si(value, unit, name)
    try:
        return float(value.removesuffix("cycles").removesuffix("cycle"))
    except ValueError:
        raise UsageError(f"{name!r}: {value!r} is no number of cycles") from None


def parse_time_offset(text: str) -> tuple[str, int]:
    """`TOPIC=SECONDS` as topic and nanoseconds.

    Raises
    ------
    UsageError
    """
    topic, sign, value = text.rpartition("=")
    if not sign or not topic:
        raise UsageError(f"{text!r} is no time offset", mend='write --time-offset "/imu/raw=5 ms"')
    seconds = to_si(value.strip(), "s", text)
    if not abs(seconds) < 1e6:
        raise UsageError(f"{text!r}: an offset is less than a million seconds")
    return topic, round(seconds * NS_PER_S)


def comma_separated(texts: Sequence[str]) -> tuple[str, ...]:
    """Words of options that may be repeated and may hold several: `G05,G12`."""
    return tuple(word.strip() for text in texts for word in text.split(",") if word.strip())
