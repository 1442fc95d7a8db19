"""Precise products from columns to records, and what is looked up in them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from replay.errors import ConfigurationError
from replay.gnss.measurements import SATELLITE_NAMES
from replay.gnss.products import (
    bias_series,
    clock_series,
    interpolation_record,
    orbit_series,
    rotation_records,
    satellite_numbers,
)
from replay.kernels.product_series import earth_rotation, observation_number, signal_bias
from replay.log.columns import Columns, Ragged
from replay.schemas import products_pb2

NS = 1_000_000_000
START = 1_277_000_000 * NS
G05, E11 = (SATELLITE_NAMES.tolist().index(name) for name in (b"G05", b"E11"))


def orbits(names: list[str], seconds: list[float], clocks: list[float] | None = None) -> Columns:
    n = len(names)
    clock = np.full(n, np.nan) if clocks is None else np.array(clocks)
    position = np.outer(np.arange(n) + 1.0, [1e6, 2e6, 3e6])
    return Columns.build(
        START + np.rint(np.array(seconds) * 1e9).astype(np.int64),
        {
            "satellite": np.array(names, dtype="S3"),
            "position_ecef_m": position,
            "velocity_ecef_m_s": np.full((n, 3), np.nan),
            "clock_s": clock,
            "position_std_ecef_m": np.full((n, 3), 0.02),
            "clock_std_s": np.full(n, np.nan),
            "orbit_predicted": np.zeros(n, dtype=np.bool_),
            "manoeuvre": np.arange(n) == 1,
            "clock_predicted": np.zeros(n, dtype=np.bool_),
            "clock_event": np.arange(n) == 2,
        },
        present={
            "position_ecef_m": np.arange(n) != 4,
            "clock_s": np.isfinite(clock),
            "clock_std_s": np.zeros(n, dtype=np.bool_),
        },
    )


def test_satellites_have_their_numbers() -> None:
    number, unknown = satellite_numbers(np.array([b"G05", b"S20", b"E11", b"", b"I02"]))
    assert number.tolist() == [G05, -1, E11, -1, -1]
    assert unknown == ("I02", "S20")


def test_orbits_are_grouped_and_parted() -> None:
    names = ["E11", "G05", "E11", "G05", "E11", "E11", "S20"]
    seconds = [0.0, 0.0, 900.0, 900.0, 1800.0, 2700.0, 0.0]
    series = orbit_series(orbits(names, seconds))
    assert series.unknown == ("S20",)
    assert np.diff(series.starts)[[G05, E11]].tolist() == [2, 3]
    assert series.starts[-1] == 5
    gps = series.rows[series.starts[G05] : series.starts[G05 + 1]]
    assert gps["position"][:, 0].tolist() == [2e6, 4e6]
    assert gps["gap"].tolist() == [1, 0]  # the manoeuvre
    assert gps["std"] == pytest.approx([0.02, 0.02])
    galileo = series.rows[series.starts[E11] : series.starts[E11 + 1]]
    # The row without a position leaves a step of 1800 s, the only one but for one of 900 s.
    assert ((galileo["t"] - START) // NS).tolist() == [0, 900, 2700]


def test_clocks_of_orbits_stand_in_where_there_are_no_others() -> None:
    both = orbits(["G05", "E11", "G05", "E11"], [0.0, 0.0, 900.0, 900.0], [1.0, 2.0, 3.0, 4.0])
    clocks = Columns.build(
        START + np.array([0, 0, 30]) * NS,
        {
            "satellite": np.array([b"G05", b"", b"G05"]),
            "station": np.array([b"", b"BRUX", b""]),
            "clock_s": np.array([5.0, 6.0, 7.0]),
            "clock_std_s": np.array([1e-11, np.nan, np.nan]),
        },
        present={
            "satellite": np.array([True, False, True]),
            "clock_std_s": np.array([True, False, False]),
        },
    )
    series = clock_series(clocks, both)
    gps = series.rows[series.starts[G05] : series.starts[G05 + 1]]
    galileo = series.rows[series.starts[E11] : series.starts[E11 + 1]]
    assert gps["clock"].tolist() == [5.0, 7.0] and galileo["clock"].tolist() == [2.0, 4.0]
    assert gps["std"][0] == 1e-11 and math.isnan(gps["std"][1])
    alone = clock_series(None, both)
    gps = alone.rows[alone.starts[G05] : alone.starts[G05 + 1]]
    assert gps["clock"].tolist() == [1.0, 3.0] and gps["gap"].tolist() == [0, 1]  # the event
    assert len(clock_series(None).rows) == 0


def test_degree() -> None:
    assert interpolation_record()["least"][0] == 11
    for degree in (0, 16):
        with pytest.raises(ConfigurationError):
            interpolation_record(degree=degree)


def number(name: str) -> int:
    return int(observation_number(*name.encode()))


def test_biases() -> None:
    first = ["C1C", "C1C", "C2W", "C1W", "C1C"]
    second = ["", "", "", "C2W", ""]
    osb, dsb = products_pb2.BIAS_KIND_OSB, products_pb2.BIAS_KIND_DSB
    columns = Columns.build(
        np.full(5, START),
        {
            "satellite": np.array([b"G05", b"G05", b"G05", b"G05", b""]),
            "station": Ragged.from_texts(["", "", "", "", "BRUX"]),
            "system": Ragged.from_texts(["G"] * 5),
            "kind": np.array([osb, osb, osb, dsb, osb]),
            "observation": Ragged.from_texts(first),
            "second_observation": Ragged.from_texts(second),
            "value_s": np.array([1e-9, 2e-9, 3e-9, 4e-9, 5e-9]),
            "value_std_s": np.full(5, 1e-11),
            "slope_s_s": np.full(5, np.nan),
            "valid_from_ns": np.array([START, START + 100 * NS, 0, START, START]),
            "valid_until_ns": np.array([START + 100 * NS, START + 200 * NS, 0, 0, 0]),
        },
        present={"satellite": np.array([True] * 4 + [False]), "slope_s_s": np.zeros(5, np.bool_)},
    )
    series = bias_series(columns)
    assert len(series.rows) == 4

    def ask(satellite: int, one: str, other: str, seconds: int) -> float:
        begin, end = series.starts[satellite : satellite + 2]
        less = number(other) if other else 0
        return float(signal_bias(series.rows, begin, end, number(one), less, START + seconds * NS))

    assert ask(G05, "C1C", "", 0) == 1e-9 and ask(G05, "C1C", "", 99) == 1e-9
    assert ask(G05, "C1C", "", 100) == 2e-9
    assert ask(G05, "C2W", "", -10_000) == 3e-9
    assert ask(G05, "C1W", "C2W", 0) == 4e-9 and ask(G05, "C2W", "C1W", 0) == -4e-9
    for missing in (("C1C", "", 200), ("C1C", "", -1), ("C1W", "", 0), ("C1C", "C2W", 0)):
        assert math.isnan(ask(G05, *missing))
    assert math.isnan(ask(E11, "C1C", "", 0))


def test_rotation() -> None:
    """A line between days, over a leap second too; beyond them the rates."""
    day = 86_400
    columns = Columns.build(
        START + np.array([day, 0]) * NS,
        {
            "polar_x_rad": np.array([3e-6, 1e-6]),
            "polar_y_rad": np.array([2e-6, 2e-6]),
            "ut1_utc_s": np.array([0.399, -0.6]),  # a leap second, and a day that is 1 ms longer
            "length_of_day_s": np.array([1e-3, 1e-3]),
            "polar_x_rate_rad_s": np.array([1e-12, 2e-12]),
            "polar_y_rate_rad_s": np.array([np.nan, np.nan]),
        },
        present={"polar_y_rate_rad_s": np.zeros(2, dtype=np.bool_)},
    )
    rows = rotation_records(columns)
    out = np.zeros(4)
    assert earth_rotation(rows, START + day // 2 * NS, 0.0, out)
    np.testing.assert_allclose(out, [2e-6, 2e-6, -0.6005, 1e-3], rtol=1e-12)
    assert not earth_rotation(rows, START - NS, 0.5, out)
    assert earth_rotation(rows, START - 3600 * NS, 3600.0, out)
    np.testing.assert_allclose(
        out, [1e-6 - 3600 * 2e-12, 2e-6, -0.6 + 1e-3 / 24.0, 1e-3], rtol=1e-12
    )
    assert earth_rotation(rows, START + (day + 3600) * NS, 3600.0, out)
    np.testing.assert_allclose(
        out, [3e-6 + 3600 * 1e-12, 2e-6, 0.399 - 1e-3 / 24.0, 1e-3], rtol=1e-12
    )
    assert not earth_rotation(rows[:0], START, 1e9, out)
