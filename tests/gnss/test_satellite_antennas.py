"""Blocks of satellites and their attitude models."""

from __future__ import annotations

import gzip

import pytest

from replay.gnss.satellite_antennas import ATTITUDES, attitude_model
from replay.kernels import satellite_attitude as attitude


@pytest.mark.parametrize(
    ("antenna", "model"),
    [
        ("BLOCK I", attitude.NOMINAL),
        ("BLOCK IIA", attitude.GPS_IIA),
        ("BLOCK IIR-M", attitude.GPS_IIR),
        ("BLOCK IIF", attitude.GPS_IIF),
        ("BLOCK IIIA", attitude.NOMINAL),
        ("GLONASS-M", attitude.GLO_M),
        ("GLONASS-K1", attitude.NOMINAL),
        ("GALILEO-1", attitude.GAL_IOV),
        ("GALILEO-2", attitude.GAL_FOC),
        ("BEIDOU-2G", attitude.NORMAL),
        ("BEIDOU-2M", attitude.BDS_2),
        ("BEIDOU-3M-CAST", attitude.NOMINAL),
        ("BEIDOU-3G-CAST", attitude.NORMAL),
        ("QZSS", attitude.QZS_1),
        ("QZSS-2I", attitude.NOMINAL),
        ("QZSS-2G", attitude.NORMAL),
        ("SOMETHING NEW", attitude.NOMINAL),
    ],
)
def test_a_block_has_its_model(antenna: str, model: int) -> None:
    assert attitude_model(antenna) == model


def test_every_block_of_the_igs_is_known(shared_data) -> None:
    path = shared_data / "antex" / "igs14.atx.gz"
    if not path.exists():
        pytest.skip("the calibrations of the IGS are not here")
    names = set()
    for line in gzip.decompress(path.read_bytes()).decode().splitlines():
        satellite = line[60:].startswith("TYPE / SERIAL") and line[40:50].strip()
        if satellite and line[20:21] in "GRECJ":
            names.add(line[:20].strip())
    assert len(names) > 20
    for name in names:
        assert any(name.startswith(known) for known in ATTITUDES), name
