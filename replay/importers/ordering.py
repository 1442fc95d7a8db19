"""Rows in the order of time: joined tables, time that goes backward, times that repeat.

* Time that goes backward: a log is ordered by time, so the rows are put in order,
  equal times staying in the order of the file; the rows that came late are counted.
* Repeated times: both rows stay in the log, because both were recorded; they are
  counted, because a filter can use one of them only.
* Rows of a joined file are those of the very same nanosecond; a row without a
  partner keeps its place with the joined columns empty.
"""

from __future__ import annotations

import numpy as np

from replay.errors import ConfigurationError
from replay.importers.findings import Findings
from replay.importers.table import Int64, Mask, Table


def order_rows(times_ns: Int64, lines: Int64, file: str, topic: str, findings: Findings) -> Int64:
    """Row numbers in the order of time.

    Parameters
    ----------
    times_ns, lines : int64 array (n,)
    file, topic : str
        For messages.
    findings : Findings
        Rows that came late or repeat a time are counted here.

    Returns
    -------
    int64 array (n,)
    """
    latest = np.maximum.accumulate(times_ns) if len(times_ns) else times_ns
    late = times_ns < latest
    if late.any():
        jump = float((latest - times_ns).max()) * 1e-9
        findings.rows(
            f"{topic}: time goes backward, by up to {jump:.6g} s; rows were put in order",
            file,
            lines[late],
            "a counter that started anew needs a file for each start",
        )
    order = np.argsort(times_ns, kind="stable").astype(np.int64)
    repeated = np.flatnonzero(np.diff(times_ns[order]) == 0) + 1
    findings.rows(
        f"{topic}: a time occurs twice; both rows are kept, a filter can use one",
        file,
        np.sort(lines[order[repeated]]),
        "remove one of the rows, or mend the times",
    )
    return order


def join_tables(
    left: Table, left_ns: Int64, right: Table, right_ns: Int64, right_good: Mask, shared: set[str]
) -> tuple[Table, Mask]:
    """Columns of `right` beside those of `left`, where times are equal.

    Parameters
    ----------
    left, right : Table
    left_ns, right_ns : int64 array, ns
    right_good : bool array
        Rows of `right` that have a time.
    shared : set of str
        Columns of the time, which both have.

    Returns
    -------
    Table
        Rows of `left`.
    bool array (n,)
        Rows that found a partner.

    Raises
    ------
    ConfigurationError
        Where both files have a column of one name.
    """
    clash = (left.numbers.keys() & right.numbers.keys()) - shared
    if clash:
        raise ConfigurationError(
            f"both {left.file.name} and {right.file.name} have a column {min(clash)!r}",
            mend="name the columns of one of them in its source",
        )
    rows = np.flatnonzero(right_good)
    rows = rows[np.argsort(right_ns[rows], kind="stable")]
    times = right_ns[rows]
    at = np.searchsorted(times, left_ns)
    inside = at < len(times)
    found = inside.copy()
    found[inside] = times[at[inside]] == left_ns[inside]
    numbers = dict(left.numbers)
    for name, column in right.numbers.items():
        if name not in shared:
            joined = np.full(len(left), np.nan)
            joined[found] = column[rows[at[found]]]
            numbers[name] = joined
    return Table(left.file, numbers, left.texts, left.lines, left.time_scale), found
