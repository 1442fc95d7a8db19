"""Fewer points on paper than in the log, without a picture that differs.

A line keeps, of every bin, its first, least, greatest and last row (M4, Jugel
et al., VLDB 2014): drawn at a bin per pixel it is the same line.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats

Rows = npt.NDArray[np.int64]


def line_rows(values: Floats, bins: int) -> Rows:
    """Rows of a line to draw; rows that are not a number (gaps) all stay.

    Parameters
    ----------
    values : array (n,)
    bins : int

    Returns
    -------
    int64 array (m,)
        Ascending; all rows where there are at most four to a bin.
    """
    count = len(values)
    if count <= 4 * bins:
        return np.arange(count, dtype=np.int64)
    finite = np.isfinite(values)
    rows = np.flatnonzero(finite)
    bin_of = rows * bins // count
    order = np.lexsort((values[rows], bin_of))
    _, starts = np.unique(bin_of, return_index=True)
    ends = np.append(starts[1:], len(rows)) - 1
    picked = [rows[starts], rows[ends], rows[order[starts]], rows[order[ends]]]
    return np.unique(np.concatenate([*picked, np.flatnonzero(~finite)]))


def band_rows(values: Floats, bins: int) -> Rows:
    """Rows of a band (n, 2) to draw: those of both its edges."""
    return np.union1d(line_rows(values[:, 0], bins), line_rows(values[:, 1], bins))


def dot_stride(count: int, most: int) -> int:
    """Every how manieth dot to draw so that there are at most `most`."""
    return max(1, -(-count // most))
