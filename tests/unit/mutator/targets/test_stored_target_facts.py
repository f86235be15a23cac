"""The facts on channels and metrics that a run stores."""

import pytest

from mutator._common.hashing import as_json_types
from mutator._common.typed_json import from_json_types
from mutator.errors import TypeMisfit
from mutator.targets.channels import Role
from mutator.targets.stored_target_facts import ChannelFacts, MetricFacts


def test_facts_are_stored_as_the_list_of_their_values() -> None:
    channel = ["gas", "-", "actuator", "pedals", "how far the pedal is pressed"]
    assert from_json_types(ChannelFacts, channel).role is Role.ACTUATOR
    assert as_json_types(from_json_types(ChannelFacts, channel)) == channel
    metric = ["margin_near", "m", "the smallest distance", "lower"]
    assert from_json_types(MetricFacts, metric).worse == "lower"
    assert as_json_types(from_json_types(MetricFacts, metric)) == metric


@pytest.mark.parametrize("values", [["gas", "-", "driver", "", ""], ["gas", "-", "actuator", ""], []])
def test_an_unknown_role_or_another_length_is_refused(values: list[str]) -> None:
    with pytest.raises(TypeMisfit):
        from_json_types(ChannelFacts, values)
