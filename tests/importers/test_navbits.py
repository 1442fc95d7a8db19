"""Navigation messages bit by bit: random ones against RTKLIB's decoders."""

import random

import numpy as np
import pytest

from replay.importers import navbits_beidou, navbits_galileo, navbits_glonass, navbits_gps
from replay.importers.frames import crc24q
from replay.importers.navbits import Bits

pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")

S = 1_000_000_000
WEEK_S = 604_800
SEEDS = range(5)
# A Thursday of August 2025: GPS week 2381.
NOW = (2381 * WEEK_S + 408_600) * S
KEPLER = {
    "sqrt_a": None, "eccentricity": "e", "i0": "i0", "omega0": "OMG0", "omega": "omg", "m0": "M0",
    "delta_n": "deln", "omega_dot": "OMGd", "i_dot": "idot", "crc": "crc", "crs": "crs",
    "cuc": "cuc", "cus": "cus", "cic": "cic", "cis": "cis", "toe_s": "toes", "af0": "f0",
    "af1": "f1", "af2": "f2", "iode": "iode", "iodc": "iodc", "health": "svh",
}  # fmt: skip


class Writer:
    """Fields of a message, one after the other; random where no value is given."""

    def __init__(self, rng: random.Random) -> None:
        self.rng, self.value, self.length = rng, 0, 0

    def put(self, width: int, value: int | None = None) -> "Writer":
        value = self.rng.getrandbits(width) if value is None else value
        assert 0 <= value < 1 << width
        self.value, self.length = self.value << width | value, self.length + width
        return self


def c_bytes(data: bytes, size: int = 0):
    out = getattr(pyrtklib, "Arr1Dunsigned char")(max(size, len(data)))
    for i, byte in enumerate(data):
        out[i] = byte
    return out


def doubles(n: int):
    out = pyrtklib.Arr1Ddouble(n)
    for i in range(n):
        out[i] = 0.0
    return out


def check_kepler(record: np.void, eph, *, without: tuple[str, ...] = ()) -> None:
    for name, theirs in KEPLER.items():
        if name in without:
            continue
        expected = np.sqrt(eph.A) if theirs is None else getattr(eph, theirs)
        assert record[name] == pytest.approx(expected, rel=1e-14, abs=0.0), name
    assert record["toe_ns"] == gps_ns(eph.toe)
    assert record["toc_ns"] == gps_ns(eph.toc)


def gps_ns(t) -> int:
    return (t.time - 315_964_800) * S + round(t.sec * 1e9)


def pack(bits: int, length: int, size: int) -> bytes:
    """Bits from the first byte's top on."""
    return (bits << (8 * size - length)).to_bytes(size, "big")


def lnav_subframes(rng: random.Random) -> list[Bits]:
    tow, issue = 408_600 // 6, rng.getrandbits(8)
    toe, top = 410_400 // 16, rng.getrandbits(2)
    found = []
    for number in (1, 2, 3):
        w = Writer(rng).put(8, 0x8B).put(16).put(17, tow + number).put(2).put(3, number).put(2)
        if number == 1:
            w.put(10, 2381 % 1024).put(2).put(4, rng.randrange(15)).put(6).put(2, top).put(1)
            w.put(23 + 24 + 24 + 16).put(8).put(8, issue).put(16, toe).put(8).put(16).put(22).put(2)
        elif number == 2:
            w.put(8, issue).put(16).put(16).put(32).put(16).put(32).put(16).put(32).put(16, toe)
            w.put(1).put(5).put(2)
        else:
            w.put(16).put(32).put(16).put(32).put(16).put(32).put(24).put(8, issue).put(14).put(2)
        assert w.length == 240
        found.append(Bits(w.value, 240))
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_lnav_agrees_with_rtklib(seed: int) -> None:
    subframes = lnav_subframes(random.Random(seed))
    assembler, record = navbits_gps.LnavAssembler("G"), None
    for bits in subframes:
        record, ionosphere = assembler.add(7, Bits(bits.value, 240), NOW)
        assert ionosphere is None
    assert record is not None and record["prn"] == 7
    buffer = c_bytes(b"".join(bits.value.to_bytes(30, "big") for bits in subframes), 150)
    # RTKLIB takes the 1024 weeks from the computer's clock: its week is not compared.
    eph = pyrtklib.eph_t()
    pyrtklib.decode_frame(buffer, eph, pyrtklib.alm_t(), doubles(8), doubles(8))
    for name, theirs in KEPLER.items():
        expected = np.sqrt(eph.A) if theirs is None else getattr(eph, theirs)
        assert record[name] == pytest.approx(expected, rel=1e-14, abs=0.0), name
    assert record["group_delay_1_s"] == eph.tgd[0]
    assert record["toe_ns"] == record["toc_ns"] == (2381 * WEEK_S + 410_400) * S
    # The count in a subframe is of the next one's start.
    assert record["transmitted_ns"] == NOW


def test_lnav_waits_for_one_issue() -> None:
    old, new = lnav_subframes(random.Random(1)), lnav_subframes(random.Random(2))
    assembler = navbits_gps.LnavAssembler("G")
    for bits in (old[0], old[1], new[2]):
        record, _ = assembler.add(7, bits, NOW)
        assert record is None
    assert assembler.add(7, new[0], NOW)[0] is None
    assert assembler.add(7, new[1], NOW)[0] is not None


def test_klobuchar_of_page_18() -> None:
    rng = random.Random(3)
    w = Writer(rng).put(24).put(17, 408_600 // 6 + 4).put(2).put(3, 4).put(2)
    w.put(2, 1).put(6, 56).put(64).put(120)
    bits = Bits(w.value, 240)
    record, ionosphere = navbits_gps.LnavAssembler("G").add(7, bits, NOW)
    assert record is None and ionosphere is not None
    numbers = np.frombuffer((w.value >> 120 & (1 << 64) - 1).to_bytes(8, "big"), dtype=np.int8)
    scales = [2.0**-30, 2.0**-27, 2.0**-24, 2.0**-24, 2.0**11, 2.0**14, 2.0**16, 2.0**16]
    assert ionosphere.coefficients == tuple(numbers * scales)


def test_lnav_parity() -> None:
    # Two subframes' first words that a receiver gave: preamble, telemetry, time.
    words = [0b00100010110000010100110100011100, 0b00100001010000010110101010101100]
    assert navbits_gps._agree(words, turned=True)
    for bit in range(30):
        broken = [words[0] ^ 1 << bit, words[1]]
        assert not navbits_gps._agree(broken, turned=True)
        assert not navbits_gps._agree(broken, turned=False)


def galileo_words(rng: random.Random) -> list[Bits]:
    issue, toe = rng.getrandbits(10), 407_400 // 60
    found = []
    for number in range(1, 6):
        w = Writer(rng).put(6, number)
        if number < 5:
            w.put(10, issue)
        if number == 1:
            w.put(14, toe).put(32).put(32).put(32).put(2)
        elif number == 2:
            w.put(32).put(32).put(32).put(14).put(2)
        elif number == 3:
            w.put(24).put(16).put(16).put(16).put(16).put(16).put(8)
        elif number == 4:
            w.put(6, 11).put(16).put(16).put(14, toe).put(31).put(21).put(6).put(2)
        else:
            w.put(11).put(11).put(14).put(5).put(10).put(10).put(2).put(2).put(1).put(1)
            w.put(12, 2381 - 1024).put(20, 408_610).put(23)
        assert w.length == 128
        found.append(Bits(w.value, 128))
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_inav_agrees_with_rtklib(seed: int) -> None:
    words = galileo_words(random.Random(seed))
    assembler, record = navbits_galileo.InavAssembler(), None
    for word in words:
        record, _ = assembler.add(11, Bits(word.value, 128), NOW)
    assert record is not None
    # Word 0, which tells the time, before the five.
    zero = Writer(random.Random(0)).put(6, 0).put(2, 2).put(88).put(12, 2381 - 1024)
    zero.put(20, 408_610)
    data = b"".join(v.to_bytes(16, "big") for v in (zero.value, *(w.value for w in words)))
    eph = pyrtklib.eph_t()
    pyrtklib.decode_gal_inav(c_bytes(data, 16 * 7), eph, doubles(4), doubles(8))
    check_kepler(record, eph)
    for k in (0, 1):
        assert record[f"group_delay_{k + 1}_s"] == pytest.approx(eph.tgd[k], rel=1e-14)
    assert record["transmitted_ns"] == (2381 * WEEK_S + 408_610) * S


def inav_pages(word: int, rng: random.Random) -> tuple[Bits, Bits]:
    even = Writer(rng).put(1, 0).put(1, 0).put(112, word >> 16)
    odd = Writer(rng).put(1, 1).put(1, 0).put(16, word & 0xFFFF).put(64)
    check = crc24q((even.value << 82 | odd.value).to_bytes(25, "big"))
    return Bits(even.value << 14, 128), Bits((odd.value << 24 | check) << 22, 128)


def test_inav_pages_and_their_crc() -> None:
    rng = random.Random(4)
    for _ in range(20):
        word = rng.getrandbits(128)
        even, odd = inav_pages(word, rng)
        got = navbits_galileo.inav_word(even, odd)
        assert got is not None and got.value == word
        broken = Bits(odd.value ^ 1 << rng.randrange(22, 128 - 2), 128)
        with pytest.raises(ValueError, match="CRC"):
            navbits_galileo.inav_word(even, broken)


@pytest.mark.parametrize("seed", SEEDS)
def test_fnav_agrees_with_rtklib(seed: int) -> None:
    rng = random.Random(seed)
    issue, toe = rng.getrandbits(10), 407_400 // 60
    week = 2381 - 1024
    pages = []
    for number in range(1, 5):
        w = Writer(rng).put(6, number)
        if number == 1:
            w.put(6, 11).put(10, issue).put(14, toe).put(31).put(21).put(6).put(8)
            w.put(11).put(11).put(14).put(5).put(10).put(2).put(12, week).put(20, 408_610)
            w.put(1).put(26)
        elif number == 2:
            w.put(10, issue).put(32).put(24).put(32).put(32).put(32).put(14)
            w.put(12, week).put(20, 408_620)
        elif number == 3:
            w.put(10, issue).put(32).put(32).put(16).put(16).put(16).put(16).put(16).put(14, toe)
            w.put(12, week).put(20, 408_630).put(8)
        else:
            w.put(10, issue).put(16).put(16).put(160).put(6)
        assert w.length == 214
        pages.append(w.value)
    assembler, record = navbits_galileo.FnavAssembler(), None
    for page in pages:
        check = crc24q(page.to_bytes(27, "big"))
        bits = navbits_galileo.fnav_page(Bits((page << 24 | check) << 18, 256))
        record, _ = assembler.add(11, bits, NOW)
    assert record is not None
    data = b"".join(pack(page, 214, 31) for page in pages)
    eph = pyrtklib.eph_t()
    pyrtklib.decode_gal_fnav(c_bytes(data, 31 * 8), eph, doubles(4), doubles(8))
    check_kepler(record, eph)
    assert record["group_delay_1_s"] == pytest.approx(eph.tgd[0], rel=1e-14)


def beidou_words(bits: int, count: int) -> tuple[list[int], bytes]:
    """Ten words of 30 bits with random parity, and the same as RTKLIB holds them."""
    rng, words = random.Random(bits & 0xFFFF), []
    rest = bits << (224 - count)
    words.append((rest >> 198) << 4 | rng.getrandbits(4))
    for k in range(9):
        words.append((rest >> (22 * (8 - k)) & 0x3FFFFF) << 8 | rng.getrandbits(8))
    joined = 0
    for word in words:
        joined = joined << 30 | word
    return words, pack(joined, 300, 38)


def beidou_clock(w: Writer, toe: int) -> None:
    w.put(1).put(5).put(4, w.rng.randrange(15)).put(13, 2381 - 1356).put(17, toe // 8)
    w.put(10).put(10)


@pytest.mark.parametrize("seed", SEEDS)
def test_d1_agrees_with_rtklib(seed: int) -> None:
    rng, toe, data, record = random.Random(seed), 406_800, b"", None
    assembler = navbits_beidou.D1Assembler()
    for number in (1, 2, 3):
        w = Writer(rng).put(11, 0x712).put(4).put(3, number).put(20, 408_600 + 6 * number)
        if number == 1:
            beidou_clock(w, toe)
            w.put(64).put(11).put(24).put(22).put(5)
        elif number == 2:
            w.put(16).put(18).put(32).put(32).put(18).put(18).put(18).put(32)
            w.put(2, toe // 8 >> 15)
        else:
            w.put(15, toe // 8 & 0x7FFF).put(32).put(18).put(24).put(18).put(14).put(32).put(32)
            w.put(1)
        assert w.length == 224
        words, stored = beidou_words(w.value, 224)
        data += stored
        record, ionosphere = assembler.add(21, navbits_beidou.strip_parity(words), NOW)
        assert (ionosphere is not None) == (number == 1)
    assert record is not None
    eph = pyrtklib.eph_t()
    pyrtklib.decode_bds_d1(c_bytes(data, 38 * 5), eph, doubles(8), doubles(8))
    check_kepler(record, eph)
    assert record["group_delay_1_s"] == pytest.approx(eph.tgd[0], abs=1e-20)
    assert record["group_delay_2_s"] == pytest.approx(eph.tgd[1], abs=1e-20)
    assert record["transmitted_ns"] == (2381 * WEEK_S + 408_606 + 14) * S


@pytest.mark.parametrize("seed", SEEDS)
def test_d2_agrees_with_rtklib(seed: int) -> None:
    rng, toe, data, record = random.Random(seed), 406_800, b"", None
    assembler = navbits_beidou.D2Assembler()
    for page in range(1, 11):
        of_week = 408_600 + 3 * (page - 1)
        w = Writer(rng).put(11, 0x712).put(4).put(3, 1).put(20, of_week).put(4, page)
        if page == 1:
            beidou_clock(w, toe)
        elif page == 7:
            w.put(8).put(18).put(17, toe // 8)
        elif page == 5:
            # RTKLIB takes the eccentricity's top bit for a sign: half of what can be said.
            w.put(4).put(32).put(18).put(1, 0)
        w.put(224 - w.length)
        words, stored = beidou_words(w.value, 224)
        data += stored
        record, _ = assembler.add(3, navbits_beidou.strip_parity(words), NOW)
    assert record is not None
    eph = pyrtklib.eph_t()
    pyrtklib.decode_bds_d2(c_bytes(data, 38 * 10), eph, doubles(8))
    check_kepler(record, eph)
    assert record["group_delay_1_s"] == pytest.approx(eph.tgd[0], abs=1e-20)


@pytest.mark.parametrize("seed", SEEDS)
def test_glonass_strings_agree_with_rtklib(seed: int) -> None:
    rng, slot = random.Random(seed), 11
    # 408600 s of the week is 17:30 of UTC less 18 s leap seconds, 20:30 in Moscow: interval 82.
    strings = []
    for number in (1, 2, 3, 4):
        w = Writer(rng).put(1, 0).put(4, number)
        if number == 1:
            w.put(2).put(2).put(5, 20).put(6, 29).put(1, 1).put(24).put(5).put(27)
        elif number == 2:
            w.put(3).put(1).put(7, 82).put(5).put(24).put(5).put(27)
        elif number == 3:
            w.put(1).put(11).put(1).put(2).put(1).put(24).put(5).put(27)
        else:
            w.put(22).put(5).put(5).put(14).put(1).put(4, 3).put(3).put(11).put(5, slot).put(2)
        w.put(85 - w.length)
        strings.append(w.value)
    assembler, record = navbits_glonass.StringAssembler(), None
    for n, value in enumerate(strings):
        record, _ = assembler.add(slot, -4, Bits(value << 43, 128), NOW + 2 * n * S)
    assert record is not None
    data = b"".join(pack(value, 85, 11)[:10] for value in strings)
    geph = pyrtklib.geph_t()
    geph.tof.time = (NOW // S) + 315_964_800
    pyrtklib.decode_glostr(c_bytes(data, 60), geph, doubles(8))
    for name, theirs in (("position_m", geph.pos), ("velocity_m_s", geph.vel),
                         ("acceleration_m_s2", geph.acc)):  # fmt: skip
        assert record[name].tolist() == [pytest.approx(theirs[k], rel=1e-14) for k in range(3)]
    assert record["af0"] == pytest.approx(-geph.taun, rel=1e-14)
    assert record["af1"] == pytest.approx(geph.gamn, rel=1e-14)
    assert record["iode"] == geph.iode == 82
    assert record["frequency_channel"] == -4
    # The interval begins at 17:30:00 of UTC, Thursday 28 August 2025, 18 leap seconds.
    assert record["toe_ns"] == (2381 * WEEK_S + 4 * 86_400 + 17 * 3600 + 30 * 60 + 18) * S


def test_crc_agrees_with_rtklib() -> None:
    data = random.Random(5).randbytes(100)
    assert crc24q(data) == pyrtklib.rtk_crc24q(c_bytes(data), len(data))
