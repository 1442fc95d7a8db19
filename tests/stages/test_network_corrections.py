"""Corrections of a rover from a made-up network whose errors are known everywhere."""

import dataclasses
import itertools

import numpy as np
import pymap3d
import pytest

from replay import channels, configuration
from replay.errors import ConfigurationError
from replay.log.columns import Columns, concatenate
from replay.stages.base import BASE, Context, Port
from replay.stages.network_config import NetworkRtkConfig
from replay.stages.network_corrections import NetworkCorrections
from tests.stages.gnss_chain import logged
from tests.stages.two_receivers import NS

T0 = 1_300_000_000 * NS
LATITUDE, LONGITUDE = 37.3, 127.0
# Lee (2010): 95 km by 115 km, the master in a corner.
STATIONS = {
    "ref1": np.array([95e3, 2e3]),
    "ref2": np.array([-1e3, 115e3]),
    "ref3": np.array([93e3, 112e3]),
}
NAMES = (b"G02", b"G07", b"G13", b"G30", b"E05", b"E11", b"E24")
SIGNALS = {b"G": (b"1C", b"2W"), b"E": (b"1C", b"5Q")}
REFERENCE = {b"G": b"G07", b"E": b"E11"}
COARSE = channels.COARSE.name
OUT = channels.NETWORK_CORRECTIONS.name


def ecef(local, up=0.0):
    return np.array(pymap3d.enu2ecef(*local, up, LATITUDE, LONGITUDE, 50.0))


def stage(names=tuple(STATIONS)):
    return NetworkCorrections(tuple(names), tuple(f"mref-{name}" for name in names))


def config(**interpolation):
    return configuration.build(NetworkRtkConfig, [{"interpolation": interpolation}])


def context(names=tuple(STATIONS)):
    heads = {}
    for role, place in ((BASE, np.zeros(2)), *((name, STATIONS[name]) for name in names)):
        heads[Port(channels.RECEIVER, role).name] = Columns.build(
            [T0],
            {
                "approximate_position_ecef_m": ecef(place)[None],
                "antenna_offset_enu_m": np.zeros((1, 3)),
            },
        )
    return Context({}, heads)


def truth(place, t, name, signal, reference):
    """Error (m) of one double difference at a place: a plane that moves with time."""

    def single(satellite):
        k = NAMES.index(satellite)
        slopes = np.array([1.1 * k - 2.0, 1.7 - 0.6 * k]) * 1e-6
        drift = np.array([0.2 * k - 0.5, 0.3 - 0.1 * k]) * 1e-8
        scale = 1.0 if signal == b"1C" else 1.6
        return scale * place @ (slopes + drift * t)

    return single(name) - single(reference)


def rate(place, name, signal, reference):
    return truth(place, 1.0, name, signal, reference) - truth(place, 0.0, name, signal, reference)


def errors(name, epochs, *, field=truth, late=0.0, hidden=(), reference=REFERENCE, sigma=0.01):
    """What the filters of one baseline write; `hidden` has pairs of epoch and satellite."""
    place, rows = STATIONS[name], []
    for k in epochs:
        for satellite in NAMES:
            base = reference(k)[satellite[:1]] if callable(reference) else reference[satellite[:1]]
            if satellite == base or (k, satellite) in hidden:
                continue
            for signal in SIGNALS[satellite[:1]]:
                value = field(place, float(k), satellite, signal, base)
                slope = rate(place, satellite, signal, base)
                rows.append((T0 + round(k * NS), satellite, base, signal, value, slope))
    t, satellite, base, signal, value, slope = zip(*rows, strict=True)
    valid = np.array(t, dtype=np.int64)
    nothing = np.zeros(len(rows))
    return Columns.build(
        valid,
        {
            "satellite": np.array(satellite, dtype="S3"),
            "reference": np.array(base, dtype="S3"),
            "signal": np.array(signal, dtype="S2"),
            "error_m": np.array(value),
            "error_rate_m_s": np.array(slope),
            "error_acceleration_m_s2": nothing,
            "multipath_m": nothing,
            "error_std_m": np.full(len(rows), sigma),
            "error_rate_std_m_s": np.full(len(rows), 1e-4),
            "error_acceleration_std_m_s2": np.full(len(rows), 1e-6),
            "multipath_std_m": nothing,
            "innovation_m": nothing,
            "innovation_std_m": nothing,
        },
        log_time_ns=valid + round(late * NS),
    )


def coarse(place, epochs, late=0.0, up=0.0):
    valid = T0 + np.array([round(k * NS) for k in epochs], dtype=np.int64)
    return Columns.build(
        valid,
        {
            "position_ecef_m": np.tile(ecef(place, up), (len(valid), 1)),
            "clock_offset_m": np.zeros(len(valid)),
            "age_s": np.zeros(len(valid)),
            "satellite_count": np.full(len(valid), 9, dtype=np.uint32),
        },
        log_time_ns=valid + round(late * NS),
    )


def network(epochs=range(10), rover=(40e3, 55e3), names=tuple(STATIONS), **special):
    """A block of everything; `special` has arguments of `errors` by station."""
    block = {COARSE: coarse(np.array(rover), epochs)}
    for name in names:
        given = {"epochs": epochs, **special.get(name, {})}
        block[Port(channels.NETWORK_ERRORS, f"mref-{name}").name] = errors(name, **given)
    return block


def run(block, settings, names=tuple(STATIONS)):
    own = stage(names)
    state = own.start(settings, context(names))
    state, outputs = own.step(state, block)
    parts = [part[OUT] for part in (outputs, own.finish(state)) if OUT in part]
    return concatenate(parts) if parts else None


def run_cut(block, settings, names=tuple(STATIONS)):
    """Every log time a block of its own, and the state through bytes at each."""
    own = stage(names)
    state = own.start(settings, context(names))
    parts = []
    for t in np.unique(np.concatenate([rows.log_time_ns for rows in block.values()])):
        state = own.restore(own.start(settings, context(names)), own.dump(state))
        piece = {name: rows.take(rows.log_time_ns == t) for name, rows in block.items()}
        state, outputs = own.step(state, {name: rows for name, rows in piece.items() if len(rows)})
        if OUT in outputs:
            assert (outputs[OUT].log_time_ns == t).all()
            parts.append(outputs[OUT])
    last = own.finish(state)
    return concatenate([*parts, *([last[OUT]] if OUT in last else [])])


def assert_same(a, b):
    np.testing.assert_array_equal(a.valid_time_ns, b.valid_time_ns)
    np.testing.assert_array_equal(a.log_time_ns, b.log_time_ns)
    for name, column in a.values.items():
        assert column.tobytes() == b.values[name].tobytes(), name


def misses(out, rover):
    """Corrections less the truth at the rover."""
    seconds = (out.valid_time_ns - T0) / NS
    want = [
        truth(np.array(rover), t, bytes(s), bytes(signal), bytes(base))
        for t, s, signal, base in zip(
            seconds, out["satellite"], out["signal"], out["reference"], strict=True
        )
    ]
    return out["correction_m"] - np.array(want)


@pytest.mark.parametrize("method", ["lim", "lcm"])
@pytest.mark.parametrize("rover", [(40e3, 55e3), (-20e3, 10e3), (130e3, 140e3)])
def test_a_linear_field_is_reproduced(method, rover):
    out = run(network(rover=rover), config(method=method))
    assert np.abs(misses(out, rover)).max() < 1e-9
    assert np.abs(out["misfit_m"]).max() < 1e-9
    assert (out["station_count"] == 3).all()
    assert (out["age_s"] == 0.0).all()
    # Every satellite, the references too, by satellite and signal.
    labels = list(zip(out["satellite"].tolist(), out["signal"].tolist(), strict=True))
    assert labels == [(s, signal) for s in NAMES for signal in SIGNALS[s[:1]]] * 10
    own = out["satellite"] == out["reference"]
    assert own.sum() == 40
    for name in ("correction_m", "correction_std_m", "misfit_m"):
        assert (out[name][own] == 0.0).all()
    assert (out["correction_std_m"][~own] > 0.0).all()


def test_height_and_the_round_earth_are_small():
    """A rover 600 m up, and errors that are a plane in latitude and longitude."""
    rover = np.array([60e3, 70e3])

    def curved(place, t, name, signal, reference):
        latitude, longitude, _ = pymap3d.ecef2geodetic(*ecef(place))
        k = NAMES.index(name) - NAMES.index(reference)
        return k * 0.5 * (latitude - LATITUDE) - k * 0.2 * (longitude - LONGITUDE)

    block = network(**{name: {"field": curved} for name in STATIONS})
    block[COARSE] = coarse(rover, range(10), up=600.0)
    out = run(block, config())
    want = np.array([
        curved(rover, 0.0, bytes(s), b"", bytes(r))
        for s, r in zip(out["satellite"], out["reference"], strict=True)
    ])  # fmt: skip
    assert np.abs(want).max() > 0.1
    # Longitudes of one plane coordinate change by 1 % over a degree of latitude.
    assert np.abs(out["correction_m"] - want).max() < 0.01 * np.abs(want).max()


@pytest.mark.parametrize("method", ["lim", "lcm", "dim"])
@pytest.mark.parametrize("at", ["ref1", "ref2"])
def test_a_rover_at_a_station_has_its_errors(method, at):
    names = ("ref1", "ref2")
    out = run(network(rover=STATIONS[at], names=names), config(method=method), names)
    assert np.abs(misses(out, STATIONS[at])).max() < 1e-9
    own = out["satellite"] != out["reference"]
    np.testing.assert_allclose(out["correction_std_m"][own], 0.01, rtol=1e-9)
    assert (out["misfit_m"] == 0.0).all()


def test_numpy_finds_the_same_from_the_positions():
    def wild(place, t, name, signal, reference):
        return 0.3 * np.sin(place[0] * 1e-5 + place[1] * 2e-5 + t + len(name + signal) + name[2])

    rover = np.array([40e3, 55e3])
    block = network(**{name: {"field": wild} for name in STATIONS})
    out = run(block, config(slope=0.0, curvature=0.0))
    A = np.array(list(STATIONS.values()))
    w = rover @ np.linalg.pinv(A)
    own = out["satellite"] != out["reference"]
    for k in np.flatnonzero(own):
        t = (out.valid_time_ns[k] - T0) / NS
        s, signal = bytes(out["satellite"][k]), bytes(out["signal"][k])
        e = np.array([wild(place, t, s, signal, b"") for place in STATIONS.values()])
        assert out["correction_m"][k] == pytest.approx(w @ e, abs=1e-9)
        left = e - A @ np.linalg.pinv(A) @ e
        assert out["misfit_m"][k] == pytest.approx(np.sqrt(np.mean(left**2)), abs=1e-9)
    # Half of a station's variance is the master's, and common.
    covariance = 1e-4 * (0.5 * np.eye(3) + 0.5)
    own_part = out["correction_std_m"][own] ** 2 - out["misfit_m"][own] ** 2
    np.testing.assert_allclose(own_part, w @ covariance @ w, rtol=1e-6)


def test_a_satellite_that_a_station_lacks_comes_from_the_others():
    hidden = [(k, b"G13") for k in range(10)]
    gone = [(k, b"E24") for k in range(5)]
    block = network(
        ref2={"hidden": hidden + gone}, ref1={"hidden": gone}, ref3={"hidden": gone}
    )  # fmt: skip
    out = run(block, config())
    k = (out.valid_time_ns - T0) // NS
    counts = np.where(out["satellite"] == b"G13", 2, 3)
    np.testing.assert_array_equal(out["station_count"], counts)
    assert not ((out["satellite"] == b"E24") & (k < 5)).any()
    assert ((out["satellite"] == b"E24") & (k >= 5)).sum() == 10
    # Two stations define the plane as well as three.
    assert np.abs(misses(out, (40e3, 55e3))).max() < 1e-9


def test_a_station_that_falls_silent_drops_out():
    block = network(range(12), ref3={"epochs": range(4)})
    out = run(block, config(max_age=3.0))
    k = (out.valid_time_ns - T0) // NS
    np.testing.assert_array_equal(out["station_count"], np.where(k <= 6, 3, 2))
    np.testing.assert_array_equal(out["age_s"], np.where((k > 3) & (k <= 6), k - 3.0, 0.0))
    # Its rate has carried it on; where it is gone the plane goes on without it.
    assert np.abs(misses(out, (40e3, 55e3))).max() < 1e-9
    # It is waited for only while it may come.
    waited = (out.log_time_ns - out.valid_time_ns) / NS
    assert set(waited[(k < 4) | (k > 6)]) == {0.0}
    assert (waited[(k > 3) & (k <= 6)] == 1.0).all()
    # The deviation of what is carried on grows with that of its rate and acceleration.
    label = (out["satellite"] == b"G02") & (out["signal"] == b"1C")
    sigma = out["correction_std_m"][label]
    assert (np.diff(sigma[3:7]) > 0.0).all()
    assert sigma[0] == sigma[3]


def test_carried_on_deviation():
    names = ("ref1",)
    block = network(range(12), rover=STATIONS["ref1"], names=names, ref1={"epochs": range(4)})
    out = run(block, config(max_age=6.0), names)
    own = out["satellite"] != out["reference"]
    age = out["age_s"][own]
    assert age.max() == 6.0
    want = 0.01 + 1e-4 * age + 0.5e-6 * age**2
    np.testing.assert_allclose(out["correction_std_m"][own], want, rtol=1e-9)


@pytest.mark.parametrize("method", ["lim", "dim"])
@pytest.mark.parametrize("lates", [(0.0, 0.0, 0.0), (0.0, 0.25, 0.1), (0.3, 0.0, 2.6)])
def test_cutting_the_log_changes_no_bit(method, lates):
    special = {name: {"late": late} for name, late in zip(STATIONS, lates, strict=True)}
    special["ref2"]["epochs"] = [k for k in range(20) if k not in (7, 8, 9, 10, 11, 12)]
    special["ref1"]["hidden"] = [(3, b"G13"), (4, b"E24")]
    block = network(range(20), **special)
    settings = config(method=method, max_age=4.0)
    one = run(block, settings)
    assert_same(one, run_cut(block, settings))
    assert (np.diff(one.log_time_ns) >= 0).all()
    # What it remembers does not depend on the cuts either.
    own, dumps = stage(), []
    for edges in ([], [T0 + 7 * NS], [T0 + 5 * NS, T0 + 11 * NS, T0 + 17 * NS]):
        state = own.start(settings, context())
        for first, last in itertools.pairwise([0, *edges, 2**62]):
            piece = {
                name: rows.take((rows.log_time_ns > first) & (rows.log_time_ns <= last))
                for name, rows in block.items()
            }
            state, _ = own.step(state, {name: rows for name, rows in piece.items() if len(rows)})
        dumps.append(own.dump(state))
    assert dumps[0] == dumps[1] == dumps[2]


def test_a_late_station_is_waited_for_in_log_time():
    block = network(range(10), ref2={"late": 0.25})
    out = run(block, config(wait=0.4))
    k = (out.valid_time_ns - T0) // NS
    waited = (out.log_time_ns - out.valid_time_ns) / NS
    # Nobody knows of it before its first errors: the first epoch does not wait for it.
    np.testing.assert_array_equal(waited, np.where(k == 0, 0.0, 0.25))
    np.testing.assert_array_equal(out["station_count"], np.where(k == 0, 2, 3))
    assert (out["age_s"] == 0.0).all()
    # Shorter waits end at the first row after them, with what there is.
    out = run(block, config(wait=0.1))
    k = (out.valid_time_ns - T0) // NS
    waited = (out.log_time_ns - out.valid_time_ns) / NS
    np.testing.assert_array_equal(waited, np.where(k == 0, 0.0, 0.25))
    block = network(range(10), ref2={"late": 1.25}, ref1={"late": 0.05})
    out = run(block, config(wait=0.1))
    k = (out.valid_time_ns - T0) // NS
    middle = (k > 2) & (k < 9)
    waited = (out.log_time_ns - out.valid_time_ns) / NS
    np.testing.assert_allclose(waited[middle], 0.25)
    assert (out["age_s"][middle] == 1.0).all()
    assert (out["station_count"][middle] == 3).all()


def test_a_late_rover_takes_the_errors_of_its_epoch():
    block = network(range(30))
    block[COARSE] = coarse(np.array([40e3, 55e3]), range(30), late=7.0)
    out = run(block, config())
    assert (out["age_s"] == 0.0).all()
    assert np.abs(misses(out, (40e3, 55e3))).max() < 1e-9
    assert ((out.log_time_ns - out.valid_time_ns) == 7 * NS).all()
    assert_same(out, run_cut(block, config()))


@pytest.mark.parametrize("method", ["lim", "lcm"])
def test_one_baseline_may_have_another_reference(method):
    other = {b"G": b"G30", b"E": b"E11"}

    def changed(k):
        return other if k >= 5 else REFERENCE

    block = network(ref2={"reference": changed})
    out = run(block, config(method=method))
    assert np.abs(misses(out, (40e3, 55e3))).max() < 1e-9
    # Most baselines keep theirs.
    base = np.array([REFERENCE[bytes(s)[:1]] for s in out["satellite"]])
    np.testing.assert_array_equal(out["reference"], base)
    k = (out.valid_time_ns - T0) // NS
    # The other reference's own is the same difference with the other sign; the rest is less sure.
    gps = (out["satellite"] == b"G02") | (out["satellite"] == b"G13")
    sigma = out["correction_std_m"]
    assert sigma[gps & (k >= 5)].min() > sigma[gps & (k < 5)].max()
    assert_same(out, run_cut(block, config(method=method)))


def test_a_baseline_without_the_common_reference_is_left_out():
    other = {b"G": b"G30", b"E": b"E11"}
    hidden = [(k, b"G07") for k in range(10)] + [(k, b"G13") for k in range(10)]
    hidden += [(k, b"G02") for k in range(10)]
    block = network(
        ref2={"reference": other, "hidden": hidden},
        ref1={"hidden": [(k, b"G30") for k in range(10)]},
    )
    out = run(block, config())
    gps = np.char.startswith(out["satellite"], b"G")
    # Satellites 7 and 30 stand at two baselines each; two have 7 as their reference.
    assert (out["reference"][gps] == b"G07").all()
    assert (out["station_count"][~gps] == 3).all()
    np.testing.assert_array_equal(
        out["station_count"][gps], np.where(out["satellite"][gps] == b"G30", 1, 2)
    )
    whole_plane = ~gps | (out["satellite"] != b"G30")
    assert np.abs(misses(out, (40e3, 55e3)))[whole_plane].max() < 1e-9


def test_a_log_gives_back_the_same_rows():
    block = network(range(8), ref2={"hidden": [(3, b"G13")]})
    names = {Port(channels.NETWORK_ERRORS, f"mref-{name}").name for name in STATIONS}
    again = {
        name: logged(channels.NETWORK_ERRORS.name, rows) if name in names else rows
        for name, rows in block.items()
    }
    assert_same(run(block, config()), run(again, config()))


def test_without_errors_nothing_is_said():
    block = {COARSE: coarse(np.array([0.0, 0.0]), range(5))}
    assert run(block, config()) is None


def test_epochs_of_one_nominal_time_belong_together():
    block = network(range(10))
    shifted = coarse(np.array([40e3, 55e3]), [k - 0.03 for k in range(10)])
    # The rover's clock is behind: its epochs come with the stations' in the log.
    block[COARSE] = dataclasses.replace(shifted, log_time_ns=shifted.valid_time_ns + 3 * NS // 100)
    out = run(block, config())
    np.testing.assert_allclose(out["age_s"], -0.03)
    assert np.abs(misses(out, (40e3, 55e3))).max() < 1e-9


def test_a_station_without_a_position_is_named():
    known = context()
    heads = {name: rows for name, rows in known.heads.items() if not name.startswith("ref2")}
    with pytest.raises(ConfigurationError, match="ref2"):
        stage().start(config(), Context({}, heads))
