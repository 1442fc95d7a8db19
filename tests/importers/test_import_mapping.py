"""Units, signs, axes, positions and covariances against closed forms and other libraries."""

from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from replay.errors import ConfigurationError, ForeignFileError
from replay.importers.files import File
from replay.importers.geodesy import Places, gravity_reaction
from replay.importers.mounting import mounting_matrix, rotate
from replay.importers.spec import Absence, Code, Value
from replay.importers.table import Table
from replay.importers.values import pick, pick_quality

FILE = File("small.csv", b"", "", 0)
LAT = np.array([40.1, -33.9, 0.0, 89.999])
LON = np.array([-105.2, 18.4, 180.0, 12.0])
HEIGHT = np.array([1600.0, -20.0, 0.0, 3000.0])


def table(**columns: list[float]) -> Table:
    count = len(next(iter(columns.values())))
    numbers = {name: np.array(values, dtype=float) for name, values in columns.items()}
    return Table(FILE, numbers, {}, np.arange(1, count + 1))


def times(count: int) -> np.ndarray:
    return np.arange(count, dtype=np.int64)


@pytest.mark.parametrize(
    ("unit", "written", "factor"),
    [
        ("rad/s", "deg/s", math.pi / 180),
        ("rad/s", "deg/h", math.pi / 180 / 3600),
        ("m/s^2", "g", 9.80665),
        ("m/s^2", "mg", 9.80665e-3),
        ("m/s", "km/h", 1 / 3.6),
        ("m", "cm", 0.01),
        ("degC", "degC", 1.0),
    ],
)
def test_units(unit: str, written: str, factor: float) -> None:
    value = Value(columns=("a", "-b"), unit=written)
    picked = pick(table(a=[2.0, -4.0], b=[1.0, 3.0]), times(2), "f", value, unit, 2)
    np.testing.assert_allclose(
        picked.values, np.array([[2.0, -1.0], [-4.0, -3.0]]) * factor, rtol=1e-15
    )
    assert picked.present.all()


def test_a_constant_stands_in_every_row() -> None:
    value = Value(constant=(1.0, 2.0), unit="cm")
    picked = pick(table(a=[0.0, 0.0]), times(2), "f", value, "m", 2)
    np.testing.assert_array_equal(picked.values, [[0.01, 0.02], [0.01, 0.02]])


def test_absence_by_value_by_time_and_by_emptiness() -> None:
    rows = table(a=[1.0, 2.0, 3.0, math.nan], flag=[0.0, 7.0, 7.0, 7.0])
    at = np.array([10, 20, 30, 40], dtype=np.int64) * 1_000_000_000
    value = Value(
        columns=("a",),
        unit="m",
        absent_when=Absence(column="flag", equals=0.0),
        absent_before="1980-01-06T00:00:25",
    )
    picked = pick(rows, at, "f", value, "m", 1)
    assert picked.present.tolist() == [False, False, True, False]
    assert np.isnan(picked.scalar[[0, 1, 3]]).all()


def test_a_unit_of_another_kind_is_named_with_those_that_fit() -> None:
    with pytest.raises(ConfigurationError, match="unit 'm/s' is none of rad/s") as error:
        pick(table(a=[1.0]), times(1), "rate", Value(columns=("a",), unit="m/s"), "rad/s", 1)
    assert "deg/s" in error.value.mend
    with pytest.raises(ConfigurationError, match="rate has no unit"):
        pick(table(a=[1.0]), times(1), "rate", Value(columns=("a",)), "rad/s", 1)


def test_a_missing_column_names_the_nearest() -> None:
    value = Value(columns=("gyro_x",), unit="rad/s")
    with pytest.raises(ForeignFileError, match="no column 'gyro_x'") as error:
        pick(table(gyrox=[1.0]), times(1), "rate", value, "rad/s", 1)
    assert "did you mean gyrox?" in error.value.mend
    assert error.value.where == "small.csv"


def test_a_wrong_number_of_columns() -> None:
    value = Value(columns=("a",), unit="rad/s")
    with pytest.raises(ConfigurationError, match="rate takes 3 columns or 3 constants, not 1"):
        pick(table(a=[1.0]), times(1), "rate", value, "rad/s", 3)


def test_quality_codes() -> None:
    quality, unnamed = pick_quality(
        table(Q=[1.0, 2.0, 9.0]), Code(column="Q", map={"1": "RTK_FIXED", "2": "SINGLE"})
    )
    assert quality.tolist() == [6, 1, 0]
    assert unnamed.tolist() == [False, False, True]
    with pytest.raises(ConfigurationError, match="'FIXED' is no fix quality"):
        pick_quality(table(Q=[1.0]), Code(constant="FIXED"))


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        ("forward-right-down", [1, 2, 3]),
        ("forward-left-up", [1, -2, -3]),
        ("right-forward-up", [2, 1, -3]),
        ("down-right-back", [-3, 2, 1]),
    ],
)
def test_named_axes(axes: str, expected: list[int]) -> None:
    matrix = mounting_matrix([f"axes {axes}"])
    np.testing.assert_array_equal(matrix @ [1, 2, 3], expected)


def test_left_handed_axes_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="not right-handed"):
        mounting_matrix(["axes forward-right-up"])


@pytest.mark.parametrize(
    "step", ["roll", "roll 3", "spin 3 deg", "roll 3 m", "axes a-b-c", "roll x deg"]
)
def test_an_unclear_step_is_refused_by_name(step: str) -> None:
    with pytest.raises(ConfigurationError, match="mounting step"):
        mounting_matrix([step])


def test_quarter_turns_are_exact() -> None:
    np.testing.assert_array_equal(mounting_matrix(["yaw 90 deg"]) @ [1, 0, 0], [0, 1, 0])
    np.testing.assert_array_equal(mounting_matrix(["pitch 90 deg"]) @ [0, 0, 1], [1, 0, 0])
    np.testing.assert_array_equal(mounting_matrix(["roll -180 deg"]), np.diag([1, -1, -1]))


@given(st.tuples(*[st.floats(-360, 360)] * 3))
def test_steps_are_turns_one_after_another(angles: tuple[float, float, float]) -> None:
    steps = [f"{w} {a!r} deg" for w, a in zip(("roll", "pitch", "yaw"), angles, strict=True)]
    # Lower case: about the fixed axes, in this order.
    expected = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    np.testing.assert_allclose(mounting_matrix(steps), expected, atol=1e-13)


def test_the_boulder_mounting_in_frame_rotations() -> None:
    def frame(axis: int, degrees: float) -> np.ndarray:
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        return {
            1: np.array([[1, 0, 0], [0, c, s], [0, -s, c]]),
            2: np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]),
            3: np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]),
        }[axis]

    expected = frame(1, 180).T @ frame(3, 180).T @ frame(2, -6.79).T @ frame(3, -5.35).T
    matrix = mounting_matrix(["yaw -5.35 deg", "pitch -6.79 deg", "yaw 180 deg", "roll 180 deg"])
    np.testing.assert_allclose(matrix, expected, atol=1e-15)
    vectors = np.random.default_rng(1).normal(size=(20, 3))
    np.testing.assert_allclose(rotate(matrix, vectors), vectors @ expected.T, atol=1e-14)


def test_positions_and_vectors_agree_with_pymap3d() -> None:
    places = Places.from_geodetic(np.radians(LAT), np.radians(LON), HEIGHT)
    expected = np.stack(pymap3d.geodetic2ecef(LAT, LON, HEIGHT), axis=1)
    np.testing.assert_allclose(places.ecef_m, expected, rtol=0, atol=3e-9)
    enu = np.array([[1.0, 2.0, 3.0], [-4.0, 0.5, 0.0], [9.0, -8.0, 7.0], [0.0, 0.0, 1.0]])
    velocity = np.stack(pymap3d.enu2ecefv(enu[:, 0], enu[:, 1], enu[:, 2], LAT, LON), axis=1)
    np.testing.assert_allclose(places.enu_to_ecef(enu), velocity, atol=1e-13)
    same = Places.from_ecef(expected)
    np.testing.assert_allclose(same.ecef_to_enu(velocity), enu, atol=1e-12)


def test_an_empty_position_stays_empty() -> None:
    nan = np.array([math.nan])
    places = Places.from_geodetic(nan, np.zeros(1), np.zeros(1))
    assert np.isnan(places.ecef_m).all()
    assert np.isnan(Places.from_ecef(np.full((1, 3), math.nan)).sin_lat).all()


def test_gravity_reaction_is_minus_gravity_in_body_axes() -> None:
    roll, pitch, heading = 0.1, -0.2, 1.3
    to_ned = Rotation.from_euler("ZYX", [heading, pitch, roll])
    expected = to_ned.inv().apply([0.0, 0.0, -9.8])
    made = gravity_reaction(np.array([roll]), np.array([pitch]), 9.8)
    np.testing.assert_allclose(made, [expected], atol=1e-14)
