"""Compiled loops of the protobuf wire format: find fields, take columns, put columns.

Decoding goes in two steps. :func:`locate` walks each row once and notes where
every field's value lies; the `take_*` loops then fill one column each. All reads
stay inside the row, whatever the bytes say; a row that breaks the wire format
gets a code in `bad` and its values are not to be used.

Encoding fills the rows column by column, in the order of field numbers, each
`put_*` loop moving the rows' cursors on.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

import replay.kernels  # noqa: F401  sets the folder of numba's cache
from replay.log._memory import copy_bytes, load32, load64, signed, store32, store64
from replay.log._scan import (
    BYTES_IN,
    BYTES_OUT,
    I64,
    I64_IN,
    I64_OUT,
    U64,
    U64_OUT,
    Bytes,
)

I64_GRID_OUT = types.Array(types.int64, 2, "C")
U64_IN = types.Array(types.uint64, 1, "C", readonly=True)
U64_GRID_OUT = types.Array(types.uint64, 2, "C")
BYTES_GRID_IN = types.Array(types.uint8, 2, "C", readonly=True)
BYTES_GRID_OUT = types.Array(types.uint8, 2, "C")

# What `bad` says of a row; 0 is a good one.
TRUNCATED = 1  # a varint does not end, or a value runs past the end of its message
MALFORMED = 2  # a wire type, field number or group that protobuf does not allow
NOT_UTF8 = 3
TOO_LONG = 4  # a text that does not fit its column

ABSENT = -1
SCATTERED = -2  # a field in several pieces: the row is walked again for it

VARINT = 0
FIXED64 = 1
DELIMITED = 2
GROUP = 3
GROUP_END = 4
FIXED32 = 5
_MAX_DEPTH = 100  # as protobuf's own parsers


@njit(cache=True)
def _read_varint(buf: Bytes, p: int, end: int, limit: int) -> tuple[np.uint64, int]:
    """Value and the place after it; a place of -1 where it does not end in `limit` bytes."""
    value = np.uint64(0)
    shift = np.uint64(0)
    stop = min(end, p + limit)
    while p < stop:
        byte = np.uint64(buf[p])
        value |= (byte & np.uint64(0x7F)) << shift
        p += 1
        if byte < np.uint64(0x80):
            return value, p
        shift += np.uint64(7)
    return value, -1


@njit(cache=True)
def _read_length(buf: Bytes, p: int, end: int) -> tuple[int, int]:
    """Length of a delimited value and the place after it; (-1, -1) where it does not fit."""
    if p < end and buf[p] < 0x80:
        size = signed(buf[p])
        p += 1
    else:
        value, p = _read_varint(buf, p, end, 5)
        if p < 0 or value > np.uint64(0x7FFFFFFF):
            return -1, -1
        size = signed(value)
    if size > end - p:
        return -1, -1
    return size, p


@njit(cache=True)
def _read_tag(buf: Bytes, p: int, end: int) -> tuple[int, int, int]:
    """Field number, wire type and the place after; a number of -TRUNCATED or -MALFORMED if not."""
    if p < end and buf[p] < 0x80:
        tag = signed(buf[p])
        p += 1
    else:
        value, p = _read_varint(buf, p, end, 5)
        if p < 0:
            return -TRUNCATED, 0, p
        if value > np.uint64(0xFFFFFFFF):
            return -MALFORMED, 0, p
        tag = signed(value)
    number = tag >> 3
    wire = tag & 7
    if number == 0 or wire > FIXED32:
        return -MALFORMED, 0, p
    return number, wire, p


@njit(cache=True)
def _skip_plain(buf: Bytes, p: int, end: int, wire: int) -> int:
    """Place after a value that is no group, or -TRUNCATED or -MALFORMED."""
    if wire == VARINT:
        _, p = _read_varint(buf, p, end, 10)
        return p if p >= 0 else -TRUNCATED
    if wire == FIXED64:
        return p + 8 if p + 8 <= end else -TRUNCATED
    if wire == FIXED32:
        return p + 4 if p + 4 <= end else -TRUNCATED
    if wire == DELIMITED:
        size, p = _read_length(buf, p, end)
        return p + size if p >= 0 else -TRUNCATED
    return -MALFORMED


@njit(cache=True)
def _skip_group(buf: Bytes, p: int, end: int, number: int) -> int:
    """Place after the group `number` that begins at `p`, or -TRUNCATED or -MALFORMED."""
    numbers = np.empty(_MAX_DEPTH, dtype=np.int64)
    numbers[0] = number
    depth = 1
    while depth > 0:
        if p >= end:
            return -TRUNCATED
        inner, wire, p = _read_tag(buf, p, end)
        if inner < 0:
            return inner
        if wire == GROUP:
            if depth == _MAX_DEPTH:
                return -MALFORMED
            numbers[depth] = inner
            depth += 1
        elif wire == GROUP_END:
            depth -= 1
            if numbers[depth] != inner:
                return -MALFORMED
        else:
            p = _skip_plain(buf, p, end, wire)
            if p < 0:
                return p
    return p


@njit(cache=True)
def _skip(buf: Bytes, p: int, end: int, number: int, wire: int) -> int:
    if wire == GROUP:
        return _skip_group(buf, p, end, number)
    return _skip_plain(buf, p, end, wire)


@njit(
    types.void(
        BYTES_IN, I64_IN, I64_IN, I64_IN, I64_IN, I64_IN, I64_GRID_OUT, I64_GRID_OUT, BYTES_OUT
    ),
    nogil=True,
    cache=True,
)
def locate(
    buf: Bytes,
    offset: I64,
    length: I64,
    slot_of: I64,
    wire_of: I64,
    joins: I64,
    where: I64,
    size: I64,
    bad: Bytes,
) -> None:
    """Find every field of every row.

    `slot_of[number]` is a field's row in `where` and `size`, or -1. `wire_of[slot]`
    is its wire type. `joins[slot]` is -1 where a later value replaces an earlier
    one, else (nested and repeated fields, whose pieces join) the wire type of a
    single element. `where[slot, row]` gets the offset of the value (after the
    length of a delimited one), ABSENT or SCATTERED; `size` a delimited one's length.
    """
    for row in range(len(offset)):
        p = offset[row]
        end = p + length[row]
        for slot in range(where.shape[0]):
            where[slot, row] = ABSENT
        code = 0
        while p < end:
            number, wire, p = _read_tag(buf, p, end)
            if number < 0:
                code = -number
                break
            slot = slot_of[number] if number < len(slot_of) else -1
            if slot >= 0 and wire == wire_of[slot]:
                span = 0
                if wire == DELIMITED:
                    span, p = _read_length(buf, p, end)
                    if p < 0:
                        code = TRUNCATED
                        break
                if joins[slot] >= 0 and where[slot, row] != ABSENT:
                    where[slot, row] = SCATTERED
                else:
                    where[slot, row] = p
                    size[slot, row] = span
                p = p + span if wire == DELIMITED else _skip_plain(buf, p, end, wire)
            else:
                if slot >= 0 and wire == joins[slot]:
                    where[slot, row] = SCATTERED
                p = _skip(buf, p, end, number, wire)
            if p < 0:
                code = -p
                break
        bad[row] = code


@njit(types.void(BYTES_IN, I64_IN, U64_OUT), nogil=True, cache=True)
def take_fixed64(buf: Bytes, where: I64, out: U64) -> None:
    """Values of eight bytes; absent rows keep what `out` holds."""
    for row in range(len(where)):
        if where[row] >= 0:
            out[row] = load64(buf, where[row])


@njit(types.void(BYTES_IN, I64_IN, U64_OUT), nogil=True, cache=True)
def take_fixed32(buf: Bytes, where: I64, out: U64) -> None:
    """Values of four bytes, widened; absent rows keep what `out` holds."""
    for row in range(len(where)):
        if where[row] >= 0:
            out[row] = np.uint64(load32(buf, where[row]))


@njit(types.void(BYTES_IN, I64_IN, I64_IN, I64_IN, U64_OUT), nogil=True, cache=True)
def take_varint(buf: Bytes, offset: I64, length: I64, where: I64, out: U64) -> None:
    """Varints; absent rows keep what `out` holds."""
    for row in range(len(where)):
        if where[row] >= 0:
            out[row], _ = _read_varint(buf, where[row], offset[row] + length[row], 10)


@njit(cache=True)
def _take_doubles(buf: Bytes, p: int, end: int, slot_of: I64, out: U64) -> int:
    """Doubles of one nested message into `out`; 0 or a code of `bad`."""
    while p < end:
        number, wire, p = _read_tag(buf, p, end)
        if number < 0:
            return -number
        value_at = p
        p = _skip(buf, p, end, number, wire)
        if p < 0:
            return -p
        if wire == FIXED64 and number < len(slot_of) and slot_of[number] >= 0:
            out[slot_of[number]] = load64(buf, value_at)
    return 0


@njit(
    types.void(
        BYTES_IN, I64_IN, I64_IN, types.int64, I64_IN, BYTES_IN,
        I64_IN, I64_IN, U64_GRID_OUT, BYTES_OUT,
    ),
    nogil=True,
    cache=True,
)  # fmt: skip
def take_vector(
    buf: Bytes,
    offset: I64,
    length: I64,
    field: int,
    slot_of: I64,
    tags: Bytes,
    where: I64,
    size: I64,
    out: U64,
    bad: Bytes,
) -> None:
    """Nested messages of doubles as rows of `out`; rows that lack the field keep what it holds.

    A message whose components all stand in order, which every writer that omits
    no zero makes, is copied word by word; any other is walked.
    """
    width = len(tags)
    for row in range(len(where)):
        at = where[row]
        if at == ABSENT or bad[row] != 0:
            continue
        plain = at >= 0 and size[row] == 9 * width
        if plain:
            for k in range(width):
                plain = plain and buf[at + 9 * k] == tags[k]
        if plain:
            for k in range(width):
                out[row, k] = load64(buf, at + 9 * k + 1)
            continue
        out[row] = 0
        if at >= 0:
            bad[row] = _take_doubles(buf, at, at + size[row], slot_of, out[row])
            continue
        p = offset[row]
        end = p + length[row]
        while p < end and bad[row] == 0:
            number, wire, p = _read_tag(buf, p, end)
            if number == field and wire == DELIMITED:
                span, p = _read_length(buf, p, end)
                bad[row] = _take_doubles(buf, p, p + span, slot_of, out[row])
                p += span
            else:
                p = _skip(buf, p, end, number, wire)


@njit(types.void(BYTES_IN, I64_IN, I64_IN, BYTES_GRID_OUT, BYTES_OUT), nogil=True, cache=True)
def take_text(buf: Bytes, where: I64, size: I64, out: Bytes, bad: Bytes) -> None:
    """Short texts into columns of one width, filled up with zero bytes."""
    width = out.shape[1]
    for row in range(len(where)):
        if where[row] < 0:
            continue
        if size[row] > width:
            bad[row] = TOO_LONG
            continue
        copy_bytes(out.reshape(-1), row * width, buf, where[row], size[row])


@njit(cache=True)
def _elements(buf: Bytes, p: int, end: int, element: int) -> int:
    """How many packed elements lie in `p..end`, or -TRUNCATED."""
    if element == VARINT:
        count = 0
        run = 0
        for i in range(p, end):
            run += 1
            if buf[i] < 0x80:
                count += 1
                run = 0
            elif run == 10:
                return -TRUNCATED
        return count if run == 0 else -TRUNCATED
    width = 8 if element == FIXED64 else 4
    return (end - p) // width if (end - p) % width == 0 else -TRUNCATED


@njit(cache=True)
def _fill(buf: Bytes, p: int, end: int, element: int, out: U64, k: int) -> int:
    """Packed elements of `p..end` into `out[k:]`; the place after the last."""
    while p < end:
        if element == VARINT:
            out[k], p = _read_varint(buf, p, end, 10)
        elif element == FIXED64:
            out[k] = load64(buf, p)
            p += 8
        else:
            out[k] = np.uint64(load32(buf, p))
            p += 4
        k += 1
    return k


@njit(
    types.void(
        BYTES_IN, I64_IN, I64_IN, types.int64, types.int64, I64_IN, I64_IN,
        I64_IN, I64_OUT, U64_OUT, BYTES_OUT,
    ),
    nogil=True,
    cache=True,
)  # fmt: skip
def take_repeated(
    buf: Bytes,
    offset: I64,
    length: I64,
    field: int,
    element: int,
    where: I64,
    size: I64,
    starts: I64,
    counts: I64,
    out: U64,
    bad: Bytes,
) -> None:
    """Repeated numbers, packed or not.

    With an `out` of length 0 the elements of each row are counted into `counts`;
    else they are put into `out` from `starts[row]` on.
    """
    filling = len(out) > 0
    for row in range(len(where)):
        at = where[row]
        if at == ABSENT or bad[row] != 0:
            continue
        if at >= 0:
            if filling:
                _fill(buf, at, at + size[row], element, out, starts[row])
            else:
                counts[row] = _elements(buf, at, at + size[row], element)
        else:
            p = offset[row]
            end = p + length[row]
            total = 0
            while p < end:
                number, wire, p = _read_tag(buf, p, end)
                begin = p
                p = _skip(buf, p, end, number, wire)
                if number != field:
                    continue
                if wire == DELIMITED:
                    _, begin = _read_length(buf, begin, end)
                elif wire != element:
                    continue
                found = _elements(buf, begin, p, element)
                if found < 0:
                    total = found
                    break
                if filling:
                    _fill(buf, begin, p, element, out, starts[row] + total)
                total += found
            counts[row] = total
        if counts[row] < 0:
            bad[row] = TRUNCATED
            counts[row] = 0


@njit(types.void(BYTES_IN, I64_IN, BYTES_OUT), nogil=True, cache=True)
def check_utf8(data: Bytes, offset: I64, bad: Bytes) -> None:
    """Mark the rows of a ragged text that are no UTF-8 (RFC 3629)."""
    for row in range(len(offset) - 1):
        p = offset[row]
        end = offset[row + 1]
        while p < end:
            lead = data[p]
            p += 1
            if lead < 0x80:
                continue
            low = 0x80
            high = 0xBF
            if 0xC2 <= lead <= 0xDF:
                more = 1
            elif 0xE0 <= lead <= 0xEF:
                more = 2
                low = 0xA0 if lead == 0xE0 else low
                high = 0x9F if lead == 0xED else high
            elif 0xF0 <= lead <= 0xF4:
                more = 3
                low = 0x90 if lead == 0xF0 else low
                high = 0x8F if lead == 0xF4 else high
            else:
                bad[row] = NOT_UTF8
                break
            for _ in range(more):
                if p >= end or data[p] < low or data[p] > high:
                    bad[row] = NOT_UTF8
                    break
                low = 0x80
                high = 0xBF
                p += 1
            if bad[row] != 0:
                break


@njit(types.void(U64_IN, I64_OUT), nogil=True, cache=True)
def varint_sizes(values: U64, out: I64) -> None:
    """Bytes that each value takes as a varint."""
    for i in range(len(values)):
        value = values[i] >> np.uint64(7)
        count = 1
        while value != 0:
            value >>= np.uint64(7)
            count += 1
        out[i] = count


@njit(cache=True)
def _put_varint(out: Bytes, p: int, value: np.uint64) -> int:
    while value >= np.uint64(0x80):
        out[p] = np.uint8((value & np.uint64(0x7F)) | np.uint64(0x80))
        value >>= np.uint64(7)
        p += 1
    out[p] = np.uint8(value)
    return p + 1


@njit(types.void(U64_IN, BYTES_OUT), nogil=True, cache=True)
def put_packed(values: U64, out: Bytes) -> None:
    """Varints end to end."""
    p = 0
    for i in range(len(values)):
        p = _put_varint(out, p, values[i])


@njit(
    types.void(BYTES_IN, I64_IN, types.int64, BYTES_GRID_IN, BYTES_IN, BYTES_OUT, I64_OUT),
    nogil=True,
    cache=True,
)
def put_fixed(
    template: Bytes, slots: I64, width: int, body: Bytes, present: Bytes, out: Bytes, cursor: I64
) -> None:
    """Fields of one constant size: `template` with the words of `body` set in at `slots`.

    An empty `present` means every row.
    """
    size = len(template)
    for row in range(len(cursor)):
        if len(present) and present[row] == 0:
            continue
        p = cursor[row]
        copy_bytes(out, p, template, 0, size)
        flat = body.reshape(-1)
        at = row * body.shape[1]
        for k in range(len(slots)):
            if width == 8:
                store64(out, p + slots[k], load64(flat, at + 8 * k))
            else:
                store32(out, p + slots[k], load32(flat, at + 4 * k))
        cursor[row] = p + size


@njit(types.void(BYTES_IN, U64_IN, BYTES_IN, BYTES_OUT, I64_OUT), nogil=True, cache=True)
def put_varint(tag: Bytes, values: U64, present: Bytes, out: Bytes, cursor: I64) -> None:
    """Varint fields; an empty `present` means every row."""
    for row in range(len(cursor)):
        if len(present) and present[row] == 0:
            continue
        p = cursor[row]
        copy_bytes(out, p, tag, 0, len(tag))
        cursor[row] = _put_varint(out, p + len(tag), values[row])


@njit(
    types.void(BYTES_IN, I64_IN, I64_IN, BYTES_IN, BYTES_IN, BYTES_OUT, I64_OUT),
    nogil=True,
    cache=True,
)
def put_delimited(
    tag: Bytes, offset: I64, length: I64, data: Bytes, present: Bytes, out: Bytes, cursor: I64
) -> None:
    """Length-delimited fields; an empty `present` means every row."""
    for row in range(len(cursor)):
        if len(present) and present[row] == 0:
            continue
        p = cursor[row]
        copy_bytes(out, p, tag, 0, len(tag))
        p = _put_varint(out, p + len(tag), np.uint64(length[row]))
        copy_bytes(out, p, data, offset[row], length[row])
        cursor[row] = p + length[row]
