"""The files that a run folder can contain, and the refusal of everything that leads out of it.

Run folders travel: evidence comes from strangers. Two rules keep every command inside the folder:

* `check_contents`, whenever a run folder is opened: nothing in it is a link, pipe, device or socket. A path
  of fixed names below a checked folder therefore stays in it. This is enough for a folder that somebody
  sends. It cannot stop a process that changes the folder at the same time, but such a process has the user's
  permissions, and needs no links.
* `mutator._common.below`, wherever a name comes from a file: the name is checked when it is joined.
"""

from fnmatch import fnmatchcase
from pathlib import Path

from mutator._common.below import entries_below, is_deep, is_plain, not_plain
from mutator.errors import Outside
from mutator.store import file_digests
from mutator.store.run_head import CAMPAIGN, HEAD

SCRATCH, ASIDE, TRACES = "work", "damaged", "traces"
SIGNATURE = ("seal.json", "seal.json.sig")
_TABLES = ("results", "propagation", "timings")
CONTENT = (  # all files that a run folder can contain; * matches any text, including folders
    *(HEAD, file_digests.FILE, CAMPAIGN, "plan.csv", "plan/*.jsonl", "reviewed.json", "checks.json"),
    *SIGNATURE,
    *("golden/*/*", "patches/*.blocks"),
    *("records/*.jsonl", "timings/*.jsonl", "proof/*.jsonl"),
    *("series/*.js", "series/*.blocks"),
    *(f"{TRACES}/*/*", *(f"plots/*.{kind}" for kind in ("svg", "jpg", "png", "mp4", "gif"))),
    *("results.csv", "results.parquet", "propagation.parquet", "timings.parquet", "results.json"),
    *("report/*.md", "report/*.html", "report/made_from.json", "report/series/*.js"),
    *("report/tables/*.csv", "report/figures/*.svg", "report/figures/*.png", "report/compare-*/*.csv"),
    *("exports/mcap/*.mcap", *(f"exports/{name}.{kind}" for name in _TABLES for kind in ("csv", "parquet"))),
    *(f"{ASIDE}/*", "owner.lock", "workers/*", f"{SCRATCH}/*"),
)
FOLDERS = {pattern.partition("/")[0] for pattern in CONTENT if "/" in pattern}
_ALL_FOLDERS = FOLDERS | {f"report/{name}" for name in ("series", "tables", "figures")}
_ALL_FOLDERS |= {"series/kept", "exports/mcap"}
# what targets wrote, and what `verify --repair` set aside; nothing in them is reached by its name
_CLOSED = (SCRATCH, ASIDE, f"{TRACES}/*/{SCRATCH}")


def check_contents(run: Path) -> None:
    """Raise Outside for a link, a special file, an unprintable name, a file in place of a folder, folders
    nested too deeply, or two names that differ only in case.

    Folders that can contain anything only have to be folders.
    """
    tops: dict[str, str] = {}  # names in `run` itself
    for name, entry in entries_below(run, is_closed):
        if not is_plain(entry):
            raise not_plain(Path(entry.path))
        if not entry.name.isprintable():
            raise _refused(f"the name {entry.name!a}", run, "names of printable characters")
        if is_deep(name):
            raise _refused("deeply nested folders", run, "few folders in each other")
        if name in _ALL_FOLDERS and not entry.is_dir():
            raise _refused("a file", Path(entry.path), "a folder")
        if "/" not in name and (before := tops.setdefault(name.casefold(), name)) != name:
            raise _refused(f"both {before!a} and {name!a}", run, "names that differ not only in case")


def belongs(name: str) -> bool:
    """Whether a run folder can contain a folder or file of this name, which is not a path."""
    return name in FOLDERS or any(fnmatchcase(name, pattern) for pattern in CONTENT if "/" not in pattern)


def is_closed(name: str) -> bool:
    """Whether the folder of this name in a run folder can contain anything."""
    return any(fnmatchcase(name, pattern) and name.count("/") == pattern.count("/") for pattern in _CLOSED)


def _refused(got: str, where: Path, expected: str) -> Outside:
    return Outside(got, where=where, expected=expected, remedy="rename or delete what does not belong here")
