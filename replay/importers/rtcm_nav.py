"""Ephemerides of RTCM 3: messages 1019, 1020, 1042, 1044, 1045, 1046 (RTCM 10403.3, 3.5.9)."""

from __future__ import annotations

from typing import Any, Final

from replay.importers.navbits import SEMICIRCLE_RAD, Bits, accuracy_m, near, new_record
from replay.importers.navbits_beidou import BDT_BEHIND_S, WEEKS_BEHIND
from replay.importers.navbits_galileo import (
    GST_WEEKS_BEHIND,
    SOURCE_FNAV,
    SOURCE_INAV_E1,
    sisa_m,
)
from replay.importers.navbits_glonass import dated
from replay.importers.navbits_gps import fit_s
from replay.kernels.ephemeris import SYSTEM_BEIDOU, SYSTEM_GALILEO, SYSTEM_GLONASS
from replay.time import NS_PER_WEEK

Layout = tuple[tuple[str, int, float], ...]

_PI: Final = SEMICIRCLE_RAD
# Fields in their order: name, bits (negative where two's complement), scale.
_ORBIT_GPS: Final[Layout] = (
    ("crs", -16, 2.0**-5), ("delta_n", -16, 2.0**-43 * _PI), ("m0", -32, 2.0**-31 * _PI),
    ("cuc", -16, 2.0**-29), ("eccentricity", 32, 2.0**-33), ("cus", -16, 2.0**-29),
    ("sqrt_a", 32, 2.0**-19), ("toe_s", 16, 16.0), ("cic", -16, 2.0**-29),
    ("omega0", -32, 2.0**-31 * _PI), ("cis", -16, 2.0**-29), ("i0", -32, 2.0**-31 * _PI),
    ("crc", -16, 2.0**-5), ("omega", -32, 2.0**-31 * _PI), ("omega_dot", -24, 2.0**-43 * _PI),
)  # fmt: skip
_I_DOT: Final = ("i_dot", -14, 2.0**-43 * _PI)
_CLOCK_GPS: Final[Layout] = (
    ("toc", 16, 16.0), ("af2", -8, 2.0**-55), ("af1", -16, 2.0**-43), ("af0", -22, 2.0**-31),
)  # fmt: skip
_TGD: Final = ("group_delay_1_s", -8, 2.0**-31)
_GPS: Final[Layout] = (
    ("week", 10, 1), ("accuracy", 4, 1), ("l2", 2, 1), _I_DOT, ("iode", 8, 1), *_CLOCK_GPS,
    ("iodc", 10, 1), *_ORBIT_GPS, _TGD, ("health", 6, 1), ("l2p", 1, 1), ("fit", 1, 1),
)  # fmt: skip
_QZSS: Final[Layout] = (
    *_CLOCK_GPS, ("iode", 8, 1), *_ORBIT_GPS, _I_DOT, ("l2", 2, 1), ("week", 10, 1),
    ("accuracy", 4, 1), ("health", 6, 1), _TGD, ("iodc", 10, 1), ("fit", 1, 1),
)  # fmt: skip
_BEIDOU: Final[Layout] = (
    ("week", 13, 1), ("accuracy", 4, 1), _I_DOT, ("iode", 5, 1), ("toc", 17, 8.0),
    ("af2", -11, 2.0**-66), ("af1", -22, 2.0**-50), ("af0", -24, 2.0**-33), ("iodc", 5, 1),
    ("crs", -18, 2.0**-6), ("delta_n", -16, 2.0**-43 * _PI), ("m0", -32, 2.0**-31 * _PI),
    ("cuc", -18, 2.0**-31), ("eccentricity", 32, 2.0**-33), ("cus", -18, 2.0**-31),
    ("sqrt_a", 32, 2.0**-19), ("toe_s", 17, 8.0), ("cic", -18, 2.0**-31),
    ("omega0", -32, 2.0**-31 * _PI), ("cis", -18, 2.0**-31), ("i0", -32, 2.0**-31 * _PI),
    ("crc", -18, 2.0**-6), ("omega", -32, 2.0**-31 * _PI), ("omega_dot", -24, 2.0**-43 * _PI),
    ("group_delay_1_s", -10, 1e-10), ("group_delay_2_s", -10, 1e-10), ("health", 1, 1),
)  # fmt: skip
_GALILEO: Final[Layout] = (
    ("week", 12, 1), ("iode", 10, 1), ("accuracy", 8, 1), _I_DOT, ("toc", 14, 60.0),
    ("af2", -6, 2.0**-59), ("af1", -21, 2.0**-46), ("af0", -31, 2.0**-34),
    *_ORBIT_GPS[:7], ("toe_s", 14, 60.0), *_ORBIT_GPS[8:],
    ("group_delay_1_s", -10, 2.0**-32),
)  # fmt: skip
_FNAV: Final[Layout] = (*_GALILEO, ("e5a", 2, 1), ("e5a_valid", 1, 1))
_INAV: Final[Layout] = (
    *_GALILEO, ("group_delay_2_s", -10, 2.0**-32), ("e5b", 2, 1), ("e5b_valid", 1, 1),
    ("e1", 2, 1), ("e1_valid", 1, 1),
)  # fmt: skip
MESSAGES: Final = (1019, 1020, 1042, 1044, 1045, 1046)


class WrongWeekError(ValueError):
    """The message's week is not that of the approximate time."""


def ephemeris(number: int, bits: Bits, now_ns: int) -> Any:
    """A record of EPHEMERIS_DTYPE from a message that came at a time.

    Parameters
    ----------
    number : int
        Of the message, which is one of MESSAGES.
    bits : Bits
        After the message's number.
    now_ns : int, ns
        GPS time. RTCM does not say when a satellite sent a message: this stands for it.

    Raises
    ------
    ValueError
        Where the message is too short.
    WrongWeekError
        Where its week does not fit `now_ns`.
    """
    if number == 1020:
        return _glonass(bits, now_ns)
    if number == 1042:
        record, extra = _fill(SYSTEM_BEIDOU, bits.u(6), _BEIDOU, bits)
        _check_week(extra["week"], 8192, WEEKS_BEHIND, now_ns)
        record["accuracy_m"] = accuracy_m(extra["accuracy"])
        ahead = BDT_BEHIND_S
    elif number in (1045, 1046):
        layout = _FNAV if number == 1045 else _INAV
        record, extra = _fill(SYSTEM_GALILEO, bits.u(6), layout, bits)
        _check_week(extra["week"], 4096, GST_WEEKS_BEHIND, now_ns)
        record["accuracy_m"] = sisa_m(extra["accuracy"])
        record["iodc"] = record["iode"]
        record["source"] = SOURCE_FNAV if number == 1045 else SOURCE_INAV_E1
        record["health"] = sum(
            extra.get(name, 0) << shift
            for name, shift in (
                ("e1_valid", 0), ("e1", 1), ("e5a_valid", 3), ("e5a", 4), ("e5b_valid", 6),
                ("e5b", 7),
            )
        )  # fmt: skip
        ahead = 0
    else:
        system, layout, width = ("G", _GPS, 6) if number == 1019 else ("J", _QZSS, 4)
        record, extra = _fill(ord(system), bits.u(width), layout, bits)
        _check_week(extra["week"], 1024, 0, now_ns)
        record["accuracy_m"] = accuracy_m(extra["accuracy"])
        record["fit_s"] = fit_s(system, extra["fit"], int(record["iodc"]))
        ahead = 0
    record["toe_ns"] = near(float(record["toe_s"]), now_ns, ahead)
    record["toc_ns"] = near(extra["toc"], now_ns, ahead)
    record["transmitted_ns"] = now_ns
    return record


def _fill(system: int, prn: int, layout: Layout, bits: Bits) -> tuple[Any, dict[str, Any]]:
    """The record, and what has no field in it."""
    record = new_record(system, prn)
    extra: dict[str, Any] = {}
    for name, width, scale in layout:
        value = (bits.u(width) if width > 0 else bits.s(-width)) * scale
        if record.dtype.fields is not None and name in record.dtype.fields:
            record[name] = value
        else:
            extra[name] = value
    return record, extra


def _check_week(week: int, rollover: int, behind: int, now_ns: int) -> None:
    """Messages may be of the week before or after around its end."""
    ahead = (week + behind - now_ns // NS_PER_WEEK) % rollover
    if ahead not in (0, 1, rollover - 1):
        raise WrongWeekError


def _glonass(bits: Bits, now_ns: int) -> Any:
    record = new_record(SYSTEM_GLONASS, bits.u(6))
    channel = bits.u(5) - 7
    bits.skip(4)
    frame = bits.u(5) * 3600 + bits.u(6) * 60 + bits.u(1) * 30
    health = bits.u(1)
    bits.skip(1)
    interval = bits.u(7)
    for axis in range(3):
        record["velocity_m_s"][axis] = bits.sign_magnitude(24) * 2.0**-20 * 1e3
        record["position_m"][axis] = bits.sign_magnitude(27) * 2.0**-11 * 1e3
        record["acceleration_m_s2"][axis] = bits.sign_magnitude(5) * 2.0**-30 * 1e3
    bits.skip(1)
    record["af1"] = bits.sign_magnitude(11) * 2.0**-40
    bits.skip(3)
    record["af0"] = -bits.sign_magnitude(22) * 2.0**-30
    return dated(record, channel, health, interval, frame, now_ns)
