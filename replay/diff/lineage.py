"""Runs over runs: whether one log was made from the other, as a smoothed run from its filter's."""

from __future__ import annotations

import dataclasses

from replay.channels import FILTER_STATE, SOLUTION
from replay.schemas.replay_pb2 import Manifest


@dataclasses.dataclass(frozen=True, slots=True)
class Lineage:
    """A run and the one that was made over its log.

    Attributes
    ----------
    earlier, later : str
        Their names.
    later_is_a : bool
        Whether the later one is A.
    passed : frozenset of str
        Topics that the earlier run made and that the later log holds as they were.
    """

    earlier: str
    later: str
    later_is_a: bool
    passed: frozenset[str]

    @property
    def run_names(self) -> dict[str, str]:
        """Run name of A to that of B."""
        names = (self.later, self.earlier) if self.later_is_a else (self.earlier, self.later)
        return dict([names])

    @property
    def text(self) -> str:
        """In words."""
        which = ("A", "B") if self.later_is_a else ("B", "A")
        return f"{which[0]} was made over {which[1]}: {self.later} beside {self.earlier}"


def lineage(a: Manifest | None, b: Manifest | None) -> Lineage | None:
    """How the run of one log was made over the other's; None where it was not.

    The inputs of the later run must be those of the earlier one and what that one made, by
    their digests.
    """
    if a is None or b is None:
        return None
    for earlier, later, later_is_a in ((a, b, False), (b, a, True)):
        held = {d.topic: d.sha256 for d in (*earlier.inputs, *earlier.outputs)}
        taken = {d.topic: d.sha256 for d in later.inputs}
        made = {d.topic for d in earlier.outputs}
        passed = frozenset(made & taken.keys())
        whole = {d.topic for d in earlier.inputs} <= taken.keys()
        names = _name(earlier), _name(later)
        if passed and whole and all(names) and all(held.get(t) == d for t, d in taken.items()):
            return Lineage(*names, later_is_a, passed)
    return None


def _name(manifest: Manifest) -> str:
    """Name of the run that a manifest is of."""
    for spec in (SOLUTION, FILTER_STATE):
        for digest in manifest.outputs:
            if spec.matches(digest.topic):
                return spec.parts(digest.topic)["run"]
    return ""
