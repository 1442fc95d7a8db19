"""Smoothing is compiled ahead as every pipeline is, though no recorded channel leads to it."""

from replay.engine.warmup import compile_kernels


def test_the_smoother_can_be_compiled_ahead():
    assert compile_kernels(["smooth"]) > 0.0
