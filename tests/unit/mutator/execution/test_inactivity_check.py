"""A fault that was never active always has the reason in its record, the same from every engine."""

from pathlib import Path

import pytest

import mutator
from mutator.checks.check_by_running import findings_from_running
from mutator.model import Outcome, Record, Status
from mutator.workspace import Workspace
from tests.small_loop import small_loop

LAW = "def law(y, rate):\n    push = -2.0 * y - 2.5 * rate\n    return push\n\n\n"
HEAD = """\
class Control:
    def __init__(self):
        self.last = None{init}

    def update(self, y, dt):
        last = y if self.last is None else self.last
        self.last = y
        rate = (y - last) / dt
        return {call}
"""


def controller(before: str = LAW, init: str = "", call: str = "law(y, rate)") -> str:
    return before + HEAD.format(init=f"\n        {init}" if init else "", call=call)


AT_LAW = "{file: law.py, function: law, after_assign: push}"
GRAPH = "class Graph:\n    def __init__(self, function):\n"
GRAPH += "        self.gains = function(1.0, 0.0), function(0.0, 1.0)\n"
GRAPH += "    def __call__(self, y, rate):\n        return self.gains[0] * y + self.gains[1] * rate\n\n\n"
TABLE = "TABLE = [law(-1.0, 0.0)]\n\n\n"
WORKER = """\
import os


class Worker:
    def __init__(self):
        (self.taken, give), (take, self.given) = os.pipe(), os.pipe()
        if not os.fork():
            while numbers := os.read(take, 100):
                os.write(give, repr(law(*map(float, numbers.split()))).encode())
            os._exit(0)

    def __call__(self, y, rate):
        os.write(self.given, f"{y} {rate}".encode())
        return float(os.read(self.taken, 100))


"""
SPAWNED = """\
import pathlib
import subprocess
import sys


def ask(y, rate):
    code = f"import law; print(law.law({y}, {rate}))"
    folder = pathlib.Path(__file__).parent
    return float(subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True).stdout)


"""
ONE_CALL = "law(y, rate) if self.count() == 3 else -2.0 * y - 2.5 * rate"
COUNTER = "self.number = 0\n\n    def count(self):\n        self.number += 1\n        return self.number"
REASONS: dict[str, tuple[dict[str, str], str]] = {
    "traced in the constructor": (
        {"law.py": controller(LAW + GRAPH, "self.graph = Graph(law)", "self.graph(y, rate)")},
        "it runs only before the first observation (2 times), as for code that is built or traced once",
    ),
    "run at import": (
        {"law.py": controller(LAW + TABLE, call="TABLE[0] * -y - 2.5 * rate")},
        "it runs only before the first observation (once)",
    ),
    "a worker in the constructor": (
        {"law.py": controller(LAW + WORKER, "self.worker = Worker()", "self.worker(y, rate)")},
        "it runs only in a child process (started once at law.py:12), in which the trigger never holds",
    ),
    "a process of Python each step": (
        {"law.py": controller(LAW + SPAWNED, call="ask(y, rate)")},
        "it runs only in a child process (started 20 times at law.py:14), in which the trigger never holds",
    ),
    "one early step": (
        {"law.py": controller(init=COUNTER, call=ONE_CALL)},
        "it runs once, at 0.1 s, but not while the trigger holds",
    ),
    "never called": (
        {"law.py": controller(call="-2.0 * y - 2.5 * rate")},
        "it is never executed",
    ),
    "replaced at import": (
        {
            "law.py": controller(LAW + "import fast\n\n\n"),
            "fast.py": "import sys\n\n\ndef fast_law(y, rate):\n    return -2.0 * y - 2.5 * rate\n\n\n"
            "sys.modules['law'].law = fast_law\n",
        },
        "law of law.py is replaced by fast_law (fast.py:4)",
    ),
    "replaced by an object": (
        {"law.py": controller(LAW + "import functools\nlaw = functools.partial(max, -1.0)\n\n\n")},
        "law of law.py is replaced by an object of type partial",
    ),
}


def tried(workspace: Workspace, trigger: str = "t>=0.5") -> Record:
    return mutator.try_fault("c/f/one", "s", trigger, workspace=workspace).record


@pytest.mark.parametrize("kind", REASONS)
def test_the_record_says_why_a_fault_was_never_active(tmp_path: Path, kind: str) -> None:
    """The reason names what there is: the process and its line, the replacement, the time."""
    files, reason = REASONS[kind]
    record = tried(small_loop(tmp_path, files, one=AT_LAW))
    assert (record.status, record.outcome) == (Status.OK, Outcome.NOT_ACTIVATED)
    assert record.detail.startswith(reason)


def test_a_trigger_that_never_holds_is_the_reason(tmp_path: Path) -> None:
    """Nothing is run to find it."""
    record = tried(small_loop(tmp_path, {"law.py": controller()}, one=AT_LAW), "t>=100")
    assert record.detail == "the trigger never held"


def test_a_value_that_a_metaclass_hides_is_the_reason(tmp_path: Path) -> None:
    """A metaclass of the target's own can keep a default where nothing can set it."""
    text = "class Meta(type):\n    def __new__(meta, name, bases, names):\n"
    text += "        names['kept'] = (names.pop('gain'),)\n"
    text += "        return super().__new__(meta, name, bases, names)\n"
    text += "class Gains(metaclass=Meta):\n    gain = -2.0\n\n\n"
    files = {"law.py": controller(text, call="Gains.kept[0] * y - 2.5 * rate")}
    record = tried(small_loop(tmp_path, files, one="{file: law.py, constant: Gains.gain}"))
    assert record.detail == "Meta, the metaclass of Gains, keeps the value where it cannot be set"


@pytest.mark.parametrize("link", [True, False])
def test_a_file_with_two_names_names_the_other(tmp_path: Path, link: bool) -> None:
    """A place in the name that is never imported says which file to name: a link, or a copy in a monorepo."""
    call = "from lib.gains import law\n\n\n"
    files = {"law.py": controller(call), "lib/__init__.py": "", "lib/gains.py": LAW, "old/__init__.py": ""}
    if not link:
        files["old/gains.py"] = LAW
    workspace = small_loop(tmp_path, files, one="{file: old/gains.py, function: law, after_assign: push}")
    if link:
        (tmp_path / "tree" / "old" / "gains.py").symlink_to("../lib/gains.py")
    what = "the same file" if link else "a copy of it"
    assert tried(workspace).detail == (
        f"old/gains.py is never imported; lib/gains.py, {what}, is imported: name that file"
    )


READER = """\
class Control:
    def __init__(self):
        self.y = 1.0

    def take(self, frames):
        for name, content in frames:
            if name == "place":
                self.y = content

    def update(self, y, dt):
        self.take([("place", y)])
        return -2.0 * self.y
"""
MESSAGES = """\
messages:
  law:
    at: {file: law.py, function: Control.take, entry: true}
    queue: frames
    topic: message[0]
    topics: {place: place, speed: spede}
"""
LOST = """\
schema: fault_spec/1
module: c
fault_type: m
about: Messages are lost.
variants:
  one:
    about: They are lost.
    as_described:
      injections:
        - message: {topic: place, reader: law}
          model: message_loss
"""


def test_a_topic_that_never_comes_is_the_reason(tmp_path: Path) -> None:
    """A fault of messages is active only at readings at which a message of its topic comes."""
    workspace = small_loop(tmp_path, {"law.py": READER}, manifest=MESSAGES)
    spec = workspace.library / "faults" / "c" / "m.yaml"
    spec.write_text(LOST)
    activation = mutator.try_fault("c/m/one", "s", "t>=0.5", workspace=workspace).record.activation
    assert activation is not None and (activation.first, activation.count) == (0.5, 10)
    spec.write_text(LOST.replace("topic: place", "topic: speed"))
    record = mutator.try_fault("c/m/one", "s", "t>=0.5", workspace=workspace).record
    assert (record.status, record.outcome) == (Status.OK, Outcome.NOT_ACTIVATED)
    assert record.detail.startswith("it runs 20 times")
    assert record.detail.endswith("while the trigger holds and a message of topic 'speed' comes")


FORKING = """\
import os


def ask(y, rate):
    take, give = os.pipe()
    if not (child := os.fork()):
        os.write(give, repr(law(y, rate)).encode())
        os._exit(0)
    os.waitpid(child, 0)
    os.close(give)
    number = float(os.read(take, 100))
    os.close(take)
    return number


"""
POOL = """\
import concurrent.futures
import multiprocessing


def ask(y, rate):
    context = multiprocessing.get_context("fork")
    with concurrent.futures.ProcessPoolExecutor(1, context) as pool:
        return pool.submit(law, y, rate).result()


"""


@pytest.mark.parametrize("text", [FORKING, POOL])
def test_an_activation_in_a_forked_child_counts(tmp_path: Path, text: str) -> None:
    """A child that is forked while the fault is active runs it, so its executions are activations."""
    workspace = small_loop(tmp_path, {"law.py": controller(LAW + text, call="ask(y, rate)")}, one=AT_LAW)
    record = tried(workspace)
    assert record.status is Status.OK
    assert record.activation is not None
    assert (record.activation.first, record.activation.count) == (0.5, 10)
    assert record.t_manifest == 0.5


CHECKED: dict[str, tuple[str, str]] = {
    "traced in the constructor": ("run only before the first observation", "anchor where the result arrives"),
    "a worker in the constructor": ("run only in a child process", "anchor where the result arrives"),
    "replaced at import": ("belong to a function that another replaces", "anchor where the result arrives"),
    "never called": ("never reached in s", "add a scenario"),
}


@pytest.mark.parametrize("kind", CHECKED)
def test_check_drive_says_where_a_statement_runs(tmp_path: Path, kind: str) -> None:
    """Only a statement that nothing executes is unreached; the others are told as what they are."""
    workspace = small_loop(tmp_path, REASONS[kind][0], one=AT_LAW)
    (finding,) = (f for f in findings_from_running(workspace, "t", ["s"]) if f.name == "statements")
    words, remedy = CHECKED[kind]
    assert words in finding.found and remedy in finding.remedy
    assert kind == "never called" or REASONS[kind][1] in finding.places[0].what
