"""Single points: the truth without noise, and errors as large as they are said to be with it."""

from __future__ import annotations

import functools

import numpy as np
import pymap3d
import pytest
from scipy.stats import binom, chi2

from replay import channels
from replay.errors import ConfigurationError
from replay.schemas import filter_pb2, solution_pb2
from replay.stages.base import Context
from replay.stages.spp import SinglePoint
from tests.simulate.observing import DRIVE, FREQUENCY, NO_AIR, START_NS, C, base, make, receiver
from tests.stages.gnss_chain import (
    CLOCKS,
    EVENTS,
    GEOMETRY,
    OBS,
    RESIDUALS,
    SATELLITES,
    SOLUTION,
    edited,
    inputs_of,
    run,
    solve,
    spp_config,
    times_of,
    with_sights,
)

MM = 1e-3
CLOCK = {"bias": "0.2 ms", "drift": "0.3 ppm", "walk": 1e-10, "reported": True}
SIGMA = 0.5
RATE_SIGMA = 0.02
NOISE = {"code": SIGMA, "rate": RATE_SIGMA, "weighted": True}
# The weights that the simulated noise has: 1 / sin(E) of its deviation, and nothing else.
FITTING = {
    "atmosphere": {"shapiro": False},
    "spp": {
        "code_sigma": SIGMA,
        "doppler_sigma": RATE_SIGMA,
        "weighting": "sine",
        "system_scale": [1.0],
        "range_std_scale": 0.0,
        "ionosphere_std": 0.0,
        "troposphere_std": 0.0,
        "raim": False,
    },
}
EPOCHS = 400


@functools.cache
def standing(noisy: bool = False, scale: float = 1.0, air: bool = True):
    """A receiver on a pillar; its true place."""
    extra = {"segments": [{"kind": "hold", "duration": float(EPOCHS)}]} if noisy else {}
    made = make(
        base(clock=CLOCK, noise=NOISE if noisy else {}),
        sky={"ionosphere": {"scale": scale}, "troposphere": {"enabled": air}},
        **extra,
    )
    truth = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    return made, inputs_of(made.rows, "base"), truth


def enu_of(positions, truth):
    lat, lon, _ = pymap3d.ecef2geodetic(*truth)
    return np.stack(pymap3d.ecef2enuv(*(positions - truth).T, lat, lon), axis=1)


def full(triangles):
    """Symmetric 3 by 3 matrices of upper triangles (n, 6)."""
    index = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    return triangles[:, index]


def test_without_noise_the_place_is_the_truth():
    made, inputs, truth = standing()
    found = solve(inputs, spp_config({"atmosphere": {"shapiro": False}}))
    solution = found[SOLUTION]
    assert len(solution) == len(times_of(inputs[OBS])) >= 30
    assert (solution["status"] == solution_pb2.SOLUTION_STATUS_SINGLE).all()
    assert np.linalg.norm(solution["position_ecef_m"] - truth, axis=1).max() < 1 * MM
    assert np.abs(solution["velocity_enu_m_s"]).max() < 0.3 * MM
    assert EVENTS not in found
    # Time is true time: the receiver's with its clock taken off.
    epochs = made.epochs("base")
    expected = epochs.valid_time_ns - 1e9 * epochs["clock_offset_s"]
    assert np.abs(solution.valid_time_ns - expected).max() <= 1.0
    for letter in "GEC":
        own = np.array(found[CLOCKS].ragged("system").texts()) == letter
        offset = C * epochs["clock_offset_s"]
        np.testing.assert_allclose(found[CLOCKS]["offset_m"][own], offset, atol=1 * MM)


def test_without_noise_a_drive_is_the_truth():
    made = make(receiver(clock=CLOCK), segments=DRIVE, truth={"rate": 100.0})
    solution = solve(inputs_of(made.rows), spp_config({"atmosphere": {"shapiro": False}}))[SOLUTION]
    truth = made.rows[channels.TRUTH.topic]
    times = truth.valid_time_ns
    # Between rows of truth, 10 ms apart, motion is a parabola.
    k = np.searchsorted(times, solution.valid_time_ns)
    inside = (k > 0) & (k < len(times))
    after, row = k[inside], np.flatnonzero(inside)
    part = (solution.valid_time_ns[row] - times[after - 1]) / (times[after] - times[after - 1])
    speed = truth["velocity_enu_m_s"]
    velocity = speed[after - 1] + part[:, None] * (speed[after] - speed[after - 1])
    np.testing.assert_allclose(solution["velocity_enu_m_s"][row], velocity, atol=1 * MM)
    place = truth["position_ecef_m"]
    line = place[after - 1] + part[:, None] * (place[after] - place[after - 1])
    # A chord of 10 ms at 4 m/s^2 is 0.05 mm off.
    np.testing.assert_allclose(solution["position_ecef_m"][row], line, atol=1 * MM)
    assert len(row) > 25
    assert np.linalg.norm(velocity, axis=1).max() > 14.0


def bounds(freedom, tail=5e-4):
    return chi2.ppf(tail, freedom), chi2.ppf(1.0 - tail, freedom)


@pytest.mark.parametrize("free", [False, True])
def test_errors_are_as_large_as_the_covariance_says(free):
    _, inputs, truth = standing(noisy=True)
    config = spp_config(FITTING, {"spp": {"ionosphere_free": free}})
    found = solve(inputs, config)
    solution = found[SOLUTION]
    errors = enu_of(solution["position_ecef_m"], truth)
    covariance = full(solution["position_covariance_enu_m2"])
    squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariance), errors)
    n = len(solution)
    assert n >= EPOCHS - 5
    low, high = bounds(3 * n)
    assert low < squares.sum() < high
    # Each axis of the velocity, the clock and its drift by themselves.
    low, high = bounds(n)
    for axis in range(3):
        normal = solution["velocity_enu_m_s"][:, axis] / solution["velocity_std_enu_m_s"][:, axis]
        assert low < (normal**2).sum() < high
    residuals = found[RESIDUALS]
    code = residuals["kind"] == filter_pb2.MEASUREMENT_KIND_PSEUDORANGE
    normal = residuals["normalized"][code]
    # Residuals of one epoch hang together: of m satellites m less unknowns are free.
    z, r = residuals["innovation"][code], residuals["measurement_std"][code]
    freedom = int(code.sum()) - 6 * n
    low, high = bounds(freedom)
    assert low < ((z / r) ** 2).sum() < high
    assert np.mean(normal**2) == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / freedom))


def test_the_clocks_deviation_is_that_of_its_error():
    made, inputs, _ = standing(noisy=True)
    found = solve(inputs, spp_config(FITTING))
    epochs = made.epochs("base")
    clocks = found[CLOCKS]
    for letter in "GEC":
        own = np.array(clocks.ragged("system").texts()) == letter
        error = clocks["offset_m"][own] - C * epochs["clock_offset_s"][-own.sum() :]
        low, high = bounds(int(own.sum()))
        assert low < ((error / clocks["offset_std_m"][own]) ** 2).sum() < high


def spoilt(inputs, names, metres):
    code = inputs[OBS]["pseudorange_m"].copy()
    for name, size in zip(names, metres, strict=True):
        code[inputs[OBS]["satellite"] == name] += size
    return {**inputs, OBS: edited(inputs[OBS], pseudorange_m=code)}


def high_satellites(inputs, count):
    """Names of satellites that are seen from 25 degrees on all the time, of several systems."""
    seen = with_sights(inputs, spp_config(FITTING))[SATELLITES]
    epochs = len(times_of(seen))
    names = sorted(set(seen["satellite"].tolist()))
    steady = [
        name
        for name in names
        if (seen["satellite"] == name).sum() == epochs
        and seen["elevation_rad"][seen["satellite"] == name].min() > np.radians(25.0)
    ]
    return steady[:: max(len(steady) // count, 1)][:count]


@pytest.mark.parametrize("sizes", [(50.0,), (50.0, -80.0), (30.0, 45.0, -60.0)])
def test_outliers_are_named_and_left_out(sizes):
    _, inputs, truth = standing(noisy=True)
    names = high_satellites(inputs, len(sizes))
    assert len(names) == len(sizes)
    config = spp_config(FITTING, {"spp": {"raim": True}})
    found = solve(spoilt(inputs, names, sizes), config)
    events = found[EVENTS]
    assert set(events["kind"]) == {filter_pb2.EVENT_KIND_SATELLITE_EXCLUDED}
    told = [text[:3].encode() for text in events.ragged("detail").texts()]
    count = len(times_of(inputs[OBS]))
    for name in names:
        assert told.count(name) == count
    # Good satellites are left out as rarely as the confidence says, roughly.
    assert len(told) - count * len(names) <= binom.ppf(0.9999, count, 0.001) + 1
    clean = solve(inputs, spp_config(FITTING))[SOLUTION]["position_ecef_m"]
    moved = np.linalg.norm(found[SOLUTION]["position_ecef_m"] - truth, axis=1)
    assert moved.max() < 2.0 * np.linalg.norm(clean - truth, axis=1).max()
    # The residual of what was left out is the outlier.
    residuals = found[RESIDUALS]
    for name, size in zip(names, sizes, strict=True):
        own = (residuals["satellite"] == name) & ~residuals["accepted"]
        assert np.median(residuals["innovation"][own]) == pytest.approx(size, abs=1.0)


def test_good_epochs_pass_the_test_as_often_as_it_says():
    _, inputs, _ = standing(noisy=True)
    confidence = 0.95
    # One exclusion at most: then events count the epochs that failed.
    table = {"spp": {"raim": True, "confidence": confidence, "exclusions": 1}}
    found = solve(inputs, spp_config(FITTING, table))
    count = len(times_of(inputs[OBS]))
    failed = len(found[EVENTS]) if EVENTS in found else 0
    assert binom.ppf(5e-4, count, 1 - confidence) <= failed
    assert failed <= binom.ppf(1 - 5e-4, count, 1 - confidence)


def test_robust_weights_hold_an_outlier_down():
    _, inputs, truth = standing(noisy=True)
    bad = spoilt(inputs, high_satellites(inputs, 1), [50.0])
    error = {}
    for kind in ("none", "huber", "igg3"):
        solution = solve(bad, spp_config(FITTING, {"spp": {"robust": kind}}))[SOLUTION]
        away = np.linalg.norm(solution["position_ecef_m"] - truth, axis=1)
        error[kind] = float(np.sqrt(np.mean(away**2)))
    clean = solve(inputs, spp_config(FITTING))[SOLUTION]["position_ecef_m"]
    least = np.sqrt(np.mean(np.sum((clean - truth) ** 2, axis=1)))
    assert error["none"] > 5.0 * least
    assert error["huber"] < 0.5 * error["none"]
    assert error["igg3"] < 1.3 * least


def test_the_ionosphere_free_pair_is_free_of_it():
    """Three times Klobuchar's ionosphere and none modelled: nothing is left of it.

    Without a troposphere, whose model is taken at the coarse place, which is not free of it.
    """
    _, inputs, truth = standing(scale=3.0, air=False)
    none = {"atmosphere": {"shapiro": False, "ionosphere": "none", "troposphere": "none"}}
    for table, limit in (({}, None), ({"spp": {"ionosphere_free": True}}, 1 * MM)):
        solution = solve(inputs, spp_config(none, table))[SOLUTION]
        away = np.linalg.norm(solution["position_ecef_m"] - truth, axis=1)
        if limit is None:
            assert away.min() > 2.0
        else:
            assert away.max() < limit


def test_the_pair_amplifies_noise_and_not_orbits():
    _, inputs, _ = standing()
    table = {"spp": {"weighting": "equal", "range_std_scale": 1.0, "ionosphere_free": True}}
    config = spp_config(FITTING, table)
    sights = with_sights(inputs, config)
    residuals = run(SinglePoint(), config, sights).outputs[RESIDUALS]
    stated = dict(
        zip(
            sights[SATELLITES]["satellite"].tolist(), sights[SATELLITES]["range_std_m"], strict=True
        )
    )
    pairs = {"G": ("G1C", "G2W"), "E": ("E1C", "E7Q"), "C": ("C2I", "C6I")}
    checked = set()
    for name, r in zip(
        residuals["satellite"].tolist(), residuals["measurement_std"].tolist(), strict=True
    ):
        f0, f1 = (FREQUENCY[signal] for signal in pairs[name[:1].decode()])
        a, b = f0**2 / (f0**2 - f1**2), f1**2 / (f0**2 - f1**2)
        expected = SIGMA**2 * (a * a + b * b) + stated[name] ** 2
        assert r**2 == pytest.approx(expected, rel=1e-12)
        checked.add(name[:1])
    assert len(checked) == 3


def test_dilutions_are_those_of_the_satellites_used():
    _, inputs, _ = standing()
    config = spp_config(FITTING, {"gnss": {"systems": "GE"}})
    sights = with_sights(inputs, config)
    found = run(SinglePoint(), config, sights).outputs
    seen, geometry = sights[SATELLITES], found[GEOMETRY]
    for row, time_ns in enumerate(times_of(inputs[OBS])):
        now = (seen.valid_time_ns == time_ns) & (seen["elevation_rad"] >= config.gnss.mask)
        elevation, azimuth = seen["elevation_rad"][now], seen["azimuth_rad"][now]
        systems = np.array([name[:1] for name in seen["satellite"][now].tolist()])
        design = np.stack(
            [
                np.cos(elevation) * np.sin(azimuth),
                np.cos(elevation) * np.cos(azimuth),
                np.sin(elevation),
                systems == b"G",
                systems == b"E",
            ],
            axis=1,
        )
        Q = np.diag(np.linalg.inv(design.T @ design))
        assert geometry["gdop"][row] == pytest.approx(np.sqrt(Q.sum()), rel=1e-6)
        assert geometry["pdop"][row] == pytest.approx(np.sqrt(Q[:3].sum()), rel=1e-6)
        assert geometry["hdop"][row] == pytest.approx(np.sqrt(Q[:2].sum()), rel=1e-6)
        assert geometry["vdop"][row] == pytest.approx(np.sqrt(Q[2]), rel=1e-6)
        assert geometry["gps_count"][row] == (systems == b"G").sum()
        assert geometry["galileo_count"][row] == (systems == b"E").sum()
        assert geometry["beidou_count"][row] == 0


def test_masks_and_lists_leave_satellites_out():
    _, inputs, _ = standing()
    usual = solve(inputs, spp_config(FITTING))[RESIDUALS]
    names = sorted(set(usual["satellite"].tolist()))
    table = {"gnss": {"exclude": [names[0].decode()], "mask": "40 deg"}}
    found = solve(inputs, spp_config(FITTING, table))
    used = set(found[RESIDUALS]["satellite"].tolist())
    assert names[0] not in used
    assert 0 < len(used) < len(names) - 1
    # A signal that is too weak is not used either.
    cn0 = inputs[OBS]["cn0_dbhz"].copy()
    cn0[inputs[OBS]["satellite"] == names[1]] = 20.0
    weak = {**inputs, OBS: edited(inputs[OBS], cn0_dbhz=cn0)}
    found = solve(weak, spp_config(FITTING, {"gnss": {"cn0_mask": 25.0}}))
    assert set(found[RESIDUALS]["satellite"].tolist()) == set(names) - {names[1]}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"gnss": {"exclude": ["G99"]}}, "no satellite 'G99'"),
        ({"spp": {"system_scale": [1.0, 2.0]}}, "system_scale has 5 numbers or one"),
    ],
)
def test_impossible_settings_are_refused(table, message):
    with pytest.raises(ConfigurationError, match=message):
        SinglePoint().start(spp_config(table), Context({}, {}))


def test_too_few_satellites_and_bad_geometry_are_told():
    _, inputs, _ = standing()
    names = sorted({n for n in inputs[OBS]["satellite"].tolist() if n[:1] == b"G"})
    late = inputs[OBS].valid_time_ns > START_NS + 10 * 10**9
    few = inputs[OBS].take(~late | np.isin(inputs[OBS]["satellite"], names[:3]))
    found = solve({**inputs, OBS: few}, spp_config(FITTING))
    count = len(np.unique(inputs[OBS].valid_time_ns[late]))
    assert found[EVENTS]["kind"].tolist() == [filter_pb2.EVENT_KIND_TOO_FEW_SATELLITES] * count
    assert found[SOLUTION].valid_time_ns.max() < START_NS + 11 * 10**9
    found = solve(inputs, spp_config(FITTING, {"spp": {"pdop": 0.5}}))
    assert SOLUTION not in found
    assert set(found[EVENTS]["kind"]) == {filter_pb2.EVENT_KIND_NOT_CONVERGED}
    assert len(found[EVENTS]) == len(times_of(inputs[OBS]))


def test_blocks_change_nothing():
    _, inputs, _ = standing(noisy=True)
    config = spp_config(FITTING, {"spp": {"raim": True, "robust": "huber"}})
    bad = spoilt(inputs, high_satellites(inputs, 1), [50.0])
    sights = with_sights(bad, config)
    whole = run(SinglePoint(), config, sights)
    times = times_of(inputs[OBS])
    for edges in (times, times[np.random.default_rng(2).random(len(times)) < 0.1]):
        assert run(SinglePoint(), config, sights, edges, dump_at=2).bytes() == whole.bytes()


def test_no_air_no_correction_is_needed():
    """The simplest sky: what the atmosphere's settings do is nothing where there is none."""
    made = make(base(), sky=NO_AIR)
    truth = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    off = {"atmosphere": {"shapiro": False, "ionosphere": "none", "troposphere": "none"}}
    solution = solve(inputs_of(made.rows, "base"), spp_config(off))[SOLUTION]
    assert np.linalg.norm(solution["position_ecef_m"] - truth, axis=1).max() < 1 * MM
