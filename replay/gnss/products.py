"""Rows of precise products as records of the compiled loops.

Everything is grouped by satellite and in the order of time there, as broadcast ephemerides are.
Where a satellite lacks epochs that the product has around them, where it was moved and where its
clock broke, `gap` of the row after is 1 and nothing is interpolated across.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.errors import ConfigurationError, DataError
from replay.gnss.measurements import SATELLITE_NAMES
from replay.kernels.gnss_records import SATELLITES
from replay.kernels.ionosphere_maps import MAP_DTYPE
from replay.kernels.precise_orbits import (
    MOST_POINTS,
    PRECISE_CLOCK_DTYPE,
    PRECISE_CONFIG_DTYPE,
    PRECISE_ORBIT_DTYPE,
)
from replay.kernels.product_series import BIAS_DTYPE, ROTATION_DTYPE, observation_number
from replay.log.columns import Columns, Int64, Ragged

Array = npt.NDArray[Any]
Bool = npt.NDArray[np.bool_]

DEGREE: Final = 10
_AROUND: Final = 5  # steps on either side that tell what a usual step is
_LONG: Final = 1.5  # times the usual step
_NONE: Final = -1


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Rows of all satellites.

    Attributes
    ----------
    rows : array (n,) of PRECISE_ORBIT_DTYPE, PRECISE_CLOCK_DTYPE or BIAS_DTYPE
    starts : int64 array (SATELLITES + 1,)
        Where the rows of each satellite begin.
    unknown : tuple of str
        Satellites that have no dense number and are left out.
    """

    rows: Array
    starts: Int64
    unknown: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class IonosphereMaps:
    """Maps of the ionosphere.

    Attributes
    ----------
    maps : array (n,) of MAP_DTYPE
    tec, rms : float64 arrays, TECU
        Values of all maps, end to end; NaN where absent.
    """

    maps: Array
    tec: npt.NDArray[np.float64]
    rms: npt.NDArray[np.float64]


def interpolation_record(
    *, degree: int = DEGREE, least: int = 0, beyond_s: float = 0.0, clock_beyond_s: float = 0.0
) -> Array:
    """Settings of the interpolation, one record.

    Parameters
    ----------
    degree : int
        Of the polynomials of orbits, 1 to 15.
    least : int
        Points that an orbit must have at ends and gaps; 0 for all.
    beyond_s, clock_beyond_s : float, s
        How far an orbit and a clock are continued past the last epoch.
    """
    if not 1 <= degree < MOST_POINTS:
        raise ConfigurationError(
            f"the degree of a polynomial is {degree}", mend=f"take one of 1 to {MOST_POINTS - 1}"
        )
    record = np.zeros(1, dtype=PRECISE_CONFIG_DTYPE)
    record["degree"] = degree
    record["least"] = least or degree + 1
    record["beyond"] = beyond_s
    record["clock_beyond"] = clock_beyond_s
    return record


def orbit_series(columns: Columns) -> Series:
    """Rows of `replay.PreciseOrbit` as records; a row without a position makes a gap."""
    return grouped(*orbit_rows(columns))


def orbit_rows(columns: Columns) -> tuple[Array, Int64, tuple[str, ...]]:
    """Rows of `replay.PreciseOrbit` as records, their satellites' numbers, unknown names."""
    number, unknown = satellite_numbers(columns["satellite"])
    there = columns.is_present("position_ecef_m") & (number >= 0)
    std = columns["position_std_ecef_m"].astype(np.float64)
    square = std[:, 0] * std[:, 0] + std[:, 1] * std[:, 1] + std[:, 2] * std[:, 2]
    rows = np.zeros(len(columns), dtype=PRECISE_ORBIT_DTYPE)
    rows["t"] = columns.valid_time_ns
    rows["position"] = columns["position_ecef_m"]
    rows["std"] = np.where(columns.is_present("position_std_ecef_m"), np.sqrt(square / 3.0), np.nan)
    rows["gap"] = columns["manoeuvre"]
    return rows[there], number[there], unknown


def clock_series(clocks: Columns | None, orbits: Columns | None = None) -> Series:
    """Rows of `replay.PreciseClock` as records, and those of orbits where a satellite has none.

    Parameters
    ----------
    clocks : Columns or None
        Stations' clocks are left out.
    orbits : Columns, optional
        Of `replay.PreciseOrbit`; its clocks serve for satellites that `clocks` lacks.
    """
    parts = [clock_rows(columns) for columns in (clocks, orbits) if columns is not None]
    unknown = dict.fromkeys(name for _, _, names in parts for name in names)
    rows, number = join_clocks([(rows, number) for rows, number, _ in parts])
    return grouped(rows, number, tuple(unknown))


def clock_rows(columns: Columns) -> tuple[Array, Int64, tuple[str, ...]]:
    """Rows of `replay.PreciseClock` or `replay.PreciseOrbit` that have a satellite's clock.

    Returns
    -------
    tuple of array (n,) of PRECISE_CLOCK_DTYPE, int64 array (n,), tuple of str
        Records, their satellites' numbers, unknown names.
    """
    number, unknown = satellite_numbers(columns["satellite"])
    use = (number >= 0) & columns.is_present("satellite") & columns.is_present("clock_s")
    rows = np.zeros(len(columns), dtype=PRECISE_CLOCK_DTYPE)
    rows["t"] = columns.valid_time_ns
    rows["clock"] = columns["clock_s"]
    stated = columns.is_present("clock_std_s")
    rows["std"] = np.where(stated, columns["clock_std_s"].astype(np.float64), np.nan)
    if "clock_event" in columns.values:
        rows["gap"] = columns["clock_event"]
    return rows[use], number[use], unknown


def join_clocks(parts: Sequence[tuple[Array, Int64]]) -> tuple[Array, Int64]:
    """Clocks of the first of several products that has the satellite, with their numbers."""
    rows = [np.zeros(0, dtype=PRECISE_CLOCK_DTYPE)]
    numbers = [np.zeros(0, dtype=np.int64)]
    known = np.zeros(SATELLITES, dtype=np.bool_)
    for part, number in parts:
        use = ~known[number]
        rows.append(part[use])
        numbers.append(number[use])
        known[number] = True
    return np.concatenate(rows), np.concatenate(numbers)


def bias_series(columns: Columns) -> Series:
    """Rows of `replay.SignalBias` of satellites as records of BIAS_DTYPE."""
    return grouped_biases(*bias_rows(columns))


def bias_rows(columns: Columns) -> tuple[Array, Int64, tuple[str, ...]]:
    """Rows of `replay.SignalBias` of satellites as records, their numbers, unknown names."""
    number, unknown = satellite_numbers(columns["satellite"])
    rows = np.zeros(len(columns), dtype=BIAS_DTYPE)
    rows["t"] = columns["valid_from_ns"]
    rows["until"] = columns["valid_until_ns"]
    rows["first"] = _observation_numbers(columns.ragged("observation"))
    rows["second"] = _observation_numbers(columns.ragged("second_observation"))
    rows["value"] = columns["value_s"]
    stated = columns.is_present("value_std_s")
    rows["std"] = np.where(stated, columns["value_std_s"].astype(np.float64), np.nan)
    there = (number >= 0) & columns.is_present("satellite")
    return rows[there], number[there], unknown


def grouped_biases(rows: Array, number: Int64, unknown: tuple[str, ...] = ()) -> Series:
    """Rows of biases by satellite and the beginning of their time."""
    order = np.lexsort((rows["t"], number))
    starts = np.searchsorted(number[order], np.arange(SATELLITES + 1)).astype(np.int64)
    return Series(rows[order], starts, unknown)


def _observation_numbers(names: Ragged) -> Int64:
    """Numbers of observations as :func:`observation_number` makes them; 0 for no name."""
    texts, place = np.unique(np.array(names.texts()), return_inverse=True)
    numbers = [observation_number(*f"{text:<3}".encode()) if text else 0 for text in texts]
    return np.array(numbers, dtype=np.int64)[place]


def rotation_records(columns: Columns) -> Array:
    """Rows of `replay.EarthRotation` as records of ROTATION_DTYPE, in the order of time."""
    rows = np.zeros(len(columns), dtype=ROTATION_DTYPE)
    rows["t"] = columns.valid_time_ns
    for k, name in enumerate(("polar_x_rad", "polar_y_rad", "ut1_utc_s", "length_of_day_s")):
        rows["value"][:, k] = columns[name]
    for k, name in enumerate(("polar_x_rate_rad_s", "polar_y_rate_rad_s")):
        rows["rate"][:, k] = np.where(columns.is_present(name), columns[name], np.nan)
    return rows[np.argsort(rows["t"], kind="stable")]


def satellite_numbers(names: Array) -> tuple[Int64, tuple[str, ...]]:
    """Dense numbers of satellites, -1 for others, and the names of those."""
    order = np.argsort(SATELLITE_NAMES)
    sorted_names = SATELLITE_NAMES[order]
    plain = names.astype(sorted_names.dtype)
    place = np.minimum(np.searchsorted(sorted_names, plain), SATELLITES - 1)
    found = sorted_names[place] == plain
    number = np.where(found, order[place], _NONE).astype(np.int64)
    unknown = np.unique(plain[~found & (plain != b"")])
    return number, tuple(name.decode() for name in unknown)


def grouped(rows: Array, number: Int64, unknown: tuple[str, ...] = ()) -> Series:
    """Rows of orbits or clocks by satellite and time, with their gaps.

    Parameters
    ----------
    rows : array (n,) of PRECISE_ORBIT_DTYPE or PRECISE_CLOCK_DTYPE
        In any order; `gap` is 1 where the product itself says so.
    number : int64 array (n,)
        Dense numbers of their satellites.
    unknown : tuple of str
    """
    order = np.lexsort((rows["t"], number))
    rows, number = rows[order], number[order]
    starts = np.searchsorted(number, np.arange(SATELLITES + 1)).astype(np.int64)
    for satellite in range(SATELLITES):
        part = rows[starts[satellite] : starts[satellite + 1]]
        part["gap"][1:] |= long_steps(part["t"])
    return Series(rows, starts, unknown)


def long_steps(times_ns: Int64) -> Bool:
    """Which steps between times are longer than what is usual around them: epochs lack there.

    What is usual is the median of a step and five on either side, so that files of different
    intervals may follow one another.
    """
    steps = np.diff(times_ns)
    if len(steps) == 0:
        return np.zeros(0, dtype=np.bool_)
    # At the ends the window is shorter on both sides, so that it stays in the middle.
    padded = np.concatenate([steps[:_AROUND][::-1], steps, steps[-_AROUND:][::-1]])
    width = 2 * min(_AROUND, len(steps)) + 1
    windows = np.lib.stride_tricks.sliding_window_view(padded, width)[: len(steps)]
    usual = np.sort(windows, axis=1)[:, width // 2]
    return np.asarray(steps > _LONG * usual, dtype=np.bool_)


def ionosphere_maps(columns: Columns) -> IonosphereMaps:
    """Rows of `replay.IonosphereMap` as records, in the order of time and height."""
    return join_maps(map_rows(columns))


def map_rows(columns: Columns) -> IonosphereMaps:
    """Rows of `replay.IonosphereMap` as records in their own order; no gap is known.

    Raises
    ------
    DataError
        Where a map has not as many values as its grid.
    """
    maps = np.zeros(len(columns), dtype=MAP_DTYPE)
    tec, rms = columns.ragged("tec_tecu"), columns.ragged("rms_tecu")
    values = np.ascontiguousarray(tec.values, dtype=np.float64)
    deviations = np.full(len(values), np.nan)
    maps["t"] = columns.valid_time_ns
    maps["first"] = tec.offsets[:-1]
    for name, field in (
        ("height", "height_m"), ("radius", "base_radius_m"),
        ("latitude", "latitude_first_rad"), ("latitude_step", "latitude_step_rad"),
        ("latitudes", "latitude_count"), ("longitude", "longitude_first_rad"),
        ("longitude_step", "longitude_step_rad"), ("longitudes", "longitude_count"),
    ):  # fmt: skip
        maps[name] = columns[field]
    if (np.diff(tec.offsets) != maps["latitudes"] * maps["longitudes"]).any():
        raise DataError(
            "a map of the ionosphere has not as many values as its grid",
            where="replay.IonosphereMap.tec_tecu",
            mend="import the IONEX file again",
        )
    for row in range(len(columns)):
        part = rms.row(row)
        if len(part) == len(tec.row(row)):
            deviations[tec.offsets[row] : tec.offsets[row + 1]] = part
    return IonosphereMaps(maps, values, deviations)


def join_maps(*parts: IonosphereMaps) -> IonosphereMaps:
    """Maps of several parts in the order of time and height, with their gaps."""
    maps = np.concatenate([part.maps for part in parts])
    lengths = np.array([len(part.maps) for part in parts])
    before = np.cumsum([0, *(len(part.tec) for part in parts[:-1])])
    maps["first"] += np.repeat(before, lengths)
    maps = maps[np.lexsort((maps["height"], maps["t"]))]
    epochs, place = np.unique(maps["t"], return_inverse=True)
    maps["gap"] = np.concatenate([[False], long_steps(epochs)])[place] if len(epochs) else 0
    return IonosphereMaps(
        maps,
        np.concatenate([part.tec for part in parts]),
        np.concatenate([part.rms for part in parts]),
    )
