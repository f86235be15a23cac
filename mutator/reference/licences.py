"""Generate the page of licences, as stated by the installed packages that constraints.txt lists, and of the
code of others that the repository contains.

`python -m mutator.reference.licences` writes it. `python -m mutator.reference` does not, since it depends on
the installed packages.
"""

import re
import tomllib
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

from mutator._common.table_rendering import TextTable
from mutator.errors import MutatorError

PAGE_PATH = Path("docs", "reference", "licences.md")
_PAGE_HEAD = """\
# Licences of the dependencies

<!-- Written by `python -m mutator.reference.licences`. -->

`mutator` is under the MIT License. The packages below are installed with it. Each has its own licence, shown
as the package states it. Binary wheels can include libraries under other licences: the wheels of `av` and
`opencv-python-headless` include FFmpeg. The `.dist-info` of such a wheel contains these licences.

*Needed by* shows what requires a package: `mutator` itself, one of its extras (`test`, `dev`, `train`,
`examples`), or only other packages in this table.

"""
_PAGE_END = """
## Code of others in the package

Pages that `mutator` writes contain [uPlot](https://github.com/leeoniya/uPlot) {version} by Leon Sorokin,
which draws plots. `mutator/web/uplot` has its minified files as npm's package `uplot` has them, and its
licence:

> {licence}
"""
UPLOT_FOLDER = Path("mutator", "web", "uplot")
_UPLOT_BANNER_PATTERN = re.compile(r"github\.com/leeoniya/uPlot \(v([\d.]+)\)")
_TABLE_ROW_PATTERN = re.compile(r"^\| ([\w.-]+) \| [^|]* \| ([^|]+) \|$", re.MULTILINE)


def write_licences(clone: Path) -> None:
    """Write the page. A package that is not installed keeps its listed licence; MutatorError if none is
    listed.
    """
    page_path = clone / PAGE_PATH
    licence_by_package = (
        licence_by_package_in(page_path.read_text(encoding="utf-8")) if page_path.exists() else {}
    )
    group_by_package = _first_group_by_package(clone)
    rows = [
        (name, group_by_package.get(name, "others"), _licence_of(name, licence_by_package))
        for name in packages_in_constraints(clone)
    ]
    table = TextTable(heads=("package", "needed by", "licence"), rows=rows).as_markdown(escape=False)
    page_path.write_text(f"{_PAGE_HEAD}{table}\n{_vendored_code(clone)}", encoding="utf-8")


def uplot_version(clone: Path) -> str:
    """Return the version that the vendored file of uPlot states."""
    text = (clone / UPLOT_FOLDER / "uPlot.iife.min.js").read_text(encoding="utf-8")
    match = _UPLOT_BANNER_PATTERN.search(text)
    if match is None:
        raise MutatorError("no version", where=UPLOT_FOLDER, expected="uPlot's own first line")
    return match[1]


def _vendored_code(clone: Path) -> str:
    """Return the section on vendored code; empty for a clone without it."""
    if not (clone / UPLOT_FOLDER).is_dir():
        return ""
    licence = (clone / UPLOT_FOLDER / "LICENSE").read_text(encoding="utf-8").strip()
    quoted = "\n".join(f"> {line}".rstrip() for line in licence.splitlines())
    return _PAGE_END.format(version=uplot_version(clone), licence=quoted.removeprefix("> "))


def licence_by_package_in(page: str) -> dict[str, str]:
    return {name: licence for name, licence in _TABLE_ROW_PATTERN.findall(page) if name != "package"}


def packages_in_constraints(clone: Path) -> tuple[str, ...]:
    text = (clone / "constraints.txt").read_text(encoding="utf-8")
    return tuple(sorted(set(re.findall(r"^([\w.-]+)==", text, re.MULTILINE))))


def stated_licence(name: str) -> str | None:
    """Return the licence that an installed package states; None if it is not installed.

    This is the licence expression (PEP 639), else the classifier, else the first line of the free text.
    """
    try:
        stated = metadata.metadata(name)
    except metadata.PackageNotFoundError:
        return None
    expressions = stated.get_all("License-Expression", [])
    classifiers = [
        c.split(" :: ")[1:] for c in stated.get_all("Classifier", []) if c.startswith("License :: ")
    ]
    classifier_names = [words[-1] for words in classifiers if words != ["OSI Approved"]]
    texts = [text.strip().partition("\n")[0] for text in stated.get_all("License", [])]
    return ", ".join(expressions or classifier_names or texts or ["none stated"])


def _licence_of(name: str, listed: Mapping[str, str]) -> str:
    licence = stated_licence(name) or listed.get(name)
    if licence is None:
        raise MutatorError(f"no known licence for {name}", where=PAGE_PATH, remedy=f"install {name}")
    return licence


def _first_group_by_package(clone: Path) -> dict[str, str]:
    project = tomllib.loads((clone / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {"mutator": project["dependencies"]}
    groups |= {f"`{extra}`": lines for extra, lines in project["optional-dependencies"].items()}
    group_by_package: dict[str, str] = {}
    for group, lines in groups.items():
        for name in map(_package_name, lines):
            group_by_package.setdefault(name, group)  # the first group counts: `mutator` before its extras
    return group_by_package


def _package_name(requirement: str) -> str:
    return re.split(r"[^\w.-]", requirement, maxsplit=1)[0].lower()


if __name__ == "__main__":
    write_licences(Path.cwd())
    print(PAGE_PATH)
