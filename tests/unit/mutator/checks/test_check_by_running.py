"""Findings from running a target."""

import re
from pathlib import Path

import pytest

from mutator.checks import check_by_running
from mutator.checks.check_by_running import findings_from_running
from mutator.checks.check_findings import CheckState, Finding
from mutator.checks.fast_engine_check import import_and_fork_finding
from mutator.checks.reached_statements_and_triggers import ReachTracker
from mutator.errors import MutatorError
from mutator.workspace import Workspace

SCENARIO = ["A"]
HERE = Path(__file__).parents[3]


@pytest.fixture
def toy(toycar: Workspace) -> Workspace:
    for path in [*(toycar.library / "faults" / "hostile").iterdir(), toycar.campaign("hostile")]:
        path.unlink()
    return toycar


def change(toy: Workspace, file: str, old: str, new: str) -> None:
    root = toy.library.parent
    path = root / file if file.endswith(".yaml") else root / "tree" / "toycar" / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))


def line_of(toy: Workspace, text: str, file: str = "driver.py") -> int:
    lines = (toy.library.parent / "tree" / "toycar" / file).read_text().splitlines()
    (number,) = (n for n, line in enumerate(lines, 1) if text in line)
    return number


def findings(toy: Workspace) -> dict[str, Finding]:
    return {finding.name: finding for finding in findings_from_running(toy, "toycar", SCENARIO)}


def test_a_sound_target_passes_every_check(toy: Workspace) -> None:
    found = findings(toy)
    assert {name: one.level for name, one in found.items()} == dict.fromkeys(
        ["golden A", "fast engines", "statements", "triggers", "canary defended"], CheckState.OK
    )


CLOCK = (
    "        return gas, brake, wheel",
    "        gas += time.monotonic() * 1e-9\n        return gas, brake, wheel",
)
DRAW = ("        self.warned = []", "        self.warned = []\n        self.noise = np.random.default_rng()")
NOISE = ("        return gas, brake", "        gas += self.noise.random() * 1e-9\n        return gas, brake")
SETS = (
    "        return gas, brake, wheel",
    "        parts = {'ab': 0.1, 'cd': 0.2, 'ef': 0.3, 'gh': 1e16, 'ij': -1e16}\n"
    "        for name in {'ab', 'cd', 'ef', 'gh', 'ij'}:\n"
    "            gas += parts[name]\n        return gas, brake, wheel",
)


@pytest.mark.parametrize(
    ("edits", "imports", "line", "told"),
    [
        ([CLOCK], "import time", "time.monotonic()", "in Driver.drive: time.monotonic() reads the clock"),
        (
            [DRAW, NOISE],
            "import numpy as np",
            "default_rng()",
            "in Driver.__init__: a generator of numpy.random",
        ),
        ([SETS], "", "for name in", "in Driver.drive: uses the order of a set"),
    ],
    ids=["clock", "unseeded generator", "set order"],
)
def test_a_nondeterministic_line_is_reported(
    toy: Workspace, edits: list[tuple[str, str]], imports: str, line: str, told: str
) -> None:
    for old, new in edits:
        change(toy, "driver.py", old, new)
    change(toy, "driver.py", "class Driver", f"{imports}\n\n\nclass Driver")
    found = findings(toy)["golden A"]
    assert found.level is CheckState.FAIL
    assert "first differ in channel gas at step 0 (0 s): " in found.found
    assert ("but only if their hash seeds differ" in found.found) == ("set" in told)
    (place,) = found.places
    assert str(place).startswith(f"toycar/driver.py:{line_of(toy, line)} {told}")
    assert found.remedy


@pytest.mark.parametrize("made", ["names()", "held['names']"], ids=["returned", "in a dict"])
def test_an_effect_of_the_hash_seed_is_reported_without_a_line(toy: Workspace, made: str) -> None:
    """The order of a set of constants can differ between loaded and fresh bytecode."""
    names = "{'x', 'y', 'zed', 'q'}"
    change(toy, "sensing.py", "class Sensor", f"def names():\n    return {names}\n\n\nclass Sensor")
    change(
        toy,
        "sensing.py",
        "        self.publish((gap,",
        f"        held = {{'names': {names}}}\n        shift = 0.0\n"
        f"        for place, name in enumerate({made}):\n"
        "            shift += 1e-9 * place * ord(name[0])\n        self.publish((gap + shift,",
    )
    found = findings(toy)["golden A"]
    assert "but only if their hash seeds differ; they first differ in channel " in found.found
    assert (found.places, "sorted(...)" in found.remedy) == ((), True)


def test_a_module_that_is_missing_may_stop_every_engine(toy: Workspace) -> None:
    """The check that runs nothing does not promise that campaigns go on without forks."""
    change(toy, "sensing.py", "class Sensor", "import no_such_module\n\n\nclass Sensor")
    fast = import_and_fork_finding(toy.manifest("toycar"))
    assert "cannot be loaded: ModuleNotFoundError: No module named 'no_such_module'" in fast.found
    assert "if the golden run fails, too, no campaign can start" in fast.remedy


@pytest.mark.parametrize("long", [False, True], ids=["brief", "long"])
def test_a_thread_pool_is_reported_with_its_line(
    toy: Workspace, long: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pool with ordered results is deterministic, but its threads prevent forking."""
    change(
        toy,
        "driver.py",
        "class Driver",
        "from concurrent.futures import ThreadPoolExecutor\n\n\nclass Driver",
    )
    change(
        toy, "driver.py", "self.warned = []", "self.warned = []\n        self.pool = ThreadPoolExecutor(2)"
    )
    change(
        toy,
        "driver.py",
        "        return gas, brake, wheel",
        "        wheel = self.pool.submit(float, wheel).result()\n        return gas, brake, wheel",
    )
    if long:
        monkeypatch.setattr(check_by_running, "_MOST_REPEATED_RUN_S", 0.0)
    found = findings(toy)
    assert found["golden A"].level is CheckState.OK
    fast = found["fast engines"]
    assert fast.level is CheckState.WARN
    assert re.match(
        r"nothing can be forked: (at its end )?it has [23] threads, and only one can be forked", fast.found
    )
    assert "'ThreadPoolExecutor-0_0'" in fast.found
    (place,) = fast.places
    line = line_of(toy, "self.pool.submit")
    assert str(place).startswith(f"toycar/driver.py:{line} in Driver.drive: starts the thread 'ThreadPool")
    assert "do the pool's work in the step itself" in fast.remedy
    assert "--drive" not in fast.remedy  # the timeout under test


def test_reading_a_clock_without_effect_is_only_a_note(toy: Workspace) -> None:
    change(toy, "driver.py", "class Driver", "import time\n\n\nclass Driver")
    change(
        toy,
        "driver.py",
        "        return gas, brake",
        "        time.perf_counter()\n        return gas, brake",
    )
    found = findings(toy)
    assert found["golden A"].level is found["clocks"].level is CheckState.OK
    assert [place.line for place in found["clocks"].places] == [line_of(toy, "time.perf_counter()")]


def test_reported_lines_are_those_of_the_target(toy: Workspace) -> None:
    """Lines that are added for counting shift other lines."""
    change(toy, "sensing.py", "class Sensor", "import time\n\n\nclass Sensor")
    change(
        toy,
        "sensing.py",
        "self.reading = reading",
        "self.reading = (reading[0] + time.time() * 1e-9, *reading[1:])",
    )
    (place,) = findings(toy)["golden A"].places
    assert (place.file, place.line) == ("toycar/sensing.py", line_of(toy, "time.time()", "sensing.py"))


def test_an_anchor_that_no_run_executes_is_reported(toy: Workspace) -> None:
    change(
        toy,
        "sensing.py",
        "        offset = world.offset\n",
        "        offset = world.offset\n        if gap < 0:\n            offset = 0.0\n",
    )
    spec = "fault_library/faults/sensor/lane.yaml"
    change(toy, spec, "after_assign: offset}", "after_assign: offset, nth: 2}")
    found = findings(toy)["statements"]
    assert (found.level, found.found) == (
        CheckState.WARN,
        "1 of 4 statements never reached in A, A+alone",
    )
    (place,) = found.places
    path = toy.library.parent / spec
    number = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if "at: {" in text)
    assert (place.file, place.line) == (str(path), number)
    assert place.what == "sensor/lane/shifted: toycar/sensing.py, Sensor.sense, after_assign offset"


def test_an_anchor_reached_only_without_the_faults_change_is_reported(toy: Workspace) -> None:
    """A fault can change its scenario."""
    change(
        toy,
        "sensing.py",
        "        gap = world.gap\n",
        "        gap = 500.0\n        if world.gap < 100.0:\n            gap = world.gap\n",
    )
    for kind in ("distance",):
        path = toy.library / "faults" / "sensor" / f"{kind}.yaml"
        path.write_text(path.read_text().replace("after_assign: gap}", "after_assign: gap, nth: 2}"))
    found = findings(toy)["statements"]
    assert [place.what.partition(":")[0] for place in found.places] == ["sensor/distance/nearer"]


@pytest.mark.parametrize(
    ("count", "told"),
    [(0, "none"), (1, "1 trigger, which is reached"), (2, "2 triggers, which are all reached")],
)
def test_the_wording_fits_the_number_of_places_reached(toy: Workspace, count: int, told: str) -> None:
    finding = ReachTracker(toy, toy.manifest("toycar"), [])._reach_finding("trigger", count, [], "")
    assert (finding.name, finding.found) == ("triggers", told)


def test_a_trigger_that_no_scenario_reaches_is_reported(toy: Workspace) -> None:
    change(toy, "fault_library/stpa/contexts/near_far.yaml", "near_s: 2.0", "near_s: 0.01")
    change(toy, "fault_library/campaigns/small.yaml", "random_until_s: 5.5", "random_until_s: 9.0")
    found = findings(toy)["triggers"]
    assert found.level is CheckState.WARN
    assert found.found.endswith("never reached in A, A+alone")
    whats = {Path(place.file).name: place.what for place in found.places}
    assert whats == {
        "small.yaml": "small: random times until 9 s",
        "near_far.yaml": "near_far, near: hwt <= 0.01, armed after 0 s",
    }


def test_a_harmless_canary_is_reported_with_all_values(toy: Workspace) -> None:
    change(toy, "fault_library/campaigns/small.yaml", "at_s: 1.0", "at_s: 5.9")
    toy.campaign("toy").unlink()
    found = findings(toy)["canary small"]
    assert found.level is CheckState.FAIL
    assert "sensor/lane/shifted in A did not reach H3 with any of its values: 2." in found.found
    assert found.found.count(" m") == 4


HOSTILE = """\
if _fi.active("{{{{ fi }}}}"):
    {body}
"""


@pytest.mark.parametrize(
    ("body", "cpu_s", "wall_s", "problem"),
    [
        ("raise ValueError('no')", 20, 60, "crashed: ValueError: no (toycar/sensing.py:LINE)"),
        ("raise SystemExit(4)", 20, 60, "crashed: exit status 4 (toycar/sensing.py:LINE)"),
        pytest.param("while True: pass", 1, 60, "timeout: CPU time limit of 1 s", marks=pytest.mark.slow),
        pytest.param(
            "import time; time.sleep(99)", 20, 9, "timeout: wall time limit of 9 s", marks=pytest.mark.slow
        ),
    ],
    ids=["raises", "exits", "loops", "sleeps"],
)
def test_a_canary_that_ends_its_run_is_reported_with_the_place(
    toy: Workspace, body: str, cpu_s: int, wall_s: int, problem: str
) -> None:
    """As `run` reports it: the exception at the line of the user's file, though the canary ran twice, in two
    campaigns."""
    library = toy.library
    (toy.templates / "crash.py.j2").write_text(HOSTILE.format(body=body))
    hostile = (HERE / "toy/fault_library/faults/hostile/crash.yaml").read_text()
    (library / "faults" / "hostile").mkdir(exist_ok=True)
    (library / "faults" / "hostile" / "crash.yaml").write_text(hostile)
    toy.campaign("toy").unlink()
    text = (
        toy.campaign("small")
        .read_text()
        .replace("sensor/lane/shifted, scenario", "hostile/crash/it, scenario")
    )
    text = text.replace("cpu_s: 20, wall_s: 60", f"cpu_s: {cpu_s}, wall_s: {wall_s}")
    toy.campaign("small").write_text(text)
    other = toy.campaign("small").with_name("other.yaml")
    other.write_text(text.replace("name: small", "name: other").replace("hazard: H3", "hazard: H1"))
    found = findings(Workspace(library=library, templates=toy.templates))
    expected = problem.replace("LINE", str(line_of(toy, "gap = world.gap", "sensing.py")))
    for name, hazard in (("small", "H3"), ("other", "H1")):
        finding = found[f"canary {name}"]
        assert finding.level is CheckState.FAIL
        assert finding.found.startswith(f"hostile/crash/it in A did not reach {hazard} ")
        assert finding.found.endswith(f"({expected})")


def test_a_crashing_or_hazardous_target_is_reported(toy: Workspace) -> None:
    change(toy, "driver.py", "        gap, closing", "        1 / 0\n        gap, closing")
    found = findings(toy)["golden A"]
    assert (found.level, "crashed: ZeroDivisionError" in found.found) == (CheckState.FAIL, True)


def test_a_nondeterministic_target_is_not_forked(toy: Workspace) -> None:
    """A fork would differ for the same reason."""
    change(toy, "driver.py", "class Driver", "import time\n\n\nclass Driver")
    change(toy, "driver.py", *CLOCK)
    fast = findings(toy)["fast engines"]
    assert (fast.level, "not tried, because a golden run fails" in fast.found) == (CheckState.WARN, True)


def test_a_target_without_a_stepwise_entry_is_reported(toy: Workspace) -> None:
    change(toy, "fault_library/targets/toycar.yaml", "  stepwise: begin\n", "")
    found = findings(toy)
    assert found["golden A"].level is CheckState.OK
    assert "names no `entry.stepwise`" in found["fast engines"].found
    assert "toycar.yaml" in found["fast engines"].remedy


def test_an_unknown_scenario_is_refused(toy: Workspace) -> None:
    with pytest.raises(MutatorError, match="nowhere"):
        findings_from_running(toy, "toycar", ["nowhere"])
