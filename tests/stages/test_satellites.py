"""Orbits, clocks and corrections: what is left of a range is the receiver's clock."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pymap3d
import pytest

from replay import channels
from replay.kernels import meteorology, sights
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.kernels.gnss_records import GALILEO, GPS
from replay.log.columns import Columns
from replay.schemas import filter_pb2
from replay.stages.satellites import Satellites
from tests.simulate.observing import DRIVE, START_NS, C, base, make, receiver
from tests.stages.gnss_chain import (
    COARSE,
    CORRECTIONS,
    IONOSPHERE,
    NAV,
    OBS,
    PROBLEMS,
    SATELLITES,
    TERMS,
    edited,
    inputs_of,
    keyed,
    run,
    satellites,
    spp_config,
    times_of,
)

MM = 1e-3
SECOND = 1_000_000_000
CLOCK = {"bias": "0.2 ms", "drift": "0.3 ppm", "walk": 1e-10, "reported": True}
PLAIN = {"atmosphere": {"shapiro": False}}


@functools.cache
def driven():
    """A drive of 34 s without an error but the receiver's clock."""
    made = make(receiver(clock=CLOCK), segments=DRIVE)
    return made, inputs_of(made.rows)


def modelled(corrections, *extra):
    """Sum of all terms by time, satellite and signal, m."""
    parts = [keyed(corrections, name) for name in (*TERMS, *extra)]
    return {key: sum(part[key] for part in parts) for key in parts[0]}


@pytest.mark.parametrize("shapiro", [False, True])
def test_a_range_less_its_model_is_the_receivers_clock(shapiro):
    made = make(base(clock=CLOCK), sky={"shapiro": shapiro})
    inputs = inputs_of(made.rows, "base")
    found = satellites(inputs, {"atmosphere": {"shapiro": shapiro}})
    model = modelled(found[CORRECTIONS], *(["shapiro_m"] if shapiro else []))
    away = ranges_from(made.rows[channels.RECEIVER.at(receiver="base")], found)
    code = keyed(inputs[OBS], "pseudorange_m")
    epochs = made.epochs("base")
    clocks = dict(zip(epochs.valid_time_ns.tolist(), C * epochs["clock_offset_s"], strict=True))
    assert model.keys() == code.keys()
    assert {key[2] for key in model} == {b"1C", b"2W", b"7Q", b"2I", b"6I"}
    left = np.array([code[key] - model[key] - away[key[:2]] - clocks[key[0]] for key in model])
    assert np.abs(left).max() < 0.3 * MM


def ranges_from(info, found):
    """Range from the true place less that from the coarse one, by time and satellite, m."""
    truth = info["approximate_position_ecef_m"][0]
    coarse = found[COARSE]
    place = dict(zip(coarse.valid_time_ns.tolist(), coarse["position_ecef_m"], strict=True))
    seen = found[SATELLITES]
    return {
        (t, name): np.linalg.norm(at - truth) - np.linalg.norm(at - place[t])
        for t, name, at in zip(
            seen.valid_time_ns.tolist(),
            seen["satellite"].tolist(),
            seen["position_ecef_m"],
            strict=True,
        )
    }


def test_the_terms_are_about_the_coarse_position():
    """Distance and Sagnac's effect are those of the sights and the position that are written."""
    _, inputs = driven()
    found = satellites(inputs, PLAIN)
    sagnac = keyed(found[CORRECTIONS], "sagnac_m")
    distance = keyed(found[CORRECTIONS], "distance_m")
    place = dict(
        zip(found[COARSE].valid_time_ns.tolist(), found[COARSE]["position_ecef_m"], strict=True)
    )
    seen = found[SATELLITES]
    for row in range(0, len(seen), 7):
        time_ns, name = int(seen.valid_time_ns[row]), seen["satellite"][row]
        key = next(k for k in distance if k[0] == time_ns and k[1] == name)
        expected = np.linalg.norm(seen["position_ecef_m"][row] - place[time_ns])
        assert distance[key] + sagnac[key] == pytest.approx(expected, abs=2 * MM)


def test_the_coarse_position_is_the_truth_to_centimetres_without_errors():
    """Its troposphere is that of the place before, tens of metres away."""
    made = make(base(clock=CLOCK))
    coarse = satellites(inputs_of(made.rows, "base"), PLAIN)[COARSE]
    epochs = made.epochs("base")
    assert coarse.valid_time_ns.tolist() == epochs.valid_time_ns.tolist()
    assert coarse["clock_offset_m"] == pytest.approx(C * epochs["clock_offset_s"], abs=0.05)
    truth = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    assert np.linalg.norm(coarse["position_ecef_m"] - truth, axis=1).max() < 0.05
    assert (coarse["age_s"] == 0.0).all()


def test_velocity_and_drift_are_derivatives():
    """Of what the next epochs say, turned back for the Earth's turning."""
    _, inputs = driven()
    seen = satellites(inputs, PLAIN)[SATELLITES]
    times = times_of(seen)
    for name in sorted(set(seen["satellite"].tolist()))[::4]:
        rows = np.flatnonzero(seen["satellite"] == name)
        if len(rows) < len(times):
            continue
        for field, rate, limit in (
            ("position_ecef_m", "velocity_ecef_m_s", 0.02),
            ("clock_s", "clock_drift_s_s", 1e-15),
        ):
            # Epochs are 1 s apart in the receiver's time; transmission moves by up to 3 ppm.
            middle = (seen[field][rows[2:]] - seen[field][rows[:-2]]) / 2.0
            assert np.abs(middle - seen[rate][rows[1:-1]]).max() < limit


# --- choice of message


def message(toe_s, *, sent_s=None, health=0, source=0):
    record = np.zeros(1, dtype=EPHEMERIS_DTYPE)
    record["toe_ns"] = START_NS + round(toe_s * SECOND)
    record["transmitted_ns"] = START_NS + round((toe_s if sent_s is None else sent_s) * SECOND)
    record["health"] = health
    record["source"] = source
    return record


def choose(messages, *, at_s=0.0, known_s=None, system=GPS, max_age=7200.0, **keys):
    """Number of the message that is chosen."""
    cfg = np.zeros(1, dtype=sights.SIGHTS_CONFIG_DTYPE)
    cfg["max_age"] = max_age
    for name, value in keys.items():
        cfg[name] = value
    known = [-1e6] * len(messages) if known_s is None else known_s
    available = np.array([START_NS + round(s * SECOND) for s in known], dtype=np.int64)
    t = START_NS + round(at_s * SECOND)
    table = np.concatenate(messages)
    return sights.choose_message(table, available, 0, len(table), t, t, system, cfg[0])


def test_the_nearest_message_is_chosen():
    messages = [message(-7200), message(0), message(7200)]
    assert [choose(messages, at_s=s) for s in (-4000, -3000, 3000, 4000)] == [0, 1, 1, 2]
    # Of two that are equally near, the one that came last.
    assert choose(messages, at_s=3600) == 2
    assert choose([message(0), message(0)]) == 1


def test_the_latest_message_is_chosen_where_that_is_asked_for():
    messages = [message(7200, sent_s=-300), message(3600, sent_s=-200), message(0, sent_s=50)]
    assert choose(messages, latest=1) == 1  # what is sent at 50 s is later than the epoch
    assert choose(messages, at_s=100, latest=1) == 2
    assert choose(messages) == 2


def test_a_message_is_used_up_to_its_age():
    messages = [message(0)]
    assert choose(messages, at_s=7200) == 0
    assert choose(messages, at_s=-7200) == 0
    assert choose(messages, at_s=7200.001) == -1
    assert choose(messages, at_s=-7200.001) == -1


def test_an_unhealthy_satellite_is_not_used():
    messages = [message(-3600), message(0, health=1)]
    assert choose(messages) == 0
    assert choose(messages[1:]) == -1
    assert choose(messages, unhealthy=1) == 1


def test_inav_comes_before_fnav_or_behind():
    inav, fnav = 1 + 4 + 512, 2 + 256
    messages = [message(-600, source=inav), message(0, source=fnav)]
    assert choose(messages, system=GALILEO) == 0  # although it is older
    assert choose(messages, system=GALILEO, fnav=1) == 1
    # Where there is but the other, it serves.
    assert choose(messages[1:], system=GALILEO) == 0
    assert choose(messages[:1], system=GALILEO, fnav=1) == 0


def test_a_message_is_not_known_before_its_log_time():
    messages = [message(-7200), message(0)]
    assert choose(messages, known_s=[-1000, 0.001]) == 0
    assert choose(messages, known_s=[-1000, 0.0]) == 1
    assert choose(messages, known_s=[1.0, 1.0]) == -1


# --- what happens over time


def without(observations: Columns, begin_s: float, end_s: float, keep: int) -> Columns:
    """Observations of which few satellites are left for a while."""
    elapsed = (observations.valid_time_ns - START_NS) / 1e9
    names = sorted(set(observations["satellite"].tolist()))[:keep]
    inside = (elapsed >= begin_s - 0.5) & (elapsed < end_s - 0.5)
    return observations.take(~inside | np.isin(observations["satellite"], names))


def test_an_old_position_serves_for_a_while():
    _, inputs = driven()
    inputs = {**inputs, OBS: without(inputs[OBS], 10.0, 20.0, 3)}
    found = satellites(inputs, PLAIN)
    ages = dict(zip(found[COARSE].valid_time_ns.tolist(), found[COARSE]["age_s"], strict=True))
    assert len(ages) == len(times_of(inputs[OBS]))
    # Receiver time and the log's differ by the clock's fifth of a millisecond.
    expected = [0.0] * 9 + list(range(1, 11)) + [0.0] * (len(ages) - 19)
    first = round((min(ages) - START_NS) / 1e9)
    assert list(ages.values()) == pytest.approx(expected[first - 1 :], abs=1e-6)
    # The few that are left are still seen, from the old position.
    during = found[SATELLITES].valid_time_ns == sorted(ages)[12 - first]
    assert np.count_nonzero(during) == 3
    assert PROBLEMS not in found


def test_too_old_a_position_does_not_serve():
    _, inputs = driven()
    inputs = {**inputs, OBS: without(inputs[OBS], 10.0, 20.0, 3)}
    found = satellites(inputs, PLAIN, {"antenna": {"coast": "4 s"}})
    events = found[PROBLEMS]
    assert events["kind"].tolist() == [filter_pb2.EVENT_KIND_TOO_FEW_SATELLITES] * 6
    assert events["value"].tolist() == [3.0] * 6
    assert events.ragged("detail").texts()[0] == "3 satellites are too few for a position"
    missing = set(times_of(inputs[OBS]).tolist()) - set(found[COARSE].valid_time_ns.tolist())
    assert missing == set(events.valid_time_ns.tolist())
    assert not missing & set(found[SATELLITES].valid_time_ns.tolist())
    # Afterwards it begins anew, and finds the same place.
    before = satellites(driven()[1], PLAIN)[COARSE]
    assert found[COARSE]["position_ecef_m"][-1] == pytest.approx(
        before["position_ecef_m"][-1], abs=2 * MM
    )


def test_a_satellite_without_a_message_is_told_once():
    _, inputs = driven()
    name = inputs[OBS]["satellite"][0]
    later = inputs[NAV]["satellite"] == name
    # Its message arrives at 10 s.
    log = np.where(later, START_NS + 10 * SECOND, inputs[NAV].log_time_ns)
    nav = dataclasses.replace(inputs[NAV], log_time_ns=log)
    nav = nav.take(np.argsort(log, kind="stable").astype(np.int64))
    found = satellites({**inputs, NAV: nav}, PLAIN)
    assert found[PROBLEMS]["kind"].tolist() == [filter_pb2.EVENT_KIND_NO_EPHEMERIS]
    assert found[PROBLEMS].ragged("detail").texts() == [
        f"{name.decode()}: no usable broadcast message"
    ]
    own = found[SATELLITES].valid_time_ns[found[SATELLITES]["satellite"] == name]
    # Not one epoch before the message, every one from it on.
    times = times_of(inputs[OBS])
    assert own.tolist() == [t for t in times if t >= START_NS + 10 * SECOND]


def test_the_ionosphere_of_the_log_counts_from_its_arrival():
    _, inputs = driven()
    log = inputs[IONOSPHERE].log_time_ns + 10 * SECOND
    late = dataclasses.replace(inputs[IONOSPHERE], log_time_ns=log)
    found = satellites({**inputs, IONOSPHERE: late}, PLAIN)
    usual = keyed(satellites(inputs, PLAIN)[CORRECTIONS], "ionosphere_m")
    delays = keyed(found[CORRECTIONS], "ionosphere_m")
    known = {key: key[0] >= log[0] for key in delays}
    assert 0 < sum(known.values()) < len(known)
    for key, value in delays.items():
        if known[key]:
            assert value == pytest.approx(usual[key], abs=2 * MM)
    # Before, Klobuchar without coefficients: five nanoseconds in the zenith.
    zenith = [delays[key] for key in delays if not known[key] and key[2] == b"1C"]
    assert min(zenith) > 5e-9 * C
    assert max(zenith) < 5e-9 * C * 3.5


def test_outlying_ranges_do_not_move_the_coarse_position():
    """Four clocks of a millisecond, 300 km each, among some twenty satellites."""
    _, inputs = driven()
    bad = np.isin(inputs[OBS]["satellite"], sorted(set(inputs[OBS]["satellite"].tolist()))[::5][:4])
    code = inputs[OBS]["pseudorange_m"] + np.where(bad, 1e-3 * C, 0.0)
    found = satellites({**inputs, OBS: edited(inputs[OBS], pseudorange_m=code)}, PLAIN)
    usual = satellites(inputs, PLAIN)[COARSE]
    assert len(set(inputs[OBS]["satellite"][bad].tolist())) == 4
    moved = found[COARSE]["position_ecef_m"] - usual["position_ecef_m"]
    assert np.abs(moved).max() < 5 * MM


def test_a_delay_that_no_message_tells_is_not_modelled():
    """BeiDou B2b: the position is there all the same, and the term is zero."""
    made = make(receiver(signals=["C7D"]), segments=DRIVE)
    found = satellites(inputs_of(made.rows), PLAIN, {"gnss": {"signals": ["C7D"]}})
    assert (found[CORRECTIONS]["group_delay_m"] == 0.0).all()
    assert (found[COARSE]["satellite_count"] >= 4).all()


@pytest.mark.parametrize("kind", ["each row", "random", "after a message"])
def test_blocks_change_nothing(kind):
    _, inputs = driven()
    inputs = {**inputs, OBS: without(inputs[OBS], 10.0, 20.0, 3)}
    config = spp_config(PLAIN, {"antenna": {"coast": "4 s"}})
    whole = run(Satellites(), config, inputs)
    times = np.unique(np.concatenate([c.log_time_ns for c in inputs.values()]))
    edges = {
        "each row": times,
        "random": times[np.random.default_rng(1).random(len(times)) < 0.2],
        "after a message": inputs[NAV].log_time_ns,
    }[kind]
    for dump_at in (None, 1, len(edges) // 2):
        cut_up = run(Satellites(), config, inputs, edges, dump_at=dump_at)
        assert cut_up.bytes() == whole.bytes()


@pytest.mark.parametrize("model", ["mops", "gpt"])
def test_meteorology_is_that_of_the_settings(model):
    """Zenith delays of the coarse place and the day, mapped by Niell's functions."""
    _, inputs = driven()
    found = satellites(inputs, PLAIN, {"atmosphere": {"meteorology": model, "humidity": 0.5}})
    told, coarse = found[CORRECTIONS], found[COARSE]
    lat, lon, height = pymap3d.ecef2geodetic(*coarse["position_ecef_m"][5])
    place = (np.radians(lat), np.radians(lon), height)
    if model == "mops":
        dry, wet = meteorology.mops_zenith(place[0], height, 335.25)  # 30 November 2020, 6 h
    else:
        dry, wet = meteorology.gpt_zenith(*place, 59183.0, 0.5)
    now = told.valid_time_ns == coarse.valid_time_ns[5]
    zenith = told["hydrostatic_m"][now] / told["hydrostatic_mapping"][now]
    np.testing.assert_allclose(zenith, dry, rtol=1e-6)
    np.testing.assert_allclose(told["wet_m"][now] / told["wet_mapping"][now], wet, rtol=1e-4)
