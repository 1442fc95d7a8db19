"""The study as one command: its runs as a sweep, and what is written of their rows."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from replay.batch.kan2022.figures import figures_of, shown
from replay.batch.kan2022.plan import PLAN, Plan, plan_cases
from replay.batch.kan2022.recording import write_study_recording
from replay.batch.kan2022.report import report_html
from replay.batch.kan2022.runs import load_runs
from replay.batch.kan2022.tables import to_json
from replay.batch.study import Options
from replay.batch.sweep.file import Case
from replay.batch.sweep_study import SweepStudy, rows_folder
from replay.batch.workers import Workers
from replay.view.files import write_page

NAME: Final = "kan2022"


def present(
    plan: Plan, cases: Sequence[Case], options: Options, workers: Workers
) -> Mapping[str, Path]:
    """Write tables, report and recording; a recording only where a run went well."""
    runs = load_runs(cases, rows_folder(options))
    found = shown(runs)
    figures = figures_of(found) if found is not None else []
    files = {
        "tables": options.folder / "tables.json",
        "report": options.folder / "report.html",
    }
    files["tables"].write_bytes(to_json(runs, NAME))
    text = report_html(runs, found, figures, plan, command=_command(options), workers=workers)
    write_page(files["report"], text)
    if found is not None:
        files["recording"] = options.folder / "recording.rrd"
        write_study_recording(runs, found, figures, files["recording"])
    return files


def _command(options: Options) -> str:
    words = ["replay", "study", NAME, "-o", "DIR", "--seeds", str(options.seeds)]
    if options.labels:
        words += ["--cases", ",".join(options.labels)]
    return " ".join(words)


def study_of(plan: Plan) -> SweepStudy:
    """The study of a plan."""
    return SweepStudy(
        NAME,
        "Kan (2022): PPP/INS with inertial samples at four rates, and outages, simulated",
        functools.partial(plan_cases, plan),
        functools.partial(present, plan),
    )


STUDY: Final = study_of(PLAN)
