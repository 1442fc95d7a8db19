"""Compiled reading of the lines of SP3 and RINEX CLK files.

Calendar times are nanoseconds since 1980-01-06 00:00:00 of the file's own time system.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.text_numbers import BLANK, DAMAGED, NUMBER, parse_decimal
from replay.kernels.types import Array

LINE_GOOD: Final = 0
LINE_DAMAGED: Final = 1
LINE_STRAY: Final = 2
"""It belongs to no epoch or to no row."""
LINE_UNREAD: Final = 3
"""Of a kind that is known and left out: correlations of SP3, more than two values of a clock."""

FLAG_ORBIT_PREDICTED: Final = 1
FLAG_MANOEUVRE: Final = 2
FLAG_CLOCK_PREDICTED: Final = 4
FLAG_CLOCK_EVENT: Final = 8

NAME_BYTES: Final = 9

_NS: Final = 1_000_000_000
_DAYS_TO_1980: Final = 723_125  # from 0000-03-01 to 1980-01-06
_MOST_DIGITS: Final = 18  # fit an int64; beyond 15 the integer is rounded to float64 once more
_EXACT: Final = 22  # 10**22 is the largest power of ten that is a float64
_POWERS = 10.0 ** np.arange(_EXACT + 1)
_MONTH_DAYS = np.array([31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31], dtype=np.int64)


@njit(cache=True)
def calendar_ns(year: int, month: int, day: int, hour: int, minute: int) -> int:
    """Nanoseconds since 1980-01-06 of a whole minute; -1 where there is no such minute."""
    if year < 1980 or year > 2199 or month < 1 or month > 12 or hour > 23 or minute > 59:
        return -1
    length = int(_MONTH_DAYS[month - 1])
    if month == 2 and year % 4 == 0 and (year % 100 != 0 or year % 400 == 0):
        length += 1
    if day < 1 or day > length or hour < 0 or minute < 0:
        return -1
    # Years from March, so that the day that leaps is the last.
    y = year if month > 2 else year - 1
    m = month - 3 if month > 2 else month + 9
    days = 365 * y + y // 4 - y // 100 + y // 400 + (153 * m + 2) // 5 + day - 1
    days -= _DAYS_TO_1980
    if days < 0:
        return -1
    return ((days * 24 + hour) * 60 + minute) * 60 * _NS


@njit(cache=True)
def next_word(data: Array, at: int, end: int) -> tuple[int, int]:
    """Start and end of the next word from `at`; both `end` where there is none."""
    while at < end and data[at] == 32:
        at += 1
    start = at
    while at < end and data[at] != 32:
        at += 1
    return start, at


@njit(cache=True)
def whole_number(data: Array, start: int, end: int) -> int:
    """A number of up to nine digits without a sign; -1 where it is none."""
    if end <= start or end - start > 9:
        return -1
    value = 0
    for p in range(start, end):
        digit = np.int64(data[p]) - 48
        if digit < 0 or digit > 9:
            return -1
        value = int(value * 10 + digit)
    return value


@njit(cache=True)
def parse_scientific(data: Array, start: int, end: int) -> tuple[int, float]:
    """Sign, digits with a point, exponent after D or E; nothing else.

    Up to 15 digits with a power of ten of 22 at most give the nearest float64, others one
    within a unit or two of its last place.
    """
    p = start
    if p == end:
        return BLANK, 0.0
    negative = data[p] == 45
    if negative or data[p] == 43:
        p += 1
    mantissa = np.int64(0)
    digits = 0
    seen = 0
    power = 0
    point = False
    while p < end:
        byte = np.int64(data[p])
        if 48 <= byte <= 57:
            seen += 1
            if digits < _MOST_DIGITS:
                mantissa = mantissa * 10 + (byte - 48)
                if mantissa > 0:
                    digits += 1
                if point:
                    power -= 1
            elif not point:
                power += 1
        elif byte == 46 and not point:
            point = True
        else:
            break
        p += 1
    if seen == 0:
        return DAMAGED, 0.0
    if p < end:
        letter = data[p]
        if letter != 69 and letter != 68 and letter != 101 and letter != 100:
            return DAMAGED, 0.0
        p += 1
        down = p < end and data[p] == 45
        if p < end and (data[p] == 45 or data[p] == 43):
            p += 1
        exponent = whole_number(data, p, end)
        if exponent < 0 or exponent > 99:
            return DAMAGED, 0.0
        power += -exponent if down else exponent
    value = np.float64(mantissa)
    while power < 0:
        step = min(-power, _EXACT)
        value /= _POWERS[step]
        power += step
    while power > 0:
        step = min(power, _EXACT)
        value *= _POWERS[step]
        power -= step
    return NUMBER, (-value if negative else value)


@njit(cache=True)
def _moment(data: Array, at: int, end: int) -> tuple[int, int]:
    """Year, month, day, hour, minute and seconds as words; calendar ns (-1) and where they end."""
    parts = np.zeros(5, dtype=np.int64)
    for k in range(5):
        start, at = next_word(data, at, end)
        parts[k] = whole_number(data, start, at)
        if parts[k] < 0:
            return -1, at
    minute = calendar_ns(parts[0], parts[1], parts[2], parts[3], parts[4])
    start, at = next_word(data, at, end)
    point = start
    while point < at and data[point] != 46:
        point += 1
    seconds = whole_number(data, start, point)
    if minute < 0 or seconds < 0 or seconds > 60:
        return -1, at
    fraction = 0
    scale = 100_000_000
    for p in range(point + 1, at):
        digit = np.int64(data[p]) - 48
        if digit < 0 or digit > 9:
            return -1, at
        fraction += int(digit * scale)
        scale //= 10
    return minute + seconds * _NS + fraction, at


@njit(cache=True)
def _satellite(data: Array, at: int, name: Array) -> bool:
    """Three bytes of a satellite; blanks stand for G and 0."""
    letter = data[at]
    tens = data[at + 1]
    ones = data[at + 2]
    if letter == 32:
        letter = 71
    if tens == 32:
        tens = 48
    name[0], name[1], name[2] = letter, tens, ones
    return 65 <= letter <= 90 and 48 <= tens <= 57 and 48 <= ones <= 57


@njit(cache=True)
def _exponent(data: Array, start: int, end: int, stop: int) -> int:
    """A small number of a field; -1 where blank, -2 where damaged."""
    end = min(end, stop)
    while start < end and data[start] == 32:
        start += 1
    while end > start and data[end - 1] == 32:
        end -= 1
    if start >= end:
        return -1
    value = whole_number(data, start, end)
    return value if value >= 0 else -2


@njit(cache=True)
def _three(data: Array, start: int, stop: int, values: Array) -> bool:
    """Three numbers of 14 bytes each; False where one is missing or damaged."""
    for k in range(3):
        at = start + 14 * k
        status, value = parse_decimal(data, min(at, stop), min(at + 14, stop))
        if status != NUMBER:
            return False
        values[k] = value
    return True


@njit(cache=True)
def parse_sp3(
    data: Array,
    line_starts: Array,
    line_ends: Array,
    first: int,
    times: Array,
    names: Array,
    positions: Array,
    velocities: Array,
    clocks: Array,
    deviations: Array,
    flags: Array,
    lines: Array,
    status: Array,
) -> tuple[int, int, int]:
    """Records of an SP3 file from line `first` on.

    Parameters
    ----------
    data : uint8 array
    line_starts, line_ends : int64 arrays (lines,)
    first : int
    times : int64 array (rows,), ns, written
        Calendar time of the file.
    names : uint8 array (rows, 3), written
    positions, velocities : float64 arrays (rows, 3), written
        km and dm/s; NaN where there is none.
    clocks : float64 array (rows,), written
        Microseconds, NaN where blank.
    deviations : int64 array (rows, 4), written
        Exponents of x, y, z and clock, -1 where blank.
    flags, lines : int64 arrays (rows,), written
    status : int8 array (lines,), written
        Of each line.

    Returns
    -------
    tuple of three int
        Rows; epochs; line of the end mark, -1 where there is none.
    """
    row = -1
    epochs = 0
    now = -1
    for line in range(first, len(line_starts)):
        start, stop = line_starts[line], line_ends[line]
        if stop == start:
            continue
        kind = data[start]
        if kind == 42:  # *
            now, _ = _moment(data, start + 1, stop)
            if now < 0:
                status[line] = LINE_DAMAGED
            else:
                epochs += 1
        elif kind == 80:  # P
            if now < 0:
                status[line] = LINE_STRAY
                continue
            k = row + 1
            good = stop - start >= 46 and _satellite(data, start + 1, names[k])
            if not (good and _three(data, start + 4, stop, positions[k])):
                status[line] = LINE_DAMAGED
                continue
            found, value = parse_decimal(data, min(start + 46, stop), min(start + 60, stop))
            clocks[k] = value if found == NUMBER else np.nan
            good = found != DAMAGED
            for i in range(4):
                at = start + 61 + 3 * i
                deviations[k, i] = _exponent(data, at, at + (3 if i == 3 else 2), stop)
                good = good and deviations[k, i] != -2
            if not good:
                status[line] = LINE_DAMAGED
                continue
            mark = 0
            if start + 74 < stop and data[start + 74] == 69:
                mark |= FLAG_CLOCK_EVENT
            if start + 75 < stop and data[start + 75] == 80:
                mark |= FLAG_CLOCK_PREDICTED
            if start + 78 < stop and data[start + 78] == 77:
                mark |= FLAG_MANOEUVRE
            if start + 79 < stop and data[start + 79] == 80:
                mark |= FLAG_ORBIT_PREDICTED
            row = k
            times[row] = now
            flags[row] = mark
            lines[row] = line
            velocities[row, 0] = np.nan
        elif kind == 86:  # V
            name = np.zeros(3, dtype=np.uint8)
            good = stop - start >= 46 and _satellite(data, start + 1, name)
            speed = np.zeros(3)
            if not (good and _three(data, start + 4, stop, speed)):
                status[line] = LINE_DAMAGED
            elif now < 0 or row < 0 or times[row] != now:
                status[line] = LINE_STRAY
            else:
                same = True
                for i in range(3):
                    same = same and names[row, i] == name[i]
                if same:
                    velocities[row, :] = speed
                else:
                    status[line] = LINE_STRAY
        elif kind == 69:  # E
            second = data[start + 1] if start + 1 < stop else 0
            if second == 79:
                return row + 1, epochs, line
            status[line] = LINE_UNREAD if second in (80, 86) else LINE_DAMAGED
        elif kind not in (47, 37, 43, 35, 32):  # / % + # and blank
            status[line] = LINE_DAMAGED
    return row + 1, epochs, -1


@njit(cache=True)
def parse_clocks(
    data: Array,
    line_starts: Array,
    line_ends: Array,
    first: int,
    last: int,
    times: Array,
    names: Array,
    is_satellite: Array,
    values: Array,
    lines: Array,
    status: Array,
) -> int:
    """Records of a RINEX CLK file from line `first` to before `last`.

    Parameters
    ----------
    data : uint8 array
    line_starts, line_ends : int64 arrays (lines,)
    first, last : int
    times : int64 array (rows,), ns, written
        Calendar time of the file.
    names : uint8 array (rows, 9), written
        They come as zeros.
    is_satellite : bool array (rows,), written
    values : float64 array (rows, 2), written
        Clock and its standard deviation (s); NaN where there is none.
    lines : int64 array (rows,), written
    status : int8 array (lines,), written
        Of each line.

    Returns
    -------
    int
        Rows.
    """
    row = 0
    owed = 0  # values that stand in the next line
    for line in range(first, last):
        start, stop = line_starts[line], line_ends[line]
        at, end = next_word(data, start, stop)
        if at == stop:
            continue
        if data[start] == 32:
            status[line] = LINE_UNREAD if owed > 0 else LINE_STRAY
            owed -= min(owed, 4)
            continue
        owed = 0
        is_s = end - at == 2 and data[at] == 65 and data[at + 1] == 83  # AS
        is_r = end - at == 2 and data[at] == 65 and data[at + 1] == 82  # AR
        if not is_s and not is_r:
            # CR, DR and MS are of no use to a positioning; anything else is no record.
            other = end - at == 2 and (
                (data[at + 1] == 82 and data[at] in (67, 68)) or (data[at] == 77)
            )
            status[line] = LINE_UNREAD if other else LINE_DAMAGED
            continue
        at, end = next_word(data, end, stop)
        length = end - at
        good = 3 <= length <= NAME_BYTES
        now = -1
        if good:
            for k in range(NAME_BYTES):
                names[row, k] = data[at + k] if k < length else 0
            if is_s:
                good = length == 3 and _satellite(data, at, names[row])
            now, end = _moment(data, end, stop)
        at, end = next_word(data, end, stop)
        count = whole_number(data, at, end)
        good = good and now >= 0 and count >= 1
        values[row, 1] = np.nan
        if good:
            for k in range(min(count, 2)):
                at, end = next_word(data, end, stop)
                found, value = parse_scientific(data, at, end)
                good = good and found == NUMBER
                values[row, k] = value
            at, end = next_word(data, end, stop)
            good = good and at == stop
        if not good:
            status[line] = LINE_DAMAGED
            continue
        owed = count - 2
        times[row] = now
        is_satellite[row] = is_s
        lines[row] = line
        row += 1
    return row
