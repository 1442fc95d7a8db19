"""Words that more than one module of the log spells."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Final

from replay import time

_LAST_NS: Final = 1 << 62  # the year 2126; a damaged time is as likely beyond as not

# Key of a channel's metadata that holds the depth of the stage that made it.
DEPTH_KEY: Final = "replay.depth"


def nearest(name: str, known: Iterable[str]) -> str:
    """`; the nearest is …`, or nothing where there is nothing to choose from."""
    found = difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.0)
    return f"; the nearest is {found[0]}" if found else ""


def moment(ns: int) -> str:
    """A time for a person, even one that is damaged and no date."""
    return time.to_text(ns) if 0 < ns < _LAST_NS else f"{ns} ns"
