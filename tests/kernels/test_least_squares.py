"""Positions of random skies against numpy's least squares; dilutions against RTKLIB's."""

import numpy as np
import pymap3d
import pytest

from replay.kernels import least_squares
from replay.kernels.dilution import dilutions
from replay.kernels.earth import enu_axes
from replay.kernels.gnss_records import MEASURED_DTYPE
from replay.kernels.single_records import SINGLE_ROW_DTYPE

HERE = np.array(pymap3d.geodetic2ecef(48.0, 11.0, 500.0))
CLOCKS = np.array([1e5, -40.0, 12.0, 300.0, 7.0])


def sky(seed, count=14, systems=(0, 2, 3)):
    """Satellites of some systems above ten degrees: records, elevations, azimuths."""
    rng = np.random.default_rng(seed)
    elevation = np.arcsin(rng.uniform(np.sin(0.17), 1.0, count))
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)
    places = pymap3d.aer2ecef(
        np.degrees(azimuth),
        np.degrees(elevation),
        rng.uniform(2.0e7, 2.6e7, count),
        48.0,
        11.0,
        500.0,
    )
    rows = np.zeros(count, dtype=MEASURED_DTYPE)
    rows["system"] = np.resize(systems, count)
    rows["position"] = np.stack(places, axis=1)
    return rows, elevation, azimuth


def solve(rows, observed, weight, start=None, limit=1e-6):
    work = np.zeros(1, dtype=least_squares.SOLVE_DTYPE)
    x = (HERE if start is None else start).copy()
    clock = np.zeros(5)
    status = least_squares.iterate(
        rows, observed, weight, 20, limit, x, clock, work[0], np.zeros(3)
    )
    return status, x, clock, work[0]


def ranges(rows, place=HERE):
    away = np.linalg.norm(rows["position"] - place, axis=1)
    return away + CLOCKS[rows["system"]]


@pytest.mark.parametrize("start", [np.zeros(3), HERE + [3e4, -5e4, 1e4], -HERE])
def test_exact_ranges_give_the_exact_place(start):
    rows, _, _ = sky(1)
    status, x, clock, _ = solve(rows, ranges(rows), np.ones(len(rows)), start)
    assert status > 0
    np.testing.assert_allclose(x, HERE, atol=1e-6)
    np.testing.assert_allclose(clock[[0, 2, 3]], CLOCKS[[0, 2, 3]], atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_noisy_ranges_give_numpys_weighted_solution(seed):
    rows, _, _ = sky(seed)
    rng = np.random.default_rng(100 + seed)
    observed = ranges(rows) + rng.normal(0.0, 3.0, len(rows))
    weight = rng.uniform(0.1, 2.0, len(rows))
    weight[3] = 0.0  # left out
    status, x, clock, work = solve(rows, observed, weight)
    assert status > 0
    # The gradient of the weighted sum of squares vanishes, and the cofactors are its curvature.
    line = rows["position"] - x
    away = np.linalg.norm(line, axis=1)
    design = np.concatenate(
        [-line / away[:, None], rows["system"][:, None] == np.array([0, 2, 3])], axis=1
    )
    left = observed - away - clock[rows["system"]]
    assert np.abs(design.T @ (weight * left)).max() < 1e-6
    expected = np.linalg.inv(design.T @ (weight[:, None] * design))
    np.testing.assert_allclose(work["N"][:6, :6], expected, rtol=1e-8, atol=1e-12)


def test_too_few_and_degenerate_skies_are_told():
    rows, _, _ = sky(2)
    weight = np.zeros(len(rows))
    weight[:5] = 1.0  # five satellites of three systems: six unknowns
    assert solve(rows, ranges(rows), weight)[0] == -1
    rows["position"] = rows["position"][0] + np.arange(len(rows))[:, None] * [0.0, 0.0, 1e-3]
    rows["system"] = 0
    assert solve(rows, ranges(rows), np.ones(len(rows)))[0] < 0


def dops(rows, weight):
    work = np.zeros(1, dtype=least_squares.SOLVE_DTYPE)
    out = np.zeros(1, dtype=SINGLE_ROW_DTYPE)
    enu_axes(*HERE, work["axes"][0])
    dilutions(rows, weight, HERE, work[0], np.zeros(3), out[0])
    return out[0]


@pytest.mark.parametrize("seed", range(4))
def test_dilutions_of_one_system_are_rtklibs(seed):
    pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    rows, elevation, azimuth = sky(seed, 9, (2,))
    azel, found = pyrtklib.Arr1Ddouble(18), pyrtklib.Arr1Ddouble(4)
    for k in range(9):
        azel[2 * k], azel[2 * k + 1] = azimuth[k], elevation[k]
    pyrtklib.dops(9, azel, 0.0, found)
    out = dops(rows, np.ones(9))
    assert out["dop"] == pytest.approx([found[k] for k in range(4)], rel=1e-9)
    assert out["system_pdop"][2] == pytest.approx(found[1], rel=1e-9)
    assert np.isnan(out["system_pdop"][[0, 1, 3, 4]]).all()
    assert out["count"].tolist() == [0, 0, 9, 0, 0]


def test_each_system_adds_a_clock():
    """Of several systems: the closed form in numpy, and each system's own alone."""
    rows, elevation, azimuth = sky(7, 16, (0, 3))
    out = dops(rows, np.ones(16))
    lines = np.stack(
        [
            -np.cos(elevation) * np.sin(azimuth),
            -np.cos(elevation) * np.cos(azimuth),
            -np.sin(elevation),
        ],
        axis=1,
    )
    both = np.concatenate([lines, rows["system"][:, None] == np.array([0, 3])], axis=1)
    Q = np.diag(np.linalg.inv(both.T @ both))
    expected = [Q.sum(), Q[:3].sum(), Q[:2].sum(), Q[2]]
    assert out["dop"] == pytest.approx(np.sqrt(expected), rel=1e-9)
    for system in (0, 3):
        own = lines[rows["system"] == system]
        own = np.concatenate([own, np.ones((len(own), 1))], axis=1)
        Q = np.diag(np.linalg.inv(own.T @ own))
        assert out["system_pdop"][system] == pytest.approx(np.sqrt(Q[:3].sum()), rel=1e-9)


def test_three_satellites_have_no_dilution():
    rows, _, _ = sky(3, 3, (0,))
    out = dops(rows, np.ones(3))
    assert np.isnan(out["dop"]).all()
    assert np.isnan(out["system_pdop"]).all()
