"""Settings of smoothing."""

from __future__ import annotations

from replay.configuration import Section


class Smooth(Section, frozen=True):
    """What is smoothed."""

    # A run that was made with `smoothing.record`; empty for the only one that the log has.
    run: str = ""


class SmoothConfig(Section, frozen=True):
    """Settings of `smooth`; an empty name stands for that of the run and `-smoothed`."""

    name: str = ""
    smooth: Smooth = Smooth()
