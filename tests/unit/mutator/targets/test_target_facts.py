"""The facts on channels and metrics that a run stores."""

import pytest

from mutator.targets.channels import Role
from mutator.targets.target_facts import ChannelFacts, MetricFacts


def test_facts_are_stored_as_the_list_of_their_values() -> None:
    channel = ["gas", "-", "actuator", "pedals", "how far the pedal is pressed"]
    assert ChannelFacts.from_plain(channel).role is Role.ACTUATOR
    assert ChannelFacts.from_plain(channel).plain() == channel
    metric = ["margin_near", "m", "the smallest distance", "lower"]
    assert MetricFacts.from_plain(metric).worse == "lower"
    assert MetricFacts.from_plain(metric).plain() == metric


@pytest.mark.parametrize("values", [["gas", "-", "driver", "", ""], ["gas", "-", "actuator", ""], []])
def test_an_unknown_role_or_another_length_is_refused(values: list[str]) -> None:
    with pytest.raises(ValueError):
        ChannelFacts.from_plain(values)
