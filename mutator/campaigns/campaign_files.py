"""Campaign files: the faults, scenarios, triggers and limits of a campaign."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import check_library_name
from mutator.campaigns.campaign_model import CampaignModel, Canary, SelectionModel
from mutator.campaigns.campaign_triggers import (
    EVERY_READING,
    ListedTrigger,
    with_list,
)
from mutator.campaigns.installed_studies import Study, find_study
from mutator.campaigns.operator_selection import OperatorSelection, When
from mutator.config.yaml_files import load_yaml_model
from mutator.config.yaml_sources import KeyPath, YamlSource
from mutator.errors import MutatorError
from mutator.faults.library_readings import FILE, Readings
from mutator.model import AfterHazard, Limits, Method

SCHEMA = "campaign/1"
_SUFFIXES = (".yaml", ".yml")
_Told = TypeVar("_Told")


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """A selection of faults: a glob over `<module>/<fault_type>/<variant>`, a spec `file`, or `operators`."""

    spec: str
    file: Path | None = None
    values: int | None = None  # number of values from each variant, spread evenly; None: all
    operators: OperatorSelection | None = None


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A checked campaign file. Times are simulated seconds."""

    name: str
    about: str
    study: str | None  # the published work with which reports compare the run
    path: Path
    source: bytes
    target: str
    scenarios: tuple[str, ...]
    setting: Mapping[str, tuple[str, ...]]
    faults: tuple[Selection, ...]
    reading: str | None  # None: the library's default
    methods: tuple[Method, ...]
    table: str | None
    rows: tuple[str, ...] | None
    listed: tuple[ListedTrigger, ...]
    armed_after_s: Mapping[str, float]
    random_until_s: float | None
    hold_s: float | None  # how long faults stay active; None: while the context holds, or to the end
    sample: int | None  # number of experiments, balanced over the variants
    proportional: bool  # whether to sample pairs, in proportion to the size of each fault type and scenario
    seeds: range  # the campaign is repeated with each seed
    canary: Canary
    limits: Limits
    chunk: int
    after_hazard: AfterHazard
    yaml: YamlSource

    @property
    def seed(self) -> int:
        """The seed, or the first of several."""
        return self.seeds[0]

    def armed_after(self, reading: str) -> float | None:
        """Return the time at which triggers are armed; None if the campaign does not set it."""
        return _in(self.armed_after_s, reading) if self.armed_after_s else None

    def setting_in(self, reading: str) -> tuple[str, ...]:
        return _in(self.setting, reading)

    def setting_keys(self, reading: str) -> KeyPath:
        """Return where the campaign file has the value of `setting_in`."""
        return ("setting", reading) if reading in self.setting else ("setting",)

    def error(self, keys: KeyPath, got: str, *, expected: str, remedy: str) -> MutatorError:
        """Return an error at `keys` of the campaign file; the caller raises it."""
        return self.yaml.error(keys, got, expected=expected, remedy=remedy)


def _in(told: Mapping[str, _Told], reading: str) -> _Told:
    return told[reading] if reading in told else told[EVERY_READING]


def load_campaign(path: Path) -> Campaign:
    """Read a campaign file strictly; any mistake raises MutatorError with file and line.

    The study need not be installed, so that old runs can be read. `load_study` checks it.
    """
    model, source = load_yaml_model(path, CampaignModel, SCHEMA, prepare=with_list)
    _check_once(model, source)
    triggers = model.triggers
    for keys, name in {("target",): model.target, ("triggers", "table"): triggers.table or ""}.items():
        with source.locating_errors(keys):
            check_library_name(name, path)
    return Campaign(
        name=model.name,
        about=model.about.strip(),
        study=model.study,
        path=path,
        source=read_bounded(path),
        target=model.target,
        scenarios=tuple(model.scenarios),
        setting={reading: tuple(names) for reading, names in model.setting.items()},
        faults=tuple(
            Selection(
                spec=item.spec or "",
                file=_spec_file(path, item.spec or ""),
                values=item.values,
                operators=_operators(item),
            )
            for item in model.faults
        ),
        reading=model.reading,
        methods=tuple(Method(name) for name in model.methods),
        table=triggers.table,
        rows=tuple(triggers.rows) if triggers.rows else None,
        listed=tuple(triggers.listed or ()),
        armed_after_s=triggers.armed_after_s,
        random_until_s=triggers.random_until_s,
        hold_s=triggers.hold_s,
        sample=model.sample,
        proportional=model.proportional,
        seeds=_seeds(model),
        canary=model.canary,
        limits=model.limits,
        chunk=model.chunk,
        after_hazard=model.after_hazard,
        yaml=source,
    )


def _operators(item: SelectionModel) -> OperatorSelection | None:
    if item.operators is None:
        return None
    return OperatorSelection(
        operators=tuple(dict.fromkeys(item.operators)),
        places=tuple(item.in_ or ()),
        sample=item.sample,
        when=tuple(dict.fromkeys(item.when or When)),
    )


def _seeds(model: CampaignModel) -> range:
    if model.seeds is not None:
        return range(model.seeds.from_, model.seeds.to + 1)
    assert model.seed is not None  # the model requires one of the two
    return range(model.seed, model.seed + 1)


def _check_once(model: CampaignModel, source: YamlSource) -> None:
    settings: dict[KeyPath, Sequence[str]] = {
        ("setting",) if name == EVERY_READING else ("setting", name): names
        for name, names in model.setting.items()
    }
    once: dict[KeyPath, Sequence[str]] = {("scenarios",): model.scenarios, ("methods",): model.methods}
    for keys, values in (once | settings).items():
        seen = set[str]()
        for i, value in enumerate(values):
            if value in seen:
                raise source.error((*keys, i), f"'{value}' is listed twice", remedy="remove one of the two")
            seen.add(value)


def _spec_file(campaign: Path, spec: str) -> Path | None:
    return campaign.parent / spec if spec.endswith(_SUFFIXES) else None


def load_study(campaign: Campaign) -> Study | None:
    if campaign.study is None:
        return None
    try:
        return find_study(campaign.study)
    except MutatorError as error:
        raise campaign.yaml.error(
            ("study",), error.got, expected=error.expected, remedy=error.remedy
        ) from error


def check_readings(campaign: Campaign, readings: Readings) -> None:
    """Raise MutatorError for an undeclared reading, or if `armed_after_s` or `setting` omits a reading."""
    known = ", ".join(readings.names)
    remedy = f"correct the name, or declare the reading in the library's {FILE}"
    if campaign.reading is not None and campaign.reading not in readings.names:
        raise campaign.error(
            ("reading",), f"reading '{campaign.reading}'", expected=f"one of {known}", remedy=remedy
        )
    places: dict[KeyPath, tuple[str, Mapping[str, object]]] = {
        ("triggers", "armed_after_s"): ("time", campaign.armed_after_s),
        ("setting",): ("setting", campaign.setting),
    }
    for keys, (what, told) in places.items():
        if EVERY_READING in told or not told:
            continue
        for name in told:
            if name not in readings.names:
                raise campaign.error(
                    (*keys, name), f"reading '{name}'", expected=f"one of {known}", remedy=remedy
                )
        for name in readings.names:
            if name not in told:
                raise campaign.error(
                    keys,
                    f"no {what} for reading '{name}'",
                    expected=f"one for each of {known}",
                    remedy=f"add `{name}: ...`, or write one for all of them",
                )
