"""Campaign files: the faults, scenarios, triggers and limits of a campaign."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import MOST_NAME_BYTES, checked_name_not_path
from mutator._common.message_text import describe_choices
from mutator.campaigns.campaign_model import CampaignModel, Canary, SelectionModel
from mutator.campaigns.campaign_triggers import (
    EVERY_READING,
    ListedTrigger,
    TriggersModel,
    with_trigger_list_under_key,
)
from mutator.campaigns.expectations import Expectation
from mutator.campaigns.exploration_section import DEFAULT_OBSERVE_S, ExplorationRequest, ExplorationSection
from mutator.campaigns.installed_studies import CheckableStudy, load_installed_study
from mutator.campaigns.operator_selection import MutantActivity, OperatorSelection
from mutator.config.yaml_files import load_yaml_model
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.defences.defence_facts import set_name
from mutator.engines.run_limits import LIMITS_THAT_ARE_MEASURED, limits_before_measuring
from mutator.errors import MutatorError
from mutator.faults.library_readings import SpecReadings
from mutator.limits import Limits
from mutator.model import AfterHazard, GoldenClass, Method
from mutator.targets.hazard_severity import SeverityScale

SCHEMA = "campaign/1"
WITHOUT_DEFENCES = "none"  # in `defences`: the run without any
_SPEC_SUFFIXES = (".yaml", ".yml")
_Value = TypeVar("_Value")
_NO_TRIGGERS = TriggersModel.model_construct()  # of a campaign without faults


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSelection:
    """A selection of faults: a glob over `<module>/<fault_type>/<variant>`, a spec file, or operators."""

    spec_pattern: str
    spec_file: Path | None = None
    values_per_variant: int | None = None  # number of values from each variant, spread evenly; None: all
    operator_selection: OperatorSelection | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilySelection:
    """Concrete scenarios of a family: how many to draw (None: all of a grid), and how (None: its default)."""

    family: str
    count: int | None = None
    sampling: str | None = None


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A checked campaign file. Times are simulated seconds."""

    name: str
    purpose: str
    study: str | None  # the published work with which reports compare the run
    path: Path
    file_bytes: bytes
    target: str
    scenario_selections: tuple[str | FamilySelection, ...]  # names of scenarios, and families
    changes_by_reading: Mapping[str, tuple[str, ...]]
    fault_selections: tuple[FaultSelection, ...]
    reading: str | None  # None: the library's default
    methods: tuple[Method, ...]
    context_table: str | None
    context_ids: tuple[str, ...] | None
    listed_triggers: tuple[ListedTrigger, ...]
    armed_after_s_by_reading: Mapping[str, float]
    random_until_s: float | None
    hold_s: float | None  # how long faults stay active; None: while the context holds, or to the end
    sample_size: int | None  # number of experiments, balanced over the variants
    is_sample_proportional: (
        bool  # whether to sample pairs, in proportion to the size of each fault type and scenario
    )
    seeds: range  # the campaign is repeated with each seed
    canary: Canary | None  # None: a campaign of operators that has none
    limits: Limits
    chunk_size: int
    after_hazard: AfterHazard
    yaml_source: YamlSource
    expectation: Expectation | None = None  # what results may be under pytest; None: anything
    include: GoldenClass | None = None  # scenarios that run although their golden run has a hazard
    is_bench: bool = False  # what a bench fixed when it was opened; its experiments come in batches
    exploration: ExplorationSection | None = None  # what a bench explores; None if others decide
    exploration_request: ExplorationRequest | None = None  # what a campaign explores; None if it lists faults
    defence_sets: tuple[tuple[str, ...], ...] = ()  # names of defences; the run without any is not listed
    observe_s: float = DEFAULT_OBSERVE_S  # of a drive after a fault whose hazard is prevented

    @property
    def seed(self) -> int:
        """The seed, or the first of several."""
        return self.seeds[0]

    @property
    def is_fault_free(self) -> bool:
        """Whether it only drives its scenarios without faults."""
        return not self.fault_selections and not self.is_bench

    @property
    def scenarios(self) -> tuple[str, ...]:
        """The scenarios of the library that the file names."""
        return tuple(selection for selection in self.scenario_selections if isinstance(selection, str))

    @property
    def measured_limit_names(self) -> frozenset[str]:
        """The limits that the file does not name, and that golden runs therefore determine."""
        return LIMITS_THAT_ARE_MEASURED - set(self.yaml_source.data.get("limits") or ())

    @property
    def golden_run_limits(self) -> Limits:
        """The limits of runs without a fault."""
        return limits_before_measuring(self.limits, self.measured_limit_names)

    def armed_after_s_in(self, reading: str) -> float | None:
        """Return the time at which triggers are armed; None if the campaign does not set it."""
        return (
            _value_for_reading(self.armed_after_s_by_reading, reading)
            if self.armed_after_s_by_reading
            else None
        )

    def changes_in(self, reading: str) -> tuple[str, ...]:
        return _value_for_reading(self.changes_by_reading, reading)

    def keys_of_changes(self, reading: str) -> KeyPath:
        """Return where the campaign file has the value of `changes_in`."""
        return ("setting", reading) if reading in self.changes_by_reading else ("setting",)

    @contextmanager
    def locating_errors(self, keys: KeyPath) -> Iterator[None]:
        """Point errors without a line number to `keys` of the campaign file; leave others unchanged."""
        try:
            yield
        except MutatorError as err:
            if err.line is not None:
                raise
            raise self.error(
                keys, err.got, expected=err.expected or "", remedy=err.remedy or "correct the name"
            ) from None

    def error(self, keys: KeyPath, got: str, *, expected: str, remedy: str) -> MutatorError:
        """Return an error at `keys` of the campaign file; the caller raises it."""
        return self.yaml_source.error(keys, got, expected=expected, remedy=remedy)


def _value_for_reading(value_by_reading: Mapping[str, _Value], reading: str) -> _Value:
    return value_by_reading[reading] if reading in value_by_reading else value_by_reading[EVERY_READING]


def load_campaign(path: Path) -> Campaign:
    """Read a campaign file strictly; any mistake raises MutatorError with file and line.

    The study need not be installed, so that old runs can be read. `load_campaign_study` checks it.
    """
    model, source = load_yaml_model(path, CampaignModel, SCHEMA, prepare=with_trigger_list_under_key)
    _check_no_duplicates(model, source)
    triggers = model.triggers or _NO_TRIGGERS
    # these names become paths in the library
    for keys, name in {("target",): model.target, ("triggers", "table"): triggers.table or ""}.items():
        with source.locating_errors(keys):
            checked_name_not_path(name, path)
    return Campaign(
        name=model.name,
        purpose=model.about.strip(),
        study=model.study,
        path=path,
        file_bytes=read_bounded(path),
        target=model.target,
        scenario_selections=tuple(
            item
            if isinstance(item, str)
            else FamilySelection(family=item.family, count=item.sample, sampling=item.sampling)
            for item in model.scenarios
        ),
        changes_by_reading={reading: tuple(names) for reading, names in model.setting.items()},
        fault_selections=tuple(
            FaultSelection(
                spec_pattern=item.spec or "",
                spec_file=_spec_file_path(path, item.spec or ""),
                values_per_variant=item.values,
                operator_selection=_operator_selection(item),
            )
            for item in model.faults
        ),
        reading=model.reading,
        methods=tuple(Method(name) for name in model.methods),
        context_table=triggers.table,
        context_ids=tuple(triggers.rows) if triggers.rows else None,
        listed_triggers=tuple(triggers.listed or ()),
        armed_after_s_by_reading=triggers.armed_after_s,
        random_until_s=triggers.random_until_s,
        hold_s=triggers.hold_s,
        sample_size=model.sample,
        is_sample_proportional=model.proportional,
        seeds=_seed_range(model),
        canary=model.canary,
        limits=model.limits,
        chunk_size=model.chunk,
        after_hazard=model.after_hazard,
        yaml_source=source,
        expectation=model.expect,
        include=GoldenClass(model.include) if model.include else None,
        exploration_request=model.explore,
        defence_sets=_defence_sets(model, source),
        observe_s=DEFAULT_OBSERVE_S if model.observe_s is None else model.observe_s,
    )


def _defence_sets(model: CampaignModel, source: YamlSource) -> tuple[tuple[str, ...], ...]:
    sets: list[tuple[str, ...]] = []
    for i, item in enumerate(model.defences or ()):
        names = (item,) if isinstance(item, str) else tuple(item)
        if names == (WITHOUT_DEFENCES,):
            continue
        for name in names:
            if name == WITHOUT_DEFENCES or not name.isidentifier() or names.count(name) > 1:
                raise source.error(
                    ("defences", i),
                    f"'{name}'",
                    expected=f"names of different defences, or `{WITHOUT_DEFENCES}` alone",
                    remedy="correct the set",
                )
        if not names or set(names) in map(set, sets):
            raise source.error(
                ("defences", i),
                "a set of no defence" if not names else f"the set {set_name(names)} twice",
                expected="different sets of defences",
                remedy="remove it",
            )
        if len(set_name(names).encode()) > MOST_NAME_BYTES:
            raise source.error(
                ("defences", i),
                f"{len(names)} defences whose names have {len(set_name(names).encode())} bytes together",
                expected=f"at most {MOST_NAME_BYTES}, because the run folder of the set has their names",
                remedy="give the defences shorter names, or test them in smaller sets",
            )
        sets.append(names)
    return tuple(sets)


def _operator_selection(item: SelectionModel) -> OperatorSelection | None:
    if item.operators is None:
        return None
    return OperatorSelection(
        operators=tuple(dict.fromkeys(item.operators)),
        places=tuple(item.in_ or ()),
        sample_size=item.sample,
        activities=tuple(dict.fromkeys(item.when or MutantActivity)),
    )


def _seed_range(model: CampaignModel) -> range:
    if model.seeds is not None:
        return range(model.seeds.from_, model.seeds.to + 1)
    assert model.seed is not None  # the model requires one of the two
    return range(model.seed, model.seed + 1)


def _check_no_duplicates(model: CampaignModel, source: YamlSource) -> None:
    settings: dict[KeyPath, Sequence[str]] = {
        ("setting",) if name == EVERY_READING else ("setting", name): names
        for name, names in model.setting.items()
    }
    scenarios = [item if isinstance(item, str) else f"family {item.family}" for item in model.scenarios]
    lists: dict[KeyPath, Sequence[str]] = {("scenarios",): scenarios, ("methods",): model.methods}
    for keys, values in (lists | settings).items():
        earlier = set[str]()
        for i, value in enumerate(values):
            if value in earlier:
                raise source.error((*keys, i), f"'{value}' is listed twice", remedy="remove one of the two")
            earlier.add(value)


def _spec_file_path(campaign: Path, spec: str) -> Path | None:
    return campaign.parent / spec if spec.endswith(_SPEC_SUFFIXES) else None


def load_campaign_study(campaign: Campaign) -> CheckableStudy | None:
    if campaign.study is None:
        return None
    try:
        return load_installed_study(campaign.study)
    except MutatorError as error:
        raise campaign.yaml_source.error(
            ("study",), error.got, expected=error.expected, remedy=error.remedy
        ) from error


def check_expectation(
    expectation: Expectation,
    source: YamlSource,
    keys: KeyPath,
    hazards: Collection[str],
    scale: SeverityScale | None,
) -> None:
    """Raise MutatorError if what a file has at `keys` names a hazard, or a class of severity, that there is
    not.
    """
    for i, name in enumerate(expectation.hazards or ()):
        if name not in hazards:
            raise source.error(
                (*keys, "hazards", i),
                f"hazard '{name}'",
                expected=describe_choices(hazards),
                remedy="name a hazard of the target's manifest",
            )
    classes = [name for name, _, _ in scale.classes] if scale else []
    if expectation.severity is not None and expectation.severity not in classes:
        raise source.error(
            (*keys, "severity"),
            f"severity '{expectation.severity}'",
            expected=describe_choices(classes) if classes else "a target whose manifest has a `severity`",
            remedy="name a class of the target's severity scale",
        )


def check_readings(campaign: Campaign, readings: SpecReadings) -> None:
    """Raise MutatorError for an undeclared reading, or if `armed_after_s` or `setting` omits a reading."""
    readings_text = ", ".join(readings.names)
    expected, remedy = readings.expected_text, readings.remedy
    if campaign.reading is not None and campaign.reading not in readings.names:
        raise campaign.error(("reading",), f"reading '{campaign.reading}'", expected=expected, remedy=remedy)
    places: dict[KeyPath, tuple[str, Mapping[str, object]]] = {
        ("triggers", "armed_after_s"): ("time", campaign.armed_after_s_by_reading),
        ("setting",): ("setting", campaign.changes_by_reading),
    }
    for keys, (noun, value_by_reading) in places.items():
        if EVERY_READING in value_by_reading or not value_by_reading:
            continue
        for name in value_by_reading:
            if name not in readings.names:
                raise campaign.error((*keys, name), f"reading '{name}'", expected=expected, remedy=remedy)
        for name in readings.names:
            if name not in value_by_reading:
                raise campaign.error(
                    keys,
                    f"no {noun} for reading '{name}'",
                    expected=f"one for each of {readings_text}",
                    remedy=f"add `{name}: ...`, or write one for all of them",
                )
