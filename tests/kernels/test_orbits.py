import gzip
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from replay.kernels import glonass, orbits, sight
from replay.kernels.earth import enu_axes
from replay.kernels.ephemeris import EPHEMERIS_DTYPE

pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")

MILLIMETRE = 1e-3
MILLIMETRE_PER_S = 1e-3
PICOSECOND = 1e-12
UNIX_OF_GPS_EPOCH_S = 315_964_800
HERE = (3924698.0, 301125.0, 5001905.0)  # Delft

# Of the receiver AMEL00NLD on 2021-01-01: broadcast messages of GPS, GLONASS, Galileo, BeiDou-2
# geostationary and inclined geosynchronous, BeiDou-3 in medium orbit, and QZSS.
MESSAGES = """\
     3.04           NAVIGATION DATA     MIXED               RINEX VERSION / TYPE
    18    18  2185     7                                    LEAP SECONDS
                                                            END OF HEADER
C05 2021 01 01 12 00 00 -.429587904364e-03 -.751017026346e-10  .000000000000e+00
      .100000000000e+01 -.615843750000e+03 -.104361489932e-08  .593225443844e+00
     -.203140079975e-04  .409177853726e-03  .942964106798e-05  .649344407272e+04
      .475200000000e+06  .358559191227e-07 -.514418099579e-01  .847503542900e-07
      .117304873236e+00 -.284500000000e+03 -.256474030300e+01  .217366197032e-08
      .586810157284e-09  .000000000000e+00  .782000000000e+03  .000000000000e+00
      .200000000000e+01  .000000000000e+00 -.599999994133e-09 -.900000000000e-08
      .475200000000e+06  .000000000000e+00 0.000000000000e+00 0.000000000000e+00
C20 2021 01 01 12 00 00 -.909524736926e-03  .678568312651e-12  .000000000000e+00
      .100000000000e+01 -.931562500000e+02  .345835834022e-08  .125179651684e+01
     -.455696135759e-05  .535984523594e-03  .124806538224e-04  .528263606453e+04
      .475200000000e+06 -.144354999065e-07  .587300063862e+00 -.139698386192e-08
      .965216582196e+00  .109296875000e+03 -.535096581218e+00 -.644884004864e-08
      .360014996070e-09  .000000000000e+00  .782000000000e+03  .000000000000e+00
      .200000000000e+01  .000000000000e+00  .232000001432e-07  .232000000000e-07
      .476550000000e+06  .100000000000e+01 0.000000000000e+00 0.000000000000e+00
G05 2021 01 01 12 00 00 -.298470258713e-04 -.102318153949e-11  .000000000000e+00
      .510000000000e+02 -.115281250000e+03  .452233123039e-08  .183263794367e+01
     -.599399209023e-05  .602735416032e-02  .986270606518e-05  .515379709625e+04
      .475200000000e+06 -.154599547386e-06  .194673892538e+00 -.540167093277e-07
      .955162067660e+00  .188812500000e+03  .889545323213e+00 -.792818738368e-08
      .417874549009e-10  .100000000000e+01  .213800000000e+04  .000000000000e+00
      .200000000000e+01  .000000000000e+00 -.111758708954e-07  .510000000000e+02
      .468018000000e+06  .400000000000e+01 0.000000000000e+00 0.000000000000e+00
R01 2021 01 01 12 15 00  .728471204638e-04  .000000000000e+00  .432000000000e+05
      .137562138672e+05  .243890857697e+01  .000000000000e+00  .000000000000e+00
     -.305019873047e+04  .159038066864e+01  .000000000000e+00  .100000000000e+01
      .212612412109e+05 -.134848976135e+01 -.279396772385e-08  .000000000000e+00
C06 2021 01 01 00 00 00  .982352066785e-04  .293951529784e-10  .000000000000e+00
      .100000000000e+01  .141734375000e+03  .178900309059e-08  .287176567058e+01
      .455044209957e-05  .995399802923e-02  .702124089003e-05  .649375746155e+04
      .432000000000e+06 -.675208866596e-07  .148721580560e+01  .912696123123e-07
      .944390170281e+00  .272656250000e+02 -.221854342546e+01 -.202294140649e-08
      .965397355532e-09  .000000000000e+00  .782000000000e+03  .000000000000e+00
      .200000000000e+01  .000000000000e+00  .819999979029e-08 -.150000000000e-08
      .432000000000e+06  .000000000000e+00 0.000000000000e+00 0.000000000000e+00
E11 2021 01 01 07 30 00  .654213299276e-02 -.632098817732e-10  .000000000000e+00
      .125000000000e+03 -.233437500000e+02  .311512975766e-08  .123602231592e+01
     -.114366412163e-05  .213975203224e-03 -.301562249660e-05  .544060741043e+04
      .459000000000e+06 -.745058059692e-08 -.104707646742e+01 -.745058059692e-08
      .990192024352e+00  .419468750000e+03 -.224684041872e+00 -.602310802948e-08
     -.285726187357e-11  .258000000000e+03  .213800000000e+04 0.000000000000e+00
      .312000000000e+01  .000000000000e+00 -.137370079756e-07  .000000000000e+00
      .459980000000e+06 0.000000000000e+00 0.000000000000e+00 0.000000000000e+00
J01 2021 01 01 00 00 00 -.335526186973e-03 -.568434188608e-12  .000000000000e+00
      .290000000000e+02  .985937500000e+02  .142541651718e-08 -.296492607277e+01
      .252947211266e-05  .752506867284e-01  .301990658045e-04  .649355943871e+04
      .432000000000e+06 -.130385160446e-06  .783711987927e+00 -.782310962677e-07
      .729662241224e+00 -.863312500000e+03 -.155915933427e+01 -.170042797251e-08
      .117862052285e-08  .200000000000e+01  .213800000000e+04  .100000000000e+01
      .280000000000e+01  .000000000000e+00 -.558793544769e-08  .797000000000e+03
      .431976000000e+06  .100000000000e+01 0.000000000000e+00 0.000000000000e+00
"""

RECORD_OF_SYSTEM = {
    pyrtklib.SYS_GPS: ord("G"),
    pyrtklib.SYS_GAL: ord("E"),
    pyrtklib.SYS_CMP: ord("C"),
    pyrtklib.SYS_QZS: ord("J"),
}


def c_array(values: Sequence[float]):
    out = pyrtklib.Arr1Ddouble(len(values))
    for i, value in enumerate(values):
        out[i] = float(value)
    return out


def from_c(array, n: int) -> np.ndarray:
    return np.array([array[i] for i in range(n)])


def gps_ns(t) -> int:
    return (t.time - UNIX_OF_GPS_EPOCH_S) * 1_000_000_000 + round(t.sec * 1e9)


def read(path: Path):
    """What RTKLIB reads: pairs of its ephemeris and the same as a record."""
    nav = pyrtklib.nav_t()
    pyrtklib.readrnx(str(path), 1, "", pyrtklib.obs_t(), nav, pyrtklib.sta_t())
    pairs = []
    for i in range(nav.n):
        eph = nav.eph[i]
        prn = pyrtklib.Arr1Dint(1)
        system = RECORD_OF_SYSTEM[pyrtklib.satsys(eph.sat, prn)]
        number = prn[0] - (pyrtklib.MINPRNQZS - 1 if system == ord("J") else 0)
        record = np.zeros(1, EPHEMERIS_DTYPE)[0]
        values = {
            "system": system, "prn": number, "toe_ns": gps_ns(eph.toe), "toc_ns": gps_ns(eph.toc),
            "af0": eph.f0, "af1": eph.f1, "af2": eph.f2, "source": eph.code,
            "group_delay_1_s": eph.tgd[0], "group_delay_2_s": eph.tgd[1],
            "toe_s": eph.toes, "sqrt_a": np.sqrt(eph.A), "eccentricity": eph.e, "i0": eph.i0,
            "omega0": eph.OMG0, "omega": eph.omg, "m0": eph.M0, "delta_n": eph.deln,
            "omega_dot": eph.OMGd, "i_dot": eph.idot, "cuc": eph.cuc, "cus": eph.cus,
            "crc": eph.crc, "crs": eph.crs, "cic": eph.cic, "cis": eph.cis,
        }  # fmt: skip
        for name, value in values.items():
            record[name] = value
        pairs.append((eph, record))
    for i in range(nav.ng):
        eph = nav.geph[i]
        prn = pyrtklib.Arr1Dint(1)
        pyrtklib.satsys(eph.sat, prn)
        record = np.zeros(1, EPHEMERIS_DTYPE)[0]
        record["system"] = ord("R")
        record["prn"] = prn[0]
        record["toe_ns"] = record["toc_ns"] = gps_ns(eph.toe)
        record["af0"] = -eph.taun
        record["af1"] = eph.gamn
        record["position_m"] = from_c(eph.pos, 3)
        record["velocity_m_s"] = from_c(eph.vel, 3)
        record["acceleration_m_s2"] = from_c(eph.acc, 3)
        record["frequency_channel"] = eph.frq
        pairs.append((eph, record))
    return nav, pairs


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    path = tmp_path_factory.mktemp("nav") / "messages.rnx"
    path.write_text(MESSAGES)
    nav, pairs = read(path)
    names = {f"{chr(r['system'])}{r['prn']:02}" for _, r in pairs}
    assert names == {"G05", "R01", "E11", "C05", "C06", "C20", "J01"}
    yield pairs
    del nav  # owns the memory of what RTKLIB read


def state(record, time_ns: int, offset_s: float = 0.0) -> np.ndarray:
    out = np.zeros(8)
    orbits.satellite_state(record, int(time_ns), float(offset_s), out)
    return out


def rtklib_state(eph, record, dt: float) -> tuple[np.ndarray, float]:
    """Position and clock offset, dt after toe."""
    position, clock, variance = (pyrtklib.Arr1Ddouble(n) for n in (6, 2, 1))
    t = pyrtklib.timeadd(eph.toe, dt)
    model = pyrtklib.geph2pos if record["system"] == ord("R") else pyrtklib.eph2pos
    model(t, eph, position, clock, variance)
    return from_c(position, 3), clock[0]


def largest_differences(pairs, offsets: Sequence[float]) -> dict[str, tuple[float, float]]:
    worst: dict[str, tuple[float, float]] = {}
    for eph, record in pairs:
        if record["system"] != ord("R") and record["sqrt_a"] == 0.0:
            continue
        for dt in offsets:
            position, clock = rtklib_state(eph, record, dt)
            ours = state(record, record["toe_ns"] + round(dt * 1e9))
            system = chr(record["system"])
            before = worst.get(system, (0.0, 0.0))
            worst[system] = (
                max(before[0], float(np.linalg.norm(ours[:3] - position))),
                max(before[1], abs(ours[6] - clock)),
            )
    return worst


def assert_agreement(worst: dict[str, tuple[float, float]]) -> None:
    for system, (position, clock) in worst.items():
        assert position < MILLIMETRE, system
        assert clock < PICOSECOND, system


def test_positions_and_clocks_are_rtklibs(messages):
    worst = largest_differences(messages, np.linspace(-7200.0, 7200.0, 33))
    assert set(worst) == set("GRECJ")
    assert_agreement(worst)


@pytest.mark.parametrize(
    "name",
    [
        "riverside-drive-2020-193/rover.nav",
        "nl-network-2021-001/AMEL00NLD_R_20210010000_01D_MN.rnx.gz",
    ],
)
def test_positions_and_clocks_of_whole_files_are_rtklibs(shared_data, tmp_path, name):
    path = shared_data / name
    if not path.is_file():
        pytest.skip(f"no such recording: {path}")
    if path.suffix == ".gz":
        plain = tmp_path / path.stem
        plain.write_bytes(gzip.decompress(path.read_bytes()))
        path = plain
    nav, pairs = read(path)
    worst = largest_differences(pairs, [-7200.0, -3333.3, -900.0, 0.0, 59.5, 1800.0, 7200.0])
    assert len(worst) >= 3
    assert_agreement(worst)
    del nav


@pytest.mark.parametrize("dt", [-7200.0, -1000.0, 0.5, 777.7, 7200.0])
def test_velocity_and_drift_are_derivatives(messages, dt):
    for _, record in messages:
        time_ns = int(record["toe_ns"]) + round(dt * 1e9)
        h = 1.0
        # Five points: the error is h^4/30 of the fifth derivative, 1e-14 of the orbit.
        far, near, after, beyond = (state(record, time_ns, k * h) for k in (-2, -1, 1, 2))
        slope = (far - 8.0 * near + 8.0 * after - beyond) / (12.0 * h)
        found = state(record, time_ns)
        np.testing.assert_allclose(found[3:6], slope[:3], atol=0.05 * MILLIMETRE_PER_S)
        assert found[7] == pytest.approx(slope[6], abs=1e-16)


def test_time_may_be_split_anywhere(messages):
    for _, record in messages:
        one = state(record, record["toe_ns"] + 1_500_000_000, -0.075)
        other = state(record, record["toe_ns"] + 1_425_000_000, 0.0)
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("e", [0.0, 1e-12, 0.003, 0.16, 0.5, 0.7])
def test_keplers_equation(e):
    for mean in np.linspace(-20.0, 20.0, 4001):
        anomaly = orbits.eccentric_anomaly(float(mean), e)
        turns = (anomaly - e * np.sin(anomaly) - mean) / (2.0 * np.pi)
        assert abs(turns - np.round(turns)) < 2e-15


def test_relativity_is_the_scalar_product_of_position_and_velocity(messages):
    # IS-GPS-200N 20.3.3.3.3.1: the alternative -2 R V / c^2, here in inertial axes. The
    # harmonic terms and delta n are in the one and not in the other.
    for _, record in messages:
        if record["system"] == ord("R") or orbits.is_geostationary(record):
            continue
        s = state(record, record["toe_ns"] + 600_000_000_000)
        offset, _ = orbits.relativistic_clock(record, int(record["toe_ns"]), 600.0)
        product = s[:3] @ s[3:6]  # the Earth's rotation is at right angles to the position
        assert offset == pytest.approx(-2.0 * product / orbits.SPEED_OF_LIGHT_M_S**2, abs=1e-10)


def test_clock_polynomial_is_rtklibs(messages):
    for eph, record in messages:
        if record["system"] == ord("R"):
            theirs = pyrtklib.geph2clk(pyrtklib.timeadd(eph.toe, 500.0), eph)
        else:
            theirs = pyrtklib.eph2clk(pyrtklib.timeadd(eph.toc, 500.0), eph)
        # RTKLIB's argument is the satellite's time, ours is system time.
        ours, _ = orbits.clock_polynomial(record, int(record["toc_ns"]), 500.0 - theirs)
        assert ours == pytest.approx(theirs, abs=1e-17)


def test_glonass_energy_does_not_leak():
    # Without the Moon and the Sun, the Jacobi integral of the rotating axes is constant.
    record = np.zeros(1, EPHEMERIS_DTYPE)[0]
    record["system"] = ord("R")
    record["position_m"] = (13756213.8672, -3050198.73047, 21261241.2109)
    record["velocity_m_s"] = (2438.90857697, 1590.38066864, -1348.48976135)

    def jacobi(s: np.ndarray) -> float:
        r = np.linalg.norm(s[:3])
        oblate = 1.0 - glonass.J2 * (glonass.RADIUS_M / r) ** 2 * (1.5 * (s[2] / r) ** 2 - 0.5)
        turn = 0.5 * glonass.OMEGA_E_RAD_S**2 * (s[0] ** 2 + s[1] ** 2)
        return float(0.5 * s[3:6] @ s[3:6] - glonass.MU_M3_S2 / r * oblate - turn)

    start = jacobi(state(record, 0))
    # What leaks, 3e-4 m^2/s^2 in two hours, is the error of 60 s steps: 1e-7 m/s.
    for dt in (-7200.0, 900.0, 7200.0):
        assert jacobi(state(record, 0, dt)) == pytest.approx(start, abs=1e-3)


def test_group_delays():
    record = np.zeros(1, EPHEMERIS_DTYPE)[0]
    record["group_delay_1_s"] = 2e-9
    record["group_delay_2_s"] = 3e-9

    def delay(system: str, band: int, source: int = 0) -> float:
        record["system"] = ord(system)
        record["source"] = source
        return float(orbits.group_delay(record, band))

    assert delay("G", 1) == 2e-9
    assert delay("J", 2) == pytest.approx(2e-9 * (1575.42 / 1227.6) ** 2, rel=1e-15)
    assert np.isnan(delay("G", 5))
    assert delay("C", 2) == 2e-9
    record["prn"] = 6
    assert delay("C", 7) == 3e-9
    record["prn"] = 19
    assert np.isnan(delay("C", 7))
    assert delay("C", 6) == 0.0
    assert np.isnan(delay("C", 1))
    assert delay("R", 1) == 0.0
    assert np.isnan(delay("R", 2))
    e5a = (1575.42 / 1176.45) ** 2
    e5b = (1575.42 / 1207.14) ** 2
    inav, fnav = 512 + 1, 256 + 2
    assert delay("E", 1, inav) == 3e-9
    assert delay("E", 7, inav) == pytest.approx(3e-9 * e5b, rel=1e-15)
    assert delay("E", 1, fnav) == 2e-9
    assert delay("E", 5, fnav) == pytest.approx(2e-9 * e5a, rel=1e-15)
    assert np.isnan(delay("E", 7, fnav))
    # The ionosphere-free pair of the message has no delay left, and with the other pair
    # E5a is late by the same whatever the clock: both differ by that of the clocks.
    assert (e5b * delay("E", 1, inav) - delay("E", 7, inav)) == pytest.approx(0.0, abs=1e-22)
    assert delay("E", 5, inav) - delay("E", 1, inav) == pytest.approx(
        delay("E", 5, fnav) - delay("E", 1, fnav), abs=1e-22
    )


@pytest.fixture(scope="module")
def axes():
    out = np.zeros((3, 3))
    enu_axes(*HERE, out)
    return out


def test_light_time_is_solved(messages):
    for _, record in messages:
        time_ns = int(record["toe_ns"]) + 300_000_000_000
        s = np.zeros(8)
        travel = orbits.state_at_reception(record, time_ns, -1e-4, *HERE, s)
        distance, *u = sight.line_of_sight(*HERE, *s[:3])
        assert distance == pytest.approx(travel * orbits.SPEED_OF_LIGHT_M_S, abs=1e-6)
        assert np.linalg.norm(u) == pytest.approx(1.0, abs=1e-15)
        # The same by the closed form in ECEF at transmission.
        t = state(record, time_ns, -1e-4 - travel)
        raw, *_ = sight.line_of_sight(*HERE, *t[:3])
        closed = raw + sight.sagnac(HERE[0], HERE[1], t[0], t[1])
        assert closed == pytest.approx(distance, abs=MILLIMETRE)
        line = pyrtklib.Arr1Ddouble(3)
        theirs = pyrtklib.geodist(c_array([*t[:3]]), c_array(HERE), line)
        assert closed == pytest.approx(theirs, abs=1e-6)
        # In inertial axes nothing turns: distance from where the satellite was to where we are.
        angle = 7.292115e-5 * travel
        turn = np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        assert np.linalg.norm(turn @ t[:3] - HERE) == pytest.approx(distance, abs=1e-6)
        np.testing.assert_allclose(turn @ t[3:6], s[3:6], atol=1e-9)


def test_transmission_from_a_pseudorange(messages):
    receiver_clock_s = 0.0123  # whole milliseconds and more are usual
    for _, record in messages:
        time_ns = int(record["toe_ns"]) + 300_000_000_000
        s = np.zeros(8)
        travel = orbits.state_at_reception(record, time_ns, -receiver_clock_s, *HERE, s)
        pseudorange = orbits.SPEED_OF_LIGHT_M_S * (travel + receiver_clock_s - s[6])
        offset = orbits.transmission_offset(record, time_ns, pseudorange)
        assert offset == pytest.approx(-receiver_clock_s - travel, abs=1e-14)


def test_elevation_and_azimuth_are_pymap3ds(axes):
    latitude, longitude, height = pymap3d.ecef2geodetic(*HERE)
    rng = np.random.default_rng(1)
    for target in rng.normal(size=(200, 3)) * 2.0e7:
        _, *u = sight.line_of_sight(*HERE, *map(float, target))
        elevation, azimuth = sight.elevation_azimuth(axes, *u)
        az, el, _ = pymap3d.ecef2aer(*target, latitude, longitude, height)
        assert elevation == pytest.approx(np.radians(el), abs=1e-12)
        assert azimuth == pytest.approx(np.radians(az), abs=1e-12)
        assert 0.0 <= azimuth < 2.0 * np.pi


def test_azimuth_of_the_zenith_is_north(axes):
    elevation, azimuth = sight.elevation_azimuth(np.eye(3), 0.0, 0.0, 2.0)
    assert elevation == pytest.approx(np.pi / 2)
    assert azimuth == 0.0
    assert sight.elevation_azimuth(np.eye(3), -1e-300, 1.0, 0.0)[1] < 2.0 * np.pi


def directions(n: int, seed: int) -> np.ndarray:
    """Unit vectors above the horizon, ENU."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(n, 3))
    u[:, 2] = np.abs(u[:, 2]) + 0.1
    return np.asarray(u / np.linalg.norm(u, axis=1)[:, None])


@pytest.mark.parametrize("clocks", [1, 2, 4])
def test_dilution_is_that_of_the_inverse(axes, clocks):
    n = 12
    design = np.zeros((n, 3 + clocks))
    for i, u in enumerate(directions(n, clocks)):
        sight.design_row(axes, *map(float, axes.T @ u), i % clocks, design[i])
        np.testing.assert_allclose(design[i, :3], -u, atol=1e-14)
    cofactor = np.zeros((3 + clocks, 3 + clocks))
    out = np.zeros(5)
    assert sight.dilution(design, cofactor, out)
    expected = np.linalg.inv(design.T @ design)
    np.testing.assert_allclose(cofactor, expected, rtol=1e-10, atol=1e-12)
    d = np.diag(expected)
    sums = [d.sum(), d[:3].sum(), d[:2].sum(), d[2], d[3]]
    np.testing.assert_allclose(out, np.sqrt(sums), rtol=1e-10)


def test_dilution_is_rtklibs():
    u = directions(8, 7)
    azimuth_elevation = np.column_stack((np.arctan2(u[:, 0], u[:, 1]), np.arcsin(u[:, 2])))
    theirs = pyrtklib.Arr1Ddouble(4)
    pyrtklib.dops(8, c_array(azimuth_elevation.ravel()), 0.0, theirs)
    out = np.zeros(5)
    design = np.column_stack((-u, np.ones(8)))
    assert sight.dilution(design, np.zeros((4, 4)), out)
    np.testing.assert_allclose(out[:4], from_c(theirs, 4), rtol=1e-10)


def test_no_dilution_without_geometry():
    out = np.full(5, 7.0)
    few = np.column_stack((-directions(3, 1), np.ones(3)))
    assert not sight.dilution(few, np.zeros((4, 4)), out)
    same = np.column_stack((-np.repeat(directions(1, 1), 6, axis=0), np.ones(6)))
    assert not sight.dilution(same, np.zeros((4, 4)), out)
    unused = np.column_stack((-directions(6, 1), np.ones(6), np.zeros(6)))
    assert not sight.dilution(unused, np.zeros((5, 5)), out)
    assert (out == 7.0).all()
