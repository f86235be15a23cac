"""`init` writes a copy of the library, or a first library for another controller."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_init_writes_a_library_that_later_commands_use(
    cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cli("init", "faults").out.startswith("faults: fault_library/, templates/ and a README.md")
    spec = nowhere / "faults/fault_library/faults/radar/chaff.yaml"
    spec.write_text(spec.read_text().replace("about: The radar", "about: My radar"))
    assert "My radar" not in cli("list", "specs").out
    monkeypatch.chdir(nowhere / "faults")
    assert "My radar" in cli("list", "specs").out
    assert cli("check").code == 0


def test_the_readme_names_commands_that_exist(cli: Cli, nowhere: Path) -> None:
    cli("init", "faults")
    readme = (nowhere / "faults" / "README.md").read_text()
    block = readme.split("```sh\n")[1].split("```")[0]
    verbs = [line.split()[1] for line in block.splitlines()]
    assert verbs == ["list", "try", "check", "run", "show"]
    assert all(cli(verb, "--help").code == 0 for verb in verbs)


def test_init_refuses_a_folder_with_content(cli: Cli, nowhere: Path) -> None:
    (nowhere / "thesis.tex").touch()
    answer = cli("init", ".")
    assert answer.code == 2
    assert "not empty (thesis.tex)" in answer.err
    assert [path.name for path in nowhere.iterdir()] == ["thesis.tex"]


def test_init_writes_a_library_for_a_program(cli: Cli, nowhere: Path) -> None:
    assert cli("init", "faults", "--json").json == {"folder": "faults"}


CONTROLLER = """
class Controller:
    def __init__(self, gain=1.0):
        self.gain = gain
        self.last = 0.0

    def update(self, state):
        error = 0.0 - state
        self.last = self.gain * error
        return self.last
"""
MARK = re.compile(r"^ *# TODO\(init\):.*\n", re.MULTILINE)


@pytest.fixture
def tree(nowhere: Path) -> Callable[..., Path]:
    def make(files: dict[str, str]) -> Path:
        folder = nowhere / "tree"
        folder.mkdir()
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        return folder

    return make


TREES: dict[str, tuple[dict[str, str], str, str]] = {
    "flat": ({"steer.py": CONTROLLER, "other.py": "x = 1\n"}, "packages: [other.py, steer.py]", "steer.py"),
    "module": ({"steer.py": CONTROLLER}, "packages: [steer.py]", "steer.py"),
    "package": ({"car/__init__.py": "", "car/steer.py": CONTROLLER}, "package: car", "car/steer.py"),
    "drive": ({"drive.py": CONTROLLER}, "entry: {module: drive_loop", "drive.py"),
}


@pytest.mark.parametrize("name", TREES)
def test_a_first_library_runs_once_its_todo_marks_are_deleted(
    name: str, cli: Cli, tree: Callable[..., Path], nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files, manifest, place = TREES[name]
    cli("init", "faults", "--target", tree(files))
    (written,) = (nowhere / "faults/fault_library/targets").iterdir()
    assert manifest in written.read_text()
    (entry,) = (nowhere / "faults/fault_library/overlays").glob("*/*.py")
    assert f"# {entry.name}, which builds and drives the loop" in written.read_text()
    for path in (nowhere / "faults").rglob("*.*"):
        path.write_text(MARK.sub("", path.read_text()))
    monkeypatch.chdir(nowhere / "faults")
    assert cli("check").out.startswith("all well: 1 spec, 18 faults")
    tried = cli("try", "controller/value", "--variant", "added", "--value", 10, "-s", "first", "--trigger", 1)
    assert tried.code == 0, tried.err
    assert f"+++ b/{place}" in tried.out
    assert "error = error + 10" in tried.out
    assert "hazard FAR_OFF" in tried.out


FOREIGN: dict[str, dict[str, str]] = {
    "nothing": {},
    "no controller": {"data/notes.txt": "x", "values.py": "x = 1\n"},
    "syntax errors": {"broken.py": "def step(:\n", "steer.py": CONTROLLER},
    "only syntax errors": {"broken.py": "def step(:\n"},
    "needs arguments": {
        "a.py": "class Pid:\n    def __init__(self, p, *, i): ...\n"
        "    def step(self, x, dt):\n        y = x * dt\n        return y\n"
    },
    "function": {"a.py": "def control(x):\n    y = 2 * x\n    return y\n"},
    "namesake": {"a.py": "class Drive:\n    def step(self, x):\n        y = 2 * x\n        return y\n"},
    "odd names": {"a-b.py": CONTROLLER, "c/d-e/f.py": CONTROLLER},
}


@pytest.mark.parametrize("name", FOREIGN)
def test_check_lists_every_place_to_fill_in(
    name: str, cli: Cli, tree: Callable[..., Path], nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = cli("init", "faults", "--target", tree(FOREIGN[name]), "--json").json
    assert (nowhere / "faults" / "README.md").exists()
    marks = [
        (path.relative_to(nowhere).as_posix(), number)
        for path in sorted((nowhere / "faults").rglob("*.*"))
        if path.suffix in (".yaml", ".py")
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if "# TODO(init): " in line
    ]
    assert [(Path(place["file"]).as_posix(), place["line"]) for place in told["unfilled"]] == marks
    assert len(marks) >= 12
    monkeypatch.chdir(nowhere / "faults")
    answer = cli("check")
    assert answer.code == 1
    lines = answer.out.splitlines()
    for file, number in marks:
        place = f"{file.removeprefix('faults/')}:{number}: not filled in: "
        assert sum(line.startswith(place) for line in lines) == 1, place


EMPTY = "no Python files apart from tests, docs and scripts"
NOTHING: dict[str, tuple[dict[str, str], str]] = {
    "empty": ({}, EMPTY),
    "tests": ({"tests/test_pilot.py": CONTROLLER, "test_all.py": CONTROLLER}, EMPTY),
    "unparsable": ({"broken.py": "def step(:\n"}, "found: broken.py:1 cannot be read: invalid syntax"),
    "values": ({"values.py": "x = 1\n"}, "no function in 1 file looks like a step"),
}


@pytest.mark.parametrize("name", NOTHING)
def test_a_library_for_a_tree_without_a_controller_has_a_warning(
    name: str, cli: Cli, tree: Callable[..., Path]
) -> None:
    files, told = NOTHING[name]
    folder = tree(files)
    answer = cli("init", "faults", "--target", folder)
    assert answer.code == 0
    assert f"warning: {folder}: no controller found: " in answer.err
    assert told in answer.err


def test_a_tree_with_a_controller_and_an_unreadable_file_has_no_warning(
    cli: Cli, tree: Callable[..., Path]
) -> None:
    assert cli("init", "faults", "--target", tree(FOREIGN["syntax errors"])).err == ""


@pytest.mark.parametrize("name", ["my tree: {v#2}", "123", "null", "1e3"])
def test_a_tree_can_have_any_name(
    name: str, cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = nowhere / name
    folder.mkdir()
    for file in ("steer.py", "null.py"):
        (folder / file).write_text(CONTROLLER)
    cli("init", "faults", "--target", folder)
    monkeypatch.chdir(nowhere / "faults")
    answer = cli("check")
    assert all("not filled in" in line for line in answer.out.splitlines()[:-1]), answer.out


def test_check_prints_the_whole_comment_of_a_todo_mark(
    cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cli("init", "faults", "--target", "installed:typer")
    path = nowhere / "faults/fault_library/scenarios/first.yaml"
    path.write_text("# TODO(init): the speed\n# in m/s\nspeed: 3\n# another\n")
    monkeypatch.chdir(nowhere / "faults")
    assert "first.yaml:1: not filled in: the speed in m/s; fill it in, and delete" in cli("check").out


def test_the_new_readme_names_commands_that_exist(cli: Cli, nowhere: Path) -> None:
    cli("init", "faults", "--target", "installed:typer")
    readme = (nowhere / "faults" / "README.md").read_text()
    block = readme.split("```sh\n")[1].split("```")[0]
    words = [line.partition("#")[0].split()[1:] for line in block.splitlines()]
    assert [verb for verb, *_ in words] == ["check", "check", "try", "run"]
    for verb, *others in words:
        told = cli(verb, "--help").out
        assert all(re.search(rf"{word}\b", told) for word in others if word.startswith("-"))
    assert "variants:" in (nowhere / "faults/fault_library/faults/controller/value.yaml").read_text()


def test_init_writes_a_library_for_an_installed_package(cli: Cli, nowhere: Path) -> None:
    assert "places to fill in" in cli("init", "faults", "--target", "installed:typer").out
    manifest = (nowhere / "faults/fault_library/targets/typer.yaml").read_text()
    assert "root: installed:typer\n" in manifest
    assert re.search(r'requires: \["typer>=[\d.]+"\]', manifest)
    assert not any("openpilot" in path.read_text() for path in (nowhere / "faults").rglob("*.*"))


@pytest.mark.parametrize(
    ("target", "told"),
    [("nowhere", "no folder nowhere"), ("installed:no.where", "no installed package 'no.where'")],
)
def test_init_refuses_a_missing_target_and_writes_nothing(
    target: str, told: str, cli: Cli, nowhere: Path
) -> None:
    answer = cli("init", "faults", "--target", target)
    assert answer.code == 2
    assert f"error: --target: {told}" in answer.err
    assert "--manifest" not in answer.err
    assert not (nowhere / "faults").exists()


def test_a_first_library_lists_fifteen_rows_and_names_the_way_to_fewer_files(cli: Cli, nowhere: Path) -> None:
    """Of a monorepo, the likeliest candidates are enough."""
    tree = nowhere / "repo"
    for i in range(20):
        (tree / f"p{i}").mkdir(parents=True)
        law = CONTROLLER.replace("update", f"update_{i}")
        (tree / f"p{i}" / "law.py").write_text(law + law.replace("Controller", "Other"))
    cli("init", "faults", "--target", "repo")
    readme = (nowhere / "faults" / "README.md").read_text()
    rows = [line for line in readme.splitlines() if line.startswith("| `")]
    assert len(rows) == 20  # five are files of the library
    assert "(40 in all; `mutator init DIR --target TREE --in 'GLOB'`" in readme
    cli("init", "fewer", "--target", "repo", "--in", "p3/**")
    rows = [line for line in (nowhere / "fewer" / "README.md").read_text().splitlines() if "update_" in line]
    assert len(rows) == 1
    assert "also `Other.update_3` (p3/law.py:" in rows[0]
    refused = cli("init", "none", "--in", "p3/**")
    assert refused.code == 2 and "--in: files p3/** without a target" in refused.err


def test_an_async_step_is_run_to_its_end(cli: Cli, nowhere: Path) -> None:
    """The loop is not asynchronous."""
    (nowhere / "law.py").write_text(CONTROLLER.replace("def update", "async def update"))
    cli("init", "faults", "--target", ".")
    [drive] = (nowhere / "faults").rglob("drive.py")
    assert "command = asyncio.run(self.controller.update(state))" in drive.read_text()
    assert "\nimport asyncio\n" in drive.read_text()
