"""Relative positioning of a real drive against its independent truth."""

from __future__ import annotations

import numpy as np
import pymap3d
import pytest

from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.importers import import_log
from replay.log.reader import LogReader
from replay.schemas import solution_pb2
from tests.conftest import ROOT

NEAR_NS = 20_000_000  # truth stands at whole seconds, epochs some milliseconds beside them


@pytest.fixture(scope="module")
def drive(shared_data, tmp_path_factory):
    """Half an hour in Riverside, one frequency of GPS, Galileo and BeiDou at 1 Hz."""
    folder = tmp_path_factory.mktemp("riverside")
    log = folder / "in.mcap"
    name = "riverside-drive-2020-193"
    import_log(ROOT / "recordings" / "specs" / f"{name}.toml", shared_data / name, log)
    return log


@pytest.mark.parametrize("mode", ["continuous", "fix-and-hold"])
def test_integers_of_a_real_drive_are_right(drive, mode):
    out = drive.with_name(f"{mode}.mcap")
    with LogReader(drive) as reader:
        table = {"rtk": {"ambiguities": {"mode": mode}}}
        replay_log(reader, out, make_job(reader, "rtk", tables=[table]))
    with LogReader(out) as reader:
        solution, truth = reader.read("/solution/rtk"), reader.read("/truth")
    t, at = solution.valid_time_ns, truth.valid_time_ns
    place = truth["position_ecef_m"]
    nearest = np.abs(at[None, :] - t[:, None]).argmin(axis=1)
    known = np.abs(at[nearest] - t) < NEAR_NS
    speed = np.gradient(place, at * 1e-9, axis=0)
    want = place[nearest] + speed[nearest] * ((t - at[nearest]) * 1e-9)[:, None]
    lat, lon, height = pymap3d.ecef2geodetic(*want.T)
    east, north, up = pymap3d.ecef2enu(*solution["position_ecef_m"].T, lat, lon, height)
    fixed = (solution["status"] == solution_pb2.SOLUTION_STATUS_FIXED) & known
    assert fixed.sum() >= 0.95 * known.sum()
    horizontal = np.hypot(east, north)[fixed]
    assert np.sqrt(np.mean(horizontal**2)) < 0.01
    assert horizontal.max() < 0.1
    assert np.sqrt(np.mean(up[fixed] ** 2)) < 0.03
