"""Compiled loops over MCAP records: walking, gathering, packing.

Arrays of bytes are read-only in every signature, so that a mapped file, a
decompressed chunk and an encoded buffer all use the one compiled version.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit, types

import replay.kernels  # noqa: F401  sets the folder of numba's cache
from replay.log._memory import copy_bytes, load16, load32, load64, signed, store16, store32, store64

Bytes = npt.NDArray[np.uint8]
I64 = npt.NDArray[np.int64]
U64 = npt.NDArray[np.uint64]
U32 = npt.NDArray[np.uint32]
U16 = npt.NDArray[np.uint16]

BYTES_IN = types.Array(types.uint8, 1, "C", readonly=True)
BYTES_OUT = types.Array(types.uint8, 1, "C")
I64_IN = types.Array(types.int64, 1, "C", readonly=True)
I64_OUT = types.Array(types.int64, 1, "C")
U32_IN = types.Array(types.uint32, 1, "C", readonly=True)
U32_OUT = types.Array(types.uint32, 1, "C")
U16_IN = types.Array(types.uint16, 1, "C", readonly=True)
U16_OUT = types.Array(types.uint16, 1, "C")
U64_OUT = types.Array(types.uint64, 1, "C")

_tuple_of: Any = types.UniTuple
_triple = _tuple_of(types.int64, 3)
_pair = _tuple_of(types.int64, 2)

MESSAGE = 0x05
DATA_END = 0x0F
HEADER_BYTES = 9  # opcode and content length
MESSAGE_HEAD_BYTES = 22  # channel id, sequence, log time, publish time
_TIME_LIMIT = np.uint64((1 << 63) - 1)


@njit(_triple(BYTES_IN, types.int64, types.int64), nogil=True, cache=True)
def count_records(buf: Bytes, start: int, end: int) -> tuple[int, int, int]:
    """Messages, other records, and where the walk stopped (`end` where all is well)."""
    p = start
    messages = 0
    others = 0
    while p + HEADER_BYTES <= end:
        length = load64(buf, p + 1)
        if length > np.uint64(end - p - HEADER_BYTES):
            break
        if buf[p] == MESSAGE:
            if length < np.uint64(MESSAGE_HEAD_BYTES):
                break
            if load64(buf, p + 15) >= _TIME_LIMIT or load64(buf, p + 23) >= _TIME_LIMIT:
                break
            messages += 1
        else:
            others += 1
        p += HEADER_BYTES + signed(length)
    return messages, others, p


@njit(
    types.void(
        BYTES_IN, types.int64, types.int64,
        U16_OUT, U32_OUT, I64_OUT, I64_OUT, I64_OUT, I64_OUT, I64_OUT,
    ),
    nogil=True,
    cache=True,
)  # fmt: skip
def fill_records(
    buf: Bytes,
    start: int,
    stop: int,
    channel: U16,
    sequence: U32,
    log: I64,
    publish: I64,
    offset: I64,
    length: I64,
    others: I64,
) -> None:
    """Heads of the messages that :func:`count_records` counted, and where the others begin."""
    p = start
    m = 0
    o = 0
    while p < stop:
        size = signed(load64(buf, p + 1))
        if buf[p] == MESSAGE:
            channel[m] = load16(buf, p + 9)
            sequence[m] = load32(buf, p + 11)
            log[m] = signed(load64(buf, p + 15))
            publish[m] = signed(load64(buf, p + 23))
            offset[m] = p + HEADER_BYTES + MESSAGE_HEAD_BYTES
            length[m] = size - MESSAGE_HEAD_BYTES
            m += 1
        else:
            others[o] = p
            o += 1
        p += HEADER_BYTES + size


@njit(
    _pair(
        BYTES_IN, types.int64, types.int64, types.int64,
        BYTES_OUT, I64_OUT, I64_OUT, I64_OUT, I64_OUT, I64_OUT,
    ),
    nogil=True,
    cache=True,
)  # fmt: skip
def walk_section(
    buf: Bytes,
    start: int,
    end: int,
    run_bytes: int,
    opcode: Bytes,
    offset: I64,
    length: I64,
    count: I64,
    first: I64,
    last: I64,
) -> tuple[int, int]:
    """Records of a section, neighbouring messages drawn together into runs.

    Entry `k` is one record, or a run of `count[k]` messages of at most about
    `run_bytes` whose log times lie in `first[k]..last[k]`; `length[k]` includes
    record headers. With arrays of length 0 the entries are only counted. Ends
    after a DataEnd record, or at the first record that does not fit. Returns the
    number of entries and where the walk stopped.
    """
    p = start
    k = -1
    open_run = False
    run_start = start
    filling = len(opcode) > 0
    while p + HEADER_BYTES <= end:
        size = load64(buf, p + 1)
        if size > np.uint64(end - p - HEADER_BYTES):
            break
        total = HEADER_BYTES + signed(size)
        op = buf[p]
        if op == MESSAGE:
            if size < np.uint64(MESSAGE_HEAD_BYTES):
                break
            when = load64(buf, p + 15)
            if when >= _TIME_LIMIT or load64(buf, p + 23) >= _TIME_LIMIT:
                break
            time = signed(when)
            if open_run and p - run_start < run_bytes:
                if filling:
                    length[k] += total
                    count[k] += 1
                    first[k] = min(first[k], time)
                    last[k] = max(last[k], time)
            else:
                k += 1
                open_run = True
                run_start = p
                if filling:
                    opcode[k] = op
                    offset[k] = p
                    length[k] = total
                    count[k] = 1
                    first[k] = time
                    last[k] = time
        else:
            k += 1
            open_run = False
            if filling:
                opcode[k] = op
                offset[k] = p
                length[k] = total
                count[k] = 0
                first[k] = 0
                last[k] = 0
        p += total
        if op == DATA_END:
            break
    return k + 1, p


@njit(types.boolean(I64_IN, U32_IN), nogil=True, cache=True)
def is_ordered(log: I64, sequence: U32) -> bool:
    """Whether rows stand in the order of log time, then sequence."""
    for i in range(1, len(log)):
        if log[i] < log[i - 1] or (log[i] == log[i - 1] and sequence[i] < sequence[i - 1]):
            return False
    return True


@njit(types.void(I64_IN, I64_IN, BYTES_IN, BYTES_OUT), nogil=True, cache=True)
def gather(offset: I64, length: I64, data: Bytes, out: Bytes) -> None:
    """Payloads end to end."""
    p = 0
    for i in range(len(offset)):
        copy_bytes(out, p, data, offset[i], length[i])
        p += length[i]


@njit(types.void(I64_IN, I64_IN, I64_IN, I64_IN, BYTES_IN, BYTES_OUT), nogil=True, cache=True)
def pack_digest_rows(
    log: I64, publish: I64, offset: I64, length: I64, data: Bytes, out: Bytes
) -> None:
    """Rows as they are hashed: log time, publish time, payload length, payload."""
    p = 0
    for i in range(len(log)):
        store64(out, p, np.uint64(log[i]))
        store64(out, p + 8, np.uint64(publish[i]))
        store32(out, p + 16, np.uint32(length[i]))
        copy_bytes(out, p + 20, data, offset[i], length[i])
        p += 20 + length[i]


@njit(
    types.void(
        I64_IN, U16_IN, U32_IN, I64_IN, I64_IN, I64_IN, I64_IN, BYTES_IN, BYTES_OUT, I64_OUT
    ),
    nogil=True,
    cache=True,
)
def pack_messages(
    order: I64,
    channel: U16,
    sequence: U32,
    log: I64,
    publish: I64,
    offset: I64,
    length: I64,
    data: Bytes,
    out: Bytes,
    begins: I64,
) -> None:
    """Message records of the rows `order`, end to end; `begins` gets where each one starts."""
    p = 0
    for k in range(len(order)):
        i = order[k]
        begins[k] = p
        out[p] = MESSAGE
        store64(out, p + 1, np.uint64(MESSAGE_HEAD_BYTES + length[i]))
        store16(out, p + 9, channel[i])
        store32(out, p + 11, sequence[i])
        store64(out, p + 15, np.uint64(log[i]))
        store64(out, p + 23, np.uint64(publish[i]))
        copy_bytes(out, p + 31, data, offset[i], length[i])
        p += HEADER_BYTES + MESSAGE_HEAD_BYTES + length[i]


@njit(types.void(I64_IN, I64_IN, I64_IN, BYTES_IN, U64_OUT), nogil=True, cache=True)
def hash_rows(valid: I64, offset: I64, length: I64, data: Bytes, out: U64) -> None:
    """FNV-1a over valid time and payload, eight bytes at a time: equal rows, equal numbers."""
    prime = np.uint64(0x100000001B3)
    for i in range(len(offset)):
        h = (np.uint64(0xCBF29CE484222325) ^ np.uint64(valid[i])) * prime
        h ^= h >> np.uint64(29)
        p = offset[i]
        end = p + length[i]
        while p + 8 <= end:
            h = (h ^ load64(data, p)) * prime
            h ^= h >> np.uint64(29)
            p += 8
        while p < end:
            h = (h ^ np.uint64(data[p])) * prime
            p += 1
        out[i] = h ^ np.uint64(length[i])


@njit(types.int64(BYTES_IN, types.int64, types.int64, types.int64), nogil=True, cache=True)
def find_record(buf: Bytes, start: int, stop: int, end: int) -> int:
    """First place in `start..stop` where a chunk, attachment or metadata record may begin.

    Its own length must agree with the lengths inside it, to the byte, and lie before
    `end`: chance bytes do not do that. Returns -1 where there is none.
    """
    for p in range(start, min(stop, end - HEADER_BYTES)):
        op = buf[p]
        if op != 0x06 and op != 0x09 and op != 0x0C:
            continue
        size = load64(buf, p + 1)
        if size > np.uint64(end - p - HEADER_BYTES):
            continue
        q = p + HEADER_BYTES
        stop_at = q + signed(size)
        texts = 1
        if op == 0x06:
            q += 28
        elif op == 0x09:
            q += 16
            texts = 2
        fits = True
        for _ in range(texts):
            if fits and q + 4 <= stop_at:
                q += 4 + signed(load32(buf, q))
            else:
                fits = False
        if op == 0x0C:
            if fits and q + 4 <= stop_at and q + 4 + signed(load32(buf, q)) == stop_at:
                return p
            continue
        if fits and q + 8 <= stop_at:
            rest = np.uint64(stop_at - q - 8 - (4 if op == 0x09 else 0))
            if load64(buf, q) == rest:
                return p
    return -1
