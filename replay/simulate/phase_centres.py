"""The antenna of one simulated receiver: how it is mounted, and what it adds to each signal."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay import time
from replay.gnss.antennas import Antennas
from replay.gnss.signals import frequency_hz
from replay.kernels.antenna_pattern import choose_pattern
from replay.kernels.earth import enu_axes
from replay.kernels.gnss_records import SYSTEM_LETTERS
from replay.kernels.phase_centre import antenna_terms, mount_on_body
from replay.simulate.antennas import Antenna, calibration_columns
from replay.simulate.noise import Floats
from replay.simulate.sky import Receiver, Setup
from replay.simulate.truth import Epochs, Scene

Records = npt.NDArray[np.void]


def worn_antennas(setup: Setup) -> list[Antenna]:
    """Antennas that some receiver has."""
    names = {receiver.antenna for receiver in setup.receivers}
    return [antenna for antenna in setup.antennas if antenna.name in names]


def mounted(receiver: Receiver, scene: Scene, epochs: Epochs) -> tuple[Floats, Floats]:
    """How the antenna of a receiver stands at every epoch.

    Returns
    -------
    axes : float64 array (e, 3, 3)
        Rows to the right of its mark, along it, up, in ECEF.
    turning : float64 array (e, 3), rad/s, ECEF
        Of those axes against the Earth.
    """
    count = len(epochs.elapsed_ns)
    axes, turning = np.zeros((count, 3, 3)), np.zeros((count, 3))
    if receiver.kind == "static":
        if count:
            x, y, z = epochs.crust[0].tolist()
            enu_axes(x, y, z, axes[0])
            axes[1:] = axes[0]
        return axes, turning
    true_s = epochs.elapsed_ns / time.NS_PER_S - epochs.clock[:, 0] - receiver.delay
    mount_on_body(scene.trajectory.poses(np.maximum(true_s, 0.0)), axes, turning)
    return axes, turning


class PhaseCentres:
    """What the antenna of a receiver adds, the same to code and phase.

    On a pillar its mark points to the north; on a vehicle forward, and it leans and turns
    with the body. A receiver without an antenna measures at its reference point.

    Parameters
    ----------
    receiver : Receiver
    setup : Setup
    scene : Scene
    epochs : Epochs
        Of the receiver.
    """

    def __init__(self, receiver: Receiver, setup: Setup, scene: Scene, epochs: Epochs) -> None:
        self.there = bool(receiver.antenna)
        self._epochs, self._time_ns = epochs, scene.start_ns
        # The same records that a run makes of the log's rows.
        self._known = Antennas()
        if not self.there:
            return
        own = [antenna for antenna in setup.antennas if antenna.name == receiver.antenna]
        self._known.learn(calibration_columns(own, scene.start_ns))
        self._axes, self._turning = mounted(receiver, scene, epochs)

    def of(self, signal: str, channel: int, sights: Records) -> Floats:
        """Range (m) and its rate (m/s) that are added at every epoch, `(e, 2)`.

        Parameters
        ----------
        signal : str
            As `G1C`.
        channel : int
            Of GLONASS.
        sights : array (e,) of SIGHT_DTYPE
            Of one satellite.
        """
        added = np.zeros((len(sights), 2))
        if not self.there:
            return added
        band, patterns = int(signal[1]), self._known.patterns
        chosen = choose_pattern(
            patterns, int(patterns["antenna"][0]), SYSTEM_LETTERS.index(signal[0]), band,
            frequency_hz(signal[0], band, channel), self._time_ns, self._time_ns,
        )  # fmt: skip
        antenna_terms(
            patterns[chosen], self._known.values, self._axes, self._turning,
            self._epochs.positions, sights, self._epochs.interval_s, added,
        )  # fmt: skip
        return added
