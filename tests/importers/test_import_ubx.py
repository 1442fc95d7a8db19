"""UBX: frames built here, real recordings against pyubx2 and RTKLIB, and physics."""

import gzip
import io
import itertools
import struct
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from replay.errors import ForeignFileError
from replay.gnss.ephemerides import ephemeris_records
from replay.gnss.signals import frequency_hz, wavelength_m
from replay.importers import import_log
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.frames import NMEA, UBX, find_frames
from replay.importers.ubx import read_ubx
from replay.importers.ubx_rawx import LETTERS, SIGNALS
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S, keplerian
from replay.log.columns import Columns
from replay.time import NS_PER_S, NS_PER_WEEK

pyubx2 = pytest.importorskip("pyubx2")

OBS, FIX, EPOCHS, NAV = "/gnss/x/obs", "/gnss/x/fix", "/gnss/x/epochs", "/gnss/nav"


def file_of(data: bytes) -> File:
    return File("x.ubx", data, "", len(data))


def frame(kind: int, number: int, payload: bytes) -> bytes:
    body = struct.pack("<BBH", kind, number, len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 255
        b = (b + a) & 255
    return b"\xb5\x62" + body + bytes((a, b))


def rawx(tow: float, *rows: bytes, state: int = 1) -> bytes:
    head = struct.pack("<dHbBBBxx", tow, 2381, 18, len(rows), state, 1)
    return frame(0x02, 0x15, head + b"".join(rows))


def row(
    system: int = 0, satellite: int = 5, signal: int = 0, lock_ms: int = 1000, tracking: int = 7,
    frequency: int = 0, code: float = 2.1e7,
) -> bytes:  # fmt: skip
    return struct.pack(
        "<ddfBBBBHBBBBBx", code, 1.1e8, -250.5, system, satellite, signal, frequency, lock_ms,
        44, 5, 3, 6, tracking,
    )  # fmt: skip


def read(data: bytes, findings: Findings | None = None) -> dict[str, Columns]:
    return read_ubx(file_of(data), findings or Findings(strict=True), receiver="x")


def test_a_measurement() -> None:
    got = read(rawx(408_639.998, row(system=6, satellite=3, frequency=4)))[OBS]
    assert got.valid_time_ns[0] == 2381 * NS_PER_WEEK + 408_639_998_000_000
    assert (got["satellite"][0], got["signal"][0]) == (b"R03", b"1C")
    assert got["glonass_channel"][0] == -3
    assert (got["pseudorange_m"][0], got["carrier_phase_cycles"][0]) == (2.1e7, 1.1e8)
    assert (got["doppler_hz"][0], got["cn0_dbhz"][0], got["lock_time_s"][0]) == (-250.5, 44, 1)
    # Interface description: 0.01 m times 2^5, 0.004 cycle times 3, 0.002 Hz times 2^6.
    assert got["pseudorange_std_m"][0] == pytest.approx(0.32)
    assert got["carrier_phase_std_cycles"][0] == pytest.approx(0.012)
    assert got["doppler_std_hz"][0] == pytest.approx(0.128)


def test_what_is_not_valid_is_absent() -> None:
    got = read(rawx(1.0, row(satellite=1, tracking=1), row(satellite=2, tracking=2 + 4)))[OBS]
    assert got.is_present("pseudorange_m").tolist() == [True, False]
    assert got.is_present("carrier_phase_cycles").tolist() == [False, True]
    assert got.is_present("loss_of_lock").tolist() == [False, True]
    assert got.is_present("carrier_phase_std_cycles").tolist() == [False, True]


@pytest.mark.parametrize(
    ("locks", "tracking", "expected"),
    [
        ((1000, 2000, 3000), (7, 7, 7), [0, 0, 0]),
        ((1000, 400, 1400), (7, 7, 7), [0, 1, 0]),  # it fell
        ((0, 1000, 2000), (7, 7, 7), [1, 0, 0]),  # it has only begun
        ((200, 900, 1900), (7, 7, 7), [0, 1, 0]),  # it is shorter than what has passed
        ((64_500, 64_500, 64_500), (7, 7, 7), [0, 0, 0]),  # its largest value
        ((1000, 2000, 3000), (3, 7, 15), [2, 0, 1]),  # half cycle unknown, known, taken off
    ],
)
def test_loss_of_lock(locks: tuple[int, ...], tracking: tuple[int, ...], expected: list) -> None:
    data = b"".join(
        rawx(100.0 + n, row(lock_ms=lock, tracking=state))
        for n, (lock, state) in enumerate(zip(locks, tracking, strict=True))
    )
    assert read(data)[OBS]["loss_of_lock"].tolist() == expected


def test_epochs_and_clock_resets() -> None:
    data = rawx(1.0, row(), row(signal=3), row(satellite=6)) + rawx(2.0, state=1 | 2)
    got = read(data)[EPOCHS]
    assert got["satellite_count"].tolist() == [2, 0] and got["flag"].tolist() == [0, 1]


def test_unknown_satellites_are_counted() -> None:
    findings = Findings()
    data = rawx(1.0, row(), row(system=6, satellite=255), row(signal=99))
    assert len(read(data, findings)[OBS]) == 1
    assert [loss.count for loss in findings.losses.losses] == [1, 1]
    assert "gnssId 0 sigId 99" in str(findings.losses.losses[1])


def test_damage_is_counted_with_its_place() -> None:
    one = rawx(1.0, row())
    whole = b"".join(rawx(float(n), row()) for n in range(5))
    for at in range(len(one), 2 * len(one)):
        broken = bytearray(whole)
        broken[at] ^= 0x10
        findings = Findings()
        got = read(bytes(broken), findings)[OBS]
        times = (got.valid_time_ns % NS_PER_WEEK // NS_PER_S).tolist()
        assert times == [0, 2, 3, 4]
        assert findings.losses.exit_code == 3
        assert str(len(one)) in findings.losses.losses[0].where
    with pytest.raises(ForeignFileError, match="check"):
        broken = bytearray(whole)
        broken[-1] ^= 1
        read(bytes(broken))


def test_truncation_keeps_whole_frames() -> None:
    one = rawx(1.0, row())
    whole = b"".join(rawx(float(n), row()) for n in range(3))
    for cut in range(len(one), len(whole)):
        findings = Findings()
        assert len(read(whole[:cut], findings)[OBS]) == cut // len(one)
        assert bool(findings.losses) == bool(cut % len(one))
        if findings.losses and cut % len(one) > 1:
            assert f"byte {cut // len(one) * len(one)}" in str(findings.losses.losses[0])


def test_strays_and_other_protocols() -> None:
    findings = Findings()
    nmea = b"$GNTXT,01,01,01,NMEA unknown msg*46\r\n"
    got = read(b"header" + rawx(1.0, row()) + nmea + b"??" + rawx(2.0, row()), findings)
    assert len(got[OBS]) == 2
    (loss,) = findings.losses.losses
    assert (loss.count, loss.where) == (8, "x.ubx, from byte 0")
    assert any("1 NMEA frames" in note for note in findings.notes)


def test_messages_that_are_not_read_are_counted() -> None:
    findings = Findings(strict=True)
    read(rawx(1.0, row()) + frame(0x0D, 0x03, bytes(28)) * 2 + frame(0x77, 0x01, b""), findings)
    (note,) = findings.notes
    assert "TIM-TM2 (time marks): 2" in note and "77 01: 1" in note


def test_foreign_bytes_are_refused() -> None:
    with pytest.raises(ForeignFileError, match="no UBX frame"):
        read(b"no frame at all", Findings())


def test_subframes_without_any_time_are_a_loss() -> None:
    findings = Findings()
    words = struct.pack("<BBBBBBBB10I", 0, 10, 0, 0, 10, 0, 2, 0, *range(10))
    assert read(frame(0x02, 0x13, words), findings) == {}
    assert findings.losses.losses[0].count == 1


def pvt(flags: int, fix: int = 3, valid: int = 7) -> bytes:
    return frame(
        0x01, 0x07,
        struct.pack(
            "<IHBBBBBBIiBBBBiiiiIIiiiiiIIHHxxxxihH", 408_639_750, 2025, 8, 28, 17, 30, 21, valid,
            20, 749_542_955, fix, flags, 0, 25, -1_051_471_665, 400_966_916, 1_580_048, 1_601_435,
            14, 10, 1000, 2000, -3000, 0, 0, 70, 0, 90, 0, 0, 0, 0,
        ),
    )  # fmt: skip


def test_a_fix() -> None:
    got = read(pvt(1 | 2 | 2 << 6))[FIX]
    # 17:30:21.749542955 of UTC, 18 leap seconds.
    day = 2381 * NS_PER_WEEK + 4 * 86_400 * NS_PER_S
    assert got.valid_time_ns[0] == day + 63_039_749_542_955
    expected = pymap3d.geodetic2ecef(40.0966916, -105.1471665, 1580.048)
    assert got["position_ecef_m"][0] == pytest.approx(expected, abs=1e-6)
    expected = pymap3d.enu2ecefv(2.0, 1.0, 3.0, 40.0966916, -105.1471665)
    assert got["velocity_ecef_m_s"][0] == pytest.approx(expected, abs=1e-9)
    xx, _, _, yy, _, zz = got["position_covariance_enu_m2"][0]
    assert xx + yy == pytest.approx(0.014**2) and zz == pytest.approx(0.010**2)
    assert got["quality"][0] == 6 and got["satellite_count"][0] == 25


@pytest.mark.parametrize(
    ("flags", "fix", "quality"), [(1, 3, 1), (3, 3, 2), (1 | 1 << 6, 3, 5), (1, 4, 7), (1, 1, 7)]
)
def test_qualities(flags: int, fix: int, quality: int) -> None:
    assert read(pvt(flags, fix))[FIX]["quality"][0] == quality


def test_no_fix_is_no_row() -> None:
    findings = Findings(strict=True)
    assert read(pvt(0) + pvt(1, fix=0) + pvt(1, fix=5) + pvt(1, valid=0), findings) == {}
    assert "4 NAV-PVT" in findings.notes[0]


def test_a_finer_position_takes_its_place() -> None:
    fine = struct.pack(
        "<BxxBIiiiibbbbII", 0, 0, 408_639_750, -1_051_471_665, 400_966_916, 1_580_048, 0, 12, -34,
        -5, 0, 141, 103,
    )  # fmt: skip
    got = read(pvt(1) + frame(0x01, 0x14, fine))[FIX]
    lat, lon, height = 40.0966916 - 34e-9, -105.1471665 + 12e-9, 1580.048 - 5e-4
    expected = pymap3d.geodetic2ecef(lat, lon, height)
    assert got["position_ecef_m"][0] == pytest.approx(expected, abs=1e-6)
    assert got["position_covariance_enu_m2"][0, 5] == pytest.approx(0.0103**2)


@pytest.fixture(scope="module")
def walk(shared_data: Path) -> bytes:
    return (shared_data / "boulder-walk-2024-240" / "gnss_1730.ubx").read_bytes()


@pytest.fixture(scope="module")
def walked(walk: bytes) -> dict[str, Columns]:
    return read(walk)


def test_frames_are_those_of_pyubx2(walk: bytes, shared_data: Path) -> None:
    log = gzip.decompress((shared_data / "raw" / "ublox-zed-f9p_hpg1.11.log.gz").read_bytes())
    for data in (walk, log):
        part = data[:200_000]
        found = find_frames(part, UBX)
        reader = pyubx2.UBXReader(io.BytesIO(part), protfilter=3, parsing=False, quitonerror=0)
        theirs = [raw for raw, _ in reader]
        ours = [
            part[at : at + n]
            for at, n, kind in zip(found.offsets, found.lengths, found.kinds, strict=True)
            if kind in (UBX, NMEA)
        ]
        assert ours == theirs and len(ours) > 500


def test_measurements_are_those_of_pyubx2(walk: bytes, walked: dict[str, Columns]) -> None:
    rows = {}
    got = walked[OBS]
    for i in range(2000):
        key = (int(got.valid_time_ns[i]), got["satellite"][i], got["signal"][i])
        rows[key] = i
    seen = 0
    for _, message in pyubx2.UBXReader(io.BytesIO(walk[:60_000]), protfilter=2):
        if message.identity != "RXM-RAWX":
            continue
        moment = message.week * NS_PER_WEEK + round(message.rcvTow * 1e9)
        for n in range(1, message.numMeas + 1):
            one = {
                name: getattr(message, f"{name}_{n:02d}")
                for name in ("prMes", "cpMes", "doMes", "svId", "locktime", "cno", "cpValid")
            }
            ids = message.payload[16 + 32 * (n - 1) + 20 : 16 + 32 * (n - 1) + 23]
            number = one["svId"] - 100 if ids[0] == 1 else one["svId"]
            satellite = f"{LETTERS[ids[0]]}{number:02d}".encode()
            i = rows[moment, satellite, SIGNALS[ids[0], ids[2]].encode()]
            assert got["pseudorange_m"][i] == one["prMes"]
            assert got["doppler_hz"][i] == np.float32(one["doMes"])
            assert got["lock_time_s"][i] == pytest.approx(one["locktime"] / 1e3)
            assert got["cn0_dbhz"][i] == one["cno"]
            present = got.is_present("carrier_phase_cycles")[i]
            assert present == bool(one["cpValid"])
            if present:
                assert got["carrier_phase_cycles"][i] == one["cpMes"]
            seen += 1
    assert seen > 500


def test_ranges_phases_and_dopplers_move_together(walked: dict[str, Columns]) -> None:
    """The phase in metres follows the pseudorange, and minus the Doppler is its rate."""
    got = walked[OBS]
    keys = np.char.add(got["satellite"], got["signal"])
    checked = 0
    for key in np.unique(keys):
        i = np.flatnonzero(keys == key)
        i = i[got.is_present("carrier_phase_cycles")[i] & got.is_present("pseudorange_m")[i]]
        letter, band = chr(key[0]), int(chr(key[3]))
        if len(i) < 100 or letter == "S":
            continue
        near = (np.diff(got.valid_time_ns[i]) == 250_000_000) & (got["loss_of_lock"][i][1:] == 0)
        step = np.diff(got["carrier_phase_cycles"][i])[near]
        doppler = 0.5 * (got["doppler_hz"][i][1:] + got["doppler_hz"][i][:-1])[near]
        assert np.median(np.abs(step / 0.25 + doppler)) < 1.0, key
        # Code noise telescopes away; what is left is multipath and ionosphere, under 1 m/s.
        # A wavelength of another band would be off by 5 % of up to 800 m/s.
        length = wavelength_m(letter, band)
        code = np.diff(got["pseudorange_m"][i])[near]
        assert abs(np.mean(code - step * length)) < 1.0 * 0.25, key
        checked += 1
    assert checked > 40


def test_ephemerides_are_those_of_rtklib(walk: bytes, walked: dict[str, Columns]) -> None:
    pyrtklib = pytest.importorskip("pyrtklib")
    raw = pyrtklib.raw_t()
    pyrtklib.init_raw(raw, pyrtklib.STRFMT_UBX)
    theirs = {}
    for byte in walk:
        if pyrtklib.input_ubx(raw, byte) == 2:
            number = pyrtklib.Arr1Dint(1)
            system = pyrtklib.satsys(raw.ephsat, number)
            letter = {pyrtklib.SYS_GPS: "G", pyrtklib.SYS_CMP: "C"}[system]
            e = raw.nav.eph[raw.ephsat - 1]
            theirs[f"{letter}{number[0]:02d}"] = (
                e.toes, e.A, e.e, e.i0, e.OMG0, e.omg, e.M0, e.deln, e.OMGd, e.idot, e.crc, e.crs,
                e.cuc, e.cus, e.cic, e.cis, e.f0, e.f1, e.tgd[0], e.iode, e.svh,
            )  # fmt: skip
    # This RTKLIB does not read the Galileo pages of this receiver.
    assert sorted(theirs) == ["C11", "C21", "C22", "C34", "C42", "C43", "C44", "C50", "G10",
                              "G23", "G27", "G32"]  # fmt: skip
    for record in ephemeris_records(walked[NAV]):
        name = f"{chr(record['system'])}{record['prn']:02d}"
        if name[0] == "E":
            continue
        ours = [record["toe_s"], record["sqrt_a"] ** 2] + [
            record[field]
            for field in (
                "eccentricity", "i0", "omega0", "omega", "m0", "delta_n", "omega_dot", "i_dot",
                "crc", "crs", "cuc", "cus", "cic", "cis", "af0", "af1", "group_delay_1_s", "iode",
                "health",
            )
        ]  # fmt: skip
        assert ours == pytest.approx(list(theirs[name]), rel=1e-14, abs=0.0), name


def test_two_issues_of_an_orbit_agree(walked: dict[str, Columns]) -> None:
    """Issues 44 and 45 of Galileo, ten minutes apart, give one place within a metre."""
    records = ephemeris_records(walked[NAV])
    checked = 0
    for prn in np.unique(records["prn"][records["system"] == ord("E")]):
        mine = records[(records["system"] == ord("E")) & (records["prn"] == prn)]
        for one, two in itertools.pairwise(mine):
            places = []
            for record in (one, two):
                out = np.zeros(6)
                tk = (1_440_437_500_000_000_000 - int(record["toe_ns"])) / 1e9
                keplerian(record, tk, out)
                places.append(out[:3])
            distance = np.linalg.norm(places[0] - places[1])
            assert distance < 1.0, prn
            checked += one["iode"] != two["iode"]
    assert checked >= 4


def test_galileo_alone_finds_the_receiver(walked: dict[str, Columns]) -> None:
    """Ionosphere-free E1 and E5a with the F/NAV clocks, against the RTK position."""
    observed, fixes = walked[OBS], walked[FIX]
    records = ephemeris_records(walked[NAV])
    records = records[(records["source"] == 258) & (records["health"] == 0)]
    epoch = int(np.unique(observed.valid_time_ns)[300])
    truth = fixes["position_ecef_m"][np.argmin(np.abs(fixes.valid_time_ns - epoch))]
    f1, f5 = frequency_hz("E", 1), frequency_hz("E", 5)
    places, ranges = [], []
    for record in records[::-1]:
        name = f"E{record['prn']:02d}".encode()
        here = (observed.valid_time_ns == epoch) & (observed["satellite"] == name)
        one = observed["pseudorange_m"][here & (observed["signal"] == b"1C")]
        five = observed["pseudorange_m"][here & (observed["signal"] == b"5Q")]
        if not len(one) or not len(five) or name in [p[0] for p in places]:
            continue
        free = float((f1**2 * one[0] - f5**2 * five[0]) / (f1**2 - f5**2))
        # Received by the receiver's clock less the pseudorange is sent by the satellite's.
        out = np.zeros(6)
        tk = (epoch - int(record["toe_ns"])) / 1e9 - free / SPEED_OF_LIGHT_M_S
        clock = record["af0"] + record["af1"] * (tk + (record["toe_ns"] - record["toc_ns"]) / 1e9)
        keplerian(record, tk - clock, out)
        clock -= 2.0 * (out[:3] @ out[3:]) / SPEED_OF_LIGHT_M_S**2
        places.append((name, out[:3]))
        ranges.append(free + SPEED_OF_LIGHT_M_S * clock)
    assert len(places) >= 6
    state = np.array([0.0, 0.0, 6.4e6, 0.0])
    for _ in range(12):
        turns = [
            7.2921151467e-5 * np.linalg.norm(place - state[:3]) / SPEED_OF_LIGHT_M_S
            for _, place in places
        ]
        lines = np.array(
            [
                [np.cos(a) * x + np.sin(a) * y, np.cos(a) * y - np.sin(a) * x, z] - state[:3]
                for a, (_, (x, y, z)) in zip(turns, places, strict=True)
            ]
        )
        distance = np.linalg.norm(lines, axis=1)
        up = state[:3] / np.linalg.norm(state[:3])
        sine = np.maximum(lines @ up / distance, 0.1)
        matrix = np.column_stack([-lines / distance[:, None], np.ones(len(lines))])
        missing = np.array(ranges) - distance - state[3] - 2.0 / sine  # zenith delay at 1580 m
        state += np.linalg.lstsq(matrix, missing, rcond=None)[0]
    # A metre of multipath on a walker's antenna is 2.6 m without the ionosphere, and the six
    # satellites dilute it by three; a wrong bit of an orbit would be kilometres.
    assert np.abs(missing).max() < 2.6 * 2.0
    assert np.linalg.norm(state[:3] - truth) < 3.0 * 2.6 * 2.0
    # The receiver tells its clock's offset: NAV-PVT has the time of the same epoch.
    told = epoch - int(fixes.valid_time_ns[np.argmin(np.abs(fixes.valid_time_ns - epoch))])
    assert state[3] / SPEED_OF_LIGHT_M_S * 1e9 == pytest.approx(told, abs=100.0)


def test_the_walk_imports_as_its_spec_says(shared_data: Path, tmp_path: Path) -> None:
    name = "boulder-walk-2024-240"
    spec = Path(__file__).parents[2] / "recordings" / "specs" / f"{name}.toml"
    result = import_log(spec, shared_data / name, tmp_path / "walk.mcap")
    assert result.mismatches == ()
    # The inertial file begins and ends within a line: that is the only loss.
    assert [(loss.count, loss.unit) for loss in result.losses.losses] == [(2, "rows")]
    assert result.rows["/gnss/rover/obs"] == 37_850
    assert result.rows["/gnss/rover/fix"] == result.rows["/truth"] == 536
