"""The terms that are told of each measurement add up to it, and each is what it says."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from scipy import stats

from replay import channels
from replay.gnss.signals import GLONASS_FDMA_HZ
from tests.simulate.observing import (
    DRIVE,
    FREQUENCY,
    NO_AIR,
    C,
    base,
    make,
    message,
    receiver,
    signals_of,
    travel_and_clock,
)

MM = 1e-3
WITH_TERMS = {"rate": 10.0, "signals": True}
SIGNALS = ["G1C", "G2W", "R1C", "R2P", "E1C", "E7Q", "C2I", "C6I"]
ERRORS = {
    "noise": {"code": 0.5, "carrier": 0.003, "rate": 0.05, "code_bias": 2.0},
    "multipath": {"code": 0.4, "carrier": 0.004, "tau": 10.0},
    "clock": {"bias": "0.2 ms", "drift": "0.3 ppm", "walk": 1e-10, "reported": True},
    "tracking": {"slips_per_hour": 200.0},
    "latency": 0.1,
}
SKY = {
    "systems": "GREC",
    "shapiro": True,
    "errors": {"orbit": "2 m", "clock": "1 m"},
    "ionosphere": {
        "residual": "1 m",
        "gradient": "2 ppm",
        "slope_east": "-3 ppm",
        "wave": {"amplitude": "0.3 m", "direction": "40 deg"},
        "front": {"height": "2 m", "speed": 300.0},
    },
    "troposphere": {
        "wet": "5 cm",
        "local_wet": "1 cm",
        "gradient_north": "1 mm",
        "wet_slope_east": "0.5 ppm",
        "field": {"sigma": "1 cm"},
    },
}
TREES = [
    {"kind": "trees", "begin": 8.0, "end": 20.0, "left": "70 deg", "right": "70 deg"},
    {"kind": "canyon", "begin": 20.0, "end": 30.0, "left": "50 deg", "reflected": 0.7},
]


@functools.cache
def whole():
    """A drive with every error that there is."""
    one = receiver(**{**ERRORS, "signals": SIGNALS}, strength={"zenith": 47.0})
    return make(one, sky=SKY, segments=DRIVE, truth=WITH_TERMS, blockage=TREES)


def frequencies(made):
    """Carrier of each observation, Hz."""
    columns = made.observations("rover")
    found = []
    for satellite, signal, channel in zip(
        columns["satellite"], columns["signal"], columns["glonass_channel"], strict=True
    ):
        if satellite[:1] == b"R":
            zero, step = GLONASS_FDMA_HZ[int(signal[:1])]
            found.append(zero + int(channel) * step)
        else:
            found.append(FREQUENCY[(satellite[:1] + signal).decode()])
    return np.array(found)


def test_the_terms_add_up_to_code_and_carrier():
    made = whole()
    seen, truth = made.observations("rover"), made.rows[channels.SIGNAL_TRUTH.at(receiver="rover")]
    np.testing.assert_array_equal(seen.valid_time_ns, truth.valid_time_ns)
    np.testing.assert_array_equal(seen.log_time_ns, truth.log_time_ns)
    for name in ("satellite", "signal"):
        np.testing.assert_array_equal(seen[name], truth[name])
    common = (
        truth["range_m"] - truth["satellite_clock_m"] + truth["receiver_clock_m"]
        + truth["troposphere_m"] + truth["shapiro_m"]
    )  # fmt: skip
    code = common + truth["ionosphere_m"] + truth["code_delay_m"]
    code += truth["code_multipath_m"] + truth["code_noise_m"]
    assert np.abs(code - seen["pseudorange_m"]).max() < 0.1 * MM
    carrier = seen.is_present("carrier_phase_cycles")
    wavelength = C / frequencies(made)
    phase = common - truth["ionosphere_m"] + truth["carrier_multipath_m"]
    phase += truth["carrier_noise_m"] + wavelength * truth["ambiguity_cycles"]
    left = (phase - wavelength * seen["carrier_phase_cycles"])[carrier]
    assert np.abs(left).max() < 0.1 * MM
    # None of the terms is idle, and some rows have no carrier.
    for name in truth.values:
        if name not in ("satellite", "signal"):
            assert np.any(truth[name] != 0.0), name
    assert 20 < np.count_nonzero(~carrier) < len(seen) / 2
    assert np.isnan(truth["carrier_noise_m"][~carrier]).all()
    assert {s[:1] for s in truth["satellite"].tolist()} == {b"G", b"R", b"E", b"C"}


def test_slips_are_steps_of_the_ambiguity():
    made = whole()
    truth = made.rows[channels.SIGNAL_TRUTH.at(receiver="rover")]
    for slip in made.slips:
        own = (truth["satellite"] == slip["satellite"].encode()) & (
            truth["signal"] == slip["signal"].encode()
        )
        row = int(np.searchsorted(truth.valid_time_ns[own], slip["time_ns"]))
        cycles = truth["ambiguity_cycles"][own]
        assert cycles[row] - cycles[row - 1] == slip["cycles"]
    assert len(made.slips) > 5


def test_the_ionosphere_goes_with_the_inverse_square_of_the_frequency():
    made = whole()
    truth = made.rows[channels.SIGNAL_TRUTH.at(receiver="rover")]
    on_l1 = truth["ionosphere_m"] * (frequencies(made) / 1575.42e6) ** 2
    keys = list(zip(truth.valid_time_ns.tolist(), truth["satellite"].tolist(), strict=True))
    first = dict(zip(reversed(keys), on_l1[::-1], strict=True))
    np.testing.assert_allclose([first[key] for key in keys], on_l1, rtol=1e-12)


def test_the_orbit_error_is_that_against_the_message():
    sky = {"errors": {"orbit": "2 m", "clock": "1 m"}, **NO_AIR}
    clock = {"bias": "0.3 ms", "reported": True}
    made = make(base(clock=clock), sky=sky, truth=WITH_TERMS)
    truth = made.rows[channels.SIGNAL_TRUTH.at(receiver="base")]
    place = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    for row in range(0, len(truth), 61):
        m = message(made, truth["satellite"][row].decode())
        travel, sent = travel_and_clock(m, place, int(truth.valid_time_ns[row]), -0.3e-3)
        broadcast = C * (travel - sent)
        true = truth["range_m"][row] - truth["satellite_clock_m"][row]
        assert truth["orbit_error_m"][row] == pytest.approx(true - broadcast, abs=1e-5)
    assert 0.3 < np.std(truth["orbit_error_m"]) < 3.0


def test_they_are_written_only_when_asked_for():
    assert channels.SIGNAL_TRUTH.at(receiver="base") not in make(base(), sky=NO_AIR).rows


def test_multipath_has_the_deviation_of_the_scenario_and_is_each_signals_own():
    """Against the closed form of the filter's correlation, over many satellites."""
    cutoff, seconds = 0.02, 600.0
    path = {"filter": "butterworth", "code": 0.4, "carrier": 0.003, "cutoff": cutoff}
    made = make(
        base(multipath=path, signals=["G1C", "G2W", "E1C", "E7Q", "C2I", "C6I"]),
        sky=NO_AIR, truth=WITH_TERMS, imu={"rate": 10.0},
        segments=[{"kind": "hold", "duration": seconds}],
    )  # fmt: skip
    truth, seen = (
        made.rows[channels.SIGNAL_TRUTH.at(receiver="base")],
        made.observations("base"),
    )
    sine = (seen["cn0_dbhz"] - 38.0) / 12.0
    series = {}
    for satellite, signal in signals_of(seen):
        own = (seen["satellite"] == satellite.encode()) & (seen["signal"] == signal.encode())
        if np.count_nonzero(own) < seconds - 3:
            continue
        for kind, sigma in (("code", 0.4), ("carrier", 0.003)):
            unit = truth[f"{kind}_multipath_m"][own] * sine[own] / sigma
            series[satellite, signal, kind] = unit[-590:]
    units = np.array(list(series.values()))
    assert len(units) > 60
    # Bilinear Butterworth: r(k) = (1 + p) / 2 p^(k - 1).
    pole = (1.0 - math.tan(math.pi * cutoff)) / (1.0 + math.tan(math.pi * cutoff))
    ahead = 0.5 * (1.0 + pole)
    squares = 1.0 + 2.0 * ahead**2 / (1.0 - pole**2)  # sum of r(k)^2
    variance = np.mean(units**2)
    spread = math.sqrt(2.0 * squares / units.size)
    assert abs(variance - 1.0) < 4.0 * spread
    assert spread < 0.05
    lagged = np.mean(units[:, 1:] * units[:, :-1]) / variance
    assert lagged == pytest.approx(ahead, abs=0.01)
    # Two series of their own: the mean product has the deviation sqrt(sum r^2 / n).
    products = (units @ units.T / units.shape[1])[np.triu_indices(len(units), 1)]
    alone = products / math.sqrt(squares / units.shape[1])
    assert np.std(alone) == pytest.approx(1.0, abs=0.1)
    assert np.abs(alone).max() < stats.norm.isf(1e-4 / len(alone)) * 1.2
