"""The facts on channels and metrics that a run stores."""

import pytest

from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import TypeMisfit
from mutator.targets.channels import Role
from mutator.targets.stored_target_facts import ChannelFacts, MetricFacts


def test_facts_are_stored_as_the_list_of_their_values() -> None:
    channel = ["gas", "-", "actuator", "pedals", "how far the pedal is pressed"]
    assert typed_value_from_json(ChannelFacts, channel).role is Role.ACTUATOR
    assert as_json_types(typed_value_from_json(ChannelFacts, channel)) == channel
    metric = ["margin_near", "m", "the smallest distance", "lower"]
    assert typed_value_from_json(MetricFacts, metric).worse == "lower"
    assert as_json_types(typed_value_from_json(MetricFacts, metric)) == metric


@pytest.mark.parametrize("values", [["gas", "-", "driver", "", ""], ["gas", "-", "actuator", ""], []])
def test_an_unknown_role_or_another_length_is_refused(values: list[str]) -> None:
    with pytest.raises(TypeMisfit):
        typed_value_from_json(ChannelFacts, values)
