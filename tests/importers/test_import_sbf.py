"""SBF: blocks built here after the published layout, against pysbf2 and RTKLIB.

No recording is at hand. ExtSensorMeas is known to neither library: its test states the
layout alone.
"""

import binascii
import math
import random
import struct

import numpy as np
import pymap3d
import pytest

from replay.gnss.ephemerides import ephemeris_records
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.sbf import read_sbf
from replay.log.columns import Columns
from replay.time import NS_PER_S, NS_PER_WEEK, parse_calendar

pysbf2 = pytest.importorskip("pysbf2")

OBS, FIX, NAV, IMU = "/gnss/x/obs", "/gnss/x/fix", "/gnss/nav", "/imu/raw"
WEEK, MS = 2381, 408_639_750
NOW = WEEK * NS_PER_WEEK + MS * 1_000_000
PI = math.pi


def block(number: int, body: bytes) -> bytes:
    body = struct.pack("<IH", MS, WEEK) + body
    body += bytes(-(len(body) + 8) % 4)
    rest = struct.pack("<HH", number, len(body) + 8) + body
    return b"$@" + struct.pack("<H", binascii.crc_hqx(rest, 0)) + rest


def read(data: bytes, findings: Findings | None = None) -> dict[str, Columns]:
    file = File("x.sbf", data, "", len(data))
    return read_sbf(file, findings or Findings(strict=True), receiver="x")


def parsed(data: bytes):
    return pysbf2.SBFReader.parse(data)


def measurements() -> bytes:
    def first(
        kind: int, number: int, count: int, info: int = 0, code: int = 21_000_000_123
    ) -> bytes:
        return struct.pack(
            "<BBBBIiHbBHBB", 1, kind, number, code >> 32, code & 0xFFFFFFFF, -12_345_678, 1234,
            -3, 140, 100, info, count,
        )  # fmt: skip

    second = struct.pack(
        "<BBBBbBHHH", 3, 90, 120, (-1 & 7) | (-2 & 31) << 3, 2, 4, 60_000, 4321, 50_000
    )
    rows = (
        first(0, 5, 1) + second + first(8, 38 + 2, 0, info=(5 + 8) << 3)
        + first(17, 71 + 10, 0, code=26_000_000_123) + first(28, 141 + 20, 0)
        + first(31, 181, 0, info=(32 - 32) << 3)
    )  # fmt: skip
    return block(4027, struct.pack("<BBBBBB", 5, 20, 12, 0, 0, 0) + rows)


def test_measurements_agree_with_rtklib() -> None:
    pyrtklib = pytest.importorskip("pyrtklib")
    data = measurements()
    got = read(data)[OBS]
    assert set(got.valid_time_ns.tolist()) == {NOW}
    ours = {
        (got["satellite"][i].decode(), got["signal"][i].decode()): tuple(
            got[name][i] for name in ("pseudorange_m", "carrier_phase_cycles", "doppler_hz",
                                      "cn0_dbhz")
        )
        for i in range(len(got))
    }  # fmt: skip
    assert set(ours) == {
        ("G05", "1C"), ("G05", "2L"), ("R03", "1C"), ("E11", "1C"), ("C21", "2I"), ("J01", "1L"),
    }  # fmt: skip
    raw = pyrtklib.raw_t()
    pyrtklib.init_raw(raw, pyrtklib.STRFMT_SEPT)
    states = [s for byte in data * 2 if (s := pyrtklib.input_sbf(raw, byte))]
    assert states and states[0] == 1
    letters = {pyrtklib.SYS_GPS: "G", pyrtklib.SYS_GLO: "R", pyrtklib.SYS_GAL: "E",
               pyrtklib.SYS_CMP: "C", pyrtklib.SYS_QZS: "J"}  # fmt: skip
    checked = 0
    for n in range(raw.obs.n):
        one, number = raw.obs.data[n], pyrtklib.Arr1Dint(1)
        letter = letters[pyrtklib.satsys(one.sat, number)]
        for k in range(3):
            if one.code[k]:
                prn = number[0] - (192 if letter == "J" else 0)
                mine = ours[f"{letter}{prn:02d}", pyrtklib.code2obs(one.code[k])]
                assert mine[0] == pytest.approx(one.P[k], abs=1e-4)
                assert mine[1] == pytest.approx(one.L[k], abs=1e-3)
                assert mine[2] == pytest.approx(one.D[k], abs=1e-2)
                checked += 1
    assert checked >= 4


def test_measurements_agree_with_pysbf2() -> None:
    data = measurements()
    theirs = parsed(data)
    got = read(data)[OBS]
    main = (got["satellite"] == b"G05") & (got["signal"] == b"1C")
    assert got["pseudorange_m"][main] == pytest.approx(theirs.CodeMSB_01 + theirs.CodeLSB_01)
    assert got["doppler_hz"][main] == pytest.approx(theirs.Doppler_01)
    assert got["cn0_dbhz"][main] == theirs.CN0_01 + 10.0
    assert got["lock_time_s"][main] == theirs.LockTime_01
    wave = 299792458.0 / 1575.42e6
    cycles = got["pseudorange_m"][main] / wave + theirs.CarrierMSB_01 + theirs.CarrierLSB_01
    assert got["carrier_phase_cycles"][main] == pytest.approx(cycles)
    second = (got["satellite"] == b"G05") & (got["signal"] == b"2L")
    # The offset's high part is signed: -1 times 65.536 m.
    assert got["pseudorange_m"][second] - got["pseudorange_m"][main] == pytest.approx(
        -65.536 + theirs.CodeOffsetLSB_01_01
    )
    assert got["loss_of_lock"][second] == 2
    glonass = got["satellite"] == b"R03"
    assert got["glonass_channel"][glonass] == 5


def pvt(place: tuple, speed: tuple, mode: int = 4, error: int = 0) -> bytes:
    body = struct.pack("<BB3df3ffdfBBBBHHIBBHHHHB", mode, error, *place, 20.0, *speed, 0.0, 1e-6,
                       0.0, 0, 0, 25, 0, 1, 150, 0, 0, 1, 0, 0, 30, 50, 0)  # fmt: skip
    return body


def test_fixes_geodetic_and_cartesian() -> None:
    lat, lon = math.radians(40.0), math.radians(-105.0)
    data = block(4007, pvt((lat, lon, 1580.0), (1.0, 2.0, -3.0)))
    theirs = parsed(data)
    assert (theirs.Latitude, theirs.NrSV, theirs.MeanCorrAge) == (lat, 25, 1.5)
    place = pymap3d.geodetic2ecef(40.0, -105.0, 1580.0)
    speed = pymap3d.enu2ecefv(2.0, 1.0, -3.0, 40.0, -105.0)
    for bytes_ in (data, block(4006, pvt(place, speed))):
        got = read(bytes_)[FIX]
        assert got.valid_time_ns[0] == NOW
        assert got["position_ecef_m"][0] == pytest.approx(place, abs=1e-6)
        assert got["velocity_ecef_m_s"][0] == pytest.approx(speed, abs=1e-6)
        # 0.30 and 0.50 m are twice the deviations; the horizontal one is of both axes.
        expected = [0.15**2 / 2, 0.15**2 / 2, 0.25**2]
        assert got["position_covariance_enu_m2"][0, [0, 3, 5]] == pytest.approx(expected)
        assert (got["quality"][0], got["satellite_count"][0]) == (6, 25)
        assert got["differential_age_s"][0] == 1.5


def test_covariances_take_their_place() -> None:
    numbers = (4.0, 9.0, 16.0, 1.0, 0.5, 0.25, 0.0, 0.75, 0.0, 0.0)
    cov = struct.pack("<BB10f", 4, 0, *numbers)
    data = block(5906, cov) + block(5908, cov) + block(4007, pvt((0.7, 0.1, 1.0), (0.0,) * 3))
    assert parsed(block(5906, cov)).Cov_lonhgt == 0.75
    got = read(data)[FIX]
    # North-north 4, east-east 9, up-up 16; north-east 0.5, north-up 0.25, east-up 0.75.
    expected = [9.0, 0.5, 0.75, 4.0, 0.25, 16.0]
    assert got["position_covariance_enu_m2"][0].tolist() == expected
    assert got["velocity_covariance_enu_m2_s2"][0].tolist() == expected


def test_no_solution_is_no_fix() -> None:
    findings = Findings(strict=True)
    data = block(4007, pvt((0.7, 0.1, 1.0), (0.0,) * 3, error=1)) + block(
        4007, pvt((-2e10,) * 3, (-2e10,) * 3, mode=0)
    )
    assert read(data, findings) == {} and "2 PVT" in findings.notes[0]


def kepler(rng: random.Random, toe: int) -> tuple[bytes, dict[str, float]]:
    f = {name: float(np.float32(rng.uniform(-1e-3, 1e-3))) for name in (
        "af2", "af1", "af0", "crs", "delta_n", "cuc", "cus", "cic", "cis", "crc", "omega_dot",
        "i_dot")}  # fmt: skip
    d = {name: rng.uniform(-1.0, 1.0) for name in ("m0", "omega0", "i0", "omega")}
    d |= {"eccentricity": 0.01, "sqrt_a": 5153.7}
    body = struct.pack(
        "<I5fdfdfdIfdfdfdffHH", toe, f["af2"], f["af1"], f["af0"], f["crs"], f["delta_n"],
        d["m0"], f["cuc"], d["eccentricity"], f["cus"], d["sqrt_a"], toe, f["cic"], d["omega0"],
        f["cis"], d["i0"], f["crc"], d["omega"], f["omega_dot"], f["i_dot"], WEEK, WEEK,
    )  # fmt: skip
    angles = ("m0", "omega0", "i0", "omega", "delta_n", "omega_dot", "i_dot")
    return body, {k: v * (PI if k in angles else 1.0) for k, v in (f | d).items()}


def test_gps_and_beidou_ephemerides() -> None:
    body, expected = kepler(random.Random(1), 410_400)
    gps = block(5891, struct.pack("<BBHBBBBHBBBBf", 7, 0, WEEK % 1024, 1, 1, 0, 0, 0x117, 0x17,
                                  0x17, 0, 0, 1e-9) + body)  # fmt: skip
    beidou = block(4081, struct.pack("<BBHBBBBHff", 141 + 20, 0, WEEK - 1356, 0, 1, 3, 4, 0, 2e-9,
                                     3e-9) + body)  # fmt: skip
    assert expected["omega0"] == parsed(gps).OMEGA_0 * PI and parsed(gps).IODC == 0x117
    assert expected["i_dot"] == parsed(beidou).IDOT * PI and parsed(beidou).IODE == 4
    one, two = sorted(ephemeris_records(read(gps + beidou)[NAV]), key=lambda r: -r["system"])
    for record, system, prn, ahead in ((one, "G", 7, 0), (two, "C", 21, 14)):
        assert (chr(record["system"]), record["prn"]) == (system, prn)
        for name, value in expected.items():
            assert record[name] == pytest.approx(value, rel=1e-12), name
        assert record["toe_ns"] == (WEEK * 604_800 + 410_400 + ahead) * NS_PER_S
    assert (one["iodc"], one["iode"], one["fit_s"]) == (0x117, 0x17, 14_400)
    assert (two["iodc"], two["iode"], two["health"]) == (3, 4, 1)
    assert one["accuracy_m"] == 2.8 and two["group_delay_2_s"] == np.float32(3e-9)


def test_galileo_ephemeris() -> None:
    numbers = [0.1, 0.01, 0.3, 0.4, 0.5]
    # E1-B known, valid, in test (3); E5b known, no guarantee, healthy.
    flags = 1 | 3 << 2 | 1 << 4 | 1 << 5
    body = struct.pack(
        "<BBd5d9fII2fdHHHHBBBBfffB", 71 + 10, 2, 5440.6, *numbers, *[1e-4] * 9, 407_400, 407_400,
        0.0, 1e-11, 1e-4, WEEK, WEEK, 44, flags, 0, 255, 107, 255, 1e-9, 2e-9, -2e10, 0,
    )  # fmt: skip
    data = block(4002, body)
    assert (parsed(data).IODnav, parsed(data).t_oe, parsed(data).BGD_L1E5b) == (
        44, 407_400, np.float32(2e-9),
    )  # fmt: skip
    record = ephemeris_records(read(data)[NAV])[0]
    assert (chr(record["system"]), record["prn"], record["source"]) == ("E", 11, 1 | 512)
    assert record["m0"] == pytest.approx(0.1 * PI) and record["eccentricity"] == 0.01
    assert record["accuracy_m"] == pytest.approx(3.12)
    assert record["health"] == 3 << 1 | 1 << 6
    assert record["toe_ns"] == (WEEK * 604_800 + 407_400) * NS_PER_S


def test_glonass_ephemeris() -> None:
    toe = parse_calendar("2025-08-28T17:30:18")
    body = struct.pack(
        "<BB3d3f3f3fIHBBBBHBBBBHHB", 38 + 2, 5 + 8, 1e4, -2e4, 3e3, 1.5, -2.5, 0.5, 0, 0, 1e-9,
        1e-12, 1e-5, 0.0, toe // NS_PER_S % 604_800, WEEK % 1024, 0, 0, 1, 4, 1230, 0, 0, 0, 0, 0,
        0, 0,
    )  # fmt: skip
    data = block(4004, body)
    assert parsed(data).X == 1e7 and parsed(data).tb == 1230
    record = ephemeris_records(read(data)[NAV])[0]
    assert (record["prn"], record["frequency_channel"], record["health"]) == (3, 5, 1)
    assert record["position_m"].tolist() == [1e7, -2e7, 3e6]
    assert record["velocity_m_s"].tolist() == [1500.0, -2500.0, 500.0]
    assert record["af0"] == -np.float32(1e-5) and record["toe_ns"] == toe
    # Minutes of the Moscow day over 15; 17:30 of UTC.
    assert record["iode"] == 82
    assert record["toe_s"] == 4 * 86_400 + 17.5 * 3600


def test_sensor_samples() -> None:
    force = struct.pack("<BBBB3d", 1, 1, 0, 0, 0.1, 0.2, -9.8)
    rate = struct.pack("<BBBB3d", 1, 1, 1, 0, 90.0, -45.0, 0.0)
    warmth = struct.pack("<BBBBh22x", 1, 1, 3, 0, 2345)
    data = block(4050, struct.pack("<BB", 3, 28) + warmth + force + rate)
    got = read(data)[IMU]
    assert got["specific_force_body_m_s2"][0] == pytest.approx([0.1, 0.2, -9.8])
    assert got["angular_rate_body_rad_s"][0] == pytest.approx([PI / 2, -PI / 4, 0.0])
    assert got["temperature_c"][0] == pytest.approx(23.45)


def test_damage_is_counted_with_its_place() -> None:
    data = measurements()
    for at in range(len(data) + 2, 2 * len(data)):
        broken = bytearray(data + data + block(4013, b""))
        broken[at] ^= 1
        findings = Findings()
        assert len(read(bytes(broken), findings)[OBS]) == 6
        assert findings.losses.exit_code == 3
    findings = Findings()
    read(data + data[:-1], findings)
    assert f"byte {len(data)}" in str(findings.losses.losses[0])


def test_blocks_that_are_not_read_are_counted() -> None:
    findings = Findings(strict=True)
    read(measurements() + block(4013, bytes(8)) * 2, findings)
    assert "4013: 2" in findings.notes[0]
