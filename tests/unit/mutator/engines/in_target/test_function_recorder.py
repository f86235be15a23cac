"""The recorder of executed functions, in a process of its own, since an audit hook cannot be removed."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from mutator.engines.in_target import function_recorder

needs_monitoring = pytest.mark.skipif(
    not hasattr(sys, "monitoring"), reason="sys.monitoring needs Python 3.12: nothing is recorded before"
)
DRIVE = """\
import json, sys
sys.path.insert(0, sys.argv[1])
sys.path.insert(0, sys.argv[2])
import function_recorder
recorder = function_recorder.FunctionRecorder(sys.argv[2])
recorder.begin()
import car
car.drive()
print(json.dumps(recorder.as_json()))
"""
CAR = """\
from dataclasses import dataclass

@dataclass
class Car:
    speed: float = 1.0

    def step(self):
        return [self.add(x) for x in range(3)]

    def add(self, x):
        return (lambda: x + self.speed)()

    def never(self):
        return 0

def steps():
    yield 1

def unused():
    pass

def drive():
    Car().step()
    list(steps())
    {body}
"""


def recorded(tmp_path: Path, body: str = "pass", files: dict[str, str] | None = None) -> dict[str, Any]:
    tree = tmp_path / "tree"
    tree.mkdir()
    for name, text in {"car.py": CAR.replace("{body}", body), **(files or {})}.items():
        (tree / name).write_text(text)
    (tmp_path / "main.py").write_text(DRIVE)
    folder = Path(function_recorder.__file__).parent
    command = [sys.executable, str(tmp_path / "main.py"), str(folder), str(tree)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    noted: dict[str, Any] = json.loads(result.stdout.splitlines()[-1])
    return noted


def test_an_older_python_records_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Then what a run executed is not known."""
    monkeypatch.setattr(function_recorder, "_monitoring", None)
    recorder = function_recorder.FunctionRecorder(str(tmp_path))
    recorder.begin()
    assert recorder.as_json() is None


@needs_monitoring
def test_what_ran_is_noted(tmp_path: Path) -> None:
    """Functions, methods, generators, module and class bodies; not what was only defined. Lambdas and
    functions inside of functions go by the outer one."""
    noted = recorded(tmp_path)
    assert set(noted["functions"]) == {"car.py"}
    names = {*noted["functions"]["car.py"]} - {"Car.step.<locals>.<listcomp>"}
    assert names == {"<module>", "Car", "Car.step", "Car.add", "steps", "drive"}
    assert (noted["read"], noted["obstacle"]) == ([], "")


@needs_monitoring
@pytest.mark.parametrize(
    "body",
    ["exec('x = 1')", "eval('1 + 1')", "import os; exec(compile('x = 1', 'made up', 'exec'))"],
)
def test_text_that_runs_as_code_is_an_obstacle(tmp_path: Path, body: str) -> None:
    assert recorded(tmp_path, body)["obstacle"] == "it executes text as code"


@needs_monitoring
@pytest.mark.parametrize(
    "body",
    [
        "import os; os.waitpid(os.fork() or os._exit(0), 0)",
        "import subprocess; subprocess.run(['true'])",
        "import os; os.system('true')",
        "import multiprocessing as m; p = m.get_context('spawn').Process(target=print); p.start(); p.join()",
    ],
)
def test_other_processes_are_an_obstacle(tmp_path: Path, body: str) -> None:
    """What they run is not noted here."""
    assert recorded(tmp_path, body)["obstacle"] == "it starts other processes"


@needs_monitoring
@pytest.mark.parametrize("body", ["open(__file__).read()", "import inspect; inspect.getsource(Car)"])
def test_source_that_is_read_as_text_is_noted(tmp_path: Path, body: str) -> None:
    """Each of its bytes can then matter. An import also reads it, but does not count."""
    noted = recorded(tmp_path, f"import other; {body}", {"other.py": "x = 1\n"})
    assert noted["read"] == ["car.py"]
    assert noted["functions"]["other.py"] == ["<module>"]


@needs_monitoring
def test_a_function_whose_code_is_read_counts_as_executed(tmp_path: Path) -> None:
    """A just-in-time compiler reads a function's code and never calls it."""
    assert "unused" in recorded(tmp_path, "unused.__code__")["functions"]["car.py"]


@needs_monitoring
def test_other_threads_are_noted(tmp_path: Path) -> None:
    body = "import threading; t = threading.Thread(target=unused); t.start(); t.join()"
    assert "unused" in recorded(tmp_path, body)["functions"]["car.py"]
