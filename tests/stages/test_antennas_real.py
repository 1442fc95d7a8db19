"""Two stations with different antennas, 35 km apart, against the positions of their marks."""

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

HOURS = 8
NAME = "nl-network-2021-001"


@pytest.mark.heavy
def test_calibrations_bring_the_height_of_a_station_to_its_mark(shared_data, tmp_path):
    """Their phase centres stand 38 mm apart in height on L1 and 24 mm on L2."""
    if not (shared_data / "antex" / "igs14.atx.gz").exists():
        pytest.skip("the calibrations of the IGS are not here")
    log = tmp_path / "in.mcap"
    import_log(ROOT / "recordings" / "specs" / f"{NAME}.toml", shared_data / NAME, log)
    heights = {}
    for calibrated in (False, True):
        table = {
            "gnss": {"receiver": "delf", "base": "zegv", "systems": "G"},
            "antenna": {"calibrated": calibrated},
        }
        out = tmp_path / f"{calibrated}.mcap"
        with LogReader(log) as reader:
            end_ns = reader.read("/gnss/delf/obs").log_time_ns[0] + HOURS * 3600 * 1_000_000_000
            replay_log(reader, out, make_job(reader, "rtk", tables=[table], end_ns=int(end_ns)))
            info = reader.read("/gnss/delf/receiver")
        with LogReader(out) as reader:
            solution = reader.read("/solution/rtk")
        height = pymap3d.ecef2geodetic(*info["approximate_position_ecef_m"][0])[2]
        east, north, up = info["antenna_offset_enu_m"][0]
        assert east == north == 0.0
        found = pymap3d.ecef2geodetic(*solution["position_ecef_m"].T)[2]
        fixed = solution["status"] == solution_pb2.SOLUTION_STATUS_FIXED
        assert fixed.mean() > 0.95
        heights[calibrated] = float(np.mean(found[fixed] - (height + up)))
    assert abs(heights[True]) < 0.02
    assert abs(heights[False]) > abs(heights[True]) + 0.02
    # Between the differences of the two frequencies, patterns and troposphere aside.
    assert 0.02 < heights[True] - heights[False] < 0.045
