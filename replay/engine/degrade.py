"""Outages alone: the transform that is wanted most often, with the runs in a log kept."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from replay.engine.transforms import (
    DEGRADE,
    Outage,
    Transform,
    plan_outages,
    transform_log,
)

__all__ = ["DEGRADE", "Outage", "plan_outages", "remove_fixes"]


def remove_fixes(source: Path, target: Path, outages: Sequence[Outage]) -> dict[str, int]:
    """Write a log without the GNSS rows of some stretches of time.

    Parameters
    ----------
    source, target : Path
    outages : sequence of Outage
        Valid times within any of them are left out of fixes and observations of the
        receiver that is replayed; where satellites are kept, their observations stay.

    Returns
    -------
    dict of topic to int
        Rows left out.

    Raises
    ------
    UsageError
        Where an outage takes nothing away, or both paths are the same.
    """
    done = transform_log(
        source, target, Transform(), outages=tuple(outages), keep_results=True, command="degrade"
    )
    return done.removed
