"""Integers of a network of reference stations and of its rover, against truth.

Truth of an integer is what the simulator hid in the phases (`SignalTruth.ambiguity_cycles`),
differenced as the integer is: satellite less reference, station less master.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt

from replay.evaluate.align import Rows
from replay.evaluate.errors_enu import Errors
from replay.evaluate.geometry import Floats
from replay.evaluate.signal_table import WIDE_LANE, Labels, SignalTable, labels, picked
from replay.log.columns import Columns
from replay.schemas import sights_pb2
from replay.time import NS_PER_S

Mask = npt.NDArray[np.bool_]

_USED: Final = (sights_pb2.AMBIGUITY_STATUS_FIXED, sights_pb2.AMBIGUITY_STATUS_HELD)
_APART_CYCLES: Final = 0.5
_TRIANGLE: Final = 3
WRONG_POSITION_M: Final = 0.10


class IntegerTruth:
    """True double differences of two receivers' integers.

    Parameters
    ----------
    station, master : Columns of replay.SignalTruth
        The difference is station less master.
    """

    def __init__(self, station: Columns, master: Columns) -> None:
        self._sides = [
            (SignalTable.of(side), side["ambiguity_cycles"].astype(np.float64))
            for side in (station, master)
        ]
        self._lanes = self._sides[0][0].lanes()

    def at(self, times_ns: Rows, satellites: Labels, references: Labels, signals: Labels) -> Floats:
        """True integers [cycle] (n,), of `WL` those of the wide lane; NaN where not known."""
        wide = signals == WIDE_LANE.encode()
        first, second = signals.astype("S8"), signals.astype("S8")
        for system, (one, two) in self._lanes.items():
            of = wide & (satellites.astype("S1") == system)
            first[of], second[of] = one, two
        whole = self._difference(times_ns, satellites, references, first)
        if wide.any():
            whole[wide] -= self._difference(
                times_ns[wide], satellites[wide], references[wide], second[wide]
            )
        return whole

    def _difference(
        self, times_ns: Rows, satellites: Labels, references: Labels, signals: Labels
    ) -> Floats:
        (here, cycles), (there, others) = self._sides
        total = np.zeros(len(times_ns))
        for names, sign in ((satellites, 1.0), (references, -1.0)):
            total += sign * picked(cycles, here.rows(times_ns, names, signals))
            total -= sign * picked(others, there.rows(times_ns, names, signals))
        return total


class EpochIntegers(msgspec.Struct, frozen=True, kw_only=True):
    """Integers found anew at each epoch.

    Attributes
    ----------
    epochs : int
        Epochs at which the resolution said something.
    attempted : int
        Of these, where ambiguities were tried.
    fixed : int
        Of these, where the test was passed.
    whole : int
        Of the fixed, where every ambiguity that was tried was fixed.
    judged : int
        Of the fixed, whose truth is known.
    wrong : int
        Of the judged, with at least one integer that is not the true one.
    basis : str
        What truth is: "integers", or "position" with the limit of `WRONG_POSITION_M`.
    """

    epochs: int
    attempted: int
    fixed: int
    whole: int
    judged: int
    wrong: int
    basis: str

    @property
    def success(self) -> float:
        """Share of the attempted epochs that were fixed, and not wrongly; NaN without any."""
        return (self.fixed - self.wrong) / self.attempted if self.attempted else float("nan")


def epoch_integers(
    resolution: Columns,
    ambiguities: Columns | None,
    truth: IntegerTruth | None,
    *,
    position: Errors | None = None,
    since_ns: int = 0,
) -> EpochIntegers:
    """How often the integers of an epoch were found, and how often wrongly.

    Parameters
    ----------
    resolution : Columns of replay.AmbiguityResolution
    ambiguities : Columns of replay.DoubleDifferenceAmbiguity, or None
    truth : IntegerTruth or None
        None judges a fixed epoch by its position.
    position : Errors or None
        East, north, up [m] of epochs, for the case without `truth`.
    since_ns : int, GPS ns
        Earlier epochs are left out.
    """
    chosen = resolution.take(resolution.valid_time_ns >= since_ns)
    tried = chosen["candidate_count"].astype(np.int64)
    passed = chosen["fixed_count"].astype(np.int64)
    fixed_ns = chosen.valid_time_ns[passed > 0]
    if truth is not None and ambiguities is not None:
        known, wrong = _by_integers(fixed_ns, ambiguities, truth)
    else:
        known, wrong = _by_position(fixed_ns, position)
    return EpochIntegers(
        epochs=len(np.unique(chosen.valid_time_ns)),
        attempted=int(np.count_nonzero(tried > 0)),
        fixed=len(fixed_ns),
        whole=int(np.count_nonzero((passed > 0) & (passed == tried))),
        judged=int(np.count_nonzero(known)),
        wrong=int(np.count_nonzero(wrong)),
        basis="position" if truth is None or ambiguities is None else "integers",
    )


def _by_integers(fixed_ns: Rows, ambiguities: Columns, truth: IntegerTruth) -> tuple[Mask, Mask]:
    """Which fixed epochs are known to the truth, and which have a wrong integer."""
    used = fixed_rows(ambiguities) & np.isin(ambiguities.valid_time_ns, fixed_ns)
    rows = ambiguities.take(used)
    away = np.abs(rows["integer_cycles"].astype(np.float64) - true_integers(rows, truth))
    known = np.isin(fixed_ns, rows.valid_time_ns[np.isfinite(away)])
    return known, np.isin(fixed_ns, rows.valid_time_ns[away > _APART_CYCLES])


def _by_position(fixed_ns: Rows, position: Errors | None) -> tuple[Mask, Mask]:
    if position is None:
        none = np.zeros(len(fixed_ns), dtype=np.bool_)
        return none, none
    horizontal = np.hypot(position.values[:, 0], position.values[:, 1])
    wrong = position.times_ns[horizontal > WRONG_POSITION_M]
    return np.isin(fixed_ns, position.times_ns), np.isin(fixed_ns, wrong)


def fixed_rows(ambiguities: Columns) -> Mask:
    """Which rows (n,) were used with an integer."""
    whole = ambiguities.is_present("integer_cycles") & np.isin(ambiguities["status"], _USED)
    return np.asarray(whole)


def true_integers(ambiguities: Columns, truth: IntegerTruth) -> Floats:
    """True integers [cycle] of the rows (n,) of a channel of ambiguities."""
    return truth.at(
        ambiguities.valid_time_ns,
        labels(ambiguities, "satellite"),
        labels(ambiguities, "reference"),
        labels(ambiguities, "signal"),
    )


class LaneIntegers(msgspec.Struct, frozen=True, kw_only=True):
    """Integers of one signal of a baseline between reference stations.

    Attributes
    ----------
    rows : int
        Of all epochs and satellites.
    fixed, judged, wrong : int
        Rows with an integer in use, those of them whose truth is known, and the wrong ones.
    first_fix_s : float or None, s
        From the first row of the baseline to the first that is fixed.
    all_fixed_s : float or None, s
        The same to the first epoch at which all are fixed.
    """

    rows: int
    fixed: int
    judged: int
    wrong: int
    first_fix_s: float | None
    all_fixed_s: float | None

    @property
    def share(self) -> float:
        """Of the rows, those that are fixed."""
        return self.fixed / self.rows if self.rows else float("nan")


def baseline_integers(ambiguities: Columns, truth: IntegerTruth | None) -> dict[str, LaneIntegers]:
    """Figures of a baseline between reference stations, by signal, the wide lane first."""
    if len(ambiguities) == 0:
        return {}
    signals = labels(ambiguities, "signal")
    start_ns = int(ambiguities.valid_time_ns.min())
    used = fixed_rows(ambiguities)
    away = np.full(len(ambiguities), np.nan)
    if truth is not None:
        integer = ambiguities["integer_cycles"].astype(np.float64)
        away = np.where(used, np.abs(integer - true_integers(ambiguities, truth)), np.nan)
    names = sorted(np.unique(signals).tolist(), key=lambda name: (name != WIDE_LANE.encode(), name))
    found: dict[str, LaneIntegers] = {}
    for name in names:
        of = signals == name
        times = ambiguities.valid_time_ns[of]
        epochs, place = np.unique(times, return_inverse=True)
        whole = np.bincount(place, ~used[of], minlength=len(epochs)) == 0
        found[name.decode()] = LaneIntegers(
            rows=int(np.count_nonzero(of)),
            fixed=int(np.count_nonzero(used & of)),
            judged=int(np.count_nonzero(np.isfinite(away[of]))),
            wrong=int(np.count_nonzero(away[of] > _APART_CYCLES)),
            first_fix_s=_elapsed(times[used[of]], start_ns),
            all_fixed_s=_elapsed(epochs[whole], start_ns),
        )
    return found


def _elapsed(times_ns: Rows, start_ns: int) -> float | None:
    return None if len(times_ns) == 0 else (int(times_ns.min()) - start_ns) / NS_PER_S


class Closure(msgspec.Struct, frozen=True, kw_only=True):
    """Sums of integers around a triangle of baselines, which are nought if all are right.

    Attributes
    ----------
    stations : tuple of str
    checked : int
        Sums, one for each epoch, satellite and signal that all three baselines have.
    exceptions : int
        Of these, not nought.
    """

    stations: tuple[str, ...]
    checked: int
    exceptions: int


def closures(baselines: Mapping[str, Columns]) -> tuple[Closure, ...]:
    """N_ab + N_bc - N_ac of every triangle.

    Parameters
    ----------
    baselines : mapping of "A-B" to Columns of replay.DoubleDifferenceAmbiguity
        Differences B less A, none of them twice. Each may have its own reference satellite.
    """
    sides = {pair: _Side(columns) for pair, columns in _pairs(baselines).items()}
    stations = sorted({name for pair in sides for name in pair})
    found: list[Closure] = []
    for names in itertools.combinations(stations, _TRIANGLE):
        for a, b, c in itertools.permutations(names):
            if (a, b) in sides and (b, c) in sides and (a, c) in sides:
                found.append(_closure((a, b, c), sides))
                break
    return tuple(found)


def _pairs(baselines: Mapping[str, Columns]) -> dict[tuple[str, str], Columns]:
    found: dict[tuple[str, str], Columns] = {}
    for name, columns in baselines.items():
        master, dash, station = name.partition("-")
        if dash:
            found[master, station] = columns
    return found


class _Side:
    """Integers of a baseline, the reference satellite's nought among them."""

    def __init__(self, ambiguities: Columns) -> None:
        rows = ambiguities.take(fixed_rows(ambiguities))
        self.times_ns = rows.valid_time_ns
        self.satellites = labels(rows, "satellite")
        self.references = labels(rows, "reference")
        self.signals = labels(rows, "signal")
        integers = rows["integer_cycles"].astype(np.float64)
        self._values = np.concatenate([integers, np.zeros(len(rows))])
        self._table = SignalTable(
            np.tile(self.times_ns, 2),
            np.concatenate([self.satellites, self.references]),
            np.tile(self.signals, 2),
        )

    def between(
        self, times_ns: Rows, satellites: Labels, references: Labels, signals: Labels
    ) -> Floats:
        """Integers (n,) of satellites less references, NaN where one of them is not known."""
        there = picked(self._values, self._table.rows(times_ns, satellites, signals))
        return there - picked(self._values, self._table.rows(times_ns, references, signals))


def _closure(names: tuple[str, str, str], sides: Mapping[tuple[str, str], _Side]) -> Closure:
    a, b, c = names
    side = sides[a, b]
    what = (side.times_ns, side.satellites, side.references, side.signals)
    total = side.between(*what) + sides[b, c].between(*what) - sides[a, c].between(*what)
    known = total[np.isfinite(total)]
    wrong = int(np.count_nonzero(np.abs(known) > _APART_CYCLES))
    return Closure(stations=names, checked=len(known), exceptions=wrong)
