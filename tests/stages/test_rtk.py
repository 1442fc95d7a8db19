"""Relative positioning against made-up skies of which everything is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from replay import channels, configuration
from replay.errors import ConfigurationError
from replay.schemas import filter_pb2, sights_pb2, solution_pb2
from replay.stages.base import BASE, RECEIVER, Context, Port
from replay.stages.rtk import Rtk
from replay.stages.rtk_config import MovingBaseConfig, RtkConfig
from tests.stages.two_receivers import (
    BASE_POSITION,
    C_M_S,
    FREQUENCY,
    NS,
    READ,
    fixed_base,
    local_axes,
    make_sky,
    receive,
    run_stage,
    whole,
)

MM = 1e-3
CM = 1e-2
AXES = local_axes(BASE_POSITION)
FIXED = solution_pb2.SOLUTION_STATUS_FIXED
FLOAT = solution_pb2.SOLUTION_STATUS_FLOAT
SINGLE = solution_pb2.SOLUTION_STATUS_SINGLE


def config(cls=RtkConfig, **table):
    return configuration.build(cls, [table])


def still(offset):
    place = BASE_POSITION + np.asarray(offset) @ AXES
    return lambda t: place


def drive(offset, velocity):
    place, step = BASE_POSITION + np.asarray(offset) @ AXES, np.asarray(velocity) @ AXES
    return lambda t: place + step * t


def integers(sky, signals, seed):
    generator = np.random.default_rng(seed)
    return generator.integers(-1000, 1000, (len(sky.names), len(signals))).astype(float)


def pair(sky, rover_path, epochs=range(12), *, signals=("1C", "5Q"), rover=None, base=None,
         base_path=lambda t: BASE_POSITION, rover_integers=None):  # fmt: skip
    """Both receivers' channels, and the true integers rover less base."""
    own = integers(sky, signals, 2) if rover_integers is None else rover_integers
    other = integers(sky, signals, 3)
    block = {
        **receive(sky, RECEIVER, epochs, rover_path, lambda t: 150.0 + 30.0 * t, own,
                  signals=signals, seed=11, **(rover or {})),
        **receive(sky, BASE, epochs, base_path, lambda t: -80.0 + 5.0 * t, other,
                  signals=signals, seed=12, **(base or {})),
    }  # fmt: skip
    block = fixed_base(block)
    return block, (own(0.0) if callable(own) else own) - other


def cut(block, times):
    """The block in pieces, cut after the given log times."""
    pieces, last = [], -1
    for end in [*times, 2**62]:
        piece = {}
        for name, rows in block.items():
            part = rows.take((rows.log_time_ns > last) & (rows.log_time_ns <= end))
            if len(part):
                piece[name] = part
        pieces.append(piece)
        last = end
    return pieces


def assert_integers(parts, sky, signals, truth):
    """Every integer that was used is the true double difference."""
    rows = whole(parts, channels.FILTER_AMBIGUITIES)
    used = rows["status"] != sights_pb2.AMBIGUITY_STATUS_REJECTED
    assert used.any()
    for k in np.flatnonzero(used):
        i = sky.names.index(bytes(rows["satellite"][k]))
        j = sky.names.index(bytes(rows["reference"][k]))
        s = signals.index(bytes(rows["signal"][k]).decode())
        assert rows["integer_cycles"][k] == truth[i, s] - truth[j, s]


@pytest.mark.parametrize("offset", [(0, 0, 0), (300, -200, 20), (8000, 6000, -50)])
def test_exact_integers_and_position_without_noise(offset):
    sky, signals = make_sky(), ("1C", "5Q")
    path = drive(offset, [8.0, -3.0, 0.1])
    block, truth = pair(sky, path)
    parts = run_stage(Rtk(), config(), [block])
    solution = whole(parts, channels.SOLUTION)
    assert (solution["status"] == FIXED).all()
    want = np.array([path(float(k)) for k in range(12)])
    assert np.abs(solution["position_ecef_m"] - want).max() < 0.1 * MM
    assert_integers(parts, sky, signals, truth)
    baseline = whole(parts, channels.RELATIVE_POSITION)
    assert np.abs(baseline["baseline_ecef_m"] - (want - BASE_POSITION)).max() < 0.1 * MM
    assert np.abs(baseline["length_m"] - np.linalg.norm(want - BASE_POSITION, axis=1)).max() < MM


@pytest.mark.parametrize("dynamics", ["static", "velocity", "acceleration"])
def test_other_dynamics_find_the_same(dynamics):
    sky = make_sky()
    path = still([500, 400, 10]) if dynamics == "static" else drive([500, 400, 10], [9, 2, 0])
    block, truth = pair(sky, path, range(8), rover={"code": 0.3, "phase": 1 * MM})
    motion = {"dynamics": dynamics, "process_noise": 0.0 if dynamics == "static" else 0.3}
    parts = run_stage(Rtk(), config(rtk={"motion": motion}), [block])
    solution = whole(parts, channels.SOLUTION)
    assert (solution["status"] == FIXED).sum() >= 6
    fixed = solution["status"] == FIXED
    want = np.array([path(float(k)) for k in range(8)])
    assert np.abs(solution["position_ecef_m"] - want)[fixed].max() < 2 * CM
    assert_integers(parts, sky, ("1C", "5Q"), truth)


def dense_double_differences(block, sky, signals, sigmas, place):
    """The textbook: double differences with their full covariance, least squares by numpy."""

    def table(role):
        obs = block[Port(channels.GNSS_OBS, role).name]
        count = len(sky.names), len(signals)
        return obs["pseudorange_m"].reshape(count), obs["carrier_phase_cycles"].reshape(count)

    (code_r, phase_r), (code_b, phase_b) = table(RECEIVER), table(BASE)
    wavelengths = np.array([C_M_S / FREQUENCY[s] for s in signals])
    single = [code_r - code_b, (phase_r - phase_b) * wavelengths]
    places = sky.at(0.0)
    computed = np.linalg.norm(places - place, axis=1) - np.linalg.norm(
        places - BASE_POSITION, axis=1
    )
    toward = (places - place) / np.linalg.norm(places - place, axis=1)[:, None]
    factor = 2.0 * 0.5 * (1.0 + 1.0 / np.sin(sky.elevations) ** 2)
    groups = [
        [i for i, name in enumerate(sky.names) if name[:1] == system]
        for system in dict.fromkeys(name[:1] for name in sky.names)
    ]
    labels = []
    A, z, R = [], [], []
    for kind in range(2):
        for members in groups:
            for s in range(len(signals)):
                # The highest satellite is the reference, as the filter has it.
                reference = max(members, key=lambda i: sky.elevations[i])
                others = [i for i in members if i != reference]
                D = np.zeros((len(others), len(members)))
                for row, i in enumerate(others):
                    D[row, members.index(i)] = 1.0
                    D[row, members.index(reference)] = -1.0
                value = single[kind][members, s] - computed[members]
                z.append(D @ value)
                A.append((kind, s, others, -D @ toward[members]))
                R.append(D @ np.diag(sigmas[kind] ** 2 * factor[members]) @ D.T)
                if kind == 1:
                    labels += [(sky.names[i], sky.names[reference], signals[s]) for i in others]
    n, m = 3 + len(labels), sum(len(part) for part in z)
    H, W = np.zeros((m, n)), np.zeros((m, m))
    row, column = 0, 3
    for (kind, s, others, h), r in zip(A, R, strict=True):
        end = row + len(others)
        H[row:end, :3] = h
        W[row:end, row:end] = np.linalg.inv(r)
        if kind == 1:
            H[row:end, column : column + len(others)] = wavelengths[s] * np.eye(len(others))
            column += len(others)
        row = end
    Q = np.linalg.inv(H.T @ W @ H)
    return Q @ (H.T @ (W @ np.concatenate(z))), Q, labels


def test_one_epoch_is_the_dense_least_squares_and_its_integers_are_those_of_rtklib():
    rtklib = pytest.importorskip("pyrtklib")
    sky, signals = make_sky(count=6), ("1C",)
    path = still([700, -300, 15])
    noise = {"code": 0.2, "phase": 2 * MM}
    block, _ = pair(sky, path, range(1), signals=signals, rover=noise, base=noise)
    table = {
        "differences": {"code_sigma": [0.3], "phase_sigma": [0.003], "code_gate": 1e9,
                        "phase_gate": 1e9},
        "motion": {"position_sigma": 3e3, "ambiguity_sigma": 3e3},
        "ambiguities": {"threshold": 1e9, "partial": "none"},
    }  # fmt: skip
    parts = run_stage(Rtk(), config(rtk=table), [block])
    solution = whole(parts, channels.SOLUTION)
    assert solution["status"][0] == FLOAT
    place = path(0.0)
    x, Q, labels = dense_double_differences(block, sky, signals, (0.3, 0.003), place)
    # Second order of the step from the single position: 3 m squared over 2e7 m.
    assert np.abs(solution["position_ecef_m"][0] - place - x[:3]).max() < 0.05 * MM
    got = solution["position_covariance_enu_m2"][0]
    axes = local_axes_of_ellipsoid(place)
    local = axes @ Q[:3, :3] @ axes.T
    np.testing.assert_allclose(got, local[np.triu_indices(3)], rtol=1e-4, atol=1e-7)
    rows = whole(parts, channels.FILTER_AMBIGUITIES)
    found = [
        (bytes(a), bytes(b), bytes(c).decode())
        for a, b, c in zip(rows["satellite"], rows["reference"], rows["signal"], strict=True)
    ]
    order = [found.index(label) for label in labels]
    np.testing.assert_allclose(rows["float_cycles"][order], x[3:], atol=1e-3)
    np.testing.assert_allclose(rows["float_std_cycles"][order], np.sqrt(np.diag(Q)[3:]), rtol=1e-4)
    n = len(labels)
    a, F, s = rtklib.Arr1Ddouble(n), rtklib.Arr1Ddouble(2 * n), rtklib.Arr1Ddouble(2)
    Qa = rtklib.Arr1Ddouble(n * n)
    for i in range(n):
        a[i] = float(x[3 + i])
        for j in range(n):
            Qa[i * n + j] = float(Q[3 + i, 3 + j])
    assert getattr(rtklib, "lambda")(n, 2, a, Qa, F, s) == 0
    best = np.rint([F[i] for i in range(n)])
    np.testing.assert_array_equal(rows["integer_cycles"][order], best)
    resolution = whole(parts, channels.FILTER_RESOLUTION)
    assert resolution["ratio"][0] == pytest.approx(s[1] / s[0], rel=1e-3)


def local_axes_of_ellipsoid(x):
    import pymap3d

    lat, lon, _ = pymap3d.ecef2geodetic(*x, deg=False)
    return np.array(
        [
            [-np.sin(lon), np.cos(lon), 0.0],
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
        ]
    )


@pytest.mark.parametrize("told", [True, False])
def test_a_slip_starts_its_ambiguity_anew(told):
    sky, signals = make_sky(), ("1C", "5Q")
    before = integers(sky, signals, 2)
    after = before.copy()
    slipped = sky.names.index(b"G03")
    after[slipped] += [7.0, -4.0]
    path = drive([300, -200, 20], [8.0, -3.0, 0.1])
    lost = {(6, "G03")} if told else set()
    block, _ = pair(
        sky, path, rover={"lost": lost, "phase": 1 * MM, "code": 0.2},
        rover_integers=lambda t: before if t < 5.5 else after,
    )  # fmt: skip
    parts = run_stage(Rtk(), config(rtk={"motion": {"geometry_free": 1e9}}), [block])
    solution = whole(parts, channels.SOLUTION)
    want = np.array([path(float(k)) for k in range(12)])
    assert (solution["status"] == FIXED).all()
    assert np.abs(solution["position_ecef_m"] - want).max() < 2 * CM
    other = integers(sky, signals, 3)
    rows = whole(parts, channels.FILTER_AMBIGUITIES)
    t = rows.valid_time_ns // NS - rows.valid_time_ns[0] // NS
    late = (t >= 9) & (rows["satellite"] == b"G03")
    assert late.any()
    for k in np.flatnonzero(late):
        j = sky.names.index(bytes(rows["reference"][k]))
        s = signals.index(bytes(rows["signal"][k]).decode())
        truth = after - other
        assert rows["integer_cycles"][k] == truth[slipped, s] - truth[j, s]
    if told:
        events = whole(parts, channels.FILTER_EVENTS)
        slips = events["kind"] == filter_pb2.EVENT_KIND_CYCLE_SLIP
        assert slips.sum() == len(signals)


def test_the_reference_may_set_without_a_step():
    sky = make_sky()
    path = drive([300, -200, 20], [8.0, -3.0, 0.1])
    noise = {"code": 0.2, "phase": 1 * MM}
    block, _ = pair(sky, path, rover=noise, base=noise)
    highest = {b"G07", b"E07"}
    start = int(block[channels.GNSS_OBS.name].valid_time_ns[0])
    gone = {}
    for name, rows in block.items():
        if "satellite" not in rows.values:
            gone[name] = rows
            continue
        hidden = np.isin(rows["satellite"], list(highest)) & (rows.valid_time_ns >= start + 6 * NS)
        gone[name] = rows.take(~hidden)
    parts = run_stage(Rtk(), config(), [gone])
    solution = whole(parts, channels.SOLUTION)
    want = np.array([path(float(k)) for k in range(12)])
    assert (solution["status"] == FIXED).all()
    assert np.abs(solution["position_ecef_m"] - want).max() < 2 * CM
    events = whole(parts, channels.FILTER_EVENTS)
    assert list(events["kind"]) == [filter_pb2.EVENT_KIND_AMBIGUITIES_FIXED]


@pytest.mark.parametrize("late", [0.0, 0.2])
def test_cutting_the_log_changes_no_bit(late):
    sky = make_sky()
    noise = {"code": 0.3, "phase": 2 * MM}
    path = drive([300, -200, 20], [8.0, -3.0, 0.1])
    block, _ = pair(sky, path, rover=noise, base={**noise, "late": late})
    stage, settings = Rtk(), config()
    one = run_stage(stage, settings, [block])
    times = np.unique(np.concatenate([rows.log_time_ns for rows in block.values()]))
    # Every log time a block of its own, and the state through bytes at each.
    state = stage.start(settings, Context({}, {}))
    many = []
    for piece in cut(block, times[:-1]):
        fresh = stage.start(settings, Context({}, {}))
        state = stage.restore(fresh, stage.dump(state))
        state, outputs = stage.step(state, piece)
        ends = [int(rows.log_time_ns[-1]) for rows in piece.values()]
        for rows in outputs.values():
            assert (rows.log_time_ns == max(ends)).all()
        many.append(outputs)
    many.append(stage.finish(state))
    for port in Rtk().spec.outputs:
        if port.channel == channels.FILTER_EVENTS:
            continue
        a, b = whole(one, port.channel), whole(many, port.channel)
        np.testing.assert_array_equal(a.valid_time_ns, b.valid_time_ns)
        np.testing.assert_array_equal(a.log_time_ns, b.log_time_ns)
        for name, column in a.values.items():
            np.testing.assert_array_equal(column, b.values[name])


def test_without_the_base_there_is_a_single_position_and_an_event():
    sky = make_sky()
    path = drive([300, -200, 20], [8.0, -3.0, 0.1])
    block, _ = pair(sky, path)
    start = int(block[channels.GNSS_OBS.name].valid_time_ns[0])
    for channel in READ:
        name = Port(channel, BASE).name
        rows = block[name]
        block[name] = rows.take(rows.valid_time_ns < start + 4 * NS)
    parts = run_stage(Rtk(), config(base={"max_age": 2.5}), [block])
    solution = whole(parts, channels.SOLUTION)
    status = solution["status"]
    assert (status[:6] >= FLOAT).all()
    assert (status[6:] == SINGLE).all()
    events = whole(parts, channels.FILTER_EVENTS)
    assert (events["kind"] == filter_pb2.EVENT_KIND_BASE_LOST).sum() == 1
    age = whole(parts, channels.RELATIVE_POSITION)["base_age_s"]
    np.testing.assert_allclose(age, [0, 0, 0, 0, 1, 2])


def test_three_satellites_on_two_frequencies_are_no_position():
    """Twelve measurements of three directions: nothing is claimed, neither fixed nor float."""
    sky = make_sky(systems=("G",), count=8)
    block, _ = pair(sky, still([300, -200, 20]))
    start = int(block[channels.GNSS_OBS.name].valid_time_ns[0])
    rows = block[channels.GNSS_OBS.name]
    few = np.isin(rows["satellite"], sky.names[:3])
    block[channels.GNSS_OBS.name] = rows.take(few | (rows.valid_time_ns < start + 6 * NS))
    parts = run_stage(Rtk(), config(), [block])
    solution = whole(parts, channels.SOLUTION)
    assert (solution["status"][:6] >= FLOAT).all()
    assert len(solution) == 6
    kinds = whole(parts, channels.FILTER_EVENTS)["kind"]
    assert (kinds == filter_pb2.EVENT_KIND_TOO_FEW_SATELLITES).sum() == 6


def test_a_moving_base_gives_the_vector_between_the_receivers():
    sky = make_sky()
    base_path = drive([0, 0, 0], [12.0, 5.0, 0.2])
    apart = np.array([1.2, 0.9, 0.3]) @ AXES
    block, truth = pair(sky, lambda t: base_path(t) + apart, base_path=base_path)
    # Neither receiver knows its place to better than some metres.
    coarse = block[Port(channels.COARSE, BASE).name]
    values = dict(coarse.values)
    values["position_ecef_m"] = np.array([base_path(float(k)) + 4.0 for k in range(12)])
    block[Port(channels.COARSE, BASE).name] = dataclasses.replace(coarse, values=values)
    parts = run_stage(Rtk(), config(MovingBaseConfig, base={"length": 1.53}), [block])
    rows = whole(parts, channels.RELATIVE_POSITION)
    assert (rows["status"] == FIXED).all()
    # The receivers' clocks differ by up to 2 us: 30 um of way.
    assert np.abs(rows["baseline_ecef_m"] - apart).max() < 0.2 * MM
    local = local_axes_of_ellipsoid(base_path(0.0)) @ apart
    heading = np.arctan2(local[0], local[1]) % (2 * np.pi)
    np.testing.assert_allclose(rows["heading_rad"], heading, atol=2e-4)
    pitch = np.arctan2(local[2], np.hypot(local[0], local[1]))
    np.testing.assert_allclose(rows["pitch_rad"], pitch, atol=2e-4)
    assert_integers(parts, sky, ("1C", "5Q"), truth)


def test_integers_are_fed_back_after_some_epochs():
    sky = make_sky()
    noise = {"code": 0.3, "phase": 2 * MM}
    block, truth = pair(sky, still([300, 200, 5]), rover=noise, base=noise)
    table = {"ambiguities": {"mode": "fix-and-hold", "hold_count": 4}}
    parts = run_stage(Rtk(), config(rtk=table), [block])
    rows = whole(parts, channels.FILTER_RESOLUTION)
    held = rows["status"] == sights_pb2.AMBIGUITY_STATUS_HELD
    assert list(held) == [False] * 3 + [True] * 9
    # From the next epoch on the float ambiguities are the integers.
    rows = whole(parts, channels.FILTER_AMBIGUITIES)
    last = rows.valid_time_ns == rows.valid_time_ns[-1]
    miss = rows["float_cycles"][last] - rows["integer_cycles"][last]
    assert np.abs(miss).max() < 0.05
    assert rows["float_std_cycles"][last].max() < 0.05
    assert_integers(parts, sky, ("1C", "5Q"), truth)


@pytest.mark.parametrize("dynamics", ["static", "velocity"])
def test_a_position_about_a_base_that_moves_is_not_carried_on(dynamics):
    settings = config(MovingBaseConfig, rtk={"motion": {"dynamics": dynamics}})
    with pytest.raises(ConfigurationError, match="the base moves"):
        Rtk().start(settings, Context({}, {}))
