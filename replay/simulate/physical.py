"""What the Earth's tides and the turning of antennas put into one receiver's signals."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from replay.kernels.phase_centre import sight_directions
from replay.kernels.true_wind_up import antenna_axes, true_wind_up
from replay.simulate.ground import ut1_minus_gps_s
from replay.simulate.noise import Floats
from replay.simulate.phase_centres import mounted
from replay.simulate.sky import Receiver, Setup
from replay.simulate.truth import Epochs, Scene, TrueSky

Records = npt.NDArray[np.void]


class WindUp:
    """Wind-up of the phases that one receiver has of each satellite.

    Parameters
    ----------
    receiver : Receiver
    setup : Setup
    scene : Scene
    sky : TrueSky
    epochs : Epochs
        Of the receiver.
    """

    def __init__(
        self, receiver: Receiver, setup: Setup, scene: Scene, sky: TrueSky, epochs: Epochs
    ) -> None:
        self.there = setup.sky.wind_up
        self._scene, self._sky, self._epochs = scene, sky, epochs
        if self.there:
            mount, self._turning = mounted(receiver, scene, epochs)
            self._axes = np.empty_like(mount)
            antenna_axes(mount, self._axes)

    def of(self, number: int, sights: Records) -> Floats:
        """Cycles and cycles/s of a satellite at every epoch, `(e, 2)`; noughts without it.

        Parameters
        ----------
        number : int
            Of the satellite in the sky.
        sights : array (e,) of SIGHT_DTYPE
        """
        out = np.zeros((len(sights), 2))
        if self.there:
            epochs, start_ns = self._epochs, self._scene.start_ns
            true_wind_up(
                self._sky.satellites[number], self._sky.limits_s[number],
                start_ns + epochs.elapsed_ns, -epochs.clock[:, 0], epochs.positions,
                epochs.velocities, self._axes, self._turning, ut1_minus_gps_s(start_ns), sights,
                out,
            )  # fmt: skip
        return out


def tide_ranges(epochs: Epochs, sights: Records) -> tuple[Floats, ...]:
    """What solid Earth tide and pole tide add to the ranges (e,), m; nothing without tides."""
    if epochs.tides is None:
        return ()
    towards = np.zeros((len(sights), 3))
    sight_directions(sights, epochs.positions, towards)
    return tuple(_along(towards, tide) for tide in epochs.tides)


def _along(towards: Floats, moved: Floats) -> Any:
    product = towards * moved
    return -(product[:, 0] + product[:, 1] + product[:, 2])
