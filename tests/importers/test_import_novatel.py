"""NovAtel binary: messages built here against RTKLIB, and a real recording's physics."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.novatel import read_novatel
from replay.log.columns import Columns
from replay.time import NS_PER_WEEK

OBS, FIX, NAV, IMU, TRUTH = "/gnss/x/obs", "/gnss/x/fix", "/gnss/nav", "/imu/raw", "/truth"
WEEK, MS = 2381, 408_639_750


def check(data: bytes) -> bytes:
    """CRC-32 that starts at zero and is not inverted, from zlib's that is both."""
    plain = zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF
    return struct.pack("<I", plain)


def message(number: int, body: bytes, ms: int = MS) -> bytes:
    head = struct.pack("<3sBHBBHHBBHiIHH", b"\xaa\x44\x12", 28, number, 0, 0, len(body), 0, 0, 180,
                       WEEK, ms, 0, 0, 0)  # fmt: skip
    return head + body + check(head + body)


def short(number: int, body: bytes, ms: int = MS) -> bytes:
    head = struct.pack("<3sBHHi", b"\xaa\x44\x13", len(body), number, WEEK, ms)
    return head + body + check(head + body)


def read(data: bytes, findings: Findings | None = None, **options: float) -> dict[str, Columns]:
    file = File("x.gps", data, "", len(data))
    return read_novatel(file, findings or Findings(strict=True), receiver="x", **options)


def status(system: int, signal: int, locks: int = 0x1C00) -> int:
    return 4 | locks | system << 16 | signal << 21


ROWS = [
    (5, 0, 2.1e7, 0.05, -1.1e8, 0.004, -250.5, 45.5, 100.0, status(0, 0)),
    (5, 0, 2.2e7, 0.05, -1.0e8, 0.004, -200.5, 44.5, 100.0, status(0, 9)),
    (38 + 3, 5, 2.0e7, 0.05, -1.07e8, 0.004, 1.5, 40.0, 10.0, status(1, 0)),
    (11, 0, 2.6e7, 0.05, -1.3e8, 0.004, 1.5, 41.0, 10.0, status(3, 2)),
    (21, 0, 2.3e7, 0.05, -1.2e8, 0.004, 1.5, 42.0, 10.0, status(4, 0, 0x1800)),
]


def test_range_agrees_with_rtklib() -> None:
    pyrtklib = pytest.importorskip("pyrtklib")
    body = struct.pack("<I", len(ROWS)) + b"".join(struct.pack("<HHdfdffffI", *r) for r in ROWS)
    data = message(43, body)
    raw = pyrtklib.raw_t()
    pyrtklib.init_raw(raw, pyrtklib.STRFMT_OEM4)
    assert [s for byte in data if (s := pyrtklib.input_oem4(raw, byte))] == [1]
    theirs = {}
    for n in range(raw.obs.n):
        one, number = raw.obs.data[n], pyrtklib.Arr1Dint(1)
        letter = {
            pyrtklib.SYS_GPS: "G", pyrtklib.SYS_GLO: "R", pyrtklib.SYS_GAL: "E",
            pyrtklib.SYS_CMP: "C",
        }[pyrtklib.satsys(one.sat, number)]  # fmt: skip
        for k in range(3):
            if one.code[k]:
                key = f"{letter}{number[0]:02d}", pyrtklib.code2obs(one.code[k])
                theirs[key] = one.P[k], one.L[k], one.D[k]
    got = read(data)[OBS]
    assert set(got.valid_time_ns.tolist()) == {WEEK * NS_PER_WEEK + MS * 1_000_000}
    ours = {
        (got["satellite"][i].decode(), got["signal"][i].decode()): (
            got["pseudorange_m"][i],
            got["carrier_phase_cycles"][i] if got.is_present("carrier_phase_cycles")[i] else 0.0,
            got["doppler_hz"][i],
        )
        for i in range(len(got))
    }
    assert set(theirs) <= set(ours) and len(theirs) >= 4
    ours = {key: tuple(np.nan_to_num(values)) for key, values in ours.items()}
    for key, values in theirs.items():
        assert ours[key] == pytest.approx(values), key
    assert got["glonass_channel"][got["satellite"] == b"R04"].tolist() == [5 - 7]
    assert not got.is_present("carrier_phase_cycles")[got["satellite"] == b"C21"].any()


def packed(prn: int, code: float, carrier: float, doppler: float, track: int) -> bytes:
    bits, at = 0, 0
    for value, width in (
        (round(doppler * 256) & 0xFFFFFFF, 28), (round(code * 128), 36),
        (round(carrier * 256) & 0xFFFFFFFF, 32), (2, 4), (1, 4), (prn, 8), (3200, 21), (25, 5),
        (0, 6), (0, 16),
    ):  # fmt: skip
        bits |= value << at
        at += width
    return struct.pack("<I", track) + bits.to_bytes(20, "little")


def test_packed_ranges_keep_their_turns() -> None:
    code, wave = 2.1e7, 299792458.0 / 1575.42e6
    carrier = -code / wave + 12.25
    cut = (carrier + 2.0**22) % 2.0**23 - 2.0**22
    body = struct.pack("<I", 1) + packed(5, code, cut, -250.5, status(0, 0))
    got = read(message(140, body))[OBS]
    assert got["pseudorange_m"][0] == code and got["doppler_hz"][0] == -250.5
    assert got["carrier_phase_cycles"][0] == pytest.approx(-carrier, abs=1 / 256)
    assert (got["lock_time_s"][0], got["cn0_dbhz"][0]) == (100.0, 45.0)
    assert got["pseudorange_std_m"][0] == pytest.approx(0.113)


def test_a_fix_with_its_velocity() -> None:
    place = struct.pack("<IIdddfIfff4sffBB6x", 0, 50, 51.1, -114.0, 1097.4, -17.0, 61, 0.02, 0.01,
                        0.03, b"", 0.5, 0.0, 20, 18)  # fmt: skip
    speed = struct.pack("<IIffdddf", 0, 50, 0.0, 0.0, 10.0, 30.0, 1.0, 0.0)
    got = read(message(42, place) + message(99, speed))[FIX]
    expected = pymap3d.geodetic2ecef(51.1, -114.0, 1080.4)
    assert got["position_ecef_m"][0] == pytest.approx(expected, abs=1e-4)
    expected = pymap3d.enu2ecefv(5.0, 10.0 * np.sqrt(0.75), 1.0, 51.1, -114.0)
    assert got["velocity_ecef_m_s"][0] == pytest.approx(expected, abs=1e-9)
    assert got["position_covariance_enu_m2"][0, [0, 3, 5]] == pytest.approx([1e-4, 4e-4, 9e-4])
    assert (got["quality"][0], got["satellite_count"][0]) == (6, 18)
    assert got["differential_age_s"][0] == 0.5


def test_raw_samples_need_their_scale() -> None:
    def sample(n: int) -> bytes:
        body = struct.pack("<IdI6i", WEEK, 10.0 + n / 100, 0, 981, 20, 30, -400, 500, 600)
        return short(325, body)

    data = b"".join(sample(n) for n in range(5))
    findings = Findings()
    assert IMU not in read(data, findings) and findings.losses.losses[0].count == 5
    got = read(data, gyro_scale_rad=1e-6, accel_scale_m_s=1e-4)[IMU]
    # z, -y, x: forward is y, right is x, down is minus z; increments of 0.01 s.
    assert got["angular_rate_body_rad_s"][0] == pytest.approx([-5e-2, 6e-2, 4e-2])
    assert got["specific_force_body_m_s2"][0] == pytest.approx([-0.2, 0.3, -9.81])


def test_samples_without_gravity_need_an_attitude() -> None:
    body = struct.pack("<Id6d", WEEK, 10.0, *[1e-6] * 6)
    later = struct.pack("<Id6d", WEEK, 10.008, *[1e-6] * 6)
    findings = Findings()
    assert IMU not in read(short(1362, body) + short(1362, later), findings)
    assert findings.losses.losses[0].count == 2


def test_damage_is_counted() -> None:
    whole = b"".join(short(1362, bytes(60)) for _ in range(3)) + message(101, bytes(4))
    broken = bytearray(whole)
    broken[90] ^= 1
    findings = Findings()
    read(bytes(broken), findings)
    assert "byte 76" in str(findings.losses.losses[0])
    assert any("101: 1" in note for note in findings.notes)


@pytest.fixture(scope="module")
def still(shared_data: Path) -> tuple[dict[str, Columns], Findings]:
    findings = Findings(strict=True)
    return read((shared_data / "raw" / "ins2.gps").read_bytes(), findings), findings


def test_a_vehicle_at_rest(still: tuple[dict[str, Columns], Findings]) -> None:
    got, findings = still
    imu, truth = got[IMU], got[TRUTH]
    assert (len(imu), len(truth)) == (766, 62)
    assert np.diff(imu.valid_time_ns) == pytest.approx(8e6, abs=1e4)
    force = np.linalg.norm(imu["specific_force_body_m_s2"], axis=1)
    assert force.mean() == pytest.approx(9.81, abs=0.01)
    assert np.abs(truth["velocity_enu_m_s"]).max() < 0.02
    assert np.ptp(truth["position_ecef_m"], axis=0).max() < 0.02
    assert any("gravity" in note for note in findings.notes)


def test_heading_follows_the_yaw_rate(still: tuple[dict[str, Columns], Findings]) -> None:
    """The filter's heading drifts while the vehicle stands: as its corrected rates say."""
    imu, truth = still[0][IMU], still[0][TRUTH]
    span = (truth.valid_time_ns[-1] - truth.valid_time_ns[0]) / 1e9
    turned = (truth["attitude_rad"][-1, 2] - truth["attitude_rad"][0, 2]) / span
    earth = -7.292115e-5 * np.sin(np.radians(51.15))  # about down, put back by the import
    rate = imu["angular_rate_body_rad_s"][:, 2].mean() - earth
    assert rate < 0.0 and turned < 0.0
    assert rate == pytest.approx(turned, abs=1e-4)


def test_inspvax_brings_deviations(still: tuple[dict[str, Columns], Findings]) -> None:
    truth = still[0][TRUTH]
    has = truth.is_present("position_std_enu_m")
    assert has.sum() == 6
    # Both messages tell one height, one above the geoid, the other above the ellipsoid.
    heights = pymap3d.ecef2geodetic(*truth["position_ecef_m"].T)[2]
    assert np.ptp(heights) < 0.01
