"""The sdist and the wheel, built by the standard front end, installed and used outside a clone."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import time
import zipfile
from io import BytesIO
from pathlib import Path

import pytest

from mutator._common.version import DISTRIBUTION
from mutator.campaigns.plan import build_plan
from mutator.workspace import Workspace

pytestmark = pytest.mark.slow

CLONE = Path(__file__).parents[2]
SHIPPED = ("target", "fault_library", "templates")
CHAFF = ("radar/chaff", "--scenario", "S1", "--trigger", "C2", "--value", "40")


def environment(here: Path) -> dict[str, str]:
    settings = ("MUTATOR_", "PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(settings)}
    return kept | {"XDG_CACHE_HOME": str(here / "cache"), "XDG_DATA_HOME": str(here / "data")}


def call(*words: object, here: Path) -> str:
    done = subprocess.run(
        [str(word) for word in words],
        cwd=here,
        env=environment(here),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{words}: {done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def interrupt_after_first_record(*words: object, here: Path, out: Path) -> None:
    command = [str(word) for word in words]
    process = subprocess.Popen(
        command, cwd=here, env=environment(here), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while process.poll() is None and not any(
        p.read_bytes().count(b"\n") > 1  # the first line is a head
        for p in out.glob("records/*.jsonl")
    ):
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    assert process.wait(60) != 0, "it ended before it could be interrupted"


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the clone, because a build leaves files in it."""
    copy = tmp_path_factory.mktemp("copy") / "clone"
    strangers = shutil.ignore_patterns(".*", "build", "dist", "runs", "*.egg-info")
    return Path(shutil.copytree(CLONE, copy, ignore=strangers))


def files(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture(scope="module")
def built(clone: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("built")
    call(sys.executable, "-m", "build", "--outdir", out, clone, here=out)
    return out


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    return next(built.glob("*.whl"))


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("environment")
    call(sys.executable, "-m", "venv", home, here=home)
    python = home / "bin" / "python"
    call(python, "-m", "pip", "install", "-c", CLONE / "constraints.txt", wheel, here=home)
    return python


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    assert not any((folder / "fault_library").exists() for folder in tmp_path.parents)
    return tmp_path


def test_clone_and_sdist_build_the_same_wheel(clone: Path, built: Path, wheel: Path, tmp_path: Path) -> None:
    stale = clone / "build" / "lib" / "mutator" / "stale.py"
    stale.parent.mkdir(parents=True, exist_ok=True)
    stale.touch()
    call(sys.executable, "-m", "build", "--wheel", "--outdir", tmp_path, clone, here=tmp_path)
    assert files(next(tmp_path.glob("*.whl"))) == files(wheel)
    with tarfile.open(next(built.glob("*.tar.gz"))) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {
        "LICENSE",
        "CHANGELOG.md",
        "constraints.txt",
        "tests/e2e/test_wheel.py",
        "docs/README.md",
    } <= names


def test_the_wheel_contains_only_the_package_its_data_and_the_archive(wheel: Path) -> None:
    found = files(wheel)
    tops = {name.partition("/")[0] for name in found}
    assert tops == {"mutator", *(top for top in tops if top.endswith(".dist-info"))}
    data = {name for name in found if name.startswith("mutator/") and not name.endswith(".py")}
    sources = {p.relative_to(CLONE).as_posix() for p in (CLONE / "mutator").rglob("*") if p.is_file()}
    assert {n for n in sources if not n.endswith((".py", ".pyc"))} == data - {"mutator/_common/shipped.zip"}
    assert {n for n in sources if n.endswith(".py")} == {n for n in found if n.endswith(".py")}
    with zipfile.ZipFile(BytesIO(found["mutator/_common/shipped.zip"])) as archive:
        shipped = {name: archive.read(name) for name in archive.namelist()}
    ours = {p for folder in SHIPPED for p in (CLONE / folder).rglob("*") if p.is_file()}
    assert {p.relative_to(CLONE).as_posix() for p in ours if p.suffix != ".pyc"} == {*shipped}
    assert all((CLONE / name).read_bytes() == data for name, data in shipped.items())


def test_the_readmes_line_with_uv_installs_the_program(clone: Path, tmp_path: Path) -> None:
    call(sys.executable, "-m", "venv", tmp_path / "tool", here=clone)
    call(tmp_path / "tool" / "bin" / "python", "-m", "pip", "install", "uv", here=clone)
    lines = (clone / "README.md").read_text(encoding="utf-8").splitlines()
    [line] = [line for line in lines if line.startswith("uv venv ")]
    install, _, run = line.rpartition(" && ")
    assert run.startswith(".venv/bin/mutator run quickstart")
    path = f"{tmp_path / 'tool' / 'bin'}:{os.environ['PATH']}"
    call("env", f"PATH={path}", "sh", "-c", f"{install} && .venv/bin/mutator list scenarios", here=clone)


def test_the_controller_is_neither_importable_nor_compiled(python: Path, elsewhere: Path) -> None:
    code = "import importlib.util; print(importlib.util.find_spec('selfdrive'))"
    assert call(python, "-c", code, here=elsewhere) == "None\n"
    mutator = python.with_name("mutator")
    call(mutator, "try", *CHAFF, "--out", elsewhere / "tried", here=elsewhere)
    assert not list((python.parents[1] / "lib").rglob("selfdrive*"))
    [unpacked] = (elsewhere / "data" / "mutator" / "shipped").iterdir()
    assert (unpacked / "target" / "selfdrive" / "__init__.py").is_file()
    assert not [*unpacked.rglob("*.pyc"), *unpacked.rglob("__pycache__")]


def test_pip_knows_the_wheel_by_the_name_of_the_distribution(wheel: Path, python: Path) -> None:
    assert wheel.name.startswith("mutator_fi-")
    listed = json.loads(call(python, "-m", "pip", "list", "--format", "json", here=wheel.parent))
    assert [package["name"] for package in listed if "mutator" in package["name"]] == [DISTRIBUTION]
    examined = json.loads(call(python.with_name("mutator"), "doctor", "--json", here=wheel.parent))
    assert "libcst" in str(examined), "the harness's requirements are checked"


def test_the_first_commands_work_in_an_empty_folder(python: Path, elsewhere: Path) -> None:
    mutator, workspace = python.with_name("mutator"), Workspace.find(CLONE)
    listed = json.loads(call(mutator, "list", "--json", here=elsewhere))
    assert [spec["name"] for spec in listed["specs"]] == [spec.name for spec in workspace.specs()]
    tried = call(mutator, "try", *CHAFF, here=elsewhere)
    assert "d_rel = d_rel + 40  # fi:" in tried
    assert "experiment     0ef69fca1dbb8f42" in tried
    assert "verdict: hazard" in tried
    run = (mutator, "run", "quickstart", "--out", "runs/q", "-n", 2)
    interrupt_after_first_record(*run, here=elsewhere, out=elsewhere / "runs/q")
    resumed = call(*run, here=elsewhere)
    [now] = re.findall(r"60 of 60 experiments done, (\d+) now", resumed)
    assert 0 < int(now) < 60
    head = json.loads((elsewhere / "runs/q/run.json").read_text())
    plan = build_plan(workspace, "quickstart")
    assert head["plan"] == plan.digest
    assert head["sources"]["target"] == workspace.manifest("openpilot").tree.digest
    assert "60 experiments" in (elsewhere / "runs/q/report/REPORT.md").read_text()


def test_edits_in_a_new_library_take_effect(python: Path, elsewhere: Path) -> None:
    mutator = python.with_name("mutator")
    call(mutator, "init", "mine", here=elsewhere)
    mine = elsewhere / "mine"
    template = mine / "templates" / "offset.py.j2"
    template.write_text(template.read_text().replace("{{ by | signed }}", "{{ by | signed }} * 1.5", 1))
    spec = mine / "fault_library" / "faults" / "radar" / "chaff.yaml"
    spec.write_text(spec.read_text().replace("after_assign: d_rel", "after_assign: v_rel"))
    tried = call(mutator, "try", *CHAFF, here=mine)
    assert "v_rel = v_rel + 40 * 1.5" in tried
    assert "verdict: " in tried
