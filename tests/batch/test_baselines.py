"""Baselines: equal passes, anything else is named, and nothing is rewritten without a reason."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import msgspec
import pytest

from replay.batch.baseline import Verdict, check, compare, update
from replay.batch.baseline_file import Recorded, load_baseline, save_baseline, sealed
from replay.batch.recordings import find_recordings
from replay.cli import main
from replay.errors import ConfigurationError, ExitCode, UsageError
from tests.conftest import ROOT

RECORDINGS = ROOT / "recordings"
SCENARIO = """\
seed = 3
[imu]
rate = "50 Hz"
[[segments]]
kind = "hold"
duration = 8.0
[[segments]]
kind = "speed"
to = 12.0
[[segments]]
kind = "turn"
angle = "60 deg"
radius = 30.0
[[segments]]
kind = "straight"
duration = 30.0
"""
CASES = """\
about = "small"
[cases.default]
about = "as the log says"
[cases.outages]
degrade = ["22,4"]
every = 10.0
leave_last = 3.0
"""
REASON = "First figures."


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of one small recording with its baseline."""
    root = tmp_path_factory.mktemp("recordings")
    (root / "small").mkdir()
    (root / "small" / "scenario.toml").write_text(SCENARIO)
    (root / "small" / "baseline.toml").write_text(CASES)
    list(update(find_recordings(root), REASON))
    return root


@pytest.fixture
def root(made: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may spoil."""
    return Path(shutil.copytree(made, tmp_path / "recordings"))


def replace(path: Path, old: str, new: str) -> None:
    """Edit a file; the text must be in it."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    """Exit code of the command line."""
    monkeypatch.setattr(sys, "argv", ["replay", "baseline", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def recorded_default(root: Path) -> Recorded:
    recorded = load_baseline(root / "small" / "baseline.toml").cases["default"].recorded
    assert recorded is not None
    return recorded


def test_simulated_recordings_give_what_is_committed() -> None:
    simulated = [item for item in find_recordings(RECORDINGS) if item.spec is None]
    checks = list(check(simulated))
    assert {c.case for c in checks if c.recording == "drive"} >= {"default", "no-constraints"}
    assert {(c.recording, c.case): c.verdict for c in checks} == {
        (c.recording, c.case): Verdict.EQUAL for c in checks
    }


@pytest.mark.parametrize(
    "name",
    [
        "urban-short-turn-loop-nominal-001",
        "covered-parking-urban-drive-gnss-outage-001",
        "boulder-drive-2025-189",
    ],
)
def test_real_recordings_give_what_is_committed(name: str, shared_data: Path) -> None:
    checks = list(check(find_recordings(RECORDINGS, [name]), shared_data))
    assert [(c.case, c.verdict) for c in checks] == [(c.case, Verdict.EQUAL) for c in checks]


def test_real_recordings_without_files_are_skipped_and_say_why(tmp_path: Path) -> None:
    real = [item for item in find_recordings(RECORDINGS) if item.spec is not None]
    for data, why in ((None, "--data DIR"), (tmp_path, "it comes from https://")):
        checks = list(check(real, data))
        assert len(checks) >= len(real) >= 3
        assert {c.verdict for c in checks} == {Verdict.SKIPPED}
        assert all(why in c.notes[0] for c in checks)
        assert {c.exit_code for c in checks} == {ExitCode.OK}


def test_equal_runs_pass(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(monkeypatch, "check", "--recordings", str(root)) == 0


def test_outages_come_again(root: Path) -> None:
    case = load_baseline(root / "small" / "baseline.toml").cases["outages"]
    assert case.recorded is not None
    assert case.recorded.figures["drift_outages"]["count"] == 3  # at 22, 32 and 42 s of 50
    default = recorded_default(root)
    changed = [t for t, d in case.recorded.inputs.items() if d != default.inputs[t]]
    assert changed == ["/gnss/rover/fix"]


def test_a_changed_setting_is_named_by_channel_and_figure(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    replace(
        root / "small" / "baseline.toml",
        'about = "as the log says"\n',
        'about = "as the log says"\nset = ["gnss.position_scale=2.0"]\n',
    )
    assert run(monkeypatch, "check", "--recordings", str(root), "--json") == 1
    default, outages = json.loads(capsys.readouterr().out)
    assert (default["verdict"], outages["verdict"]) == ("changed", "equal")
    channels = {change["topic"]: change for change in default["channels"]}
    assert set(channels) >= {"/solution/gnss-ins-lc", "/filter/gnss-ins-lc/innovations"}
    assert {change["kind"] for change in channels.values()} == {"output"}
    figures = {change["name"]: change for change in default["figures"]}
    nis = figures["nis_mean_position.east"]
    assert nis["found"] < 0.5 * nis["recorded"]
    assert any("configuration" in note for note in default["notes"])
    assert run(monkeypatch, "check", "--recordings", str(root)) == 1
    shown = capsys.readouterr().out
    assert "/solution/gnss-ins-lc" in shown
    assert "nis_mean_position.east" in shown


def test_a_changed_scenario_is_told_from_a_changed_filter(root: Path) -> None:
    replace(root / "small" / "scenario.toml", "seed = 3", "seed = 4")
    found = next(check(find_recordings(root)))
    assert found.verdict is Verdict.CHANGED
    inputs = {change.topic for change in found.channels if change.kind == "input"}
    assert inputs == {"/imu/raw", "/gnss/rover/fix", "/truth"}
    assert any("the input is another one" in note for note in found.notes)


@pytest.mark.parametrize(
    ("old", "new"),
    [("position_rms_m = { east = 0.", "position_rms_m = { east = 9."), ("sha256 = ", "sha256 = ")],
)
def test_an_edit_by_hand_is_found(root: Path, old: str, new: str) -> None:
    path = root / "small" / "baseline.toml"
    replace(path, old, new)
    if old == new:
        sha = recorded_default(root).outputs["/solution/gnss-ins-lc"].sha256
        replace(path, sha, sha[::-1])
    found = next(check(find_recordings(root)))
    assert found.verdict is Verdict.EDITED
    assert found.exit_code is ExitCode.FAILURE
    assert "its seal does not fit" in found.notes[0]


def test_figures_that_move_alone_are_the_evaluation_s(root: Path) -> None:
    found = recorded_default(root)
    figures = {name: dict(group) for name, group in found.figures.items()}
    figures["position_rms_m"]["east"] += 0.0001
    rounded = sealed(msgspec.structs.replace(found, figures=figures))
    assert compare("small", "default", rounded, found).verdict is Verdict.EQUAL
    figures["position_rms_m"]["east"] += 0.01
    moved = compare("small", "default", sealed(msgspec.structs.replace(rounded)), found)
    assert moved.verdict is Verdict.CHANGED
    assert [change.name for change in moved.figures] == ["position_rms_m.east"]
    assert "the evaluation changed" in moved.notes[0]


def test_a_changed_output_without_a_raised_version_is_hinted_at(root: Path) -> None:
    found = recorded_default(root)
    outputs = dict(found.outputs)
    outputs.popitem()
    before = sealed(msgspec.structs.replace(found, outputs=outputs))
    checked = compare("small", "default", before, found)
    assert [(c.topic, c.recorded) for c in checked.channels] == [("/solution/gnss-ins-lc", None)]
    assert any("StageSpec.version" in note for note in checked.notes)


def test_update_wants_a_reason(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(monkeypatch, "update", "--recordings", str(root)) == 2
    assert run(monkeypatch, "update", "--recordings", str(root), "--reason", " ") == 2


def test_update_writes_what_changed_and_keeps_history(root: Path) -> None:
    path = root / "small" / "baseline.toml"
    before = path.read_bytes()
    list(update(find_recordings(root), "Nothing to say."))
    assert path.read_bytes() == before
    replace(path, 'about = "as the log says"\n', 'set = ["filter.states=15"]\n')
    list(update(find_recordings(root), "Fewer states."))
    entries = load_baseline(path).history
    assert [(entry.reason, entry.cases) for entry in entries] == [
        (REASON, ("default", "outages")),
        ("Fewer states.", ("default",)),
    ]
    assert {c.verdict for c in check(find_recordings(root))} == {Verdict.EQUAL}


def test_a_recording_without_a_file_gets_one(root: Path) -> None:
    path = root / "small" / "baseline.toml"
    path.unlink()
    assert [c.verdict for c in check(find_recordings(root))] == [Verdict.UNRECORDED]
    list(update(find_recordings(root), REASON))
    assert list(load_baseline(path).cases) == ["default"]


def test_files_come_back_as_they_were_written(root: Path, tmp_path: Path) -> None:
    for path in (root / "small" / "baseline.toml", *RECORDINGS.rglob("baseline.toml")):
        again = tmp_path / "again.toml"
        save_baseline(again, load_baseline(path))
        assert again.read_text() == path.read_text()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('pipeline = "gnss-ins-lc"', 'pipline = "gnss-ins-lc"'),
        ("[cases.default]", "[cases.default"),
        ('about = "small"', 'spec = "somewhere.toml"'),
        ('degrade = ["22,4"]', 'degrade = ["22"]'),
        ('degrade = ["22,4"]', 'degrade = ["inf,4"]'),
    ],
)
def test_a_file_that_is_off_is_named(root: Path, old: str, new: str) -> None:
    replace(root / "small" / "baseline.toml", old, new)
    with pytest.raises(ConfigurationError):
        list(check(find_recordings(root)))


def test_an_unknown_recording_is_named(root: Path) -> None:
    with pytest.raises(UsageError, match="smal"):
        find_recordings(root, ["smal"])
