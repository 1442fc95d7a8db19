"""Precise point positioning on made-up skies: what is put in comes out."""

import numpy as np
import pytest

from replay.kernels import ppp_records as records
from tests.kernels.ppp_sky import C_M_S, L1, NS, PLACE, T0, Sky, local_axes, run, settings

FIXED, FLOAT = 7, 6
WIDE = {
    "position_sigma": 1e3, "clock_sigma": 1e3, "ionosphere_sigma": 1e3, "ambiguity_sigma": 1e3,
    "wet_sigma": 10.0,
}  # fmt: skip


def last(rows):
    return rows[rows["t"] == rows["t"][-1]]


@pytest.mark.parametrize("dynamics", [records.STATIC, records.KINEMATIC])
def test_exact_data_give_exact_states(dynamics):
    sky = Sky(systems=(0, 1, 2), each=9, gradient=(1e-3, -5e-4))
    config = settings(dynamics=dynamics, gradients=1, gradient_sigma=1.0, **WIDE)
    numbers = range(40)
    result = run(config, *sky.epochs(numbers))
    assert np.all(result.solutions["status"] == FLOAT)
    # Priors of 1 km draw estimates of a millimetre's deviation by some millionths of 3 m.
    assert np.abs(result.solutions["r"][-1] - PLACE).max() < 2e-4
    end = numbers[-1] * sky.interval
    assert abs(result.zeniths["wet"][-1] - sky.wet) < 2e-4
    assert np.abs(result.zeniths["gradient"][-1] - sky.gradient).max() < 1e-5
    clock = sky.clock(end)
    for system in sky.systems:
        assert abs(result.solutions["clock"][-1][system] - clock - sky.between[system]) < 2e-3
    for row in last(result.slants):
        truth = sky.slant(row["satellite"], end)
        if row["satellite"] in range(32, 64):
            truth *= (L1 / 1602.0e6) ** 2
        assert abs(row["value"] - truth) < 2e-3
    for row in last(result.phases):
        system = 0 if row["satellite"] < 32 else 1 if row["satellite"] < 64 else 2
        k = sky.satellites.index((system, row["satellite"] - (0, 32, 64)[system]))
        slot = (row["signal"] // 256) - 67
        assert abs(row["value"] - sky.cycles[k, slot] * sky.wavelength(k, slot)) < 4e-3
    assert np.all(result.innovations["accepted"] == 1)
    assert np.abs(result.innovations["z"]).max() < 2e-3


def design(config, sky, numbers, x0, epochs, rows):
    """Rows of the model at `x0` as a dense least-squares problem, priors among them."""
    sats = sorted({int(r["satellite"]) for r in rows})
    between = [s for s in sky.systems if s != 0]
    base = 3 + len(between) + 1
    amb = {(s, j): base + 2 * k + j for k, s in enumerate(sats) for j in range(2)}
    per = 1 + len(sats)
    first = base + 2 * len(sats)
    total = first + per * len(numbers)
    H, z, w = [], [], []

    def add(entries, value, variance):
        line = np.zeros(total)
        for i, h in entries:
            line[i] += h
        H.append(line)
        z.append(value)
        w.append(1.0 / variance)

    c = config[0]
    for i in range(3):
        add([(i, 1.0)], epochs[0]["x"][i] - x0[i], c["position_sigma"] ** 2)
    for k in range(len(between)):
        add([(3 + k, 1.0)], -x0[3 + k], c["clock_sigma"] ** 2)
    add([(base - 1, 1.0)], -x0[base - 1], c["wet_sigma"] ** 2)
    begun = {}
    for e, epoch in enumerate(epochs):
        clock = first + per * e
        add([(clock, 1.0)], epoch["clock"] - x0[clock], c["clock_sigma"] ** 2)
        for k in range(len(sats)):
            i = clock + 1 + k
            add([(i, 1.0)], -x0[i], c["ionosphere_sigma"] ** 2)
        for row in rows[epoch["first"] : epoch["first"] + epoch["count"]]:
            sat = int(row["satellite"])
            d = row["position"] - x0[:3]
            r = np.linalg.norm(d)
            u = d / r
            factor = 0.5 * (1.0 + 1.0 / np.sin(row["elevation"]) ** 2)
            for j in range(2):
                if (sat, j) not in begun:
                    begun[sat, j] = row["phase"][j] - row["code"][j]
                    i = amb[sat, j]
                    add([(i, 1.0)], begun[sat, j] - x0[i], c["ambiguity_sigma"] ** 2)
                g = (L1 / row["frequency"][j]) ** 2
                for kind in range(2):
                    entries = [(i, -u[i]) for i in range(3)]
                    entries += [(clock, 1.0), (base - 1, row["wet_mapping"])]
                    if row["system"] != 0:
                        entries.append((3 + between.index(row["system"]), 1.0))
                    entries.append((clock + 1 + sats.index(sat), g if kind == 0 else -g))
                    if kind == 1:
                        entries.append((amb[sat, j], 1.0))
                    sigma = c["code_sigma"][j] if kind == 0 else c["phase_sigma"][j]
                    observed = row["code"][j] if kind == 0 else row["phase"][j]
                    known = sum(h * x0[i] for i, h in entries[3:])
                    add(entries, observed - r - known, sigma**2 * factor)
    return np.array(H), np.array(z), np.array(w), total


def test_static_filter_is_least_squares_over_all_epochs():
    # Noise is small, so that what is not straight about a range does not show.
    sky = Sky(systems=(0, 2), each=6, code_noise=0.05, phase_noise=3e-4)
    config = settings()
    numbers = range(8)
    epochs, rows = sky.epochs(numbers)
    # Where it begins does not matter but for how straight a range is.
    epochs["x"] = PLACE
    result = run(config, epochs, rows)
    x = np.zeros(2000)
    x[:3] = epochs[0]["x"]
    for _ in range(4):
        H, z, w, total = design(config, sky, numbers, x, epochs, rows)
        # Columns of one size, and orthogonal factors instead of normal equations.
        A = H * np.sqrt(w)[:, None]
        scale = np.linalg.norm(A, axis=0)
        step, *_ = np.linalg.lstsq(A / scale, z * np.sqrt(w), rcond=None)
        x[:total] += step / scale
    Q = np.linalg.inv((A / scale).T @ (A / scale)) / np.outer(scale, scale)
    assert np.abs(result.x[:3] - x[:3]).max() < 2e-7
    assert np.abs(np.diag(result.P)[:3] / np.diag(Q)[:3] - 1.0).max() < 1e-5


def test_a_single_epoch_uncombined_is_the_ionosphere_free_combination():
    # From the second epoch on the uncombined phases tell more: how the ionosphere changes.
    sky = Sky(systems=(0, 2), each=8, code_noise=0.5, phase_noise=0.003)
    epochs, rows = sky.epochs(range(12))
    wide = {**WIDE, "ionosphere_sigma": 1e4, "ambiguity_sigma": 1e4}
    kinematic = {"dynamics": records.KINEMATIC, "phase_sigma": 0.01, **wide}
    free = run(settings(**kinematic), epochs, rows)
    pair = run(settings(ionosphere=records.IONOSPHERE_COMBINATION, **kinematic), epochs, rows)
    assert np.abs(free.solutions["r"][0] - pair.solutions["r"][0]).max() < 1e-3
    assert np.abs(free.solutions["cov"][0] / pair.solutions["cov"][0] - 1.0).max() < 1e-3
    for place in (0, 3, 5):
        assert np.all(
            free.solutions["cov"][:, place] <= pair.solutions["cov"][:, place] * (1.0 + 1e-3)
        )
    error = np.abs(free.solutions["r"][-1] - pair.solutions["r"][-1])
    assert error.max() < 3.0 * np.sqrt(np.diag(pair.P)[:3].max())


@pytest.mark.parametrize("cut", [1, 7, 19])
def test_cuts_do_not_change_a_bit(cut):
    sky = Sky(systems=(0, 1), each=8, code_noise=0.5, phase_noise=0.003)
    gone = lambda k, e: k == 2 and 5 < e < 11  # noqa: E731
    config = settings(dynamics=records.VELOCITY, gradients=1, ionosphere_noise=4e-3, phase_gate=4.0)
    epochs, rows = sky.epochs(range(20), skip=gone)
    whole = run(config, epochs, rows)
    middle = int(epochs["first"][cut])
    early = run(config, epochs[:cut], rows[:middle])
    later = epochs[cut:].copy()
    later["first"] -= middle
    late = run(config, later, rows[middle:], (early.state, early.x, early.P))
    joined = np.concatenate([early.solutions, late.solutions])
    assert joined.tobytes() == whole.solutions.tobytes()
    assert late.state.tobytes() == whole.state.tobytes()
    joined = np.concatenate([early.innovations, late.innovations])
    assert joined.tobytes() == whole.innovations.tobytes()


def believing(**changes):
    return settings(
        **{"code_gate": 4.0, "phase_gate": 4.0, "ionosphere_noise": 4e-3, "dynamics": 1, **changes}
    )


@pytest.mark.parametrize("size", [(1, 0), (1, 1), (0, 3), (77, 60)])
def test_a_slip_begins_the_ambiguity_anew(size):
    sky = Sky(systems=(0, 2), each=8, code_noise=0.3, phase_noise=0.002)
    jump = lambda k, e, slot: size[slot] if k == 4 and e >= 60 else 0  # noqa: E731
    # The second of them is a jump of 5 cm in both together: the residuals have to tell it.
    epochs, rows = sky.epochs(range(90), slips=jump)
    result = run(believing(geometry_free_rate=1e-4), epochs, rows)
    slips = result.notes[result.notes["kind"] == records.EVENT_SLIP]
    name = sky.satellites[4]
    satellite = {0: 0, 2: 64}[name[0]] + name[1]
    assert set(slips["satellite"]) == {satellite}
    assert slips["t"].min() >= epochs["t"][59]
    assert slips["t"].max() <= epochs["t"][63]
    axes = local_axes(PLACE)
    error = (result.solutions["r"][55:] - PLACE) @ axes.T
    step = error[8:] - error[:1]
    assert np.abs(step).max() < 0.1
    assert result.solutions["count"][-1].sum() == 16


def test_an_outlier_is_left_out_and_said():
    sky = Sky(systems=(0, 2), each=8, code_noise=0.3, phase_noise=0.002)
    wrong = lambda k, e, slot: 30.0 if (k, e, slot) == (5, 20, 0) else 0.0  # noqa: E731
    clean = run(believing(), *sky.epochs(range(30)))
    again = Sky(systems=(0, 2), each=8, code_noise=0.3, phase_noise=0.002)
    result = run(believing(), *again.epochs(range(30), code_error=wrong))
    left = result.innovations[result.innovations["accepted"] == 0]
    before = clean.innovations[clean.innovations["accepted"] == 0]
    assert len(left) == len(before) + 1
    found = left[np.abs(left["z"]) > 20.0]
    assert len(found) == 1
    assert found["kind"][0] == 7
    assert np.abs(result.solutions["r"][-1] - clean.solutions["r"][-1]).max() < 0.05
    assert len(result.innovations) == len(clean.innovations)


def test_states_come_and_go_with_satellites():
    sky = Sky(systems=(0, 2), each=8)
    gone = lambda k, e: k % 2 == 0 and 10 <= e < 30  # noqa: E731
    epochs, rows = sky.epochs(range(40), skip=gone)
    config = settings(dynamics=records.KINEMATIC, gap=70.0)
    counts = []
    state = None
    for e in range(40):
        part = epochs[e : e + 1].copy()
        first, count = int(part["first"][0]), int(part["count"][0])
        part["first"] = 0
        result = run(config, part, rows[first : first + count], state)
        state = (result.state, result.x, result.P)
        counts.append(int(result.state["n"][0]))
    full, half = 3 + 1 + 1 + 1 + 16 * 3, 3 + 1 + 1 + 1 + 8 * 3
    assert counts[9] == full
    assert counts[20] == half
    assert counts[39] == full
    assert result.solutions["count"][-1].sum() == 16
    # Those that had gone began anew.
    ages = last(result.phases)["age"]
    assert sorted(set(ages)) == [10, 40]


def test_a_millisecond_of_the_receivers_clock_does_not_matter():
    def reset(t):
        return 30.0 + 0.1 * t + (C_M_S * 1e-3 if t >= 600.0 else 0.0)

    sky = Sky(systems=(0, 2), each=8, clock=reset)
    epochs, rows = sky.epochs(range(40))
    # The receiver sets its clock and its codes, and lets its phases go on.
    for e in range(20, 40):
        part = rows[epochs[e]["first"] : epochs[e]["first"] + epochs[e]["count"]]
        part["phase"] -= C_M_S * 1e-3
    result = run(believing(), epochs, rows)
    kinds = list(result.notes["kind"])
    assert kinds == [records.EVENT_CLOCK_JUMP]
    assert result.notes["value"][0] == pytest.approx(1.0)
    assert last(result.phases)["age"].min() == 40
    assert np.abs(result.solutions["r"][20:] - PLACE).max() < 0.01
    steady = run(believing(), *sky.epochs(range(40)))
    assert len(steady.notes) == 0
    # Times are those of the receiver's clock with its offset taken off.
    truth = T0 + np.round(np.arange(40) * 30.0 * NS)
    assert np.abs(result.solutions["t"] - truth).max() < 20


def test_an_epoch_back_in_time_is_left_out_and_said():
    sky = Sky()
    epochs, rows = sky.epochs([0, 1, 3, 2, 4])
    result = run(settings(), epochs, rows)
    assert len(result.solutions) == 4
    assert list(result.notes["kind"]) == [records.EVENT_TIME_BACKWARD]


def test_a_filter_that_fits_nothing_begins_again():
    sky = Sky(systems=(0, 2), each=8, code_noise=0.3, phase_noise=0.002)
    far = lambda t: PLACE + (np.array([0.0, 900.0, 0.0]) if t >= 600.0 else 0.0)  # noqa: E731
    sky.place = far
    result = run(believing(dynamics=records.STATIC), *sky.epochs(range(40)))
    assert records.EVENT_RESET in result.notes["kind"]
    assert np.abs(result.solutions["r"][-1] - far(1200.0)).max() < 3.0


@pytest.mark.parametrize("slots", [2, 3])
def test_integers_are_found(slots):
    sky = Sky(systems=(0, 2), each=9, slots=slots, code_noise=0.3, phase_noise=0.002)
    config = believing(
        slots=slots, mode=1, partial=0 if slots == 2 else 2, lock=1, threshold=2.0,
        geometry_free_rate=1e-3,
    )  # fmt: skip
    numbers = range(120)
    result = run(config, *sky.epochs(numbers))
    status = result.solutions["status"]
    assert np.mean(status[-30:] == FIXED) > 0.9
    fixed = result.solutions["r"][-30:][status[-30:] == FIXED]
    assert np.abs(fixed - PLACE).max() < 0.03
    rows = result.ambiguities[result.ambiguities["status"] == 2]
    assert len(rows) > 0
    for row in rows[-200:]:
        system = 0 if row["satellite"] < 64 else 2
        first = {0: 0, 2: 64}[system]
        k = sky.satellites.index((system, row["satellite"] - first))
        j = sky.satellites.index((system, row["reference"] - first))
        slot = (row["signal"] // 256) - 67
        assert row["integer"] == sky.cycles[k, slot] - sky.cycles[j, slot]


def test_phases_of_unknown_bias_stay_real():
    sky = Sky(systems=(0, 2), each=9, code_noise=0.1, phase_noise=0.002)
    epochs, rows = sky.epochs(range(40))
    rows["phase_known"] = 0
    result = run(believing(mode=1, lock=1), epochs, rows)
    assert np.all(result.solutions["status"] == FLOAT)
    assert len(result.ambiguities) == 0


def test_the_covariance_says_how_far_off_it_is():
    # Normalised squared errors of the position over independent runs: chi-square of 3 each.
    runs, total = 40, []
    for seed in range(runs):
        sky = Sky(systems=(0, 2), each=8, code_noise=0.5, phase_noise=0.003)
        sky.generator = np.random.default_rng(seed)
        wet = sky.generator.normal() * 0.1
        sky.wet = wet
        config = believing(wet_sigma=0.1, code_gate=9.0, phase_gate=9.0, ionosphere_noise=-1.0)
        epochs, rows = sky.epochs(range(30))
        # The coarse position must not know the truth too well, nor the prior be wide without end.
        result = run(config, epochs, rows)
        error = result.x[:3] - PLACE
        total.append(error @ np.linalg.solve(result.P[:3, :3], error))
    mean = np.mean(total)
    # Standard deviation of the mean: sqrt(2 * 3 / 40) = 0.39.
    assert 3.0 - 3.0 * 0.39 < mean < 3.0 + 3.0 * 0.39


def test_orbits_wrong_by_metres_leave_changes_of_position_right():
    """What stays the same is in the ambiguities, and phases count as what they are."""
    off = np.random.default_rng(5).normal(size=16) * 2.0
    speed = np.array([0.4, -0.3, 0.2])
    sky = Sky(interval=1.0, place=lambda t: PLACE + speed * t, phase_noise=0.002, wet=0.0)
    sky.turn *= 0.0
    epochs, rows = sky.epochs(range(60), code_error=lambda k, e, slot: off[k])
    for k, (system, prn) in enumerate(sky.satellites):
        rows["phase"][(rows["system"] == system) & (rows["prn"] == prn + 1)] += off[k]
    config = settings(
        dynamics=records.KINEMATIC, range_scale=1.0, range_usual=0.03, range_walk=2e-3,
        ionosphere_noise=1e-4, wet_sigma=1e-3,
    )  # fmt: skip
    rows["range_std"] = 2.0
    result = run(config, epochs, rows)
    moved = result.solutions["r"] - result.solutions["r"][0]
    truth = speed * np.arange(60)[:, None]
    # Sixteen ionosphere-free phases of 6 mm each; the orbits' error itself stays.
    assert np.sqrt(np.mean(np.diff(moved - truth, axis=0) ** 2)) < 0.01
    assert np.linalg.norm(result.solutions["r"][-1] - PLACE - truth[-1]) > 0.1
    # Codes alone would be as wrong as orbits, and are said to be.
    codes = result.innovations[result.innovations["kind"] == 7]
    phases = result.innovations[result.innovations["kind"] == 8]
    assert np.all(codes["r"] > 1.97)
    assert np.all(phases["r"] < 0.02)
    # Where the products are as good as usual, nothing walks and nothing is added.
    rows["range_std"] = 0.03
    usual = run(config, epochs, rows)
    config["range_walk"] = 1.0
    assert np.array_equal(run(config, epochs, rows).P, usual.P)
