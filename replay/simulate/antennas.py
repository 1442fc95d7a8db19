"""Antennas of a scenario, `[[antennas]]`, and their calibrations as rows of the log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final

import numpy as np

from replay.configuration import Section, build, quantity
from replay.errors import ConfigurationError
from replay.gnss.signals import frequency_hz
from replay.kernels.gnss_records import SYSTEM_LETTERS
from replay.log.columns import Columns, Ragged, starts

_LONGEST_NAME: Final = 20  # of ANTEX: type and radome


class Centre(Section, frozen=True):
    """Phase centre on one frequency."""

    frequency: str  # of ANTEX: system and RINEX band, as G01
    # Reference point to mean phase centre. On a vehicle the mark points forward: these are
    # forward, right and up of the body.
    offset: tuple[Annotated[float, quantity("m", "north, east, up")], ...] = (0.0, 0.0, 0.0)
    # At zenith angles from 0 in steps of the antenna; none is none, beyond the last as at it.
    variation: tuple[Annotated[float, quantity("m", "added to the range")], ...] = ()


class Antenna(Section, frozen=True):
    """A kind of antenna. Signals without a frequency of their own have GPS's nearest."""

    name: str  # type and radome
    calibrated: bool = True  # the log tells offsets and variations
    step: Annotated[float, quantity("rad", "of the zenith angle in variations")] = np.pi / 36.0
    frequencies: tuple[Centre, ...] = ()


def read_antennas(tables: Any) -> tuple[Antenna, ...]:
    """Antennas of a scenario's tables.

    Raises
    ------
    ConfigurationError
        For an unknown key, a wrong type, an impossible value.
    """
    if not _are_tables(tables):
        raise ConfigurationError("antennas is no list", mend="write [[antennas]], one each")
    antennas: list[Antenna] = []
    for index, table in enumerate(tables):
        where = f"antennas[{index}]"
        try:
            antenna = _read(table)
            _check(antenna)
        except ConfigurationError as error:
            raise ConfigurationError(error.what, where=where, mend=error.mend) from error
        if antenna.name in (other.name for other in antennas):
            raise ConfigurationError(f"two antennas are called {antenna.name!r}", where=where)
        antennas.append(antenna)
    return tuple(antennas)


def check_worn(name: str, signals: Sequence[str], antennas: Sequence[Antenna], where: str) -> None:
    """Refuse a receiver's antenna that is not there or that has no frequency for a signal."""
    antenna = next((one for one in antennas if one.name == name), None)
    if antenna is None:
        known = ", ".join(one.name for one in antennas)
        raise ConfigurationError(
            f"no antenna {name!r}", where=where,
            mend=f"known: {known}" if known else "write [[antennas]] with a name",
        )  # fmt: skip
    told = [centre.frequency for centre in antenna.frequencies]
    if any(frequency[0] == "G" for frequency in told):
        return
    for signal in signals:
        own = f"{signal[0]}{int(signal[1]):02d}"
        if own not in told:
            raise ConfigurationError(
                f"the antenna {name!r} has no frequency for the signal {signal!r}", where=where,
                mend=f"give it {own}, or one of GPS, which then stands in",
            )  # fmt: skip


def calibration_columns(antennas: Sequence[Antenna], time_ns: int) -> Columns:
    """Rows of `replay.AntennaCalibration`, one for each frequency, known from a time on."""
    rows = [(antenna, centre) for antenna in antennas for centre in antenna.frequencies]
    steps = np.array([antenna.step for antenna, _ in rows])
    patterns = [centre.variation or (0.0,) for _, centre in rows]
    lengths = np.array([len(pattern) for pattern in patterns], dtype=np.int64)
    nothing = np.zeros(len(rows), dtype=np.int64)
    return Columns.build(
        np.full(len(rows), time_ns),
        {
            "antenna": Ragged.from_texts([antenna.name for antenna, _ in rows]),
            "serial": Ragged.from_texts([""] * len(rows)),
            "frequency": Ragged.from_texts([centre.frequency for _, centre in rows]),
            "offset_neu_m": np.array([centre.offset for _, centre in rows]),
            "zenith_start_rad": np.zeros(len(rows)),
            "zenith_end_rad": steps * (lengths - 1),
            "zenith_step_rad": steps,
            "azimuth_step_rad": np.zeros(len(rows)),
            "pattern_m": Ragged(
                starts(lengths), np.array([x for pattern in patterns for x in pattern])
            ),
            "azimuth_pattern_m": Ragged(starts(nothing), np.zeros(0)),
            "valid_from_ns": nothing,
            "valid_until_ns": nothing.copy(),
        },
    )


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, Mapping) for one in value)


def _read(table: Mapping[str, Any]) -> Antenna:
    rest = dict(table)
    centres = rest.pop("frequencies", [])
    if not _are_tables(centres):
        raise ConfigurationError(
            "frequencies is no list", mend="write [[antennas.frequencies]], one each"
        )
    antenna = build(Antenna, [rest])
    return Antenna(
        name=antenna.name,
        calibrated=antenna.calibrated,
        step=antenna.step,
        frequencies=tuple(build(Centre, [centre]) for centre in centres),
    )


def _check(antenna: Antenna) -> None:
    name = antenna.name
    if not name or name != name.strip() or len(name.encode()) > _LONGEST_NAME:
        raise ConfigurationError(
            f"the name is {name!r}",
            mend=f"write up to {_LONGEST_NAME} bytes without blanks at the ends",
        )
    if not antenna.step > 0.0:
        raise ConfigurationError(f"step is {antenna.step:g} rad", mend="write more than 0")
    if not antenna.frequencies:
        raise ConfigurationError(
            "it has no frequency", mend="write [[antennas.frequencies]] with frequency = 'G01'"
        )
    told = [centre.frequency for centre in antenna.frequencies]
    for centre in antenna.frequencies:
        text = centre.frequency
        good = (
            len(text) == 3 and text[0] in SYSTEM_LETTERS and text[1] == "0" and text[2].isdecimal()
        )
        try:
            frequency_hz(text[0], int(text[2])) if good else None
        except KeyError:
            good = False
        if not good:
            raise ConfigurationError(
                f"no frequency {text!r}", mend="a system and its RINEX band, as G01"
            )
        if told.count(text) > 1:
            raise ConfigurationError(f"it has {text} twice", mend="name it once")
        if len(centre.offset) != 3:
            raise ConfigurationError(
                f"offset of {text} has not three numbers", mend="[north, east, up]"
            )
        if not np.isfinite([*centre.offset, *centre.variation]).all():
            raise ConfigurationError(f"{text} has a number that is not finite")
