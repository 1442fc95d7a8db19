"""What a comparison found: plain structs that become JSON, tables and pictures.

Nothing here holds rows, so a result of two long runs stays small. Every number
that may be not finite is `None` then, because JSON has no other word for it.
Differences are A - B.
"""

from __future__ import annotations

import enum
import math
from typing import Final

import msgspec

from replay.errors import ExitCode

FORMAT_VERSION: Final = 1


class Verdict(enum.StrEnum):
    """The answer in one word, in the order of severity."""

    IDENTICAL = "IDENTICAL"
    WITHIN_TOLERANCE = "WITHIN_TOLERANCE"
    CHANGED = "CHANGED"
    INCOMPARABLE = "INCOMPARABLE"

    @property
    def severity(self) -> int:
        """Zero for identical, rising."""
        return list(Verdict).index(self)

    @property
    def exit_code(self) -> ExitCode:
        """What the command line answers."""
        return _EXIT_CODES[self]


_EXIT_CODES: Final = {
    Verdict.IDENTICAL: ExitCode.OK,
    Verdict.WITHIN_TOLERANCE: ExitCode.OK,
    Verdict.CHANGED: ExitCode.FAILURE,
    Verdict.INCOMPARABLE: ExitCode.LOSS,
}


class ChannelStatus(enum.StrEnum):
    """What became of one channel."""

    IDENTICAL = "identical"
    WITHIN_TOLERANCE = "within_tolerance"
    CHANGED = "changed"
    MISSING = "missing"  # in A only
    EXTRA = "extra"  # in B only
    SCHEMA = "schema"  # two messages that cannot be subtracted

    @property
    def verdict(self) -> Verdict:
        """What the channel means for the whole."""
        match self:
            case ChannelStatus.IDENTICAL:
                return Verdict.IDENTICAL
            case ChannelStatus.WITHIN_TOLERANCE:
                return Verdict.WITHIN_TOLERANCE
            case ChannelStatus.SCHEMA:
                return Verdict.INCOMPARABLE
            case _:
                return Verdict.CHANGED


class RowKind(enum.StrEnum):
    """How two rows of one time and key stand to each other."""

    EQUAL = "equal"
    WITHIN = "within"  # other bits, inside the tolerance
    VALUE = "value"  # beyond the tolerance, or in one run only absent
    NAN = "nan"  # not a number in one run only
    MISSING = "missing"  # row in A only
    EXTRA = "extra"  # row in B only
    EVENT = "event"  # of an event channel: in one run only, or other content


class Side(enum.StrEnum):
    """In which run a row stands."""

    A = "a"
    B = "b"
    BOTH = "both"


class CulpritKind(enum.StrEnum):
    """What the trace shows at its first difference."""

    OUTPUT = "output"  # a stage gave other output from equal input
    INPUT = "input"  # what a stage was given differs and no stage before it did
    MISSING_STEP = "missing_step"  # a step that one run did not take


class Place(msgspec.Struct, frozen=True, kw_only=True):
    """A row: its valid time (GPS ns, and the same as text) and its key fields."""

    time_ns: int
    time: str
    key: dict[str, str] = {}


class ComponentDiff(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of A - B of one component.

    `max` is the greatest absolute difference, at `at`, where the values were
    `a` and `b`; `mean`, `rms` are over the rows where both are finite.
    """

    name: str
    unit: str
    differing: int
    mean: float | None
    rms: float | None
    max: float | None
    at: Place | None = None
    a: str = ""
    b: str = ""


class FieldDiff(msgspec.Struct, frozen=True, kw_only=True):
    """One field that differs somewhere.

    `compared` rows were matched; of these `within`, `value`, `nan` differ, and
    `presence` of the `value` ones because one run lacks the field. `components`
    holds those that differ, `omitted_components` counts what was left off.
    """

    field: str
    unit: str
    rule: str
    tolerance: float | None
    compared: int
    within: int
    value: int
    nan: int
    presence: int
    components: list[ComponentDiff]
    omitted_components: int = 0
    indefinite_a: int = 0
    indefinite_b: int = 0

    @property
    def worst(self) -> ComponentDiff | None:
        """The component of the greatest difference; one that is not finite is greater."""
        return max(
            self.components, key=lambda c: math.inf if c.max is None else c.max, default=None
        )


class SigmaDiff(msgspec.Struct, frozen=True, kw_only=True):
    """Square root of dx' P^-1 dx with A's covariance over `states`, in sigmas."""

    field: str
    states: list[str]
    rows: int
    rms: float | None
    max: float | None
    at: Place | None


class RowCounts(msgspec.Struct, frozen=True, kw_only=True):
    """Rows by kind."""

    equal: int = 0
    within: int = 0
    value: int = 0
    nan: int = 0
    missing: int = 0
    extra: int = 0
    event: int = 0

    @property
    def differing(self) -> int:
        """Rows that are not equal bit for bit."""
        return self.within + self.beyond

    @property
    def beyond(self) -> int:
        """Rows that a person has to look at."""
        return self.value + self.nan + self.missing + self.extra + self.event


class ContextRow(msgspec.Struct, frozen=True, kw_only=True):
    """A row near the first difference; `a` or `b` is empty where the row is not."""

    at: Place
    kind: RowKind
    a: str
    b: str
    difference: float | None
    here: bool = False


class Divergence(msgspec.Struct, frozen=True, kw_only=True):
    """The first row that differs, and the rows around it.

    `field` and `component` are empty for a row that stands in one run only.
    """

    topic: str
    at: Place
    log_time_ns: int
    kind: RowKind
    side: Side
    field: str = ""
    component: str = ""
    a: str = ""
    b: str = ""
    difference: float | None = None
    tolerance: float | None = None
    unit: str = ""
    around: list[ContextRow] = []


class ChannelDiff(msgspec.Struct, frozen=True, kw_only=True):
    """One channel. `topic_b` differs from `topic` where run names were mapped.

    `first_difference` is the first row with other bits, `first_change` the
    first one beyond tolerance. `local` is the difference of positions in
    metres east, north and up of A.
    """

    topic: str
    topic_b: str
    message: str
    status: ChannelStatus
    rows_a: int
    rows_b: int
    rows: RowCounts
    reordered: int = 0
    fields: list[FieldDiff] = []
    fields_missing: list[str] = []
    fields_extra: list[str] = []
    local: list[ComponentDiff] = []
    sigmas: list[SigmaDiff] = []
    first_difference: Divergence | None = None
    first_change: Divergence | None = None
    notes: list[str] = []


class Culprit(msgspec.Struct, frozen=True, kw_only=True):
    """Where the traces part. `channels` are the topics that the stage wrote or read."""

    kind: CulpritKind
    stage: str
    step: int
    at: Place
    channels: list[str]
    side: Side = Side.BOTH


class SettingChange(msgspec.Struct, frozen=True, kw_only=True):
    """A configuration key, version or digest that differs; `None` where it is absent."""

    key: str
    a: str | None
    b: str | None


class RunInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One of the two runs."""

    path: str
    channels: int
    rows: int
    manifest: bool
    command: str = ""
    pipeline: str = ""
    package_version: str = ""


class DiffResult(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that a comparison found. `to_json` gives these names as keys."""

    verdict: Verdict
    exit_code: int
    reasons: list[str]
    a: RunInfo
    b: RunInfo
    channels: list[ChannelDiff]
    format_version: int = FORMAT_VERSION
    run_names: dict[str, str] = {}
    first_difference: Divergence | None = None
    first_change: Divergence | None = None
    culprit: Culprit | None = None
    configuration: list[SettingChange] = []
    versions: list[SettingChange] = []
    inputs: list[SettingChange] = []

    def channel(self, topic: str) -> ChannelDiff:
        """Find the channel of a topic of A (or of B where A has none)."""
        return next(channel for channel in self.channels if channel.topic == topic)


def to_json(result: DiffResult) -> bytes:
    """Indented JSON; the keys are the attributes of the structs of this module."""
    return msgspec.json.format(msgspec.json.encode(result), indent=2) + b"\n"


def from_json(text: bytes) -> DiffResult:
    """Read what :func:`to_json` wrote."""
    return msgspec.json.decode(text, type=DiffResult)


def finite(value: float) -> float | None:
    """Pass a number on, or None where it is not finite."""
    return float(value) if math.isfinite(value) else None
