"""Where library, templates and targets are found."""

import os
from dataclasses import dataclass
from pathlib import Path

from mutator._common.shipped import shipped_folder
from mutator._common.text import suggestion
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels, load_fault_models
from mutator.faults.readings import Readings, load_readings
from mutator.faults.specs import FaultSpec, load_spec
from mutator.outcomes.columns import check_names
from mutator.stpa.analysis import Analysis, load_analysis
from mutator.stpa.context_tables import ContextTable, HazardList, load_context_table, load_hazards
from mutator.targets.manifest import TargetManifest, load_manifest

_LIBRARY = "fault_library"
_TEMPLATES = "templates"


@dataclass(frozen=True)
class Workspace:
    """A fault library, a templates folder, and optionally a target root that overrides the manifest's."""

    library: Path
    templates: Path
    target: Path | None = None

    @classmethod
    def find(
        cls,
        root: Path | None = None,
        library: Path | None = None,
        templates: Path | None = None,
        target: Path | None = None,
    ) -> "Workspace":
        """Each of them from the first place that names or holds it.

        1. the argument; 2. MUTATOR_LIBRARY, MUTATOR_TEMPLATES, MUTATOR_TARGET; 3. for library and templates
        `root` or MUTATOR_ROOT, which holds both, else the nearest folder from the current one upward that
        holds fault_library/; 4. what ships with the harness. MutatorError for a named folder that is missing.
        """
        library = library or _environment("MUTATOR_LIBRARY")
        templates = templates or _environment("MUTATOR_TEMPLATES")
        target = target or _environment("MUTATOR_TARGET")
        base = root or _environment("MUTATOR_ROOT")
        if library is None:
            library = (base or _upward(_LIBRARY) or shipped_folder()) / _LIBRARY
        if templates is None:
            templates = (base or _upward(_LIBRARY, _TEMPLATES) or shipped_folder()) / _TEMPLATES
        return cls(
            library=_folder(library, _LIBRARY, "--library or MUTATOR_LIBRARY"),
            templates=_folder(templates, _TEMPLATES, "--templates or MUTATOR_TEMPLATES"),
            target=_folder(target, "target", "--target or MUTATOR_TARGET") if target else None,
        )

    def manifest(self, name: str) -> TargetManifest:
        """The target `name`, or the manifest file of that path."""
        manifest = load_manifest(self._file("targets", name, "target"), self.target)
        check_names(manifest)
        return manifest

    def target_names(self) -> tuple[str, ...]:
        """Names of the manifests in the library."""
        return self._names("targets")

    def fault_models(self) -> FaultModels:
        """The fault models of the templates folder."""
        return load_fault_models(self.templates)

    def readings(self) -> Readings:
        """The readings that the library declares."""
        return load_readings(self.library)

    def spec_files(self) -> tuple[Path, ...]:
        """Every fault spec of the library, sorted."""
        return tuple(sorted((self.library / "faults").rglob("*.yaml")))

    def spec(self, name: str | Path) -> FaultSpec:
        """The spec `<module>/<fault_type>`, or the spec file of that path."""
        return load_spec(self._file("faults", name, "fault spec"), self.readings())

    def specs(self) -> tuple[FaultSpec, ...]:
        """All specs of the library, in the order of `spec_files`; each is at `<module>/<fault_type>.yaml`."""
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

    def scenario_names(self) -> tuple[str, ...]:
        """Names of the scenarios in the library."""
        return self._names("scenarios")

    def scenario(self, name: str | Path) -> Path:
        """File of the scenario `name`, or the scenario file of that path."""
        return self._file("scenarios", name, "scenario")

    def campaign_names(self) -> tuple[str, ...]:
        """Names of the campaigns in the library."""
        return self._names("campaigns")

    def campaign(self, name: str | Path) -> Path:
        """File of the campaign `name`, or the campaign file of that path."""
        return self._file("campaigns", name, "campaign")

    def context_table_names(self) -> tuple[str, ...]:
        """Names of the context tables in the library."""
        return self._names("stpa/contexts")

    def context_table(self, name: str | Path) -> ContextTable:
        """The context table `name`, or the table of that path."""
        return load_context_table(self._file("stpa/contexts", name, "context table"))

    def hazards(self) -> HazardList:
        """Accidents and hazards of fault_library/stpa/hazards.yaml."""
        return load_hazards(self.library / "stpa" / "hazards.yaml")

    def analysis(self) -> Analysis | None:
        """The hazard analysis of fault_library/stpa/; None where there is no control structure in it."""
        folder = self.library / "stpa"
        return load_analysis(folder) if (folder / "control_structure.yaml").exists() else None

    def _names(self, folder: str) -> tuple[str, ...]:
        base = self.library / folder
        return tuple(sorted(p.relative_to(base).with_suffix("").as_posix() for p in base.rglob("*.yaml")))

    def _file(self, folder: str, name: str | Path, what: str) -> Path:
        """A file of the library by name, or the file at a path that ends in .yaml."""
        if str(name).endswith((".yaml", ".yml")) and Path(name).is_file():
            return Path(name)
        known = self._names(folder)
        if str(name) in known:
            return self.library / folder / f"{name}.yaml"
        raise MutatorError(
            f"no {what} '{name}'",
            where=self.library / folder,
            expected=f"one of {', '.join(known) or 'none'}, or the path of a YAML file",
            remedy="correct the name" + suggestion(str(name), list(known)),
        )


def _environment(name: str) -> Path | None:
    value = os.environ.get(name)
    return Path(value) if value else None


def _upward(*folders: str) -> Path | None:
    """The nearest folder from the current one upward that holds fault_library/, if it holds all of these."""
    here = Path.cwd()
    nearest = next((p for p in (here, *here.parents) if (p / _LIBRARY).is_dir()), None)
    return nearest if nearest and all((nearest / name).is_dir() for name in folders) else None


def _folder(path: Path, what: str, option: str) -> Path:
    if not path.is_dir():
        raise MutatorError(
            f"no folder {path}",
            expected=f"the {what} folder",
            remedy=f"correct {option}, --root or MUTATOR_ROOT",
        )
    return path.resolve()
