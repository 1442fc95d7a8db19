"""Figures of a network: what was planted is found, what is right is not called wrong."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from replay.channels import find
from replay.evaluate.network import (
    IntegerTruth,
    baseline_integers,
    closures,
    epoch_integers,
)
from replay.evaluate.network_residuals import (
    Observed,
    residual_figures,
    rover_residuals,
    wavelengths,
)
from replay.evaluate.network_run import network_figures, read_network_run, read_stations
from replay.evaluate.signal_table import SignalTable, labels
from replay.log.columns import Columns, Ragged
from replay.log.writer import LogWriter
from replay.schemas.solution_pb2 import SOLUTION_STATUS_FIXED
from tests.batch import fake_network
from tests.batch.fake_network import BASELINES, CHANGE_S, CONVERGED_S, LEFT_M, PLANTED, SATELLITES
from tests.view.fake_run import START_NS, ns

NS = 1_000_000_000


@pytest.fixture(scope="module")
def made() -> dict[str, Columns]:
    return fake_network.make_network()


def write(path: Path, rows: dict[str, Columns], metadata: dict[str, dict[str, str]]) -> Path:
    with LogWriter(path) as writer:
        for topic in sorted(rows):
            spec = find(topic)
            assert spec is not None
            writer.add_channel(topic, spec.message)
        writer.write(rows)
        for name, values in metadata.items():
            writer.add_metadata(name, values)
    return path


def truth_of(made: dict[str, Columns], station: str, master: str) -> IntegerTruth:
    return IntegerTruth(made[f"/truth/{station}/signals"], made[f"/truth/{master}/signals"])


def observed(made: dict[str, Columns], name: str) -> Observed:
    return Observed(
        made[f"/gnss/{name}/obs"],
        made[f"/gnss/{name}/corrections"],
        made[f"/truth/{name}/signals"],
    )


# looking rows up


def test_labels_of_equal_and_of_unequal_lengths() -> None:
    equal = Columns.build([1, 2], {"satellite": Ragged.from_texts(["G01", "E30"])})
    assert labels(equal, "satellite").tolist() == [b"G01", b"E30"]
    unequal = Columns.build([1, 2], {"signal": Ragged.from_texts(["1C", "5"])})
    assert labels(unequal, "signal").tolist() == [b"1C", b"5"]
    packed = Columns.build([1, 2], {"signal": np.array([b"1C", b"WL"])})
    assert labels(packed, "signal").tolist() == [b"1C", b"WL"]
    assert labels(equal.take(slice(1, 2)), "satellite").tolist() == [b"E30"]


def test_a_row_serves_the_nearest_epoch_within_the_tolerance_and_no_other() -> None:
    names = np.array([b"G01", b"G02", b"G01"])
    table = SignalTable(np.array([0, 0, NS]), names, np.array([b"1C"] * 3), tolerance_s=0.1)
    times = np.array([0, NS // 20, NS // 5, NS, NS, NS - NS // 20])
    asked = np.array([b"G02", b"G01", b"G01", b"G02", b"G01", b"G01"])
    found = table.rows(times, asked, np.array([b"1C"] * 6))
    assert found.tolist() == [1, 0, -1, -1, 2, 2]
    assert table.rows(times[:1], np.array([b"G01"]), np.array([b"2W"])).tolist() == [-1]
    empty = SignalTable(np.array([], np.int64), np.array([], "S3"), np.array([], "S2"))
    assert empty.rows(times, asked, np.array([b"1C"] * 6)).tolist() == [-1] * 6


# integers of an epoch


def test_wrong_and_refused_epochs_are_those_that_were_planted(made: dict[str, Columns]) -> None:
    resolution = made["/filter/network/resolution"]
    ambiguities = made["/filter/network/ambiguities"]
    found = epoch_integers(resolution, ambiguities, truth_of(made, "rover", "mref"))
    assert (found.epochs, found.attempted) == (len(resolution), len(resolution))
    assert found.fixed == found.whole == found.judged == len(resolution) - PLANTED["refused"]
    assert found.wrong == PLANTED["wrong"] and found.basis == "integers"
    right = len(resolution) - PLANTED["refused"] - PLANTED["wrong"]
    assert found.success == right / len(resolution)
    late = int(resolution.valid_time_ns[-PLANTED["tried"]])
    later = epoch_integers(resolution, ambiguities, truth_of(made, "rover", "mref"), since_ns=late)
    assert later.attempted == PLANTED["tried"] and later.wrong == PLANTED["wrong"]


def test_another_pair_of_receivers_makes_every_epoch_wrong(made: dict[str, Columns]) -> None:
    found = epoch_integers(
        made["/filter/network/resolution"],
        made["/filter/network/ambiguities"],
        truth_of(made, "rover", "ref1"),
    )
    assert found.wrong == found.fixed


def test_without_truth_nothing_is_judged(made: dict[str, Columns]) -> None:
    found = epoch_integers(made["/filter/network/resolution"], None, None)
    assert (found.judged, found.wrong, found.basis) == (0, 0, "position")


# integers between stations


@pytest.mark.parametrize("baseline", BASELINES)
def test_integers_between_stations(made: dict[str, Columns], baseline: str) -> None:
    master, _, station = baseline.partition("-")
    rows = made[f"/network/{baseline}/ambiguities"]
    found = baseline_integers(rows, truth_of(made, station, master))
    assert list(found) == ["WL", "1C", "2W"]
    epochs = len(np.unique(rows.valid_time_ns))
    for signal, lane in found.items():
        assert lane.rows == epochs * (len(SATELLITES) - 1)
        assert lane.first_fix_s == lane.all_fixed_s == pytest.approx(CONVERGED_S)
        assert lane.share == pytest.approx(1.0 - CONVERGED_S / epochs)
        assert lane.judged == lane.fixed
        planted = baseline == "ref1-ref2" and signal == "1C"
        assert lane.wrong == (PLANTED["closure"] if planted else 0)


def test_triangles_close_but_for_what_was_planted(made: dict[str, Columns]) -> None:
    found = closures({name: made[f"/network/{name}/ambiguities"] for name in BASELINES})
    assert len(found) == 4
    for item in found:
        assert item.checked > 1000
        bad = {"ref1", "ref2"} <= set(item.stations)
        assert item.exceptions == (PLANTED["closure"] if bad else 0), item.stations


def test_a_star_has_no_triangle(made: dict[str, Columns]) -> None:
    star = [name for name in BASELINES if name.startswith("mref")]
    assert closures({name: made[f"/network/{name}/ambiguities"] for name in star}) == ()


# residuals of the rover


def test_residuals_before_are_the_planes_and_after_what_is_left(made: dict[str, Columns]) -> None:
    found = rover_residuals(
        observed(made, "rover"), observed(made, "mref"), made["/network/rover/corrections"]
    )
    world = fake_network._World(160.0, 5)
    assert len(found) == len(world.t) * 2 * (len(SATELLITES) - 1)
    for satellite, signal, rows in found.each():
        ref = world.reference()
        expected = world.difference("rover", "mref", satellite, ref, signal)[ref != satellite]
        np.testing.assert_allclose(found.before_m[rows], expected, atol=2e-7)
        np.testing.assert_allclose(found.after_m[rows], LEFT_M, atol=2e-7)
    figures = residual_figures(found)
    assert figures["1C"].after_rms_m == pytest.approx(LEFT_M, abs=2e-7)
    l2 = (1575.42 / 1227.60) ** 2
    assert figures["2W"].before_rms_m == pytest.approx(l2 * figures["1C"].before_rms_m, rel=1e-4)


def test_single_mode_takes_its_differences_from_the_integers(made: dict[str, Columns]) -> None:
    network = rover_residuals(
        observed(made, "rover"), observed(made, "mref"), made["/network/rover/corrections"]
    )
    single = rover_residuals(
        observed(made, "rover"), observed(made, "mref"), made["/filter/network/ambiguities"],
        corrected=False,
    )  # fmt: skip
    np.testing.assert_allclose(single.before_m, network.before_m, atol=1e-12)
    assert np.isnan(single.after_m).all()
    assert residual_figures(single)["1C"].after_rms_m is None


def test_what_an_antenna_adds_and_the_corrections_model_leaves_nothing(
    made: dict[str, Columns],
) -> None:
    rover, master = observed(made, "rover"), observed(made, "mref")
    # Of each satellite another, so that differences do not hide it.
    name = labels(rover.observations, "satellite")
    added_m = 0.01 * np.char.lstrip(name.astype(np.str_), "G").astype(np.float64)
    length_m = wavelengths(name, labels(rover.observations, "signal"))
    phases = rover.observations["carrier_phase_cycles"] + added_m / length_m
    values = {**rover.observations.values, "carrier_phase_cycles": phases}
    received = dataclasses.replace(rover.observations, values=values)
    told = dict(zip(zip(received.valid_time_ns, name, strict=True), added_m, strict=True))
    rows = rover.corrections
    keys = zip(rows.valid_time_ns, labels(rows, "satellite"), strict=True)
    modelled = {**rows.values, "antenna_m": np.array([told[key] for key in keys])}
    with_antenna = Observed(received, dataclasses.replace(rows, values=modelled), rover.truth)
    corrections = made["/network/rover/corrections"]
    plain = rover_residuals(rover, master, corrections)
    found = rover_residuals(with_antenna, master, corrections)
    np.testing.assert_allclose(found.before_m, plain.before_m, atol=1e-7)
    unmodelled = rover_residuals(Observed(received, rows, rover.truth), master, corrections)
    assert np.abs(unmodelled.before_m - plain.before_m).min() > 0.02


# a run from its log


@pytest.fixture(scope="module")
def log(made: dict[str, Columns], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("network")
    return write(folder / "network.mcap", made, fake_network.make_metadata())


def settled_epochs(made: dict[str, Columns]) -> int:
    rows = made["/solution/network"]
    late = rows.valid_time_ns >= rows.valid_time_ns[0] + 60 * NS
    return int(np.count_nonzero(late & (rows["status"] == SOLUTION_STATUS_FIXED)))


def test_figures_of_a_log(log: Path, made: dict[str, Columns]) -> None:
    run = read_network_run(log)
    assert (run.rover, run.master) == ("rover", "mref")
    assert sorted(run.stations) == ["mref", "ref1", "ref2", "ref3"]
    found = network_figures(run, settling_s=60.0)
    assert found.since_s == pytest.approx(60.0) and found.epochs is not None
    assert found.epochs.wrong == PLANTED["wrong"]
    assert found.rows == settled_epochs(made)
    assert set(found.position_cm) == {"north", "east", "height"}
    assert set(found.attitude_arcmin) == {"heading", "pitch", "roll"}
    assert found.stations == read_stations(log)
    assert found.residuals["1C"].after_rms_m == pytest.approx(LEFT_M, abs=2e-7)


def test_a_known_offset_is_the_mean_by_axis(tmp_path: Path) -> None:
    """Single mode is the same but for an offset east, north, up of the fake."""
    figures = {}
    for name, single in (("network", False), ("single", True)):
        rows = fake_network.make_network(run=name, single=single)
        path = write(tmp_path / f"{name}.mcap", rows, fake_network.make_metadata(name))
        figures[name] = network_figures(read_network_run(path))
    for axis, offset in (("east", 10.0), ("north", -20.0), ("height", 30.0)):
        away = figures["single"].position_cm[axis].mean - figures["network"].position_cm[axis].mean
        assert away == pytest.approx(offset, abs=0.01)
        deviations = [figures[name].position_cm[axis].std for name in figures]
        assert deviations[0] == pytest.approx(deviations[1], abs=0.01)
    assert figures["single"].stations is None
    assert figures["single"].residuals["1C"].after_rms_m is None


def test_the_change_of_reference_is_in_the_fake() -> None:
    """Else the closures and residuals above would not show that references are followed."""
    world = fake_network._World(160.0, 5)
    assert set(world.reference().tolist()) == {"G05", "G12"}
    assert int(ns(np.array([CHANGE_S]))[0]) > START_NS
