"""What an import met on its way: losses that are counted, notes for a person."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from replay.errors import ForeignFileError, LossReport

_LINES_SHOWN = 5


@dataclasses.dataclass(slots=True)
class Findings:
    """Losses and notes so far.

    Attributes
    ----------
    strict : bool
        Whether the first loss ends the import.
    losses : LossReport
    notes : list of str
        What was done, for the manifest.
    """

    strict: bool = False
    losses: LossReport = dataclasses.field(default_factory=LossReport)
    notes: list[str] = dataclasses.field(default_factory=list)

    def rows(
        self, what: str, file: str, lines: Sequence[int] | npt.NDArray[np.int64], mend: str
    ) -> None:
        """Count rows of a file that a rule hit; nothing where there are none.

        Raises
        ------
        ForeignFileError
            Where the import is strict.
        """
        if len(lines) == 0:
            return
        if self.strict:
            raise ForeignFileError(what, where=f"{file}:{lines[0]}", mend=mend)
        shown = ", ".join(str(line) for line in lines[:_LINES_SHOWN])
        more = ", …" if len(lines) > _LINES_SHOWN else ""
        label = "line" if len(lines) == 1 else "lines"
        self.losses.add(what, where=f"{file}, {label} {shown}{more}", count=len(lines), unit="rows")

    def loss(self, what: str, where: str, count: int, unit: str, mend: str) -> None:
        """Count a loss that is not one of single rows.

        Raises
        ------
        ForeignFileError
            Where the import is strict.
        """
        if self.strict:
            raise ForeignFileError(what, where=where, mend=mend)
        self.losses.add(what, where=where, count=count, unit=unit)
