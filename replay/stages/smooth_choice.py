"""Which run of a log is smoothed, and why others cannot be."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Final

from replay import channels
from replay.errors import MissingChannelError
from replay.stages.smooth_config import SmoothConfig

_NETWORK: Final = "NETWORK_"
"""Channels of stations, which bear no run's name."""


def find_run(config: SmoothConfig, topics: Collection[str], reasons: Mapping[str, str]) -> str:
    """The run to smooth.

    Parameters
    ----------
    config : SmoothConfig
    topics : collection of str
        Of the log.
    reasons : mapping
        By pipeline, why its runs can never be smoothed.

    Raises
    ------
    MissingChannelError
        Where the log has no run that was recorded for smoothing, or not the one asked for.
    """
    spec = channels.FILTER_TRANSITION
    runs = sorted(spec.parts(topic)["run"] for topic in topics if spec.matches(topic))
    wanted = config.smooth.run
    if wanted in runs:
        return wanted
    if not wanted and len(runs) == 1:
        return runs[0]
    others = sorted(_runs(topics) - set(runs))
    if runs:
        why = f", not {wanted}" if wanted else ""
        if wanted in others:
            why += f": {_reason(wanted, reasons)}"
        raise MissingChannelError(
            f"the log has {', '.join(runs)} to smooth{why}",
            mend=f"choose one: --set smooth.run={runs[0]}",
        )
    asked = [wanted] if wanted in others else others
    known = "; ".join(f"{name}: {_reason(name, reasons)}" for name in asked)
    hopeful = not asked or any(name not in reasons for name in asked)
    raise MissingChannelError(
        f"the log has no run that can be smoothed: no channel {spec.topic}",
        where=known or f"it has no run at all, but {', '.join(sorted(topics)) or 'nothing'}",
        mend="run the filter again with --set smoothing.record=true, and smooth what it writes"
        if hopeful
        else "smooth the run of a filter: `replay pipelines` lists them",
    )


def _runs(topics: Collection[str]) -> set[str]:
    """All runs that a log has rows of."""
    found: set[str] = set()
    for topic in topics:
        spec = channels.find(topic)
        if spec is None:
            continue
        found.update(value for key, value in spec.parts(topic).items() if key == "run")
        if spec.name.startswith(_NETWORK):
            found.add("network")
    return found


def _reason(name: str, reasons: Mapping[str, str]) -> str:
    if name in reasons:
        return reasons[name]
    if name.endswith("-smoothed"):
        return "it is smoothed already"
    return "it was made without smoothing.record"
