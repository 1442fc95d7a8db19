"""Displacements are exact without noise, honest with it, and slips are found and taken off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from replay.kernels import tdcp, tdcp_records
from replay.kernels.gnss_records import SLOTS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.kernels.single_records import RESIDUAL_DTYPE, SINGLE_ROW_DTYPE
from replay.kernels.slip_records import SLIP_ROW_DTYPE, TIME_DIFFERENCE
from tests.kernels.synthetic_phases import (
    EAST,
    F1,
    F2,
    HERE,
    NORTH,
    NS,
    UP,
    Scene,
    slip,
    slip_settings,
    tdcp_settings,
)

NO_DETECTOR = {
    "loss_of_lock": False,
    "lock_time": False,
    "half_cycles": False,
    "geometry_free": 0.0,
    "wide_lane": 0.0,
    "doppler": 0.0,
}
BLIND = slip_settings(**NO_DETECTOR)


class Run:
    """What came of some epochs."""

    def __init__(self, epochs, rows, config=None, detectors=None, cuts=()):
        config = tdcp_settings() if config is None else config
        detectors = slip_settings() if detectors is None else detectors
        state = tdcp_records.new_tdcp_state()
        parts = [[], [], [], [], []]
        for piece in np.split(epochs, cuts):
            made = [
                np.zeros(len(piece) + 1, dtype=SINGLE_ROW_DTYPE),
                np.zeros(len(piece) + 1, dtype=tdcp_records.DISPLACEMENT_DTYPE),
                np.zeros(SLOTS * len(rows), dtype=RESIDUAL_DTYPE),
                np.zeros(5 * SLOTS * len(rows), dtype=SLIP_ROW_DTYPE),
                np.zeros(SLOTS * len(rows), dtype=NOTE_DTYPE),
            ]
            counts = np.zeros(5, dtype=np.int64)
            work = np.zeros(1, dtype=SOLVE_DTYPE)
            tdcp.run_tdcp(state, config, detectors, piece, rows, work, *made, counts)
            # From one block to the next everything goes through the bytes of the state.
            state = np.frombuffer(state.tobytes(), dtype=tdcp_records.TDCP_STATE_DTYPE).copy()
            for part, table, count in zip(parts, made, counts, strict=True):
                part.append(table[:count])
        self.places, self.moved, self.residuals, self.slips, self.notes = map(np.concatenate, parts)

    def kinds(self):
        return self.notes["kind"].tolist()


def true_steps(scene, count):
    return np.diff([scene.place(scene.step * e) for e in range(count)], axis=0)


def local(vectors):
    return np.stack([vectors @ EAST, vectors @ NORTH, vectors @ UP], axis=-1)


@pytest.mark.parametrize("frequencies", [(F1,), (F1, F2)])
def test_without_noise_displacements_are_exact(frequencies):
    scene = Scene(frequencies=frequencies)
    run = Run(*scene.epochs(20))
    np.testing.assert_allclose(run.moved["d"], true_steps(scene, 20), rtol=0, atol=1e-6)
    assert run.moved["count"].tolist() == [scene.satellites] * 19
    assert (
        run.places["status"].tolist()
        == [tdcp_records.STATUS_SINGLE] + [tdcp_records.STATUS_CHAINED] * 19
    )
    # The receiver's clock is taken off the times.
    true = [NS * e - round(scene.clock(e) / 299792458.0 * NS) for e in range(20)]
    times = run.places["t"] - scene.epochs(1)[0]["t"][0]
    assert np.abs(times - true).max() <= 1
    assert run.moved["since"].tolist() == run.places["t"][:-1].tolist()
    assert not len(run.slips) and not len(run.notes)


def test_the_chain_keeps_the_error_of_its_beginning():
    scene = Scene(coarse_error=(3.0, -2.0, 4.0))
    run = Run(*scene.epochs(30))
    off = run.places["r"] - [scene.place(float(e)) for e in range(30)]
    np.testing.assert_allclose(off[0], scene.coarse_error, atol=1e-8)
    # Satellites of this sky turn by up to 2e-4 rad in a second.
    assert np.abs(np.diff(off, axis=0)).max() < 5.4 * 2e-4 * 2
    growth = run.places["cov"][:, [0, 3, 5]]
    assert (np.diff(growth, axis=0) > 0).all()
    np.testing.assert_allclose(
        growth[-1] - growth[0], run.moved["cov"][:, [0, 3, 5]].sum(axis=0), rtol=1e-3
    )


@pytest.mark.parametrize("slipped", [{3: 1}, {0: -2, 5: 7}, {1: 1, 2: 4, 6: -30}])
@pytest.mark.parametrize("frequencies", [(F1,), (F1, F2)])
def test_slips_that_no_detector_saw_are_found_and_taken_off(slipped, frequencies):
    scene = Scene(satellites=11, frequencies=frequencies, phase_noise=0.002)
    epochs, rows = scene.epochs(12)
    clean = Run(epochs, rows.copy(), detectors=BLIND)
    for satellite, cycles in slipped.items():
        slip(rows, satellite, 0, 7, cycles, scene.satellites)
    run = Run(epochs, rows, detectors=BLIND)
    assert {int(row["satellite"]): row["size"] for row in run.slips} == slipped
    assert set(run.slips["t"]) == {epochs["t"][7]}
    assert set(run.slips["detector"]) == {TIME_DIFFERENCE}
    assert run.slips["repaired"].all()
    assert run.kinds() == [tdcp_records.EVENT_SLIP_REPAIRED] * len(slipped)
    assert run.notes["value"].tolist() == [slipped[k] for k in run.notes["satellite"]]
    # With the jumps taken off nothing is lost.
    np.testing.assert_allclose(run.moved["d"], clean.moved["d"], rtol=0, atol=1e-7)


def test_jumps_that_two_frequencies_hardly_show_are_found_by_the_geometry():
    """Five and four cycles: 25 mm between the phases, one cycle of the wide lane."""
    scene = Scene(phase_noise=0.002, code_noise=0.3)
    epochs, rows = scene.epochs(30)
    slip(rows, 2, 0, 20, 5, scene.satellites)
    slip(rows, 2, 1, 20, 4, scene.satellites)
    run = Run(epochs, rows)
    sizes = {int(row["signal"]) % 256 - ord("1"): row["size"] for row in run.slips}
    assert sizes == {0: 5.0, 1: 4.0}


def test_half_a_cycle_is_taken_off_where_that_is_wanted():
    scene = Scene(phase_noise=0.001)
    epochs, rows = scene.epochs(6)
    slip(rows, 4, 0, 3, 1.5, scene.satellites)
    run = Run(epochs, rows, detectors=BLIND)
    assert run.slips["size"].tolist() == [1.5] and run.slips["repaired"].all()
    run = Run(epochs, rows, tdcp_settings(half_cycles=False), BLIND)
    assert not run.slips["repaired"].any()
    assert run.slips["size"] == pytest.approx([1.5], abs=0.05)
    assert run.kinds() == [12]
    refused = run.residuals[run.residuals["accepted"] == 0]
    assert refused["satellite"].tolist() == [4]


def test_a_false_alarm_costs_nothing():
    scene = Scene(phase_noise=0.002)
    epochs, rows = scene.epochs(6)
    clean = Run(epochs, rows.copy())
    rows["lock_lost"][3 * scene.satellites + 2, :2] = 1
    run = Run(epochs, rows)
    assert run.slips["size"].tolist() == [0.0, 0.0] and run.slips["repaired"].all()
    np.testing.assert_allclose(run.moved["d"], clean.moved["d"], rtol=0, atol=1e-7)
    assert not len(run.notes)


def test_errors_are_as_large_as_the_covariance_says():
    sigma, count = 0.004, 400
    scene = Scene(phase_noise=0.0, seed=8)
    epochs, rows = scene.epochs(count)
    made = np.random.default_rng(1)
    factor = np.sqrt(0.5 * (1 + 1 / np.sin(rows["elevation"]) ** 2))[:, None]
    rows["phase"] += sigma * factor * made.normal(size=rows["phase"].shape)
    run = Run(epochs, rows, tdcp_settings(phase_sigma=sigma, drift_sigma=0.0))
    error = local(run.moved["d"] - true_steps(scene, count))
    P = np.zeros((count - 1, 3, 3))
    for place, (a, b) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
        P[:, a, b] = P[:, b, a] = run.moved["cov"][:, place]
    square = np.einsum("ni,nij,nj->n", error, np.linalg.inv(P), error)
    # Every other one is independent: phases of two epochs are in neighbours.
    for part in (square[::2], square[1::2]):
        low, high = stats.chi2(3 * len(part)).ppf([0.001, 0.999])
        assert low < part.sum() < high
    freedom = 2 * scene.satellites - 4
    unit = run.moved["unit"][::2] ** 2 * freedom
    low, high = stats.chi2(freedom * len(unit)).ppf([0.001, 0.999])
    assert low < unit.sum() < high
    normal = run.residuals["z"] / run.residuals["s"]
    assert np.mean(normal**2) == pytest.approx(1.0, abs=0.05)


def test_another_broadcast_message_makes_no_step():
    """A satellite whose orbit and clock step by metres with the message; rates step too."""
    scene = Scene()
    epochs, rows = scene.epochs(10)
    late = rows[3 + 5 * scene.satellites :: scene.satellites]
    late["position"] += [2.0, -1.0, 3.0]
    late["clock"] += 1.7
    late["issue"] = 8
    # Lines of sight turn by some 1e-4 rad in a second: 3.7 m of orbit are tenths of a mm.
    np.testing.assert_allclose(
        Run(epochs, rows).moved["d"], true_steps(scene, 10), rtol=0, atol=4e-4
    )
    # The same step that no message explains is a bad satellite.
    late["issue"] = 7
    run = Run(epochs, rows)
    assert {int(k) for k in run.notes["satellite"]} == {3}


@pytest.mark.parametrize("of_phase", [True, False])
def test_a_jump_of_the_receivers_clock(of_phase):
    scene = Scene()
    epochs, rows = scene.epochs(12)
    jump = 299792.458
    late = rows[6 * scene.satellites :]
    late["code"] += jump
    if of_phase:
        late["phase"] += jump
    epochs["clock"][6:] += jump
    epochs["t"][6:] += 10**6
    run = Run(epochs, rows)
    np.testing.assert_allclose(run.moved["d"], true_steps(scene, 12), rtol=0, atol=1e-6)
    assert run.kinds() == [tdcp_records.EVENT_CLOCK_JUMP]
    assert run.notes["value"] == pytest.approx([1.0], abs=1e-3)
    assert not len(run.slips)
    assert np.abs(np.diff(run.places["t"]) - NS).max() < 1000


def lost(count, begin, end, keep):
    scene = Scene(satellites=9, place=lambda t: HERE + 15.0 * t * NORTH)
    epochs, rows = scene.epochs(count)
    rows["phase"][begin * 9 : end * 9].reshape(-1, 9, 3)[:, keep:] = np.nan
    return scene, epochs, rows


def test_too_few_phases_break_the_chain_and_the_next_begins_at_the_coarse_position():
    _, epochs, rows = lost(20, 8, 11, 3)
    epochs["x"] += UP
    run = Run(epochs, rows)
    assert run.kinds() == [tdcp_records.EVENT_CHAIN_BROKEN] * 4
    # Three epochs of three satellites, and the first epoch with all, of new phases.
    status = run.places["status"].tolist()
    assert status == [4] + [8] * 7 + [4] * 4 + [8] * 8
    np.testing.assert_allclose(run.places["r"][8:12], epochs["x"][8:12], atol=1e-9)


def test_a_chain_may_be_carried_on_by_its_velocity():
    scene, epochs, rows = lost(20, 8, 11, 3)
    epochs["x"] += 3.0 * UP
    run = Run(epochs, rows, tdcp_settings(carry=4.5))
    assert not len(run.notes)
    assert run.places["status"].tolist() == [4] + [8] * 7 + [1] * 4 + [8] * 8
    off = run.places["r"] - [scene.place(float(e)) for e in range(20)] - 3.0 * UP
    assert np.abs(off).max() < 0.02
    assert (np.diff(run.places["cov"][:, 0]) > 0).all()


def test_epochs_without_phases_are_bridged():
    """The receiver kept tracking while its epochs were lost on the way."""
    scene = Scene()
    epochs, rows = scene.epochs(12)
    keep = np.ones(12, dtype=bool)
    keep[5:8] = False
    run = Run(epochs[keep], rows)
    assert run.moved["d"][4] == pytest.approx(scene.place(8.0) - scene.place(4.0), abs=1e-6)
    assert run.places["status"].tolist() == [4] + [8] * 8
    run = Run(epochs[keep], rows, tdcp_settings(max_gap=3.5))
    assert run.places["status"].tolist() == [4] + [8] * 4 + [4] + [8] * 3


def test_a_contradiction_is_not_believed():
    """Two groups of satellites that do not agree, of which none is the larger."""
    scene = Scene(satellites=6, frequencies=(F1,))
    epochs, rows = scene.epochs(4)
    made = np.random.default_rng(2)
    rows["phase"][2 * 6 : 3 * 6, 0] += made.uniform(-3.0, 3.0, 6)
    run = Run(epochs, rows, tdcp_settings(max_gap=1.5), BLIND)
    error = run.moved["d"] - true_steps(scene, 4)[: len(run.moved)]
    assert len(run.moved) < 3 or np.abs(error).max() < 0.1


@pytest.mark.parametrize("cuts", [(1,), (7, 8), tuple(range(1, 30))])
def test_cuts_change_no_bit(cuts):
    scene = Scene(phase_noise=0.003, code_noise=0.4)
    epochs, rows = scene.epochs(30)
    slip(rows, 2, 0, 8, 3, scene.satellites)
    rows["phase"][15 * 9 : 17 * 9 - 6] = np.nan
    whole, pieces = Run(epochs, rows), Run(epochs, rows, cuts=cuts)
    for name in ("places", "moved", "residuals", "slips", "notes"):
        a, b = getattr(whole, name), getattr(pieces, name)
        assert len(a) == len(b)
        for field in a.dtype.names:
            if name != "places" or field in ("t", "r", "cov", "status", "has_v"):
                assert a[field].tobytes() == b[field].tobytes(), (name, field)
