"""A virtual station against a simulated receiver that stands where it would."""

import functools

import numpy as np
import pytest

from replay import channels, configuration
from replay.log.columns import Columns, concatenate
from replay.stages.base import BASE, Context, Port
from replay.stages.network_config import NetworkRtkConfig
from replay.stages.network_virtual import VIRTUAL, NetworkVirtual
from replay.stages.satellites import Satellites
from tests.simulate.observing import base, make
from tests.stages.gnss_chain import logged
from tests.stages.two_receivers import NS

MM = 1e-3
C = 299_792_458.0
HZ = {b"G1C": 1575.42e6, b"G2W": 1227.60e6, b"E1C": 1575.42e6, b"E7Q": 1207.14e6,
      b"C2I": 1561.098e6, b"C6I": 1268.52e6}  # fmt: skip
AWAY = {"latitude": "30.9 deg", "longitude": "114.8 deg", "height": "120 m"}
OBS = Port(channels.GNSS_OBS, BASE).name
OUT = Port(channels.GNSS_OBS, VIRTUAL).name
INFO = Port(channels.RECEIVER, VIRTUAL).name
SETTINGS = configuration.build(NetworkRtkConfig, [{"atmosphere": {"shapiro": False}}])


@functools.cache
def world():
    """Inputs of the stage but the network's corrections, and a receiver 65 km from the master."""
    made = make(base("mref"), {**base("away"), **AWAY})
    block = {
        OBS: logged(channels.GNSS_OBS.name, made.observations("mref")),
        channels.NAV.name: logged(channels.NAV.name, made.rows[channels.NAV.topic]),
        channels.NAV_IONOSPHERE.name: logged(
            channels.NAV_IONOSPHERE.name, made.rows[channels.NAV_IONOSPHERE.topic]
        ),
    }
    heads = {Port(channels.RECEIVER, BASE).name: made.rows[channels.RECEIVER.at(receiver="mref")]}
    context = Context({}, heads)
    master = Satellites(BASE)
    state = master.start(SETTINGS, context)
    _, found = master.step(state, block)
    for channel in (channels.SATELLITES, channels.CORRECTIONS):
        name = Port(channel, BASE).name
        block[name] = logged(channel.name, found[name])
    place = made.rows[channels.RECEIVER.at(receiver="away")]["approximate_position_ecef_m"][0]
    times = np.unique(block[OBS].valid_time_ns)
    block[channels.COARSE.name] = Columns.build(
        times, {"position_ecef_m": np.tile(place, (len(times), 1))}, log_time_ns=times
    )
    return block, context, logged(channels.GNSS_OBS.name, made.observations("away"))


def corrections(rows, common=0.0, delay=0.0, hidden=(), late=0):
    """For every signal: what is common to the frequencies less the ionosphere's delay."""
    names = [s[:1] + signal for s, signal in zip(rows["satellite"], rows["signal"], strict=True)]
    hz = np.array([HZ[name] for name in names])
    keep = ~np.isin(np.array(names), list(hidden))
    return Columns.build(
        rows.valid_time_ns,
        {
            "satellite": rows["satellite"],
            "reference": rows["satellite"],
            "signal": rows["signal"],
            "correction_m": common - delay * (1575.42e6 / hz) ** 2,
        },
        log_time_ns=rows.log_time_ns + late,
    ).take(keep), hz


def run(block):
    _, context, _ = world()
    stage = NetworkVirtual()
    state = stage.start(SETTINGS, context)
    state, outputs = stage.step(state, block)
    return outputs


def joined(a, b):
    """Rows of both of the same time, satellite and signal."""
    places = [
        {
            key: k
            for k, key in enumerate(
                zip(
                    rows.valid_time_ns.tolist(),
                    rows["satellite"].tolist(),
                    rows["signal"].tolist(),
                    strict=True,
                )
            )
        }
        for rows in (a, b)
    ]
    keys = [key for key in places[0] if key in places[1]]
    return (
        rows.take(np.array([p[k] for k in keys])) for rows, p in zip((a, b), places, strict=True)
    )


def test_it_measures_what_a_receiver_there_does():
    block, _, there = world()
    found, _ = corrections(block[OBS])
    outputs = run({**block, channels.NETWORK_CORRECTIONS.name: found})
    virtual = outputs[OUT]
    assert len(virtual) > 0.9 * len(there)
    a, b = joined(virtual, there)
    assert len(a) > 0.9 * len(there)
    # Clocks are perfect and the air is as modelled: ranges agree although 65 km lie between.
    assert np.abs(a["pseudorange_m"] - b["pseudorange_m"]).max() < 0.5 * MM
    cycles = a["carrier_phase_cycles"] - b["carrier_phase_cycles"]
    assert np.abs(cycles - np.round(cycles)).max() < 0.005
    label = np.char.add(a["satellite"], a["signal"])
    for name in np.unique(label):
        assert len(np.unique(np.round(cycles[label == name]))) == 1
    info = outputs[INFO]
    np.testing.assert_array_equal(
        info["approximate_position_ecef_m"], block[channels.COARSE.name]["position_ecef_m"][:1]
    )
    assert info.ragged("marker").texts() == [VIRTUAL]


@pytest.mark.parametrize("hidden", [(), (b"G2W",)])
def test_the_ionosphere_turns_its_sign_on_codes(hidden):
    block, _, _ = world()
    common, delay = 0.07, 0.11
    plain, _ = corrections(block[OBS], hidden=hidden)
    found, _ = corrections(block[OBS], common, delay, hidden)
    a, b = (run({**block, channels.NETWORK_CORRECTIONS.name: rows})[OUT] for rows in (plain, found))
    names = [s[:1] + signal for s, signal in zip(a["satellite"], a["signal"], strict=True)]
    assert not set(names) & set(hidden)
    hz = np.array([HZ[name] for name in names])
    slant = delay * (1575.42e6 / hz) ** 2
    phase = (b["carrier_phase_cycles"] - a["carrier_phase_cycles"]) * C / hz
    np.testing.assert_allclose(phase, common - slant, atol=1e-7)
    code = b["pseudorange_m"] - a["pseudorange_m"]
    # One frequency alone does not tell the two parts apart.
    alone = np.array([bool(hidden) and name[:1] == b"G" for name in names])
    assert alone.any() == bool(hidden)
    np.testing.assert_allclose(code, np.where(alone, 0.0, common + slant), atol=1e-7)


def test_cutting_the_log_changes_no_bit():
    block, context, _ = world()
    found, _ = corrections(block[OBS], 0.07, 0.11, late=2 * NS)
    # Some of the rover's epochs have no corrections, and some are a little off.
    k = (found.valid_time_ns - found.valid_time_ns[0]) // NS
    found = found.take(k % 5 != 3)
    found.valid_time_ns[:] += 50_000_000
    block = {**block, channels.NETWORK_CORRECTIONS.name: found}
    one = run(block)[OUT]
    stage = NetworkVirtual()
    state = stage.start(SETTINGS, context)
    parts = []
    for t in np.unique(np.concatenate([rows.log_time_ns for rows in block.values()])):
        state = stage.restore(stage.start(SETTINGS, context), stage.dump(state))
        piece = {name: rows.take(rows.log_time_ns == t) for name, rows in block.items()}
        state, outputs = stage.step(
            state, {name: rows for name, rows in piece.items() if len(rows)}
        )
        if OUT in outputs:
            parts.append(outputs[OUT])
    many = concatenate(parts)
    np.testing.assert_array_equal(one.log_time_ns, many.log_time_ns)
    np.testing.assert_array_equal(one.valid_time_ns, many.valid_time_ns)
    for name, column in one.values.items():
        assert column.tobytes() == many.values[name].tobytes(), name
    whole = stage.start(SETTINGS, context)
    whole, _ = stage.step(whole, block)
    assert stage.dump(whole) == stage.dump(state)
    # It bears the master's epoch and the log time of the corrections.
    assert set(np.unique(one.log_time_ns - one.valid_time_ns)) == {2 * NS}
    assert len(np.unique(one.valid_time_ns)) == len(np.unique(found.valid_time_ns))
