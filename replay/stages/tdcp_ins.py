"""TDCP/INS: inertial samples, held by the displacements of a chain of carrier phases.

The loosely coupled filter with other measurements (Tang et al. 2021, eqs 14 and 15): the
change of position since the chain began, and the mean velocity over the last interval.
Where the phases break, the inertial system carries the position over: the next chain
begins where it believes the antenna to be, not at a code position. Covariances are about
the absolute position, which stays as uncertain as the code position at the beginning.
The arithmetic is in :mod:`replay.kernels.tdcp_link`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.kernels import records
from replay.kernels.tdcp_records import STATUS_CHAINED
from replay.log.columns import Columns
from replay.stages.base import Block, Context, Outputs, Port, StageSpec
from replay.stages.gnss_ins_lc import GnssInsLoose, LooseState
from replay.stages.loose_config import Gnss, LooseConfig
from replay.stages.tdcp_ins_config import TdcpInsConfig

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_AXES: Final = 3
_DIAGONAL: Final = (0, 3, 5)


@dataclasses.dataclass(slots=True)
class TdcpInertialState(LooseState):
    """Everything that crosses from one block to the next."""

    own: TdcpInsConfig


class TdcpInertial(GnssInsLoose):
    """The stage `tdcp-ins`.

    Parameters
    ----------
    record : bool
        Whether it writes transitions for a smoother.
    """

    spec = StageSpec(
        name="tdcp-ins",
        version=2,
        inputs=(
            Port(channels.IMU),
            Port(channels.DISPLACEMENT),
            Port(channels.SOLUTION, run="tdcp"),
        ),
        outputs=GnssInsLoose.spec.outputs,
        trigger=Port(channels.SOLUTION, run="tdcp"),
    )

    def start(self, config: Section, context: Context) -> TdcpInertialState:
        """State before the first row."""
        if not isinstance(config, TdcpInsConfig):
            raise TypeError("tdcp-ins takes a TdcpInsConfig")
        own = config.tdcp_ins
        if len(config.antenna.lever_arm) != _AXES:
            raise ConfigurationError("antenna.lever_arm has three numbers")
        if len(own.displacement_floor) not in (1, _AXES):
            raise ConfigurationError("tdcp_ins.displacement_floor has three numbers or one")
        inertial = LooseConfig(
            filter=config.filter,
            alignment=config.alignment,
            gnss=Gnss(
                use_velocity=own.velocity,
                position_gate=own.gate,
                velocity_gate=own.gate,
                # What is added to a displacement is in its record already.
                position_floor=(0.0, 0.0, 0.0),
                velocity_floor=own.velocity_floor,
                rejections=own.rejections,
                outage_limit=own.outage_limit,
                latency=own.latency,
            ),
            stops=config.stops,
            non_holonomic=config.non_holonomic,
            imu=config.imu,
            output=config.output,
        )
        state = super().start(inertial, context)
        fields = {field.name: getattr(state, field.name) for field in dataclasses.fields(state)}
        return TdcpInertialState(**fields, own=config)

    def step(self, state: LooseState, block: Block) -> tuple[LooseState, Outputs]:
        """Take a block of inertial samples and epochs of the chain."""
        places = block.get(channels.SOLUTION.name)
        if places is not None:
            if not isinstance(state, TdcpInertialState):
                raise TypeError("tdcp-ins goes on from its own state")
            links = link_records(places, block.get(channels.DISPLACEMENT.name), state.own)
            state.pending = np.concatenate([state.pending, links])
        return state, self._take(state, block.get(channels.IMU.name), places)


def link_records(places: Columns, displacements: Columns | None, config: TdcpInsConfig) -> Array:
    """Records of FIX_DTYPE of the epochs of a chain.

    Parameters
    ----------
    places : Columns of `replay.Solution`
        Of the stage `tdcp`.
    displacements : Columns of `replay.Displacement`, optional
        Those that lead to these places have their valid times.
    config : TdcpInsConfig
    """
    own = config.tdcp_ins
    rows = np.zeros(len(places), dtype=records.FIX_DTYPE)
    rows["t"] = places.valid_time_ns
    rows["log_t"] = places.log_time_ns
    rows["r"] = places["position_ecef_m"]
    rows["R"] = places["position_covariance_enu_m2"]
    rows["lever"] = config.antenna.lever_arm
    rows["chain"] = records.LINK_BEGIN
    rows["anchor"] = int(own.anchor)
    if displacements is None or len(displacements) == 0:
        return rows
    at = np.searchsorted(displacements.valid_time_ns, rows["t"])
    at = np.minimum(at, len(displacements) - 1)
    linked = displacements.valid_time_ns[at] == rows["t"]
    linked &= places["status"] == STATUS_CHAINED
    at = at[linked]
    part = rows[linked]
    part["since"] = displacements["since_ns"][at]
    span = (part["t"] - part["since"])[:, None] / _NS
    covariance = displacements["covariance_enu_m2"][at]
    part["d"] = displacements["displacement_ecef_m"][at]
    part["has_v"] = 1
    part["v"] = part["d"] / span
    part["V"] = covariance / (span * span)
    part["window"] = span[:, 0]
    if own.measurement == "position":
        part["chain"] = records.LINK_SUM
        part["D"][:, _DIAGONAL] = own.position_std * own.position_std
    else:
        part["chain"] = records.LINK_EACH
        part["D"] = covariance * (own.displacement_scale * own.displacement_scale)
        floor = np.array(own.displacement_floor)
        part["D"][:, _DIAGONAL] += floor * floor
    rows[linked] = part
    return rows
