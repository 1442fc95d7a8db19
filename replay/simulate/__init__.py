"""Simulated drives: trajectory, inertial unit, satellites, receivers and truth, into a log."""

from replay.simulate.scenario import Scenario, load_scenario, read_scenario
from replay.simulate.write import SimulationResult, make_channels, simulate, write_log

__all__ = [
    "Scenario",
    "SimulationResult",
    "load_scenario",
    "make_channels",
    "read_scenario",
    "simulate",
    "write_log",
]
