"""Which stage, at which step, first made two runs part: read off the traces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from replay.diff.match import ABSENT, align, key_codes
from replay.diff.names import value_text
from replay.diff.result import Culprit, CulpritKind, Place, Side
from replay.log.columns import Columns
from replay.time import to_text

Int64 = npt.NDArray[np.int64]


def trace_culprit(
    a: Columns,
    b: Columns,
    outputs: Mapping[str, Sequence[str]],
    inputs: Mapping[str, Sequence[str]],
) -> Culprit | None:
    """Find the stage and step at which two traces part; None where they are equal.

    Rows of one time stand in the order of the stages' depth. So at the first row
    that differs either the stage had equal input and is itself the culprit, or
    nothing before it differs and the input channels do.

    Parameters
    ----------
    a, b : Columns
        Rows of the trace channels, in the order of the log.
    outputs, inputs : mapping of stage name to topics
        From the manifests; may be empty.
    """
    # A step is known by its count of triggers: its time may be what differs.
    steps_a, steps_b = (np.asarray(columns["step"]).astype(np.int64) for columns in (a, b))
    alignment = align(steps_a, steps_b, *key_codes(("stage",), a, b))
    rows_a, rows_b = alignment.a, alignment.b
    both = alignment.matched
    input_differs, output_differs = (
        _differs(a, b, name, rows_a, rows_b, both) for name in ("input_digest", "output_digest")
    )
    parted = np.flatnonzero(input_differs | output_differs | ~both)
    if not len(parted):
        return None
    in_a = rows_a[parted] != ABSENT
    row = np.where(in_a, rows_a[parted], rows_b[parted])
    time = np.empty(len(parted), dtype=np.int64)
    time[in_a] = a.log_time_ns[row[in_a]]
    time[~in_a] = b.log_time_ns[row[~in_a]]
    first = int(np.lexsort((row, time))[0])
    slot = int(parted[first])
    columns, side = (a, Side.A) if in_a[first] else (b, Side.B)
    if not both[slot]:
        kind = CulpritKind.MISSING_STEP
    else:
        kind = CulpritKind.INPUT if input_differs[slot] else CulpritKind.OUTPUT
        side = Side.BOTH
    index = int(row[first])
    stage = value_text(columns.values["stage"], index)
    time_ns = int(columns.valid_time_ns[index])
    topics = inputs if kind is CulpritKind.INPUT else outputs
    return Culprit(
        kind=kind,
        stage=stage,
        step=int(columns["step"][index]),
        at=Place(time_ns=time_ns, time=to_text(time_ns), key={"stage": stage}),
        channels=list(topics.get(stage, ())),
        side=side,
    )


def _differs(
    a: Columns,
    b: Columns,
    name: str,
    rows_a: Int64,
    rows_b: Int64,
    both: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bool_]:
    differs = np.zeros(len(both), dtype=np.bool_)
    differs[both] = a[name][rows_a[both]] != b[name][rows_b[both]]
    return differs
