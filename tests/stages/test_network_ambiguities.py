"""Integers between two reference stations: found, kept, lost with a slip, and repaired."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from replay import channels, configuration
from replay.kernels.network_records import (
    EVENT_INTEGER_REPAIRED,
    EVENT_STATION_FOUND,
    EVENT_STATION_LOST,
)
from replay.stages.base import BASE, Context, Port
from replay.stages.network_ambiguities import NetworkAmbiguities, _growth
from replay.stages.network_config import NetworkConfig
from tests.stages.test_rtk import cut, integers
from tests.stages.two_receivers import (
    BASE_POSITION,
    C_M_S,
    FREQUENCY,
    NS,
    fixed_base,
    local_axes,
    make_sky,
    receive,
    run_stage,
    whole,
)

SIGNALS = ("1C", "2W")
STATION = BASE_POSITION + np.array([40_000.0, 50_000.0, -400.0]) @ local_axes(BASE_POSITION)
NOISE = {"code": 0.2, "phase": 0.002}
MM = 1e-3
SKY = make_sky(("G",), 9)


def wavelength(signal):
    return C_M_S / FREQUENCY[signal]


def settings(**own):
    """Settings for noise that is white."""
    white = {"code_correlation": 0.0, "phase_correlation": 0.0}
    return configuration.build(
        NetworkConfig, [{"gnss": {"base": "master"}, "integers": {**white, **own}}]
    )


def stage():
    return NetworkAmbiguities(BASE, "s1", "master-s1")


def ionosphere(satellites, t):
    """Slant delays (m, L1) at the station beyond the master's: decimetres, slowly changing."""
    generator = np.random.default_rng(5)
    level, rate = generator.normal(0.0, 0.15, 9), generator.normal(0.0, 2e-4, 9)
    return np.array([level[SKY.names.index(bytes(s))] for s in satellites]) + t * np.array(
        [rate[SKY.names.index(bytes(s))] for s in satellites]
    )


def stations(epochs=range(90), *, station_integers=None, lost=(), station_epochs=None, late=0.0):
    """Both stations' channels and the true integers station less master."""
    own = integers(SKY, SIGNALS, 2) if station_integers is None else station_integers
    other = integers(SKY, SIGNALS, 3)
    block = {
        **receive(SKY, "s1", epochs if station_epochs is None else station_epochs,
                  lambda t: STATION, lambda t: 40.0 + 3.0 * t, own, signals=SIGNALS, seed=21,
                  lost=lost, late=late, **NOISE),
        **receive(SKY, BASE, epochs, lambda t: BASE_POSITION, lambda t: -80.0 + 5.0 * t, other,
                  signals=SIGNALS, seed=22, **NOISE),
    }  # fmt: skip
    block = fixed_base(block)
    coarse, obs = Port(channels.COARSE, "s1").name, Port(channels.GNSS_OBS, "s1").name
    place = np.tile(STATION, (len(block[coarse]), 1))
    block[coarse] = with_values(block[coarse], position_ecef_m=place)
    rows = block[obs]
    t = (rows.valid_time_ns - 1_300_000_000 * NS) / NS
    length = np.array([wavelength(bytes(s).decode()) for s in rows["signal"]])
    delay = ionosphere(rows["satellite"], t) * (length / wavelength("1C")) ** 2
    block[obs] = with_values(
        rows,
        pseudorange_m=rows["pseudorange_m"] + delay,
        carrier_phase_cycles=rows["carrier_phase_cycles"] - delay / length,
    )
    return block, (own(0.0) if callable(own) else own) - other


def with_values(columns, **fields):
    return dataclasses.replace(columns, values={**columns.values, **fields})


def assert_right(parts, truth, since=0):
    """Every integer that was given is the true one; how many there were."""
    rows = whole(parts, Named(channels.NETWORK_AMBIGUITIES))
    known = rows.is_present("integer_cycles") & (rows.valid_time_ns >= since)
    for k in np.flatnonzero(known):
        i = SKY.names.index(bytes(rows["satellite"][k]))
        j = SKY.names.index(bytes(rows["reference"][k]))
        signal = bytes(rows["signal"][k]).decode()
        difference = truth[i] - truth[j]
        want = difference[0] - difference[1]
        if signal != "WL":
            want = difference[SIGNALS.index(signal)]
        assert rows["integer_cycles"][k] == want
    return int(known.sum())


class Named:
    """A channel under the name that the stage gives it."""

    def __init__(self, channel):
        self.name = Port(channel, "master-s1").name


def test_all_integers_are_found_within_seconds_and_are_the_true_ones():
    block, truth = stations()
    parts = run_stage(stage(), settings(), [block])
    assert assert_right(parts, truth) > 0
    steps = whole(parts, Named(channels.NETWORK_RESOLUTION))
    t = (steps.valid_time_ns - steps.valid_time_ns[0]) / NS
    assert (steps["known_count"][t > 30.0] == len(SKY.names)).all()


def test_what_is_left_is_the_ionosphere_that_was_put_in():
    block, _ = stations()
    parts = run_stage(stage(), settings(), [block])
    rows = whole(parts, Named(channels.NETWORK_RESIDUALS))
    assert len(rows) > 1000
    t = (rows.valid_time_ns - 1_300_000_000 * NS) / NS
    references = rows["reference"]
    signals = [bytes(s).decode() for s in rows["signal"]]
    ratio = np.array([(wavelength(s) / wavelength("1C")) ** 2 for s in signals])
    put_in = ionosphere(rows["satellite"], t) - ionosphere(references, t)
    noise = rows["residual_m"] + ratio * put_in
    # Four phases of 2 mm each.
    assert np.std(noise) == pytest.approx(2.0 * 2 * MM, rel=0.1)
    assert abs(np.mean(noise)) < 1 * MM


@pytest.mark.parametrize("late", [0.0, 0.2])
def test_cutting_the_log_changes_no_bit(late):
    block, _ = stations(range(50), lost=[(30, "G04")], late=late)
    one = run_stage(stage(), settings(), [block])
    times = np.unique(np.concatenate([rows.log_time_ns for rows in block.values()]))
    runner, config = stage(), settings()
    state = runner.start(config, Context({}, {}))
    many = []
    for piece in cut(block, times[:-1]):
        state = runner.restore(runner.start(config, Context({}, {})), runner.dump(state))
        state, outputs = runner.step(state, piece)
        ends = [int(rows.log_time_ns[-1]) for rows in piece.values()]
        for rows in outputs.values():
            assert (rows.log_time_ns == max(ends)).all()
        many.append(outputs)
    many.append(runner.finish(state))
    for output in runner.spec.outputs:
        a, b = whole(one, output), whole(many, output)
        np.testing.assert_array_equal(a.valid_time_ns, b.valid_time_ns)
        np.testing.assert_array_equal(a.log_time_ns, b.log_time_ns)
        for name, column in a.values.items():
            if isinstance(column, np.ndarray):
                np.testing.assert_array_equal(column, b.values[name])


@pytest.mark.parametrize("told", [True, False])
def test_after_a_slip_the_new_integer_is_found(told):
    first = integers(SKY, SIGNALS, 2)
    later = first.copy()
    later[3] += [7.0, 5.0]
    lost = [(50, "G04")] if told else []
    block, _ = stations(
        range(110), station_integers=lambda t: later if t >= 50 else first, lost=lost
    )
    parts = run_stage(stage(), settings(), [block])
    other = integers(SKY, SIGNALS, 3)
    rows = whole(parts, Named(channels.NETWORK_AMBIGUITIES))
    at = 1_300_000_000 * NS + 50 * NS
    mine = rows["satellite"] == b"G04"
    known = rows.is_present("integer_cycles")
    assert not known[mine & (rows.valid_time_ns == at)].any()
    assert known[mine & (rows.valid_time_ns >= at + 50 * NS)].all()
    before, after = first - other, later - other
    for truth, some in ((before, rows.valid_time_ns < at), (after, rows.valid_time_ns >= at)):
        for k in np.flatnonzero(some & known):
            i = SKY.names.index(bytes(rows["satellite"][k]))
            j = SKY.names.index(bytes(rows["reference"][k]))
            if bytes(rows["signal"][k]) == b"1C":
                assert rows["integer_cycles"][k] == truth[i, 0] - truth[j, 0]


def test_a_wrong_integer_is_repaired_and_told():
    block, truth = stations()
    half = 1_300_000_000 * NS + 45 * NS
    before, after = cut(block, [half])
    runner, config = stage(), settings(doubt=4)
    state = runner.start(config, Context({}, {}))
    state, _ = runner.step(state, before)
    number = int(np.flatnonzero(state.integers["known"][0])[2])
    state.integers["first"][0, number] += 1
    state.integers["second"][0, number] += 1
    state, outputs = runner.step(state, after)
    events = outputs[Named(channels.NETWORK_EVENTS).name]
    repaired = events["kind"] == EVENT_INTEGER_REPAIRED
    assert repaired.sum() == 1
    assert events["value"][repaired][0] == -1.0
    assert events.valid_time_ns[repaired][0] == half + 4 * NS
    assert assert_right([outputs], truth, since=half + 5 * NS) > 0


def test_correlated_errors_take_longer_to_average():
    """The deviation that the filter takes is that of the mean of an AR(1) process."""
    tau, interval, count = 6.0, 1.0, 4000
    fade = np.exp(-interval / tau)
    lags = np.arange(1, count)
    variance_of_mean = (1.0 + 2.0 * np.sum((1.0 - lags / count) * fade**lags)) / count
    assert _growth(tau, interval) == pytest.approx(np.sqrt(variance_of_mean * count), rel=1e-3)
    assert _growth(0.0, interval) == 1.0
    assert _growth(6.0, 30.0) == pytest.approx(1.0, abs=0.01)


def test_a_station_that_stays_away_is_told_and_taken_up_again():
    away = [k for k in range(100) if not 50 <= k < 60]
    block, truth = stations(range(100), station_epochs=range(100))
    for channel in (channels.GNSS_OBS, channels.SATELLITES, channels.CORRECTIONS, channels.COARSE):
        name = Port(channel, BASE).name
        k = (block[name].valid_time_ns - 1_300_000_000 * NS) // NS
        block[name] = block[name].take(np.isin(k, away))
    parts = run_stage(stage(), settings(), [block])
    events = whole(parts, Named(channels.NETWORK_EVENTS))
    assert (events["kind"] == EVENT_STATION_LOST).sum() == 1
    assert (events["kind"] == EVENT_STATION_FOUND).sum() == 1
    rows = whole(parts, Named(channels.NETWORK_RESIDUALS))
    k = (rows.valid_time_ns - 1_300_000_000 * NS) // NS
    assert not np.isin(k, range(50, 60)).any()
    assert (k > 90).any()
    assert assert_right(parts, truth) > 0
