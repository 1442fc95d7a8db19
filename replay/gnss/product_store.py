"""Precise products as a stage learns them: rows as they came, and what the loops read of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

import erfa
import numpy as np
import numpy.typing as npt

from replay import time
from replay.errors import DataError
from replay.gnss import code_biases, products
from replay.gnss.satellite_antennas import SATELLITE_ANTENNA_TYPES, SatelliteAntennas
from replay.kernels.ionosphere_maps import MAP_DTYPE
from replay.kernels.precise_orbits import PRECISE_CLOCK_DTYPE, PRECISE_ORBIT_DTYPE
from replay.kernels.precise_records import LEAP_DTYPE, Products
from replay.kernels.product_series import BIAS_DTYPE, ROTATION_DTYPE
from replay.kernels.tides import OCEAN_TIDES
from replay.log.columns import Columns

Array = npt.NDArray[Any]

_INT: Final = np.dtype(np.int64)
_FLOAT: Final = np.dtype(np.float64)
# Rows, and the dense numbers of their satellites.
_PARTS: Final[dict[str, np.dtype[Any]]] = {
    "orbits": PRECISE_ORBIT_DTYPE,
    "orbit_numbers": _INT,
    "orbit_clocks": PRECISE_CLOCK_DTYPE,
    "orbit_clock_numbers": _INT,
    "clocks": PRECISE_CLOCK_DTYPE,
    "clock_numbers": _INT,
    "biases": BIAS_DTYPE,
    "bias_numbers": _INT,
    "rotation": ROTATION_DTYPE,
    "maps": MAP_DTYPE,
    "tec": _FLOAT,
    "rms": _FLOAT,
    "loading": _FLOAT,
    "details": np.dtype(np.uint8),
}
STORE_TYPES: Final[dict[str, np.dtype[Any]]] = {**_PARTS, **SATELLITE_ANTENNA_TYPES}
"""Of :meth:`ProductStore.arrays`, for dumps."""

_GPS_YEAR: Final = 1980


def leap_table() -> Array:
    """Leap seconds of GPS time (erfa's table), array (n,) of LEAP_DTYPE."""
    rows = [(0, 0)]
    for year, month, tai_minus_utc in erfa.leap_seconds.get().tolist():
        if year > _GPS_YEAR:
            seconds = int(tai_minus_utc) - time.TAI_MINUS_GPS_S
            start_ns = time.parse_calendar(f"{year}-{month:02d}-01 00:00:00")
            rows.append((start_ns + seconds * time.NS_PER_S, seconds))
    return np.array(rows, dtype=LEAP_DTYPE)


@dataclasses.dataclass(slots=True)
class ProductStore:
    """Everything that was learnt so far.

    Attributes
    ----------
    interpolation : array (1,) of PRECISE_CONFIG_DTYPE
    leaps : array of LEAP_DTYPE
    rows : dict of str to array
        As they came; see `STORE_TYPES`.
    antennas : SatelliteAntennas
    """

    interpolation: Array
    leaps: Array
    rows: dict[str, Array] = dataclasses.field(
        default_factory=lambda: {name: np.zeros(0, dtype=dtype) for name, dtype in _PARTS.items()}
    )
    antennas: SatelliteAntennas = dataclasses.field(default_factory=SatelliteAntennas)
    _made: Products | None = None

    def learn_orbits(self, columns: Columns) -> None:
        """Keep rows of `replay.PreciseOrbit`."""
        orbits, numbers, _ = products.orbit_rows(columns)
        clocks, clock_numbers, _ = products.clock_rows(columns)
        self._add(orbits=orbits, orbit_numbers=numbers)
        self._add(orbit_clocks=clocks, orbit_clock_numbers=clock_numbers)

    def learn_clocks(self, columns: Columns) -> None:
        """Keep rows of `replay.PreciseClock`."""
        clocks, numbers, _ = products.clock_rows(columns)
        self._add(clocks=clocks, clock_numbers=numbers)

    def learn_biases(self, columns: Columns) -> None:
        """Keep rows of `replay.SignalBias`."""
        biases, numbers, _ = products.bias_rows(columns)
        self._add(biases=biases, bias_numbers=numbers)

    def learn_rotation(self, columns: Columns) -> None:
        """Keep rows of `replay.EarthRotation`."""
        self._add(rotation=products.rotation_records(columns))

    def learn_maps(self, columns: Columns) -> None:
        """Keep rows of `replay.IonosphereMap`."""
        part = products.map_rows(columns)
        part.maps["first"] += len(self.rows["tec"])
        self._add(maps=part.maps, tec=part.tec, rms=part.rms)

    def learn_loading(self, columns: Columns) -> None:
        """Keep the last row of `replay.OceanLoading`.

        Raises
        ------
        DataError
            Where it has not three times eleven tides.
        """
        parts = [
            columns.ragged(name).row(len(columns) - 1)
            for name in ("amplitude_up_west_south_m", "phase_up_west_south_rad")
        ]
        if any(len(part) != 3 * OCEAN_TIDES for part in parts):
            raise DataError(
                "the ocean loading has not eleven tides up, west and south",
                where="replay.OceanLoading",
                mend="import the BLQ file again",
            )
        self.rows["loading"] = np.concatenate(parts).astype(np.float64)
        self._made = None

    def learn_details(self, columns: Columns) -> None:
        """Keep what rows of `replay.ProductInfo` say of the codes that clocks refer to."""
        text = "\n".join(columns.ragged("detail").texts()) + "\n"
        self._add(details=np.frombuffer(text.encode(), dtype=np.uint8))

    def learn_antennas(self, columns: Columns) -> None:
        """Keep rows of `replay.AntennaCalibration` of satellites."""
        self.antennas.learn(columns)
        self._made = None

    def known(self) -> Products:
        """What the compiled loops read."""
        if self._made is None:
            self._made = self._make()
        return self._made

    def arrays(self) -> dict[str, Array]:
        """For a dump."""
        return {**self.rows, **self.antennas.arrays()}

    def of_arrays(self, arrays: Mapping[str, Array]) -> ProductStore:
        """The store that gave :meth:`arrays`, with the settings of this one."""
        rows = {name: arrays[name] for name in _PARTS}
        antennas = SatelliteAntennas.of_arrays(arrays)
        return ProductStore(self.interpolation, self.leaps, rows, antennas)

    def _add(self, **parts: Array) -> None:
        for name, part in parts.items():
            self.rows[name] = np.concatenate([self.rows[name], part])
        self._made = None

    def _make(self) -> Products:
        rows = self.rows
        orbits = products.grouped(rows["orbits"], rows["orbit_numbers"])
        clocks = products.grouped(
            *products.join_clocks(
                [
                    (rows["clocks"], rows["clock_numbers"]),
                    (rows["orbit_clocks"], rows["orbit_clock_numbers"]),
                ]
            )
        )
        references = code_biases.clock_references([rows["details"].tobytes().decode()])
        biases = products.grouped_biases(
            *code_biases.single_biases(rows["biases"], rows["bias_numbers"], references)
        )
        maps = products.join_maps(
            products.IonosphereMaps(rows["maps"].copy(), rows["tec"], rows["rms"])
        )
        shape = (2, 3, OCEAN_TIDES) if len(rows["loading"]) else (2, 0, OCEAN_TIDES)
        amplitudes, phases = rows["loading"].reshape(shape)
        return Products(
            orbits.rows, orbits.starts, clocks.rows, clocks.starts, biases.rows, biases.starts,
            rows["rotation"][np.argsort(rows["rotation"]["t"], kind="stable")],
            maps.maps, maps.tec, maps.rms,
            self.antennas.patterns, self.antennas.starts, self.antennas.attitudes,
            self.antennas.values, amplitudes, phases, self.leaps, self.interpolation,
        )  # fmt: skip
