"""One colour for one thing, in every plot, map and page.

A series keeps its hue on the dark ground of the Rerun viewer and on the white
page of the report; only the lightness differs. The hues are those of Okabe and
Ito (2008, Color Universal Design), which people with any colour vision tell apart.
"""

from __future__ import annotations

import dataclasses
from typing import Final

Rgb = tuple[int, int, int]


@dataclasses.dataclass(frozen=True, slots=True)
class Ink:
    """A colour for both grounds.

    Attributes
    ----------
    dark : tuple of 3 int
        Red, green, blue (0 to 255) on a dark ground.
    light : tuple of 3 int
        The same on white paper.
    """

    dark: Rgb
    light: Rgb

    @property
    def hexadecimal(self) -> str:
        """`#rrggbb` for paper."""
        return "#{:02x}{:02x}{:02x}".format(*self.light)

    def faint(self) -> Ink:
        """Half way to the ground: for bounds and bands of the same series."""
        return Ink(_mix(self.dark, (22, 24, 28)), _mix(self.light, (255, 255, 255)))


def _mix(color: Rgb, ground: Rgb) -> Rgb:
    red, green, blue = ((a + b) // 2 for a, b in zip(color, ground, strict=True))
    return red, green, blue


TRUTH: Final = Ink((240, 240, 240), (34, 34, 34))
ALL_SYSTEMS: Final = Ink((225, 225, 230), (60, 64, 72))
OUTAGE: Final = Ink((255, 85, 70), (204, 51, 17))
REJECTED: Final = Ink((255, 60, 60), (200, 20, 20))
BOUND: Final = Ink((130, 135, 145), (150, 150, 150))
_RUNS: Final = (
    Ink((86, 180, 255), (0, 98, 178)),  # blue
    Ink((60, 210, 160), (0, 138, 100)),  # bluish green
    Ink((224, 145, 200), (170, 75, 135)),  # reddish purple
    # From here on hues of receivers too: comparisons, which have many runs, show none.
    Ink((255, 176, 32), (214, 128, 0)),  # orange
    Ink((190, 165, 255), (100, 75, 190)),  # violet
    Ink((213, 130, 70), (150, 75, 20)),  # brown
    Ink((120, 225, 235), (0, 150, 170)),  # cyan
    Ink((240, 228, 66), (160, 145, 0)),  # yellow
)
_SYSTEMS: Final = {
    "G": Ink((86, 180, 255), (0, 98, 178)),  # blue
    "R": Ink((255, 140, 120), (190, 70, 50)),  # red-brown
    "E": Ink((60, 210, 160), (0, 138, 100)),  # bluish green
    "C": Ink((255, 176, 32), (214, 128, 0)),  # orange
    "J": Ink((224, 145, 200), (170, 75, 135)),  # reddish purple
}
_RECEIVERS: Final = (
    Ink((255, 176, 32), (214, 128, 0)),  # orange
    Ink((240, 228, 66), (160, 145, 0)),  # yellow
    Ink((213, 130, 70), (150, 75, 20)),  # brown
)
AXES: Final = (
    Ink((240, 105, 95), (196, 60, 50)),  # x, forward
    Ink((110, 205, 105), (50, 140, 50)),  # y, right
    Ink((95, 155, 255), (40, 90, 200)),  # z, down
)


def run_ink(index: int) -> Ink:
    """Colour of the `index`-th run of a log; they repeat after eight."""
    return _RUNS[index % len(_RUNS)]


def system_ink(letter: str) -> Ink:
    """Colour of a satellite system by its RINEX letter; grey for one that is not known."""
    return _SYSTEMS.get(letter, BOUND)


def receiver_ink(index: int) -> Ink:
    """Colour of the `index`-th receiver of a log; they repeat after three."""
    return _RECEIVERS[index % len(_RECEIVERS)]
