"""The eccentricity's effect on a clock against the formula by the elements of the orbit."""

from __future__ import annotations

import numpy as np
import pytest

from replay.kernels.relativity import eccentricity_clock

MU, C = 3.986004418e14, 299792458.0


@pytest.mark.parametrize("e", [0.0, 0.004, 0.02, 0.16])
@pytest.mark.parametrize("E", [0.0, 0.7, 2.5, -1.4])
def test_by_elements(e, E):
    """-2 sqrt(mu a) e sin(E) / c^2; the velocity in ECEF serves as the inertial one."""
    a = 27_977_000.0
    n = np.sqrt(MU / a**3)
    flat = np.sqrt(1.0 - e * e)
    r = a * np.array([np.cos(E) - e, flat * np.sin(E), 0.0])
    v = a * n / (1.0 - e * np.cos(E)) * np.array([-np.sin(E), flat * np.cos(E), 0.0])
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    r, v = turn @ r, turn @ v
    due = -2.0 * np.sqrt(MU * a) * e * np.sin(E) / C**2
    assert eccentricity_clock(r, v) == pytest.approx(due, abs=1e-20)
    turning = v - np.cross([0.0, 0.0, 7.292115e-5], r)
    assert eccentricity_clock(r, turning) == pytest.approx(due, abs=1e-20)
