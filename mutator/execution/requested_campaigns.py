"""Which campaigns a pytest command asks for: by option, by file, or by the project's settings.

Every pytest session imports this, so it imports nothing of the harness.
"""

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

WORKER_INPUT_KEY = "mutator_campaigns"  # what an xdist worker gets
_SETTINGS_FILE, _SETTINGS_TABLE = "pyproject.toml", "mutator"
_KEYS = ("library", "target", "campaigns")
_REGRESSIONS = "regressions/*.yaml"  # of a project with these settings
_YAML_SUFFIXES = (".yaml", ".yml")
_HEAD = re.compile(rb"""(?:\xef\xbb\xbf)?["']?schema["']?\s*:\s*["']?(campaign|regression)/""")
_MOST_HEAD_BYTES = 4096  # comments can come first


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestedCampaigns:
    """What a command asks for. `name` is a campaign's name in the library; `library` and `target` are those
    of the project's settings.
    """

    name: str = ""
    files: tuple[Path, ...] = ()
    library: Path | None = None
    target: Path | None = None

    @property
    def is_empty(self) -> bool:
        return not (self.name or self.files)


def find_requested_campaigns(config: pytest.Config) -> RequestedCampaigns:
    """Return the campaigns, and files of saved experiments, of `--campaign`, of the arguments, and of the
    project where they are collected.

    Adds the project's campaigns to what pytest looks at, if the command is given in the project's folder and
    names no place.
    """
    settings = _project_settings(config.rootpath)
    library, target = (settings.get(key) for key in ("library", "target"))
    name = config.getoption("campaign")
    if name is not None:
        is_file = name.endswith(_YAML_SUFFIXES)
        named_files = (Path(name),) if is_file else ()
        return RequestedCampaigns(
            name="" if is_file else name, files=named_files, library=library, target=target
        )
    arguments = [Path(config.invocation_params.dir, text.partition("::")[0]) for text in config.args]
    files = [path for path in arguments if path.suffix in _YAML_SUFFIXES and _schema_of(path)]
    is_in_root = config.invocation_params.dir == config.rootpath
    is_plain = is_in_root and config.args_source is not pytest.Config.ArgsSource.ARGS
    for path in _distinct_files([*settings.get("campaigns", ()), *settings.get("regressions", ())]):
        if any(path == place or place in path.parents for place in arguments):
            files.append(path)
        elif is_plain:
            files.append(path)
            config.args.append(str(path))
    return RequestedCampaigns(files=tuple(_distinct_files(files)), library=library, target=target)


def is_regression_file(path: Path) -> bool:
    """Whether a file has saved experiments, and is no campaign."""
    return _schema_of(path) == b"regression"


def _distinct_files(paths: list[Path]) -> list[Path]:
    """Return each file once, although several patterns or symbolic links name it."""
    path_by_real_path: dict[Path, Path] = {}
    for path in sorted(paths, key=Path.is_symlink):  # a link only if the file itself is not listed
        path_by_real_path.setdefault(path.resolve(), path)
    return list(path_by_real_path.values())


def _schema_of(path: Path) -> bytes | None:
    """Return `campaign` or `regression`; None for a file of another kind."""
    try:
        with path.open("rb") as file:
            head = file.read(_MOST_HEAD_BYTES)
    except OSError:
        return None
    heads = filter(None, map(_HEAD.match, head.splitlines()))
    return next((head[1] for head in heads), None)


def _project_settings(root: Path) -> dict[str, Any]:
    """Return `[tool.mutator]` of the project, with paths; UsageError for a mistake in it."""
    path = root / _SETTINGS_FILE
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return {}
    if f"[tool.{_SETTINGS_TABLE}" not in text:
        return {}
    try:
        table = tomllib.loads(text)["tool"][_SETTINGS_TABLE]
    except (tomllib.TOMLDecodeError, LookupError, TypeError) as err:
        raise pytest.UsageError(f"{path}: [tool.{_SETTINGS_TABLE}]: {err}") from None
    settings: dict[str, Any] = {"regressions": sorted(root.glob(_REGRESSIONS))}
    for key, value in table.items():
        is_list = key == "campaigns"
        values = value if is_list else [value]
        if key not in _KEYS or not isinstance(values, list) or not all(isinstance(v, str) for v in values):
            kind = "a list of files" if is_list else f"one of {', '.join(_KEYS)}, with the path of a folder"
            raise pytest.UsageError(f"{path}: [tool.{_SETTINGS_TABLE}]: {key} = {value!r}: expected {kind}")
        settings[key] = _files(path, values) if is_list else root / value
    return settings


def _files(path: Path, patterns: list[str]) -> list[Path]:
    """Return the files that these patterns match, relative to the folder of the settings."""
    files: list[Path] = []
    for pattern in patterns:
        try:
            matches = [file for file in sorted(path.parent.glob(pattern)) if file.is_file()]
        except (NotImplementedError, ValueError, LookupError, AttributeError):  # absolute, or no pattern
            matches = []
        if not matches:
            text = f"no file {pattern!r}, relative to this file"
            raise pytest.UsageError(f"{path}: [tool.{_SETTINGS_TABLE}]: campaigns: {text}")
        files += matches
    return files
