"""Observation types of RINEX 2 as signals of RINEX 3.

RINEX 2 names a frequency, not a tracking mode, so the modes are a convention;
it is that of RTKLIB, but for the carriers of one frequency (below).

======== ===== ======= ======= ======= ======= =======
RINEX 2  GPS   GLONASS Galileo BeiDou  QZSS    SBAS
======== ===== ======= ======= ======= ======= =======
C1       1C    1C      1X      –       1C      1C
P1       1W    1P      –       –       –       –
C2       2X    2C      –       2X      2X      –
P2       2W    2P      –       –       –       –
C5       5X    –       5X      –       5X      5X
C6       –     –       6X      6X      6X      –
C7       –     –       7X      7X      –       –
C8       –     –       8X      –       –       –
======== ===== ======= ======= ======= ======= =======

L, D and S of frequencies 5 to 8 go with C. Those of frequency 1 go with C1 (the
C/A carrier is what receivers track), or with P1 where the header lists P1 and no
C1. Those of frequency 2 go with P2 of GPS and GLONASS, or with C2 where the
header lists C2 and no P2. A type without an entry (T1, or those of RINEX 2.12) has
no signal and its values are counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

_CODES: Final = {
    "G": {"C1": "1C", "P1": "1W", "C2": "2X", "P2": "2W", "C5": "5X"},
    "R": {"C1": "1C", "P1": "1P", "C2": "2C", "P2": "2P"},
    "E": {"C1": "1X", "C5": "5X", "C6": "6X", "C7": "7X", "C8": "8X"},
    "C": {"C2": "2X", "C6": "6X", "C7": "7X"},
    "J": {"C1": "1C", "C2": "2X", "C5": "5X", "C6": "6X"},
    "S": {"C1": "1C", "C5": "5X"},
}
_PREFERRED: Final = {"1": ("C1", "P1"), "2": ("P2", "C2")}

SYSTEMS: Final = tuple(_CODES)


def rinex3_types(system: str, types: Sequence[str]) -> tuple[str, ...]:
    """RINEX 3 types such as `L1C` of one system; RINEX 2 types without a signal stay.

    Parameters
    ----------
    system : str
        RINEX letter.
    types : sequence of str
        RINEX 2 types that the header lists.
    """
    codes = _CODES[system]
    return tuple(_rinex3_type(codes, kind, types) for kind in types)


def _rinex3_type(codes: dict[str, str], kind: str, types: Sequence[str]) -> str:
    if kind in codes:
        return f"C{codes[kind]}"
    if len(kind) != 2 or kind[0] not in "LDS":
        return kind
    candidates = _PREFERRED.get(kind[1], (f"C{kind[1]}",))
    known = [code for code in candidates if code in codes]
    listed = [code for code in known if code in types]
    chosen = (listed or known)[:1]
    return f"{kind[0]}{codes[chosen[0]]}" if chosen else kind
