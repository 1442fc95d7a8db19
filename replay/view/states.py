"""Lanes of states along time: fix quality of each receiver, status of each solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
import rerun as rr

from replay.log.columns import Columns
from replay.view import labels
from replay.view.fields import integers
from replay.view.gather import RunData
from replay.view.palette import Ink
from replay.view.sink import Sink, Times, rgba

Words = npt.NDArray[np.str_]


def draw_states(sink: Sink, data: RunData) -> list[str]:
    """Send the lanes; a row per change of state, not per fix.

    Returns
    -------
    list of str
        Entities of the lanes.
    """
    paths: list[str] = []
    for receiver, fix in data.fixes.items():
        times, words = _in_words(fix, "quality", labels.quality)
        times, words = _with_outages(times, words, data)
        paths.append(_lane(sink, f"state/gnss/{receiver}", times, words, labels.QUALITY_INKS))
    for run in data.runs:
        if run.solution is not None:
            times, words = _in_words(run.solution, "status", labels.status)
            paths.append(_lane(sink, f"state/run/{run.name}", times, words, labels.STATUS_INKS))
    return paths


def _in_words(columns: Columns, field: str, word: Callable[[int], str]) -> tuple[Times, Words]:
    numbers = integers(columns, field)
    names = {int(number): word(int(number)) for number in np.unique(numbers)}
    return columns.valid_time_ns, np.asarray([names[n] for n in numbers.tolist()], dtype=np.str_)


def _with_outages(times: Times, words: Words, data: RunData) -> tuple[Times, Words]:
    """`no fix` from the last fix before each outage on; the next fix ends it."""
    starts: list[int] = []
    for outage in data.outages:
        before = int(np.searchsorted(times, outage.start_ns, side="right"))
        inside = times[before:][times[before:] < outage.end_ns]
        if len(inside) == 0:
            starts.append(outage.start_ns + 1)  # after the fix that may stand at the very start
    all_times = np.concatenate([times, np.asarray(starts, dtype=np.int64)])
    all_words = np.concatenate([words, np.full(len(starts), "no fix")])
    order = np.argsort(all_times, kind="stable")
    return all_times[order], all_words[order]


def _lane(sink: Sink, path: str, times: Times, words: Words, inks: Mapping[str, Ink]) -> str:
    change = np.concatenate([[True], words[1:] != words[:-1]])
    kept, states = times[change], words[change].tolist()
    sink.columns(path, kept, lambda rows: rr.StateChange.columns(state=states[rows]))
    names = list(dict.fromkeys(states))
    grey = labels.QUALITY_INKS["unknown"]
    colors = rgba(*(inks.get(name, grey).dark for name in names))
    sink.static(path, rr.StateConfiguration(values=names, labels=names, colors=colors))
    return path
