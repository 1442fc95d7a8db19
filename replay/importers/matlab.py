"""Matrices of MATLAB files (before version 7.3) as tables."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
import scipy.io

from replay.errors import ConfigurationError, ForeignFileError
from replay.importers.files import File
from replay.importers.table import Table


def read_mat(file: File, variable: str, columns: Sequence[str]) -> Table:
    """Columns of a matrix.

    Parameters
    ----------
    file : File
    variable : str
        Name of the matrix; empty where the file has only one.
    columns : sequence of str
        Names of its columns, in their order.

    Returns
    -------
    Table
        `lines` count the rows of the matrix from 1.

    Raises
    ------
    ConfigurationError
        Where the columns have no names.
    ForeignFileError
        Where the file cannot be read, or has no such matrix of numbers.
    """
    if not columns:
        raise ConfigurationError(
            "the columns of a matrix have no names", where=file.name, mend="give columns = [...]"
        )
    try:
        found = scipy.io.loadmat(io.BytesIO(file.data))
    except Exception as error:  # a damaged file raises whatever its bytes lead to
        raise ForeignFileError(
            f"the file is no MATLAB file that can be read: {error}",
            where=file.name,
            mend="fetch it again; a file of version 7.3 has to be saved as version 7",
        ) from error
    names = [name for name in found if not name.startswith("__")]
    if variable not in names and (variable or len(names) != 1):
        raise ForeignFileError(
            f"no variable {variable!r}", where=file.name, mend=f"the file has {', '.join(names)}"
        )
    matrix = found[variable or names[0]]
    if not isinstance(matrix, np.ndarray) or matrix.ndim != 2 or matrix.dtype.kind not in "fiu":
        raise ForeignFileError(
            f"{variable or names[0]} is no matrix of numbers", where=file.name, mend="name another"
        )
    if matrix.shape[1] != len(columns) or len(matrix) == 0:
        raise ForeignFileError(
            f"the matrix has {len(matrix)} rows of {matrix.shape[1]} columns",
            where=file.name,
            mend=f"{len(columns)} columns are expected: {', '.join(columns)}",
        )
    numbers = {
        name: np.ascontiguousarray(matrix[:, k], dtype=np.float64) for k, name in enumerate(columns)
    }
    return Table(file, numbers, {}, np.arange(1, len(matrix) + 1, dtype=np.int64))
