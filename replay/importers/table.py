"""Named columns of a text file with the line that each row stood in."""

from __future__ import annotations

import dataclasses
import difflib

import numpy as np
import numpy.typing as npt

from replay.errors import ForeignFileError
from replay.importers.files import File

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, slots=True)
class Table:
    """Rows of a file.

    Attributes
    ----------
    file : File
    numbers : mapping of column to float64 array (n,)
        An empty field is NaN.
    texts : mapping of column to list of str
        Columns that hold calendar dates or long decimals.
    lines : int64 array (n,)
        Number of each row's line, from 1.
    time_scale : str
        "GPST" or "UTC" where the file says so, else "".
    """

    file: File
    numbers: dict[str, Float64]
    texts: dict[str, list[str]]
    lines: Int64
    time_scale: str = ""

    def __len__(self) -> int:
        return len(self.lines)

    def number(self, name: str) -> Float64:
        """A numeric column.

        Raises
        ------
        ForeignFileError
            Where there is none of that name.
        """
        if name not in self.numbers:
            raise self._missing(name)
        return self.numbers[name]

    def text(self, name: str) -> list[str]:
        """A text column.

        Raises
        ------
        ForeignFileError
            Where there is none of that name.
        """
        if name not in self.texts:
            raise self._missing(name)
        return self.texts[name]

    def take(self, rows: Int64) -> Table:
        """Some rows, in the given order."""
        return Table(
            self.file,
            {name: column[rows] for name, column in self.numbers.items()},
            {name: [column[row] for row in rows] for name, column in self.texts.items()},
            self.lines[rows],
            self.time_scale,
        )

    def _missing(self, name: str) -> ForeignFileError:
        known = [*self.numbers, *self.texts]
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]}? " if near else ""
        return ForeignFileError(
            f"no column {name!r}",
            where=self.file.name,
            mend=f"{hint}the file has {', '.join(known)}",
        )
