"""What an exploration drives, as the file of its bench fixes it."""

from dataclasses import dataclass, field
from typing import Literal

from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.config.yaml_files import YamlRecord
from mutator.limits import MOST_LIMIT_OR_TIME

ChallengerKind = Literal["alternating", "ramp", "noise", "glitch"]
MOST_PLANES = 10_000
DEFAULT_OBSERVE_S = 15.0  # how long a drive must go on after a fault that it survived
STRATEGIES = ("planes", "random")
MOST_SEEDS = 100
_MOST_POINTS = 200
CHALLENGER_KINDS: tuple[ChallengerKind, ...] = ("alternating", "ramp", "noise", "glitch")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExploredPlane:
    """Faults of one kind in one scenario, from one time on: their magnitude and duration differ."""

    __pydantic_config__ = pydantic_mapping_config("A plane")

    spec: str = field(
        metadata=yaml_metadata("The full name of a variant, `<module>/<fault_type>/<variant>`.")
    )
    scenario: str = field(
        metadata=yaml_metadata("A scenario's name, or a family with values: `r157_deceleration:ego=60`.")
    )
    start: str = field(
        metadata=yaml_metadata("When the fault begins, as it was asked for: a time in s or a context.")
    )
    condition: str = field(
        metadata=yaml_metadata(
            "The same as a condition over observed values. The fault begins when the golden run first "
            "meets it."
        )
    )
    armed_after_s: float = field(
        default=0.0,
        metadata=yaml_metadata("From when the condition counts, in s.", ge=0, le=MOST_LIMIT_OR_TIME),
    )
    magnitudes: list[float] = field(
        metadata=yaml_metadata(
            "The values of the fault, in the unit of its spec, by their size. Empty for a fault without one.",
            max_length=_MOST_POINTS,
        )
    )
    durations_s: list[float] = field(
        metadata=yaml_metadata("How long the fault lasts, ascending.", min_length=1, max_length=_MOST_POINTS)
    )
    unit: str = field(default="", metadata=yaml_metadata("The unit of the magnitudes; empty without one."))
    seed: int = field(default=0, metadata=yaml_metadata("The seed of the runs.", ge=0, lt=2**63))
    seeds: int = field(
        default=1,
        metadata=yaml_metadata(
            "How many seeds of its random numbers the fault has in each cell.", ge=1, le=MOST_SEEDS
        ),
    )
    challengers: tuple[str, ...] = field(
        default=(),
        metadata=yaml_metadata(
            "The errors that change, by name, which must be survived where the constant one is. Empty if the "
            "fault is not challenged.",
            strict=False,
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationSection:
    """What an exploration drives: planes, and how each is searched."""

    __pydantic_config__ = pydantic_mapping_config("An exploration")

    planes: list[YamlRecord[ExploredPlane]] = field(
        metadata=yaml_metadata("The planes.", min_length=1, max_length=MOST_PLANES)
    )
    goal: Literal["envelope", "find"] = field(
        default="envelope",
        metadata=yaml_metadata(
            "`envelope`: the border of what is survived, in each plane. `find`: as many small and short "
            "hazardous faults as possible, in all planes together."
        ),
    )
    strategy: Literal["planes", "random"] = field(
        default="planes",
        metadata=yaml_metadata("Of `find`: `planes` learns from results; `random` draws cells, to compare."),
    )
    budget: int = field(
        default=300, metadata=yaml_metadata("Of `find`: the number of runs.", ge=1, le=1_000_000)
    )
    observe_s: float = field(
        default=DEFAULT_OBSERVE_S,
        metadata=yaml_metadata(
            "How long a drive must go on after a fault to count as without hazard, in s. If the target can "
            "stop a run, runs end then.",
            ge=0,
            le=MOST_LIMIT_OR_TIME,
        ),
    )
    search: int = field(
        default=120, metadata=yaml_metadata("The most runs of the search of a plane.", ge=1, le=100_000)
    )
    validation: int = field(
        default=86,
        metadata=yaml_metadata(
            "How many cells of each plane are drawn from those that the search calls without hazard, and "
            "driven. 0: none.",
            ge=0,
            le=100_000,
        ),
    )
    batch: int = field(
        default=16, metadata=yaml_metadata("The most experiments of a batch.", ge=1, le=10_000)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationRequest:
    """What a campaign explores: its faults in its scenarios, from these starts on."""

    __pydantic_config__ = pydantic_mapping_config("What is explored")

    goal: Literal["envelope", "find"] = field(
        default="envelope",
        metadata=yaml_metadata(
            "`envelope`: [what is survived](../how-to/find-what-is-survived.md) of each fault, by magnitude "
            "and duration. `find`: small and short hazardous faults among all."
        ),
    )
    starts: list[float | str] = field(
        metadata=yaml_metadata(
            "When faults begin: times in s, or contexts, which mean the first time that the golden run is in "
            "them.",
            min_length=1,
        )
    )
    points: int = field(
        default=51,
        metadata=yaml_metadata(
            "Of `envelope`: at most this many magnitudes, and durations.", ge=2, le=_MOST_POINTS
        ),
    )
    longest_s: float = field(
        default=15.0, metadata=yaml_metadata("The longest duration, in s.", gt=0, le=MOST_LIMIT_OR_TIME)
    )
    observe_s: float = field(
        default=DEFAULT_OBSERVE_S,
        metadata=yaml_metadata(
            "How long a drive must go on after a fault to count as without hazard, in s. If the target can "
            "stop a run, runs end then.",
            ge=0,
            le=MOST_LIMIT_OR_TIME,
        ),
    )
    search: int = field(
        default=120,
        metadata=yaml_metadata("Of `envelope`: the most runs of the search of a plane.", ge=1, le=100_000),
    )
    validation: int = field(
        default=86,
        metadata=yaml_metadata(
            "Of `envelope`: how many cells of each plane are drawn from those called without hazard. 0: "
            "none.",
            ge=0,
            le=100_000,
        ),
    )
    seeds: int = field(
        default=3,
        metadata=yaml_metadata(
            "Of `envelope`: with how many seeds a fault that has random numbers is driven in each cell. The "
            "cell is without hazard only if all these runs are.",
            ge=1,
            le=MOST_SEEDS,
        ),
    )
    challengers: tuple[ChallengerKind, ...] = field(
        default=CHALLENGER_KINDS,
        metadata=yaml_metadata(
            "Of `envelope`: errors that change, which must be survived where a constant error of the same "
            "size is: with `alternating` sign, a `ramp`, `noise`, a repeated `glitch`. `[]`: none.",
            strict=False,
        ),
    )
    strategy: Literal["planes", "random"] = field(
        default="planes",
        metadata=yaml_metadata("Of `find`: `planes` learns from results; `random` draws faults, to compare."),
    )
    budget: int = field(
        default=300, metadata=yaml_metadata("Of `find`: the number of runs.", ge=1, le=1_000_000)
    )
    batch: int = field(
        default=16, metadata=yaml_metadata("The most experiments of a batch.", ge=1, le=10_000)
    )
