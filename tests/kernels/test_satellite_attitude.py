"""How satellites stand: the geometry of vectors, published laws, what turning bodies must keep."""

from __future__ import annotations

import numpy as np
import pytest

from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.satellite_attitude import (
    BDS_2,
    GAL_FOC,
    GAL_IOV,
    GLO_M,
    GPS_IIA,
    GPS_IIF,
    GPS_IIR,
    NOMINAL,
    NORMAL,
    QZS_1,
    TURNING,
    UNCERTAIN,
    in_shadow,
    nominal_yaw,
    orbit_angles,
    satellite_axes,
    yaw_angle,
)

GPS_M, GLO_RADIUS_M, GAL_M = 26_560_000.0, 25_510_000.0, 29_600_000.0
GPS_RATE, GLO_RATE, GAL_RATE = (2 * np.pi / period for period in (43082.0, 40544.0, 50685.0))
SUN_M = 1.496e11
OF_MODEL = {
    GPS_IIA: (GPS_M, GPS_RATE),
    GPS_IIR: (GPS_M, GPS_RATE),
    GPS_IIF: (GPS_M, GPS_RATE),
    GLO_M: (GLO_RADIUS_M, GLO_RATE),
    GAL_IOV: (GAL_M, GAL_RATE),
    GAL_FOC: (GAL_M, GAL_RATE),
}


def around(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def unit(v):
    return v / np.linalg.norm(v)


def placed(beta, mu, radius=GPS_M, rate=GPS_RATE, seed=0):
    """Satellite and Sun of given angles in axes that are turned at random; ECEF velocity."""
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    r = radius * np.array([np.cos(mu), np.sin(mu), 0.0])
    v = radius * rate * np.array([-np.sin(mu), np.cos(mu), 0.0])
    sun = SUN_M * np.array([-np.cos(beta), 0.0, np.sin(beta)])
    r, v, sun = turn @ r, turn @ v, turn @ sun
    return r, v - np.cross([0.0, 0.0, EARTH_RATE_RAD_S], r), sun


def course(model, beta, step=2e-4):
    """Yaw and flags along one orbit, from a quarter before midnight on."""
    radius, rate = OF_MODEL[model]
    mu = np.arange(-0.5 * np.pi, 1.5 * np.pi, step)
    found = [yaw_angle(model, beta, around(u), rate, radius) for u in mu]
    return mu, np.array([f[0] for f in found]), np.array([f[1] for f in found])


def test_angles_of_an_orbit():
    for seed, (beta, mu) in enumerate([(0.3, 1.0), (-0.7, -2.8), (0.01, 3.1), (1.2, 0.0)]):
        r, v, sun = placed(beta, mu, seed=seed)
        found = orbit_angles(r, v, sun)
        np.testing.assert_allclose(found, (beta, mu, GPS_RATE), atol=1e-12)


def test_nominal_axes_hold_the_sun():
    """z to the Earth, y at right angles to Earth and Sun, the Sun on x's side."""
    axes = np.zeros((3, 3))
    for seed in range(40):
        generator = np.random.default_rng(seed)
        r, v, sun = placed(generator.uniform(-1.3, 1.3), generator.uniform(-3, 3), seed=seed)
        assert satellite_axes(NOMINAL, r, v, sun, axes) == 0
        z = -unit(r)
        y = unit(np.cross(z, sun))
        np.testing.assert_allclose(axes, [np.cross(y, z), y, z], atol=1e-12)
        assert axes[0] @ sun > 0.0


def test_orbit_normal_axes():
    """x along the track, y against the normal of the orbit; BeiDou-2 below 4 deg, QZS-1 20."""
    axes = np.zeros((3, 3))
    for model, beta in ((NORMAL, 0.9), (BDS_2, 0.06), (QZS_1, -0.3)):
        r, v, sun = placed(beta, 0.7, seed=5)
        assert satellite_axes(model, r, v, sun, axes) == TURNING
        inertial = v + np.cross([0.0, 0.0, EARTH_RATE_RAD_S], r)
        np.testing.assert_allclose(axes[0], unit(inertial), atol=1e-12)
        np.testing.assert_allclose(axes[1], -unit(np.cross(r, inertial)), atol=1e-12)
    for model, beta in ((BDS_2, 0.08), (QZS_1, -0.36)):
        assert yaw_angle(model, beta, 0.7, GPS_RATE, GPS_M) == (nominal_yaw(beta, 0.7), 0)


@pytest.mark.parametrize("model", OF_MODEL)
@pytest.mark.parametrize("beta_deg", [16.0, -20.0, 45.0])
def test_far_from_the_orbit_plane_all_is_nominal(model, beta_deg):
    mu, yaw, flags = course(model, np.radians(beta_deg), 1e-2)
    assert not flags.any()
    due = [nominal_yaw(np.radians(beta_deg), u) for u in mu]
    np.testing.assert_allclose(around(yaw - due), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("model", "limit_deg_s"),
    [(GPS_IIA, 0.12), (GPS_IIR, 0.20), (GPS_IIF, 0.11), (GLO_M, 0.25), (GAL_IOV, 0.205)],
)
@pytest.mark.parametrize("beta_deg", [-1.7, -0.4, 0.2, 1.1, 1.9])
def test_no_satellite_turns_faster_than_it_can(model, limit_deg_s, beta_deg):
    """The nominal law would need 0.25 deg/s and more here, up to 2.4."""
    mu, yaw, flags = course(model, np.radians(beta_deg))
    rate = around(np.diff(yaw)) / np.diff(mu) * OF_MODEL[model][1]
    assert np.degrees(np.max(np.abs(rate))) < limit_deg_s * 1.001
    assert np.any(flags & TURNING)


@pytest.mark.parametrize("beta_deg", [-1.0, 0.5, 2.0])
def test_turns_start_and_end_nominally(beta_deg):
    """A noon turn of a IIR starts where the nominal rate is 0.2 deg/s, and ends on the law."""
    beta = np.radians(beta_deg)
    mu, yaw, flags = course(GPS_IIR, beta, 1e-4)
    nominal = np.array([nominal_yaw(beta, u) for u in mu])
    noon = (flags & TURNING).astype(bool) & (mu > 0.5 * np.pi)
    first, last = np.flatnonzero(noon)[[0, -1]]
    law = np.degrees(around(nominal[first] - nominal[first - 1])) / 1e-4 * GPS_RATE
    assert abs(law) == pytest.approx(0.2, rel=2e-2)
    assert around(yaw[last] - nominal[last]) == pytest.approx(0.0, abs=5e-3)
    # At noon itself it lags.
    k = np.argmin(np.abs(mu - np.pi))
    assert np.degrees(abs(around(yaw[k] - nominal[k]))) > 2.0


def test_limit_of_beta_is_koubas():
    """Kouba (2009): below 2.4 deg a IIR, below 4 deg of beta a IIA at 0.12 deg/s cannot follow."""
    for model, rate in ((GPS_IIR, 0.20), (GPS_IIA, 0.12)):
        limit = np.arctan(np.degrees(GPS_RATE) / rate)
        noon = np.pi - 1e-4
        assert yaw_angle(model, limit * 1.01, noon, GPS_RATE, GPS_M)[1] == 0
        assert yaw_angle(model, limit * 0.99, noon, GPS_RATE, GPS_M)[1] == TURNING
    assert np.degrees(limit) == pytest.approx(3.99, abs=0.01)


def test_shadow_of_a_iif_at_constant_rate():
    """Dilssner (2010): from the beginning to the end of the shadow, both nominal."""
    beta = np.radians(4.5)
    mu, yaw, flags = course(GPS_IIF, beta)
    inside = np.flatnonzero(flags)
    half = np.arccos(np.sqrt(1 - (6378137.0 / GPS_M) ** 2) / np.cos(beta))
    assert mu[inside[0]] == pytest.approx(-half, abs=3e-4)
    assert mu[inside[-1]] == pytest.approx(half, abs=3e-4)
    slope = np.diff(yaw[inside]) / np.diff(mu[inside])
    due = around(nominal_yaw(beta, half) - nominal_yaw(beta, -half)) / (2 * half)
    np.testing.assert_allclose(slope, due, rtol=1e-9)


def test_shadow_of_a_glonass_ends_early():
    """Dilssner (2011): 0.25 deg/s from the edge of the shadow, then fixed at the exit's angle."""
    beta = np.radians(-6.0)
    mu, yaw, flags = course(GLO_M, beta)
    half = np.arccos(np.sqrt(1 - (6378137.0 / GLO_RADIUS_M) ** 2) / np.cos(beta))
    inside = np.flatnonzero(flags)
    assert yaw[inside[-1]] == pytest.approx(nominal_yaw(beta, half), abs=1e-12)
    rate = np.degrees(np.diff(yaw[inside]) / np.diff(mu[inside]) * GLO_RATE)
    assert np.median(np.abs(rate)) == pytest.approx(0.0, abs=1e-9)
    assert rate[0] == pytest.approx(-0.25, rel=1e-6)


@pytest.mark.parametrize(
    ("model", "rate_deg_s", "wrong_deg", "right_deg"),
    [(GPS_IIA, 0.12, 0.3, -0.3), (GPS_IIF, 0.11, -0.5, 0.5)],
)
def test_noon_turns_within_the_bias_go_the_other_way(model, rate_deg_s, wrong_deg, right_deg):
    """From side to side all the same, nearly half a turn; where beta > 0 the law's is negative."""
    for beta_deg, way in ((wrong_deg, 1.0), (right_deg, -1.0)):
        mu, yaw, flags = course(model, np.radians(beta_deg))
        noon = np.flatnonzero((flags & TURNING).astype(bool) & (mu > 0.5 * np.pi))
        rate = np.degrees(around(np.diff(yaw[noon])) / np.diff(mu[noon])) * GPS_RATE
        np.testing.assert_allclose(rate, way * np.sign(beta_deg) * rate_deg_s, rtol=1e-6)
        nominal = nominal_yaw(np.radians(beta_deg), mu[noon[-1] + 1])
        assert yaw[noon[-1] + 1] == pytest.approx(nominal, abs=1e-12)
        assert around(yaw[noon[-1]] - nominal) == pytest.approx(0.0, abs=5e-3)


def test_noon_turn_of_a_glonass_is_half_done_at_noon():
    for beta, due in ((0.01, -0.5 * np.pi), (-0.01, 0.5 * np.pi)):
        assert yaw_angle(GLO_M, beta, np.pi - 1e-12, GLO_RATE, GLO_RADIUS_M)[0] == pytest.approx(
            due, abs=1e-6
        )


def test_after_the_shadow_a_iia_is_uncertain():
    beta = np.radians(3.0)
    mu, yaw, flags = course(GPS_IIA, beta)
    doubtful = np.flatnonzero(flags & UNCERTAIN)
    half = np.arccos(np.sqrt(1 - (6378137.0 / GPS_M) ** 2) / np.cos(beta))
    assert mu[doubtful[0]] == pytest.approx(half, abs=3e-4)
    assert (mu[doubtful[-1]] - half) / GPS_RATE == pytest.approx(1800.0, abs=3.0)
    nominal = nominal_yaw(beta, mu[doubtful[-1]])
    assert around(yaw[doubtful[-1]] - nominal) == pytest.approx(0.0, abs=1e-9)


def test_galileos_laws():
    """IOV: at the middle of the turn the auxiliary Sun is 2 deg from the plane: yaw of 90 deg.

    FOC: 10 deg from the collinear point on the law, 90 deg when it is passed in beta of nought.
    """
    for middle in (0.0, np.pi):
        for beta, due in ((0.01, -0.5 * np.pi), (-0.01, 0.5 * np.pi)):
            at = around(middle - 1e-12)
            assert yaw_angle(GAL_IOV, beta, at, GAL_RATE, GAL_M)[0] == pytest.approx(due, abs=1e-6)
    # Where the turn begins the law of the auxiliary Sun is the nominal one.
    edge = np.arcsin(np.sin(np.radians(15.0)) / np.cos(0.01)) * (1 - 1e-9)
    assert yaw_angle(GAL_IOV, 0.01, edge, GAL_RATE, GAL_M)[0] == pytest.approx(
        nominal_yaw(0.01, edge), abs=1e-6
    )
    beta = np.radians(1.0)
    begin = np.arccos(np.cos(np.radians(10.0)) / np.cos(beta))
    yaw, flags = yaw_angle(GAL_FOC, beta, -begin + 1e-9, GAL_RATE, GAL_M)
    assert flags == TURNING
    assert yaw == pytest.approx(nominal_yaw(beta, -begin), abs=1e-6)
    # 5656 s are four times what 10 deg take.
    tiny = np.radians(1e-3)
    assert yaw_angle(GAL_FOC, tiny, 0.0, GAL_RATE, GAL_M)[0] == pytest.approx(
        -0.5 * np.pi, abs=0.02
    )


def test_shadow():
    """Behind the Earth the umbra, at its edge half of it, beside it light."""
    sun = np.array([SUN_M, 0.0, 0.0])
    assert in_shadow(np.array([-GPS_M, 0.0, 0.0]), sun) == 1.0
    assert in_shadow(np.array([GPS_M, 0.0, 0.0]), sun) == 0.0
    edge = np.arcsin(6378137.0 / GPS_M)
    # The Sun's centre is behind the Earth's edge where the cone to it says so.
    at = GPS_M * np.array([-np.cos(edge), np.sin(edge), 0.0])
    assert in_shadow(at, sun) == pytest.approx(0.5, abs=0.05)
    width = np.radians(0.27)
    out = GPS_M * np.array([-np.cos(edge + width), np.sin(edge + width), 0.0])
    assert in_shadow(out, sun) == pytest.approx(0.0, abs=0.05)
