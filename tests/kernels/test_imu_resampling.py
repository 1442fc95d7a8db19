"""Fewer inertial samples of the same motion."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay import channels
from replay.kernels.imu_resampling import (
    SAMPLE_DTYPE,
    close_interval,
    new_resampling,
    resample,
)
from replay.kernels.strapdown import NAVIGATION_DTYPE, mechanize
from replay.simulate import make_channels, read_scenario
from tests.engine.drives import short_scenario
from tests.kernels.test_strapdown import start

SECOND = 1_000_000_000
ARCSECOND = np.pi / 180 / 3600


def samples(times_s, rates, forces) -> np.ndarray:
    made = np.zeros(len(times_s), dtype=SAMPLE_DTYPE)
    made["t"] = np.rint(np.asarray(times_s) * SECOND).astype(np.int64)
    made["log_t"] = made["t"] + 1000
    made["w"], made["f"], made["temperature"] = rates, forces, np.nan
    return made


def fewer(rows, ratio, *, integrate=True, longest_s=1.0, cuts=(), close=True) -> np.ndarray:
    state, scratch = new_resampling(), np.zeros((2, 4))
    parts = []
    for part in np.split(rows, list(cuts)):
        out = np.zeros(len(part) + 1, dtype=SAMPLE_DTYPE)
        count = resample(part, ratio, integrate, round(longest_s * SECOND), state, scratch, out)
        parts.append(out[:count])
    if close:
        out = np.zeros(1, dtype=SAMPLE_DTYPE)
        parts.append(out[: close_interval(state, integrate, scratch, out)])
    return np.concatenate(parts)


def mechanized(rows, nav) -> np.ndarray:
    """Navigation after all samples; the first only tells when the second begins."""
    scratch = np.zeros((2, 4))
    nav = np.array([nav], dtype=NAVIGATION_DTYPE)[0]
    for before, row in itertools.pairwise(rows):
        dt = (row["t"] - before["t"]) * 1e-9
        mechanize(nav, *(row["w"] * dt), *(row["f"] * dt), dt, scratch)
    return nav


def angle(a, b) -> float:
    return float(np.linalg.norm(a["C"] @ b["C"].T - np.eye(3)) / np.sqrt(2))


def integral(rows, field) -> np.ndarray:
    dt = np.diff(rows["t"]) * 1e-9
    return (rows[field][1:] * dt[:, None]).sum(axis=0)


def random_rows(count=61, rate=200.0, seed=3) -> np.ndarray:
    random = np.random.default_rng(seed)
    return samples(
        100.0 + np.arange(count) / rate,
        random.normal(0, 0.5, (count, 3)),
        random.normal(0, 3.0, (count, 3)) + [0, 0, -9.8],
    )


def test_about_one_axis_the_increments_are_added_up():
    rows = random_rows()
    rows["w"][:, 1:] = 0.0
    rows["f"][:, 1:] = 0.0  # along the axis: nothing turns the force either
    made = fewer(rows, 10)
    assert made["t"].tolist() == rows["t"][::10].tolist()
    assert made["log_t"].tolist() == rows["log_t"][::10].tolist()
    np.testing.assert_allclose(made["w"][1:, 0], rows["w"][1:, 0].reshape(-1, 10).mean(1), 1e-13)
    np.testing.assert_allclose(made["f"][1:, 0], rows["f"][1:, 0].reshape(-1, 10).mean(1), 1e-13)
    assert not made["w"][:, 1:].any()


def test_without_rotation_the_velocity_is_added_up():
    rows = random_rows()
    rows["w"] = 0.0
    np.testing.assert_allclose(
        integral(fewer(rows, 7), "f"), integral(rows, "f"), rtol=1e-13, atol=1e-13
    )


def test_the_long_samples_carry_the_strapdown_where_the_short_ones_do():
    """Rotation and velocity, of rates and forces as wild as white noise makes them."""
    rows = random_rows(601)
    nav = start(roll=0.3, pitch=-0.2, heading=2.0)
    fine, coarse = mechanized(rows, nav), mechanized(fewer(rows, 10), nav)
    plain = rows[::10].copy()
    for field in ("w", "f"):
        plain[field][1:] = rows[field][1:].reshape(-1, 10, 3).mean(1)
    means = mechanized(plain, nav)
    # What remains is how far the Earth turns and what gravity does in a long interval.
    assert angle(fine, coarse) < 1e-3 * ARCSECOND
    assert angle(fine, means) > 1e3 * angle(fine, coarse)
    assert np.linalg.norm(fine["v"] - coarse["v"]) < 1e-6
    assert np.linalg.norm(fine["v"] - means["v"]) > 1e-3


def test_coning_inside_the_long_interval_is_kept():
    """A cone at 20 Hz, each of whose turns one long interval hides whole."""
    cone, turning = 0.01, 2 * np.pi * 20.0
    edges = np.arange(0, 2001) / 1000.0
    # Rate of a body axis that moves on a small cone, by its closed form (Bortz 1971).
    middle = turning * (edges[1:] + edges[:-1]) / 2
    chord = 2 * np.sin(turning * 0.0005) / 0.001
    rates = np.zeros((2001, 3))
    rates[1:, 0] = -np.sin(cone) * chord * np.sin(middle)
    rates[1:, 1] = np.sin(cone) * chord * np.cos(middle)
    rates[1:, 2] = -turning * (1 - np.cos(cone))
    rows = samples(100.0 + edges, rates, np.zeros((2001, 3)))
    nav = start()
    fine, coarse = mechanized(rows, nav), mechanized(fewer(rows, 50), nav)
    assert angle(fine, coarse) < 1.0 * ARCSECOND
    # The plain mean sees the drift of the third axis alone: it drifts by all of the cone.
    plain = rows[::50].copy()
    plain["w"][1:] = rows["w"][1:].reshape(-1, 50, 3).mean(1)
    drift = turning * (1 - np.cos(cone)) * 2.0
    assert angle(fine, mechanized(plain, nav)) == pytest.approx(drift, rel=0.02)


def test_a_drive_without_errors():
    table = short_scenario(imu={"rate": 200.0, "grade": "perfect"}, gnss={"grade": "perfect"})
    made = make_channels(read_scenario(table))
    imu = made[channels.IMU.topic]
    rows = np.zeros(len(imu), dtype=SAMPLE_DTYPE)
    rows["t"] = rows["log_t"] = imu.valid_time_ns
    rows["w"], rows["f"] = imu["angular_rate_body_rad_s"], imu["specific_force_body_m_s2"]
    nav = start(latitude=52.0, longitude=4.4, height=0.0, heading=np.radians(35.0))
    fine = mechanized(rows, nav)
    integrated = mechanized(fewer(rows, 10), nav)
    decimated = mechanized(fewer(rows, 10, integrate=False), nav)
    error = np.linalg.norm(integrated["r"] - fine["r"])
    assert error < 0.01
    assert angle(integrated, fine) < 0.01 * ARCSECOND
    assert np.linalg.norm(decimated["r"] - fine["r"]) > 100 * error
    assert angle(decimated, fine) > 100 * angle(integrated, fine)


def test_decimation_takes_samples_as_they_stand():
    rows = random_rows()
    rows["temperature"] = np.arange(len(rows))
    made = fewer(rows, 4, integrate=False)
    assert made.tobytes() == rows[::4].tobytes()


@pytest.mark.parametrize("integrate", [True, False])
def test_a_gap_stays(integrate):
    """What is open ends before it; the sample after it stands as it is and begins anew."""
    rows = random_rows(50)
    rows["t"][23:] += SECOND
    made = fewer(rows, 10, integrate=integrate, longest_s=0.1)
    places = [0, 10, 20, 22, 23, 33, 43, 49]
    assert made["t"].tolist() == rows["t"][places].tolist()
    assert made["w"][4].tolist() == rows["w"][23].tolist()
    if integrate:
        # Between gaps nothing of the motion is lost.
        nav = start()
        fine, coarse = mechanized(rows[:23], nav), mechanized(made[:4], nav)
        assert angle(fine, coarse) < 1e-3 * ARCSECOND


def test_what_is_open_at_the_end_is_shorter():
    rows = random_rows(26)
    made = fewer(rows, 10)
    assert made["t"].tolist() == rows["t"][[0, 10, 20, 25]].tolist()
    assert len(fewer(rows[:21], 10)) == 3


def test_samples_that_no_interval_can_hold():
    rows = random_rows(31)
    good = np.delete(rows, [5, 12])
    rows["w"][5, 1] = np.nan
    rows["t"][12] = rows["t"][11]
    made = fewer(rows, 7)
    assert made.tobytes() == fewer(good, 7).tobytes()
    state = new_resampling()
    out = np.zeros(40, dtype=SAMPLE_DTYPE)
    resample(rows, 7, True, SECOND, state, np.zeros((2, 4)), out)
    assert (state["bad"][0], state["late"][0], state["gaps"][0]) == (1, 1, 0)


@given(st.lists(st.integers(0, 61), max_size=6), st.integers(2, 12), st.booleans())
def test_cuts_change_nothing(cuts, ratio, integrate):
    rows = random_rows()
    whole = fewer(rows, ratio, integrate=integrate)
    assert fewer(rows, ratio, integrate=integrate, cuts=sorted(cuts)).tobytes() == whole.tobytes()
