"""Faults are injected into defended trees as into the target's own."""

import shutil
from pathlib import Path

import pytest

from mutator.errors import InvalidMutant
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault
from mutator.mutants.injected_line_syntax import tag_of
from mutator.mutants.mutant_building import Mutant, build
from mutator.mutants.probe_contract import is_probe_path
from mutator.targets.defence_lines import without_defence_lines
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

ROOT = Path(__file__).parents[2]
LIBRARIES = {"toy": ROOT / "tests/toy/fault_library", "shipped": ROOT / "fault_library"}


def injected_lines(mutant: Mutant) -> dict[str, list[bytes]]:
    return {
        path: [line for line in data.splitlines() if (tag := tag_of(line)) and tag.is_of_fault]
        for path, data in mutant.files.items()
        if not is_probe_path(path)
    }


def own_files(files: dict[str, bytes]) -> dict[str, bytes]:
    return {path: without_defence_lines(data) for path, data in files.items() if not is_probe_path(path)}


def faults_of(workspace: Workspace, manifest: TargetManifest) -> list[Fault]:
    models = workspace.fault_models()
    return [
        fault
        for reading in workspace.readings().names
        for spec in workspace.specs()
        for fault in expand_spec(spec, 1, reading, models=models, manifest=manifest)
    ]


def workspace_of(name: str, toy_templates: Path) -> Workspace:
    return Workspace.find(library=LIBRARIES[name], templates=toy_templates)


@pytest.fixture(scope="module")
def templates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the templates of the harness and of the toy."""
    folder = tmp_path_factory.mktemp("both") / "templates"
    for source in (ROOT / "templates", ROOT / "tests/toy/templates"):
        shutil.copytree(source, folder, dirs_exist_ok=True)
    return folder


@pytest.mark.parametrize("name", LIBRARIES)
def test_each_fault_gives_the_same_lines_in_a_defended_tree(name: str, templates: Path) -> None:
    """Without the defences' lines, each changed file equals that of the mutant of the target's own tree."""
    workspace = workspace_of(name, templates)
    manifest = workspace.manifest(workspace.target_name())
    if not workspace.defences:
        pytest.skip("the library has no defences")
    defended = workspace.defended(manifest, workspace.defences)
    models = workspace.fault_models()
    for fault in faults_of(workspace, manifest):
        try:
            mutant = build(manifest, models, fault, always_trigger())
        except InvalidMutant:
            with pytest.raises(InvalidMutant):
                build(defended, models, fault, always_trigger())
            continue
        in_defended = build(defended, models, fault, always_trigger())
        assert injected_lines(in_defended) == injected_lines(mutant), fault.label
        assert own_files(in_defended.files) == own_files(mutant.files), fault.label


@pytest.mark.parametrize("name", LIBRARIES)
def test_without_its_lines_and_files_a_defended_tree_is_the_target(name: str, templates: Path) -> None:
    """Each file is restored to the byte, and all new files are those of the defences."""
    workspace = workspace_of(name, templates)
    manifest = workspace.manifest(workspace.target_name())
    for defence in workspace.defences:
        tree = workspace.defended(manifest, [defence]).tree
        files = {path: without_defence_lines(tree.files[path]) for path in manifest.tree.files}
        assert files == manifest.tree.files
        added = tree.files.keys() - manifest.tree.files.keys()
        assert {Path(path).name for path in added} == {"_fd.py", f"_fd_{defence}.py"}
