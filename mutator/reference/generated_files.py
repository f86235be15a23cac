"""The generated files of the documentation, and the public names for type checkers."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

from mutator._common.shipped_files import check_not_shipped
from mutator.reference import (
    command_line_page,
    doors_page,
    fault_models_page,
    operators_page,
    python_api,
    results_and_channels_pages,
    yaml_format_pages,
)
from mutator.reference.json_schemas import build_editor_schema, yaml_formats
from mutator.workspace import Workspace

PAGES_FOLDER = Path("docs") / "reference"
SCHEMAS_FOLDER = PAGES_FOLDER / "schemas"
STUB_PATH = Path("mutator") / "__init__.pyi"
RENDER_BY_PAGE: dict[str, Callable[[Workspace], str]] = {
    "api.md": python_api.render_api_page,
    "campaign.md": yaml_format_pages.render_campaigns_page,
    "defence.md": yaml_format_pages.render_defences_page,
    "family.md": yaml_format_pages.render_families_page,
    "channels.md": results_and_channels_pages.render_channels_page,
    "cluster-file.md": yaml_format_pages.render_clusters_page,
    "cli.md": command_line_page.render_command_line_page,
    "doors.md": doors_page.render_doors_page,
    "fault-models.md": fault_models_page.render_fault_models_page,
    "fault-spec.md": yaml_format_pages.render_fault_spec_page,
    "hazard-analysis.md": yaml_format_pages.render_hazard_analysis_page,
    "operators.md": operators_page.render_operators_page,
    "results.md": results_and_channels_pages.render_results_page,
    "target-manifest.md": yaml_format_pages.render_manifests_page,
}


def render_files(workspace: Workspace) -> dict[Path, str]:
    files = {PAGES_FOLDER / name: render(workspace) for name, render in RENDER_BY_PAGE.items()} | {
        STUB_PATH: python_api.render_stub()
    }
    fault_models = workspace.fault_models()
    for file_format in yaml_formats(workspace.readings()):
        text = json.dumps(build_editor_schema(file_format, fault_models), indent=1, ensure_ascii=False)
        files[SCHEMAS_FOLDER / f"{file_format.name}.json"] = text + "\n"
    return files


def write_files(workspace: Workspace) -> Iterator[Path]:
    """Write the files into the library's clone; yield the paths. MutatorError if there is no clone."""
    clone = workspace.library.parent
    check_not_shipped(clone)
    for path, text in render_files(workspace).items():
        (clone / path).parent.mkdir(parents=True, exist_ok=True)
        (clone / path).write_text(text, encoding="utf-8")
        yield path
