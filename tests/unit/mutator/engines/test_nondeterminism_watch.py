"""What the watcher records about a target's code. Because the watcher replaces functions, it runs in a
separate process."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from mutator.engines.in_target import nondeterminism_watch

NOTED = {
    "time.time()": "time.time() reads the clock",
    "monotonic()": "time.monotonic() reads the clock",
    "time.perf_counter_ns()": "time.perf_counter_ns() reads the clock",
    "time.strftime('%Y')": "time.strftime() reads the clock",
    "os.times()": "os.times() reads the clock",
    "Held().clock()": "time.perf_counter() reads the clock",
    "1 / (type(datetime.now()) is datetime.original_class)": "datetime.datetime.now() reads the clock",
    "Held().now()": "datetime.datetime.now() reads the clock",
    "datetime.now()": "datetime.datetime.now() reads the clock",
    "random.gauss(0, 1)": "random.gauss() draws from the shared generator of random, which has no seed",
    "random.Random()": "random.Random() is made without a seed",
    "np.random.rand()": "numpy.random.rand() draws from the shared generator of numpy.random",
    "np.random.default_rng()": "a generator of numpy.random is made without a seed",
    "np.random.RandomState()": "a generator of numpy.random is made without a seed",
    "os.urandom(2)": "os.urandom() draws from the system",
    "uuid.uuid4()": "uuid.uuid4() returns a different id",
    "hash('x')": "hash() of text depends on PYTHONHASHSEED",
    "threading.Thread(target=int, name='poll').start()": "starts the thread 'poll'",
    "ThreadPoolExecutor(1).submit(int).result()": "starts the thread 'ThreadPoolExecutor-",
}
SOUND = (
    "random.Random(3).random()",
    "np.random.default_rng(3).random()",
    "np.random.RandomState(3).rand()",
    "time.localtime(3)",
    "datetime(2020, 1, 1)",
    "1 / isinstance(datetime(2020, 1, 1), datetime)",
    "hash(3)",
    "random.seed(3), random.random()",
    "Held().seed(3)",
    "1 / (copy.deepcopy(Held.clock) is Held.clock)",
    "1 / (pickle.loads(pickle.dumps(Held.clock)) is Held.clock)",
    "1 / (Held.clock.__name__ == 'perf_counter')",
    "np.random.seed(3), np.random.rand()",
)
IMPORTS = """\
import copy, os, pickle, random, threading, time, uuid
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from time import monotonic
import numpy as np

class Held:
    clock = time.perf_counter
    now = datetime.now
    seed = random.seed

"""
SCRIPT = """\
import json, sys
import {name} as watch
watcher = watch.NondeterminismWatcher(sys.argv[1])
watcher.begin()
sys.path.insert(0, sys.argv[1])
import controller
controller.drive()
print(json.dumps(watcher.as_json()["noted"]))
"""


@pytest.fixture(scope="module")
def noted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, str]]]:
    folder = tmp_path_factory.mktemp("tree")
    lines = [*NOTED, *SOUND]
    body = "".join(f"    {line}\n" for line in lines)
    text = f"{IMPORTS}def drive():\n{body}"
    (folder / "controller.py").write_text(text)
    script = SCRIPT.format(name=nondeterminism_watch.__name__)
    done = subprocess.run([sys.executable, "-c", script, folder], capture_output=True, text=True, check=True)
    found: dict[str, list[dict[str, str]]] = {line: [] for line in lines}
    for one in json.loads(done.stdout):
        found[text.splitlines()[one["line"] - 1].strip()].append(one)
    return found


@pytest.mark.parametrize("line", NOTED)
def test_sources_of_nondeterminism_are_reported(line: str, noted: dict[str, list[dict[str, str]]]) -> None:
    (one,) = noted[line]
    assert one["what"].startswith(NOTED[line])
    assert (one["file"], one["function"], one["via"]) == ("controller.py", "drive", "")


@pytest.mark.parametrize("line", SOUND)
def test_reproducible_values_are_not_reported(line: str, noted: dict[str, list[dict[str, str]]]) -> None:
    assert noted[line] == []


def test_a_clock_read_by_a_package_is_reported_at_the_targets_line(tmp_path: Path) -> None:
    package, tree = tmp_path / "site-packages" / "pid", tmp_path / "tree"
    for folder in (package, tree):
        folder.mkdir(parents=True)
    (package / "__init__.py").write_text(
        "import time\nSTARTED = time.time()\n\ndef step():\n    time.time()\n"
    )
    (tree / "controller.py").write_text("import pid\n\ndef drive():\n    pid.step()\n")
    script = SCRIPT.format(name=nondeterminism_watch.__name__)
    path = f"{package.parent}:{Path(nondeterminism_watch.__file__).parents[3]}"
    done = subprocess.run(
        [sys.executable, "-c", script, tree],
        env={"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    (one,) = json.loads(done.stdout)
    assert (one["line"], one["via"]) == (4, "pid/__init__.py:5")


def test_pandas_can_be_imported_while_watched(tmp_path: Path) -> None:
    """pandas cannot use a replaced `datetime`."""
    (tmp_path / "controller.py").write_text(
        "import datetime\nimport pandas\n\ndef drive():\n    assert pandas.Timestamp(2020, 1, 1)\n"
        "    datetime.date.today()\n"
    )
    script = SCRIPT.format(name=nondeterminism_watch.__name__)
    done = subprocess.run(
        [sys.executable, "-c", script, tmp_path], capture_output=True, text=True, check=True
    )
    assert [(one["line"], one["what"]) for one in json.loads(done.stdout)] == [
        (6, "datetime.date.today() reads the clock")
    ]
