"""A run against truth: errors, drift in outages, consistency of the filter."""

from replay.evaluate.read import RunChannels, read_run, runs_of
from replay.evaluate.report import Evaluation
from replay.evaluate.run import evaluate_channels, evaluate_run
from replay.evaluate.table import print_evaluation

__all__ = [
    "Evaluation",
    "RunChannels",
    "evaluate_channels",
    "evaluate_run",
    "print_evaluation",
    "read_run",
    "runs_of",
]
