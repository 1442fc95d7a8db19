"""Differences of code biases as biases of single codes."""

from __future__ import annotations

import numpy as np
import pytest

from replay.gnss.code_biases import clock_references, single_biases
from replay.kernels.gnss_records import satellite_number
from replay.kernels.product_series import BIAS_DTYPE, observation_number

NS = 1e-9
RATIO = (1575.42 / 1227.60) ** 2


def number(name: str) -> int:
    return observation_number(*name.encode())


def rows_of(*biases: tuple[str, str, float]):
    rows = np.zeros(len(biases), dtype=BIAS_DTYPE)
    for row, (first, second, value) in zip(rows, biases, strict=True):
        row["first"], row["second"] = number(first), number(second) if second else 0
        row["value"], row["until"] = value, 10**18
    return rows, np.full(len(biases), satellite_number(0, 5), dtype=np.int64)


def solved(*biases: tuple[str, str, float]) -> dict[int, float]:
    rows, _ = single_biases(*rows_of(*biases), clock_references([]))
    assert (rows["second"] == 0).all()
    return dict(zip(rows["first"].tolist(), rows["value"].tolist(), strict=True))


def test_the_combination_that_clocks_refer_to_has_no_bias() -> None:
    found = solved(("C1W", "C2W", 4 * NS), ("C1C", "C1W", -1.5 * NS))
    first, second = found[number("C1W")], found[number("C2W")]
    assert first - second == pytest.approx(4 * NS)
    assert RATIO * first - second == pytest.approx(0.0, abs=1e-15)
    assert found[number("C1C")] - first == pytest.approx(-1.5 * NS)


def test_a_bias_that_is_given_is_where_differences_begin() -> None:
    found = solved(("C1W", "", 2 * NS), ("C1C", "C1W", 0.5 * NS), ("C5Q", "C1C", -3 * NS))
    assert found == pytest.approx(
        {number("C1W"): 2 * NS, number("C1C"): 2.5 * NS, number("C5Q"): -0.5 * NS}
    )


def test_differences_that_nothing_holds_say_nothing() -> None:
    assert solved(("C5Q", "C5X", 1 * NS)) == {}


def test_products_say_what_their_clocks_refer_to() -> None:
    found = clock_references(
        ["about; clocks refer to E C1X C5X C1C C5Q; clocks refer to C C2I C7I"]
    )
    assert found["E"] == ("C1X", "C5X")
    assert found["C"] == ("C2I", "C7I")
    assert found["G"] == ("C1W", "C2W")
