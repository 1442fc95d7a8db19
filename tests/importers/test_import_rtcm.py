"""RTCM 3: streams that RTKLIB wrote, read here, by RTKLIB and by pyrtcm."""

import io
import random

import numpy as np
import pytest

from replay.errors import ForeignFileError
from replay.gnss.ephemerides import ephemeris_records
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.frames import crc24q
from replay.importers.rtcm import read_rtcm
from replay.importers.rtcm_msm import lock_extended_s, lock_s
from replay.log.columns import Columns
from replay.time import NS_PER_S, parse_calendar

pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
pyrtcm = pytest.importorskip("pyrtcm")

OBS, NAV, RECEIVER, EPOCHS = "/gnss/x/obs", "/gnss/nav", "/gnss/x/receiver", "/gnss/x/epochs"
NOW = parse_calendar("2025-08-28T17:30:40")
SATELLITES = {
    "G": (pyrtklib.SYS_GPS, (5, 12, 31), ("1C", "2W")),
    "R": (pyrtklib.SYS_GLO, (3, 24), ("1C", "2C")),
    "E": (pyrtklib.SYS_GAL, (11, 30), ("1C", "7Q")),
    "C": (pyrtklib.SYS_CMP, (11, 21), ("2I", "7I")),
    "J": (pyrtklib.SYS_QZS, (193, 195), ("1C", "2L")),
}
MSM = {"G": 1070, "R": 1080, "E": 1090, "J": 1110, "C": 1120}
CHANNELS = {3: 5, 24: 2}


def read(data: bytes, findings: Findings | None = None, near: int | None = NOW) -> dict:
    file = File("x.rtcm3", data, "", len(data))
    return read_rtcm(file, findings or Findings(strict=True), receiver="x", approximate_ns=near)


def written(rtcm) -> bytes:
    return bytes(rtcm.buff[i] for i in range(rtcm.nbyte))


def gtime(ns: int):
    t = pyrtklib.gtime_t()
    t.time, t.sec = ns // NS_PER_S + 315_964_800, ns % NS_PER_S / 1e9
    return t


def new_rtcm():
    rtcm = pyrtklib.rtcm_t()
    pyrtklib.init_rtcm(rtcm)
    rtcm.time = gtime(NOW)
    return rtcm


def msm(letter: str, layer: int, seed: int) -> tuple[bytes, dict]:
    """A message of RTKLIB and the values that it was given."""
    rng, rtcm = random.Random(seed), new_rtcm()
    system, numbers, codes = SATELLITES[letter]
    given = {}
    for n, number in enumerate(numbers):
        one = rtcm.obs.data[n]
        one.sat, one.time = pyrtklib.satno(system, number), gtime(NOW)
        name = f"{letter}{number - 192 if letter == 'J' else number:02d}"
        base = rng.uniform(2.0e7, 2.6e7)
        speed = rng.uniform(-800.0, 800.0)
        if letter == "R":
            rtcm.nav.geph[number - 1].sat = one.sat
            rtcm.nav.geph[number - 1].frq = CHANNELS[number]
            rtcm.nav.glo_fcn[number - 1] = CHANNELS[number] + 8
        for k, code in enumerate(codes):
            one.code[k] = pyrtklib.obs2code(code)
            hertz = {"1C": 1575.42e6, "2W": 1227.6e6, "2L": 1227.6e6, "7Q": 1207.14e6,
                     "2I": 1561.098e6, "7I": 1207.14e6}.get(code, 0.0)  # fmt: skip
            if letter == "R":
                first, step = {"1C": (1602e6, 562.5e3), "2C": (1246e6, 437.5e3)}[code]
                hertz = first + CHANNELS[number] * step
            wave = 299792458.0 / hertz
            one.P[k] = base + rng.uniform(-20.0, 20.0)
            one.L[k] = (base + rng.uniform(-20.0, 20.0)) / wave
            one.D[k] = -speed / wave
            one.SNR[k] = round(45.0 / pyrtklib.SNR_UNIT) if hasattr(pyrtklib, "SNR_UNIT") else 45000
            given[name, code] = (one.P[k], one.L[k], one.D[k], wave)
    rtcm.obs.n = len(numbers)
    assert pyrtklib.gen_rtcm3(rtcm, MSM[letter] + layer, 0, 0) == 1
    return written(rtcm), given


@pytest.mark.parametrize("layer", [4, 5, 6, 7])
@pytest.mark.parametrize("letter", sorted(SATELLITES))
def test_measurements_are_those_that_were_written(letter: str, layer: int) -> None:
    data, given = msm(letter, layer, layer)
    findings = Findings()
    got = read(data, findings)[OBS]
    found = {(got["satellite"][i].decode(), got["signal"][i].decode()): i for i in range(len(got))}
    assert set(found) == set(given)
    assert set(got.valid_time_ns.tolist()) == {NOW}
    fine = layer >= 6
    for key, (code, carrier, doppler, wave) in given.items():
        i = found[key]
        # Half a step of the fine range: 2^-24 or 2^-29 ms of light.
        step = 299792.458 * 2.0 ** (-29 if fine else -24)
        assert got["pseudorange_m"][i] == pytest.approx(code, abs=0.51 * step)
        if letter == "R" and layer in (4, 6):
            assert not got.is_present("carrier_phase_cycles")[i]  # its channel is not told
            continue
        # RTKLIB takes whole cycles off the first phase, and keeps doing so.
        step = 299792.458 * 2.0 ** (-31 if fine else -29) / wave
        off = got["carrier_phase_cycles"][i] - carrier
        assert abs(off - round(off)) < 0.51 * step + 1e-6
        assert abs(off) * wave < 1500.0
        assert got.is_present("doppler_hz")[i] == (layer in (5, 7))
        if layer in (5, 7):
            assert got["doppler_hz"][i] == pytest.approx(doppler, abs=0.51e-4 / wave + 1e-9)
    assert bool(findings.losses) == (letter == "R" and layer in (4, 6))


@pytest.mark.parametrize("letter", ["G", "E", "C"])
def test_cells_are_those_of_pyrtcm(letter: str) -> None:
    data, _ = msm(letter, 7, 3)
    (_, message), *_ = list(pyrtcm.RTCMReader(io.BytesIO(data)))
    got = read(data)[OBS]
    assert message.NCell == len(got)
    rough = {
        getattr(message, f"PRN_{n:02d}"): getattr(message, f"DF397_{n:02d}")
        + getattr(message, f"DF398_{n:02d}")
        for n in range(1, message.NSat + 1)
    }
    for n in range(1, message.NCell + 1):
        prn = getattr(message, f"CELLPRN_{n:02d}")
        signal = getattr(message, f"CELLSIG_{n:02d}")
        here = (got["satellite"] == f"{letter}{int(prn):02d}".encode()) & (
            got["signal"] == signal.encode()
        )
        whole = rough[prn] + getattr(message, f"DF405_{n:02d}")
        assert got["pseudorange_m"][here] == pytest.approx(whole * 299792.458, abs=1e-6)
        assert got["cn0_dbhz"][here] == getattr(message, f"DF408_{n:02d}")


def test_lock_times() -> None:
    # RTCM 10403.3, tables 3.5-74 and 3.5-75.
    assert [lock_s(n) for n in (0, 1, 2, 15)] == [0.0, 0.032, 0.064, 524.288]
    table = {0: 0, 63: 63, 64: 64, 95: 126, 96: 128, 127: 252, 128: 256, 703: 65_011_712 + 0,
             704: 67_108_864}  # fmt: skip
    for indicator, ms in table.items():
        if indicator != 703:
            assert lock_extended_s(indicator) * 1e3 == pytest.approx(ms)


FIELDS = {
    "eccentricity": "e", "i0": "i0", "omega0": "OMG0", "omega": "omg", "m0": "M0",
    "delta_n": "deln", "omega_dot": "OMGd", "i_dot": "idot", "crc": "crc", "crs": "crs",
    "cuc": "cuc", "cus": "cus", "cic": "cic", "cis": "cis", "toe_s": "toes", "af0": "f0",
    "af1": "f1", "af2": "f2", "iode": "iode", "iodc": "iodc",
}  # fmt: skip


@pytest.mark.parametrize(
    ("number", "letter", "prn"),
    [(1019, "G", 7), (1042, "C", 21), (1044, "J", 194), (1045, "E", 11), (1046, "E", 11)],
)
def test_ephemerides_are_those_that_rtklib_reads(number: int, letter: str, prn: int) -> None:
    rng, rtcm = random.Random(number), new_rtcm()
    system = SATELLITES[letter][0]
    satellite = pyrtklib.satno(system, prn)
    eph = rtcm.nav.eph[satellite - 1 + (pyrtklib.MAXSAT if number == 1045 else 0)]
    rtcm.ephsat, rtcm.ephset = satellite, int(number == 1045)
    eph.sat, eph.week = satellite, 2381 - (1356 if letter == "C" else 0)
    behind = 14 if letter == "C" else 0
    eph.toes = 410_400.0
    eph.toe = eph.toc = gtime((2381 * 604_800 + 410_400 + behind) * NS_PER_S)
    eph.A, eph.e = rng.uniform(2.6e7, 2.9e7), rng.uniform(0.0, 0.02)
    for name, size in (("i0", 1.0), ("OMG0", 3.0), ("omg", 3.0), ("M0", 3.0), ("deln", 4e-9),
                       ("OMGd", 8e-9), ("idot", 4e-10), ("crc", 300.0), ("crs", 300.0),
                       ("cuc", 1e-5), ("cus", 1e-5), ("cic", 1e-7), ("cis", 1e-7),
                       ("f0", 4e-4), ("f1", 1e-11)):  # fmt: skip
        setattr(eph, name, rng.uniform(-size, size))
    eph.iode, eph.iodc, eph.sva, eph.svh = (17, 17, 1, 0)
    eph.tgd[0], eph.tgd[1] = 4e-9, -3e-9
    eph.code = 0
    assert pyrtklib.gen_rtcm3(rtcm, number, 0, 0) == 1
    data = written(rtcm)

    other = new_rtcm()
    states = [s for byte in data if (s := pyrtklib.input_rtcm3(other, byte))]
    assert states == [2]
    theirs = other.nav.eph[satellite - 1 + (pyrtklib.MAXSAT if number == 1045 else 0)]
    record = ephemeris_records(read(data)[NAV])[0]
    assert record["prn"] == (prn - 192 if letter == "J" else prn)
    for name, field in FIELDS.items():
        if letter == "E" and name == "iodc":
            continue
        expected = getattr(theirs, field)
        assert record[name] == pytest.approx(expected, rel=1e-13, abs=1e-30), name
    assert record["sqrt_a"] ** 2 == pytest.approx(theirs.A, rel=1e-14)
    assert record["group_delay_1_s"] == pytest.approx(theirs.tgd[0], rel=1e-13)
    assert record["toe_ns"] == (2381 * 604_800 + 410_400 + behind) * NS_PER_S
    assert record["toc_ns"] == record["toe_ns"]


def test_glonass_ephemeris_and_its_channel() -> None:
    rtcm = new_rtcm()
    satellite = pyrtklib.satno(pyrtklib.SYS_GLO, 3)
    geph = rtcm.nav.geph[2]
    rtcm.ephsat = satellite
    geph.sat, geph.frq, geph.iode, geph.svh = satellite, 5, 82, 0
    # Interval 82 is 20:30 in Moscow, 17:30 of UTC.
    geph.toe = geph.tof = gtime(parse_calendar("2025-08-28T17:30:18"))
    for k in range(3):
        geph.pos[k], geph.vel[k], geph.acc[k] = 1.1e7 * (k - 1), 1e3 * (k + 0.5), 1e-6 * (k - 1)
    geph.taun, geph.gamn = 1e-5, 1e-12
    assert pyrtklib.gen_rtcm3(rtcm, 1020, 0, 0) == 1
    data = written(rtcm)
    found = read(data + msm("R", 4, 1)[0], Findings())
    record = ephemeris_records(found[NAV])[0]
    assert record["position_m"] == pytest.approx([-1.1e7, 0.0, 1.1e7], abs=0.5)
    assert record["velocity_m_s"] == pytest.approx([500.0, 1500.0, 2500.0], abs=1e-3)
    assert record["acceleration_m_s2"] == pytest.approx([-1e-6, 0.0, 1e-6], abs=1e-6)
    assert record["af0"] == pytest.approx(-1e-5, abs=1e-9)
    assert (record["frequency_channel"], record["iode"]) == (5, 82)
    assert record["toe_ns"] == parse_calendar("2025-08-28T17:30:18")
    obs = found[OBS]
    known = obs["satellite"] == b"R03"
    assert obs.is_present("carrier_phase_cycles").tolist() == known.tolist()


def frame(payload: bytes) -> bytes:
    head = b"\xd3" + len(payload).to_bytes(2, "big") + payload
    return head + crc24q(head).to_bytes(3, "big")


def test_station_position() -> None:
    rtcm = new_rtcm()
    for k, value in enumerate((3582105.2910, -532589.7313, 5232754.8054)):
        rtcm.sta.pos[k] = value
    assert pyrtklib.gen_rtcm3(rtcm, 1006, 0, 0) == 1
    data = written(rtcm)
    got = read(data + data)[RECEIVER]
    assert len(got) == 1
    expected = (3582105.2910, -532589.7313, 5232754.8054)
    assert got["approximate_position_ecef_m"][0] == pytest.approx(expected, abs=0.51e-4)


def test_the_date_is_needed_and_has_to_fit() -> None:
    data, _ = msm("G", 7, 1)
    with pytest.raises(ForeignFileError, match="week") as caught:
        read(data, near=None)
    assert "approximate_time" in caught.value.mend
    # Half a week less a minute off on either side.
    for shift in (-1, 1):
        near = NOW + shift * (302_400 - 60) * NS_PER_S
        assert set(read(data, near=near)[OBS].valid_time_ns.tolist()) == {NOW}


def test_damage_is_counted_with_its_place() -> None:
    data, _ = msm("G", 7, 1)
    whole = data + frame(b"\x4c\xe0" + bytes(4)) + data
    rng = random.Random(2)
    for _ in range(30):
        broken = bytearray(whole)
        broken[rng.randrange(3, len(data))] ^= 1 << rng.randrange(8)
        findings = Findings()
        assert len(read(bytes(broken), findings)[OBS]) == 6
        assert "byte 0" in str(findings.losses.losses[0])
        assert findings.losses.exit_code == 3
    findings = Findings()
    read(whole[: len(data) + 20], findings)
    assert any("ends inside a frame" in str(loss) for loss in findings.losses.losses)


def test_messages_that_are_not_read_are_counted() -> None:
    findings = Findings(strict=True)
    payload = (1230 << 4).to_bytes(2, "big") + bytes(4)
    read(frame(payload) * 2 + msm("G", 7, 1)[0], findings)
    assert "1230: 2" in findings.notes[0]


def test_epochs_count_satellites() -> None:
    got: Columns = read(msm("G", 7, 1)[0] + msm("E", 7, 1)[0])[EPOCHS]
    assert got["satellite_count"].tolist() == [5]
    assert np.all(got.valid_time_ns == NOW)
