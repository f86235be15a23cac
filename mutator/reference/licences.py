"""The page of licences: what each package in constraints.txt says of itself where it is installed.

`python -m mutator.reference.licences` writes it, in the clone it is run in. It is no part of
`python -m mutator.reference`, since it depends on what is installed.
"""

import re
import tomllib
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

from mutator._common.tables import Table
from mutator.errors import MutatorError

PAGE = Path("docs", "reference", "licences.md")
_HEAD = """\
# Licences of the dependencies

<!-- Written by `python -m mutator.reference.licences`. -->

`mutator` itself is under the MIT License. The packages below are installed beside it, each under its own
licence, given here as the package states it. Binary wheels may carry libraries under further licences, as
those of `av` and `opencv-python-headless` carry FFmpeg; the `.dist-info` of such a wheel has them.

*Needed by* says who asks for a package: `mutator` to run; an extra of it (`test`, `dev`, `train`,
`examples`); or only other packages of this table.

"""
_ROW = re.compile(r"^\| ([\w.-]+) \| [^|]* \| ([^|]+) \|$", re.MULTILINE)


def write_licences(clone: Path) -> None:
    """Write the page. A package that is not installed here keeps its licence; MutatorError if it has none."""
    page = clone / PAGE
    known = table_of(page.read_text(encoding="utf-8")) if page.exists() else {}
    direct = _needed_by(clone)
    rows = [(name, direct.get(name, "others"), _licence(name, known)) for name in constrained(clone)]
    table = Table(heads=("package", "needed by", "licence"), rows=rows).as_markdown(escape=False)
    page.write_text(f"{_HEAD}{table}\n", encoding="utf-8")


def table_of(page: str) -> dict[str, str]:
    """The licence of each package, as the page has it."""
    return {name: licence for name, licence in _ROW.findall(page) if name != "package"}


def constrained(clone: Path) -> tuple[str, ...]:
    """Names of the packages in constraints.txt, sorted, each once."""
    text = (clone / "constraints.txt").read_text(encoding="utf-8")
    return tuple(sorted(set(re.findall(r"^([\w.-]+)==", text, re.MULTILINE))))


def stated_licence(name: str) -> str | None:
    """The licence that an installed package states; None when it is not installed here.

    The licence expression where there is one (PEP 639); else the classifier; else the first line of the free
    text, which may be the whole licence.
    """
    try:
        stated = metadata.metadata(name)
    except metadata.PackageNotFoundError:
        return None
    expressions = stated.get_all("License-Expression", [])
    classifiers = [
        c.split(" :: ")[1:] for c in stated.get_all("Classifier", []) if c.startswith("License :: ")
    ]
    named = [words[-1] for words in classifiers if words != ["OSI Approved"]]
    texts = [text.strip().partition("\n")[0] for text in stated.get_all("License", [])]
    return ", ".join(expressions or named or texts or ["none stated"])


def _licence(name: str, known: Mapping[str, str]) -> str:
    licence = stated_licence(name) or known.get(name)
    if licence is None:
        raise MutatorError(f"no licence known of {name}", where=PAGE, remedy=f"install {name} here")
    return licence


def _needed_by(clone: Path) -> dict[str, str]:
    """Who asks for each direct dependency: mutator first, then the first of its extras."""
    project = tomllib.loads((clone / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {"mutator": project["dependencies"]}
    groups |= {f"`{extra}`": lines for extra, lines in project["optional-dependencies"].items()}
    needed: dict[str, str] = {}
    for group, lines in groups.items():
        for name in map(_name, lines):
            needed.setdefault(name, group)
    return needed


def _name(requirement: str) -> str:
    return re.split(r"[^\w.-]", requirement, maxsplit=1)[0].lower()


if __name__ == "__main__":
    write_licences(Path.cwd())
    print(PAGE)
