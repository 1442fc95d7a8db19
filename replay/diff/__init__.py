"""Run against run: which channel, row, field, stage and step first differ, and by how much.

`diff_logs` compares two logs; `render_terminal`, `render_markdown` and `to_json`
show the result. `replay.diff.recording.write_rrd` draws it and is not imported
here, because Rerun takes a second to load.
"""

from replay.diff.compare import DiffOptions, diff_columns, diff_logs, diff_runs
from replay.diff.render_markdown import render_markdown
from replay.diff.render_terminal import render_terminal
from replay.diff.result import DiffResult, Verdict, from_json, to_json

__all__ = [
    "DiffOptions",
    "DiffResult",
    "Verdict",
    "diff_columns",
    "diff_logs",
    "diff_runs",
    "from_json",
    "render_markdown",
    "render_terminal",
    "to_json",
]
