"""`executed/`: what runs executed of the target, so that `--since` can tell which of them a change affects.

Experiments that executed the same share one line, whose digest is in their timings. Lines refer to others
for the parts of each file, because what two runs executed differs in few files. Neither results nor seals
depend on this folder. Damaged lines are ignored: without them, an experiment runs.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.hashing import digest
from mutator.store.checksummed_lines import intact_lines

EXECUTED_FOLDER, EXECUTED_SCHEMA = "executed", "executed/1"
_DIGEST_DIGITS = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class ExecutedCode:
    """What a run executed, and what else decided its result.

    * `parts_by_file`: by file of the target the digests of its executed parts (`targets.function_digests`)
    * `files_read`: digests of the Python files of the target that the run read as text
    * `packages`: versions of the packages that it loaded
    * `surroundings`: digests of what all runs of its session had in common, by name
    * `obstacle`: why it is not known what the run executed; empty if it is
    """

    parts_by_file: Mapping[str, Mapping[str, str]]
    files_read: Mapping[str, str]
    packages: Mapping[str, str | None]
    surroundings: Mapping[str, str]
    obstacle: str = ""


class ExecutedCodeLines:
    """What the runs of one worker executed, as lines that `append_line` stores, each once."""

    def __init__(self, append_line: Callable[[Mapping[str, Any]], None]) -> None:
        self._append_line = append_line
        self._digests: set[str] = set()

    def append(self, code: ExecutedCode) -> str:
        """Append what a run executed; return its digest."""
        files = [
            self._append_once({"path": path, "parts": dict(parts)})
            for path, parts in sorted(code.parts_by_file.items())
        ]
        return self._append_once(
            {
                "files": files,
                "read": dict(code.files_read),
                "packages": dict(code.packages),
                "surroundings": dict(code.surroundings),
                "obstacle": code.obstacle,
            }
        )

    def _append_once(self, value: Mapping[str, Any]) -> str:
        name = digest(value)[:_DIGEST_DIGITS]
        if name not in self._digests:
            self._append_line({"digest": name, **value})
            self._digests.add(name)
        return name


class ExecutedCodes:
    """What the runs of a run folder executed, by digest. The lines are read at the first request."""

    def __init__(self, run: Path) -> None:
        self._run = run
        self._value_by_digest: dict[str, dict[str, Any]] | None = None

    def find(self, code_digest: str) -> ExecutedCode | None:
        """Return what was executed; None if it is missing or damaged."""
        if self._value_by_digest is None:
            self._value_by_digest = dict(self._read_values())
        try:
            value = self._value_by_digest[code_digest]
            files = [self._value_by_digest[name] for name in value["files"]]
            return ExecutedCode(
                parts_by_file={str(file["path"]): dict(file["parts"]) for file in files},
                files_read=dict(value["read"]),
                packages=dict(value["packages"]),
                surroundings=dict(value["surroundings"]),
                obstacle=str(value["obstacle"]),
            )
        except (LookupError, TypeError, ValueError):
            return None

    def _read_values(self) -> list[tuple[str, dict[str, Any]]]:
        values = []
        for path in sorted((self._run / EXECUTED_FOLDER).glob("*.jsonl")):
            for number, line in intact_lines(path):
                value = json.loads(line) if number > 1 else {}
                value.pop("sum", None)
                name = value.pop("digest", "")
                if name and name == digest(value)[:_DIGEST_DIGITS]:
                    values.append((name, value))
        return values
