"""RTKLIB's single-point solution of simulated epochs is the truth, where models agree."""

from __future__ import annotations

import numpy as np
import pymap3d
import pytest

from replay import channels
from tests.simulate.observing import NO_AIR, base, make

pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")

MM = 1e-3
SYSTEM = {"G": pyrtklib.SYS_GPS, "E": pyrtklib.SYS_GAL, "C": pyrtklib.SYS_CMP}
CODE = {"1C": pyrtklib.CODE_L1C, "2I": pyrtklib.CODE_L2I}
ELEMENTS = {
    "A": None, "e": "eccentricity", "i0": "i0", "OMG0": "omega0", "omg": "omega", "M0": "m0",
    "deln": "delta_n", "OMGd": "omega_dot", "idot": "i_dot", "crc": "crc", "crs": "crs",
    "cuc": "cuc", "cus": "cus", "cic": "cic", "cis": "cis", "toes": "toe_s", "f0": "af0",
    "f1": "af1", "f2": "af2", "iode": "iode", "iodc": "iodc", "code": "source",
}  # fmt: skip


def gtime(time_ns: int):
    return pyrtklib.gpst2time(
        int(time_ns // (604_800 * 10**9)), float(time_ns % (604_800 * 10**9)) / 1e9
    )


def navigation(made):
    """RTKLIB's ephemerides and coefficients from the log's rows."""
    nav = made.rows[channels.NAV.topic]
    table = pyrtklib.Arr1Deph_t(len(nav))
    for row in range(len(nav)):
        eph, name = table[row], nav["satellite"][row].decode()
        eph.sat = pyrtklib.satno(SYSTEM[name[0]], int(name[1:]))
        for theirs, ours in ELEMENTS.items():
            if ours is not None:
                setattr(eph, theirs, nav[ours][row].item())
        eph.A = nav["sqrt_a"][row].item() ** 2
        eph.toe, eph.toc = gtime(int(nav["toe_ns"][row])), gtime(int(nav["toc_ns"][row]))
        eph.ttr = gtime(int(nav["transmitted_ns"][row]))
        eph.week = int(nav["toe_ns"][row]) // (604_800 * 10**9)
        eph.tgd[0] = nav["group_delay_1_s"][row].item()
        eph.tgd[1] = nav["group_delay_2_s"][row].item()
    out = pyrtklib.nav_t()
    out.eph = table
    out.n = out.nmax = len(nav)
    numbers = made.rows[channels.NAV_IONOSPHERE.topic].ragged("coefficients").row(0)
    for index, number in enumerate(numbers.tolist()):
        out.ion_gps[index] = number
    return out, table


def solutions(made, systems: str, ionosphere: int, troposphere: int):
    """ENU errors (n, 3) of the base at every fifth epoch."""
    nav, keep = navigation(made)
    columns = made.observations("base")
    truth = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    option = pyrtklib.prcopt_t()
    option.mode = pyrtklib.PMODE_SINGLE
    option.navsys = sum(SYSTEM[letter] for letter in systems)
    option.nf = 1
    option.ionoopt, option.tropopt = ionosphere, troposphere
    option.elmin = np.radians(12.0)
    option.maxgdop = 30.0
    for index, value in enumerate((100.0, 0.003, 0.003, 0.0, 1.0)):
        option.err[index] = value
    errors = []
    for time_ns in np.unique(columns.valid_time_ns)[::5].tolist():
        rows = np.flatnonzero(columns.valid_time_ns == time_ns)
        wanted = [
            (columns["satellite"][r].decode(), columns["signal"][r].decode(), r)
            for r in rows
            if columns["signal"][r].decode() in CODE
            and columns["satellite"][r].decode()[0] in systems
        ]
        data = pyrtklib.Arr1Dobsd_t(len(wanted))
        for index, (satellite, signal, row) in enumerate(wanted):
            one = data[index]
            one.time = gtime(time_ns)
            one.rcv = 1
            one.sat = pyrtklib.satno(SYSTEM[satellite[0]], int(satellite[1:]))
            one.code[0] = CODE[signal]
            one.P[0] = columns["pseudorange_m"][row].item()
            one.SNR[0] = 45000
        sol = pyrtklib.sol_t()
        azel = pyrtklib.Arr1Ddouble(2 * len(wanted))
        seen = pyrtklib.Arr1Dssat_t(pyrtklib.MAXSAT)
        said = pyrtklib.Arr1Dchar(256)
        status = pyrtklib.pntpos(data[0], len(wanted), nav, option, sol, azel, seen[0], said)
        assert status == 1, said
        found = np.array([sol.rr[i] for i in range(3)])
        enu = pymap3d.ecef2enuv(*(found - truth), 30.5, 114.3)
        errors.append(np.array(enu))
    del keep
    return np.array(errors)


@pytest.mark.parametrize("systems", ["G", "E", "C", "GEC"])
def test_rtklib_finds_the_place(systems):
    # What its formula for the Earth's rotation leaves out is a tenth of a millimetre.
    clock = {"bias": "0.3 ms", "drift": "0.1 ppm"}
    made = make(base(clock=clock), sky=NO_AIR)
    errors = solutions(made, systems, pyrtklib.IONOOPT_OFF, pyrtklib.TROPOPT_OFF)
    assert len(errors) >= 6
    assert np.abs(errors).max() < 1 * MM


def test_rtklib_corrects_the_ionosphere():
    made = make(base(), sky={"troposphere": {"enabled": False}})
    errors = solutions(made, "GEC", pyrtklib.IONOOPT_BRDC, pyrtklib.TROPOPT_OFF)
    assert np.abs(errors).max() < 2 * MM
    # And without it the height is metres off.
    errors = solutions(made, "GEC", pyrtklib.IONOOPT_OFF, pyrtklib.TROPOPT_OFF)
    assert np.abs(errors[:, 2]).min() > 1.0


def test_rtklib_corrects_the_troposphere_as_well_as_its_mapping_can():
    # Its Saastamoinen maps by 1 / sin: 20 cm off Niell's at 12 degrees, 1 cm at 40.
    made = make(base(mask="35 deg"), sky={"ionosphere": {"enabled": False}})
    errors = solutions(made, "GEC", pyrtklib.IONOOPT_OFF, pyrtklib.TROPOPT_SAAS)
    assert np.abs(errors).max() < 0.05
