"""Positions of a log that brings satellites and corrections of its own, and what runs on them."""

from __future__ import annotations

import numpy as np
import pymap3d
import pytest

from replay import channels
from replay.engine.job import make_job
from replay.engine.pipelines import find_pipeline
from replay.engine.run import replay_log
from replay.evaluate import evaluate_run
from replay.importers import import_log
from replay.log.reader import LogReader
from replay.schemas import filter_pb2
from replay.stages.coarse import CoarsePositions
from tests.conftest import ROOT
from tests.simulate.observing import NO_AIR, C, base, make
from tests.stages.gnss_chain import (
    COARSE,
    OBS,
    PROBLEMS,
    inputs_of,
    run,
    spp_config,
    times_of,
    with_sights,
)

TOKYO = "tokyo-car-2020-310"
CONFIG = spp_config(
    {
        "gnss": {"signals": ["G1C"]},
        "atmosphere": {"shapiro": False, "ionosphere": "none", "troposphere": "none"},
    }
)
PLACE = np.array(pymap3d.geodetic2ecef(30.5, 114.3, 25.0))
BIAS_S = 2e-4


@pytest.fixture(scope="module")
def corrected():
    """Half a minute at rest without an error; two satellites alone from 10 to 15 s."""
    made = make(base("rover", signals=["G1C"], clock={"bias": BIAS_S}), sky=NO_AIR)
    inputs = with_sights(inputs_of(made.rows), CONFIG)
    del inputs[COARSE]
    observations = inputs[OBS]
    seconds = (observations.valid_time_ns - observations.valid_time_ns.min()) * 1e-9
    few = np.unique(observations["satellite"])[:2]
    keep = (seconds < 9.5) | (seconds > 15.5) | np.isin(observations["satellite"], few)
    return {**inputs, OBS: observations.take(np.flatnonzero(keep))}


def test_each_epoch_stands_where_its_ranges_say(corrected):
    found = run(CoarsePositions(), CONFIG, corrected).outputs
    coarse = found[COARSE]
    times = times_of(corrected[OBS])
    assert np.array_equal(coarse.valid_time_ns, times)
    # The receiver's rounding of ranges is a millimetre.
    np.testing.assert_allclose(
        coarse["position_ecef_m"], np.tile(PLACE, (len(times), 1)), atol=0.02
    )
    np.testing.assert_allclose(coarse["clock_offset_m"], C * BIAS_S, atol=0.02)
    seconds = (times - times[0]) * 1e-9
    alone = (seconds > 9.5) & (seconds < 15.5)
    assert not coarse["age_s"][~alone].any()
    # Where two satellites are too few the last position serves, and its age is told.
    np.testing.assert_allclose(coarse["age_s"][alone], seconds[alone] - 9.0, atol=1e-9)
    assert not coarse["satellite_count"][alone].any()
    assert coarse["satellite_count"][~alone].min() >= 5
    assert set(found[PROBLEMS]["kind"]) == {filter_pb2.EVENT_KIND_TOO_FEW_SATELLITES}
    assert len(found[PROBLEMS]) == alone.sum() == 6


def test_cuts_and_dumps_change_no_byte(corrected):
    whole = run(CoarsePositions(), CONFIG, corrected)
    edges = times_of(corrected[OBS])[[0, 4, 11, 12, 20]].tolist()
    for dump_at in (None, 2, 4):
        pieces = run(CoarsePositions(), CONFIG, corrected, edges, dump_at=dump_at)
        assert pieces.bytes() == whole.bytes()


@pytest.mark.parametrize("name", ["ppp", "ppp-ins-tc", "kfspp"])
def test_the_stage_stands_in_where_a_log_brings_its_own_orbits(name):
    pipeline = find_pipeline(name)
    config = pipeline.config()
    own = [
        channel.at(receiver="rover")
        for channel in (channels.GNSS_OBS, channels.SATELLITES, channels.CORRECTIONS)
    ]

    def first(topics):
        return pipeline.stages(config, topics)[0].spec.name

    assert first(own) == "coarse"
    usual = first(own[:1])
    assert usual != "coarse"
    assert first([*own, channels.COARSE.at(receiver="rover")]) == usual


@pytest.mark.heavy
def test_a_car_with_codes_and_doppler_alone(shared_data, tmp_path):
    """No phases: no ambiguities; the delays are held to what the author has corrected."""
    log, target = tmp_path / "in.mcap", tmp_path / "run.mcap"
    import_log(ROOT / "recordings" / "specs" / f"{TOKYO}.toml", shared_data / TOKYO, log)
    with LogReader(log) as reader:
        replay_log(reader, target, make_job(reader, "ppp-ins-tc", tables=[]))
    with LogReader(target) as reader:
        assert len(reader.read("/filter/ppp-ins-tc/phases")) == 0
        wet = reader.read("/filter/ppp-ins-tc/troposphere")["wet_std_m"]
        assert wet.max() < 0.02
    horizontal = evaluate_run(target).position_error_m["horizontal"]
    assert horizontal.rms < 3.2
