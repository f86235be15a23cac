"""The generated files of the documentation, and the public names for type checkers."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

from mutator._common.shipped import refuse_shipped
from mutator.reference import api, cli, doors, formats, models, operators, recorded
from mutator.reference.schemas import editor_schema, file_formats
from mutator.workspace import Workspace

FOLDER = Path("docs") / "reference"
SCHEMAS = FOLDER / "schemas"
STUB = Path("mutator") / "__init__.pyi"
PAGES: dict[str, Callable[[Workspace], str]] = {
    "api.md": api.python_api,
    "campaign.md": formats.campaigns,
    "channels.md": recorded.channels,
    "cluster-file.md": formats.clusters,
    "cli.md": cli.command_line,
    "doors.md": doors.doors_page,
    "fault-models.md": models.fault_models_page,
    "fault-spec.md": formats.fault_spec,
    "hazard-analysis.md": formats.hazard_analysis,
    "operators.md": operators.operators_page,
    "results.md": recorded.results,
    "target-manifest.md": formats.manifests,
}


def generated_files(workspace: Workspace) -> dict[Path, str]:
    files = {FOLDER / name: make(workspace) for name, make in PAGES.items()} | {STUB: api.stub()}
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
