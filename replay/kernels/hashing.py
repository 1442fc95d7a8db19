"""Rolling 64-bit digest of rows, for the trace: it tells equal from different, not friend from foe.

Each row's bytes are mixed word by word with the multiply-xorshift steps of
splitmix64 (Steele, Lea, Flood 2014) and chained to the digest before it.
"""

from typing import Any

import numpy as np
from numba import njit

from replay.kernels.types import Array

_MULTIPLIER_1 = np.uint64(0xBF58476D1CE4E5B9)
_MULTIPLIER_2 = np.uint64(0x94D049BB133111EB)
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_S30 = np.uint64(30)
_S27 = np.uint64(27)
_S31 = np.uint64(31)


@njit(cache=True)
def mix(h: Any) -> Any:
    """One round of splitmix64 on a 64-bit word."""
    h = (h ^ (h >> _S30)) * _MULTIPLIER_1
    h = (h ^ (h >> _S27)) * _MULTIPLIER_2
    return h ^ (h >> _S31)


@njit(cache=True)
def combine(a: Any, b: Any) -> Any:
    """Digest of two digests, in this order."""
    return mix((mix(a + _GOLDEN) ^ b) + _GOLDEN)


@njit(cache=True)
def combine_rows(total: Array, more: Array) -> None:
    """Replace each of `total` by its combination with the same place of `more`."""
    for i in range(total.shape[0]):
        total[i] = combine(total[i], more[i])


@njit(cache=True)
def rolling_digest(
    seed: Any, log_t: Array, valid_t: Array, offsets: Array, lengths: Array, data: Array, out: Array
) -> Any:
    """Chain rows to `seed`; `out[i]` is the digest after row i.

    Parameters
    ----------
    seed : uint64
    log_t, valid_t : int64 arrays (n,), ns
    offsets, lengths : int64 arrays (n,)
        Payload of each row in `data`.
    data : uint8 array
    out : uint64 array (n,)

    Returns
    -------
    uint64
        Digest after the last row.
    """
    h = seed
    for i in range(log_t.shape[0]):
        h = mix((h ^ np.uint64(log_t[i])) + _GOLDEN)
        h = mix((h ^ np.uint64(valid_t[i])) + _GOLDEN)
        first = offsets[i]
        length = lengths[i]
        h = (h ^ np.uint64(length)) * _MULTIPLIER_1
        whole = length // 8
        for k in range(whole):
            at = first + 8 * k
            word = np.uint64(data[at])
            for j in range(1, 8):
                word |= np.uint64(data[at + j]) << np.uint64(8 * j)
            h = (h ^ word) * _MULTIPLIER_1
            h ^= h >> _S31
        word = np.uint64(0)
        for j in range(8 * whole, length):
            word |= np.uint64(data[first + j]) << np.uint64(8 * (j - 8 * whole))
        h = mix((h ^ word) + _GOLDEN)
        out[i] = h
    return h
