"""Interpolation of precise orbits and clocks: closed forms, gaps, ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from replay.gnss.products import interpolation_record, long_steps
from replay.kernels import precise_orbits as kernel
from replay.kernels.earth import EARTH_RATE_RAD_S as OMEGA
from replay.kernels.orbits import MU_M3_S2 as MU
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S as C

NS = 1_000_000_000
START = 1_277_000_000 * NS
A = 26_560e3
INCLINATION = 0.96


def kepler(t: np.ndarray, e: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position and velocity in ECEF, eccentric anomaly, of an orbit that nothing disturbs.

    Written in inertial axes that are ECEF's at t = 0, then turned.
    """
    n = math.sqrt(MU / A**3)
    m = n * t
    anomaly = m.copy()
    for _ in range(20):
        anomaly = m + e * np.sin(anomaly)
    b = math.sqrt(1.0 - e * e)
    rate = n / (1.0 - e * np.cos(anomaly))
    plane = A * np.stack([np.cos(anomaly) - e, b * np.sin(anomaly)])
    speed = A * np.stack([-np.sin(anomaly), b * np.cos(anomaly)]) * rate
    tilt = np.array([[1.0, 0.0], [0.0, math.cos(INCLINATION)], [0.0, math.sin(INCLINATION)]])
    x, v = tilt @ plane, tilt @ speed
    c, s = np.cos(OMEGA * t), np.sin(OMEGA * t)
    turn = np.array([[c, s, 0 * c], [-s, c, 0 * c], [0 * c, 0 * c, 0 * c + 1.0]])
    position = np.einsum("ijn,jn->in", turn, x)
    velocity = np.einsum("ijn,jn->in", turn, v)
    velocity -= np.cross([0.0, 0.0, OMEGA], position.T).T
    return position.T, velocity.T, anomaly


def orbits(step_s: int, count: int, e: float = 0.0) -> np.ndarray:
    rows = np.zeros(count, dtype=kernel.PRECISE_ORBIT_DTYPE)
    t = np.arange(count) * step_s
    rows["t"] = START + t * NS
    rows["position"] = kepler(t.astype(np.float64), e)[0]
    return rows


def ask(
    rows: np.ndarray, t: float, *, degree: int = 10, least: int = 0, beyond_s: float = 0.0
) -> tuple[int, np.ndarray]:
    """Status and state at `t` seconds after the start."""
    state, work = np.full(8, np.nan), np.zeros(kernel.WORK_SHAPE)
    config = interpolation_record(degree=degree, least=least, beyond_s=beyond_s)[0]
    whole = math.floor(t)
    status, _ = kernel.precise_position(
        rows, 0, len(rows), START + whole * NS, t - whole, config, state, work
    )
    return status, state


# The error of a polynomial of degree 10 half way between its middle points is
# (1 3 5 7 9)^2 11 / 2^11 / 11! h^11 of the radius, h being the orbit's angle between points, 0.131
# for 15 minutes: 6e-7 m; that of the speed at the middle point is 5!^2 / 11! h^10 of the speed:
# 2e-9 m/s. An eccentricity e adds 2^11 e of it, and less of higher powers.
@pytest.mark.parametrize(
    ("step", "e", "error", "rate"),
    [(900, 0.0, 7e-7, 3e-9), (900, 0.01, 2.5e-5, 1e-7), (300, 0.01, 1e-9, 1e-12)],
)
def test_an_orbit_that_nothing_disturbs(step: int, e: float, error: float, rate: float) -> None:
    rows = orbits(step, 40, e)
    ends = 6 * step
    times = np.linspace(ends, 33 * step, 97)
    position, velocity, anomaly = kepler(times, e)
    for t, x, v, angle in zip(times, position, velocity, anomaly, strict=True):
        status, state = ask(rows, float(t))
        assert status == kernel.FOUND
        # Numbers of 26 million m are rounded to 4e-9 m.
        assert np.abs(state[:3] - x).max() < error + 2e-8
        assert np.abs(state[3:6] - v).max() < rate + 5e-10
        # IS-GPS-200N, 20.3.3.3.3.1: F e sqrt(A) sin E.
        expected = -2.0 * math.sqrt(MU * A) / C**2 * e * math.sin(angle)
        assert kernel.relativity(state) == pytest.approx(
            expected, abs=1e-18 + 2.0 * A * rate / C**2
        )
        rate_of = math.sqrt(MU / A**3) / (1.0 - e * math.cos(angle))
        expected *= rate_of / math.tan(angle)
        assert kernel.relativity_rate(state) == pytest.approx(
            expected, abs=1e-19 + 1e-9 * abs(expected)
        )


def test_epochs_themselves() -> None:
    rows = orbits(900, 20)
    for k in (0, 1, 7, 19):
        status, state = ask(rows, 900.0 * k)
        assert status == kernel.FOUND
        np.testing.assert_allclose(state[:3], rows[k]["position"], rtol=0, atol=1e-8)


def test_a_polynomial_of_higher_degree_serves_an_eccentric_orbit() -> None:
    rows = orbits(900, 40, 0.16)
    worst = {}
    for degree in (8, 10, 12):
        errors = []
        for t in np.linspace(9000.0, 25000.0, 41):
            _, state = ask(rows, float(t), degree=degree)
            errors.append(np.linalg.norm(state[:3] - kepler(np.array([t]), 0.16)[0][0]))
        worst[degree] = max(errors)
    assert worst[8] > 5.0 * worst[10] > 25.0 * worst[12]


def test_time_before_and_after() -> None:
    rows = orbits(900, 20)
    end = 19 * 900.0
    for t in (-1.0, end + 1.0):
        assert ask(rows, t)[0] == kernel.OUTSIDE
        status, state = ask(rows, t, beyond_s=1.0)
        assert status == kernel.FOUND
        np.testing.assert_allclose(state[:3], kepler(np.array([t]))[0][0], atol=0.01, rtol=0)
    assert ask(rows, end + 1.001, beyond_s=1.0)[0] == kernel.OUTSIDE
    assert ask(rows[:0], 0.0)[0] == kernel.NO_PRODUCT


def test_nothing_is_taken_from_beyond_a_gap() -> None:
    """Rows beyond it are made wrong: what is near the gap stays as it was without them."""
    rows = np.delete(orbits(900, 40), 20)  # no epoch at 18 000 s
    rows["gap"][1:] = long_steps(rows["t"])
    assert np.flatnonzero(rows["gap"]).tolist() == [20]
    before, after = rows.copy(), rows.copy()
    before["position"][20:] += 1e6
    after["position"][:20] += 1e6
    for t, part in ((17_000.0, before), (17_100.0, before), (18_900.0, after), (19_000.0, after)):
        status, state = ask(part, t)
        assert status == kernel.FOUND
        np.testing.assert_allclose(state[:3], kepler(np.array([t]))[0][0], atol=0.05, rtol=0)
    for t in (17_101.0, 18_000.0, 18_899.0):
        assert ask(rows, t)[0] == kernel.IN_GAP
    assert ask(before, 17_101.0, beyond_s=2.0)[0] == kernel.FOUND
    assert ask(after, 18_899.0, beyond_s=2.0)[0] == kernel.FOUND
    assert ask(rows, 18_000.0, beyond_s=2.0)[0] == kernel.IN_GAP


def test_a_manoeuvre_parts_an_orbit() -> None:
    rows = orbits(900, 40)
    rows["gap"][20] = 1
    rows["position"][20:] += 500.0
    status, state = ask(rows, 17_100.0)
    assert status == kernel.FOUND
    np.testing.assert_allclose(state[:3], kepler(np.array([17_100.0]))[0][0], atol=1e-8)
    assert ask(rows, 17_500.0)[0] == kernel.IN_GAP


def test_few_points() -> None:
    rows = orbits(300, 8)
    assert ask(rows, 1000.0)[0] == kernel.TOO_FEW
    status, state = ask(rows, 1000.0, least=8)
    assert status == kernel.FOUND
    np.testing.assert_allclose(state[:3], kepler(np.array([1000.0]))[0][0], atol=1e-3, rtol=0)
    assert ask(rows, 1000.0, least=9)[0] == kernel.TOO_FEW


def clocks(times_s: list[float], values: list[float]) -> np.ndarray:
    rows = np.zeros(len(times_s), dtype=kernel.PRECISE_CLOCK_DTYPE)
    rows["t"] = START + np.rint(np.array(times_s) * 1e9).astype(np.int64)
    rows["clock"] = values
    return rows


def ask_clock(rows: np.ndarray, t: float, beyond_s: float = 0.0) -> tuple[int, float, float]:
    state = np.full(8, np.nan)
    whole = math.floor(t)
    status = kernel.precise_clock(
        rows, 0, len(rows), START + whole * NS, t - whole, beyond_s, state
    )
    return status, state[6], state[7]


def test_clocks() -> None:
    # Steps may differ: it is the two values around the time that count.
    rows = clocks([0, 30, 60, 360, 660], [1e-4, 1.3e-4, 1.0e-4, 4.0e-4, 1.0e-4])
    for t, value, drift in (
        (0.0, 1e-4, 1e-6), (29.9999, 1.299999e-4, 1e-6), (45.5, 1.145e-4, -1e-6),
        (61.0, 1.01e-4, 1e-6), (359.0, 3.99e-4, 1e-6), (660.0, 1.0e-4, -1e-6),
    ):  # fmt: skip
        status, found, rate = ask_clock(rows, t)
        assert status == kernel.FOUND
        assert found == pytest.approx(value, abs=1e-16)
        assert rate == pytest.approx(drift, abs=1e-16)
    assert ask_clock(rows, 661.0)[0] == kernel.OUTSIDE
    assert ask_clock(rows, 661.0, 1.0)[1] == pytest.approx(0.99e-4, abs=1e-16)
    rows["gap"][2] = 1
    assert ask_clock(rows, 45.5)[0] == kernel.IN_GAP
    assert ask_clock(rows, 31.0, 1.0)[1] == pytest.approx(1.31e-4, abs=1e-16)
    assert ask_clock(rows, 59.5, 1.0)[1] == pytest.approx(0.995e-4, abs=1e-16)
    assert ask_clock(rows[:1], 0.0)[0] == kernel.TOO_FEW


def test_transmission() -> None:
    """From the moment of transmission to the pseudorange and back."""
    e = 0.01
    rows = orbits(900, 30, e)
    bias = clocks([0, 30_000], [3e-4, 3e-4 + 30_000 * 1e-11])
    here = np.array([4_000e3, 3_000e3, 3_900e3])
    sent = 11_234.567_891_234
    position, velocity, anomaly = kepler(np.array([sent]), e)
    # Range in axes that do not turn: the receiver moves on by the travel time.
    travel = 0.075
    for _ in range(10):
        angle = OMEGA * travel
        c, s = math.cos(angle), math.sin(angle)
        there = np.array([c * here[0] - s * here[1], s * here[0] + c * here[1], here[2]])
        travel = float(np.linalg.norm(there - position[0])) / C
    effect = -2.0 * math.sqrt(MU * A) / C**2 * e * math.sin(anomaly[0])
    clock = 3e-4 + 1e-11 * sent + effect
    received = START + round((sent + travel + 1e-3) * 1e9)  # the receiver's clock is 1 ms ahead
    reading = (received - START) / 1e9
    code = C * (reading - (sent + clock))
    state, work = np.zeros(8), np.zeros(kernel.WORK_SHAPE)
    orbit_starts = np.array([0, 0, len(rows)])
    clock_starts = np.array([0, 0, len(bias)])
    config = interpolation_record()[0]
    status, found = kernel.precise_transmission(
        rows, orbit_starts, bias, clock_starts, 1, received, code, config, state, work
    )
    assert status == kernel.FOUND
    # A time near 11 235 s in a float64 is good to 2e-12 s; polynomials to 1e-4 m.
    np.testing.assert_allclose(state[:3], position[0], rtol=0, atol=2e-4)
    np.testing.assert_allclose(state[3:6], velocity[0], rtol=0, atol=1e-6)
    assert found == pytest.approx(effect, abs=1e-17)
    assert state[6] == pytest.approx(3e-4 + 1e-11 * sent, abs=1e-16)
    status, _ = kernel.precise_transmission(
        rows, orbit_starts, bias, clock_starts, 0, received, code, config, state, work
    )
    assert status == kernel.NO_PRODUCT


def test_what_a_long_step_is() -> None:
    def of(steps: list[int]) -> list[bool]:
        times = np.concatenate([[0], np.cumsum(steps)]) * NS
        return long_steps(times).tolist()

    regular = [900] * 12
    assert not any(of(regular))
    assert of([*regular, 1800, *regular]) == [False] * 12 + [True] + [False] * 12
    # Fifteen minutes one day, five the next: neither lacks anything.
    assert not any(of(regular + [300] * 12))
    assert of([1800, 900, 900]) == [True, False, False]
    assert of([900]) == [False] and of([]) == []
