"""Maps of the ionosphere: closed forms within a map, between maps and along a line of sight."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from replay.gnss.products import IonosphereMaps, ionosphere_maps
from replay.kernels import ionosphere_maps as kernel
from replay.log.columns import Columns, Ragged

NS = 1_000_000_000
START = 1_277_000_000 * NS
RADIUS, HEIGHT = 6371e3, 450e3
LATITUDES = np.radians(np.arange(87.5, -88.0, -2.5))
LONGITUDES = np.radians(np.arange(-180.0, 181.0, 5.0))
Content = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


def grid(
    content: Content, hours: list[float], longitudes: np.ndarray = LONGITUDES
) -> IonosphereMaps:
    """Maps of a function of latitude, longitude (rad) and time (s)."""
    n = len(hours)
    lat, lon = np.meshgrid(LATITUDES, longitudes, indexing="ij")
    values = np.array([content(lat, lon, hour * 3600.0).ravel() for hour in hours])
    columns = Columns.build(
        START + np.rint(np.array(hours) * 3600e9).astype(np.int64),
        {
            "height_m": np.full(n, HEIGHT),
            "base_radius_m": np.full(n, RADIUS),
            "latitude_first_rad": np.full(n, LATITUDES[0]),
            "latitude_step_rad": np.full(n, math.radians(-2.5)),
            "latitude_count": np.full(n, len(LATITUDES)),
            "longitude_first_rad": np.full(n, longitudes[0]),
            "longitude_step_rad": np.full(n, math.radians(5.0)),
            "longitude_count": np.full(n, len(longitudes)),
            "tec_tecu": Ragged.from_matrix(values),
            "rms_tecu": Ragged.from_matrix(0.1 * np.abs(values)),
        },
    )
    return ionosphere_maps(columns)


def vertical(maps: IonosphereMaps, seconds: float, lat: float, lon: float) -> tuple[float, float]:
    return kernel.slant_tec(
        maps.maps, maps.tec, maps.rms, START + round(seconds * 1e9), math.radians(lat),
        math.radians(lon), 0.0, math.pi / 2, kernel.THIN_LAYER,
    )  # fmt: skip


def test_a_bilinear_content_is_met_exactly() -> None:
    maps = grid(lambda lat, lon, t: 20.0 + 5.0 * lat + 3.0 * lon + 2.0 * lat * lon, [0.0])
    for lat, lon in ((0.0, 0.0), (51.3, 4.4), (-33.9, 151.2), (86.0, -179.9), (-87.5, 179.9)):
        a, b = math.radians(lat), math.radians(lon)
        value, deviation = vertical(maps, 0.0, lat, lon)
        assert value == pytest.approx(20.0 + 5.0 * a + 3.0 * b + 2.0 * a * b, abs=1e-9)
        assert deviation == pytest.approx(0.1 * value, rel=1e-3)


def test_longitudes_close() -> None:
    """With and without the column at the end that repeats the first, and beyond the seam."""

    def content(lat: np.ndarray, lon: np.ndarray, _: float) -> np.ndarray:
        return 20.0 + np.cos(lon) * np.cos(lat)

    whole, open_ended = grid(content, [0.0]), grid(content, [0.0], LONGITUDES[:-1])
    for lon in (-180.0, 180.0, 178.1, -178.1, 541.9, -541.9, 3.3):
        expected = vertical(whole, 0.0, 12.5, lon)[0]
        assert vertical(open_ended, 0.0, 12.5, lon)[0] == pytest.approx(expected, abs=1e-9)
    # The repeating column is the first one: both sides of the seam are the same place.
    assert vertical(whole, 0.0, 12.5, 181.9)[0] == pytest.approx(
        vertical(whole, 0.0, 12.5, -178.1)[0], abs=1e-9
    )


def test_between_maps_the_ionosphere_follows_the_sun() -> None:
    """A content that moves with the Sun stays what it is; one that grows, grows evenly."""
    turn = 2.0 * math.pi / 86_400.0

    def content(lat: np.ndarray, lon: np.ndarray, t: float) -> np.ndarray:
        return np.asarray((20.0 + 4.0 * lat + 3.0 * (lon + turn * t)) * (1.0 + t / 7200.0))

    maps = grid(content, [0.0, 2.0])
    for seconds in (0.0, 900.0, 3600.0, 7199.0, 7200.0):
        a, b = math.radians(40.1), math.radians(11.2)
        expected = (20.0 + 4.0 * a + 3.0 * (b + turn * seconds)) * (1.0 + seconds / 7200.0)
        assert vertical(maps, seconds, 40.1, 11.2)[0] == pytest.approx(expected, abs=1e-9)


def test_what_is_not_known() -> None:
    def content(lat: np.ndarray, lon: np.ndarray, _: float) -> np.ndarray:
        values = np.full(lat.shape, 10.0)
        values[30:35, 20:25] = np.nan
        return values

    maps = grid(content, [0.0, 2.0, 4.0, 8.0, 10.0, 12.0])
    assert maps.maps["gap"].tolist() == [0, 0, 0, 1, 0, 0]
    for seconds in (-1.0, 12 * 3600.0 + 1.0, 5 * 3600.0):
        assert math.isnan(vertical(maps, seconds, 0.0, 100.0)[0])
    for seconds in (0.0, 4 * 3600.0, 8 * 3600.0, 12 * 3600.0):
        assert vertical(maps, seconds, 0.0, 100.0)[0] == pytest.approx(10.0)
    lat, lon = np.degrees(LATITUDES[32]), np.degrees(LONGITUDES[22])
    assert math.isnan(vertical(maps, 0.0, float(lat), float(lon))[0])
    # The pole's last rows are those at 87.5 degrees.
    assert vertical(maps, 0.0, 89.0, 0.0)[0] == pytest.approx(10.0)


def test_a_line_of_sight() -> None:
    """Pierce point by vectors; the mapping by the angle of ray and radius there."""
    rng = np.random.default_rng(7)
    ratio = RADIUS / (RADIUS + HEIGHT)
    for _ in range(50):
        lat, lon = math.radians(rng.uniform(-89.0, 89.0)), rng.uniform(-math.pi, math.pi)
        azimuth, elevation = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.05, 1.55)
        up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
        east = np.array([-math.sin(lon), math.cos(lon), 0.0])
        north = np.cross(up, east)
        level = math.sin(azimuth) * east + math.cos(azimuth) * north
        ray = math.cos(elevation) * level + math.sin(elevation) * up
        x = RADIUS * up
        b = x @ ray
        length = -b + math.sqrt(b * b + (RADIUS + HEIGHT) ** 2 - RADIUS**2)
        there = (x + length * ray) / (RADIUS + HEIGHT)
        a, o = kernel.pierce_point(lat, lon, azimuth, elevation, ratio)
        found = [math.cos(a) * math.cos(o), math.cos(a) * math.sin(o), math.sin(a)]
        np.testing.assert_allclose(found, there, atol=1e-12)
        slant = kernel.layer_mapping(elevation, ratio, kernel.THIN_LAYER)
        assert slant == pytest.approx(1.0 / (there @ ray), rel=1e-12)


def test_one_unit_of_content() -> None:
    assert kernel.tecu_delay(1575.42e6) == pytest.approx(0.1624, abs=5e-5)  # m on L1
