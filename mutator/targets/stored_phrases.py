"""The phrases that a run stores, so that the sentence about an experiment needs no library."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mutator._common.phrase_texts import PhraseTexts

HIGHER, LOWER = "higher", "lower"  # the direction of an actuator's first change
NO_NUMBER = "no_number"  # that change, if the actuator becomes NaN; tables would read `nan` as an empty cell
FIRST_CHANGE_SHARE = "first_change_share"  # name in records and results
# names of the speeds in records and results
SPEED_AT_ACTIVATION, HIGHEST_SPEED, LOWEST_SPEED = "speed_at_activation", "highest_speed", "lowest_speed"
GOLDEN_HIGHEST_SPEED, GOLDEN_LOWEST_SPEED = "golden_highest_speed", "golden_lowest_speed"
POSITIVE, NEGATIVE = "positive", "negative"  # cases of a phrase with a sign
LATER_HOLE = "later"  # in phrases of hazards: when the hazard occurred
PhraseByCase = Mapping[str, PhraseTexts]


@dataclass(frozen=True, kw_only=True)
class Phrases:
    """Phrases by what they are about; the inner keys are cases, such as `positive` ('': all cases).

    `faults`: by variant, `<module>/<fault_type>/<variant>`; `models`: by fault model; `situations`: by the
    context of the campaign's table; `hazards`; `actuators`: by channel.
    """

    faults: Mapping[str, PhraseByCase] = field(default_factory=dict)
    models: Mapping[str, PhraseByCase] = field(default_factory=dict)
    situations: Mapping[str, PhraseByCase] = field(default_factory=dict)
    hazards: Mapping[str, PhraseByCase] = field(default_factory=dict)
    actuators: Mapping[str, PhraseByCase] = field(default_factory=dict)
