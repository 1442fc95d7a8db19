import pytest

from replay.gnss import signals
from replay.kernels.ephemeris import SYSTEM_GLONASS

pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")

RTKLIB_SYSTEM = {
    "G": pyrtklib.SYS_GPS,
    "R": pyrtklib.SYS_GLO,
    "E": pyrtklib.SYS_GAL,
    "C": pyrtklib.SYS_CMP,
    "J": pyrtklib.SYS_QZS,
}
# One attribute with which RTKLIB knows each band.
CODE_OF_BAND = {1: "1C", 2: "2I", 3: "3X", 4: "4X", 5: "5X", 6: "6X", 7: "7X", 8: "8X"}


@pytest.mark.parametrize("band", CODE_OF_BAND)
@pytest.mark.parametrize("system", RTKLIB_SYSTEM)
def test_frequencies_are_rtklibs(system, band):
    code = pyrtklib.obs2code(CODE_OF_BAND[band])
    for channel in signals.GLONASS_CHANNELS if system == "R" else (0,):
        theirs = pyrtklib.code2freq(RTKLIB_SYSTEM[system], code, channel)
        if theirs == 0.0:
            with pytest.raises(KeyError, match=f"system {system} has no band {band}"):
                signals.frequency_hz(system, band, channel)
        else:
            assert signals.frequency_hz(system, band, channel) == theirs
            assert signals.wavelength_m(system, band, channel) == pyrtklib.CLIGHT / theirs


def test_carriers_are_multiples_of_the_common_clock():
    multiples = {("G", 1): 154, ("G", 2): 120, ("E", 5): 115, ("E", 7): 118, ("E", 8): 116.5}
    multiples |= {("E", 6): 125, ("C", 2): 152.6, ("C", 6): 124}
    for (system, band), multiple in multiples.items():
        assert signals.frequency_hz(system, band) == pytest.approx(multiple * 10.23e6, rel=1e-15)


def test_systems_may_be_numbers():
    assert signals.frequency_hz(SYSTEM_GLONASS, 1, -7) == 1598.0625e6
    assert signals.frequency_hz("R", 2, 6) == 1248.625e6


@pytest.mark.parametrize("channel", [-8, 7])
def test_glonass_has_fourteen_channels(channel):
    with pytest.raises(ValueError, match="no frequency channel"):
        signals.frequency_hz("R", 1, channel)


def test_cdma_signals_of_glonass_have_no_channel():
    assert signals.frequency_hz("R", 3, 99) == 1202.025e6
