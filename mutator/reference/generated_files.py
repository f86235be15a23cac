"""The generated files of the documentation, and the public names for type checkers."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

from mutator._common.shipped import refuse_shipped
from mutator.reference import (
    columns_and_channels,
    command_line,
    doors_page,
    fault_models_page,
    format_pages,
    operators_page,
    python_api,
)
from mutator.reference.schemas import editor_schema, file_formats
from mutator.workspace import Workspace

FOLDER = Path("docs") / "reference"
SCHEMAS = FOLDER / "schemas"
STUB = Path("mutator") / "__init__.pyi"
PAGES: dict[str, Callable[[Workspace], str]] = {
    "api.md": python_api.python_api,
    "campaign.md": format_pages.campaigns,
    "channels.md": columns_and_channels.channels,
    "cluster-file.md": format_pages.clusters,
    "cli.md": command_line.command_line,
    "doors.md": doors_page.doors_page,
    "fault-models.md": fault_models_page.fault_models_page,
    "fault-spec.md": format_pages.fault_spec,
    "hazard-analysis.md": format_pages.hazard_analysis,
    "operators.md": operators_page.operators_page,
    "results.md": columns_and_channels.results,
    "target-manifest.md": format_pages.manifests,
}


def generated_files(workspace: Workspace) -> dict[Path, str]:
    files = {FOLDER / name: make(workspace) for name, make in PAGES.items()} | {STUB: python_api.stub()}
    known = workspace.fault_models()
    for kind in file_formats(workspace.readings()):
        text = json.dumps(editor_schema(kind, known), indent=1, ensure_ascii=False)
        files[SCHEMAS / f"{kind.name}.json"] = text + "\n"
    return files


def write(workspace: Workspace) -> Iterator[Path]:
    """Write the files into the library's clone; yield the paths. MutatorError if there is no clone."""
    clone = workspace.library.parent
    refuse_shipped(clone)
    for path, text in generated_files(workspace).items():
        (clone / path).parent.mkdir(parents=True, exist_ok=True)
        (clone / path).write_text(text, encoding="utf-8")
        yield path
