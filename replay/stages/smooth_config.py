"""Settings of smoothing."""

from __future__ import annotations

from typing import Literal

from replay.configuration import Section


class Smooth(Section, frozen=True):
    """What is smoothed."""

    # A run that was made with `smoothing.record`; empty for the only one that the log has.
    run: str = ""
    # Rauch-Tung-Striebel, or forward and backward filters combined: the same to rounding, with
    # more work; there to compare with.
    method: Literal["rts", "combination"] = "rts"


class SmoothConfig(Section, frozen=True):
    """Settings of `smooth`; an empty name stands for that of the run and `-smoothed`."""

    name: str = ""
    smooth: Smooth = Smooth()
