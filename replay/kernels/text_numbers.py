"""Compiled parsing of fixed-width decimal numbers, correctly rounded."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

Bytes = npt.NDArray[np.uint8]
Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]

BLANK = 0
NUMBER = 1
DAMAGED = 2

KIND_CODE = 0
KIND_PHASE = 1
KIND_OTHER = 4
"""Kinds 0 to 3 are columns of the output; this one is counted only."""

_VALUE_BYTES = 14
_FIELD_BYTES = 16
_MOST_DIGITS = 15  # 10**15 < 2**53: mantissa and power of ten are exact, one rounding is left
_POWERS = 10.0 ** np.arange(_MOST_DIGITS + 1)


@njit(cache=True)
def parse_decimal(data: Bytes, start: int, end: int) -> tuple[int, float]:
    """Blanks, sign, digits with a point somewhere, blanks; nothing else.

    The digits form an integer below 2**53, which one division by a power of ten
    turns into the nearest float64.

    Returns
    -------
    int
        BLANK, NUMBER or DAMAGED.
    float
        The value, 0 where there is none.
    """
    p = start
    while p < end and data[p] == 32:
        p += 1
    if p == end:
        return BLANK, 0.0
    negative = data[p] == 45
    if negative or data[p] == 43:
        p += 1
    mantissa = np.int64(0)
    digits = 0
    decimals = -1
    while p < end:
        byte = np.int64(data[p])
        if 48 <= byte <= 57:
            mantissa = mantissa * 10 + (byte - 48)
            digits += 1
            if decimals >= 0:
                decimals += 1
            if digits > _MOST_DIGITS:
                return DAMAGED, 0.0
        elif byte == 46 and decimals < 0:
            decimals = 0
        else:
            break
        p += 1
    while p < end and data[p] == 32:
        p += 1
    if p < end or digits == 0 or decimals < 0:
        return DAMAGED, 0.0
    value = np.float64(mantissa) / _POWERS[decimals]
    return NUMBER, (-value if negative else value)


@njit(cache=True, nogil=True)
def parse_observations(
    data: Bytes,
    line_starts: Int64,
    line_ends: Int64,
    satellite_lines: Int64,
    satellite_layouts: Int64,
    satellite_rows: Int64,
    layout_starts: Int64,
    kinds: Int64,
    slots: Int64,
    scales: Float64,
    fields_per_line: int,
    indent: int,
    values: Float64,
    present: npt.NDArray[np.bool_],
    loss_of_lock: npt.NDArray[np.int8],
    strength: npt.NDArray[np.int8],
    other_counts: Int64,
    damaged_lines: Int64,
) -> tuple[int, int, int]:
    """Values of RINEX observation records: fields of 14 bytes, an LLI and a strength digit.

    Parameters
    ----------
    data : uint8 array
    line_starts, line_ends : int64 arrays (lines,)
    satellite_lines, satellite_layouts, satellite_rows : int64 arrays (n,)
        First line, layout and first output row of each satellite's record.
    layout_starts : int64 array (layouts + 1,)
        Where each layout begins in `kinds`, `slots` and `scales`.
    kinds, slots, scales : arrays (fields,)
        Output column, output row after the satellite's first, divisor.
    fields_per_line, indent : int
    values, present : float64 and bool arrays (rows, 4), written
    loss_of_lock, strength : int8 arrays (rows,), written
        -1 where blank; they come as -1.
    other_counts : int64 array (fields,), added to
        Values of KIND_OTHER.
    damaged_lines : int64 array (n,), written
        Line of a satellite's first unreadable field, else left.

    Returns
    -------
    int
        Zeros, which RINEX takes for absent.
    int
        Loss-of-lock digits that stand beside no carrier phase.
    int
        Code strength digits that differ from the phase's.
    """
    zeros = 0
    stray = 0
    differing = 0
    for n in range(len(satellite_lines)):
        first = layout_starts[satellite_layouts[n]]
        count = layout_starts[satellite_layouts[n] + 1] - first
        for k in range(count):
            line = satellite_lines[n] + k // fields_per_line
            start = line_starts[line] + indent + (k % fields_per_line) * _FIELD_BYTES
            end = line_ends[line]
            if start >= end:
                continue
            status, value = parse_decimal(data, start, min(end, start + _VALUE_BYTES))
            if status == NUMBER and end < start + _VALUE_BYTES:
                status = DAMAGED
            kind = kinds[first + k]
            row = satellite_rows[n] + slots[first + k]
            if status == DAMAGED:
                if damaged_lines[n] < 0:
                    damaged_lines[n] = line
            elif status == NUMBER and value == 0.0:
                zeros += 1
            elif status == NUMBER and kind == KIND_OTHER:
                other_counts[first + k] += 1
            elif status == NUMBER:
                values[row, kind] = value / scales[first + k]
                present[row, kind] = True
            for place in range(2):
                at = start + _VALUE_BYTES + place
                if at >= end or data[at] == 32:
                    continue
                digit = np.int64(data[at]) - 48
                if digit < 0 or digit > 9:
                    if damaged_lines[n] < 0:
                        damaged_lines[n] = line
                elif place == 0:
                    if kind == KIND_PHASE:
                        loss_of_lock[row] = digit
                    elif digit != 0:
                        stray += 1
                elif digit != 0 and kind in (KIND_PHASE, KIND_CODE):
                    if strength[row] >= 0 and strength[row] != digit:
                        differing += 1
                    if kind == KIND_PHASE or strength[row] < 0:
                        strength[row] = digit
    return zeros, stray, differing
