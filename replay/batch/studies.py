"""The studies by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from replay.errors import UsageError

if TYPE_CHECKING:
    from replay.batch.study import Study
    from replay.batch.sweep_study import SweepStudy


def find_study(name: str) -> Study | SweepStudy:
    """Study of a name.

    Raises
    ------
    UsageError
        Where there is none.
    """
    if name not in STUDIES:
        raise UsageError(f"no study {name!r}", mend=f"known: {', '.join(STUDIES)}")
    return STUDIES[name]()


def _lee2010() -> Study:
    from replay.batch.lee2010.run import STUDY

    return STUDY


def _lee2010_degradation() -> Study:
    from replay.batch.lee2010_degradation.run import STUDY

    return STUDY


def _kan2022() -> SweepStudy:
    from replay.batch.kan2022.run import STUDY

    return STUDY


STUDIES: Final[dict[str, Callable[[], Study | SweepStudy]]] = {
    "lee2010": _lee2010,
    "lee2010-degradation": _lee2010_degradation,
    "kan2022": _kan2022,
}
"""Studies by name; each is imported when it is asked for."""
