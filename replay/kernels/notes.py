"""Events of an epoch: records of NOTE_DTYPE (:mod:`replay.kernels.sights`)."""

from numba import njit

from replay.kernels.types import Array, Record


@njit(cache=True)
def append_note(
    notes: Array, counts: Array, place: int, t: int, log_t: int, kind: int, sat: int, value: float
) -> None:
    """Append one event; ``counts[place]`` is the number of events."""
    row = notes[counts[place]]
    counts[place] += 1
    row["t"] = t
    row["log_t"] = log_t
    row["kind"] = kind
    row["satellite"] = sat
    row["value"] = value


@njit(cache=True)
def note_epoch(
    notes: Array, counts: Array, place: int, epoch: Record, kind: int, sat: int, value: float
) -> None:
    """Append one event of an epoch at the receiver's own time."""
    append_note(notes, counts, place, epoch["t"], epoch["log_t"], kind, sat, value)
