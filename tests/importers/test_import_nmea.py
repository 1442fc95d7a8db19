"""NMEA sentences: by hand, and a real recording against pynmeagps."""

import functools
import operator
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from replay.errors import ForeignFileError
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.nmea import read_nmea
from replay.log.columns import Columns
from replay.time import NS_PER_S, NS_PER_WEEK, parse_calendar

FIX = "/gnss/x/fix"


def line(text: str) -> bytes:
    check = functools.reduce(operator.xor, text.encode())
    return f"${text}*{check:02X}\r\n".encode()


def gga(clock: str, quality: int = 4, south: bool = False) -> bytes:
    side = "S" if south else "N"
    return line(f"GNGGA,{clock},4005.8014957,{side},10508.8299894,W,{quality},12,0.62,1601.435,M,"
                "-21.387,M,0.8,0000")  # fmt: skip


def rmc(clock: str, date: str) -> bytes:
    return line(f"GNRMC,{clock},A,4005.8,N,10508.8,W,0.0,,{date},,,R,V")


def read(data: bytes, findings: Findings | None = None, near: int | None = None) -> Columns:
    file = File("x.nmea", data, "", len(data))
    found = read_nmea(file, findings or Findings(strict=True), receiver="x", approximate_ns=near)
    return found[FIX]


def test_a_fix() -> None:
    data = (
        rmc("173021.75", "280825")
        + gga("173021.75")
        + line("GNGST,173021.75,1.0,,,,0.012,0.010,0.025")
    )
    got = read(data)
    # 18 leap seconds.
    assert got.valid_time_ns[0] == parse_calendar("2025-08-28T17:30:39.75")
    expected = pymap3d.geodetic2ecef(40 + 5.8014957 / 60, -105 - 8.8299894 / 60, 1601.435 - 21.387)
    assert got["position_ecef_m"][0] == pytest.approx(expected, abs=1e-6)
    # GST: north, east, up.
    expected = [0.010**2, 0.012**2, 0.025**2]
    assert got["position_covariance_enu_m2"][0, [0, 3, 5]] == pytest.approx(expected)
    assert (got["quality"][0], got["satellite_count"][0]) == (6, 12)
    assert got["differential_age_s"][0] == 0.8


@pytest.mark.parametrize(("code", "quality"), [(1, 1), (2, 2), (4, 6), (5, 5), (6, 7)])
def test_qualities(code: int, quality: int) -> None:
    assert read(rmc("173021.75", "280825") + gga("173021.75", code))["quality"][0] == quality


def test_midnight() -> None:
    data = b"".join(
        (
            gga("235959.00"), rmc("235959.00", "310825"),
            gga("000000.00"), rmc("000000.00", "010925"),
            gga("000001.00"), line("GNZDA,000001.00,01,09,2025,00,00"),
        )
    )  # fmt: skip
    got = read(data)
    start = parse_calendar("2025-09-01T00:00:17")
    assert got.valid_time_ns.tolist() == [start + n * NS_PER_S for n in range(3)]


def test_a_date_is_needed() -> None:
    with pytest.raises(ForeignFileError, match="date") as caught:
        read(gga("173021.75"))
    assert "approximate_time" in caught.value.mend
    got = read(gga("173021.75"), near=parse_calendar("2025-08-28T12:00:00"))
    assert got.valid_time_ns[0] == parse_calendar("2025-08-28T17:30:39.75")


def test_damage_is_counted() -> None:
    good = rmc("173021.75", "280825") + gga("173021.75")
    broken = gga("173022.00").replace(b"4005", b"4006")
    odd = line("GNGGA,17x022.25,4005.8,N,10508.8,W,4,12,0.62,1601.4,M,-21.3,M,0.8,0000")
    findings = Findings()
    assert len(read(good + broken + odd, findings)) == 1
    texts = [str(loss) for loss in findings.losses.losses]
    assert f"byte {len(good)}" in texts[0] and "line 4" in texts[1]
    assert findings.losses.exit_code == 3


def test_no_fix_is_refused() -> None:
    with pytest.raises(ForeignFileError, match="no GGA"):
        read(rmc("173021.75", "280825") + gga("173021.75", 0))


def test_a_recording_is_that_of_pynmeagps(shared_data: Path) -> None:
    pynmeagps = pytest.importorskip("pynmeagps")
    data = (shared_data / "boulder-walk-2024-240" / "gnss_1730.ubx").read_bytes()
    got = read(data)
    theirs = []
    at = 0
    while (at := data.find(b"$GNGGA", at)) >= 0:
        theirs.append(pynmeagps.NMEAReader.parse(data[at : data.index(b"\n", at) + 1]))
        at += 1
    assert len(got) == len(theirs) == 536
    for i in range(0, 536, 25):
        one = theirs[i]
        expected = pymap3d.geodetic2ecef(one.lat, one.lon, one.alt + one.sep)
        assert got["position_ecef_m"][i] == pytest.approx(expected, abs=1e-4)
        assert got["satellite_count"][i] == one.numSV
    day = got.valid_time_ns[0] // NS_PER_WEEK * NS_PER_WEEK + 4 * 86_400 * NS_PER_S
    first = theirs[0].time
    of_day = first.hour * 3600 + first.minute * 60 + first.second + first.microsecond * 1e-6
    assert (got.valid_time_ns[0] - day) / 1e9 == pytest.approx(of_day + 18)
    assert np.all(np.diff(got.valid_time_ns) == 250_000_000)
