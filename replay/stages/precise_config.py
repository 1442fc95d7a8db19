"""Settings of precise orbits, clocks and biases, and of what is corrected with them."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.gnss_config import Antenna, Atmosphere
from replay.stages.spp_config import SppConfig


class Products(Section, frozen=True):
    """Where orbits and clocks come from, and how they are interpolated."""

    source: Literal["precise", "broadcast"] = "precise"
    degree: int = 10
    # By one step of the orbit's own epochs at most: then the polynomial is lost.
    beyond: Annotated[float, quantity("s", "past its last epoch that an orbit serves")] = 900.0
    clock_beyond: Annotated[float, quantity("s", "past its last epoch that a clock serves")] = 60.0
    # Of orbit and clock together, where the products state none.
    range_std: Annotated[float, quantity("m", "of orbit and clock where not stated")] = 0.03
    biases: bool = True  # use biases of signals where the log has them
    # Signals that the clocks are made of: where no biases are used, their codes replace others
    # of their frequencies, whose phases stay.
    clock_codes: tuple[str, ...] = ("G1W", "G2W")
    attitude: Literal["model", "nominal"] = "model"


class Terms(Section, frozen=True):
    """Which terms are corrected where the log allows."""

    satellite_antenna: bool = True
    wind_up: bool = True
    solid_tide: bool = True
    pole_tide: bool = True
    ocean_loading: bool = True
    higher_ionosphere: bool = False


class PreciseAtmosphere(Atmosphere, frozen=True):
    """The filter estimates the ionosphere: what is modelled is a beginning at most."""

    ionosphere: Literal["none", "klobuchar", "system", "map"] = "none"
    troposphere: Literal["none", "niell", "cosecant", "gmf"] = "gmf"
    meteorology: Literal["standard", "mops", "gpt"] = "gpt"
    # Maps are of vertical content: CODE's are made with the modified layer, others with the thin.
    map_layer: Literal["thin", "modified"] = "thin"


class PreciseAntenna(Antenna, frozen=True):
    """How the antenna stands: a station's mark points north, on a vehicle nothing is known."""

    oriented: bool = True  # level with its mark to the north, else level alone


class PreciseConfig(SppConfig, frozen=True):
    """Settings that pipelines with precise products share."""

    atmosphere: PreciseAtmosphere = PreciseAtmosphere()
    antenna: PreciseAntenna = PreciseAntenna()
    products: Products = Products()
    terms: Terms = Terms()
