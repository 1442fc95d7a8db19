"""Antennas by name, and rows of their calibrations as records of the compiled loops."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.errors import DataError
from replay.gnss.signals import FREQUENCY_HZ, GLONASS_FDMA_HZ
from replay.kernels.antenna_pattern import PATTERN_DTYPE, WORN_DTYPE
from replay.kernels.gnss_records import SYSTEM_LETTERS
from replay.log.columns import Columns

Array = npt.NDArray[Any]

_TYPE_WIDTH: Final = 16
_NAME_BYTES: Final = "S64"
_NO_RADOME: Final = "NONE"


def without_radome(antenna: str) -> str:
    """Name of the same antenna without a radome: 16 characters of type, `NONE`.

    Where an antenna was not calibrated under its radome, the values without one serve, as
    the IGS does it.
    """
    return f"{antenna[:_TYPE_WIDTH]:<{_TYPE_WIDTH}}{_NO_RADOME}"


@dataclasses.dataclass(slots=True)
class Antennas:
    """Calibrations of receivers' antennas, and which antenna one receiver has.

    Attributes
    ----------
    names : S64 array (k,)
        Antennas, by number.
    patterns : array (n,) of PATTERN_DTYPE
    values : float64 array, m
        Of all patterns.
    worn : array (m,) of WORN_DTYPE
        In the order of log time.
    """

    names: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=_NAME_BYTES))
    patterns: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=PATTERN_DTYPE))
    values: Array = dataclasses.field(default_factory=lambda: np.zeros(0))
    worn: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=WORN_DTYPE))

    @property
    def known(self) -> bool:
        """Whether anything can be modelled."""
        return len(self.patterns) > 0 and len(self.worn) > 0

    def learn(self, calibrations: Columns) -> None:
        """Keep rows of `replay.AntennaCalibration`, those of receivers' antennas.

        Raises
        ------
        DataError
            Where the numbers of a pattern do not fit its angles.
        """
        serials = calibrations.ragged("serial").texts()
        names = calibrations.ragged("antenna").texts()
        for k in range(len(calibrations)):
            if serials[k]:
                continue
            made = calibration_record(calibrations, k, len(self.values))
            if made is None:
                continue
            record, numbers = made
            record["antenna"] = self._number(names[k])
            self.patterns = np.concatenate([self.patterns, record])
            self.values = np.concatenate([self.values, numbers])

    def wear(self, info: Columns) -> None:
        """Keep what rows of `replay.ReceiverInfo` say of the antenna."""
        record = np.zeros(len(info), dtype=WORN_DTYPE)
        record["log_t"] = info.log_time_ns
        texts = [text.rstrip() for text in info.ragged("antenna").texts()]
        record["antenna"] = [self._number(text) for text in texts]
        record["bare"] = [self._number(without_radome(text)) for text in texts]
        self.worn = np.concatenate([self.worn, record])

    def arrays(self) -> dict[str, Array]:
        """For a dump."""
        return {f"antenna_{field.name}": getattr(self, field.name) for field in _PARTS}

    @staticmethod
    def of_arrays(arrays: Mapping[str, Array]) -> Antennas:
        """What :meth:`arrays` gave."""
        return Antennas(*(arrays[f"antenna_{field.name}"] for field in _PARTS))

    def _number(self, name: str) -> int:
        text = name.encode()[: np.dtype(_NAME_BYTES).itemsize]
        found = np.flatnonzero(self.names == text)
        if len(found):
            return int(found[0])
        self.names = np.concatenate([self.names, np.array([text], dtype=_NAME_BYTES)])
        return len(self.names) - 1


_PARTS: Final = dataclasses.fields(Antennas)
_FIELDS: Final = {
    "valid_from": "valid_from_ns",
    "valid_until": "valid_until_ns",
    "zenith_start": "zenith_start_rad",
    "zenith_step": "zenith_step_rad",
    "azimuth_step": "azimuth_step_rad",
}
ANTENNA_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "antenna_names": np.dtype(_NAME_BYTES),
    "antenna_patterns": PATTERN_DTYPE,
    "antenna_values": np.dtype(np.float64),
    "antenna_worn": WORN_DTYPE,
}
"""Of :meth:`Antennas.arrays`, for dumps."""


def calibration_record(
    calibrations: Columns, k: int, first: int
) -> tuple[Array, npt.NDArray[np.float64]] | None:
    """Row of `replay.AntennaCalibration` as a record without an antenna, and its numbers.

    Parameters
    ----------
    calibrations : Columns
    k : int
        The row.
    first : int
        Place of its numbers among those of all.

    Returns
    -------
    tuple of array (1,) of PATTERN_DTYPE and float64 array (m), or None
        None for a frequency that is not known.

    Raises
    ------
    DataError
        Where the numbers of a pattern do not fit its angles.
    """
    frequency = _text(calibrations, "frequency", k)
    at = _frequency(frequency)
    if at is None:
        return None
    record = np.zeros(1, dtype=PATTERN_DTYPE)
    record["available"] = calibrations.log_time_ns[k]
    record["system"], record["band"], record["frequency"] = at
    record["offset"] = calibrations["offset_neu_m"][k]
    for name, field in _FIELDS.items():
        record[name] = calibrations[field][k]
    pattern = calibrations.ragged("pattern_m").row(k)
    by_azimuth = calibrations.ragged("azimuth_pattern_m").row(k)
    record["zenith_count"] = len(pattern)
    record["azimuth_count"] = len(by_azimuth) // max(len(pattern), 1)
    record["first"] = first
    antenna = _text(calibrations, "antenna", k)
    _check(record[0], len(by_azimuth), f"{antenna}, {frequency}")
    return record, np.concatenate([pattern, by_azimuth]).astype(np.float64)


def _text(calibrations: Columns, field: str, k: int) -> str:
    return calibrations.ragged(field).row(k).tobytes().decode()


def _frequency(text: str) -> tuple[int, int, float] | None:
    """System's number, RINEX band and carrier (Hz) of an ANTEX frequency, `G01`."""
    system, band = SYSTEM_LETTERS.find(text[:1]), text[1:]
    if len(text) != 3 or system < 0 or not band.isdecimal():
        return None
    if text[0] == "R" and int(band) in GLONASS_FDMA_HZ:
        return system, int(band), GLONASS_FDMA_HZ[int(band)][0]
    carrier = FREQUENCY_HZ.get((ord(text[0]), int(band)))
    return None if carrier is None else (system, int(band), carrier)


def _check(record: Any, by_azimuth: int, where: str) -> None:
    azimuths = int(record["azimuth_count"])
    whole = azimuths * int(record["zenith_count"]) == by_azimuth and azimuths != 1
    turns = azimuths == 0 or abs((azimuths - 1) * record["azimuth_step"] - 2.0 * np.pi) < 1e-6
    if not (record["zenith_count"] >= 1 and record["zenith_step"] > 0.0 and whole and turns):
        raise DataError(
            "the pattern of an antenna does not fit its angles",
            where=where,
            mend="import the ANTEX file again",
        )
