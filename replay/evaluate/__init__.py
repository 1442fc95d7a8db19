"""A run against truth: errors, drift in outages, consistency of the filter."""

from replay.evaluate.report import Evaluation
from replay.evaluate.run import RunChannels, evaluate_channels, evaluate_run, read_run
from replay.evaluate.table import print_evaluation

__all__ = [
    "Evaluation",
    "RunChannels",
    "evaluate_channels",
    "evaluate_run",
    "print_evaluation",
    "read_run",
]
