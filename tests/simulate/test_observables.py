"""Without errors, observables are range and clocks; with them, what was asked for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay import channels
from replay.errors import ConfigurationError
from replay.kernels.observables import SIGHT_DTYPE, see
from replay.simulate.air import Ionosphere, Troposphere, air_record
from replay.simulate.constellation import constellation, refer
from replay.simulate.trajectory import ecef_of
from tests.simulate.observing import (
    DRIVE,
    FREQUENCY,
    NO_AIR,
    START_NS,
    C,
    base,
    group_delay,
    make,
    message,
    receiver,
    series,
    signals_of,
    travel_and_clock,
)

UM = 1e-6
CLOCK = {"bias": "0.2 ms", "drift": "0.3 ppm", "walk": 1e-10, "reported": True}
LEVER = np.array([-0.4, 0.15, -1.2])


def place_of(made, name, kind, delay_s, lever):
    """Antenna (3,) at an epoch's true time, from the truth channel alone."""
    if kind == "static":
        info = made.rows[channels.RECEIVER.at(receiver=name)]
        return lambda time_ns, offset_s: info["approximate_position_ecef_m"][0]
    truth = made.rows[channels.TRUTH.topic]

    def at(time_ns, offset_s):
        then = time_ns - round(delay_s * 1e9)
        row = int(np.searchsorted(truth.valid_time_ns, then))
        assert truth.valid_time_ns[row] == then
        r, enu = truth["position_ecef_m"][row], truth["velocity_enu_m_s"][row]
        latitude, longitude = geodetic(r)
        axes = local(latitude, longitude)
        roll, pitch, heading = truth["attitude_rad"][row]
        ned = Rotation.from_euler("ZYX", [heading, pitch, roll]).apply(lever)
        return r + axes.T @ (enu * offset_s + np.array([ned[1], ned[0], -ned[2]]))

    return at


def geodetic(r):
    import pymap3d

    latitude, longitude, _ = pymap3d.ecef2geodetic(*r)
    return np.radians(latitude), np.radians(longitude)


def local(latitude, longitude):
    s, c, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    return np.array([[-sl, cl, 0.0], [-s * cl, -s * sl, c], [c * cl, c * sl, s]])


def code_remainders(made, name, kind, delay_s=0.0, lever=LEVER):
    """Pseudorange less receiver clock, satellite clock, group delay and range, m."""
    columns, epochs = made.observations(name), made.epochs(name)
    clocks = dict(zip(epochs.valid_time_ns.tolist(), epochs["clock_offset_s"], strict=True))
    at = place_of(made, name, kind, delay_s, lever)
    found = []
    for satellite, signal in signals_of(columns):
        m = message(made, satellite)
        one = series(columns, satellite, signal)
        delay = group_delay(m, signal)
        for row in range(0, len(one["time"]), 7):
            time_ns = int(one["time"][row])
            b = clocks[time_ns]
            travel, clock = travel_and_clock(m, at(time_ns, -b), time_ns, -b)
            found.append(one["pseudorange_m"][row] - C * (b + travel - clock + delay))
    return np.array(found)


def test_a_static_code_is_range_and_clocks():
    made = make(base(clock=CLOCK), sky=NO_AIR)
    left = code_remainders(made, "base", "static")
    assert len(left) > 200
    assert {s[0][0] for s in signals_of(made.observations("base"))} == set("GEC")
    assert np.abs(left).max() < UM


@pytest.mark.parametrize("delay", [0.0, 4.0])
def test_a_moving_code_is_that_of_the_antenna_at_the_true_time(delay):
    # Velocity times the clock's offset leaves a t^2 / 2, which is 0.1 um at 0.2 ms.
    one = receiver(clock=CLOCK, lever_arm=LEVER.tolist(), delay=delay)
    made = make(one, sky=NO_AIR, segments=DRIVE)
    start = START_NS + round(delay * 1e9)
    columns = made.observations("rover")
    late = columns.valid_time_ns > start
    made.rows[channels.GNSS_OBS.at(receiver="rover")] = columns.take(late)
    left = code_remainders(made, "rover", "vehicle", delay)
    # Turning, the antenna moves about the unit by some mm in that time.
    assert np.median(np.abs(left)) < UM
    assert np.abs(left).max() < 200 * UM


def test_without_an_arm_the_moving_code_is_exact():
    made = make(receiver(clock=CLOCK), sky=NO_AIR, segments=DRIVE)
    assert np.abs(code_remainders(made, "rover", "vehicle", lever=np.zeros(3))).max() < UM


def test_the_carrier_is_the_code_and_whole_cycles():
    made = make(base(), sky=NO_AIR)
    columns = made.observations("base")
    told = {(a[1], a[2]): a[5] for a in made.arcs}
    for satellite, signal in signals_of(columns):
        one = series(columns, satellite, signal)
        wavelength = C / FREQUENCY[satellite[0] + signal]
        code = one["pseudorange_m"] - C * group_delay(message(made, satellite), signal)
        cycles = one["carrier_phase_cycles"] - code / wavelength
        np.testing.assert_allclose(cycles, told[satellite, signal], atol=1e-6)


def test_the_ionosphere_delays_the_code_as_it_advances_the_carrier():
    made = make(base(), sky={"ionosphere": {"residual": "1 m", "gradient": "2 ppm"}})
    clear = make(base(), sky={"ionosphere": {"enabled": False}})
    a, b = made.observations("base"), clear.observations("base")
    seen = 0
    for satellite, signal in signals_of(a):
        wavelength = C / FREQUENCY[satellite[0] + signal]
        one, other = series(a, satellite, signal), series(b, satellite, signal)
        delay = one["pseudorange_m"] - other["pseudorange_m"]
        advance = wavelength * (one["carrier_phase_cycles"] - other["carrier_phase_cycles"])
        np.testing.assert_allclose(delay, -advance, atol=UM)
        if signal == "2W":
            first = series(a, satellite, "1C"), series(b, satellite, "1C")
            on_l1 = first[0]["pseudorange_m"] - first[1]["pseudorange_m"]
            np.testing.assert_allclose(delay, on_l1 * (77 / 60) ** 2, atol=UM)
            seen += 1
        assert delay.min() > 1.0
    assert seen > 5


def test_two_receivers_of_one_place_see_one_sky():
    """Errors of orbits, clocks, air are common: double differences are whole cycles."""
    sky = {"errors": {"orbit": "2 m", "clock": "1 m"}, "ionosphere": {"residual": "1 m"}}
    made = make(base("a"), base("b"), sky=sky)
    a, b = made.observations("a"), made.observations("b")
    for signal in FREQUENCY:
        names = [s for s, code in signals_of(a) if s[0] + code == signal]
        single = [
            series(a, s, signal[1:])["carrier_phase_cycles"]
            - series(b, s, signal[1:])["carrier_phase_cycles"]
            for s in names
        ]
        for other in single[1:]:
            double = other - single[0]
            np.testing.assert_allclose(double, np.round(double[0]), atol=1e-6)


def test_doppler_is_the_falling_phase():
    one = base(rate=10.0, clock={"bias": "-0.1 ms", "drift": "1 ppm"})
    rolling = receiver(rate=10.0, clock={"drift": "-1 ppm"}, lever_arm=[0.0, 0.0, -2.0])
    sky = {
        "errors": {"clock": "1 m", "clock_tau": "100 s"},
        "shapiro": True,
        "ionosphere": {"residual": "0.5 m", "tau": "600 s"},
        "troposphere": {"wet": "5 cm"},
    }
    made = make(one, rolling, sky=sky, segments=DRIVE)
    for name, limit_hz in (("base", 1e-4), ("rover", 2e-2)):
        columns = made.observations(name)
        for satellite, signal in signals_of(columns):
            s = series(columns, satellite, signal)
            phase, doppler = s["carrier_phase_cycles"], s["doppler_hz"]
            # Fourth order: a turning car's phase is not a parabola over 0.2 s.
            slope = (8.0 * (phase[3:-1] - phase[1:-3]) - (phase[4:] - phase[:-4])) / 1.2
            assert np.abs(doppler[2:-2] + slope).max() < limit_hz, (name, satellite, signal)


def test_broadcast_and_true_orbits_differ_by_what_was_asked():
    whole = {"systems": "GEC", **NO_AIR}
    clean = make(base(), sky=whole)
    off = make(base(), sky={**whole, "errors": {"orbit": "2 m", "clock": "0 m"}})
    nav = (m.rows[channels.NAV.topic] for m in (clean, off))
    first, second = nav
    np.testing.assert_array_equal(first["m0"], second["m0"])
    a, b = clean.observations("base"), off.observations("base")
    shift = []
    for satellite, signal in signals_of(a):
        if signal in ("1C", "2I"):
            change = (
                series(b, satellite, signal)["pseudorange_m"]
                - series(a, satellite, signal)["pseudorange_m"]
            )
            assert np.ptp(change) < 0.05  # 30 s
            shift.append(change[0])
    # Radial errors show fully and are a third of 2 m; the others by up to the sine of 13 deg.
    assert len(shift) > 20
    assert 0.3 < np.std(shift) < 1.2


def test_a_jumping_clock_stays_within_half_a_millisecond():
    clock = {"bias": "0.45 ms", "drift": "10 ppm", "jumps": True, "reported": True}
    made = make(base(clock=clock), sky=NO_AIR)
    offsets = made.epochs("base")["clock_offset_s"]
    assert np.abs(offsets).max() <= 0.5e-3
    assert np.count_nonzero(np.diff(offsets) < -0.9e-3) == 1
    assert np.abs(code_remainders(made, "base", "static")).max() < UM


def test_epochs_count_their_satellites():
    made = make(base(gaps=[[10.0, 15.0]]), sky=NO_AIR)
    epochs, columns = made.epochs("base"), made.observations("base")
    elapsed = (epochs.valid_time_ns - START_NS) // 10**9
    assert elapsed.tolist() == [*range(1, 10), *range(15, 31)]
    for time_ns, count in zip(epochs.valid_time_ns, epochs["satellite_count"], strict=True):
        assert len(set(columns["satellite"][columns.valid_time_ns == time_ns].tolist())) == count


def test_rows_stand_by_time_satellite_and_signal():
    columns = make(base(), sky=NO_AIR).observations("base")
    keys = list(
        zip(
            columns.valid_time_ns.tolist(),
            columns["satellite"].tolist(),
            columns["signal"].tolist(),
            strict=True,
        )
    )
    assert keys == sorted(keys)
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize(
    ("keys", "what"),
    [
        ({"receivers": [base(signals=["R1C"])]}, "R1C"),
        ({"receivers": [base(signals=["G9C"])]}, "G9C"),
        ({"receivers": [base(signals=["R3I"])], "sky": {"systems": "R"}}, "R3I"),
        ({"receivers": [receiver(kind="ship")]}, "ship"),
        ({"receivers": [receiver(kind="static")]}, "position"),
        ({"receivers": [receiver(), receiver()]}, "two"),
        ({"receivers": [receiver(noise={"code": -1.0})]}, "noise.code"),
        ({"receivers": [receiver(nois={})]}, "nois"),
        ({"receivers": [receiver()], "sky": {"systems": "GS"}}, "S"),
        ({"receivers": [receiver()], "blockage": [{"kind": "fog", "begin": 0, "end": 1}]}, "fog"),
        (
            {"receivers": [receiver()], "blockage": [{"kind": "roof", "begin": 2, "end": 1}]},
            "before",
        ),
        (
            {
                "receivers": [receiver()],
                "slips": [{"receiver": "x", "satellite": "G01", "time": 1.0, "cycles": 1}],
            },
            "'x'",
        ),
        ({"receivers": [], "sky": {"systems": "G"}}, "sky"),
        ({"receivers": [receiver(clock={"drift": 0.1})]}, "drifts"),
    ],
)
def test_what_is_off_is_named(keys, what):
    receivers = keys.pop("receivers")
    with pytest.raises(ConfigurationError) as caught:
        make(*receivers, **keys)
    assert what in str(caught.value.what) + str(caught.value.mend)


def test_no_satellite_that_rises_is_overlooked():
    """Epochs that are passed over, because nothing can rise so fast, are truly below the mask."""
    start = np.array(ecef_of(0.53, 1.99, 25.0))
    seconds = np.arange(0.0, 4 * 3600.0, 20.0)
    speed = np.array([-150.0, 80.0, 200.0])
    places = start + seconds[:, None] * speed * np.cos(seconds / 3000.0)[:, None]
    velocities = np.gradient(places, seconds, axis=0)
    air = air_record(Ionosphere(enabled=False), Troposphere(enabled=False), False, start, 1)
    nodes = np.zeros((3, 100))
    times = START_NS + (seconds * 1e9).astype(np.int64)
    offsets = np.zeros(len(times))
    mask = np.radians(12.0)
    rises = 0
    for system in "GRECJ":
        for record in constellation(system, 5, START_NS)[::2]:
            orbit = np.array([refer(record, START_NS)])
            whole, single = (np.zeros(len(times), dtype=SIGHT_DTYPE) for _ in range(2))
            arguments = (orbit, air, nodes, nodes[0], np.inf)

            def look(rows, out, arguments=arguments):
                see(
                    *arguments, times[rows], offsets[rows], START_NS, places[rows],
                    velocities[rows], mask, np.sin(mask), out[rows],
                )  # fmt: skip

            look(slice(None), whole)
            for row in range(len(times)):
                look(slice(row, row + 1), single)
            np.testing.assert_array_equal(whole["seen"], single["seen"])
            rises += np.count_nonzero(np.diff(whole["seen"]) > 0)
    assert rises > 10
