"""The names of a library's targets, which stand in their manifests."""

from collections.abc import Mapping
from pathlib import Path

from mutator._common.confined_files import checked_relative_path
from mutator.config.yaml_files import load_yaml
from mutator.errors import MutatorError


def manifest_path_by_name(path_by_file_name: Mapping[str, Path]) -> dict[str, Path]:
    """Return the manifests by their key `name`. MutatorError for a name that two manifests have.

    A manifest that cannot be read, or has no name, has that of its file; loading it reports the mistake.
    """
    path_by_name: dict[str, Path] = {}
    for file_name, path in path_by_file_name.items():
        name, line = _name_and_line(path)
        name = name or file_name
        if name in path_by_name:
            raise MutatorError(
                f"target '{name}', which is also the name in {path_by_name[name].name}",
                where=path,
                line=line,
                expected="a name of its own for each manifest",
                remedy="change `name` in one of the two files",
            )
        path_by_name[name] = path
    return dict(sorted(path_by_name.items()))


def _name_and_line(path: Path) -> tuple[str, int | None]:
    try:
        source = load_yaml(path)
        name = source.data.get("name") if isinstance(source.data, dict) else None
        if not isinstance(name, str):
            return "", None
        return checked_relative_path(name, path), source.line_of(("name",))
    except MutatorError:
        return "", None
