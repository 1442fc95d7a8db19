"""Findings as sentences and table cells, the same in the terminal, Markdown and Rerun."""

from __future__ import annotations

from collections.abc import Iterator

from replay.diff.result import (
    ChannelDiff,
    ChannelStatus,
    Culprit,
    CulpritKind,
    DiffResult,
    Divergence,
    FieldDiff,
    Place,
    RowKind,
    Side,
)

_MICRO_TO_UNIT = ((1.0, ""), (1e-2, "c"), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))

FIELD_HEADER = (
    "channel",
    "field",
    "beyond",
    "within",
    "max |A-B|",
    "rms",
    "mean",
    "tolerance",
    "worst at",
)
CHANNEL_HEADER = (
    "channel",
    "status",
    "rows A",
    "rows B",
    "equal",
    "within",
    "value",
    "NaN",
    "missing",
    "extra",
    "event",
)


def number(value: float | None, unit: str = "") -> str:
    """Three significant digits and the unit; metres below one in cm, mm, µm, nm."""
    if value is None:
        return "not finite"
    if unit == "m" and 0.0 < abs(value) < 1.0:
        for scale, prefix in _MICRO_TO_UNIT[1:]:
            if abs(value) >= scale:
                return f"{value / scale:.3g} {prefix}m"
    return f"{value:.3g} {unit}".rstrip() if unit != "1" else f"{value:.3g}"


def place(at: Place | None) -> str:
    """Time and key of a row."""
    if at is None:
        return ""
    return " ".join([at.time, *at.key.values()])


def clock(at: Place | None) -> str:
    """Time of day and key, for tables: the sentences above them tell the date."""
    if at is None:
        return ""
    return " ".join([at.time.partition("T")[2], *at.key.values()])


def topic(channel: ChannelDiff) -> str:
    """Topic of a channel, both where they differ."""
    if channel.topic == channel.topic_b:
        return channel.topic
    return f"{channel.topic} ↔ {channel.topic_b}"


def verdict_line(result: DiffResult) -> str:
    """One sentence."""
    return f"{result.verdict.value}: {'; '.join(result.reasons)}"


def culprit(found: Culprit) -> str:
    """Which stage, and why it is named."""
    where = f"stage {found.stage!r} at step {found.step} ({found.at.time})"
    channels = ", ".join(found.channels)
    match found.kind:
        case CulpritKind.OUTPUT:
            gave = f", which writes {channels}" if channels else ""
            return f"Culprit: {where}: equal input, other output{gave}"
        case CulpritKind.INPUT:
            read = f": {channels}" if channels else ""
            return f"Culprit: the input{read}. It differs first where {where} reads it"
        case CulpritKind.MISSING_STEP:
            other = "B" if found.side is Side.A else "A"
            return f"Culprit: {where} ran in {found.side.value.upper()} but not in {other}"


def divergence(found: Divergence, words: str) -> str:
    """Where the first difference is and what it is; `words` begins the sentence."""
    where = f"{words}: {found.topic} at {place(found.at)}"
    if found.side is not Side.BOTH:
        run = "A" if found.side is Side.A else "B"
        what = "event" if found.kind is RowKind.EVENT else "row"
        return f"{where}: a {what} that only {run} has"
    field = component(found.field, found.component)
    if not found.a and not found.b:
        return f"{where}: {field} is {number(found.difference, found.unit)}"
    values = f"A {found.a}, B {found.b}"
    if found.difference is None:
        return f"{where}: {field}: {values}"
    return f"{where}: {field}: {values}, A-B {number(found.difference, found.unit)}"


def component(field: str, name: str) -> str:
    """Field with the name of its component."""
    if not name:
        return field
    return field + name if name.startswith("[") else f"{field}.{name}"


def headlines(result: DiffResult) -> list[str]:
    """Say what a person must know, in sentences, the verdict first."""
    lines = [verdict_line(result)]
    if result.culprit is not None:
        lines.append(culprit(result.culprit))
    change, difference = result.first_change, result.first_difference
    if change is not None:
        lines.append(divergence(change, "First beyond tolerance"))
    if difference is not None and (
        change is None or difference.at != change.at or difference.topic != change.topic
    ):
        lines.append(divergence(difference, "First other bits"))
    for old, new in result.run_names.items():
        lines.append(f"Run {old!r} of A is compared with run {new!r} of B")
    return lines


def channel_row(channel: ChannelDiff) -> tuple[str, ...]:
    """Cells under :data:`CHANNEL_HEADER`; zeros are left blank."""
    rows = channel.rows
    counts = (rows.equal, rows.within, rows.value, rows.nan, rows.missing, rows.extra, rows.event)
    return (
        topic(channel),
        channel.status.value.replace("_", " "),
        str(channel.rows_a),
        str(channel.rows_b),
        *(str(count) if count else "" for count in counts),
    )


def field_rows(channel: ChannelDiff) -> Iterator[tuple[str, ...]]:
    """Cells under :data:`FIELD_HEADER`: a row per field, then positions in ENU, then sigmas."""
    for field in channel.fields:
        worst = field.worst
        if worst is None:
            continue
        yield (
            channel.topic,
            worst.name + _remarks(field),
            str(field.value + field.nan) if field.value + field.nan else "",
            str(field.within) if field.within else "",
            number(worst.max, worst.unit),
            number(worst.rms, worst.unit),
            number(worst.mean, worst.unit),
            "any" if field.tolerance is None else number(field.tolerance, field.unit),
            clock(worst.at),
        )
    for part in channel.local:
        yield (
            channel.topic,
            f"  position {part.name}",
            "",
            "",
            number(part.max, part.unit),
            number(part.rms, part.unit),
            number(part.mean, part.unit),
            "",
            clock(part.at),
        )
    for sigma in channel.sigmas:
        yield (
            channel.topic,
            "  " + _state_groups(sigma.states),
            "",
            "",
            f"{number(sigma.max)} sigma",
            f"{number(sigma.rms)} sigma",
            "",
            "",
            clock(sigma.at),
        )


def _state_groups(states: list[str]) -> str:
    """Names of error states without their axes."""
    return " + ".join(dict.fromkeys(state.rpartition("_")[0] for state in states))


def _remarks(field: FieldDiff) -> str:
    remarks = []
    if field.nan:
        remarks.append(f"{field.nan} NaN")
    if field.presence:
        remarks.append(f"{field.presence} absent in one")
    if field.indefinite_a or field.indefinite_b:
        remarks.append(f"not positive definite: A {field.indefinite_a}, B {field.indefinite_b}")
    return f" ({', '.join(remarks)})" if remarks else ""


def differing(result: DiffResult) -> list[ChannelDiff]:
    """Channels that are worth a table."""
    return [c for c in result.channels if c.status is not ChannelStatus.IDENTICAL]
