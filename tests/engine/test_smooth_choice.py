"""Which runs can be smoothed: all filters, and of the others it is said why not."""

import pytest

from replay import channels, configuration
from replay.engine.pipelines import PIPELINES
from replay.errors import MissingChannelError
from replay.stages.smooth_choice import find_run
from replay.stages.smooth_config import SmoothConfig

REASONS = {name: p.unsmoothed for name, p in PIPELINES.items() if p.unsmoothed}
SOLUTION, TRANSITION = channels.SOLUTION, channels.FILTER_TRANSITION


def choose(topics, run=""):
    config = configuration.build(SmoothConfig, [{"smooth": {"run": run}}])
    return find_run(config, topics, REASONS)


def test_every_pipeline_records_or_says_why_not():
    """One of the two, and not both."""
    for name, pipeline in PIPELINES.items():
        if name != "smooth":
            records = hasattr(pipeline.config(), "smoothing")
            assert records != bool(pipeline.unsmoothed), name
    assert set(REASONS) == {"spp", "tdcp", "network", "network-virtual"}


@pytest.mark.parametrize(
    ("name", "topic"),
    [
        ("spp", SOLUTION.at(run="spp")),
        ("tdcp", SOLUTION.at(run="tdcp")),
        ("network", channels.NETWORK_ERRORS.at(baseline="a-b")),
    ],
)
def test_runs_that_are_no_filters_are_told_so(name, topic):
    with pytest.raises(MissingChannelError) as caught:
        choose([topic])
    assert f"{name}: {REASONS[name]}" in str(caught.value)
    assert "smoothing.record" not in str(caught.value)


def test_a_filter_that_did_not_record_is_told_how_to():
    with pytest.raises(MissingChannelError, match=r"(?s)rtk: .*without.*smoothing\.record=true"):
        choose([SOLUTION.at(run="rtk"), SOLUTION.at(run="spp")])


def test_one_that_is_asked_for_and_cannot_be_is_named():
    topics = [SOLUTION.at(run="spp"), SOLUTION.at(run="rtk"), TRANSITION.at(run="rtk")]
    assert choose(topics) == "rtk"
    with pytest.raises(MissingChannelError, match="not spp: every epoch is solved by itself"):
        choose(topics, "spp")
    with pytest.raises(MissingChannelError, match=r"(?s)not x.*smooth\.run=rtk"):
        choose(topics, "x")


def test_a_smoothed_run_is_not_smoothed_again():
    with pytest.raises(MissingChannelError, match="smoothed already"):
        choose([SOLUTION.at(run="rtk-smoothed")])
