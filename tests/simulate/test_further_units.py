"""Several inertial units in one log, and which of them a pipeline reads."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay import channels
from replay.engine.graph import bind
from replay.engine.job import Job, make_job
from replay.engine.pipelines import find_pipeline
from replay.errors import ConfigurationError, MissingChannelError
from replay.log.reader import LogReader
from replay.simulate import read_scenario
from replay.simulate.write import make_channels, write_log

REFERENCE = channels.IMU_UNIT.at(unit="reference")
DRIVE = [
    {"kind": "hold", "duration": 3.0},
    {"kind": "speed", "to": 10.0},
    {"kind": "turn", "angle": "90 deg", "radius": 30.0},
]
RATE, FORCE = "angular_rate_body_rad_s", "specific_force_body_m_s2"


def table(*units: dict[str, Any], **keys: Any) -> dict[str, Any]:
    return {"segments": DRIVE, "imus": list(units), "imu": {"grade": "icm-20602"}, **keys}


def reference(**keys: Any) -> dict[str, Any]:
    return {"name": "reference", "rate": "200 Hz", **keys}


def test_perfect_units_of_any_rate_feel_the_same_motion():
    rows = make_channels(
        read_scenario(table(reference(grade="perfect"), imu={"rate": 50.0, "grade": "perfect"}))
    )
    slow, fast = rows[channels.IMU.topic], rows[REFERENCE]
    np.testing.assert_array_equal(fast.valid_time_ns[3::4], slow.valid_time_ns)
    for name in (RATE, FORCE):
        mean = fast[name].reshape(-1, 4, 3).mean(axis=1)
        # Where a manoeuvre begins within an interval, the integral of its motion is less exact.
        np.testing.assert_allclose(mean, slow[name], atol=1e-8)


def test_each_unit_errs_on_its_own_and_changes_no_other():
    alone = make_channels(read_scenario(table()))
    rows = make_channels(
        read_scenario(table(reference(grade="icm-20602", rate=100.0), reference(name="third")))
    )
    for name in (RATE, FORCE):
        np.testing.assert_array_equal(
            rows[channels.IMU.topic][name], alone[channels.IMU.topic][name]
        )
    one, other = rows[channels.IMU.topic][RATE], rows[REFERENCE][RATE]
    assert one.shape == other.shape
    still = slice(0, 200)
    own, theirs = (values[still] - values[still].mean(axis=0) for values in (one, other))
    assert np.std(own) == pytest.approx(np.std(theirs), rel=0.1)
    assert abs(np.mean(own * theirs)) < 0.15 * np.var(own)
    assert channels.IMU_UNIT.at(unit="third") in rows


def test_a_unit_has_a_name_of_its_own_and_a_grade_that_is_known():
    for units, what in (
        ([reference(name="")], "name"),
        ([reference(name="a/b")], "name"),
        ([reference(), reference()], "two inertial units"),
        ([reference(grade="navigatoin")], "no grade"),
        ([reference(rate="1 Hz")], "rate"),
    ):
        with pytest.raises(ConfigurationError, match=what):
            read_scenario(table(*units))
    with pytest.raises(ConfigurationError, match="imus"):
        read_scenario({**table(), "imus": {"name": "reference"}})


def test_canonical_text_reads_back_equal():
    scenario = read_scenario(table(reference(errors={"gyro_bias": "1 deg/h"})))
    again = read_scenario(tomllib.loads(scenario.to_toml()))
    assert again == dataclasses.replace(scenario, folder=again.folder)
    assert again.units[0].errors.gyro_bias == pytest.approx(4.848e-6, rel=1e-3)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("units") / "two.mcap"
    write_log(read_scenario(table(reference())), path)
    return path


def job_of(log: Path, **imu: Any) -> tuple[Job, list[str]]:
    with LogReader(log) as reader:
        return make_job(reader, "gnss-ins-lc", tables=[{"imu": imu}]), list(reader.channels)


def test_a_pipeline_reads_the_unit_that_is_chosen_with_settings_that_fit_it(log):
    for name, topic in (("", channels.IMU.topic), ("reference", REFERENCE)):
        job, topics = job_of(log, name=name)
        stages = find_pipeline("gnss-ins-lc").stages(job.config, topics)
        units = {channels.IMU_UNIT.name: name}
        node = bind(stages, dict.fromkeys(topics, 0), run="run", receivers=units)[-1]
        assert node.inputs[channels.IMU.name] == topic
    usual, chosen = job_of(log)[0].config, job_of(log, name="reference")[0].config
    # 0.004 deg/s/sqrt(Hz) against 0.002 deg/sqrt(h)
    ratio = usual.filter.gyro_noise[0] / chosen.filter.gyro_noise[0]
    assert ratio == pytest.approx(0.004 / (0.002 / 60.0))
    assert usual.gnss == chosen.gnss


def test_a_unit_that_the_log_lacks_is_told(log):
    job, topics = job_of(log, name="other")
    stages = find_pipeline("gnss-ins-lc").stages(job.config, topics)
    units = {channels.IMU_UNIT.name: "other"}
    with pytest.raises(MissingChannelError, match=r"/imu/\{unit\}/raw"):
        bind(stages, dict.fromkeys(topics, 0), run="run", receivers=units)
