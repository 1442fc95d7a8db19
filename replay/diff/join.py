"""Two channels joined: rows matched, fields compared, every row given its kind."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.channels import FILTER_EVENTS, ChannelSpec, Difference, Tolerance
from replay.diff.fields import (
    EQUAL,
    NAN,
    VALUE,
    WITHIN,
    FieldOutcome,
    Pair,
    compare_field,
    same_bits,
)
from replay.diff.match import ABSENT, Alignment, align, key_codes
from replay.diff.names import enum_names, key_text, unit
from replay.diff.result import Place, RowKind
from replay.log.columns import Column, Columns, Ragged
from replay.time import to_text

Int64 = npt.NDArray[np.int64]

LOG_TIME: Final = "log_time_ns"
PAYLOAD: Final = "payload"

# A row's kind by its worst field; the codes of one-sided rows follow those of fields.
KINDS: Final = (
    RowKind.EQUAL,
    RowKind.WITHIN,
    RowKind.VALUE,
    RowKind.NAN,
    RowKind.MISSING,
    RowKind.EXTRA,
    RowKind.EVENT,
)
_MISSING: Final = KINDS.index(RowKind.MISSING)
_EXTRA: Final = KINDS.index(RowKind.EXTRA)
_EVENT: Final = KINDS.index(RowKind.EVENT)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Joined:
    """One channel of two runs.

    Attributes
    ----------
    spec : ChannelSpec
    a, b : Columns
    alignment : Alignment
        One row per row of the union, sorted by valid time.
    matched_a, matched_b : int64 arrays (m,)
        Rows of A and of B that are partners, in the order of the alignment.
    outcomes : mapping of field name to FieldOutcome
        Of matched rows; a field that is equal bit for bit everywhere is not here.
    kinds : uint8 array (n,)
        Index into :data:`KINDS` per row of the alignment.
    """

    spec: ChannelSpec
    a: Columns
    b: Columns
    alignment: Alignment
    matched_a: Int64
    matched_b: Int64
    outcomes: dict[str, FieldOutcome]
    kinds: npt.NDArray[np.uint8]

    @property
    def fields_missing(self) -> list[str]:
        """Fields that A alone has."""
        return [name for name in self.a.values if name not in self.b.values]

    @property
    def fields_extra(self) -> list[str]:
        """Fields that B alone has."""
        return [name for name in self.b.values if name not in self.a.values]

    def log_times(self) -> Int64:
        """When each row of the alignment became available in the run that had it first."""
        never = np.iinfo(np.int64).max
        times = []
        for rows, columns in ((self.alignment.a, self.a), (self.alignment.b, self.b)):
            time = np.full(len(rows), never)
            time[rows != ABSENT] = columns.log_time_ns[rows[rows != ABSENT]]
            times.append(time)
        return np.asarray(np.minimum(times[0], times[1]))

    def place(self, row: int) -> Place:
        """Time and key of a row of the alignment."""
        in_a = int(self.alignment.a[row])
        columns, index = (self.b, int(self.alignment.b[row])) if in_a == ABSENT else (self.a, in_a)
        return _place(self.spec, columns, index)

    def matched_place(self, row: int) -> Place:
        """Time and key of a matched row."""
        return _place(self.spec, self.a, int(self.matched_a[row]))


def _place(spec: ChannelSpec, columns: Columns, row: int) -> Place:
    time_ns = int(columns.valid_time_ns[row])
    keys = [key for key in spec.key if key in columns.values]
    return Place(
        time_ns=time_ns, time=to_text(time_ns), key=key_text(spec.message, keys, columns, row)
    )


def join(spec: ChannelSpec, a: Columns, b: Columns) -> Joined:
    """Match the rows of a channel and compare every field of the matched ones.

    Parameters
    ----------
    spec : ChannelSpec
        Key and tolerances; a field without a tolerance is compared exactly.
    a, b : Columns
        Rows of which the fields were not decoded are compared by their payloads.
    """
    a, b = _with_fields(a), _with_fields(b)
    keys = [key for key in spec.key if key in a.values and key in b.values]
    alignment = align(a.valid_time_ns, b.valid_time_ns, *key_codes(keys, a, b))
    both = alignment.matched
    rows_a, rows_b = alignment.a[both], alignment.b[both]
    outcomes: dict[str, FieldOutcome] = {}
    for name in (LOG_TIME, *a.values):
        if name in keys or (name != LOG_TIME and name not in b.values):
            continue
        pair = _pair(name, a, b, rows_a, rows_b)
        if not same_bits(pair):
            outcome = _compare(spec, name, pair)
            if outcome.severity.any():
                outcomes[name] = outcome
    kinds = np.full(len(alignment), EQUAL, dtype=np.uint8)
    kinds[both] = _worst(outcomes, len(rows_a))
    kinds[alignment.b == ABSENT] = _MISSING
    kinds[alignment.a == ABSENT] = _EXTRA
    if spec.message == FILTER_EVENTS.message:
        kinds[kinds > WITHIN] = _EVENT
    return Joined(spec, a, b, alignment, rows_a, rows_b, outcomes, kinds)


def _worst(outcomes: dict[str, FieldOutcome], count: int) -> npt.NDArray[np.uint8]:
    worst = np.full(count, EQUAL, dtype=np.uint8)
    for outcome in outcomes.values():
        np.maximum(worst, outcome.severity, out=worst)
    return worst


def _with_fields(columns: Columns) -> Columns:
    if columns.values or columns.payloads is None:
        return columns
    return dataclasses.replace(
        columns, values={PAYLOAD: Ragged.from_blobs(columns.payloads.blobs())}
    )


def column(columns: Columns, name: str) -> Column:
    """Column of a field or of the log time."""
    return columns.log_time_ns if name == LOG_TIME else columns.values[name]


def _pair(name: str, a: Columns, b: Columns, rows_a: Int64, rows_b: Int64) -> Pair:
    return Pair(
        _take(column(a, name), rows_a),
        _take(column(b, name), rows_b),
        a.is_present(name)[rows_a],
        b.is_present(name)[rows_b],
    )


def _take(values: Column, rows: Int64) -> Column:
    return values.take(rows) if isinstance(values, Ragged) else values[rows]


def _compare(spec: ChannelSpec, name: str, pair: Pair) -> FieldOutcome:
    if name == LOG_TIME:
        return compare_field(name, "ns", Tolerance(0.0, "ns", Difference.EXACT), pair)
    enum = enum_names(spec.message, name)
    field_unit = unit(spec.message, name)
    tolerance = spec.tolerances.get(name) or Tolerance(0.0, field_unit, Difference.EXACT)
    return compare_field(name, tolerance.unit, tolerance, pair, enum)


__all__ = ["EQUAL", "KINDS", "LOG_TIME", "NAN", "VALUE", "Joined", "column", "join"]
