"""The glue for a target's entry module: how a run is opened, stepped, recorded and written."""

import json
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mutator.glue import GlueError, Run, read_scenario, seed_globals


class Ball(Run):
    """A falling ball. If it is `caught`, the run ends when the ball reaches the ground."""

    def __init__(self, scenario, seed):
        super().__init__(step_s=0.1, duration_s=scenario["duration_s"])
        self.height = scenario["height_m"] + 0.001 * seed
        self.caught = scenario["caught"]

    def step(self):
        self.height -= 1.0
        lies = self.height <= 0.0
        self.hazard("LIES", lies)
        self.hazard("FLIES", False)
        self.alert("low", 1.0 < self.height < 3.0 or self.height < 0.0)
        if lies and self.caught:
            self.end()
        self.record(height=self.height, lies=lies)


@pytest.fixture
def arguments(tmp_path: Path) -> list[str]:
    scenario = tmp_path / "drop.yaml"
    scenario.write_text(
        "about: A drop: from 4 m  # not far\n\n# times\nduration_s: 0.6\nheight_m: 4\ncaught: false\n"
    )
    out = tmp_path / "out"
    out.mkdir()
    return ["--scenario", str(scenario), "--seed", "0", "--out", str(out)]


def driven(arguments: list[str]) -> tuple[dict[str, list[float]], dict[str, object]]:
    Ball.main(arguments)
    out = Path(arguments[5])
    with np.load(out / "trace.npz") as trace:
        return {name: trace[name].tolist() for name in trace}, json.loads((out / "record.json").read_text())


def test_a_run_writes_a_trace_and_a_record(arguments: list[str]) -> None:
    trace, record = driven(arguments)
    assert list(trace) == ["t", "height", "lies"]
    assert trace["t"] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert trace["height"] == [3.0, 2.0, 1.0, 0.0, -1.0, -2.0]
    assert trace["lies"] == [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
    assert record["hazards"] == {"LIES": pytest.approx(0.3), "FLIES": None}
    assert record["alerts"] == [{"name": "low", "t": 0.1}, {"name": "low", "t": pytest.approx(0.4)}]


def test_the_step_that_calls_end_is_recorded_as_the_last(arguments: list[str]) -> None:
    trace, _ = driven([*arguments, "--caught"])
    assert trace["height"][-1] == 0.0


def test_equal_runs_write_equal_bytes(arguments: list[str]) -> None:
    out = Path(arguments[5])
    files = []
    for _ in range(2):
        driven(arguments)
        files.append({path.name: path.read_bytes() for path in out.iterdir()})
    assert files[0] == files[1]
    assert set(files[0]) == {"trace.npz", "record.json"}


def test_a_run_stepped_from_outside_writes_the_same_files_as_main(
    arguments: list[str], tmp_path: Path
) -> None:
    driven(arguments)
    run = Ball.open(arguments)
    while not run.done:
        run.step()
    run.write(tmp_path)
    for name in ("trace.npz", "record.json"):
        assert (tmp_path / name).read_bytes() == (Path(arguments[5]) / name).read_bytes()


@pytest.mark.parametrize("flags", [["--height-m", "-2"], ["--height_m=-2"]])
def test_flags_replace_keys_of_the_scenario(arguments: list[str], flags: list[str]) -> None:
    trace, _ = driven([*arguments, *flags])
    assert trace["height"][0] == -3.0


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (
            ["--heigth_m", "3"],
            "drop.yaml: no key 'heigth_m'; the file has about, duration_s, height_m, caught",
        ),
        (["3"], "argument '3'"),
        (["--seed", "-1"], "--seed -1; expected a whole number"),
        (["--seed"], "no --seed"),
        (["--duration_s", "0.01"], "at least one step"),
        (["--duration_s", "0"], "duration_s is 0; expected a finite time above 0 s"),
        (["--duration_s", "long"], "duration_s is 'long'; expected a number"),
    ],
)
def test_the_error_names_the_wrong_argument(arguments: list[str], flags: list[str], words: str) -> None:
    with pytest.raises(GlueError) as told:
        Ball.main([*arguments, *flags])
    assert words in str(told.value)


def test_values_are_read_as_json_or_as_text(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text('a: 1\nb: 2.5\nc: true\nd: null\ne: [1, 2]\nf: {"x": 1}\ng: a: b\nh: "1"\ni: a#b\n')
    expected = {
        "a": 1,
        "b": 2.5,
        "c": True,
        "d": None,
        "e": [1, 2],
        "f": {"x": 1},
        "g": "a: b",
        "h": "1",
        "i": "a#b",
    }
    assert read_scenario(path) == expected


@pytest.mark.parametrize("line", ["- a", "a:", "  b: 1", "a 1", "first: 2"])
def test_an_invalid_scenario_file_is_an_error(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(f"first: 1\n{line}\n")
    with pytest.raises(GlueError, match=r"a\.yaml:2: '.*'; expected `key: value`"):
        read_scenario(path)


@pytest.mark.parametrize("later", [{"b": 1.0}, {}, {"a": 1.0, "b": 2.0}])
def test_each_step_must_record_the_same_channels(later: dict[str, float]) -> None:
    run = Run(step_s=0.5, duration_s=1.0)
    run.record(a=1.0)
    with pytest.raises(GlueError, match=r"at 0.5 s: missing or unexpected channels: [ab]"):
        run.record(**later)


@pytest.mark.parametrize(
    "value",
    [None, "1", "near", b"1", [1.0], np.zeros(1), np.zeros((2, 3)), 1j, pytest.param(10**400, id="huge")],
)
def test_only_numbers_can_be_recorded(value: object) -> None:
    run = Run(step_s=0.5, duration_s=1.0)
    run.record(a=1.0, gap=2.0)
    with pytest.raises(GlueError, match=r"^at 0.5 s: gap is .*; expected a number$"):
        run.record(a=1.0, gap=value)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [True, 3, np.float32(2.5), np.array(4), float("inf")])
def test_any_single_number_is_recorded(value: float, tmp_path: Path) -> None:
    run = Run(step_s=0.5, duration_s=1.0)
    run.record(a=value)
    run.write(tmp_path)
    with np.load(tmp_path / "trace.npz") as trace:
        assert trace["a"].tolist() == [float(value)]


@pytest.mark.parametrize("length", [0, -0.1, float("nan"), float("inf"), None])
def test_an_invalid_step_length_is_refused(length: float) -> None:
    with pytest.raises(GlueError, match=r"step_s is .*; expected"):
        Run(step_s=length, duration_s=1.0)
    run = Run(step_s=0.5, duration_s=1.0)
    with pytest.raises(GlueError, match=r"step_s is .*; expected"):
        run.step_s = length


def test_ending_a_run_in_its_constructor_is_an_error(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Ended(Ball):
        def __init__(self, scenario, seed):
            super().__init__(scenario, seed)
            self.end()

    with pytest.raises(GlueError, match="nothing is recorded"):
        Ended.main(arguments)


LENGTHS = [0.1, 0.25, 0.05, 0.1, 0.1, 0.4, 0.1]


@pytest.mark.parametrize("first", [0.1, 0.7])
def test_steps_can_differ_in_length(first: float, arguments: list[str]) -> None:
    class Uneven(Run):
        def __init__(self, scenario, seed):
            super().__init__(step_s=first, duration_s=1.0)
            self.lengths = iter(LENGTHS)

        def step(self):
            began = self.t
            self.step_s = next(self.lengths)
            assert self.t == began
            self.record(length=self.step_s)

    Uneven.main(arguments)
    with np.load(Path(arguments[5]) / "trace.npz") as trace:
        assert trace["length"].tolist() == LENGTHS[:6]
        assert trace["t"] == pytest.approx([0.0, 0.1, 0.35, 0.4, 0.5, 0.6])


def test_times_of_equal_steps_are_exact_multiples() -> None:
    """Adding up the step lengths would accumulate rounding errors."""
    run = Run(step_s=0.1, duration_s=100.0)
    times = []
    while not run.done:
        times.append(run.t)
        run.step_s = 0.1
        run.record(a=0.0)
    assert times == [number * 0.1 for number in range(1000)]


def test_a_channel_named_t_is_refused() -> None:
    """The time would overwrite the channel."""
    with pytest.raises(GlueError, match="without t"):
        Run(step_s=0.5, duration_s=1.0).record(t=1.0)


@pytest.mark.parametrize("rows", [0, 2])
def test_a_step_that_does_not_record_exactly_once_is_an_error(
    arguments: list[str], rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Ball, "step", lambda run: [run.record(a=1.0) for _ in range(rows)])
    with pytest.raises(GlueError, match=f"recorded {rows} rows"):
        Ball.main(arguments)


def test_a_subclass_must_call_the_constructor_of_run(arguments: list[str]) -> None:
    class Bare(Run):
        def __init__(self, scenario, seed):
            self.seed = seed

    with pytest.raises(GlueError, match=r"Bare.__init__ does not call super\(\).__init__; add "):
        Bare.open(arguments)


def test_a_run_without_a_step_method_is_an_error(arguments: list[str]) -> None:
    with pytest.raises(NotImplementedError, match="Run has no step"):
        Run(step_s=1.0, duration_s=1.0).step()


def test_only_seed_globals_seeds_the_global_random_generators(arguments: list[str]) -> None:
    before = random.getstate()
    driven(arguments)
    assert random.getstate() == before
    draws = []
    for _ in range(2):
        seed_globals(7)
        draws.append((random.random(), np.random.random()))
    assert draws[0] == draws[1]


def test_importing_the_glue_loads_only_numpy() -> None:
    code = (
        "import numpy, sys; known = set(sys.modules); import mutator.glue; print(*sys.modules.keys() - known)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    own = {"mutator", "mutator._common", "mutator._common.version", "mutator.glue"}
    assert {name for name in loaded if name.partition(".")[0] not in sys.stdlib_module_names} == own
