"""Orbits out of a log of broadcast messages: one orbit from several, and what is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from replay import channels
from replay.errors import ConfigurationError
from replay.importers import import_log
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.kernels.true_orbit import between_messages, true_state
from replay.log.writer import LogWriter
from replay.simulate import load_scenario
from replay.simulate.constellation import constellation, refer
from replay.simulate.glonass import CHANNELS
from replay.simulate.trajectory import ecef_of
from replay.simulate.write import make_all
from tests.simulate.observing import NO_AIR, START, START_NS, C, base, make, series, signals_of

HOUR_NS = 3600 * 10**9
LONG = [{"kind": "hold", "duration": 2700.0}]
SLOW = {"imu": {"rate": 10.0}, "truth": {"rate": 1.0, "signals": True}}


def sky_log(path, columns):
    """A log with a channel of broadcast orbits alone."""
    with LogWriter(path) as writer:
        writer.add_channel(channels.NAV.topic, channels.NAV.message)
        writer.write({channels.NAV.topic: columns})
    return str(path)


def observed(sky, **keys):
    systems = sky.get("systems", "GREC")
    signals = [name for name in ("G1C", "R1C", "E1C", "C2I") if name[0] in systems]
    one = base(rate=0.1, signals=signals, **keys)
    return make(one, sky={"systems": "GREC", **NO_AIR, **sky}, segments=LONG, **SLOW)


def test_messages_of_one_orbit_give_that_orbit(tmp_path):
    """The built-in sky, and the same from the messages that it broadcasts."""
    built_in = observed({})
    again = observed(
        {"navigation": sky_log(tmp_path / "sky.mcap", built_in.rows[channels.NAV.topic])}
    )
    a, b = built_in.observations("base"), again.observations("base")
    assert signals_of(a) == signals_of(b)
    assert {name[0] for name, _ in signals_of(a)} == set("GREC")
    for satellite, signal in signals_of(a):
        one, other = series(a, satellite, signal), series(b, satellite, signal)
        np.testing.assert_array_equal(one["time"], other["time"])
        np.testing.assert_allclose(one["pseudorange_m"], other["pseudorange_m"], atol=1e-3)
        np.testing.assert_allclose(one["doppler_hz"], other["doppler_hz"], atol=1e-4)
    truth = again.rows[channels.SIGNAL_TRUTH.at(receiver="base")]
    assert np.abs(truth["orbit_error_m"]).max() < 1e-3


def test_between_messages_that_disagree_the_truth_goes_over_smoothly(tmp_path):
    nav = observed({}).rows[channels.NAV.topic]
    # Every second message of Galileo says that the clock is 10 m ahead.
    number = (nav["toe_ns"] // (1800 * 10**9)) % 2
    ahead = (nav["satellite"].astype("U1") == "E") & (number == 1)
    values = {**nav.values, "af0": nav["af0"] + np.where(ahead, 10.0 / C, 0.0)}
    changed = dataclasses.replace(nav, values=values)
    made = observed({"systems": "E", "navigation": sky_log(tmp_path / "sky.mcap", changed)})
    truth = made.rows[channels.SIGNAL_TRUTH.at(receiver="base")]
    rows = made.rows[channels.NAV.topic]
    toes = np.unique(rows["toe_ns"])
    seen = 0
    for at, logged, error in zip(
        truth.valid_time_ns, truth.log_time_ns, truth["orbit_error_m"], strict=True
    ):
        before = toes[toes <= at]
        if not len(before) or before[-1] == toes[-1]:
            continue
        i = len(before) - 1
        f = (at - toes[i]) / (toes[i + 1] - toes[i])
        share = f * f * (3.0 - 2.0 * f)
        parity = (toes // (1800 * 10**9)) % 2
        true = 10.0 * ((1.0 - share) * parity[i] + share * parity[i + 1])
        known = np.unique(rows["toe_ns"][rows.log_time_ns <= logged])
        nearest = known[np.argmin(np.abs(known - at))]
        if np.count_nonzero(np.abs(known - at) == abs(nearest - at)) > 1:
            continue
        told = 10.0 * ((nearest // (1800 * 10**9)) % 2)
        # The clock comes off the range.
        assert error == pytest.approx(told - true, abs=1e-3)
        seen += 1
    assert seen > 200
    assert np.ptp(truth["orbit_error_m"]) > 4.0


def test_the_share_and_its_rate():
    table = np.zeros(3, dtype=EPHEMERIS_DTYPE)
    table["toe_ns"] = [0, 2 * HOUR_NS, 12 * HOUR_NS]
    number, share, rate = between_messages(table, HOUR_NS // 2, 0.0, 7200.0)
    assert (number, share) == (0, pytest.approx(5.0 / 32.0))
    assert rate == pytest.approx(9.0 / 8.0 / 7200.0)
    for hours, expected in ((-1, 0), (-3, -1), (3, 1), (7, -1), (11, 2), (13, 2), (15, -1)):
        found = between_messages(table, hours * HOUR_NS, 0.0, 7200.0)
        assert found == (expected, 0.0, 0.0)


def test_velocity_and_drift_are_slopes_of_position_and_clock():
    satellite = constellation("G", 3, START_NS)[5]
    first = START_NS // 10**9 * 10**9
    table = np.array([refer(satellite, first), refer(satellite, first + 2 * HOUR_NS)])
    table["m0"][1] += 2e-6  # 50 m along the track
    table["af0"][1] += 1e-7
    place = np.array(ecef_of(0.5, 2.0, 0.0))
    states = np.zeros((3, 8))
    for row, offset in enumerate((-1.0, 0.0, 1.0)):
        true_state(table, first + HOUR_NS, offset, 1e9, *place, states[row], np.zeros(8))
    # A second of reception is one of transmission but for the range rate.
    slope = (states[2] - states[0]) / 2.0
    sent = 1.0 - (np.linalg.norm(states[2, :3] - place) - np.linalg.norm(states[0, :3] - place)) / (
        2.0 * C
    )
    turning = np.cross([0, 0, 7.292115e-5], states[1, :3]) * (sent - 1.0)
    np.testing.assert_allclose(slope[:3], states[1, 3:6] * sent + turning, atol=1e-3)
    assert slope[6] == pytest.approx(states[1, 7], abs=1e-14)


def test_the_file_is_looked_for_beside_the_scenario(tmp_path):
    sky_log(tmp_path / "sky.mcap", observed({}).rows[channels.NAV.topic])
    text = f"""
    [start]
    time = "{START}"
    latitude = "30.5 deg"
    [sky]
    systems = "G"
    navigation = "sky.mcap"
    [[receivers]]
    name = "rover"
    signals = ["G1C"]
    [[segments]]
    kind = "hold"
    duration = 5.0
    """
    (tmp_path / "scenario.toml").write_text(text)
    scenario = load_scenario(tmp_path / "scenario.toml")
    assert str(tmp_path) not in scenario.to_toml()
    rows, _ = make_all(scenario)
    assert len(rows[channels.GNSS_OBS.at(receiver="rover")])


@pytest.mark.parametrize(
    ("name", "start", "what"),
    [("nothing.mcap", START, "sky.navigation"), ("sky.mcap", "2021-03-01T00:00:00", "no healthy")],
)
def test_a_log_without_the_messages_is_refused(tmp_path, name, start, what):
    sky_log(tmp_path / "sky.mcap", observed({}).rows[channels.NAV.topic])
    with pytest.raises(ConfigurationError, match=what):
        make(
            base(),
            start={"time": start, "latitude": "30.5 deg"},
            sky={"navigation": str(tmp_path / name)},
        )


NAVIGATION_OF_ESBC = """
title = "Messages that a station in Esbjerg received"
origin = "https://github.com/nav-solutions/data"
licence = "MPL-2.0"
[sources.nav]
file = "ESBC00DNK_R_20201770000_01D_MN.rnx.gz"
format = "rinex-nav"
[streams.nav]
source = "nav"
"""


def test_a_real_navigation_file_gives_a_real_sky(shared_data, tmp_path):
    """What a receiver computes of it is off by decimetres, as real messages differ."""
    spec, log = tmp_path / "nav.toml", tmp_path / "nav.mcap"
    spec.write_text(NAVIGATION_OF_ESBC)
    import_log(spec, shared_data / "ppp-esbc-2020-177", log)
    esbjerg = {"latitude": "55.5 deg", "longitude": "8.4 deg"}
    made = make(
        {**base(rate=0.1, signals=["G1C", "R1C", "E1C", "C2I"]), **esbjerg},
        start={"time": "2020-06-25T06:00:00", **esbjerg},
        sky={"systems": "GREC", "navigation": str(log), **NO_AIR},
        segments=[{"kind": "hold", "duration": 7200.0}],
        **SLOW,
    )
    truth = made.rows[channels.SIGNAL_TRUTH.at(receiver="base")]
    system = truth["satellite"].astype("U1")
    for letter, least, largest_m in (("G", 9, 3.0), ("R", 7, 5.0), ("E", 7, 1.5), ("C", 7, 3.0)):
        own = system == letter
        assert len(set(truth["satellite"][own].tolist())) >= least
        assert 0.01 < np.std(truth["orbit_error_m"][own]) < 1.0
        assert np.abs(truth["orbit_error_m"][own]).max() < largest_m
    # Steps of the phase would be slips: its third differences over ten seconds stay small.
    columns = made.observations("base")
    for satellite, signal in signals_of(columns):
        one = series(columns, satellite, signal)
        if len(one["time"]) > 30:
            kept = np.diff(one["time"], 3) == 0
            steps = np.diff(one["carrier_phase_cycles"], 3)[kept]
            assert np.abs(steps).max() < 0.5, satellite
    # The channels of the built-in slots are those of 2020.
    nav = made.rows[channels.NAV.topic]
    own = nav["satellite"].astype("U1") == "R"
    slots = nav["satellite"][own].astype("U3").tolist()
    for slot, channel in zip(slots, nav["frequency_channel"][own].tolist(), strict=True):
        assert CHANNELS[int(slot[1:]) - 1] == channel
