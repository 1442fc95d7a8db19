"""Each command on a small log: what it prints, what it writes, how it ends."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay import time
from replay.cli import main
from replay.cli.app import err, out
from replay.configuration import describe
from replay.engine.moments import parse_outage, parse_time
from replay.errors import UsageError
from replay.log.reader import LogReader
from replay.stages.loose_config import LooseConfig
from tests.engine.drives import (
    FIX,
    IMU,
    OUTPUTS,
    PIPELINE,
    SECOND,
    SOLUTION,
    TRUTH,
    changed,
    rewrite,
    run_to_file,
)

ROOT = Path(__file__).parents[2]
START = 1_432_814_400 * SECOND


@dataclasses.dataclass
class Answer:
    """How a command ended."""

    code: int
    out: str
    err: str


Command = Callable[..., Answer]


@pytest.fixture
def replay(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Runs a command line in this process."""
    for console in (out, err):
        monkeypatch.setattr(console, "_width", 250)

    def run(*words: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["replay", *map(str, words)])
        capsys.readouterr()
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        captured = capsys.readouterr()
        return Answer(code, captured.out, captured.err)

    return run


def complaint(answer: Answer, code: int, *, where: object = "", mend: str = "") -> str:
    """Check that an error says what, where and how to mend it; what it says."""
    assert answer.code == code, answer.err
    assert "Traceback" not in answer.err + answer.out
    text = answer.err
    assert text.startswith("error: ")
    if where:
        assert f"where: {where}" in text
    if mend:
        assert re.search(f"mend:  .*{mend}", text)
    return text.splitlines()[0]


@pytest.fixture
def cut_log(short_log: Path, tmp_path: Path) -> Path:
    path = tmp_path / "cut.mcap"
    path.write_bytes(short_log.read_bytes()[:-20_000])
    return path


def digests(path: Path) -> dict[str, str]:
    with LogReader(path) as reader:
        return {topic: digest.sha256 for topic, digest in reader.digests().items()}


# run


def test_run(replay: Command, short_log: Path, short_run: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.mcap"
    answer = replay("run", PIPELINE, short_log, "-o", target)
    assert answer.code == 0, answer.err
    assert answer.err == ""  # no bar where there is no terminal
    held = digests(target)
    assert held == digests(short_run)
    for topic in OUTPUTS:
        assert topic in answer.out
        assert held[topic][:16] in answer.out
    assert "s of log" in answer.out


def test_run_with_settings(replay: Command, short_log: Path, tmp_path: Path) -> None:
    """A file lies under --set; both give what the library gives."""
    settings = tmp_path / "settings.toml"
    settings.write_text('name = "mine"\n[filter]\ngyro_bias_tau = "5 min"\nstates = 15\n')
    target, expected = tmp_path / "run.mcap", tmp_path / "expected.mcap"
    answer = replay(
        "run", PIPELINE, short_log, "-o", target, "--config", settings,
        "--set", "filter.states=21", "--set", "filter.gyro_bias_sigma=20 deg/h",
    )  # fmt: skip
    assert answer.code == 0, answer.err
    sigma = 20.0 * math.pi / 180.0 / 3600.0
    own = {"states": 21, "gyro_bias_tau": 300.0, "gyro_bias_sigma": sigma}
    run_to_file(short_log, expected, {"name": "mine", "filter": own})
    with LogReader(target) as reader:
        assert "/solution/mine" in reader.channels
        assert reader.read("/filter/mine/covariance")["dimension"][0] == 21
    assert digests(target).keys() == digests(expected).keys()
    assert digests(target)["/solution/mine"] == digests(expected)["/solution/mine"]


@pytest.mark.parametrize("form", ["20", "2025-06-01T12:00:20", "2025/06/01 12:00:20.000", "ns"])
def test_run_from_a_time(replay: Command, short_log: Path, tmp_path: Path, form: str) -> None:
    with LogReader(short_log) as reader:
        first = reader.start_ns
    text = str(first + 20 * SECOND) if form == "ns" else form
    target = tmp_path / "run.mcap"
    answer = replay("run", PIPELINE, short_log, "-o", target, "--from", text, "--to", "40")
    assert answer.code == 0, answer.err
    with LogReader(target) as reader:
        assert reader.start_ns == first + 20 * SECOND
        assert reader.end_ns == first + 40 * SECOND - 20_000_000


def test_run_and_resume(replay: Command, short_log: Path, tmp_path: Path) -> None:
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    words = ["run", PIPELINE, short_log, "--checkpoint-every", "10"]
    assert replay(*words, "-o", one).code == 0
    assert replay(*words, "-o", two, "--resume", one).code == 0
    assert digests(one) == digests(two)
    answer = replay("run", PIPELINE, short_log, "-o", two, "--resume", one)
    assert "another job" in complaint(answer, 2, where=one)


@pytest.mark.parametrize(
    ("words", "what", "mend"),
    [
        (["gnss-ins-lcc"], "no pipeline 'gnss-ins-lcc'", "did you mean gnss-ins-lc"),
        ([PIPELINE, "--set", "filter.stattes=15"], "unknown key filter.stattes", "filter.states"),
        ([PIPELINE, "--set", "filter"], "'filter' is no assignment", "section.key=value"),
        ([PIPELINE, "--set", "filter.states=17"], "filter.states is 17", "15"),
        ([PIPELINE, "--set", "filter.gyro_noise=3 kg"], "'3 kg' is no quantity", "rad/sqrt"),
        ([PIPELINE, "--set", "filter.states=many"], "many|int", "replay pipelines"),
        ([PIPELINE, "--from", "yesterday"], "'yesterday' is no time", "2025-07-08"),
        ([PIPELINE, "--checkpoint-every", "-1"], "--checkpoint-every", ""),
        ([PIPELINE, "--set", "name=a/b"], "'a/b'", "name="),
    ],
)
def test_run_with_wrong_words(
    replay: Command, short_log: Path, tmp_path: Path, words: list[str], what: str, mend: str
) -> None:
    answer = replay("run", words[0], short_log, "-o", tmp_path / "x.mcap", *words[1:])
    assert re.search(what, complaint(answer, 2, mend=re.escape(mend)))
    assert not list(tmp_path.iterdir())


def test_run_with_a_wrong_file_of_settings(
    replay: Command, short_log: Path, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.toml"
    words = ("run", PIPELINE, short_log, "-o", tmp_path / "x.mcap", "--config", bad)
    assert "no such file" in complaint(replay(*words), 2, where=bad)
    bad.write_text("states = = 3")
    assert "TOML" in complaint(replay(*words), 2, where=bad)
    bad.write_bytes(b'name = "\xff"')
    assert "TOML" in complaint(replay(*words), 2, where=bad)


def test_words_that_the_parser_refuses(replay: Command, short_log: Path) -> None:
    for words in (["run", PIPELINE, short_log], ["fly"], ["info"], ["info", short_log, "--fast"]):
        answer = replay(*words)
        assert answer.code == 2
        assert "Usage" in answer.err
    assert replay("--help").code == 0


@pytest.mark.parametrize(
    "words",
    [
        ["info", "LOG"],
        ["doctor", "LOG"],
        ["evaluate", "LOG"],
        ["recover", "LOG", "-o", "OUT"],
        ["run", PIPELINE, "LOG", "-o", "OUT"],
        ["verify", "LOG", "--input", "LOG"],
        ["diff", "LOG", "LOG"],
        ["view", "LOG", "-o", "OUT"],
        ["report", "LOG", "-o", "OUT"],
        ["degrade", "LOG", "-o", "OUT", "--outage", "1,2"],
        ["simulate", "LOG", "-o", "OUT"],
    ],
)
def test_missing_file(replay: Command, tmp_path: Path, words: list[str]) -> None:
    missing, target = tmp_path / "missing.mcap", tmp_path / "out"
    names: dict[str, object] = {"LOG": missing, "OUT": target}
    answer = replay(*(names.get(word, word) for word in words))
    complaint(answer, 2)
    assert str(missing) in answer.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["info", "doctor", "run", "evaluate"])
def test_a_file_that_is_no_log(replay: Command, tmp_path: Path, command: str) -> None:
    for path in (tmp_path / "text.mcap", tmp_path / "empty.mcap", tmp_path):
        if path.suffix:
            path.write_bytes(b"" if path.stem == "empty" else b"not a log at all" * 20)
        more = [PIPELINE, path, "-o", tmp_path / "out.mcap"] if command == "run" else [path]
        answer = replay(command, *more)
        complaint(answer, 1)
        assert str(path) in answer.err


def test_run_over_a_damaged_log(replay: Command, cut_log: Path, tmp_path: Path) -> None:
    answer = replay("run", PIPELINE, cut_log, "-o", tmp_path / "x.mcap")
    complaint(answer, 1, mend=f"replay recover {cut_log}")
    assert re.search(rf"where: {cut_log}, byte \d+", answer.err)
    assert not (tmp_path / "x.mcap").exists()


def test_run_without_a_channel(replay: Command, short_log: Path, tmp_path: Path) -> None:
    poor = rewrite(short_log, tmp_path / "poor.mcap", lambda rows: {TRUTH: rows[TRUTH]})
    answer = replay("run", PIPELINE, poor, "-o", tmp_path / "x.mcap")
    assert "/imu/raw" in complaint(answer, 1, mend="import or simulate")


@pytest.mark.parametrize("command", ["run", "degrade"])
def test_input_is_never_written_over(
    replay: Command, short_log: Path, tmp_path: Path, command: str
) -> None:
    path = tmp_path / "in.mcap"
    path.write_bytes(short_log.read_bytes())
    words = [PIPELINE, path] if command == "run" else [path, "--outage", "40,3"]
    complaint(replay(command, *words, "-o", tmp_path / "." / "in.mcap"), 2, where=path)
    assert path.read_bytes() == short_log.read_bytes()


def test_a_folder_that_is_not_there(replay: Command, short_log: Path, tmp_path: Path) -> None:
    answer = replay("run", PIPELINE, short_log, "-o", tmp_path / "no" / "x.mcap")
    complaint(answer, 2)
    assert str(tmp_path / "no" / "x.mcap") in answer.err


# verify and diff


def test_verify(replay: Command, short_log: Path, short_run: Path, tmp_path: Path) -> None:
    answer = replay("verify", short_run, "--input", short_log)
    assert answer.code == 0
    assert answer.out.count("equal") == len(OUTPUTS)

    def off(rows: dict[str, Any]) -> dict[str, Any]:
        return {**rows, SOLUTION: changed(rows[SOLUTION], "status", 7, 0)}

    forged = rewrite(short_run, tmp_path / "forged.mcap", off)
    answer = replay("verify", forged, "--input", short_log)
    assert answer.code == 1
    (line,) = [line for line in answer.out.splitlines() if "different" in line]
    assert SOLUTION in line
    other = rewrite(
        short_log, tmp_path / "other.mcap", lambda rows: {**rows, IMU: rows[IMU].take(slice(9))}
    )
    answer = replay("verify", short_run, "--input", other)
    assert IMU in complaint(answer, 3, where=other)
    bare = rewrite(short_run, tmp_path / "bare.mcap", lambda rows: rows, metadata=False)
    assert "manifest" in complaint(replay("verify", bare, "--input", short_log), 3, where=bare)


def test_diff(replay: Command, short_log: Path, short_run: Path, tmp_path: Path) -> None:
    again, other = tmp_path / "again.mcap", tmp_path / "other.mcap"
    run_to_file(short_log, again)
    run_to_file(short_log, other, {"filter": {"gyro_noise": 1e-3}})
    answer = replay("diff", short_run, again)
    assert answer.code == 0
    assert "identical" in answer.out.lower()
    answer = replay("diff", short_run, other)
    assert answer.code == 1
    assert SOLUTION in answer.out
    answer = replay("diff", short_run, other, "--json")
    assert answer.code == 1
    assert json.loads(answer.out)
    answer = replay("diff", short_run, other, "--markdown", "--topic", SOLUTION)
    assert answer.code == 1
    assert "|" in answer.out
    answer = replay("diff", short_run, other, "--map-run", "nothing")
    assert "'nothing'" in complaint(answer, 2, mend="NAME_IN_A=NAME_IN_B")


def test_diff_of_runs_over_different_logs(
    replay: Command, short_log: Path, short_run: Path, tmp_path: Path
) -> None:
    source, run = tmp_path / "source.mcap", tmp_path / "run.mcap"
    assert replay("degrade", short_log, "-o", source, "--outage", "40,3").code == 0
    run_to_file(source, run)
    answer = replay("diff", short_run, run)
    assert answer.code == 3
    assert FIX in answer.out + answer.err
    assert replay("diff", short_run, run, "--allow-different-inputs").code == 1


# evaluate, view, report


def test_evaluate(replay: Command, short_run: Path, short_log: Path) -> None:
    answer = replay("evaluate", short_run)
    assert answer.code == 0
    assert "position" in answer.out.lower()
    figures = replay("evaluate", short_run, "--json")
    assert figures.code == 0
    assert json.loads(figures.out)
    complaint(replay("evaluate", short_log), 1)
    complaint(replay("evaluate", short_run, "--run", "nobody"), 1)


def test_compare(replay: Command, short_run: Path, short_log: Path, tmp_path: Path) -> None:
    page, recording = tmp_path / "methods.html", tmp_path / "methods.rrd"
    answer = replay("compare", short_run, short_run, "-o", page, "--rrd", recording)
    assert answer.code == 0, answer.err
    assert f"{short_run.stem}:{PIPELINE}" in answer.out
    assert "<h1>Comparison of methods</h1>" in page.read_text()
    assert recording.read_bytes()[:3] == b"RRF"
    figures = json.loads(replay("compare", short_run, "--json").out)
    assert [m["name"] for m in figures["methods"]] == [PIPELINE]
    alone = json.loads(replay("evaluate", short_run, "--json").out)
    assert figures["methods"][0]["position_error_m"] == alone["position_error_m"]
    assert replay("compare", short_run, "--markdown").out.startswith("| method |")
    scenes = replay(
        "compare", short_run, "-o", page, "--scene", "5,9", "--scene", "12,20", "--title", "A <b>"
    )
    assert scenes.code == 0, scenes.err
    assert "2 Scene, " in page.read_text() and "A &lt;b&gt;" in page.read_text()
    complaint(replay("compare", short_log), 1)
    complaint(replay("compare", short_run, "--scene", "5", "-o", page), 2, mend="START,END")
    complaint(replay("compare", short_run, "--scene", "9,5", "-o", page), 2)
    complaint(replay("compare", short_run, "--scene", "a,b", "-o", page), 2)
    complaint(replay("compare", short_run, "--png", tmp_path / "x.png"), 2, mend="--rrd")


def test_view(replay: Command, short_run: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.rrd"
    answer = replay("view", short_run, "-o", target)
    assert answer.code == 0, answer.err
    assert target.read_bytes()[:3] == b"RRF"
    assert str(target) in answer.out


def test_report(replay: Command, short_run: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.html"
    answer = replay("report", short_run, "-o", target, "--title", "A <drive>")
    assert answer.code == 0, answer.err
    page = target.read_text()
    assert "A &lt;drive&gt;" in page
    poor = rewrite(
        short_run,
        tmp_path / "poor.mcap",
        lambda rows: {t: c for t, c in rows.items() if t != TRUTH},
    )
    answer = replay("report", poor, "-o", target)
    assert answer.code == 0, answer.err
    assert "no figures against truth" in answer.err


# logs


def test_info(replay: Command, short_log: Path, cut_log: Path) -> None:
    answer = replay("info", short_log)
    assert answer.code == 0
    for topic, digest in digests(short_log).items():
        assert topic in answer.out
        assert digest[:16] in answer.out
    assert "50.00 Hz" in answer.out
    assert "gap: /gnss/rover/fix, 2025-06-01T12:00:23.750, 5.250 s" in answer.out
    answer = replay("info", cut_log)
    assert answer.code == 3
    assert "damaged" in answer.err


def test_doctor_and_recover(
    replay: Command, short_log: Path, cut_log: Path, tmp_path: Path
) -> None:
    answer = replay("doctor", short_log)
    assert (answer.code, answer.out.splitlines()[-1]) == (0, "whole")
    answer = replay("doctor", cut_log)
    assert answer.code == 3
    assert "damaged" in answer.out
    assert f"replay recover {cut_log}" in answer.out
    saved = tmp_path / "saved.mcap"
    answer = replay("recover", cut_log, "-o", saved)
    assert answer.code == 3
    assert "lost" in answer.err
    assert replay("doctor", saved).code == 0
    assert replay("recover", short_log, "-o", saved).code == 0
    assert digests(saved) == digests(short_log)
    complaint(replay("recover", cut_log, "-o", cut_log), 2, where=cut_log)


SPEC = """
title = "tiny"
origin = "https://example.org/tiny"
licence = "CC0-1.0"

[sources.imu]
file = "imu.csv"
columns = ["t", "gx", "gy", "gz", "ax", "ay", "az"]

[channels.imu]
kind = "imu"
source = "imu"

[channels.imu.time]
columns = ["t"]
scale = "gps_calendar"

[channels.imu.fields]
angular_rate_body_rad_s = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
specific_force_body_m_s2 = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
"""


def test_import(replay: Command, tmp_path: Path) -> None:
    spec, target = tmp_path / "tiny.toml", tmp_path / "out.mcap"
    spec.write_text(SPEC)
    lines = [f"2025/07/08 19:34:2{i}.500,0.1,0.2,0.{i},1.0,2.0,-9.8" for i in range(6)]
    data = tmp_path / "imu.csv"
    data.write_text("\n".join(lines) + "\n")
    words = ("import", spec, "--data", tmp_path, "-o", target)
    answer = replay(*words)
    assert answer.code == 0, answer.err
    with LogReader(target) as reader:
        rows = reader.read(IMU)
    assert rows["angular_rate_body_rad_s"][:, 2].tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert rows.valid_time_ns[0] == time.parse_calendar("2025-07-08T19:34:20.5")
    lines[3] = lines[3].replace("0.2", "broken", 1)
    data.write_text("\n".join(lines) + "\n")
    answer = replay(*words)
    assert answer.code == 3
    assert "skipped" in answer.err
    with LogReader(target) as reader:
        assert len(reader.read(IMU)) == 5
    target.unlink()
    answer = replay(*words, "--strict")
    complaint(answer, 1)
    assert str(data) in answer.err
    assert not target.exists()
    data.unlink()
    assert replay(*words).code in (1, 2)
    spec.write_text("channels = 3")
    complaint(replay(*words), 2)


def test_simulate(replay: Command, tmp_path: Path) -> None:
    scenario, target = tmp_path / "tiny.toml", tmp_path / "out.mcap"
    scenario.write_text('[[segments]]\nkind = "hold"\nduration = "2 s"\n')
    answer = replay("simulate", scenario, "-o", target)
    assert answer.code == 0, answer.err
    for topic, digest in digests(target).items():
        assert topic in answer.out
        assert digest[:16] in answer.out
    scenario.write_text('[[segments]]\nkind = "hover"\n')
    assert "hover" in complaint(replay("simulate", scenario, "-o", target), 2)


def test_degrade(replay: Command, short_log: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.mcap"
    answer = replay("degrade", short_log, "-o", target, "--outage", "12,2", "--outage", "40,3")
    assert answer.code == 0, answer.err
    assert "20 rows left out in 2 outages" in answer.out
    answer = replay(
        "degrade", short_log, "-o", target, "--outage", "10,1", "--every", "5", "--leave-last", "25"
    )
    assert answer.code == 0, answer.err
    with LogReader(short_log) as before, LogReader(target) as after:
        first, last = before.start_ns, before.end_ns
        old, new = before.read(FIX).valid_time_ns, after.read(FIX).valid_time_ns
    gone = (np.setdiff1d(old, new) - first) / SECOND
    assert set((gone // 5).astype(int)) >= {2, 3, 4}
    assert np.all(gone % 5 < 1.0)
    assert gone.max() <= (last - first) / SECOND - 25
    answer = replay("degrade", short_log, "-o", target, "--outage", "25,2")
    assert "no GNSS row" in complaint(answer, 2)
    for text in ("12", "12,x", "soon,3", "12,-3"):
        complaint(replay("degrade", short_log, "-o", target, "--outage", text), 2)


def test_pipelines(replay: Command) -> None:
    answer = replay("pipelines")
    assert answer.code == 0
    assert PIPELINE in answer.out
    answer = replay("pipelines", PIPELINE)
    assert answer.code == 0
    for key, default, unit, _ in describe(LooseConfig):
        assert key in answer.out
        if unit:
            assert unit in answer.out, key
        assert default[:10] in answer.out
    assert "did you mean" in replay("pipelines", "gnss-ins-lx").err


def test_warmup(replay: Command) -> None:
    """The small log takes every path to a kernel, so that this compiles nothing new."""
    answer = replay("warmup")
    assert answer.code == 0
    assert re.search(r"in \d+\.\d s", answer.out)


# words


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0", START),
        ("40", START + 40 * SECOND),
        ("40.25", START + 40_250_000_000),
        ("-2", START - 2 * SECOND),
        ("1e3", START + 1000 * SECOND),
        ("1436038461499000001", 1_436_038_461_499_000_001),
        ("1436038461.499000001", 1_436_038_461_499_000_001),
        ("2025-06-01T12:00:40", START + 40 * SECOND),
        ("2025-06-01 12:00:40.000000001", START + 40 * SECOND + 1),
        ("1980-01-06T00:00:01", SECOND),
    ],
)
def test_times(text: str, expected: int) -> None:
    assert parse_time(text, START) == expected


@pytest.mark.parametrize(
    "text", ["", "soon", "12:00:00", "2025-13-01T00:00:00", "nan", "inf", "-inf", "1.5e18"]
)
def test_words_that_are_no_time(text: str) -> None:
    with pytest.raises(UsageError, match="is no time"):
        parse_time(text, START)


def test_outages() -> None:
    assert parse_outage("40,15", START) == (START + 40 * SECOND, START + 55 * SECOND)
    date = "2025-06-01T12:00:40"
    assert parse_outage(f"{date},1.5", START) == (
        START + 40 * SECOND,
        START + 41_500_000_000,
    )
    for text in ("40", "", ",", "40,", ",15", "40;15", "40,nan", "40,inf"):
        with pytest.raises(UsageError):
            parse_outage(text, START)


# the command itself


def command(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from replay.cli import main; main()", *map(str, words)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "200"},
        check=False,
    )


def test_exit_codes_reach_the_shell(short_log: Path, cut_log: Path, tmp_path: Path) -> None:
    assert command("info", short_log).returncode == 0
    assert command("info", tmp_path / "none.mcap").returncode == 2
    assert command("doctor", cut_log).returncode == 3
    assert command("info", Path(__file__)).returncode == 1


def test_a_reader_that_leaves_early() -> None:
    """`replay info LOG | head -1` is no error."""
    words = [sys.executable, "-c", "from replay.cli import main; main()", "pipelines", PIPELINE]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    errors = process.stderr.read()
    assert process.wait(timeout=60) == 0
    assert b"Traceback" not in errors


def test_help_loads_no_library() -> None:
    """Words alone answer at once: the heavy libraries wait for the command that needs them."""
    script = (
        "import sys\nsys.argv = ['replay', '--help']\nfrom replay.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'rerun', 'matplotlib', 'scipy', 'pyarrow'} & set(sys.modules)\n"
        "sys.exit(f'loaded: {sorted(heavy)}' if heavy else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
