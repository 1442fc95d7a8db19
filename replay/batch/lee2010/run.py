"""The three cases of Lee (2010): members, figures of each run, and what is written of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from replay.batch.lee2010.figures import CaseRuns, figures_of
from replay.batch.lee2010.picture import picture_of
from replay.batch.lee2010.published import CASES, MODES, TITLES
from replay.batch.lee2010.recording import write_study_recording
from replay.batch.lee2010.report import report_html
from replay.batch.lee2010.tables import Cases, by_case, to_json
from replay.batch.study import Done, Measured, Member, Options, Study, Variant
from replay.batch.workers import Workers
from replay.evaluate.network_run import network_figures, read_network_run
from replay.view.files import write_page

NAME: Final = "lee2010"
_HERE: Final = Path(__file__).parent
# All baselines, though corrections need those of the master alone: triangles must close.
_SETTINGS: Final = {"single": (), "network": ("network.baselines=all",)}
_COST: Final = {"single": 1.0, "network": 2.0}
_VARIANTS: Final = tuple(
    Variant(
        mode,
        "network-ins-tc",
        (f"mode={mode}", f"name={mode}", *_SETTINGS[mode]),
        cost=_COST[mode],
    )
    for mode in MODES
)


def members() -> tuple[Member, ...]:
    """The three cases."""
    return tuple(Member(case, _HERE / f"{case}.toml", (), _VARIANTS) for case in CASES)


def measure(log: Path, variant: Variant) -> Measured:
    """Figures of one run, and what is drawn of it."""
    run = read_network_run(log)
    return Measured(network_figures(run), picture_of(run))


def present(done: Sequence[Done], options: Options, workers: Workers) -> Mapping[str, Path]:
    """Write tables, report and recording."""
    cases: Cases = by_case(done)
    runs = [
        CaseRuns(case, TITLES.get(case, case), members[0].pictures)
        for case, members in cases.items()
    ]
    figures = figures_of(runs)
    files = {
        "tables": options.folder / "tables.json",
        "report": options.folder / "report.html",
        "recording": options.folder / "recording.rrd",
    }
    files["tables"].write_bytes(to_json(cases, NAME))
    text = report_html(cases, runs, figures, command=_command(options), workers=workers)
    write_page(files["report"], text)
    write_study_recording(cases, runs, figures, files["recording"])
    return files


def _command(options: Options) -> str:
    words = ["replay", "study", NAME, "-o", "DIR", "--seeds", str(options.seeds)]
    if options.labels:
        words += ["--cases", ",".join(options.labels)]
    return " ".join(words)


STUDY: Final = Study(
    NAME,
    "Lee (2010): GPS/INS with a network of reference stations, three simulated cases",
    members,
    measure,
    present,
)
