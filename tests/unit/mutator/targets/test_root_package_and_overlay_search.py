"""Roots of targets, including installed packages."""

import shutil
import sys
from pathlib import Path

import pytest

from mutator.api.trials import try_fault
from mutator.checks.library_check import library_problems
from mutator.errors import MutatorError
from mutator.model import Outcome
from mutator.workspace import Workspace


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of installed packages that fail if they are imported."""
    folder = tmp_path / "site"
    (folder / "filters_of_poles").mkdir(parents=True)
    (folder / "filters_of_poles" / "__init__.py").write_text("raise RuntimeError('imported')\n")
    (folder / "filters_of_poles" / "gains.txt").write_text("1\n")
    (folder / "aside_of_poles.py").write_text("raise RuntimeError('imported')\n")
    monkeypatch.syspath_prepend(str(folder))
    return folder


def installed(pole: Workspace, **keys: str) -> Workspace:
    path = pole.library / "targets" / "pole.yaml"
    lines = [line for line in path.read_text().splitlines() if line.partition(":")[0] not in keys]
    path.write_text("\n".join([lines[0], *(f"{k}: {v}" for k, v in keys.items() if v), *lines[1:]]) + "\n")
    return pole


def test_the_tree_has_only_the_installed_package_and_the_overlay(pole: Workspace, site: Path) -> None:
    manifest = installed(pole, root="installed:filters_of_poles", packages="[filters_of_poles]").manifest(
        "pole"
    )
    assert manifest.root == site.resolve()
    own = {"filters_of_poles/__init__.py", "filters_of_poles/gains.txt"}
    assert manifest.tree.files.keys() - manifest.tree.overlaid_paths == own
    assert manifest.probe_package == "filters_of_poles"
    assert "filters_of_poles" not in sys.modules
    files = '["filters_of_poles/*.py"]'
    manifest = installed(pole, files=files).manifest("pole")
    assert "filters_of_poles/gains.txt" not in manifest.tree.files


def test_the_root_can_be_an_installed_module(pole: Workspace, site: Path) -> None:
    installed(pole, root="installed:aside_of_poles", packages="[aside_of_poles.py]")
    manifest = pole.manifest("pole")
    assert manifest.root == site.resolve()
    assert manifest.tree.files.keys() - manifest.tree.overlaid_paths == {"aside_of_poles.py"}


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            {"root": "installed:none_of_poles", "packages": "[none_of_poles]"},
            "2: no package or module 'none_of_poles' is .*; pip install 'none_of_poles'",
        ),
        ({"root": "installed:_none", "packages": "[_none]"}, "2: .*; pip install '_none'"),
        ({"root": "installed:sys", "packages": "[sys]"}, "2: no package or module 'sys' is installed"),
        ({"root": "'installed:a.b'", "packages": "[a]"}, "2: 'installed:a.b'; expected installed: and the"),
        (
            {"root": "installed:filters_of_poles", "packages": "[filters_of_poles, aside_of_poles.py]"},
            "3: 'aside_of_poles.py' outside installed:filters_of_poles; expected 'filters_of_poles' alone",
        ),
        (
            {
                "root": "installed:filters_of_poles",
                "packages": "[filters_of_poles]",
                "files": '["**/*.py"]',
            },
            r"4: '\*\*/\*.py' outside installed:filters_of_poles; expected globs that begin with",
        ),
    ],
)
def test_an_invalid_installed_root_is_refused(
    pole: Workspace, site: Path, keys: dict[str, str], said: str
) -> None:
    with pytest.raises(MutatorError, match=f"pole.yaml:{said}"):
        installed(pole, **keys).manifest("pole")


def test_check_reports_a_missing_package_once(pole: Workspace) -> None:
    installed(pole, root="installed:none_of_poles", packages="[none_of_poles]", requires='["poles>=1"]')
    (problem,) = library_problems(pole, "pole")
    assert problem.remedy == "pip install 'poles>=1'"


def test_a_mutant_of_an_installed_package_runs_from_its_own_tree(
    pole: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, site = pole.manifest("pole").root, tmp_path / "site"
    shutil.move(root / "filters", site / "filters")
    for name in ("pole.py", "regulator.py"):  # modules that the glue imports
        shutil.move(root / name, pole.library / "overlays" / "pole" / name)
    shutil.rmtree(pole.library / "faults" / "sensor")
    monkeypatch.syspath_prepend(str(site))
    before = (site / "filters" / "low_pass.py").read_bytes()
    installed(pole, root="installed:filters", packages="", package="filters")
    trial = try_fault("filter/memory", "tilted", 1.0, workspace=pole)
    assert trial.record.outcome is Outcome.HAZARD
    assert "from filters import _fi" in trial.patch
    assert (site / "filters" / "low_pass.py").read_bytes() == before
