"""Antennas of simulated receivers: in the measurements, in the truth, in the calibrations."""

from __future__ import annotations

import functools
import tomllib

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from replay import channels
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.errors import ConfigurationError
from replay.log.reader import LogReader
from replay.schemas import solution_pb2
from replay.simulate import read_scenario, write_log
from tests.simulate.observing import (
    DRIVE,
    FREQUENCY,
    HERE,
    NO_AIR,
    START,
    WGS84_RATE,
    C,
    base,
    make,
    message,
    orbit,
    receiver,
    travel_and_clock,
    turn_z,
)
from tests.simulate.test_signal_truth import (
    ERRORS,
    SIGNALS,
    SKY,
    TREES,
    WITH_TERMS,
    frequencies,
)

MM = 1e-3
STEP = np.radians(10.0)
ZENITHS = STEP * np.arange(10)
FIRST = {"offset": [0.03, -0.02, 0.11], "variation": (0.004 * np.sin(2 * ZENITHS)).tolist()}
SECOND = {"offset": [-0.01, 0.015, 0.09], "variation": (-0.01 * ZENITHS**2).tolist()}
OTHER = {"offset": [0.0, 0.04, 0.2], "variation": (0.006 * ZENITHS).tolist()}
CENTRES = {"G01": FIRST, "G02": SECOND, "E01": OTHER}
STANDS_FOR = {
    "G1C": "G01", "G2W": "G02", "E1C": "E01", "E7Q": "G02", "C2I": "G01", "C6I": "G02",
}  # fmt: skip
LEANING = {"roll_per_g": "12 deg", "pitch_per_g": "-8 deg"}


def antenna(name="MODEL", centres=None, **keys):
    frequencies = [{"frequency": f, **own} for f, own in (centres or CENTRES).items()]
    return {"name": name, "step": float(STEP), "frequencies": frequencies, **keys}


def terms(made, name="rover"):
    return made.rows[channels.SIGNAL_TRUTH.at(receiver=name)]


@functools.cache
def driven(centres="all", rate=10.0):
    """A drive that leans into its turn, without noise."""
    given = CENTRES if centres == "all" else {"G01": {"offset": [0.1, -0.08, 0.12]}}
    one = receiver(rate=rate, **({"antenna": "MODEL"} if centres else {}))
    known = {"antennas": [antenna(centres=given)]} if centres else {}
    return make(one, segments=DRIVE, vehicle=LEANING, sky=NO_AIR, truth=WITH_TERMS, **known)


def direction(made, satellite, time_ns, place):
    """Unit vector to a satellite, ECEF, by the interface documents."""
    m = message(made, satellite)
    travel, _ = travel_and_clock(m, place, time_ns, 0.0)
    there = turn_z(WGS84_RATE * travel) @ orbit(m, (time_ns - m["toe_ns"]) / 1e9 - travel)[0]
    return (there - place) / np.linalg.norm(there - place)


def due(unit, right, forward, up, centre):
    """Pattern less the offset in the direction, in the antenna's axes."""
    n, e, u = centre["offset"]
    toward = np.array([forward @ unit, right @ unit, up @ unit])
    zenith = np.arccos(toward[2])
    return np.interp(zenith, ZENITHS, centre["variation"]) - toward @ [n, e, u]


def test_on_a_vehicle_the_antenna_leans_and_turns_with_the_body():
    made = driven()
    truth, motion = terms(made), made.rows[channels.TRUTH.topic]
    leaned, signals = 0.0, set()
    for row in range(0, len(truth), 37):
        at = int(np.searchsorted(motion.valid_time_ns, truth.valid_time_ns[row]))
        assert motion.valid_time_ns[at] == truth.valid_time_ns[row]
        place, (roll, pitch, heading) = motion["position_ecef_m"][at], motion["attitude_rad"][at]
        latitude, longitude, _ = pymap3d.ecef2geodetic(*place)
        body = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix().T  # rows, NED
        forward, right, down = (
            np.array(pymap3d.enu2uvw(e, n, -d, latitude, longitude)) for n, e, d in body
        )
        satellite, signal = truth["satellite"][row].decode(), truth["signal"][row].decode()
        unit = direction(made, satellite, int(truth.valid_time_ns[row]), place)
        centre = CENTRES[STANDS_FOR[satellite[0] + signal]]
        wanted = due(unit, right, forward, -down, centre)
        assert truth["antenna_m"][row] == pytest.approx(wanted, abs=1e-7)
        leaned = max(leaned, abs(roll), abs(pitch))
        signals.add(satellite[0] + signal)
    assert np.degrees(leaned) > 3.0
    assert signals == set(STANDS_FOR)


def test_on_a_pillar_its_mark_points_to_the_north():
    made = make(base(antenna="MODEL"), sky=NO_AIR, truth=WITH_TERMS, antennas=[antenna()])
    truth = terms(made, "base")
    place = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    latitude, longitude, height = pymap3d.ecef2geodetic(*place)
    assert height == pytest.approx(25.0, abs=1e-6)  # of the reference point, not the centre
    east, north, up = (np.array(pymap3d.enu2uvw(*axis, latitude, longitude)) for axis in np.eye(3))
    for row in range(0, len(truth), 53):
        satellite, signal = truth["satellite"][row].decode(), truth["signal"][row].decode()
        unit = direction(made, satellite, int(truth.valid_time_ns[row]), place)
        wanted = due(unit, east, north, up, CENTRES[STANDS_FOR[satellite[0] + signal]])
        assert truth["antenna_m"][row] == pytest.approx(wanted, abs=1e-7)


def test_code_and_phase_get_the_same_and_nothing_else_changes():
    worn, bare = driven(), driven(None)
    seen, plain, truth = worn.observations("rover"), bare.observations("rover"), terms(worn)
    np.testing.assert_array_equal(seen.valid_time_ns, plain.valid_time_ns)
    code = seen["pseudorange_m"] - plain["pseudorange_m"]
    np.testing.assert_allclose(code, truth["antenna_m"], atol=2e-8)
    length = C / np.array(
        [
            FREQUENCY[(a[:1] + b).decode()]
            for a, b in zip(seen["satellite"], seen["signal"], strict=True)
        ]
    )
    phase = length * (seen["carrier_phase_cycles"] - plain["carrier_phase_cycles"])
    np.testing.assert_allclose(phase, truth["antenna_m"], atol=2e-8)
    for name, column in terms(bare).values.items():
        np.testing.assert_array_equal(truth[name], column, err_msg=name)
    np.testing.assert_array_equal(seen["cn0_dbhz"], plain["cn0_dbhz"])
    assert worn.arcs == bare.arcs


def test_the_doppler_is_the_rate_of_what_the_antenna_adds():
    """Finite differences over 40 ms, in a turn and while the body leans."""
    worn, bare = driven("offset", 50.0), driven(None, 50.0)
    seen, plain, truth = worn.observations("rover"), bare.observations("rover"), terms(worn)
    own = (seen["signal"] == b"1C") & (seen["satellite"].astype("S1") == b"G")
    largest = 0.0
    for satellite in np.unique(seen["satellite"][own]):
        rows = np.flatnonzero(own & (seen["satellite"] == satellite))
        rate = -C / FREQUENCY["G1C"] * (seen["doppler_hz"] - plain["doppler_hz"])[rows]
        added, times = truth["antenna_m"][rows], truth.valid_time_ns[rows] * 1e-9
        assert np.ptp(np.diff(times)) < 1e-6
        slope = (added[2:] - added[:-2]) / 0.04
        largest = max(largest, np.abs(slope).max())
        np.testing.assert_allclose(rate[1:-1], slope, atol=0.05 * MM)
    assert largest > 20 * MM


def test_the_terms_add_up_with_an_antenna():
    """With every other error that there is."""
    one = receiver(**{**ERRORS, "signals": SIGNALS}, antenna="MODEL", strength={"zenith": 47.0})
    made = make(
        one, sky=SKY, segments=DRIVE, vehicle=LEANING, truth=WITH_TERMS, blockage=TREES,
        antennas=[antenna()],
    )  # fmt: skip
    seen, truth = made.observations("rover"), terms(made)
    common = (
        truth["range_m"] - truth["satellite_clock_m"] + truth["receiver_clock_m"]
        + truth["troposphere_m"] + truth["shapiro_m"] + truth["antenna_m"]
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
    assert np.abs(truth["antenna_m"]).min() > 0.0
    assert {s[:1] for s in truth["satellite"].tolist()} == {b"G", b"R", b"E", b"C"}


def test_the_calibration_stands_in_the_log_as_the_scenario_has_it():
    spare, hidden = antenna("SPARE"), antenna("HIDDEN", calibrated=False)
    made = make(
        receiver(antenna="MODEL"), base(antenna="HIDDEN"), receiver("third"),
        sky=NO_AIR, truth=WITH_TERMS, antennas=[antenna(), spare, hidden],
    )  # fmt: skip
    rows = made.rows[channels.ANTENNAS.topic]
    assert rows.ragged("antenna").texts() == ["MODEL"] * 3  # worn, and not hidden
    assert rows.ragged("frequency").texts() == list(CENTRES)
    assert rows.ragged("serial").texts() == [""] * 3
    np.testing.assert_array_equal(rows["offset_neu_m"], [c["offset"] for c in CENTRES.values()])
    for k, centre in enumerate(CENTRES.values()):
        np.testing.assert_array_equal(rows.ragged("pattern_m").row(k), centre["variation"])
    np.testing.assert_allclose(rows["zenith_end_rad"], np.pi / 2, rtol=1e-12)
    worn = {
        name: made.rows[channels.RECEIVER.at(receiver=name)].ragged("antenna").texts()
        for name in ("rover", "base", "third")
    }
    assert worn == {"rover": ["MODEL"], "base": ["HIDDEN"], "third": [""]}
    assert "antenna_m" in terms(made, "base").values
    assert "antenna_m" not in terms(made, "third").values
    nothing = make(base(antenna="HIDDEN"), sky=NO_AIR, antennas=[hidden])
    assert channels.ANTENNAS.topic not in nothing.rows


def test_the_scenario_is_written_back_whole():
    table = {
        "receivers": [receiver(antenna="MODEL")],
        "antennas": [antenna(), antenna("HIDDEN", calibrated=False)],
        "segments": [{"kind": "hold", "duration": 5.0}],
    }
    scenario = read_scenario(table)
    again = read_scenario(tomllib.loads(scenario.to_toml()))
    assert again == scenario
    assert again.setup.antennas[0].frequencies[1].offset == tuple(SECOND["offset"])


def test_it_is_written_by_hand_with_units():
    text = """
        [receiver]
        antenna = "MODEL"
        [[receivers]]
        name = "rover"
        signals = ["G1C"]
        [[antennas]]
        name = "MODEL"
        step = "45 deg"
        [[antennas.frequencies]]
        frequency = "G01"
        offset = ["1 mm", "-2 mm", "13 cm"]
        variation = ["0 mm", "2 mm", "5 mm"]
        [[segments]]
        kind = "hold"
        duration = 5.0
        """
    (found,) = read_scenario(tomllib.loads(text)).setup.antennas
    assert found.step == pytest.approx(np.pi / 4)
    assert found.calibrated
    assert found.frequencies[0].offset == pytest.approx((0.001, -0.002, 0.13))
    assert found.frequencies[0].variation == pytest.approx((0.0, 0.002, 0.005))


@pytest.mark.parametrize(
    ("antennas", "what"),
    [
        ([], "no antenna 'MODEL'"),
        ([antenna("OTHER")], "no antenna 'MODEL'"),
        ([antenna(), antenna()], "two antennas"),
        ([antenna(centres={"E01": OTHER})], "no frequency for the signal 'G1C'"),
        ([{"name": "MODEL"}], "no frequency"),
        ([antenna(centres={"G03": FIRST})], "no frequency 'G03'"),
        ([antenna(centres={"L1": FIRST})], "no frequency 'L1'"),
        ([antenna(centres={"G01": {"offset": [0.1]}})], "three numbers"),
        ([antenna(step=0.0)], "step"),
        ([antenna(" MODEL")], "the name"),
        ([antenna(height=1.0)], "unknown key height"),
        ({"name": "MODEL"}, "no list"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named(antennas, what):
    table = {
        "receivers": [receiver(antenna="MODEL")],
        "antennas": antennas,
        "segments": [{"kind": "hold", "duration": 5.0}],
    }
    with pytest.raises(ConfigurationError, match=what):
        read_scenario(table)


def raised(name, up, bulge):
    """Up offset and a variation `bulge` cos(zenith): together as an offset of `up - bulge`.

    In steps of a degree a straight line is off the cosine by less than 1e-4 of it.
    """
    step = np.radians(1.0)
    numbers = (bulge * np.cos(step * np.arange(91))).tolist()
    centre = {"offset": [0.0, 0.0, up], "variation": numbers}
    return antenna(name, {"G01": centre, "G02": centre}, step=float(step))


def errors_of(folder, rover, base_antenna, noise):
    """Mean error (east, north, up) of fixed epochs with and without the log's calibrations, m."""
    quiet = {"noise": {"code": 0.2, "carrier": 0.002}} if noise else {}
    pair = {"signals": ["G1C", "G2W", "E1C", "E7Q"], **quiet}
    table = {
        "seed": 6,
        "start": {"time": START, **HERE},
        "imu": {"rate": 10.0},
        "gnss": {"fixes": False},
        "receivers": [
            receiver("rover", kind="static", latitude="30.59 deg", longitude="114.3 deg",
                     height="31 m", antenna="HIGH", **pair),
            base(antenna="LOW", **pair),
        ],
        "antennas": [raised("HIGH", *rover), raised("LOW", *base_antenna)],
        "defaults": {"gnss": {"receiver": "rover", "base": "base"}},
        "segments": [{"kind": "hold", "duration": 120.0}],
    }  # fmt: skip
    source = folder / "in.mcap"
    write_log(read_scenario(table), source)
    place = np.array(pymap3d.geodetic2ecef(30.59, 114.3, 31.0))
    found = {}
    for calibrated in (True, False):
        target = folder / f"{calibrated}.mcap"
        with LogReader(source) as reader:
            own = {"antenna": {"calibrated": calibrated}}
            replay_log(reader, target, make_job(reader, "rtk", tables=[own]))
        with LogReader(target) as reader:
            solution = reader.read(channels.SOLUTION.at(run="rtk"))
        fixed = solution["status"] == solution_pb2.SOLUTION_STATUS_FIXED
        assert fixed.sum() > 100
        off = pymap3d.uvw2enu(*(solution["position_ecef_m"][fixed] - place).T, 30.59, 114.3)
        found[calibrated] = np.mean(off, axis=1)
    return found


def test_uncalibrated_antennas_raise_the_rover_by_their_difference(tmp_path):
    """Ten kilometres, 13 cm against 9 cm: without noise what is left is the closed form."""
    found = errors_of(tmp_path, (0.13, 0.0), (0.09, 0.0), False)
    assert np.abs(found[True]).max() < 0.5 * MM
    # The base's vertical leans by 10 km over the Earth's radius: 0.14 mm of its 90 to the north.
    np.testing.assert_allclose(found[False] - found[True], [0.0, 0.0, 0.04], atol=0.3 * MM)


def test_a_run_calibrates_offsets_and_variations_by_the_log(tmp_path):
    found = errors_of(tmp_path, (0.13, 0.005), (0.09, -0.003), True)
    assert np.abs(found[True]).max() < 3 * MM
    # (130 - 5) - (90 + 3) mm; both runs have the same noise.
    np.testing.assert_allclose(found[False] - found[True], [0.0, 0.0, 0.032], atol=0.5 * MM)
