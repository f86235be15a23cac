"""`cache`: list and delete cached data."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli.shared_options import Json, Wide
from mutator.cli.terminal_output import Terminal, short_path
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator._common.cache_layout_and_pruning import CacheEntry

# powers of 1,000, as disks are measured
_BYTES_BY_UNIT = {"B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}


def register(app: typer.Typer) -> None:
    app.command("cache", epilog=EXAMPLES)(cache)


EXAMPLES = """\b
Examples:
  mutator cache
  mutator cache --max 2GB
  mutator cache --clear
  ls "$(mutator cache --path)"
"""


def cache(
    path: Annotated[bool, typer.Option("--path", help="Print the folder and nothing else.")] = False,
    max_size: Annotated[
        str | None,
        typer.Option(
            "--max",
            metavar="SIZE",
            help="Delete the least recently used entries until the cache has at most this size.",
        ),
    ] = None,
    clear: Annotated[bool, typer.Option("--clear", help="Delete everything.")] = False,
    wide: Wide = False,
    as_json: Json = False,
) -> None:
    """List or delete the cached data on this machine.

    The cache holds passed checks of campaigns, golden runs, results of finished runs, the target's frames and
    detections, the lines that golden runs execute, previews of image effects, and a list of verified runs. It
    is in XDG_CACHE_HOME or ~/.cache. Results never depend on the cache; without it, runs take longer.
    """
    if path + clear + (max_size is not None) > 1:
        raise MutatorError("--path, --max and --clear together", expected="one of them")
    if path:
        typer.echo(mutator.cache_folder())  # nothing else, for `$(mutator cache --path)`
        return
    terminal = Terminal(as_json, wide)
    deleted = mutator.clear_caches() if clear else None
    if max_size is not None:
        deleted = mutator.prune_caches(parse_size_bytes(max_size))
    entries = mutator.cache_entries()
    if as_json:
        document = {"path": str(mutator.cache_folder()), "kept": _entries_as_json(entries)}
        terminal.print_json(
            document if deleted is None else {**document, "deleted": _entries_as_json(deleted)}
        )
        return
    if deleted is not None:
        terminal.print_text(f"deleted {counted(len(deleted), 'entry', 'entries')}, {_describe_size(deleted)}")
    rows = [
        (kind, len(of_kind), _describe_size(of_kind)) for kind, of_kind in _entries_by_kind(entries).items()
    ]
    rows.append(("total", len(entries), _describe_size(entries)))
    terminal.print_table(("what", "entries", "size"), rows, right_aligned=(1, 2), last_is_total=True)
    terminal.print_text(f"in {short_path(mutator.cache_folder())}")


def parse_size_bytes(text: str) -> int:
    """Return the number of bytes of a size such as 2GB, 500 MB or 0; MutatorError otherwise."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kKMGT]?B)?", text.strip())
    if not match:
        raise MutatorError(
            f"size '{text}'", expected="a number of B, kB, MB, GB or TB", remedy="write e.g. 2GB"
        )
    return int(float(match[1]) * _BYTES_BY_UNIT[(match[2] or "B").upper()])


def _entries_by_kind(entries: "Sequence[CacheEntry]") -> "dict[str, list[CacheEntry]]":
    groups: dict[str, list[CacheEntry]] = {}
    for entry in entries:
        groups.setdefault(entry.what, []).append(entry)
    return groups


def _describe_size(entries: "Sequence[CacheEntry]") -> str:
    size = sum(entry.size for entry in entries)
    unit = next((unit for unit in ("GB", "MB") if size >= _BYTES_BY_UNIT[unit]), "KB")
    return f"{size / _BYTES_BY_UNIT[unit]:.1f} {unit.replace('K', 'k')}"


def _entries_as_json(entries: "Sequence[CacheEntry]") -> list[dict[str, object]]:
    return [{"what": e.what, "path": str(e.path), "bytes": e.size} for e in entries]
