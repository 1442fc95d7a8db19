"""The three flights have the sizes that Lee (2010, section 5.1) gives."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from replay.simulate.motion import move
from replay.simulate.scenario import load_scenario

FOLDER = Path(__file__).parents[2] / "replay" / "batch" / "lee2010"
RANGES_KM = {1: (57.0, 65.0), 2: (75.0, 85.0), 3: (90.0, 101.0)}
STATION = re.compile(r"#\s+(M?REF\d?)\s+([\d.]+) N\s+([\d.]+) E\s+(\d+) m")


def stations(case: int) -> dict[str, np.ndarray]:
    text = (FOLDER / f"case{case}.toml").read_text(encoding="utf-8")
    return {
        name: np.array(pymap3d.geodetic2ecef(float(lat), float(lon), float(height)))
        for name, lat, lon, height in STATION.findall(text)
    }


@pytest.mark.parametrize("case", [1, 2, 3])
def test_a_flight_is_that_of_the_paper(case):
    scenario = load_scenario(FOLDER / f"case{case}.toml")
    assert len(scenario.segments) == 63
    assert scenario.settings.imu.rate == 64.0
    moved = move(scenario)
    assert len(moved.trajectory.rates) == 2238 * 64
    poses = moved.trajectory.poses(np.arange(2239.0))
    lat, lon, height = pymap3d.ecef2geodetic(*poses["r"].T)
    assert height.min() > 690.0
    assert height.max() < 730.0
    # 55 m/s along the lines; slower only where a line ends.
    speed = np.linalg.norm(poses["v_enu"], axis=1)
    assert np.median(speed) == pytest.approx(55.0, rel=1e-9)
    assert speed.mean() == pytest.approx(55.0, abs=1.0)
    assert speed.min() > 49.9
    master = stations(case)["MREF"]
    distance = np.linalg.norm(poses["r"] - master, axis=1) / 1e3
    low, high = RANGES_KM[case]
    assert low - 0.1 < distance.min()
    assert distance.max() < high + 0.1
    # Inside the network, so that corrections are interpolated.
    assert 34.68 < lat.min() < lat.max() < 35.72
    assert 128.18 < lon.min() < lon.max() < 129.22
    banks = np.degrees(poses["attitude"][:, 0])
    assert banks.max() == pytest.approx(25.0, abs=0.1)
    assert banks.min() == pytest.approx(-25.0, abs=0.1)


def test_the_three_span_57_to_101_km_from_one_network():
    assert stations(1).keys() == {"MREF", "REF1", "REF2", "REF3"}
    ends = []
    for case in (1, 2, 3):
        network = stations(case)
        for name, place in stations(1).items():
            np.testing.assert_array_equal(network[name], place)
        poses = move(load_scenario(FOLDER / f"case{case}.toml")).trajectory.poses(np.arange(2239.0))
        ends.append(np.linalg.norm(poses["r"] - network["MREF"], axis=1) / 1e3)
    assert min(d.min() for d in ends) == pytest.approx(57.0, abs=0.1)
    assert max(d.max() for d in ends) == pytest.approx(101.0, abs=0.1)
    place = stations(1)
    north = np.linalg.norm(place["MREF"] - place["REF3"]) / 1e3
    east = np.linalg.norm(place["MREF"] - place["REF1"]) / 1e3
    assert north == pytest.approx(115.0, abs=1.0)
    assert east == pytest.approx(95.0, abs=1.5)
