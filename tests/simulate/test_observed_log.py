"""The log of a scenario with receivers: the same bytes again, however it is cut; what it tells."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from replay import channels
from replay.configuration import build, known_part
from replay.log.reader import LogReader
from replay.simulate import load_scenario, read_scenario, simulate, write
from replay.stages.loose_config import LooseConfig

RECORDINGS = Path(__file__).parents[2] / "recordings"
SHORT = RECORDINGS / "tang-short" / "scenario.toml"
HOUR = RECORDINGS / "tang-drive" / "scenario.toml"
DIGESTS = """
import sys
from pathlib import Path
from replay.simulate import simulate
result = simulate(Path(sys.argv[1]), Path(sys.argv[2]))
print(" ".join(result.outputs[topic].sha256 for topic in sorted(result.outputs)))
"""


def joined(result):
    return " ".join(result.outputs[topic].sha256 for topic in sorted(result.outputs))


def digests_elsewhere(scenario, out, **environment):
    return subprocess.run(
        [sys.executable, "-c", DIGESTS, str(scenario), str(out)],
        env={**os.environ, **environment},
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    return simulate(SHORT, tmp_path_factory.mktemp("observed") / "short.mcap")


def test_another_process_writes_the_same_bytes(short, tmp_path):
    out = tmp_path / "again.mcap"
    assert joined(short) == digests_elsewhere(SHORT, out, PYTHONHASHSEED="5", TZ="Asia/Tokyo")
    assert short.path.read_bytes() == out.read_bytes()


@pytest.mark.parametrize("batch_s", [1, 7, 1000])
def test_the_batches_of_writing_change_no_digest(short, tmp_path, monkeypatch, batch_s):
    monkeypatch.setattr(write, "_BATCH_NS", batch_s * 10**9)
    assert joined(simulate(SHORT, tmp_path / "cut.mcap")) == joined(short)


@pytest.mark.heavy
@pytest.mark.parametrize("scenario", [SHORT, HOUR])
def test_a_lesser_processor_writes_the_same_bytes(tmp_path, scenario):
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    there = digests_elsewhere(
        scenario,
        tmp_path / "b.mcap",
        NUMBA_CPU_NAME="generic",
        NUMBA_CPU_FEATURES="",
        NPY_DISABLE_CPU_FEATURES=" ".join(n for n in __cpu_dispatch__ if __cpu_features__.get(n)),
    )
    assert joined(simulate(scenario, tmp_path / "a.mcap")) == there


def test_the_drive_without_receivers_is_what_it_was(tmp_path):
    baseline = tomllib.loads((RECORDINGS / "drive" / "baseline.toml").read_text())
    recorded = baseline["cases"]["default"]["recorded"]["inputs"]
    made = simulate(RECORDINGS / "drive" / "scenario.toml", tmp_path / "drive.mcap").outputs
    assert {t: d.sha256 for t, d in made.items()} == {t: i["sha256"] for t, i in recorded.items()}


def test_the_log_has_what_observations_need(short):
    scenario = load_scenario(SHORT)
    with LogReader(short.path) as reader:
        metadata = reader.metadata
        nav = reader.read(channels.NAV.topic)
        observed = reader.read(channels.GNSS_OBS.at(receiver="rover"))
        epochs = reader.read(channels.RECEIVER_EPOCH.at(receiver="rover"))
        base = reader.read(channels.RECEIVER.at(receiver="base"))
        ionosphere = reader.read(channels.NAV_IONOSPHERE.topic)
        truth = reader.read(channels.TRUTH.topic)
    assert set(observed["satellite"].tolist()) <= set(nav["satellite"].tolist())
    assert (nav.log_time_ns >= truth.valid_time_ns[0]).all()
    assert len(epochs) == int(short.duration_s)
    assert not epochs.is_present("clock_offset_s").any()
    assert np.linalg.norm(base["approximate_position_ecef_m"]) == pytest.approx(6.372e6, rel=1e-3)
    assert ionosphere.ragged("coefficients").row(0).tolist() == [
        *scenario.setup.sky.ionosphere.alpha,
        *scenario.setup.sky.ionosphere.beta,
    ]
    again = read_scenario(
        tomllib.loads(json.loads(metadata["replay.manifest"]["json"])["configuration"])
    )
    assert again == scenario
    slips = json.loads(metadata["replay.simulated"]["slips"])
    assert {"receiver", "satellite", "signal", "time_ns", "cycles", "flagged"} == set(slips[0])
    assert any(s["satellite"] == "G16" and s["cycles"] == 3 for s in slips)
    table = tomllib.loads(metadata["replay.defaults"]["toml"])
    assert table["gnss"]["base"] == "base"
    assert build(LooseConfig, [known_part(LooseConfig, table)]).gnss.receiver == "rover"


def test_canonical_text_reads_back_equal():
    for path in (SHORT, HOUR):
        scenario = load_scenario(path)
        text = scenario.to_toml()
        again = read_scenario(tomllib.loads(text))
        assert again == scenario
        assert again.to_toml() == text


def test_the_short_drive_is_made_of_what_it_says(short):
    with LogReader(short.path) as reader:
        observed = reader.read(channels.GNSS_OBS.at(receiver="rover"))
        start = reader.read(channels.TRUTH.topic).valid_time_ns[0]
    elapsed = (observed.valid_time_ns - start) // 10**9
    count = {t: len(set(observed["satellite"][elapsed == t].tolist())) for t in range(1, 301)}
    assert count[50] > 30
    assert [count[t] for t in range(200, 206)] == [0] * 6
    assert [count[t] for t in range(241, 255)] == [3] * 14
    assert count[100] < count[70]
