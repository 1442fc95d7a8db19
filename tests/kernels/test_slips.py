"""A jump of a phase is found by each detector, told with its size, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from replay.kernels import slip_records, slips
from replay.kernels.gnss_records import SATELLITES, SLOTS
from tests.kernels.synthetic_phases import F1, F2, Scene, slip, slip_settings

OFF = {
    "loss_of_lock": False,
    "lock_time": False,
    "half_cycles": False,
    "geometry_free": 0.0,
    "wide_lane": 0.0,
    "doppler": 0.0,
}
NOISE = {"phase_noise": 0.002, "code_noise": 0.2}


def search(epochs, rows, **keys):
    """Rows of slips, states of all phases (epochs, n, SLOTS) and clock jumps."""
    config = slip_settings(**keys)
    state = slip_records.new_slip_state()
    found = np.zeros(20 * len(rows), dtype=slip_records.SLIP_ROW_DTYPE)
    count = np.zeros(1, dtype=np.int64)
    states, jumps = [], []
    for epoch in epochs:
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        broken = np.zeros((SATELLITES, SLOTS), dtype=np.int64)
        jumps.append(
            slips.detect_slips(
                state[0], config[0], epoch, part, broken, found, count,
                np.zeros(SATELLITES * SLOTS),
            )
        )  # fmt: skip
        states.append(broken[: epoch["count"]].copy())
    return found[: count[0]], np.array(states), np.array(jumps)


def test_good_phases_are_continuous():
    epochs, rows = Scene(**NOISE).epochs(60)
    found, states, jumps = search(epochs, rows)
    assert len(found) == 0
    assert (states[0] == slip_records.NEW).all()
    assert (states[1:, :, :2] == slip_records.CONTINUOUS).all()
    assert not jumps.any()


@pytest.mark.parametrize(("first", "second"), [(1, 0), (0, -1), (1, 1), (-4, 2), (5, 2), (60, 17)])
def test_two_frequencies_tell_which_one_jumped_and_how_far(first, second):
    scene = Scene(**NOISE)
    epochs, rows = scene.epochs(50)
    for slot, cycles in enumerate((first, second)):
        slip(rows, 4, slot, 40, cycles, scene.satellites)
    found, states, _ = search(epochs, rows, **{**OFF, "geometry_free": 0.025, "wide_lane": 5.0})
    assert set(found["satellite"]) == {4}
    assert set(found["t"]) == {epochs[40]["t"]}
    sizes = {int(row["signal"]) % 256 - ord("1"): row["size"] for row in found}
    assert sizes == {slot: n for slot, n in enumerate((first, second)) if n}
    expected = np.zeros_like(states[1:])
    expected[:, :, 2] = slip_records.NEW
    expected[39, 4, :2] = [first != 0, second != 0]
    np.testing.assert_array_equal(states[1:], expected)


def test_the_wide_lane_finds_what_the_geometry_free_phase_hardly_shows():
    # 9 and 7 cycles are 5.6 mm of the difference of the two phases.
    scene = Scene(**NOISE)
    epochs, rows = scene.epochs(50)
    slip(rows, 2, 0, 30, 9, scene.satellites)
    slip(rows, 2, 1, 30, 7, scene.satellites)
    assert not len(search(epochs, rows, **{**OFF, "geometry_free": 0.025})[0])
    found, _, _ = search(epochs, rows, **{**OFF, "wide_lane": 4.0})
    assert found["detector"].tolist() == [slip_records.WIDE_LANE] * 2
    assert found["size"].tolist() == [9.0, 7.0]


@pytest.mark.parametrize("cycles", [8, -15])
def test_one_frequency_against_its_doppler(cycles):
    scene = Scene(frequencies=(F1,), phase_noise=0.002)
    epochs, rows = scene.epochs(10)
    slip(rows, 1, 0, 6, cycles, scene.satellites)
    (row,), _, _ = search(epochs, rows, **{**OFF, "doppler": 5.0})
    assert row["detector"] == slip_records.DOPPLER
    assert (row["satellite"], row["t"]) == (1, epochs[6]["t"])
    assert row["size"] == pytest.approx(cycles, abs=0.5)
    assert abs(row["statistic"]) > row["threshold"]


def test_what_the_receiver_says():
    scene = Scene(frequencies=(F1,))
    n = scene.satellites
    epochs, rows = scene.epochs(8)
    rows["lock_lost"][3 * n + 0, 0] = 1
    rows["lock_lost"][4 * n + 1 :: n, 0] = 2  # a half cycle unknown from there on
    rows["lock_time"][5 * n + 2, 0] = 0.1
    found, states, _ = search(epochs, rows, **{**OFF, "doppler": 5.0})
    assert len(found) == 0
    told = {"loss_of_lock": True, "lock_time": True, "half_cycles": True}
    found, states, _ = search(epochs, rows, **{**OFF, **told})
    assert (found["detector"] == slip_records.LOSS_OF_LOCK).all()
    places = [(int((row["t"] - epochs["t"][0]) // 10**9), row["satellite"]) for row in found]
    assert places == [(3, 0), (4, 1), (5, 2)]
    assert [states[e, k, 0] for e, k in places] == [slip_records.SUSPECT] * 3


def test_a_phase_that_was_away_is_a_new_one():
    scene = Scene(frequencies=(F1,))
    epochs, rows = scene.epochs(8)
    rows["phase"][3 * scene.satellites + 5, 0] = np.nan
    (row,), states, _ = search(epochs, rows)
    assert (row["detector"], row["satellite"], row["t"]) == (slip_records.GAP, 5, epochs[4]["t"])
    assert states[3, 5, 0] == states[4, 5, 0] == slip_records.NEW
    assert states[5, 5, 0] == slip_records.CONTINUOUS


@pytest.mark.parametrize("of_phase", [True, False])
@pytest.mark.parametrize("jump_ms", [1, -2])
def test_a_jump_of_the_clock_is_not_a_slip_of_all(of_phase, jump_ms):
    """A millisecond in codes and phases, or in codes alone; times are as the clock reads them."""
    jump = jump_ms * 299792.458
    scene = Scene(**NOISE)
    epochs, rows = scene.epochs(40)
    late = rows[25 * scene.satellites :]
    late["code"] += jump
    if of_phase:
        late["phase"] += jump
    epochs["clock"][25:] += jump
    epochs["t"][25:] += jump_ms * 10**6
    found, states, jumps = search(epochs, rows)
    assert len(found) == 0
    assert (states[1:, :, :2] == slip_records.CONTINUOUS).all()
    assert np.flatnonzero(jumps).tolist() == [25]
    assert jumps[25] == pytest.approx(jump, abs=1.0)


def test_the_jumps_of_a_pair_are_those_of_both_phases():
    row = Scene().epochs(1)[1][0]
    la, lb = 299792458.0 / F1, 299792458.0 / F2
    for first in range(-6, 7):
        for second in range(-6, 7):
            known, a, b = slips.pair_jumps(
                row, 1, first * la - second * lb + 0.003, first - second + 0.2, 0.2
            )
            assert known == (first != 0 or second != 0)
            assert not known or (a, b) == (first, second)
