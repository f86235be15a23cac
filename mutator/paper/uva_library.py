"""Build specs and campaigns from the fault files of the paper's authors."""

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mutator._common.shipped_files import shipped_folder
from mutator.checks.library_check import spec_problems
from mutator.config.units import split_key_at_unit
from mutator.config.yaml_writing import yaml_text
from mutator.errors import MutatorError
from mutator.faults.fault_specs import load_spec
from mutator.onboarding.library_import import EntryOutcome, ImportedEntry, ImportedLibrary
from mutator.paper.uva_campaigns import CODED_READING, TARGET, campaign_name, campaign_text
from mutator.paper.uva_conditions import FileCondition, parse_condition
from mutator.paper.uva_earlier_places import EARLIER_PLACES
from mutator.paper.uva_files import FaultFile, FaultLine, read_fault_files
from mutator.paper.uva_places import VISION_PLACES, HookPlace
from mutator.workspace import Workspace

_FREE_ROAD_HAZARD, _FREE_ROAD = "H2", "no_lead"
_READINGS = ("as_described", CODED_READING)


@dataclass(frozen=True, slots=True, kw_only=True)
class _PlacedLine:
    """A line that can be imported, with its values in the unit of the place's draws."""

    line: int
    values: tuple[float | int, ...]


@dataclass(slots=True, kw_only=True)
class _Group:
    """Lines of a file that become the faults of one variant."""

    place: HookPlace
    condition: FileCondition
    lines: list[_PlacedLine] = field(default_factory=list)


def import_fault_files(source: Path) -> ImportedLibrary:
    """Return what becomes of the authors' fault files in a folder; see `LibraryImporter.read`."""
    files, ignored = read_fault_files(source)
    return _LibraryBuilder(files, Workspace.find(root=shipped_folder())).build(ignored)


def _places_for(files: Sequence[FaultFile]) -> tuple[HookPlace, ...]:
    """Return the map of the library that the files belong to. The two share some hooks."""
    vision, earlier = (
        {(place.source, place.hook) for place in places} for places in (VISION_PLACES, EARLIER_PLACES)
    )
    hooks = {(file.source, file.hook): file for file in files}
    only_vision, only_earlier = hooks.keys() & vision - earlier, hooks.keys() & earlier - vision
    # what both have at one hook differs in its condition
    earlier_conditions = ("plant.current_time()", "d_rel")
    is_earlier = bool(only_earlier) or any(
        line.condition.startswith(earlier_conditions) for file in files for line in file.lines
    )
    if is_earlier and only_vision:
        raise MutatorError(
            f"hook {hooks[min(only_vision)].hook} of OpenpilotWithVision among files of UVA-DSA/openpilot",
            where=hooks[min(only_vision)].name,
            expected="the files of one repository",
            remedy="import each repository into a library of its own",
        )
    return EARLIER_PLACES if is_earlier else VISION_PLACES


class _LibraryBuilder:
    def __init__(self, files: Sequence[FaultFile], shipped: Workspace) -> None:
        self._files = files
        self._shipped = shipped
        self._specs = {spec.name: spec for spec in shipped.specs()}
        self._models, self._manifest = shipped.fault_models(), shipped.manifest(TARGET)
        self._places = _places_for(files)
        self._texts: dict[str, str] = {}
        self._variants_by_campaign: dict[tuple[str, tuple[str, ...]], list[str]] = {}
        self._campaign_names: dict[tuple[str, tuple[str, ...]], str] = {}

    def build(self, ignored: Mapping[str, str]) -> ImportedLibrary:
        entries = [entry for file in self._files for entry in self._import_file(file)]
        for campaign, variants in self._variants_by_campaign.items():
            name = self._campaign_names[campaign]
            self._texts[f"campaigns/{name}.yaml"] = campaign_text(name, *campaign, [*dict.fromkeys(variants)])
        return ImportedLibrary(entries=tuple(entries), texts=self._texts, ignored=ignored)

    def _import_file(self, file: FaultFile) -> Iterable[ImportedEntry]:
        groups: list[_Group] = []
        refused: list[ImportedEntry] = []
        for line in file.lines:
            try:
                self._place_line(file, line, groups)
            except ValueError as error:
                refused.append(
                    ImportedEntry(
                        file=file.name, line=line.line, outcome=EntryOutcome.REFUSED, reason=str(error)
                    )
                )
        entries = [entry for group in self._write_groups(file, groups) for entry in group]
        return sorted([*entries, *refused], key=lambda entry: entry.line)

    def _place_line(self, file: FaultFile, line: FaultLine, groups: list[_Group]) -> None:
        """Add a line to its group; ValueError, with the reason, for one that cannot be imported."""
        place = self._find_place(file, line)
        condition = parse_condition(line.condition)
        if condition.needs_free_road and file.aim != _FREE_ROAD_HAZARD:
            raise ValueError(f"its condition needs a free road, but the title aims at {file.aim}")
        changes = line.changes[1:] if place.effect is not None else line.changes
        values = tuple(place.value_of(change.number) for change in changes)
        self._check_values(place, values)
        placed_line = _PlacedLine(line=line.line, values=values)
        self._check_buildable(file, _Group(place=place, condition=condition, lines=[placed_line]))
        alike = [group for group in groups if group.place is place and group.condition == condition]
        for other in (line for group in alike for line in group.lines):
            if other.values == values:
                raise ValueError(f"the same fault as in line {other.line}")
        # the first value names a fault, so lines that share it are in different variants
        free = [group for group in alike if values[:1] not in {other.values[:1] for other in group.lines}]
        if not free:
            free = [_Group(place=place, condition=condition)]
            groups += free
        free[0].lines.append(placed_line)

    def _find_place(self, file: FaultFile, line: FaultLine) -> HookPlace:
        at_hook = [place for place in self._places if (place.source, place.hook) == (file.source, file.hook)]
        if not at_hook:
            raise ValueError(f"no place for the hook {file.hook} of {file.source}")
        if line.problem:
            raise ValueError(
                next((place.refusal for place in at_hook if place.refusal and not place.changes), "")
                or line.problem
            )
        changes = tuple(f"{change.variable}{change.operator}" for change in line.changes)
        numbers = [change.number for change in line.changes]
        for place in at_hook:
            if (place.changes, place.limits) == (changes, line.limits) and (
                place.effect is None or place.effect == numbers[0]
            ):
                if place.refusal:
                    raise ValueError(place.refusal)
                return place
        raise ValueError(f"no place for {', '.join((*changes, *line.limits)) or 'none'} at {file.hook}")

    def _check_values(self, place: HookPlace, values: tuple[float | int, ...]) -> None:
        draw = self._shipped_draw(place)
        if draw and draw.kind == "list" and values[0] not in draw.values:
            raise ValueError(f"{values[0]:g} is not a value of {place.variant}")

    def _check_buildable(self, file: FaultFile, group: _Group) -> None:
        """Raise ValueError for a fault that `check` would refuse, such as one whose `where` names a value
        that is not known at its place.
        """
        module, *_, name = group.place.variant.split("/")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{module}.yaml"
            path.write_text(
                _spec_text(file, module, {name: self._variant_data(file, group)}), encoding="utf-8"
            )
            spec = load_spec(path, self._shipped.readings())
            if problem := next(spec_problems(spec, self._models, self._manifest), None):
                raise ValueError(f"cannot be built: {problem.got}")

    def _shipped_draw(self, place: HookPlace) -> Any:
        if not place.is_in_shipped_library:
            return None
        spec_name, _, variant_name = place.variant.rpartition("/")
        return next(variant.draw for variant in self._specs[spec_name] if variant.name == variant_name)

    def _write_groups(self, file: FaultFile, groups: list[_Group]) -> Iterable[list[ImportedEntry]]:
        variants_by_module: dict[str, dict[str, Any]] = {}
        for group in groups:
            module, *_, name = group.place.variant.split("/")
            variant = self._variant_data(file, group)
            outcome = EntryOutcome.IMPORTED
            full_name = group.place.variant
            if self._is_shipped(group, variant):
                outcome = EntryOutcome.EQUAL
            else:
                variants = variants_by_module.setdefault(module, {})
                name = name if name not in variants else f"{name}_{len(variants) + 1}"
                variants[name] = variant
                full_name = f"{module}/uva_{file.number}/{name}"
            campaign = (group.condition.when, group.place.setting)
            self._variants_by_campaign.setdefault(campaign, []).append(full_name)
            names_in_use = {*self._shipped.campaigns, *self._campaign_names.values()}
            if campaign not in self._campaign_names:
                self._campaign_names[campaign] = campaign_name(*campaign, names_in_use)
            yield [
                ImportedEntry(
                    file=file.name,
                    line=line.line,
                    outcome=outcome,
                    name=full_name,
                    value=_value_text(group.place, line.values),
                    campaign=self._campaign_names[campaign],
                )
                for line in group.lines
            ]
        for module, variants in variants_by_module.items():
            self._texts[f"faults/{module}/uva_{file.number}.yaml"] = _spec_text(file, module, variants)

    def _variant_data(self, file: FaultFile, group: _Group) -> dict[str, Any]:
        place = group.place
        shipped = self._shipped_data(place) if place.is_in_shipped_library else {}
        readings = {key: shipped[key] for key in _READINGS if key in shipped} or {
            _READINGS[0]: {"injections": place.body["injections"]}
        }
        if where := group.condition.where:
            readings = {
                key: {**reading, "injections": [{**each, "where": where} for each in reading["injections"]]}
                for key, reading in readings.items()
            }
        changes = [change for change in shipped.get("changes", []) if change != _FREE_ROAD]
        changes += [_FREE_ROAD] * (file.aim == _FREE_ROAD_HAZARD)
        columns = zip(*(line.values for line in group.lines), strict=True)
        draw = {key: {"values": list(values)} for key, values in zip(place.draws, columns, strict=True)}
        data = {
            "aim": file.aim,
            "about": place.body.get("about") or shipped["about"],
            "phrase": shipped.get("phrase"),
            "hold": shipped.get("hold"),
            "changes": changes,
            "draw": draw,
            **readings,
        }
        return {key: value for key, value in data.items() if value}

    def _is_shipped(self, group: _Group, variant: Mapping[str, Any]) -> bool:
        """Return whether the variant that ships with mutator has the same faults, all of them."""
        if not group.place.is_in_shipped_library or group.condition.where:
            return False
        shipped = self._shipped_data(group.place)
        return all(variant.get(key) == shipped.get(key) for key in ("aim", "changes", "draw"))

    def _shipped_data(self, place: HookPlace) -> dict[str, Any]:
        spec_name, _, variant_name = place.variant.rpartition("/")
        return dict(self._specs[spec_name].source.data["variants"][variant_name])


def _value_text(place: HookPlace, values: Sequence[float | int]) -> str:
    units = [split_key_at_unit(key)[1] for key in place.draws]
    unit = f" {units[0].symbol}" if units and units[0] else ""
    return ", ".join(f"{value:.12g}" for value in values) + unit


def _spec_text(file: FaultFile, module: str, variants: Mapping[str, Any]) -> str:
    data = {
        "schema": "fault_spec/1",
        "module": module,
        "fault_type": f"uva_{file.number}",
        "about": f"The faults of the authors' file {file.name}, at #{file.hook}:HOOK# of {file.source}.",
        "variants": dict(variants),
    }
    return yaml_text(data)
