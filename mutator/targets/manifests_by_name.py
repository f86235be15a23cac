"""The names of a library's targets, which stand in their manifests."""

import re
from collections.abc import Mapping
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_relative_path
from mutator.config.yaml_files import MOST_YAML_BYTES, load_yaml, parse_yaml
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError

_NAME_KEY_PATTERN = re.compile(r"^name\b", re.MULTILINE)
_NAME_LINE_PATTERN = re.compile(r"^name: [\w-]+$(?!\n[ \t])", re.MULTILINE)  # the value ends with the line


def manifest_path_by_name(path_by_file_name: Mapping[str, Path]) -> dict[str, Path]:
    """Return the manifests by their key `name`. MutatorError for a name that two manifests have.

    A manifest whose name cannot be read has that of its file; loading it reports the mistake.
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
        source, first_line = _read_name_line(path) or (load_yaml(path), 1)
        name = source.data.get("name") if isinstance(source.data, dict) else None
        if not isinstance(name, str):
            return "", None
        return checked_relative_path(name, path), (source.line_of(("name",)) or 1) + first_line - 1
    except MutatorError:
        return "", None


def _read_name_line(path: Path) -> tuple[YamlSource, int] | None:
    """Return only the line with the key `name` of a manifest, and its number, because each command asks for
    the names; None if it takes the whole file to find the name.
    """
    text = read_bounded(path, MOST_YAML_BYTES).decode(errors="replace")
    match = _NAME_LINE_PATTERN.search(text)
    if not match or len(_NAME_KEY_PATTERN.findall(text)) > 1:
        return None
    return parse_yaml(match[0], path), text.count("\n", 0, match.start()) + 1
