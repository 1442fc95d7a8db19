"""Antennas of satellites: rows of their calibrations as records, and how their blocks turn.

ANTEX names a satellite's antenna by the block that the satellite is of, and the block tells
which attitude model fits (:mod:`replay.kernels.satellite_attitude`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.gnss.antennas import calibration_record
from replay.gnss.products import satellite_numbers
from replay.kernels import satellite_attitude as attitude
from replay.kernels.antenna_pattern import PATTERN_DTYPE
from replay.kernels.gnss_records import SATELLITES
from replay.log.columns import Columns

Array = npt.NDArray[Any]

# The longest beginning that fits counts. IRNSS has no numbers here.
ATTITUDES: Final[Mapping[str, int]] = {
    "BLOCK I": attitude.NOMINAL,
    "BLOCK II": attitude.GPS_IIA,
    "BLOCK IIA": attitude.GPS_IIA,
    "BLOCK IIR": attitude.GPS_IIR,
    "BLOCK IIF": attitude.GPS_IIF,
    "BLOCK III": attitude.NOMINAL,
    "GLONASS": attitude.NOMINAL,
    "GLONASS-M": attitude.GLO_M,
    "GLONASS-K": attitude.NOMINAL,
    "GALILEO-0": attitude.NOMINAL,
    "GALILEO-1": attitude.GAL_IOV,
    "GALILEO-2": attitude.GAL_FOC,
    "BEIDOU-2G": attitude.NORMAL,
    "BEIDOU-2I": attitude.BDS_2,
    "BEIDOU-2M": attitude.BDS_2,
    "BEIDOU-3": attitude.NOMINAL,
    "BEIDOU-3G": attitude.NORMAL,
    "QZSS": attitude.QZS_1,
    "QZSS-2G": attitude.NORMAL,
    "QZSS-2": attitude.NOMINAL,
}
"""Attitude models by how the name of a satellite's antenna begins."""


def attitude_model(antenna: str) -> int:
    """Attitude model of a satellite by the name of its antenna; NOMINAL for one not known."""
    fitting = [name for name in ATTITUDES if antenna.startswith(name)]
    return ATTITUDES[max(fitting, key=len)] if fitting else attitude.NOMINAL


@dataclasses.dataclass(slots=True)
class SatelliteAntennas:
    """Calibrations of satellites' antennas.

    Attributes
    ----------
    patterns : array (n,) of PATTERN_DTYPE
        Grouped by satellite, whose dense number is their `antenna`.
    attitudes : int64 array (n,)
        Attitude model of each.
    values : float64 array, m
        Of all patterns.
    """

    patterns: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=PATTERN_DTYPE))
    attitudes: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    values: Array = dataclasses.field(default_factory=lambda: np.zeros(0))

    @property
    def starts(self) -> Array:
        """Where the patterns of each satellite begin, int64 `(SATELLITES + 1,)`."""
        numbers = np.arange(SATELLITES + 1)
        return np.searchsorted(self.patterns["antenna"], numbers).astype(np.int64)

    def learn(self, calibrations: Columns) -> None:
        """Keep rows of `replay.AntennaCalibration` that are of satellites.

        Raises
        ------
        DataError
            Where the numbers of a pattern do not fit its angles.
        """
        serials = np.array(calibrations.ragged("serial").texts(), dtype="S")
        numbers, _ = satellite_numbers(serials.astype("S3"))
        names = calibrations.ragged("antenna").texts()
        records, models, values = [self.patterns], [self.attitudes], [self.values]
        first = len(self.values)
        for k in np.flatnonzero((serials != b"") & (numbers >= 0)):
            made = calibration_record(calibrations, int(k), first)
            if made is None:
                continue
            record, numbers_of_it = made
            record["antenna"] = numbers[k]
            records.append(record)
            models.append(np.array([attitude_model(names[k])], dtype=np.int64))
            values.append(numbers_of_it)
            first += len(numbers_of_it)
        patterns = np.concatenate(records)
        order = np.argsort(patterns["antenna"], kind="stable")
        self.patterns = patterns[order]
        self.attitudes = np.concatenate(models)[order]
        self.values = np.concatenate(values)

    def arrays(self) -> dict[str, Array]:
        """For a dump."""
        return {f"satellite_{name}": getattr(self, name) for name in _NAMES}

    @staticmethod
    def of_arrays(arrays: Mapping[str, Array]) -> SatelliteAntennas:
        """What :meth:`arrays` gave."""
        return SatelliteAntennas(*(arrays[f"satellite_{name}"] for name in _NAMES))


_NAMES: Final = ("patterns", "attitudes", "values")
SATELLITE_ANTENNA_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "satellite_patterns": PATTERN_DTYPE,
    "satellite_attitudes": np.dtype(np.int64),
    "satellite_values": np.dtype(np.float64),
}
"""Of :meth:`SatelliteAntennas.arrays`, for dumps."""
