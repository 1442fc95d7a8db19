"""Precise products of a simulated sky, and what else a phase to the millimetre is made of."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import pytest

from replay import channels, time
from replay.errors import ConfigurationError
from replay.gnss.measurements import SATELLITE_NAMES
from replay.gnss.products import (
    bias_series,
    clock_series,
    interpolation_record,
    orbit_series,
    rotation_records,
)
from replay.kernels.earth import enu_axes
from replay.kernels.gnss_records import SATELLITES
from replay.kernels.precise_orbits import FOUND, WORK_SHAPE, precise_transmission
from replay.kernels.product_series import earth_rotation, observation_number, signal_bias
from replay.kernels.satellite_attitude import NOMINAL, satellite_axes
from replay.kernels.sun_moon import sun_moon_ecef
from replay.kernels.tides import pole_tide, secular_pole, solid_tide
from replay.kernels.trajectory import antenna_fixes
from replay.kernels.wind_up import level_antenna, new_state, wind_up
from replay.log.columns import Columns
from replay.simulate import read_scenario
from replay.simulate.motion import move
from tests.simulate.observing import (
    DRIVE,
    FREQUENCY,
    HERE,
    NO_AIR,
    START,
    START_NS,
    C,
    Made,
    base,
    make,
    receiver,
    series,
    turn_z,
)

MM = 1e-3
RATE = 7.292115e-5
NUMBER = {name.decode(): number for number, name in enumerate(SATELLITE_NAMES)}
SIGNALS = ["G1C", "G2W", "E1C", "E7Q"]
WITH_TERMS = {"rate": 10.0, "signals": True}
BIASES = {"code": "1 m", "carrier": 0.3}
EARTH = {"shapiro": True, "wind_up": True, "tides": True, "pole": ["0.3 arcsec", "-0.2 arcsec"]}
SKY = {"systems": "GE", "errors": {"orbit": "2 m", "clock": "1 m"}, "biases": BIASES, **EARTH}
ROVER: dict[str, Any] = {
    "signals": SIGNALS,
    "lever_arm": [-0.4, 0.15, -1.2],
    "clock": {"bias": "0.1 ms", "drift": "0.2 ppm", "walk": 1e-10},
    "noise": {"code_bias": 2.0, "carrier_bias": 0.4},
}
RECEIVERS = (receiver(**ROVER), base(signals=SIGNALS))


@functools.cache
def made(orbit_interval: float = 900.0, **errors: float) -> Made:
    """A drive and a pillar without noise; products with the errors that are given."""
    products = {"phase_biases": True, "orbit_interval": orbit_interval, **errors}
    return make(*RECEIVERS, sky=SKY, segments=DRIVE, truth=WITH_TERMS, products=products)


class Satellites:
    """Products as a user of them has them."""

    def __init__(self, one: Made) -> None:
        self.orbits = orbit_series(one.rows[channels.PRECISE_ORBIT.topic])
        self.clocks = clock_series(one.rows[channels.PRECISE_CLOCK.topic])
        self.biases = bias_series(one.rows[channels.SIGNAL_BIAS.topic])
        self.config = interpolation_record()[0]
        self.work = np.empty(WORK_SHAPE)

    def sent(self, number: int, time_ns: int, code_m: float) -> tuple[np.ndarray, float]:
        """State at transmission and the whole clock, s."""
        state = np.empty(8)
        status, effect = precise_transmission(
            self.orbits.rows, self.orbits.starts, self.clocks.rows, self.clocks.starts, number,
            time_ns, code_m, self.config, state, self.work,
        )  # fmt: skip
        assert status == FOUND
        return state, float(state[6]) + effect

    def bias_m(self, number: int, observation: str) -> float:
        """Bias of an observation, m."""
        first, end = self.biases.starts[number : number + 2]
        name = observation_number(*observation.encode())
        return C * float(signal_bias(self.biases.rows, first, end, name, 0, START_NS))


def signal_truth(one: Made, name: str) -> Columns:
    return one.rows[channels.SIGNAL_TRUTH.at(receiver=name)]


def wavelengths(columns: Columns) -> np.ndarray:
    pairs = zip(columns["satellite"].tolist(), columns["signal"].tolist(), strict=True)
    return np.array([C / FREQUENCY[(a[:1] + b).decode()] for a, b in pairs])


def places(one: Made) -> dict[str, np.ndarray]:
    """Where antennas are at whole seconds of their clocks, ground at rest."""
    table = {
        "seed": 4, "start": {"time": START, **HERE, "heading": "20 deg"},
        "gnss": {"fixes": False}, "receivers": list(RECEIVERS), "segments": DRIVE,
        "sky": SKY,
    }  # fmt: skip
    trajectory = move(read_scenario(table)).trajectory
    truth = signal_truth(one, "rover")
    epochs, first = np.unique(truth.valid_time_ns, return_index=True)
    clock = truth["receiver_clock_m"][first] / C
    poses = trajectory.poses((epochs - START_NS) / time.NS_PER_S - clock)
    found, velocities, none = (np.zeros((len(epochs), 3)) for _ in range(3))
    antenna_fixes(poses, np.array(ROVER["lever_arm"]), none, none, found, velocities)
    still = one.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    return {"rover": found, "base": np.tile(still, (len(epochs), 1))}


def ranges_to(
    place: np.ndarray, states: list[np.ndarray], travel_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distances and unit vectors from the satellites to a place, ECEF at reception."""
    turned = np.array(
        [turn_z(RATE * t) @ s[:3] for s, t in zip(states, travel_s.tolist(), strict=True)]
    )
    line = place - turned
    distance = np.linalg.norm(line, axis=1)
    return distance, line / distance[:, None]


@pytest.mark.parametrize("orbit_interval", [300.0, 900.0])
def test_products_give_back_the_satellite_to_a_millimetre(orbit_interval):
    one = made(orbit_interval)
    known = Satellites(one)
    seen, truth = one.observations("base"), signal_truth(one, "base")
    place = one.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    worst = 0.0
    for row in range(0, len(seen), 7):
        number = NUMBER[seen["satellite"][row].decode()]
        at = int(seen.valid_time_ns[row])
        state, clock = known.sent(number, at, float(seen["pseudorange_m"][row]))
        travel = float(truth["range_m"][row]) / C
        distance, _ = ranges_to(place, [state], np.array([travel]))
        off = (distance[0] - C * clock) - (truth["range_m"][row] - truth["satellite_clock_m"][row])
        worst = max(worst, abs(float(off)))
        assert C * clock == pytest.approx(truth["satellite_clock_m"][row], abs=0.1 * MM)
    assert worst < MM


def test_errors_of_products_have_their_size_and_are_smooth():
    sigma = 0.05
    exact, off = made(300.0), made(300.0, orbit_error=sigma, clock_error=sigma, clock_noise=0.01)
    topic = channels.PRECISE_ORBIT.topic
    error = off.rows[topic]["position_ecef_m"] - exact.rows[topic]["position_ecef_m"]
    count = len(np.unique(off.rows[topic]["satellite"]))
    by_satellite = error.reshape(-1, count, 3)
    # About 55 satellites, three axes, some three independent values in five hours each.
    assert np.sqrt(np.mean(by_satellite**2)) == pytest.approx(sigma, rel=0.15)
    # Waves of 12, 6 and 4 hours that share the variance, looked at every five minutes.
    chords = [2.0 * math.sin(math.pi / 12.0 / hours) for hours in (12.0, 6.0, 4.0)]
    step = sigma * math.sqrt(sum(chord * chord for chord in chords) / 3.0)
    assert np.sqrt(np.mean(np.diff(by_satellite, axis=0) ** 2)) == pytest.approx(step, rel=0.15)
    assert np.all(off.rows[topic]["position_std_ecef_m"] == sigma)
    assert not exact.rows[topic].is_present("position_std_ecef_m").any()
    topic = channels.PRECISE_CLOCK.topic
    clock = C * (off.rows[topic]["clock_s"] - exact.rows[topic]["clock_s"]).reshape(-1, count)
    assert np.sqrt(np.mean(clock**2)) == pytest.approx(math.hypot(sigma, 0.01), rel=0.15)
    # Second differences of what is smooth are nothing: white noise is left, times sqrt(6).
    white = np.std(np.diff(clock, 2, axis=0)) / math.sqrt(6.0)
    assert white == pytest.approx(0.01, rel=0.1)


def test_terms_add_up_to_code_and_phase():
    one = made()
    for name in ("rover", "base"):
        seen, truth = one.observations(name), signal_truth(one, name)
        common = (
            truth["range_m"] - truth["satellite_clock_m"] + truth["receiver_clock_m"]
            + truth["troposphere_m"] + truth["shapiro_m"] + truth["solid_tide_m"]
            + truth["pole_tide_m"]
        )  # fmt: skip
        code = common + truth["ionosphere_m"] + truth["code_delay_m"]
        assert np.abs(code - seen["pseudorange_m"]).max() < 1e-6
        carrier = seen.is_present("carrier_phase_cycles")
        wavelength = wavelengths(seen)
        phase = common - truth["ionosphere_m"] + truth["wind_up_m"] + truth["carrier_delay_m"]
        phase += wavelength * truth["ambiguity_cycles"]
        left = (phase - wavelength * seen["carrier_phase_cycles"])[carrier]
        assert np.abs(left).max() < 1e-6
        for field in ("solid_tide_m", "pole_tide_m", "wind_up_m", "carrier_delay_m"):
            assert np.any(truth[field] != 0.0), field


def corrected(one: Made, name: str, kind: str) -> dict[int, list[tuple[Any, ...]]]:
    """By epoch: state at transmission, travel time, and the range that corrections leave."""
    known = Satellites(one)
    seen, truth = one.observations(name), signal_truth(one, name)
    wavelength = wavelengths(seen)
    found: dict[int, list[tuple[Any, ...]]] = {}
    for row in range(len(seen)):
        satellite, signal = seen["satellite"][row].decode(), seen["signal"][row].decode()
        number, at = NUMBER[satellite], int(seen.valid_time_ns[row])
        state, clock = known.sent(number, at, float(seen["pseudorange_m"][row]))
        away = sum(
            float(truth[field][row])
            for field in ("troposphere_m", "shapiro_m", "solid_tide_m", "pole_tide_m")
        )
        ionosphere = float(truth["ionosphere_m"][row])
        bias = known.bias_m(number, ("C" if kind == "code" else "L") + signal)
        if kind == "code":
            value = float(seen["pseudorange_m"][row]) - ionosphere
        else:
            cycles = seen["carrier_phase_cycles"][row] - truth["ambiguity_cycles"][row]
            value = float(wavelength[row] * cycles) + ionosphere - float(truth["wind_up_m"][row])
        value += C * clock - away - bias
        travel = float(truth["range_m"][row]) / C
        found.setdefault(at, []).append((signal, satellite[0], state, travel, value))
    return found


@pytest.mark.parametrize("kind", ["code", "carrier"])
@pytest.mark.parametrize("name", ["rover", "base"])
def test_products_and_terms_give_the_antenna_back(name, kind):
    """Least squares with a clock for each signal, which takes up the receiver's biases."""
    one = made()
    true = places(one)[name]
    epochs = corrected(one, name, kind)
    assert len(epochs) == len(true)
    for epoch, place in list(zip(sorted(epochs), true, strict=True))[::5]:
        rows = epochs[epoch]
        keys = sorted({(signal, system) for signal, system, *_ in rows})
        states, travel = [row[2] for row in rows], np.array([row[3] for row in rows])
        value = np.array([row[4] for row in rows])
        x = place + [40.0, -30.0, 20.0]
        for _ in range(4):
            distance, unit = ranges_to(x, states, travel)
            clocks = np.array([[float(row[:2] == key) for key in keys] for row in rows])
            step, *_ = np.linalg.lstsq(np.hstack([unit, clocks]), value - distance, rcond=None)
            x = x + step[:3]
        assert np.abs(x - place).max() < MM


def test_tides_are_those_of_the_conventions_and_move_the_ground_alone():
    one = made()
    truth = signal_truth(one, "base")
    place = one.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    rotation = np.zeros(4)
    rows = rotation_records(one.rows[channels.EARTH_ROTATION.topic])
    arcsec = math.radians(1.0 / 3600.0)
    without = make(
        *RECEIVERS, sky={**SKY, "tides": False}, segments=DRIVE, truth=WITH_TERMS
    )  # fmt: skip
    other = signal_truth(without, "base")
    axes = np.zeros((3, 3))
    enu_axes(*place, axes)
    up = []
    for row in range(0, len(truth), 11):
        at = int(truth.valid_time_ns[row])
        assert earth_rotation(rows, at, 0.0, rotation)
        ut1 = float(rotation[2]) - time.leap_seconds(at)
        solid, polar = np.zeros(3), np.zeros(3)
        solid_tide(place, at, ut1, solid)
        xs, ys = secular_pole(at)
        pole_tide(place, rotation[0] / arcsec - xs, ys - rotation[1] / arcsec, polar)
        # What moves by the displacement changes the range by it: no formula is shared.
        moved = truth["solid_tide_m"][row] + truth["pole_tide_m"][row]
        changed = truth["range_m"][row] + moved - other["range_m"][row]
        assert changed == pytest.approx(moved, abs=0.01 * MM)
        up.append(float(axes[2] @ solid))
        assert abs(moved) <= np.linalg.norm(solid) + np.linalg.norm(polar)
    np.testing.assert_array_equal(truth.valid_time_ns, other.valid_time_ns)
    assert np.abs(up).max() > 5.0 * MM
    assert rotation[0] / arcsec - secular_pole(START_NS)[0] == pytest.approx(0.3, abs=1e-6)


def test_wind_up_is_that_of_the_formula_along_the_drive():
    """A level antenna on a level road: the heading says it all."""
    sky = {"systems": "G", "wind_up": True, **NO_AIR}
    one = make(receiver(signals=["G1C"]), sky=sky, segments=DRIVE, truth=WITH_TERMS)
    still = make(receiver(signals=["G1C"]), sky=sky, truth=WITH_TERMS)
    truth = signal_truth(one, "rover")
    motion = one.rows[channels.TRUTH.topic]
    products = make(receiver(signals=["G1C"]), sky=sky, segments=DRIVE, products={})
    known = Satellites(products)
    seen = products.observations("rover")
    state, axes, antenna, body = new_state(SATELLITES), *(np.zeros((3, 3)) for _ in range(3))
    sun, moon = np.zeros(3), np.zeros(3)
    wavelength = C / FREQUENCY["G1C"]
    for row in range(len(truth)):
        at = int(truth.valid_time_ns[row])
        k = int(np.searchsorted(motion.valid_time_ns, at))
        if k == len(motion):
            continue
        place, heading = motion["position_ecef_m"][k], motion["attitude_rad"][k, 2]
        enu_axes(*place, axes)
        level_antenna(axes, float(heading), antenna)
        number = NUMBER[truth["satellite"][row].decode()]
        sent, _ = known.sent(number, at, float(seen["pseudorange_m"][row]))
        spun = turn_z(RATE * float(truth["range_m"][row]) / C)
        r, v = spun @ sent[:3], spun @ sent[3:6]
        sun_moon_ecef(at, -float(time.leap_seconds(at)), sun, moon)
        satellite_axes(NOMINAL, r, v, sun, body)
        unit = (place - r) / np.linalg.norm(place - r)
        cycles = wind_up(body, antenna, *unit, state, number)
        assert truth["wind_up_m"][row] / wavelength == pytest.approx(cycles, abs=2e-5)
    # A quarter of a turn to the right is a quarter of a cycle for every satellite.
    satellite = truth["satellite"][0]
    own = truth["satellite"] == satellite
    turned = (truth["wind_up_m"][own][-1] - truth["wind_up_m"][own][0]) / wavelength
    unmoved = signal_truth(still, "rover")
    same = unmoved["satellite"] == satellite
    drift = (unmoved["wind_up_m"][same][-1] - unmoved["wind_up_m"][same][0]) / wavelength
    assert abs(turned - drift) == pytest.approx(0.25, abs=0.03)


def test_doppler_has_the_rate_of_the_wind_up():
    sky = {"systems": "G", "wind_up": True, **NO_AIR}
    one, plain = (
        make(receiver(signals=["G1C"], rate=10.0), sky=one, segments=DRIVE, truth=WITH_TERMS)
        for one in (sky, {**sky, "wind_up": False})
    )
    satellite = one.observations("rover")["satellite"][0].decode()
    with_it, without = (series(m.observations("rover"), satellite, "1C") for m in (one, plain))
    added = with_it["doppler_hz"] - without["doppler_hz"]
    phase = with_it["carrier_phase_cycles"] - without["carrier_phase_cycles"]
    # Simpson's rule for the phase that a Doppler makes in 0.2 s.
    integral = -0.2 / 6.0 * (added[:-2] + 4.0 * added[1:-1] + added[2:])
    grown = phase[2:] - phase[:-2]
    assert np.abs(integral - grown).max() < 0.002 * np.abs(grown).max()
    assert np.abs(grown).max() > 0.2 * 0.02


def test_biases_are_of_each_signal_and_told():
    one = made()
    known, truth = Satellites(one), signal_truth(one, "base")
    codes, phases = set(), set()
    for row in range(0, len(truth), 3):
        name = truth["satellite"][row].decode()
        signal = truth["signal"][row].decode()
        code, phase = (known.bias_m(NUMBER[name], kind + signal) for kind in "CL")
        # The base has no biases of its own.
        assert truth["code_delay_m"][row] == pytest.approx(code, abs=1e-9)
        assert truth["carrier_delay_m"][row] == pytest.approx(phase, abs=1e-9)
        codes.add(code)
        phases.add(phase)
    assert len(codes) == len(phases) > 20
    nav = one.rows[channels.NAV.topic]
    told = zip(nav["satellite"].tolist(), nav["group_delay_1_s"].tolist(), strict=True)
    beyond = [
        known.bias_m(NUMBER[name.decode()], "C1C") - C * delay
        for name, delay in told
        if name[:1] == b"G"
    ]
    assert 0.6 < np.std(beyond) < 1.4


def test_all_rows_are_known_from_the_start_and_reach_far_enough():
    one = made()
    end_ns = int(one.rows[channels.TRUTH.topic].valid_time_ns[-1])
    kinds = (
        channels.PRECISE_ORBIT, channels.PRECISE_CLOCK, channels.SIGNAL_BIAS,
        channels.EARTH_ROTATION, channels.PRODUCTS,
    )  # fmt: skip
    for kind in kinds:
        assert np.all(one.rows[kind.topic].log_time_ns == START_NS)
    orbit = one.rows[channels.PRECISE_ORBIT.topic].valid_time_ns
    around = 5 * 900 * time.NS_PER_S  # half of the points of degree ten
    assert orbit[0] <= START_NS - around
    assert orbit[-1] >= end_ns + around
    told = one.rows[channels.PRODUCTS.topic]
    named = dict(zip(told.ragged("source").texts(), told["row_count"].tolist(), strict=True))
    assert named["simulated orbit"] == len(orbit)
    assert named["simulated biases"] == len(one.rows[channels.SIGNAL_BIAS.topic])


def test_products_change_no_observation():
    with_, without = (
        make(base(signals=SIGNALS), sky={"systems": "GE"}, **keys)
        for keys in ({"products": {}}, {})
    )
    for topic in (channels.GNSS_OBS.at(receiver="base"), channels.NAV.topic, channels.IMU.topic):
        plain, beside = without.rows[topic], with_.rows[topic]
        assert plain.values.keys() == beside.values.keys()
        for name in plain.values:
            np.testing.assert_array_equal(plain[name], beside[name])


def test_products_of_a_real_sky_are_refused():
    table = {
        "segments": [{"kind": "hold", "duration": 5.0}],
        "receivers": [base()],
        "sky": {"navigation": "nav.mcap"},
        "products": {},
    }
    with pytest.raises(ConfigurationError, match="real sky"):
        read_scenario(table)


def test_a_product_without_an_interval_is_refused():
    table = {
        "segments": [{"kind": "hold", "duration": 5.0}],
        "receivers": [base()],
        "products": {"clock_interval": 0.0},
    }
    with pytest.raises(ConfigurationError, match="interval"):
        read_scenario(table)
