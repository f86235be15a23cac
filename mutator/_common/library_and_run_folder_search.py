"""Find libraries, templates and run folders without reading their files."""

import os
from pathlib import Path

from mutator._common.confined_files import checked_relative_path, files_inside
from mutator._common.shipped_files import shipped_folder

RUNS_FOLDER = Path("runs")
RUN_HEAD_FILE = "run.json"  # the file that identifies a run folder
SCRATCH_FOLDER = "work"  # of a run folder, while a command works on it
SHRUNK_FOLDER = "shrunk"  # beside run folders: those of the smaller forms of their faults
_LIBRARY_FOLDER = "fault_library"
_TEMPLATES_FOLDER = "templates"

_PathArgument = str | Path | None


def library_folder(root: _PathArgument = None, library: _PathArgument = None) -> Path:
    """Return the fault library: from an argument, the environment, the current folder or a parent, or the
    shipped library. It need not exist.
    """
    named = _configured_folder(library, root, _LIBRARY_FOLDER, "MUTATOR_LIBRARY")
    return named or (_nearest_folder_with(_LIBRARY_FOLDER) or shipped_folder()) / _LIBRARY_FOLDER


def templates_folder(root: _PathArgument = None, templates: _PathArgument = None) -> Path:
    """Return the templates folder, found like `library_folder`. It need not exist."""
    named = _configured_folder(templates, root, _TEMPLATES_FOLDER, "MUTATOR_TEMPLATES")
    return (
        named
        or (_nearest_folder_with(_LIBRARY_FOLDER, _TEMPLATES_FOLDER) or shipped_folder()) / _TEMPLATES_FOLDER
    )


def path_from_environment(variable: str) -> Path | None:
    value = os.environ.get(variable)
    return Path(value) if value else None


def library_yaml_files(library: Path, folder: str) -> dict[str, Path]:
    """Return the YAML files in a library folder by name, sorted; errors are those of `files_inside`."""
    base = library / folder
    paths = files_inside(library, folder, "*.yaml")
    # not `with_suffix`: for names such as `...yaml`, its result depends on the version of Python
    names = [path.relative_to(base).as_posix().removesuffix(".yaml") for path in paths]
    files = {checked_relative_path(name, path): path for name, path in zip(names, paths, strict=True)}
    return dict(sorted(files.items()))


def run_folders_newest_first(root: Path) -> list[Path]:
    """Return the run folders in runs/ of the current folder and of `root`, the most recently used first."""
    bases = {base.resolve() for base in (RUNS_FOLDER, root / RUNS_FOLDER)}
    heads = [head for base in bases for head in base.glob(f"*/{RUN_HEAD_FILE}")]
    heads.sort(key=lambda head: (head.stat().st_mtime_ns, str(head)), reverse=True)
    return [head.parent for head in heads]


def shrunk_folder(run: Path, experiment_id: str) -> Path:
    """Return the run folder for the smaller forms of an experiment, by default."""
    # two levels below runs/, so that the newest run there is still this one
    beside = run.parent if run.parent.name == SHRUNK_FOLDER else run.parent / SHRUNK_FOLDER
    return beside / f"{run.name}-{experiment_id}"


def _configured_folder(folder: _PathArgument, root: _PathArgument, name: str, variable: str) -> Path | None:
    if folder or root:
        return Path(folder) if folder else Path(root or "") / name
    base = path_from_environment("MUTATOR_ROOT")
    return path_from_environment(variable) or (base / name if base else None)


def _nearest_folder_with(*folders: str) -> Path | None:
    """Return the current folder or its nearest parent that contains fault_library/; None if it lacks one of
    `folders`.
    """
    here = Path.cwd()
    nearest = next((p for p in (here, *here.parents) if (p / _LIBRARY_FOLDER).is_dir()), None)
    return nearest if nearest and all((nearest / name).is_dir() for name in folders) else None
