"""The schema of a campaign file."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticKnownError

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator._common.message_text import describe_choices
from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.campaigns.campaign_triggers import (
    EVERY_READING,
    Triggers,
    schema_with_readings,
    to_value_by_reading,
)
from mutator.campaigns.expectations import Expectation
from mutator.campaigns.exploration_section import DEFAULT_OBSERVE_S, ExplorationRequest
from mutator.campaigns.operator_selection import MutantActivity
from mutator.config.yaml_files import StrictModel, YamlRecord
from mutator.families.scenario_sampling import SAMPLING_METHODS
from mutator.limits import Limits
from mutator.model import AfterHazard, Method


def _validated_operator(name: str) -> str:
    if not OPERATOR_DOOR.has_name(name):
        *others, last = map(repr, OPERATOR_DOOR.names())
        raise PydanticKnownError("enum", {"expected": f"{', '.join(others)} or {last}"})
    return name


_OperatorName = Annotated[
    str,
    AfterValidator(_validated_operator),
    WithJsonSchema({"anyOf": [{"enum": OPERATOR_DOOR.shipped_names()}, {"type": "string"}]}),
]


class SelectionModel(StrictModel, title="A selection"):
    """Selects specs of the library by name, a spec file, or mutants of `operators`."""

    spec: str | None = Field(
        None,
        description="A glob over `<module>/<fault_type>/<variant>`, such as `sensor/*`, or the path of a "
        "spec file, relative to the campaign's folder and below it, or in the library: `my_fault.yaml`.",
    )
    values: int | None = Field(
        None, ge=1, description="How many values to take from each variant, spread evenly. Default: all."
    )
    operators: list[_OperatorName] | None = Field(
        None,
        min_length=1,
        description="Instead of `spec`: mutants of these [operators](operators.md), shipped or "
        "[of another package](doors.md#operator), in lines that the golden runs of the campaign's scenarios "
        "execute.",
    )
    in_: list[str] | None = Field(
        None,
        alias="in",
        min_length=1,
        description="Only with `operators`: where to mutate. Give `PATH` or `PATH::FUNCTION`; `*` is a "
        "wildcard, and `**` also matches across folders.",
    )
    sample: int | None = Field(
        None,
        ge=1,
        description="Only with `operators`: how many mutants to draw, spread over operators and functions. "
        "Default: all.",
    )
    when: list[Annotated[MutantActivity, Field(strict=False)]] | None = Field(
        None,
        min_length=1,
        description="Only with `operators`: `permanent` (under the trigger `always`) or `transient` (under "
        "the campaign's other triggers). Default: both.",
    )

    @model_validator(mode="after")
    def _check(self) -> "SelectionModel":
        if (self.spec is None) == (self.operators is None):
            raise ValueError("either a `spec` or `operators`")
        if self.operators is not None and (self.in_ is None or self.values is not None):
            raise ValueError("`operators` with `in`, and without `values`")
        if self.operators is None and any((self.in_, self.sample, self.when)):
            raise ValueError("`in`, `sample` and `when` only together with `operators`")
        return self


MOST_SEEDS = 10_000  # each repeats the whole campaign, so a larger range is probably mistyped
_NAMES_SCHEMA = {"type": "array", "items": {"type": "string"}}


@dataclass(frozen=True, slots=True, kw_only=True)
class Canary:
    """A fault known to be harmful. The campaign has results only if this fault causes its hazard."""

    __pydantic_config__ = pydantic_mapping_config("The canary")

    spec: str = field(
        metadata=yaml_metadata(
            "The full name of a variant, `<module>/<fault_type>/<variant>`. Its largest value runs first; "
            "the other values follow until one causes the hazard."
        )
    )
    scenario: str = field(metadata=yaml_metadata("The scenario."))
    hazard: str = field(metadata=yaml_metadata("The hazard that the fault must cause."))
    at_s: float = field(
        metadata=yaml_metadata("The time from which the fault is active.", ge=0.0, allow_inf_nan=False)
    )


class FamilyScenariosModel(StrictModel, title="Scenarios of a family"):
    """Concrete scenarios, drawn from a [family](family.md) of the library."""

    family: str = Field(description="The name of the family.")
    sample: int | None = Field(
        None, ge=1, le=1_000_000, description="How many to draw. Default, of a grid only: all."
    )
    sampling: str | None = Field(
        None,
        json_schema_extra={"enum": list(SAMPLING_METHODS)},
        description="The method. Default: the family's.",
    )

    @model_validator(mode="after")
    def _check(self) -> "FamilyScenariosModel":
        if self.sampling is not None and self.sampling not in SAMPLING_METHODS:
            raise ValueError(f"`sampling` {describe_choices(SAMPLING_METHODS)}")
        return self


_Scenarios = Annotated[
    Annotated[str, Tag("name")] | Annotated[FamilyScenariosModel, Tag("family")],
    Discriminator(lambda item: "family" if isinstance(item, dict | FamilyScenariosModel) else "name"),
]


class SeedsModel(StrictModel, title="Seeds"):
    """The seeds with which the campaign is repeated."""

    from_: int = Field(alias="from", ge=0, lt=2**63, description="The first seed.")
    to: int = Field(ge=0, lt=2**63, description="The last seed, included.")

    @model_validator(mode="after")
    def _check(self) -> "SeedsModel":
        if not 0 <= self.to - self.from_ < MOST_SEEDS:
            raise ValueError(f"`to` between {self.from_} and {self.from_ + MOST_SEEDS - 1}")
        return self


class CampaignModel(StrictModel, title="The file"):
    """What a campaign runs, and the limits of each run."""

    name: str = Field(pattern=r"^[a-z0-9_]+$", description="The name: lowercase letters, digits and `_`.")
    about: str = Field(description="The purpose of the campaign.")
    study: str | None = Field(
        None, description="The [study](../how-to/add-a-study.md) with which its reports compare the results."
    )
    target: str = Field(description="The name of the target's manifest.")
    scenarios: list[_Scenarios] = Field(
        min_length=1,
        description="The scenarios by name, each once, and scenarios of families: "
        "`[S1, {family: r157_deceleration, sample: 100}]`.",
    )
    setting: Annotated[
        dict[str, list[str]],
        BeforeValidator(to_value_by_reading),
        WithJsonSchema(schema_with_readings(_NAMES_SCHEMA)),
    ] = Field(
        {EVERY_READING: []},
        description="Changes from the manifest that apply to every run, including fault-free runs. Give one "
        "list, or a list for each reading, by name.",
    )
    faults: list[SelectionModel] = Field(
        description="The selections of faults. The campaign runs all of them. If the list is "
        "empty, the scenarios are driven without faults, and the results are their [hazards, alerts and "
        "margins](../how-to/drive-without-faults.md)."
    )
    reading: str | None = Field(
        None,
        description="One of the library's [readings](fault-spec.md#readings). Default: the first. "
        "`--reading` overrides it.",
    )
    methods: list[Annotated[Method, Field(strict=False)]] = Field(
        default_factory=lambda: [Method.GUIDED],
        min_length=1,
        description="`guided`, `random` or both. Default: `guided`.",
    )
    triggers: Triggers | None = Field(
        None, description="When faults become active. Required unless `faults` is empty."
    )
    explore: YamlRecord[ExplorationRequest] | None = Field(
        None,
        description="Explore the faults instead of running the values that the specs list: results decide "
        "which experiments follow. Without `triggers`, `methods`, `setting` and `sample`.",
    )
    sample: int | None = Field(
        None,
        ge=1,
        description="How many experiments to take, each variant equally often. Default: all.",
    )
    proportional: bool = Field(
        False,
        description="Sample each fault type in each scenario in proportion to its number of experiments, "
        "with guided and random experiments in pairs.",
    )
    seed: int | None = Field(
        None,
        ge=0,
        lt=2**63,
        description="The seed of all draws; `--seed` overrides it. Give either this or `seeds`.",
    )
    seeds: SeedsModel | None = Field(
        None,
        description="The seeds; the campaign, including its `sample`, is repeated with each. `--seed` runs "
        "one seed instead.",
    )
    defences: list[str | list[str]] | None = Field(
        None,
        description="Sets of the library's [defences](defence.md): the campaign runs again with each set in "
        "the target's tree, in a run folder of its own, `defended/<set>`. An item is the name of a defence, "
        "a list of several, or `none`, the run without defences, which is there in any case.",
    )
    observe_s: float | None = Field(
        None,
        ge=0.0,
        allow_inf_nan=False,
        description="Only with `defences`: for how many seconds a drive must go on after its fault without a "
        f"hazard, so that its hazard counts as prevented. Default: {DEFAULT_OBSERVE_S:g}.",
    )
    canary: YamlRecord[Canary] | None = Field(
        None,
        description="A check that a known fault causes a hazard. Only a campaign that selects nothing but "
        "`operators` can leave it out. Its runs must then show that a hazard can be reached: results and "
        "report begin with this, and the exit code is 1 if no experiment reaches one.",
    )
    after_hazard: Annotated[AfterHazard, Field(strict=False)] = Field(
        AfterHazard.GO_ON,
        description="`stop` ends each faulty run at its first [terminal "
        "hazard](../explanation/verdicts.md#the-end-of-the-drive). This saves time, but later "
        "hazards and alerts are not observed.",
    )
    include: Literal["hazard_without_fault"] | None = Field(
        None,
        description="`hazard_without_fault` also runs faults in scenarios whose golden run has a hazard, and "
        "[judges them by what they add](../explanation/verdicts.md#golden-runs-with-a-hazard). Default: such "
        "experiments are left out.",
    )
    expect: YamlRecord[Expectation] | None = Field(
        None,
        description="What results may be. Under pytest, an experiment with another hazard is a test that "
        "fails, and so is the build; records, tables and seal stay the same.",
    )
    limits: YamlRecord[Limits] = Field(Limits(), description="The resources that one run is allowed to use.")
    chunk: int = Field(
        20,
        ge=1,
        le=1000,
        description="How many experiments with the same golden run form a chunk. A shard has whole chunks, "
        "and the plan's digest depends on them.",
    )

    @model_validator(mode="after")
    def _check(self) -> "CampaignModel":
        if self.proportional and self.sample is None:
            raise ValueError("`sample`, the number of experiments, together with `proportional`")
        if self.proportional and any(selection.operators for selection in self.faults):
            raise ValueError("no `proportional` with `operators`, which have their own `sample`")
        if self.explore is not None:
            self._check_exploration()
        elif bool(self.faults) is not (self.triggers is not None):
            raise ValueError("`triggers`, because there are `faults`" if self.faults else "no `triggers`")
        if self.observe_s is not None and not self.defences:
            raise ValueError("`observe_s` only with `defences`")
        if not self.faults and self.canary is None:
            raise ValueError("a `canary`, without which nothing shows that a hazard can be reached")
        if self.canary is None and any(selection.operators is None for selection in self.faults):
            raise ValueError("a `canary`, because `faults` has a `spec`")
        if (self.seed is None) == (self.seeds is None):
            raise ValueError(
                "either `seed` or `seeds`" if self.seed is None else "`seed` or `seeds`, not both"
            )
        if Method.RANDOM in self.methods and self.triggers and self.triggers.random_until_s is None:
            raise ValueError("`random_until_s` in `triggers` for random times")
        return self

    def _check_exploration(self) -> None:
        others = {
            "triggers": self.triggers,
            "sample": self.sample,
            "expect": self.expect,
            "setting": any(self.setting.values()),
            "methods": self.methods != [Method.GUIDED],
            "seeds": self.seeds,
            "include": self.include,
            "study": self.study,
            "after_hazard": self.after_hazard is not AfterHazard.GO_ON,
            "defences": self.defences is not None,
        }
        for key, value in others.items():
            if value:
                raise ValueError(f"no `{key}` with `explore`")
        if not self.faults or any(selection.spec is None or selection.values for selection in self.faults):
            raise ValueError("`faults` with a `spec` each, and without `values`, with `explore`")
