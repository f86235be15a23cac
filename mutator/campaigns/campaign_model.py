"""The schema of a campaign file."""

from typing import Annotated

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from mutator.campaigns.operator_selection import When
from mutator.campaigns.trigger_choice import (
    EVERY_READING,
    MOST,
    Triggers,
    by_reading,
    or_by_reading,
)
from mutator.config.yaml_files import StrictModel
from mutator.model import AfterHazard, Method
from mutator.operators.names import Operator


class SelectionModel(StrictModel, title="A selection"):
    """Faults of the library by the names of their specs, faults of a spec file, or mutants of `operators`."""

    spec: str | None = Field(
        None,
        description="A glob over `<module>/<fault_type>/<variant>`: `sensor/*`, `sensor/speed/low`; or a "
        "spec file that is not in the library, by its path from the folder of the campaign: `my_fault.yaml`.",
    )
    values: int | None = Field(
        None, ge=1, description="How many of each variant's values, spread evenly; without it, all."
    )
    operators: list[Annotated[Operator, Field(strict=False)]] | None = Field(
        None,
        min_length=1,
        description="Instead of a spec: the mutants of these [operators](operators.md), in lines that golden "
        "runs of the campaign's scenarios execute.",
    )
    in_: list[str] | None = Field(
        None,
        alias="in",
        min_length=1,
        description="With operators: where, `PATH::FUNCTION` or `PATH`, with `*`, and `**` over folders.",
    )
    sample: int | None = Field(
        None,
        ge=1,
        description="With operators: how many mutants, drawn by operator and function; without it, all.",
    )
    when: list[Annotated[When, Field(strict=False)]] | None = Field(
        None,
        min_length=1,
        description="With operators: `permanent` (under the trigger `always`), `transient` (under the "
        "campaign's other triggers) or, without it, both.",
    )

    @model_validator(mode="after")
    def _check(self) -> "SelectionModel":
        if (self.spec is None) == (self.operators is None):
            raise ValueError("either a `spec` or `operators`")
        if self.operators is not None and (self.in_ is None or self.values is not None):
            raise ValueError("`operators` with `in`, and without `values`")
        if self.operators is None and any((self.in_, self.sample, self.when)):
            raise ValueError("`in`, `sample` and `when` with `operators` alone")
        return self


MOST_SEEDS = 10_000
_NAMES = {"type": "array", "items": {"type": "string"}}


class _CanaryModel(StrictModel, title="The canary"):
    """A fault known to be harmful. The campaign starts only if it reaches its hazard."""

    spec: str = Field(
        description="A variant's whole name, `<module>/<fault_type>/<variant>`; its largest value is taken, "
        "then the others until one does harm."
    )
    scenario: str = Field(description="The scenario.")
    hazard: str = Field(description="The hazard that it must reach.")
    at_s: float = Field(ge=0.0, allow_inf_nan=False, description="The time from which the fault is active.")


class _LimitsModel(StrictModel, title="Limits"):
    """What one run may use before it is stopped."""

    cpu_s: int = Field(default=60, ge=1, le=MOST, description="Seconds of CPU.")
    wall_s: int = Field(default=300, ge=1, le=MOST, description="Seconds of wall time.")
    memory_mb: int = Field(default=4096, ge=256, le=MOST, description="MiB of address space.")
    steps: int = Field(default=20_000, ge=1, le=MOST, description="Steps of simulation.")
    disk_mb: int = Field(
        default=1024,
        ge=1,
        le=MOST,
        description="MiB in its output folder and TMPDIR together, and in any single file that it writes.",
    )


class SeedsModel(StrictModel, title="Seeds"):
    """The campaign is repeated with each of these seeds."""

    from_: int = Field(alias="from", ge=0, lt=2**63, description="The first seed.")
    to: int = Field(ge=0, lt=2**63, description="The last seed (included).")

    @model_validator(mode="after")
    def _check(self) -> "SeedsModel":
        if not 0 <= self.to - self.from_ < MOST_SEEDS:
            raise ValueError(f"`to` from {self.from_} to {self.from_ + MOST_SEEDS - 1}, not {self.to}")
        return self


class CampaignModel(StrictModel, title="The file"):
    """What to run, and what each run may use."""

    name: str = Field(pattern=r"^[a-z0-9_]+$", description="Its name: small letters, digits and `_`.")
    about: str = Field(description="What it is for.")
    study: str | None = Field(
        None, description="The [study](../how-to/add-a-study.md) that its reports compare the results with."
    )
    target: str = Field(description="The target, by the name of its manifest.")
    scenarios: list[str] = Field(min_length=1, description="Names of scenarios, each once.")
    setting: Annotated[
        dict[str, list[str]], BeforeValidator(by_reading), WithJsonSchema(or_by_reading(_NAMES))
    ] = Field(
        {EVERY_READING: []},
        description="Changes of the manifest for every run, including fault-free ones: one "
        "list, or one for each reading by its name.",
    )
    faults: list[SelectionModel] = Field(min_length=1, description="Which faults; each selection adds some.")
    reading: str | None = Field(
        None,
        description="One of the library's [readings](fault-spec.md#readings); without it, the first. "
        "`--reading` overrides it.",
    )
    methods: list[Annotated[Method, Field(strict=False)]] = Field(
        default_factory=lambda: [Method.GUIDED],
        min_length=1,
        description="`guided`, `random` or both; without it, `guided`.",
    )
    triggers: Triggers = Field(description="When faults become active.")
    sample: int | None = Field(
        None,
        ge=1,
        description="How many experiments are taken, equally per variant; without it, all.",
    )
    proportional: bool = Field(
        False,
        description="The sample takes each fault type in each scenario in proportion to its number, guided "
        "and random ones in pairs.",
    )
    seed: int | None = Field(
        None,
        ge=0,
        lt=2**63,
        description="The seed of all draws; `--seed` overrides it. Give either this or `seeds`.",
    )
    seeds: SeedsModel | None = Field(
        None,
        description="Several seeds: the campaign is repeated with each, `sample` included. `--seed` takes "
        "one seed instead.",
    )
    canary: _CanaryModel = Field(description="The check that a known fault causes a hazard.")
    after_hazard: Annotated[AfterHazard, Field(strict=False)] = Field(
        AfterHazard.GO_ON,
        description="`stop` ends each faulty run at its first [terminal hazard](../explanation/verdicts.md"
        "#the-end-of-the-drive), which saves time; later hazards and alerts are then not observed.",
    )
    limits: _LimitsModel = Field(_LimitsModel(), description="What one run may use.")
    chunk: int = Field(
        20,
        ge=1,
        le=1000,
        description="How many experiments a worker takes at a time.",
    )

    @model_validator(mode="after")
    def _check(self) -> "CampaignModel":
        if self.proportional and self.sample is None:
            raise ValueError("proportional without sample: say how many")
        if self.proportional and any(one.operators for one in self.faults):
            raise ValueError("proportional with `operators`: they have a `sample` of their own")
        if (self.seed is None) == (self.seeds is None):
            raise ValueError(
                "either `seed` or `seeds`" if self.seed is None else "`seed` or `seeds`, not both"
            )
        if Method.RANDOM in self.methods and self.triggers.random_until_s is None:
            raise ValueError("`random_until_s` in `triggers` for random times")
        return self
