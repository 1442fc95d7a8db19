"""The study: figures of each run, and what is written of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from replay.batch.lee2010_degradation.figures import RunFigures, rows_of
from replay.batch.lee2010_degradation.members import members
from replay.batch.lee2010_degradation.report import report_html
from replay.batch.lee2010_degradation.tables import table_of, to_json, to_markdown
from replay.batch.study import Done, Measured, Options, Study, Variant
from replay.batch.workers import Workers
from replay.evaluate.network_run import NetworkRun, network_figures, read_network_run
from replay.view.fields import doubles
from replay.view.files import write_page

NAME: Final = "lee2010-degradation"
_KM: Final = 1e-3


def measure(log: Path, variant: Variant) -> Measured:
    """Figures of one run."""
    run = read_network_run(log)
    return Measured(RunFigures(distance_km=_distance_km(run), network=network_figures(run)))


def _distance_km(run: NetworkRun) -> float:
    path = doubles(run.data.truth, "position_ecef_m")
    away = np.linalg.norm(path - run.stations[run.master], axis=1)
    return float(np.mean(away)) * _KM


def present(done: Sequence[Done], options: Options, workers: Workers) -> Mapping[str, Path]:
    """Write the table and the report."""
    rows = rows_of(done)
    files = {
        "tables": options.folder / "tables.json",
        "table": options.folder / "table.md",
        "report": options.folder / "report.html",
    }
    files["tables"].write_bytes(to_json(rows, done, NAME))
    files["table"].write_text(to_markdown(table_of(rows)), encoding="utf-8")
    write_page(files["report"], report_html(rows, done, command=_command(options)))
    return files


def _command(options: Options) -> str:
    words = ["replay", "study", NAME, "-o", "DIR", "--seeds", str(options.seeds)]
    if options.labels:
        words += ["--cases", ",".join(options.labels)]
    return " ".join(words)


STUDY: Final = Study(
    NAME,
    "The network of Lee (2010), case 1: fewer stations, longer baselines, rougher skies",
    members,
    measure,
    present,
)
