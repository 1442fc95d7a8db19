"""GLONASS of a simulation: its orbits, messages and channels, and what the stages make of them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from replay import channels, time
from replay.gnss.ephemerides import ephemeris_records
from replay.kernels import glonass as motion
from replay.kernels import orbits
from replay.simulate import glonass
from replay.simulate.constellation import constellation, messages, refer, sends
from tests.simulate.observing import NO_AIR, START_NS, C, base, make, series, signals_of
from tests.stages.gnss_chain import CORRECTIONS, OBS, SATELLITES, inputs_of, keyed, satellites

MONDAY = time.parse_calendar("2020-11-30T06:00:00")
EARTH = np.array([0.0, 0.0, 7.292115e-5])
MM = 1e-3


def state(record, time_ns):
    out = np.zeros(8)
    orbits.satellite_state(record, int(time_ns), 0.0, out)
    return out


def test_consecutive_messages_are_one_orbit():
    for satellite in constellation("R", 7, MONDAY):
        times = glonass.reference_times(satellite, MONDAY, MONDAY + 6 * 3600 * 10**9)
        assert len(times) >= 13
        near = [refer(satellite, t) for t in times]
        for before, after in itertools.pairwise(near):
            at = (int(before["toe_ns"]) + int(after["toe_ns"])) // 2
            a, b = state(before, at), state(after, at)
            # Forward and backward integration over a quarter of an hour each.
            np.testing.assert_allclose(a[:3], b[:3], atol=MM)
            assert a[6] == pytest.approx(b[6], abs=1e-15)


def test_slots_are_three_planes_of_eight():
    table = constellation("R", 7, MONDAY)
    assert table["prn"].tolist() == list(range(1, 25))
    r = table["position_m"]
    v = table["velocity_m_s"] + np.cross(EARTH, r)
    np.testing.assert_allclose(np.linalg.norm(r, axis=1), 25_508e3, atol=2e3)
    # Circular, and round in 11 h 15 min 44 s.
    np.testing.assert_allclose(np.sum(r * v, axis=1), 0.0, atol=1.0)
    rate = np.linalg.norm(np.cross(r, v), axis=1) / np.sum(r * r, axis=1)
    np.testing.assert_allclose(2.0 * math.pi / rate, 40_544.0, rtol=1e-9)
    normal = np.cross(r, v)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    np.testing.assert_allclose(np.degrees(np.arccos(normal[:, 2])), 64.8, atol=1e-9)
    apart = normal @ normal.T
    for i, j in itertools.combinations(range(24), 2):
        if i // 8 == j // 8:
            assert apart[i, j] == pytest.approx(1.0, abs=1e-12)
            angle = math.degrees(math.acos(np.clip(r[i] @ r[j] / (25_508e3) ** 2, -1, 1)))
            assert angle % 45.0 == pytest.approx(0.0, abs=0.2) or angle % 45.0 > 44.8
        else:
            assert apart[i, j] < 0.0


def test_opposite_satellites_share_a_channel():
    for plane, place in itertools.product(range(3), range(4)):
        slot = 8 * plane + place
        assert glonass.CHANNELS[slot] == glonass.CHANNELS[slot + 4]
    assert set(glonass.CHANNELS) <= set(range(-7, 7))
    one = constellation("R", 7, MONDAY)[0]
    assert sends(one, "1C") and sends(one, "2P") and not sends(one, "3I")


def test_messages_are_for_the_half_hour_about_a_quarter():
    end = MONDAY + 2 * 3600 * 10**9
    rows = messages(constellation("GR", 7, MONDAY), MONDAY, end)
    own = rows["satellite"] == b"R05"
    utc = rows["toe_ns"][own] // 10**9 - 18
    assert (utc % 1800 == 900).all()
    assert (rows["toe_s"][own] == utc % 604_800).all()
    assert (rows["iode"][own] == (utc + 10_800) % 86_400 // 900).all()
    sent = rows["transmitted_ns"][own]
    assert (rows["toe_ns"][own] - sent == 900 * 10**9).all()
    assert sent[0] <= MONDAY < sent[1] and sent[-1] <= end < sent[-1] + 1800 * 10**9
    glonass_rows = rows["satellite"].astype("U1") == "R"
    np.testing.assert_array_equal(rows.is_present("position_m"), glonass_rows)
    np.testing.assert_array_equal(rows.is_present("sqrt_a"), ~glonass_rows)
    assert len(ephemeris_records(rows)) == len(rows)


def test_true_orbits_are_off_by_the_deviation_asked_for():
    draws = np.random.default_rng(5)
    errors = []
    for satellite in constellation("R", 7, MONDAY):
        times = glonass.reference_times(satellite, MONDAY, MONDAY + 3 * 3600 * 10**9)
        near = np.array([refer(satellite, t) for t in times], dtype=satellite.dtype)
        for _ in range(4):
            draw = draws.standard_normal(4)
            true = glonass.perturb(near, 2.0, np.full(len(near), 1.5), draw)
            # One orbit still: what a message says half an hour on is what the next one says.
            for k in (0, len(near) - 2):
                a, b = (state(true[k + i], int(near[k + 1]["toe_ns"])) for i in (0, 1))
                away = a[:3] - b[:3]
                plain = state(near[k], int(near[k + 1]["toe_ns"]))[:3] - near[k + 1]["position_m"]
                assert np.abs(away - plain).max() < 1.0
            for one, other in ((near[0], true[0]), (near[-1], true[-1])):
                r = one["position_m"]
                v = one["velocity_m_s"] + np.cross(EARTH, r)
                radial = r / np.linalg.norm(r)
                cross = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
                off = other["position_m"] - r
                errors.append([off @ radial, off @ np.cross(cross, radial), off @ cross])
            assert C * (true["af0"] - near["af0"])[0] == pytest.approx(1.5, abs=1e-6)
    radial, along, across = np.sqrt(np.mean(np.square(errors), axis=0))
    assert radial == pytest.approx(2.0 / 3.0, rel=0.25)
    assert along == pytest.approx(2.0, rel=0.25)
    assert across == pytest.approx(2.0, rel=0.35)


def test_frequencies_are_those_of_the_channel():
    made = make(base(signals=["R1C", "R2P"]), sky={"systems": "R", **NO_AIR})
    columns = made.observations("base")
    told = {(a[1], a[2]): a[5] for a in made.arcs}
    nav = made.rows[channels.NAV.topic]
    number = dict(zip(nav["satellite"].tolist(), nav["frequency_channel"].tolist(), strict=True))
    hidden = {}
    for satellite, signal in signals_of(columns):
        one = series(columns, satellite, signal)
        k = number[satellite.encode()]
        hz = 1602e6 + k * 562.5e3 if signal == "1C" else 1246e6 + k * 437.5e3
        phase = (one["carrier_phase_cycles"] - told[satellite, signal]) * C / hz
        delay = one["pseudorange_m"] - phase
        assert np.ptp(delay) < 1e-6
        hidden[satellite, signal] = delay[0]
        own = columns["satellite"] == satellite.encode()
        assert (columns["glonass_channel"][own] == k).all()
    assert len(hidden) > 8
    # The message tells no delay for the first band: there is none in it.
    assert all(abs(d) < 1e-6 for (_, signal), d in hidden.items() if signal == "1C")


def test_the_stage_computes_the_same_orbits():
    """Across the change of a message; range less model is the receiver's clock."""
    clock = {"bias": "0.2 ms", "drift": "0.1 ppm", "reported": True}
    keys = {"time": "2020-11-30T06:13:00"}
    made = make(
        base(clock=clock, rate=0.1, signals=["G1C", "R1C"]),
        sky={"systems": "GR", **NO_AIR},
        start={**keys, "latitude": "30.5 deg", "longitude": "114.3 deg", "height": "25 m"},
        segments=[{"kind": "hold", "duration": 1200.0}],
        imu={"rate": 10.0},
        truth={"rate": 1.0, "signals": True},
    )
    inputs = inputs_of(made.rows, "base")
    options = {"ionosphere": "none", "troposphere": "none", "shapiro": False}
    found = satellites(inputs, {"atmosphere": options, "gnss": {"signals": ["G1C", "R1C"]}})
    truth = made.rows[channels.SIGNAL_TRUTH.at(receiver="base")]
    place = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    rows = found[SATELLITES]
    seen = zip(
        rows.valid_time_ns.tolist(), rows["satellite"].tolist(), rows["position_ecef_m"],
        rows["clock_s"], strict=True,
    )  # fmt: skip
    true_range, true_clock = keyed(truth, "range_m"), keyed(truth, "satellite_clock_m")
    checked = 0
    for at, name, position, offset in seen:
        key = (at, name, b"1C")
        if name[:1] == b"R":
            assert np.linalg.norm(position - place) == pytest.approx(true_range[key], abs=MM)
            assert C * offset == pytest.approx(true_clock[key], abs=1e-5)
            checked += 1
    assert checked > 500
    assert found[CORRECTIONS] is not None and len(inputs[OBS])
    assert len(set(made.rows[channels.NAV.topic]["toe_ns"].tolist())) > 2
    glonass_rows = np.char.startswith(truth["satellite"].astype("U3"), "R")
    assert np.abs(truth["orbit_error_m"][glonass_rows]).max() < MM


def test_the_lunisolar_term_is_carried():
    one = constellation("R", 7, START_NS)[3]
    moved, free = np.zeros(6), np.zeros(6)
    motion.integrate(one, 600.0, moved)
    still = one.copy()
    still["acceleration_m_s2"] = 0.0
    motion.integrate(still, 600.0, free)
    pushed = np.linalg.norm(moved[:3] - free[:3])
    assert pushed == pytest.approx(
        0.5 * np.linalg.norm(one["acceleration_m_s2"]) * 600.0**2, rel=0.02
    )
