"""Every error that this package raises on purpose, and the exit code of each.

An error says what is wrong, where (file, byte or line, time, channel) and how
to mend it. Exit codes: 0 fine, 1 failure or difference, 2 usage, 3 done with
data loss or incomparable. Loss that leaves something usable is no exception:
it is counted in a :class:`LossReport` and ends in exit code 3.
"""

from __future__ import annotations

import dataclasses
import enum


class ExitCode(enum.IntEnum):
    """What the command line answers."""

    OK = 0
    FAILURE = 1
    USAGE = 2
    LOSS = 3


class ReplayError(Exception):
    """Base of the tree.

    Parameters
    ----------
    what : str
        What is wrong, in one sentence.
    where : str
        File, byte or line, time, channel: whatever is known.
    mend : str
        What the reader can do about it.
    """

    exit_code: ExitCode = ExitCode.FAILURE

    def __init__(self, what: str, *, where: str = "", mend: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.where = where
        self.mend = mend

    def __str__(self) -> str:
        parts = [self.what]
        if self.where:
            parts.append(f"where: {self.where}")
        if self.mend:
            parts.append(f"mend: {self.mend}")
        return "\n  ".join(parts)


class UsageError(ReplayError):
    """The command's words or a configuration are off."""

    exit_code = ExitCode.USAGE


class ConfigurationError(UsageError):
    """A configuration has an unknown key, a wrong type or an impossible value."""


class ForeignFileError(ReplayError):
    """A foreign file cannot be read as its spec says."""


class LogError(ReplayError):
    """An MCAP log cannot be read or written."""


class CorruptLogError(LogError):
    """Bytes of a log are damaged where they should be whole."""


class SchemaError(LogError):
    """A channel's schema is unknown or not the one that is needed."""


class MissingChannelError(LogError):
    """A log lacks a channel that is needed."""


class DataError(ReplayError):
    """Rows of a channel break a rule: time backward, duplicate, not a number."""


class DeterminismError(ReplayError):
    """A re-run did not give the recorded bytes, or this process cannot promise them."""


class IncomparableError(ReplayError):
    """Two runs have nothing that can be compared."""

    exit_code = ExitCode.LOSS


@dataclasses.dataclass(frozen=True, slots=True)
class Loss:
    """Something that was skipped.

    Attributes
    ----------
    what : str
        What was skipped and why.
    where : str
        File, byte or line, time, channel.
    count : int
        How many records, rows or bytes.
    unit : str
        What `count` counts: "messages", "bytes", "rows".
    """

    what: str
    where: str
    count: int
    unit: str

    def __str__(self) -> str:
        return f"{self.what}: {self.count} {self.unit} ({self.where})"


@dataclasses.dataclass(slots=True)
class LossReport:
    """What was skipped so far, in the order of its finding."""

    losses: list[Loss] = dataclasses.field(default_factory=list)

    def add(self, what: str, *, where: str, count: int, unit: str) -> None:
        """Count one loss."""
        self.losses.append(Loss(what, where, count, unit))

    def __bool__(self) -> bool:
        return bool(self.losses)

    @property
    def exit_code(self) -> ExitCode:
        """3 where anything was lost, else 0."""
        return ExitCode.LOSS if self.losses else ExitCode.OK
