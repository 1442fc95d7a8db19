"""How many satellites a run used and how well they stood."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from replay.evaluate.geometry import Floats
from replay.log.columns import Columns

ALL: Final = "all"
SYSTEMS: Final = ("gps", "glonass", "galileo", "beidou", "qzss")
DOPS: Final = ("gdop", "pdop", "hdop", "vdop")
_PERCENTILE: Final = 95.0


class Spread(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of a quantity that is never negative.

    Attributes
    ----------
    count : int
        Epochs that have it.
    mean, median, min, max, p95 : float
    """

    count: int
    mean: float
    median: float
    min: float
    max: float
    p95: float


class Geometry(msgspec.Struct, frozen=True, kw_only=True):
    """Satellites used and dilution of precision.

    Attributes
    ----------
    epochs : int
        Rows of the geometry channel.
    satellites : dict of Spread
        By system of which a satellite was ever used, and "all".
    pdop : dict of Spread
        Of all systems together ("all") and of each alone, where it was defined at any epoch.
    dop : dict of Spread
        Of all systems together: "gdop", "pdop", "hdop", "vdop".
    """

    epochs: int
    satellites: dict[str, Spread]
    pdop: dict[str, Spread]
    dop: dict[str, Spread]


def spread_of(values: Floats) -> Spread | None:
    """Figures of the finite values; None where there is none."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return None
    return Spread(
        count=len(known),
        mean=float(np.mean(known)),
        median=float(np.median(known)),
        min=float(known.min()),
        max=float(known.max()),
        p95=float(np.percentile(known, _PERCENTILE)),
    )


def satellite_counts(geometry: Columns) -> dict[str, Floats]:
    """Satellites used per epoch (n,), by system of which any was used, then "all"."""
    counts = {
        system: geometry[f"{system}_count"].astype(np.float64)
        for system in SYSTEMS
        if f"{system}_count" in geometry.values
    }
    total = np.sum(list(counts.values()), axis=0) if counts else np.zeros(len(geometry))
    return {**{name: found for name, found in counts.items() if found.any()}, ALL: total}


def dilution(geometry: Columns, field: str) -> Floats:
    """A dilution of precision per epoch (n,), NaN where it is absent."""
    if field not in geometry.values:
        return np.full(len(geometry), np.nan)
    return np.where(geometry.is_present(field), geometry[field].astype(np.float64), np.nan)


def geometry_of(geometry: Columns | None) -> Geometry | None:
    """Figures of a geometry channel; None where there is none or it has no row.

    Parameters
    ----------
    geometry : Columns of replay.GnssGeometry, or None
    """
    if geometry is None or len(geometry) == 0:
        return None
    pdops = {ALL: dilution(geometry, "pdop")}
    pdops |= {system: dilution(geometry, f"{system}_pdop") for system in SYSTEMS}
    return Geometry(
        epochs=len(geometry),
        satellites=_known(satellite_counts(geometry)),
        pdop=_known(pdops),
        dop=_known({name: dilution(geometry, name) for name in DOPS}),
    )


def _known(values: dict[str, Floats]) -> dict[str, Spread]:
    found = {name: spread_of(series) for name, series in values.items()}
    return {name: spread for name, spread in found.items() if spread is not None}
