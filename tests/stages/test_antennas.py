"""What the antenna adds: from the log's calibrations to the corrections and the filters."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from replay import channels, configuration
from replay.gnss.antennas import Antennas
from replay.gnss.measurements import gather_epochs, select_signals
from replay.log.columns import Columns, Ragged
from replay.stages.base import BASE, Context
from replay.stages.rtk import MovingBaseSatellites
from replay.stages.rtk_config import MovingBaseConfig
from replay.stages.satellites import Satellites
from replay.stages.spp_config import SppConfig
from tests.simulate.observing import DRIVE, make, receiver
from tests.stages.gnss_chain import CORRECTIONS, OBS, SATELLITES, inputs_of, keyed, logged, run

ANTENNAS, RECEIVER = channels.ANTENNAS.name, channels.RECEIVER.name
WORN = "SEPCHOKE_B3E6   SPKE"
BARE = "SEPCHOKE_B3E6   NONE"
START_NS = 1_000


@functools.cache
def driven():
    """A drive of some seconds; its rows as a log gives them."""
    made = make(receiver(), segments=DRIVE)
    return made, inputs_of(made.rows)


def calibrations(*rows, log_time_ns=START_NS):
    """Rows of antenna, frequency, offset (north, east, up), and numbers by 45 degrees of zenith.

    A fifth part of a row are numbers by azimuth (north, south, north).
    """
    parts = [(*row, []) if len(row) == 4 else row for row in rows]
    n = len(parts)

    def ragged(place):
        ends = np.cumsum([0, *(len(part[place]) for part in parts)])
        return Ragged(ends.astype(np.int64), np.array([x for p in parts for x in p[place]], float))

    return logged(
        ANTENNAS,
        Columns.build(
            np.full(n, log_time_ns),
            {
                "antenna": Ragged.from_texts([part[0] for part in parts]),
                "serial": Ragged.from_texts([""] * n),
                "frequency": Ragged.from_texts([part[1] for part in parts]),
                "offset_neu_m": np.array([part[2] for part in parts], dtype=float),
                "zenith_start_rad": np.zeros(n),
                "zenith_end_rad": np.full(n, np.pi / 2),
                "zenith_step_rad": np.full(n, np.pi / 4),
                "azimuth_step_rad": np.array([np.pi if part[4] else 0.0 for part in parts]),
                "pattern_m": ragged(3),
                "azimuth_pattern_m": ragged(4),
                "valid_from_ns": np.zeros(n, dtype=np.int64),
                "valid_until_ns": np.zeros(n, dtype=np.int64),
            },
        ),
    )


NOTHING = [0.0, 0.0, 0.0]
HIGH = (WORN, "G01", (0.0, 0.0, 0.1), NOTHING)


def information(*names, times=(START_NS,)):
    """Rows of the receiver that name antennas."""
    n = len(names)
    return logged(
        RECEIVER,
        Columns.build(
            np.array(times),
            {
                "marker": Ragged.from_texts([""] * n),
                "receiver": Ragged.from_texts([""] * n),
                "antenna": Ragged.from_texts(list(names)),
                "header": Ragged.from_blobs([b""] * n),
            },
        ),
    )


def ran(rows, *names, settings=None, edges=(), dump_at=None, **kinds):
    _, inputs = driven()
    config = configuration.build(SppConfig, [settings or {}])
    info = information(*(names or (WORN,)), **kinds)
    given = {**inputs, RECEIVER: info, **({ANTENNAS: rows} if rows is not None else {})}
    return run(Satellites(), config, given, edges, dump_at=dump_at)


def added(found):
    """What the antenna adds, with the elevation and azimuth of each."""
    corrections, sights = found.outputs[CORRECTIONS], found.outputs[SATELLITES]
    where = {
        (t, name): (elevation, azimuth)
        for t, name, elevation, azimuth in zip(
            sights.valid_time_ns.tolist(), sights["satellite"].tolist(),
            sights["elevation_rad"].tolist(), sights["azimuth_rad"].tolist(), strict=True,
        )
    }  # fmt: skip
    values = keyed(corrections, "antenna_m")
    return [(key, value, *where[key[:2]]) for key, value in values.items()]


def test_a_height_of_the_phase_centre_takes_its_sine_off_every_range():
    """The only calibrated frequency serves for all systems."""
    found = added(ran(calibrations(HIGH)))
    assert len(found) > 100 and len({key[1][:1] for key, *_ in found}) > 2
    for _, value, elevation, _ in found:
        assert value == pytest.approx(-0.1 * np.sin(elevation), abs=1e-12)


def test_each_frequency_has_its_own():
    rows = calibrations(
        HIGH, (WORN, "G02", (0.0, 0.0, 0.05), NOTHING), (WORN, "E01", (0.0, 0.0, 0.2), NOTHING)
    )
    heights = {(b"G", b"1"): 0.1, (b"G", b"2"): 0.05, (b"E", b"1"): 0.2, (b"E", b"7"): 0.05}
    seen = set()
    for key, value, elevation, _ in added(ran(rows)):
        kind = key[1][:1], key[2][:1]
        if kind in heights:
            seen.add(kind)
            assert value == pytest.approx(-heights[kind] * np.sin(elevation), abs=1e-12)
    assert {(b"G", b"1"), (b"G", b"2")} < seen and len(seen) > 2


TILTED = (WORN, "G01", (0.03, 0.02, 0.1), [0.0, 0.004, 0.008], [*NOTHING, 0.1, 0.1, 0.1, *NOTHING])


def test_a_rover_has_only_the_height_and_the_mean_pattern():
    for _, value, elevation, _ in added(ran(calibrations(TILTED))):
        mean = 0.008 * (1.0 - elevation / (np.pi / 2))
        assert value == pytest.approx(mean - 0.1 * np.sin(elevation), abs=1e-12)


def at_base(stage, config, rows):
    """The stage of the base over the drive's rows, standing at the drive's start."""
    _, inputs = driven()
    names = {OBS: f"{BASE}.{OBS}", RECEIVER: f"{BASE}.{RECEIVER}"}
    given = {**inputs, RECEIVER: information(WORN), ANTENNAS: rows}
    state = stage.start(config, Context({}, {}))
    _, outputs = stage.step(state, {names.get(name, name): part for name, part in given.items()})
    found = {name.removeprefix(f"{BASE}."): part for name, part in outputs.items()}
    return type("Ran", (), {"outputs": found})


def test_a_station_has_offset_and_pattern_whole():
    made, _ = driven()
    place = [float(x) for x in made.rows[channels.TRUTH.topic]["position_ecef_m"][0]]
    config = configuration.build(SppConfig, [{"antenna": {"base_position": place}}])
    found = added(at_base(Satellites(BASE), config, calibrations(TILTED)))
    assert len(found) > 100
    for _, value, elevation, azimuth in found:
        flat = np.cos(elevation) * (0.03 * np.cos(azimuth) + 0.02 * np.sin(azimuth))
        turn = azimuth % (2 * np.pi)
        pattern = 0.1 * (1.0 - abs(turn - np.pi) / np.pi)
        assert value == pytest.approx(pattern - flat - 0.1 * np.sin(elevation), abs=1e-12)


def test_a_base_that_moves_is_like_a_rover():
    config = configuration.build(MovingBaseConfig, [])
    found = added(at_base(MovingBaseSatellites(), config, calibrations(TILTED)))
    for _, value, elevation, _ in found:
        mean = 0.008 * (1.0 - elevation / (np.pi / 2))
        assert value == pytest.approx(mean - 0.1 * np.sin(elevation), abs=1e-12)


@pytest.mark.parametrize(
    ("rows", "name", "settings"),
    [
        (None, WORN, {}),
        (calibrations(HIGH), "AOAD/M_T        NONE", {}),
        (calibrations(HIGH), "", {}),
        (calibrations(HIGH), WORN, {"antenna": {"calibrated": False}}),
        (calibrations(HIGH, log_time_ns=2**62), WORN, {}),
    ],
    ids=["no rows", "another antenna", "no name", "switched off", "not known yet"],
)
def test_what_is_not_modelled_is_absent_and_changes_no_byte(rows, name, settings):
    _, inputs = driven()
    plain = run(Satellites(), configuration.build(SppConfig, []), inputs)
    found = ran(rows, name, settings=settings)
    assert found.bytes() == plain.bytes()
    assert not found.outputs[CORRECTIONS].is_present("antenna_m").any()


def test_under_a_radome_without_calibration_the_bare_antenna_serves():
    bare = (BARE, "G01", (0.0, 0.0, 0.3), NOTHING)
    for rows, height in ((calibrations(bare), 0.3), (calibrations(bare, HIGH), 0.1)):
        for _, value, elevation, _ in added(ran(rows)):
            assert value == pytest.approx(-height * np.sin(elevation), abs=1e-12)


def test_another_antenna_counts_from_when_the_receiver_says_so():
    _, inputs = driven()
    times = np.unique(inputs[OBS].log_time_ns)
    change = int(times[len(times) // 2])
    rows = calibrations(HIGH, (BARE, "G01", (0.0, 0.0, 0.3), NOTHING))
    found = added(ran(rows, WORN, BARE, times=(START_NS, change)))
    for key, value, elevation, _ in found:
        height = 0.3 if key[0] >= change else 0.1
        assert value == pytest.approx(-height * np.sin(elevation), abs=1e-12)
    assert len({key[0] >= change for key, *_ in found}) == 2


def test_how_the_log_is_cut_changes_no_byte():
    _, inputs = driven()
    times = np.unique(inputs[OBS].log_time_ns)
    change = int(times[len(times) // 2])
    rows = calibrations(TILTED, (BARE, "G01", (0.0, 0.0, 0.3), NOTHING))
    kinds = {"times": (START_NS, change)}
    whole = ran(rows, WORN, BARE, **kinds)
    edges = [int(times[3]), change, int(times[-5])]
    assert ran(rows, WORN, BARE, edges=edges, dump_at=2, **kinds).bytes() == whole.bytes()


def test_every_filter_reads_code_and_phase_without_it():
    _, inputs = driven()
    found = ran(calibrations(HIGH)).outputs
    selection = select_signals(["G1C", "G2W"], "G")
    corrections = logged(CORRECTIONS, found[CORRECTIONS])
    sights = logged(SATELLITES, found[SATELLITES])
    plain = gather_epochs(inputs[OBS], selection, sights).rows
    rows = gather_epochs(inputs[OBS], selection, sights, corrections).rows
    seen = rows["seen"] == 1
    assert seen.sum() > 50
    for name in ("code", "phase"):
        moved = (rows[name] - plain[name])[seen]
        due = np.broadcast_to(0.1 * np.sin(rows["elevation"][seen])[:, None], moved.shape)
        there = np.isfinite(plain[name][seen])
        assert there.sum() > 50
        # To what a float64 of a range resolves.
        np.testing.assert_allclose(moved[there], due[there], atol=2e-8)


def test_a_pattern_that_does_not_fit_its_angles_is_named():
    from replay.errors import DataError

    with pytest.raises(DataError, match="does not fit") as caught:
        Antennas().learn(calibrations((*TILTED[:4], [0.1, 0.2])))
    assert WORN in caught.value.where
