"""Channels of one receiver to records per epoch and satellite, and their names back.

Which signal fills which slot is a list such as `["G1C", "G2W", "G2L", "E1C"]`: the
first signal of a system opens its first slot, the next band its second one; further
signals of a band stand in where the ones before them are missing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.errors import ConfigurationError
from replay.gnss.signals import FREQUENCY_HZ, GLONASS_FDMA_HZ
from replay.kernels import gathering
from replay.kernels.gnss_records import (
    COUNT,
    EPOCH_DTYPE,
    FIRST,
    MEASURED_DTYPE,
    SATELLITES,
    SLOTS,
    SYSTEM_LETTERS,
)
from replay.log.columns import Columns

Array = npt.NDArray[Any]
_RANK: Final = 64
_NO_CHANNEL: Final = 99
_OBSERVED: Final = (
    "pseudorange_m",
    "carrier_phase_cycles",
    "doppler_hz",
    "cn0_dbhz",
    "lock_time_s",
)
_CORRECTED: Final = (
    "distance_m",
    "sagnac_m",
    "satellite_clock_m",
    "relativity_m",
    "group_delay_m",
    "ionosphere_m",
    "hydrostatic_m",
    "wet_m",
    "hydrostatic_mapping",
    "wet_mapping",
    "shapiro_m",
)
# Each adds so many times to the code, and to the phase.
_FURTHER: Final = {
    "antenna_m": (1.0, 1.0),
    "satellite_antenna_m": (1.0, 1.0),
    "solid_tide_m": (1.0, 1.0),
    "pole_tide_m": (1.0, 1.0),
    "ocean_loading_m": (1.0, 1.0),
    "wind_up_m": (0.0, 1.0),
    "phase_bias_m": (0.0, 1.0),
    "higher_ionosphere_m": (1.0, -0.5),
}
_PHASE_BIAS: Final = "phase_bias_m"
SATELLITE_NAMES: Final = np.array(
    [
        f"{letter}{prn:02d}"
        for letter, count in zip(SYSTEM_LETTERS, COUNT, strict=True)
        for prn in range(1, count + 1)
    ],
    dtype="S3",
)
"""Name of each satellite by its dense number."""

assert len(SATELLITE_NAMES) == SATELLITES
assert FIRST[-1] + COUNT[-1] == SATELLITES


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """Which signals are looked at, as tables for the compiled loop.

    Attributes
    ----------
    choice : int64 array (5, 10, 128)
        By system, band and attribute: slot * 64 + rank, or -1.
    frequency : float64 array (5, 10, 2)
        By system and band: Hz of channel 0, Hz per GLONASS channel.
    """

    choice: Array
    frequency: Array


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Epochs:
    """Epochs of one receiver.

    Attributes
    ----------
    epochs : array (m,) of EPOCH_DTYPE
    rows : array (n,) of MEASURED_DTYPE
        Rows of one epoch stand together, in the order of satellites.
    unknown : int
        Observations of satellites that have no number here.
    """

    epochs: Array
    rows: Array
    unknown: int


def select_signals(signals: Sequence[str], systems: str) -> Selection:
    """Tables of a list of signals.

    Parameters
    ----------
    signals : sequence of str
        RINEX letter of a system, band, attribute: `"G1C"`.
    systems : str
        Letters of the systems to use.

    Raises
    ------
    ConfigurationError
        Where a signal cannot be, or a system has too many bands.
    """
    choice = np.full((len(SYSTEM_LETTERS), 10, 128), -1, dtype=np.int64)
    slots: dict[str, list[str]] = {}
    ranks: dict[tuple[str, str], int] = {}
    for letter in systems:
        if letter not in SYSTEM_LETTERS:
            raise ConfigurationError(
                f"gnss.systems: no system {letter!r}", mend=f"write letters of {SYSTEM_LETTERS}"
            )
    for signal in signals:
        if len(signal) != 3 or signal[0] not in SYSTEM_LETTERS or not signal[1].isdigit():
            raise ConfigurationError(
                f"gnss.signals: {signal!r} is no signal",
                mend='write system, band and attribute, such as "G1C"',
            )
        letter, band, attribute = signal[0], signal[1], signal[2]
        if letter not in systems:
            continue
        bands = slots.setdefault(letter, [])
        if band not in bands:
            if len(bands) == SLOTS:
                raise ConfigurationError(
                    f"gnss.signals: {letter} has more than {SLOTS} bands",
                    mend=f"leave out those of band {band}",
                )
            bands.append(band)
        rank = ranks.get((letter, band), 0)
        ranks[letter, band] = rank + 1
        cell = (SYSTEM_LETTERS.index(letter), int(band), ord(attribute))
        if choice[cell] < 0:
            choice[cell] = bands.index(band) * _RANK + rank
    frequency = np.zeros((len(SYSTEM_LETTERS), 10, 2))
    for (number, band_number), value in FREQUENCY_HZ.items():
        frequency[SYSTEM_LETTERS.index(chr(number)), band_number, 0] = value
    for band_number, (base, step) in GLONASS_FDMA_HZ.items():
        frequency[SYSTEM_LETTERS.index("R"), band_number] = base, step
    return Selection(choice, frequency)


def gather_epochs(
    observations: Columns,
    selection: Selection,
    sights: Columns | None = None,
    corrections: Columns | None = None,
    coarse: Columns | None = None,
    *,
    codes: Selection | None = None,
) -> Epochs:
    """Records of the epochs of a block.

    Parameters
    ----------
    observations : Columns of `replay.GnssObservation`
        In the order of time, satellite, signal.
    selection : Selection
    sights : Columns of `replay.SatelliteSight`, optional
    corrections : Columns of `replay.SignalCorrections`, optional
    coarse : Columns of `replay.CoarsePosition`, optional
    codes : Selection, optional
        Signals whose codes, where they are there, replace those of other signals on the same
        frequency; phases, Doppler and strengths stay. Clocks of analysis centres are made of two
        codes of a system, for GPS those of P(Y) on L1 and L2. A code of another signal differs
        from them by a bias of each satellite (C/A at the station ESBC by 0.2 to 1.4 m, of which
        an ionosphere-free pair takes 2.5 times as much), which stays where no biases are known.
    """
    observations = _in_order(observations)
    count = len(observations)
    values = np.empty((count, len(_OBSERVED)))
    for place, name in enumerate(_OBSERVED):
        values[:, place] = observations[name]
    channel = np.where(
        observations.is_present("glonass_channel"),
        observations["glonass_channel"].astype(np.int64),
        _NO_CHANNEL,
    )
    lost = np.where(
        observations.is_present("loss_of_lock"), observations["loss_of_lock"].astype(np.int64), 0
    )
    epochs = np.zeros(count, dtype=EPOCH_DTYPE)
    rows = np.zeros(count, dtype=MEASURED_DTYPE)
    counts = np.zeros(3, dtype=np.int64)
    gathering.gather(
        observations.valid_time_ns,
        observations.log_time_ns,
        characters(observations["satellite"], 3),
        characters(observations["signal"], 2),
        values,
        channel.astype(np.int64),
        lost.astype(np.int64),
        selection.choice,
        selection.frequency,
        epochs,
        rows,
        counts,
    )
    epochs, rows = epochs[: counts[0]], rows[: counts[1]]
    if codes is not None:
        _take_codes(epochs, rows, gather_epochs(observations, codes))
    if sights is not None:
        sights = _in_order(sights, signal=False)
        gathering.join_sights(
            epochs,
            rows,
            sights.valid_time_ns,
            sights.log_time_ns,
            characters(sights["satellite"], 3),
            np.concatenate([sights["position_ecef_m"], sights["velocity_ecef_m_s"]], axis=1),
            np.stack(
                [
                    sights[name].astype(np.float64)
                    for name in (
                        "clock_s",
                        "clock_drift_s_s",
                        "elevation_rad",
                        "azimuth_rad",
                        "range_std_m",
                        "ephemeris_age_s",
                    )
                ],
                axis=1,
            ),
            np.stack([sights["issue"], sights["health"]], axis=1).astype(np.int64),
        )
    if corrections is not None:
        corrections = _in_order(corrections)
        gathering.join_corrections(
            epochs,
            rows,
            corrections.valid_time_ns,
            corrections.log_time_ns,
            characters(corrections["satellite"], 3),
            characters(corrections["signal"], 2),
            _corrected(corrections),
        )
    if coarse is not None:
        placed = np.concatenate(
            [
                coarse["position_ecef_m"],
                coarse["clock_offset_m"][:, None],
                coarse["age_s"][:, None],
            ],
            axis=1,
        )
        gathering.join_coarse(
            epochs,
            coarse.valid_time_ns,
            coarse.log_time_ns,
            np.ascontiguousarray(placed),
            coarse["satellite_count"].astype(np.int64),
        )
    return Epochs(epochs, rows, int(counts[2]))


def _take_codes(epochs: Array, rows: Array, other: Epochs) -> None:
    """Let codes replace those of the same epoch, satellite and frequency, before all corrections.

    Both are of the same observations, so that their epochs are the same.
    """
    mine, others = (
        np.repeat(np.arange(len(these)), these["count"]) * SATELLITES + ranges["satellite"]
        for these, ranges in ((epochs, rows), (other.epochs, other.rows))
    )
    _, own, its = np.intersect1d(mine, others, assume_unique=True, return_indices=True)
    for slot in range(SLOTS):
        for source in range(SLOTS):
            code = other.rows["code"][its, source]
            same = other.rows["frequency"][its, source] == rows["frequency"][own, slot]
            same &= np.isfinite(code)
            rows["code"][own[same], slot] = code[same]


def _corrected(corrections: Columns) -> Array:
    """Terms `(n, 14)` as the compiled loop reads them; what is absent adds nothing."""
    code = len(_CORRECTED)
    terms = np.zeros((len(corrections), code + 3))
    for place, name in enumerate(_CORRECTED):
        terms[:, place] = corrections[name]
    for name, (on_code, on_phase) in _FURTHER.items():
        if name not in corrections.values:
            continue
        there = corrections.is_present(name)
        if not there.any():
            continue
        value = np.where(there, corrections[name], 0.0)
        if on_code:
            terms[:, code] += on_code * value
        terms[:, code + 1] += on_phase * value
        if name == _PHASE_BIAS:
            terms[:, code + 2] = there
    return terms


def characters(names: Array, width: int) -> Array:
    """Texts of one length as bytes `(n, width)`."""
    fixed = np.ascontiguousarray(names, dtype=f"S{width}")
    return fixed.view(np.uint8).reshape(len(fixed), width)


def signal_names(numbers: Array) -> Array:
    """`S2` names of signals from their numbers; `--` for an empty slot."""
    codes = np.asarray(numbers, dtype=np.int64)
    low = np.where(codes > 0, codes % 256, ord("-")).astype(np.uint8)
    high = np.where(codes > 0, codes // 256, ord("-")).astype(np.uint8)
    return np.ascontiguousarray(np.stack([low, high], axis=-1)).view("S2").reshape(codes.shape)


def _in_order(columns: Columns, *, signal: bool = True) -> Columns:
    """Rows by log time, valid time, satellite and signal; mostly they are so already."""
    satellite = characters(columns["satellite"], 3).astype(np.int64)
    key = (satellite[:, 0] << 16) + (satellite[:, 1] << 8) + satellite[:, 2]
    # Systems in the order of the dense numbers, which is not that of the alphabet.
    key += np.array([SYSTEM_LETTERS.find(chr(c)) for c in range(128)])[satellite[:, 0]] << 24
    key <<= 16
    if signal:
        text = characters(columns["signal"], 2).astype(np.int64)
        key += (text[:, 0] << 8) + text[:, 1]
    times = columns.valid_time_ns
    log = columns.log_time_ns
    step, same = np.diff(times), np.diff(log) == 0
    if bool(((step > 0) | ((step == 0) & (np.diff(key) > 0)) | ~same).all()):
        return columns
    return columns.take(np.lexsort((key, times, log)).astype(np.int64))
