"""Generate the page of doors: everything that can be added, and how."""

import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from pkgutil import resolve_name

from mutator._common.extension_doors import (
    ALL_DOORS,
    DISTRIBUTOR_DOOR,
    EXPORT_DOOR,
    LIBRARY_IMPORTER_DOOR,
    OPERATOR_DOOR,
    STUDY_DOOR,
    TRACE_IMPORTER_DOOR,
    Door,
)
from mutator._common.table_rendering import TextTable
from mutator.reference.yaml_key_tables import generated_page_head
from mutator.workspace import Workspace

_INTRO = """\
A door is a place where you add something to mutator. Most take one file.
[CONTRIBUTING](../../CONTRIBUTING.md#add-something) says more about those inside the project.
"""
_ENTRY_POINTS_NOTE = """\
Another package adds these by an entry point. It is loaded only when somebody uses its name. If it cannot be
loaded, is no object of the stated class, has the name of another, or fails while it is used, the error names
the package. Its code runs with your rights, so install only packages that you trust. Inside the project, the
object is an attribute of a new module in the folder; the module's name is the object's name, with `_` for
`-`, and after a keyword of Python.

Once a package is uninstalled, the files that its exports wrote in run folders are strangers to
`mutator clean`, which then leaves these folders alone.

The package in `tests/fixtures/doors/` has an example of each but the study.
"""
_EXAMPLE_BY_DOOR = {
    EXPORT_DOOR.addition: ("a format of `mutator export`", "counts", "door_examples.counts:EXPORT"),
    TRACE_IMPORTER_DOOR.addition: (
        "a format of traces; its name is the suffix",
        "jsonl",
        "door_examples.jsonl:IMPORTER",
    ),
    LIBRARY_IMPORTER_DOOR.addition: (
        "a format of `mutator import` ([import faults](../how-to/import-faults.md))",
        "drives",
        "door_examples.drives:IMPORTER",
    ),
    DISTRIBUTOR_DOOR.addition: (
        "a way to run experiments elsewhere, chosen by `--cluster NAME:WHERE`",
        "here",
        "door_examples.here:DISTRIBUTOR",
    ),
    OPERATOR_DOOR.addition: (
        "mutants without a spec ([mutation operators](operators.md))",
        "zero",
        "door_examples.zero:OPERATOR",
    ),
    STUDY_DOOR.addition: (
        "published results with which runs are compared ([add a study](../how-to/add-a-study.md))",
        "crash_tests",
        "crash_tests.study:STUDY",
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _InternalDoor:
    """A door that is no entry point, or has a page of its own."""

    name: str
    purpose: str
    protocol: str
    how_to_register: str
    example: str


_INTERNAL_DOORS = (
    _InternalDoor(
        name="fault model",
        purpose="what can go wrong in a statement",
        protocol="a Jinja2 template and its YAML, with examples that are its tests",
        how_to_register="put both into the library's `templates/`",
        example="[Add a fault model](../how-to/add-a-fault-model.md)",
    ),
    _InternalDoor(
        name="hazard, metric",
        purpose="what is judged and measured in a run, and its result columns",
        protocol="a formula over channels; of a metric, also over those of the golden run",
        how_to_register="write it into the target's manifest",
        example="[Add a hazard](../how-to/add-a-hazard.md)",
    ),
    _InternalDoor(
        name="target",
        purpose="another controller",
        protocol="a manifest, and a class with `step()`",
        how_to_register="put the manifest into the library's `targets/`",
        example="[Add a target](../how-to/add-a-target.md)",
    ),
    _InternalDoor(
        name="trigger kind",
        purpose="when a fault is active",
        protocol="a function that makes a `Trigger` from a condition and a hold",
        how_to_register="`mutator/triggers/trigger_kinds.py`; for the command line, `TRIGGER_PARSERS` and "
        "`TRIGGER_FORMS`",
        example="`always_trigger` in that module",
    ),
    _InternalDoor(
        name="engine",
        purpose="how a run is executed",
        protocol="`mutator.engines.engine_kinds.EngineKind`",
        how_to_register="`ENGINES` in `mutator/engines/engine_kinds.py`",
        example="`mutator/engines/reference_engine.py`",
    ),
    _InternalDoor(
        name="panel",
        purpose="a part of the report",
        protocol="a function from a `ReportedRun` to a `Panel` or None",
        how_to_register="`PANELS` or `PLANNED_PAGES` in `mutator/report/panels/`",
        example="`mutator/report/panels/provenance_panel.py`",
    ),
)


def render_doors_page(workspace: Workspace) -> str:
    heads = ("door", "what it adds", "protocol", "how to register", "example")
    rows = [(f"**{p.name}**", p.purpose, p.protocol, p.how_to_register, p.example) for p in _INTERNAL_DOORS]
    inside = TextTable(heads=heads, rows=rows).as_markdown(escape=False)
    parts = [generated_page_head("Doors"), _INTRO, "## Entry points of other packages\n", _ENTRY_POINTS_NOTE]
    for door in ALL_DOORS:
        parts += _door_section(door)
    return "\n".join([*parts, "## Data and tables\n", inside]).rstrip() + "\n"


def _door_section(door: Door) -> Iterator[str]:
    adds, example_name, example_value = _EXAMPLE_BY_DOOR[door.addition]
    kind = resolve_name(door.type_path)
    yield f"### {door.addition.capitalize()}\n"
    yield f"It adds {adds}. The object is a `{door.type_path.replace(':', '.')}`."
    if door.shipped_package:
        folder = door.shipped_package.replace(".", "/")
        attribute = door.attribute_in_module
        yield f"Inside the project, it is the attribute `{attribute}` of a module in `{folder}/`."
    yield f"\n{inspect.cleandoc(kind.__doc__)}\n"
    yield f'```toml\n[project.entry-points."{door.entry_point_group}"]'
    yield f'{example_name} = "{example_value}"\n```\n'
    yield from _mapping_tables(door)
    shipped_rows = [(f"`{name}`", door.load(name).about) for name in door.shipped_names()]
    if shipped_rows:
        yield (
            TextTable(heads=(door.addition, "what it is"), rows=shipped_rows).as_markdown(escape=False) + "\n"
        )


def _mapping_tables(door: Door) -> Iterator[str]:
    """Yield what each shipped importer of libraries makes of the entries of its files."""
    for name in door.shipped_names() if door is LIBRARY_IMPORTER_DOOR else ():
        heads = (f"entry of `{name}`", "what it becomes", "what differs, or why it is refused")
        rows = door.load(name).mapping
        yield TextTable(heads=heads, rows=rows).as_markdown(escape=False) + "\n"
