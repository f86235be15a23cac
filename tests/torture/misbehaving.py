"""Campaigns with misbehaving mutants among ordinary ones, in every engine."""

import csv
import random
import re
import subprocess
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mutator._common.files import is_half_written, remove_folder
from mutator._common.table_rendering import TextTable
from mutator.engines.engine_kinds import OFFERED_ENGINES, REFERENCE
from mutator.errors import EXIT_HARNESS_ERRORS, EXIT_OK
from mutator.model import Status
from mutator.workspace import Workspace

from ..differential.command import Command
from .damages import contents
from .tally import Case, End
from .worlds import LAST

LISTED = Path(__file__).with_name("misdeeds.txt")
ATTACKS = Path(__file__).with_name("attacks.txt")
METHODS = ("guided", "random")
WORKERS = (1, 2)
_WORDS = ("raises", "noticed")  # of a misdeed, besides its statuses
MOST = 3  # misdeeds in one campaign
LONGEST_S = 240  # of a command, on a busy machine
MODULES = (
    *(
        "atexit",
        "builtins",
        "contextlib",
        "ctypes",
        "errno",
        "gc",
        "glob",
        "hashlib",
        "importlib.util",
        "json",
        "locale",
        "marshal",
        "mmap",
        "multiprocessing",
    ),
    *(
        "numpy",
        "os",
        "pathlib",
        "random",
        "resource",
        "shutil",
        "signal",
        "subprocess",
        "sys",
        "threading",
        "time",
    ),
    *("warnings", "zipfile"),
)
MODEL = """schema: fault_model/1
name: {model}
kind: insert
{more}about: It {name}.
params:
  target: {{type: variable, about: the anchored variable}}
examples:
  - about: It {name}.
    injection: {{at: {{file: e.py, function: f, after_assign: x}}, model: {model}}}
    before: none
    after: none
"""
SPEC = """schema: fault_spec/1
module: misdeeds
fault_type: {model}
about: It {name}.
variants:
  it:
    aim: H1
    about: It {name}.
    as_described:
      injections:
        - at: {{file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}}
          model: {model}
          unit: m
"""
CAMPAIGN = """schema: campaign/1
name: misbehaving
about: Ordinary faults, and mutants that misbehave.
target: toycar
scenarios: [A]
faults:
  - {{spec: sensor/distance/longer, values: 1}}
  - {{spec: sensor/lane/shifted, values: 1}}
  - spec: sensor/silence/no_data
{more}methods: [{method}]
triggers:
  table: near_far
  rows: [near]
  armed_after_s: {{as_described: 1.0, as_coded: 0.0}}
  random_until_s: 5.5
seed: 3
canary: {{spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 1.0}}
limits: {{cpu_s: 1, wall_s: 20, memory_mb: 1024, steps: 200, disk_mb: 20}}
chunk: 2
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Misdeed:
    """What a mutant does when its fault is first active, the statuses that are allowed, whether the fault
    model declares that it raises, and whether the command may end with an error."""

    name: str
    lines: tuple[str, ...]
    ends: frozenset[Status]
    raises: bool
    noticed: bool

    @property
    def model(self) -> str:
        return self.name.replace(" ", "_").lower()

    def write(self, workspace: Workspace) -> None:
        imports = [f"import {name}" for name in MODULES]
        body = ["    " + line for line in (*imports, *self.lines)]
        # not rendered: the lines can look like Jinja2
        code = ['if _fi.active("{{ fi }}"):{% raw %}', "    if _fi.steps() == 1:"]
        text = "\n".join([*code, *("    " + line for line in body), "{% endraw %}"])
        names = {"name": self.name, "model": self.model, "more": "raises: true\n" * self.raises}
        (workspace.templates / f"{self.model}.py.j2").write_text(text)
        (workspace.templates / f"{self.model}.yaml").write_text(MODEL.format(**names))
        spec = workspace.library / "faults" / "misdeeds" / f"{self.model}.yaml"
        spec.parent.mkdir(exist_ok=True)
        spec.write_text(SPEC.format(**names))


def misdeeds(listed: Path = LISTED, names: Mapping[str, object] | None = None) -> dict[str, Misdeed]:
    """Read a list of misdeeds. `names` are set before each."""
    first, *parts = re.split(r"^== ", listed.read_text(), flags=re.MULTILINE)
    before = [f"{name} = {value!r}" for name, value in (names or {}).items()]
    before += [line for line in first.split("\n") if line and not line.startswith("#")]
    found = {}
    for part in parts:
        head, *lines = part.rstrip("\n").split("\n")
        name, _, said = head.partition(": ")
        words = said.split()
        ends = frozenset(Status(word) for word in words if word not in _WORDS)
        code = (*before, *(line for line in lines if line))
        found[name] = Misdeed(
            name=name, lines=code, ends=ends, raises="raises" in words, noticed="noticed" in words
        )
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Came:
    """The result of a campaign: exit code, output, and what is wrong with its files. `rows` has the lines of
    results.csv by experiment, `bad` those of misdeeds by fault type."""

    code: int
    said: str
    rows: dict[str, str] = field(default_factory=dict)
    bad: dict[str, str] = field(default_factory=dict)
    status: dict[str, Status] = field(default_factory=dict)  # of a fault type of `bad`
    left: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    engine: str
    workers: int
    method: str
    names: tuple[str, ...]


class Misbehaving:
    def __init__(
        self, workspace: Workspace, at: Path, seeds: Sequence[int], known: Mapping[str, Misdeed] | None = None
    ) -> None:
        self.workspace, self.at = workspace, at
        self.misdeeds = known or misdeeds()
        self.drawn = {seed: self._draw(seed) for seed in seeds}
        self.tree = workspace.manifest("toycar").root
        for misdeed in self.misdeeds.values():
            misdeed.write(workspace)
        self.before = contents(self.tree)
        self.verdicts: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._right: dict[str, Came] = {}

    def _draw(self, seed: int) -> Drawn:
        chance = random.Random(seed)
        engine = list(OFFERED_ENGINES)[
            -1 - seed % len(OFFERED_ENGINES)
        ]  # a few tries cover every engine, fork first
        workers, method = (chance.choice(some) for some in (WORKERS, METHODS))
        names = chance.sample(sorted(self.misdeeds), chance.randint(1, MOST))
        return Drawn(engine=engine, workers=workers, method=method, names=tuple(names))

    def cases(self, seed: int) -> Sequence[Case]:
        """Run a campaign on some engine. Each of its misdeeds is a case."""
        drawn = self.drawn[seed]
        came = self.came(drawn, LONGEST_S)
        problem = self._problem(came, drawn.method)
        return [self._case(self.misdeeds[name], drawn, came, problem) for name in drawn.names]

    def _case(self, misdeed: Misdeed, drawn: Drawn, came: Came, problem: str) -> Case:
        status, reader = came.status.get(misdeed.model), f"{drawn.engine} -n {drawn.workers}"
        self.verdicts[misdeed.name, drawn.engine].add(str(status))
        why = problem or self._difference(misdeed, drawn.method, came)
        story = f"{drawn.method} on {reader}: {why}\n{came.said[-LAST:]}"
        end = End.WRONG if why else End.RIGHT
        return Case(kind=misdeed.name, damage=str(status), reader=reader, end=end, story=story)

    def _problem(self, came: Came, method: str) -> str:
        """Return what is wrong with a campaign, apart from its misdeeds, or an empty text."""
        if came.left:
            return came.left
        if "Traceback" in came.said or "bug in mutator" in came.said:
            return "a traceback"
        wanted = EXIT_HARNESS_ERRORS if Status.HARNESS_ERROR in came.status.values() else EXIT_OK
        if came.code != wanted:
            return f"exit code {came.code}, not {wanted}"
        right = self._reference(method).rows
        changed = [name for name in right.keys() | came.rows.keys() if right.get(name) != came.rows.get(name)]
        return "".join(f"{came.rows.get(name)}, not {right.get(name)}" for name in changed)

    def _difference(self, misdeed: Misdeed, method: str, came: Came) -> str:
        """Return what is wrong with a misdeed's result, or an empty text."""
        status, row = came.status.get(misdeed.model), came.bad.get(misdeed.model)
        if status not in misdeed.ends:
            return f"not one of {', '.join(sorted(misdeed.ends))}: {row}"
        truth = self._reference(method)
        if status is Status.HARNESS_ERROR is truth.status[misdeed.model]:
            return ""  # engines word a harness error differently
        right = truth.bad[misdeed.model]
        return "" if row == right else f"{row}, not {right} as on the reference engine"

    def _reference(self, method: str) -> Came:
        if method not in self._right:
            drawn = [one for one in self.drawn.values() if one.method == method]
            names = sorted({name for one in drawn for name in one.names})
            every = Drawn(engine=REFERENCE, workers=2, method=method, names=tuple(names))
            came = self.came(every, LONGEST_S + 20 * len(names))
            assert len(came.bad) == len(names) and not came.left, f"on the reference engine: {came}"
            for name in names:
                self.verdicts[name, REFERENCE].add(str(came.status[self.misdeeds[name].model]))
            self._right[method] = came
        return self._right[method]

    def came(self, drawn: Drawn, longest_s: float) -> Came:
        specs = "".join(f"  - spec: misdeeds/{self.misdeeds[name].model}/it\n" for name in drawn.names)
        campaign = self.workspace.library / "campaigns" / "misbehaving.yaml"
        campaign.write_text(CAMPAIGN.format(more=specs, method=drawn.method))
        remove_folder(self.at)
        (self.at / "tmp").mkdir(parents=True)
        words = (
            "run",
            "misbehaving",
            "--engine",
            drawn.engine,
            "-n",
            drawn.workers,
            "--out",
            self.at / "run",
        )
        command = Command(
            self.workspace, self.at, "-m", "mutator", *map(str, words), TMPDIR=str(self.at / "tmp")
        )
        try:
            said = command.end(longest_s=longest_s)
        except (subprocess.TimeoutExpired, AssertionError) as err:
            command.kill()
            return Came(code=-1, said="", left=f"the command does not end: {err}")
        table = self.at / "run" / "results.csv"
        came = Came(code=command.process.returncode, said=said, left=self._left())
        if table.exists():
            text = table.read_text()
            for line, row in zip(text.splitlines()[1:], csv.DictReader(text.splitlines()), strict=True):
                if row["module"] == "misdeeds":
                    came.bad[row["fault_type"]], came.status[row["fault_type"]] = line, Status(row["status"])
                else:
                    came.rows[row["experiment_id"]] = line
        return came

    def _left(self) -> str:
        """Return what a command wrongly left behind, or an empty text."""
        left = [*(self.at / "tmp").iterdir()]
        left += [
            path for path in (self.at / "run").glob("*") if path.name == "work" or is_half_written(path.name)
        ]
        if left:
            return f"the command leaves {', '.join(map(str, left))}"
        return "" if contents(self.tree) == self.before else "the user's tree has changed"

    def table(self) -> str:
        names = sorted({name for name, _ in self.verdicts})
        rows = [
            (name, *(", ".join(sorted(self.verdicts[name, one])) or "-" for one in OFFERED_ENGINES))
            for name in names
        ]
        return (
            "verdicts of misdeeds\n"
            + TextTable(heads=("misdeed", *OFFERED_ENGINES), rows=rows, right_aligned=()).as_text()
        )
