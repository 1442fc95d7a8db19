"""Precise point positioning smoothed, on made-up skies: the joint solution of all epochs."""

import numpy as np
import pytest

from replay.kernels import ppp_records as records
from replay.kernels.transition import GIVEN_INTEGERS, OWN
from replay.kernels.two_filter import combine_nodes
from replay.log.columns import concatenate
from tests.engine.test_smooth import matrices
from tests.kernels.ppp_sky import C_M_S, PLACE, Sky, new_recorder, run, settings
from tests.kernels.test_ppp import believing, design
from tests.kernels.test_smoother import smooth


def recorded(config, epochs, rows, state=None, recorder=None):
    recorder = new_recorder() if recorder is None else recorder
    result = run(config, epochs, rows, state, recorder)
    return result, recorder.columns()


def names_of(columns, k):
    return columns.ragged("state_names").blobs()[k].decode().split(",")


@pytest.fixture(scope="module")
def static():
    """Eight epochs of a receiver that stands, and the least-squares solution of all of them."""
    sky = Sky(systems=(0, 2), each=6, code_noise=0.05, phase_noise=3e-4)
    config, numbers = settings(), range(8)
    epochs, rows = sky.epochs(numbers)
    epochs["x"] = PLACE
    x = np.zeros(2000)
    x[:3] = PLACE
    for _ in range(4):
        H, z, w, total = design(config, sky, numbers, x, epochs, rows)
        A = H * np.sqrt(w)[:, None]
        scale = np.linalg.norm(A, axis=0)
        step, *_ = np.linalg.lstsq(A / scale, z * np.sqrt(w), rcond=None)
        x[:total] += step / scale
    Q = np.linalg.inv((A / scale).T @ (A / scale)) / np.outer(scale, scale)
    satellites = sorted({int(row["satellite"]) for row in rows})
    return recorded(config, epochs, rows)[1], x, Q, satellites


def test_smoothed_epochs_are_those_of_the_joint_solution(static):
    """Every state at every epoch: position, clocks, wet delay, slant delays, ambiguities."""
    columns, x, Q, satellites = static
    count = len(satellites)
    base = 5  # position, the other system's clock, wet delay
    first, per = base + 2 * count, 1 + count
    found = smooth(columns)
    assert len(found) == 8
    for k, (estimate, P) in enumerate(found):
        names = names_of(columns, k)
        place = {f"position_ecef_{axis}": i for i, axis in enumerate("xyz")}
        place |= {"clock_E": 3, "wet_delay": 4, "clock": first + per * k}
        for i, satellite in enumerate(satellites):
            text = f"{'G' if satellite < 32 else 'E'}{satellite % 32 + 1:02d}"
            place[f"ionosphere_{text}"] = first + per * k + 1 + i
            for slot in range(2):
                place[f"ambiguity_{text}_{slot}"] = base + 2 * i + slot
        assert set(place) == set(names)
        at = [place[name] for name in names]
        sigma = np.sqrt(np.diag(Q)[at])
        assert (np.abs(estimate - x[at]) / sigma).max() < 2e-4
        assert np.abs((P - Q[np.ix_(at, at)]) / np.outer(sigma, sigma)).max() < 2e-5


def test_forward_and_backward_filters_combined_say_the_same(static):
    """To what priors of 300 m leave of sixteen digits where phases know millimetres."""
    columns = static[0]
    for (x, P), (y, Q) in zip(smooth(columns), smooth(columns, (), combine_nodes), strict=True):
        sigma = np.sqrt(np.diag(P))
        assert (np.abs(x - y) / sigma).max() < 1e-3
        assert np.abs((P - Q) / np.outer(sigma, sigma)).max() < 1e-3


def test_a_measurement_that_was_left_out_says_nothing_backwards():
    """With a code that is wrong by 30 m, left out, as without that code."""
    found = []
    for wrong in (30.0, np.nan):
        sky = Sky(systems=(0, 2), each=8, code_noise=0.3, phase_noise=0.002)
        bad = lambda k, e, slot, by=wrong: by if (k, e, slot) == (5, 20, 0) else 0.0  # noqa: E731
        # Neither may take it for a broken phase.
        config = believing(wide_lane=0.0)
        found.append(recorded(config, *sky.epochs(range(30), code_error=bad)))
    left = [result.innovations[result.innovations["accepted"] == 0] for result, _ in found]
    assert len(left[0]) == len(left[1]) + 1
    for (x, P), (y, Q) in zip(*(smooth(columns) for _, columns in found), strict=True):
        sigma = np.sqrt(np.diag(Q))
        assert (np.abs(x - y) / sigma).max() < 1e-5
        assert np.abs((P - Q) / np.outer(sigma, sigma)).max() < 1e-5


MOTIONS = {
    "static": {"dynamics": records.STATIC},
    "kinematic": {"dynamics": records.KINEMATIC},
    "velocity": {"dynamics": records.VELOCITY, "process_noise": 0.01, "drift_noise": 0.1},
    "combination": {
        "dynamics": records.KINEMATIC, "ionosphere": records.IONOSPHERE_COMBINATION,
    },
    "constrained": {
        "dynamics": records.STATIC, "ionosphere": records.IONOSPHERE_CONSTRAINED,
        "constraint_time": 600.0, "bias_sigma": 5.0,
    },
    "white": {"dynamics": records.KINEMATIC, "ionosphere_noise": -1.0},
}  # fmt: skip


@pytest.mark.parametrize("motion", MOTIONS)
def test_nodes_are_those_of_a_kalman_filter(motion):
    """Satellites come and go, phases break, codes are wrong, and the receiver sets its clock.

    P' - Phi P Phi' and P' - P have no negative eigenvalue, nor has P less its smoothed one, and
    the last node stays what it was.
    """
    clock = lambda t: 30.0 + 0.1 * t + (C_M_S * 1e-3 if t >= 750.0 else 0.0)  # noqa: E731
    sky = Sky(systems=(0, 1, 2), each=7, code_noise=0.3, phase_noise=0.002, clock=clock)
    epochs, rows = sky.epochs(
        range(36),
        skip=lambda k, e: (k % 3 == 0 and 10 <= e < 18) or (k == 4 and e < 5),
        slips=lambda k, e, slot: 40 + slot if k == 7 and e >= 22 else 0,
        code_error=lambda k, e, slot: 40.0 if (k, e, slot) == (8, 12, 1) else 0.0,
    )
    for e in range(25, 36):
        rows["phase"][epochs[e]["first"] : epochs[e]["first"] + epochs[e]["count"]] -= C_M_S * 1e-3
    config = believing(gradients=1, gradient_sigma=1e-3, gap=70.0, **MOTIONS[motion])
    result, columns = recorded(config, epochs, rows)
    assert len(columns) == 36
    assert np.array_equal(columns.valid_time_ns, result.solutions["t"])
    assert len(set(columns["dimension"])) > 2
    found = smooth(columns)
    gained = 0
    for k, (_, smoothed) in enumerate(found):
        phi, predicted, updated = matrices(columns, k)
        scale = 1.0 / np.sqrt(np.diag(predicted))
        weigh = np.outer(scale, scale)
        assert np.linalg.eigvalsh((predicted - updated) * weigh).min() > -1e-12
        own = 1.0 / np.sqrt(np.diag(updated))
        less = (updated - smoothed) * np.outer(own, own)
        assert np.linalg.eigvalsh(less).min() > -1e-6
        gained += np.diag(less).max() > 0.1
        if k:
            noise = (predicted - phi @ matrices(columns, k - 1)[2] @ phi.T) * weigh
            assert np.linalg.eigvalsh(noise).min() > -1e-12
            assert columns["since_ns"][k] == columns.valid_time_ns[k - 1]
            white = [names_of(columns, k).index("clock")]
            assert not phi[white].any()
            assert np.count_nonzero(phi) > 10
    assert gained > 20
    assert np.array_equal(found[-1][0], columns.ragged("estimate").row(35))
    np.testing.assert_array_equal(found[-1][1], matrices(columns, 35)[2])


@pytest.mark.parametrize("mode", [records.FLOAT_ONLY, 1, records.HOLD])
def test_integers_that_were_fed_back_are_part_of_the_states(mode):
    """Held ones are smoothed with all else, others are said not to be known to the states."""
    sky = Sky(systems=(0, 2), each=9, code_noise=0.2, phase_noise=0.002)
    config = believing(mode=mode, agree=2, lock=2, success=0.9, lane_sigma=0.02)
    result, columns = recorded(config, *sky.epochs(range(60)))
    fixed = result.solutions["status"] == 7
    assert fixed.any() == (mode != records.FLOAT_ONLY)
    told = columns["solution"][fixed]
    if mode == 1:
        assert np.all(told == GIVEN_INTEGERS)
    if mode == records.HOLD:
        assert np.all(told[config[0]["hold_count"] :] == OWN)
        found = smooth(columns)
        first = int(np.flatnonzero(fixed)[0])
        # Integers of the end are there from the beginning on.
        x, P = found[first // 2]
        error = x[:3] - PLACE
        assert error @ np.linalg.solve(P[:3, :3], error) < 16.3
        was = matrices(columns, first // 2)[2]
        assert np.trace(P[:3, :3]) < np.trace(was[:3, :3]) / 10
    assert np.all(columns["solution"][~fixed] == OWN)


def test_cuts_change_no_bit_of_the_nodes_and_recording_none_of_the_rest():
    sky = Sky(systems=(0, 1), each=8, code_noise=0.5, phase_noise=0.003)
    gone = lambda k, e: k == 2 and 5 < e < 11  # noqa: E731
    config = believing(dynamics=records.VELOCITY, gradients=1)
    epochs, rows = sky.epochs(range(20), skip=gone)
    whole, columns = recorded(config, epochs, rows)
    plain = run(config, epochs, rows)
    for name in ("solutions", "innovations", "notes", "slants", "phases", "state", "x", "P"):
        assert getattr(plain, name).tobytes() == getattr(whole, name).tobytes()
    middle = int(epochs["first"][7])
    recorder = new_recorder()
    early, some = recorded(config, epochs[:7], rows[:middle], None, recorder)
    later = epochs[7:].copy()
    later["first"] -= middle
    state = (early.state, early.x, early.P)
    _, others = recorded(config, later, rows[middle:], state, recorder)
    joined = concatenate([some, others])
    for name in ("value", "predicted_upper_triangle", "correction", "updated_upper_triangle"):
        assert joined.ragged(name).values.tobytes() == columns.ragged(name).values.tobytes()
    assert np.array_equal(joined["since_ns"], columns["since_ns"])


def test_a_filter_that_begins_anew_has_no_tie_to_what_it_was():
    """Nor do the epochs that fit nothing, before it does so, tell those before them anything."""
    sky = Sky(systems=(0, 2), each=8, code_noise=0.3, phase_noise=0.002)
    sky.place = lambda t: PLACE + (500.0 if t >= 600.0 else 0.0)
    config = believing(dynamics=records.STATIC)
    epochs, rows = sky.epochs(range(40))
    result, columns = recorded(config, epochs, rows)
    resets = result.notes["t"][result.notes["kind"] == records.EVENT_RESET]
    assert len(resets) >= 1
    for t in resets:
        after = int(np.searchsorted(columns.valid_time_ns, t))
        assert t not in columns.valid_time_ns
        assert columns["dimension_before"][after] == 0
        assert columns["since_ns"][after] == columns.valid_time_ns[after]
    alone = smooth(recorded(config, epochs[:20], rows[: int(epochs["first"][20])])[1])
    for (x, P), (y, Q) in zip(smooth(columns)[:20], alone, strict=True):
        assert np.array_equal(x, y)
        assert np.array_equal(P, Q)
