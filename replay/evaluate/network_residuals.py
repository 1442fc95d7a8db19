"""What is left of a rover's double-differenced phases at its true position.

With the true integer taken off, and what the corrections of the run model, the rest of a
phase is orbit error, ionosphere, troposphere, multipath and noise: what a network of
reference stations is to take away (Lee 2010, figure 8).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Final

import msgspec
import numpy as np

from replay.evaluate.align import Rows
from replay.evaluate.geometry import Floats
from replay.evaluate.signal_table import Labels, SignalTable, labels, picked
from replay.gnss.signals import wavelength_m
from replay.log.columns import Columns

_CHANNEL: Final = 0  # GLONASS, which is not simulated, has no one wavelength


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """Channels of one receiver.

    Attributes
    ----------
    observations : Columns of replay.GnssObservation
    corrections : Columns of replay.SignalCorrections
    truth : Columns of replay.SignalTruth
    """

    observations: Columns
    corrections: Columns
    truth: Columns


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DoubleResiduals:
    """Residuals of double-differenced phases, rover less master.

    Attributes
    ----------
    times_ns : int64 array (n,), GPS ns
    satellites, references, signals : bytes array (n,)
    before_m : float64 array (n,), m
        At the true position, the true integers and the modelled delays taken off.
    after_m : float64 array (n,), m
        The network's correction taken off as well; NaN where there is none.
    """

    times_ns: Rows
    satellites: Labels
    references: Labels
    signals: Labels
    before_m: Floats
    after_m: Floats

    def __len__(self) -> int:
        return len(self.times_ns)

    def each(self) -> Iterator[tuple[str, str, Rows]]:
        """Satellite, signal and rows of each, ascending."""
        for signal in np.unique(self.signals).tolist():
            for satellite in np.unique(self.satellites).tolist():
                rows = np.flatnonzero((self.satellites == satellite) & (self.signals == signal))
                if len(rows):
                    yield satellite.decode(), signal.decode(), rows


class ResidualFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of the residuals of one signal, all satellites.

    Attributes
    ----------
    count : int
        Of double differences that have a correction, or of all where none has.
    before_rms_m, before_max_m : float, m
    after_rms_m, after_max_m : float or None, m
    """

    count: int
    before_rms_m: float
    before_max_m: float
    after_rms_m: float | None
    after_max_m: float | None


def rover_residuals(
    rover: Observed, master: Observed, differences: Columns, *, corrected: bool = True
) -> DoubleResiduals:
    """Residuals of the double differences that a channel of a run names.

    Parameters
    ----------
    rover, master : Observed
    differences : Columns of replay.NetworkCorrection, or of replay.DoubleDifferenceAmbiguity
        Their satellites, references and signals; those of the first also say the correction.
    corrected : bool
        Whether `differences` are of corrections.
    """
    satellites = labels(differences, "satellite")
    references = labels(differences, "reference")
    signals = labels(differences, "signal")
    keep = satellites != references
    times = differences.valid_time_ns[keep]
    satellites, references, signals = satellites[keep], references[keep], signals[keep]
    total = np.zeros(len(times))
    for side, sign in ((rover, 1.0), (master, -1.0)):
        rest = phase_rest(side)
        table = SignalTable.of(side.observations)
        total += sign * picked(rest, table.rows(times, satellites, signals))
        total -= sign * picked(rest, table.rows(times, references, signals))
    correction = np.full(len(times), np.nan)
    if corrected:
        correction = differences["correction_m"].astype(np.float64)[keep]
    known = np.isfinite(total)
    return DoubleResiduals(
        times[known],
        satellites[known],
        references[known],
        signals[known],
        total[known],
        (total - correction)[known],
    )


def phase_rest(side: Observed) -> Floats:
    """What is left of each phase (n,) [m] beside the broadcast range at the true position.

    The receiver's clock error is still in it, the same for all satellites of an epoch.
    """
    rows = side.observations
    satellites, signals = labels(rows, "satellite"), labels(rows, "signal")
    where = (rows.valid_time_ns, satellites, signals)
    at_truth = SignalTable.of(side.truth).rows(*where)
    at_model = SignalTable.of(side.corrections).rows(*where)

    def true(field: str) -> Floats:
        return picked(side.truth[field].astype(np.float64), at_truth)

    def modelled(field: str) -> Floats:
        if field not in side.corrections.values:  # an older log's channel
            return np.zeros(len(rows))
        values = side.corrections[field].astype(np.float64)
        return picked(np.where(side.corrections.is_present(field), values, 0.0), at_model)

    phase = rows["carrier_phase_cycles"].astype(np.float64)
    phase = np.where(rows.is_present("carrier_phase_cycles"), phase, np.nan)
    length = wavelengths(satellites, signals)
    delays = modelled("hydrostatic_m") + modelled("wet_m") + modelled("shapiro_m")
    delays += modelled("antenna_m")
    # The broadcast range less clock is the true one less the error of orbit and clock.
    broadcast = true("range_m") - true("satellite_clock_m") - true("orbit_error_m")
    whole = phase - true("ambiguity_cycles")
    return whole * length - broadcast - delays + modelled("ionosphere_m")


def wavelengths(satellites: Labels, signals: Labels) -> Floats:
    """Carrier wavelengths (n,) [m]."""
    letters, bands = satellites.astype("S1"), signals.astype("S1")
    joined = np.char.add(letters, bands) if len(letters) else np.array([], dtype="S2")
    found = np.full(len(satellites), np.nan)
    for name in np.unique(joined).tolist():
        found[joined == name] = wavelength_m(chr(name[0]), int(chr(name[1])), _CHANNEL)
    return found


def residual_figures(residuals: DoubleResiduals) -> dict[str, ResidualFigures]:
    """Figures by signal."""
    found: dict[str, ResidualFigures] = {}
    for name in np.unique(residuals.signals).tolist():
        of = residuals.signals == name
        corrected = of & np.isfinite(residuals.after_m)
        chosen = corrected if corrected.any() else of
        before, after = residuals.before_m[chosen], residuals.after_m[corrected]
        found[name.decode()] = ResidualFigures(
            count=int(np.count_nonzero(chosen)),
            before_rms_m=_rms(before),
            before_max_m=float(np.abs(before).max()),
            after_rms_m=_rms(after) if len(after) else None,
            after_max_m=float(np.abs(after).max()) if len(after) else None,
        )
    return found


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values * values)))
