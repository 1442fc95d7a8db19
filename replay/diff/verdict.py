"""From what was found to one word and the reasons for it."""

from __future__ import annotations

from collections.abc import Sequence

from replay.diff.result import ChannelDiff, ChannelStatus, Culprit, Verdict

_ONE_SIDED = (ChannelStatus.MISSING, ChannelStatus.EXTRA)


def judge(
    channels: Sequence[ChannelDiff],
    culprit: Culprit | None,
    *,
    other_inputs: Sequence[str],
    allow_different_inputs: bool,
) -> tuple[Verdict, list[str]]:
    """Verdict and its reasons in plain words.

    Parameters
    ----------
    channels : sequence of ChannelDiff
    culprit : Culprit or None
        Where the traces part.
    other_inputs : sequence of str
        Input channels whose recorded digests differ.
    allow_different_inputs : bool
        Whether that is what the user wants to compare.
    """
    reasons = _incomparable(channels)
    if other_inputs and not allow_different_inputs:
        reasons.append(
            f"the runs are not over the same log: {', '.join(other_inputs)} differ "
            "(--allow-different-inputs compares them all the same)"
        )
    if reasons:
        return Verdict.INCOMPARABLE, reasons
    verdict = max((c.status.verdict for c in channels), key=lambda v: v.severity)
    if verdict is Verdict.IDENTICAL and culprit is not None:
        return Verdict.CHANGED, ["the traces part, though no recorded channel differs"]
    return verdict, _counts(channels)


def _incomparable(channels: Sequence[ChannelDiff]) -> list[str]:
    if all(channel.status in _ONE_SIDED for channel in channels):
        return ["no channel is in both logs"]
    return [
        f"{channel.topic}: {note}"
        for channel in channels
        if channel.status is ChannelStatus.SCHEMA
        for note in channel.notes
    ]


def _counts(channels: Sequence[ChannelDiff]) -> list[str]:
    phrases = {
        ChannelStatus.CHANGED: "beyond tolerance in",
        ChannelStatus.MISSING: "missing from B:",
        ChannelStatus.EXTRA: "in B only:",
        ChannelStatus.WITHIN_TOLERANCE: "other bits within tolerance in",
    }
    reasons = []
    for status, phrase in phrases.items():
        topics = [channel.topic for channel in channels if channel.status is status]
        if topics:
            reasons.append(f"{phrase} {', '.join(topics)}")
    return reasons or [f"{len(channels)} channels are equal bit for bit"]
