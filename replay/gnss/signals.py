"""Carrier frequencies by system and RINEX band.

RINEX 3.05 (2020), tables 4 to 9. The band of RINEX 3 tells BeiDou-2 from BeiDou-3 where
they differ: B1I (both) is band 2, B1C (BeiDou-3) band 1. Band 7 is B2I of BeiDou-2 and
B2b of BeiDou-3, which share the frequency.
"""

from __future__ import annotations

from typing import Final

from replay.kernels.ephemeris import (
    SYSTEM_BEIDOU,
    SYSTEM_GALILEO,
    SYSTEM_GLONASS,
    SYSTEM_GPS,
    SYSTEM_QZSS,
)
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S

FREQUENCY_HZ: Final[dict[tuple[int, int], float]] = {
    (SYSTEM_GPS, 1): 1575.42e6,  # L1; IS-GPS-200N, 3.3.1.1
    (SYSTEM_GPS, 2): 1227.60e6,  # L2
    (SYSTEM_GPS, 5): 1176.45e6,  # L5; IS-GPS-705J, 3.3.1.1
    (SYSTEM_GLONASS, 3): 1202.025e6,  # G3, CDMA; RINEX 3.05, table 5
    (SYSTEM_GLONASS, 4): 1600.995e6,  # G1a, CDMA
    (SYSTEM_GLONASS, 6): 1248.06e6,  # G2a, CDMA
    (SYSTEM_GALILEO, 1): 1575.42e6,  # E1; Galileo OS SIS ICD 2.1, table 2
    (SYSTEM_GALILEO, 5): 1176.45e6,  # E5a
    (SYSTEM_GALILEO, 6): 1278.75e6,  # E6
    (SYSTEM_GALILEO, 7): 1207.14e6,  # E5b
    (SYSTEM_GALILEO, 8): 1191.795e6,  # E5, AltBOC
    (SYSTEM_BEIDOU, 1): 1575.42e6,  # B1C and B1A; BDS-SIS-ICD B1C 1.0, 4.1
    (SYSTEM_BEIDOU, 2): 1561.098e6,  # B1I; BDS-SIS-ICD B1I 3.0, 4.2.1
    (SYSTEM_BEIDOU, 5): 1176.45e6,  # B2a; BDS-SIS-ICD B2a 1.0, 4.1
    (SYSTEM_BEIDOU, 6): 1268.52e6,  # B3I; BDS-SIS-ICD B3I 1.0, 4.2.1
    (SYSTEM_BEIDOU, 7): 1207.14e6,  # B2I and B2b; BDS-SIS-ICD B2b 1.0, 4.1
    (SYSTEM_BEIDOU, 8): 1191.795e6,  # B2, a and b together
    (SYSTEM_QZSS, 1): 1575.42e6,  # L1; IS-QZSS-PNT, 4.1
    (SYSTEM_QZSS, 2): 1227.60e6,  # L2
    (SYSTEM_QZSS, 5): 1176.45e6,  # L5
    (SYSTEM_QZSS, 6): 1278.75e6,  # L6; IS-QZSS-L6
}
"""Carrier frequencies (Hz) that do not depend on the satellite."""

# GLONASS ICD 5.1, section 3.3.1.1: frequency of channel 0 and step, for FDMA.
GLONASS_FDMA_HZ: Final[dict[int, tuple[float, float]]] = {
    1: (1602.0e6, 562.5e3),
    2: (1246.0e6, 437.5e3),
}
"""Band to frequency of channel 0 and distance of the channels (Hz)."""

GLONASS_CHANNELS: Final = range(-7, 7)


def frequency_hz(system: int | str, band: int, channel: int = 0) -> float:
    """Carrier frequency.

    Parameters
    ----------
    system : int or str
        RINEX letter, or its number as in `EPHEMERIS_DTYPE`.
    band : int
        RINEX band: the second character of an observation code such as `C1C`.
    channel : int
        GLONASS frequency channel, -7 to 6; for bands 1 and 2 of GLONASS only.

    Returns
    -------
    float, Hz

    Raises
    ------
    KeyError
        The system has no such band.
    ValueError
        GLONASS has no such channel.
    """
    number = ord(system) if isinstance(system, str) else int(system)
    if number == SYSTEM_GLONASS and band in GLONASS_FDMA_HZ:
        if channel not in GLONASS_CHANNELS:
            raise ValueError(f"GLONASS has no frequency channel {channel}: -7 to 6")
        base, step = GLONASS_FDMA_HZ[band]
        return base + channel * step
    try:
        return FREQUENCY_HZ[number, band]
    except KeyError:
        raise KeyError(f"system {chr(number)} has no band {band}") from None


def wavelength_m(system: int | str, band: int, channel: int = 0) -> float:
    """Carrier wavelength in vacuum (m); arguments and errors as :func:`frequency_hz`."""
    return SPEED_OF_LIGHT_M_S / frequency_hz(system, band, channel)
