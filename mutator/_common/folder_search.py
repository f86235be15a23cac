"""Find libraries, templates and run folders without reading their files."""

import os
from pathlib import Path

from mutator._common.confined_files import check_name, files_inside
from mutator._common.shipped_files import shipped_folder

RUNS = Path("runs")
RUN_HEAD = "run.json"  # the file that identifies a run folder
_LIBRARY = "fault_library"
_TEMPLATES = "templates"

_Given = str | Path | None


def library_folder(root: _Given = None, library: _Given = None) -> Path:
    """Return the fault library: from an argument, the environment, the current folder or a parent, or the
    shipped library. It need not exist.
    """
    named = _named(library, root, _LIBRARY, "MUTATOR_LIBRARY")
    return named or (_upward(_LIBRARY) or shipped_folder()) / _LIBRARY


def templates_folder(root: _Given = None, templates: _Given = None) -> Path:
    """Return the templates folder, found like `library_folder`. It need not exist."""
    named = _named(templates, root, _TEMPLATES, "MUTATOR_TEMPLATES")
    return named or (_upward(_LIBRARY, _TEMPLATES) or shipped_folder()) / _TEMPLATES


def environment_path(variable: str) -> Path | None:
    value = os.environ.get(variable)
    return Path(value) if value else None


def library_files(library: Path, folder: str) -> dict[str, Path]:
    """Return the YAML files in a library folder by name, sorted; errors are those of `files_inside`."""
    base = library / folder
    paths = files_inside(library, folder, "*.yaml")
    files = {check_name(p.relative_to(base).with_suffix("").as_posix(), p): p for p in paths}
    return dict(sorted(files.items()))


def run_folders(root: Path) -> list[Path]:
    """Return the run folders in runs/ of the current folder and of `root`, the most recently used first."""
    bases = {base.resolve() for base in (RUNS, root / RUNS)}
    heads = [head for base in bases for head in base.glob(f"*/{RUN_HEAD}")]
    heads.sort(key=lambda head: (head.stat().st_mtime_ns, str(head)), reverse=True)
    return [head.parent for head in heads]


def _named(folder: _Given, root: _Given, name: str, variable: str) -> Path | None:
    if folder or root:
        return Path(folder) if folder else Path(root or "") / name
    base = environment_path("MUTATOR_ROOT")
    return environment_path(variable) or (base / name if base else None)


def _upward(*folders: str) -> Path | None:
    """Return the current folder or its nearest parent that contains fault_library/; None if it lacks one of
    `folders`.
    """
    here = Path.cwd()
    nearest = next((p for p in (here, *here.parents) if (p / _LIBRARY).is_dir()), None)
    return nearest if nearest and all((nearest / name).is_dir() for name in folders) else None
