"""Find the fault library, the templates and the targets."""

import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path

from mutator._common.argument_checks import check_whole_number
from mutator._common.bounded_reading import MOST_FILE_BYTES, check_file_size, open_regular
from mutator._common.confined_files import checked_path_inside, files_inside
from mutator._common.files import check_path_encodable
from mutator._common.library_and_run_folder_search import (
    library_folder,
    library_yaml_files,
    path_from_environment,
    templates_folder,
)
from mutator._common.message_text import counted, describe_choices, spelling_suggestion
from mutator._common.shipped_files import shipped_folder
from mutator._common.table_rendering import TextTable
from mutator.defences.defence import Defence
from mutator.defences.defence_yaml import load_defence
from mutator.errors import MutatorError
from mutator.families.family import Family
from mutator.families.family_yaml import load_family
from mutator.faults.fault_model_files import load_fault_models
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec, load_spec
from mutator.faults.library_readings import SpecReadings, load_readings
from mutator.faults.spec_expansion import expand_spec
from mutator.model import ConcreteScenario, Fault
from mutator.results.table_columns import check_column_names
from mutator.store.planned_scenarios import PlannedScenarios, planned_scenarios_of
from mutator.store.run_head import RunHead
from mutator.stpa.accidents_and_hazards import HazardList, load_hazard_list
from mutator.stpa.context_tables import ContextTable, load_context_table
from mutator.stpa.hazard_analysis_yaml import (
    ControlStructureModel,
    HazardAnalysis,
    load_control_structure,
    load_hazard_analysis,
)
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.manifest import TargetManifest
from mutator.targets.manifest_files import load_manifest
from mutator.targets.manifests_by_name import manifest_path_by_name
from mutator.targets.severity_yaml import load_severity_scale, scale_for_target

_SANDBOX_MODULE = "mutator.engines.sandbox"


@dataclass(frozen=True, repr=False)
class Workspace:
    """A fault library, a templates folder, and optionally a target root that overrides the manifest's."""

    library: Path  #: the folder fault_library/
    templates: Path  #: the folder templates/
    target: Path | None = None  #: root of the target's source; None: as in the manifest
    sandbox: bool = False  #: whether a target's code runs in a sandbox
    #: the concrete scenarios of a run's plan, which `scenario` then finds by name, too
    planned_scenarios: PlannedScenarios | None = None

    def __repr__(self) -> str:
        counts = ", ".join(counted(len(names), what) for what, names in self._names_by_kind())
        return f"<Workspace {self.library}: {counts}>"

    def _repr_html_(self) -> str:
        rows = [["library", str(self.library)], ["templates", str(self.templates)]]
        rows += [["target", str(self.target)]] if self.target else []
        rows += [[counted(len(names), what), ", ".join(names)] for what, names in self._names_by_kind()]
        return str(TextTable(heads=("workspace", ""), rows=rows).as_html())

    def _names_by_kind(self) -> tuple[tuple[str, Collection[str]], ...]:
        base = self.library / "faults"
        specs = [path.relative_to(base).with_suffix("").as_posix() for path in self.spec_files()]
        return (
            ("fault spec", specs),
            ("scenario", self.scenarios),
            *([("family", self.families)] if self.families else []),
            ("context table", self.context_tables),
            ("campaign", self.campaigns),
            ("target", self.targets),
        )

    @classmethod
    def find(
        cls,
        root: str | Path | None = None,
        library: str | Path | None = None,
        templates: str | Path | None = None,
        target: str | Path | None = None,
        *,
        sandbox: bool = False,
    ) -> "Workspace":
        """Find library, templates and target, each in the first of these places that names or contains it: 1.
        the argument, or `root`, which holds library and templates; 2. MUTATOR_LIBRARY, MUTATOR_TEMPLATES and
        MUTATOR_TARGET, or MUTATOR_ROOT; 3. the current folder or its nearest parent that holds
        fault_library/; 4. the copies that ship with the harness.

        With `sandbox`, the processes that run a target's code can reach neither your other files nor the
        network. MutatorError if a named folder does not exist, or if this machine has no sandbox.
        """
        if sandbox:
            # late: what only reads loads nothing of the engines
            import_module(_SANDBOX_MODULE).check_sandbox_available()
        target_root = Path(target) if target else path_from_environment("MUTATOR_TARGET")
        if target_root and not target_root.is_dir():
            raise MutatorError(
                f"no folder {target_root}",
                expected="the target folder",
                remedy="correct MUTATOR_TARGET, or give the controller's source with --target",
            )
        return cls(
            library=_checked_folder(library_folder(root, library), "fault_library", "library"),
            templates=_checked_folder(templates_folder(root, templates), "templates", "templates"),
            target=target_root.resolve() if target_root else None,
            sandbox=sandbox,
        )

    def manifest(self, name: str) -> TargetManifest:
        """Return the manifest with this name or path."""
        manifest = load_manifest(self._find_file("targets", name, "target", self.targets), self.target)
        manifest = replace(manifest, sandbox=self.sandbox)
        check_column_names(manifest)
        return manifest

    @property
    def defences(self) -> Mapping[str, Path]:
        """The defences of the library by name; `defence` reads one."""
        return self._path_by_name("defences")

    def defence(self, name: str | Path) -> Defence:
        """Return the defence with this name or path."""
        return load_defence(self._find_file("defences", name, "defence"), self.templates)

    def defended(self, manifest: TargetManifest, names: Iterable[str]) -> TargetManifest:
        """Return the target with these defences of the library in its tree."""
        defences = [self.defence(name) for name in names]
        if not defences:
            return manifest
        # every verb loads this module, and only this function parses Python
        from mutator.mutants.defended_target import defended_manifest

        return defended_manifest(manifest, defences, self.templates)

    def manifest_of(self, head: RunHead) -> TargetManifest:
        """Return the target of a run folder, with the defences in the tree that it ran."""
        return self.defended(self.manifest(head.target), [defence.name for defence in head.defences])

    def scale_of(self, manifest: TargetManifest) -> SeverityScale | None:
        """Return the severity scale of a target, with the rules for its hazards; None without `severity`.

        MutatorError, at the manifest's line, for an unknown scale or rule.
        """
        if manifest.severity is None:
            return None
        shipped = (shipped_folder() / "fault_library" / "severity").glob("*.yaml")
        path_by_name = {path.stem: path for path in sorted(shipped)} | self._path_by_name("severity")
        if manifest.severity.scale not in path_by_name:
            raise manifest.source.error(
                ("severity", "scale"),
                f"'{manifest.severity.scale}'",
                expected=f"one of {', '.join(path_by_name)}, or a file in {self.library / 'severity'}",
                remedy="correct the name, or write the scale",
            )
        scale = load_severity_scale(path_by_name[manifest.severity.scale])
        return scale_for_target(scale, manifest.severity, manifest.all_metrics, manifest.source)

    @property
    def targets(self) -> Mapping[str, Path]:
        """The manifests of the library by their `name`. MutatorError if two have the same."""
        return manifest_path_by_name(self._path_by_name("targets"))

    def fault_models(self) -> FaultModels:
        """Return the fault models of the templates folder."""
        return load_fault_models(self.templates)

    def readings(self) -> SpecReadings:
        """Return the readings that the library declares."""
        return load_readings(self.library)

    def spec_files(self) -> tuple[Path, ...]:
        """Return the file of every fault spec in the library, sorted."""
        return tuple(files_inside(self.library, "faults", "*.yaml"))

    def spec(self, name: str | Path) -> FaultSpec:
        """Return the spec with this name, `<module>/<fault_type>`, or path."""
        return load_spec(self._find_file("faults", name, "fault spec"), self.readings())

    def specs(self) -> tuple[FaultSpec, ...]:
        """All specs, in the order of `spec_files`. Each must be at `<module>/<fault_type>.yaml`."""
        readings = self.readings()
        specs = tuple(load_spec(path, readings) for path in self.spec_files())
        for spec in specs:
            expected = self.library / "faults" / f"{spec.name}.yaml"
            if spec.path != expected:
                raise spec.source.error(
                    ("module",),
                    f"module '{spec.module}', fault_type '{spec.fault_type}'",
                    expected=f"the file at {expected.relative_to(self.library)} in the library",
                    remedy="move the file or correct the names",
                )
        return specs

    def faults(
        self,
        pattern: str | Path = "*",
        *,
        reading: str | None = None,
        seed: int = 0,
        target: str | None = None,
    ) -> tuple[Fault, ...]:
        """Return the faults that match `pattern`, in the library's order, with values drawn from `seed`.

        `pattern` is `<module>/<fault_type>` or `<module>/<fault_type>/<variant>`, with * for any text, or a
        spec file. `target` names a manifest; default: the library's only target. MutatorError if nothing
        matches, and for a mistake in a spec.
        """
        check_whole_number("seed", seed)
        if str(pattern).endswith((".yaml", ".yml")):
            specs: tuple[FaultSpec, ...] = (self.spec(pattern),)
            glob = "*"
        else:
            specs, glob = self.specs(), str(pattern)
        manifest, models = self.manifest(self.target_name(target)), self.fault_models()
        faults = tuple(
            fault
            for spec in specs
            if any(fnmatchcase(name, glob) for name in (spec.name, *_variant_names(spec)))
            for fault in expand_spec(spec, seed, reading, models=models, manifest=manifest)
            if fnmatchcase(spec.name, glob) or fnmatchcase(fault.spec, glob)
        )
        if not faults:
            names = [name for spec in specs for name in (spec.name, *_variant_names(spec))]
            raise MutatorError(
                f"no fault matches '{glob}'",
                where=self.library / "faults",
                expected="<module>/<fault_type>, with or without /<variant>, with * for any text",
                remedy="see `mutator list specs`" + spelling_suggestion(glob, names),
            )
        return faults

    def target_name(self, name: str | None = None) -> str:
        """Return the given target, or the library's only target; MutatorError if the library has none or
        several.
        """
        names = tuple(self.targets)
        if name is None and not names:
            raise MutatorError(
                "no target manifest",
                where=self.library / "targets",
                remedy="write one (see docs/how-to/add-a-target.md)",
            )
        if name is None and len(names) > 1:
            listed = f"{len(names)} targets in the library ({', '.join(names)})"
            raise MutatorError(listed, argument="target", remedy="name one")
        return name or names[0]

    @property
    def scenarios(self) -> Mapping[str, Path]:
        """The scenarios of the library by name."""
        return self._path_by_name("scenarios")

    def scenario(self, name: str | Path) -> Path:
        """Return the file of the scenario with this name or path."""
        if self.planned_scenarios and str(name) in self.planned_scenarios.by_name:
            return self.planned_scenarios.file(str(name))
        return self._find_file("scenarios", name, "scenario")

    def with_scenarios_of(self, run: Path) -> "Workspace":
        """Return the workspace with the concrete scenarios of a run folder."""
        return replace(self, planned_scenarios=planned_scenarios_of(run))

    @property
    def families(self) -> Mapping[str, Path]:
        """The families of scenarios of the library by name; `family` reads one."""
        return self._path_by_name("families")

    def family(self, name: str | Path) -> Family:
        """Return the family of scenarios with this name or path."""
        return load_family(self._find_file("families", name, "family of scenarios"))

    def concrete_scenario(self, text: str) -> ConcreteScenario | None:
        """Return the scenario that `FAMILY:ego=60,gap=20` names; None for a name or file without values.

        MutatorError for an unknown family, and for values that it does not have.
        """
        family, colon, values = text.partition(":")
        return self.family(family).concrete_from_text(values) if colon else None

    @property
    def campaigns(self) -> Mapping[str, Path]:
        """The campaigns of the library by name."""
        return self._path_by_name("campaigns")

    def campaign(self, name: str | Path) -> Path:
        """Return the file of the campaign with this name or path."""
        return self._find_file("campaigns", name, "campaign")

    @property
    def context_tables(self) -> Mapping[str, Path]:
        """The context tables of the library by name; `context_table` reads one."""
        return self._path_by_name("stpa/contexts")

    def context_table(self, name: str | Path, variables: Collection[str] | None = None) -> ContextTable:
        """Return the context table with this name or path; `variables` are those that a target observes."""
        return load_context_table(self._find_file("stpa/contexts", name, "context table"), variables)

    def hazards(self) -> HazardList | None:
        """Return the accidents and hazards in fault_library/stpa/hazards.yaml; None without that file."""
        path = checked_path_inside(self.library, self.library / "stpa" / "hazards.yaml")
        return load_hazard_list(path) if os.path.lexists(path) else None

    def analysis(self) -> HazardAnalysis | None:
        """Return the hazard analysis in fault_library/stpa/; None without a control structure."""
        folder = self.library / "stpa"
        files_inside(self.library, "stpa", "*.yaml")  # all that it reads
        return load_hazard_analysis(folder) if (folder / "control_structure.yaml").exists() else None

    def structure(self, manifest: TargetManifest) -> ControlStructureModel | None:
        """Return a target's control structure; None if no channel names one of its components."""
        path = checked_path_inside(self.library, self.library / "stpa" / "control_structure.yaml")
        structure = load_control_structure(path) if path.exists() else None
        components = structure.components if structure else {}
        return structure if any(channel.component in components for channel in manifest.channels) else None

    @property
    def references(self) -> Path:
        """The folder of published numbers, which need not exist. UnsafePath for a link that leads out of
        it.
        """
        files_inside(self.library, "references", "*.yaml")
        return self.library / "references"

    def _path_by_name(self, folder: str) -> dict[str, Path]:
        return library_yaml_files(self.library, folder)

    def _find_file(
        self, folder: str, name: str | Path, kind: str, named_paths: Mapping[str, Path] | None = None
    ) -> Path:
        path_by_name = self._path_by_name(folder) if named_paths is None else named_paths
        if str(name).endswith((".yaml", ".yml")):
            if not Path(name).is_file():
                raise MutatorError(
                    f"no file {name}",
                    expected=f"a {kind}: the path of a YAML file, or {describe_choices(path_by_name)}",
                    remedy="correct the path"
                    + spelling_suggestion(str(Path(name).with_suffix("")), list(path_by_name)),
                )
            return _checked_file(Path(name))
        if (path := path_by_name.get(str(name))) is not None:
            return _checked_file(path)
        hint = spelling_suggestion(str(name), list(path_by_name))
        if named_paths and (file := self._path_by_name(folder).get(str(name))) is not None:
            names = [other for other, path in named_paths.items() if path == file]
            hint = f": {file.name} describes '{names[0]}'"
        raise MutatorError(
            f"no {kind} '{name}'",
            where=self.library / folder,
            expected=f"{describe_choices(path_by_name)}, or the path of a YAML file",
            remedy=f"correct the name{hint}",
        )


def _checked_file(path: Path) -> Path:
    """Return the path of a file; MutatorError unless it is a regular file of a size to be read as a whole."""
    check_path_encodable(path)
    try:
        with open_regular(path) as file:
            check_file_size(file, path, MOST_FILE_BYTES)
    except OSError as error:
        raise MutatorError(
            f"cannot be read ({error.strerror})", where=path, expected="a file", remedy="put the file back"
        ) from None
    return path


def _variant_names(spec: FaultSpec) -> list[str]:
    return [f"{spec.name}/{variant.name}" for variant in spec]


def _checked_folder(path: Path, what: str, argument: str) -> Path:
    if not path.is_dir():
        raise MutatorError(
            f"no folder {path}",
            argument=argument,
            expected=f"the {what} folder",
            remedy=f"correct `{argument}` or MUTATOR_{argument.upper()}, `root` or MUTATOR_ROOT",
        )
    check_path_encodable(path.resolve())
    return path.resolve()
