"""Settings of what a filter writes for a smoother."""

from __future__ import annotations

from replay.configuration import Section


class Smoothing(Section, frozen=True):
    """Whether the filter writes how it came from node to node (`replay run smooth` reads it).

    A node is a moment with an update or a solution: `output.solution_interval` says how many
    there are between the updates.
    """

    record: bool = False
