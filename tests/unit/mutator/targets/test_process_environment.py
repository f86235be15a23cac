"""The environment variables that a manifest sets."""

from pathlib import Path

import pytest

from mutator.engines.engine_jobs import RunMode
from mutator.errors import MutatorError
from mutator.model import Status
from mutator.report.experiment_filming import Shot, _write_shots
from mutator.triggers.trigger_kinds import trigger_at_time
from mutator.workspace import Workspace

from ..fork_on_toy import Fork

MANIFEST = "fault_library/targets/toycar.yaml"
USE = "import os\nassert (os.environ['ROAD'], os.environ['PYTHONHASHSEED']) == ('wet', '0')\n"


def with_env(workspace: Workspace, env: str) -> Path:
    path = workspace.library.parent / MANIFEST
    head, about, rest = path.read_text().split("\n", 2)
    path.write_text(f"{head}\n{about}\nenv: {env}\n{rest}")
    return path


def test_reference_runs_and_the_fork_server_have_the_variables(fork: Fork) -> None:
    with_env(fork.toy, "{ROAD: wet, OMP_NUM_THREADS: '1'}")
    (fork.toy.library.parent / "tree" / "toycar" / "__init__.py").write_text(USE)
    job = fork.job(trigger_at_time(2.0))
    forked = fork.run(job)
    assert (forked.status, forked.mode, forked.fallback_reason) == (Status.OK, RunMode.FORK, "")
    plain = fork.engine.reference.execute(job, fork.folder / "plain")
    assert plain.status is Status.OK, plain.detail


def test_films_have_the_variables(toycar: Workspace, tmp_path: Path) -> None:
    with_env(toycar, "{ROAD: wet}")
    show = toycar.library.parent / "tree" / "toycar" / "show.py"
    show.write_text("import os, sys; open(sys.argv[4], 'w').write(os.environ['ROAD'])")
    places = dict.fromkeys(("golden", "faulty", "events"), "")
    _write_shots(toycar.manifest("toycar"), tmp_path, places, [Shot(path=tmp_path / "film.txt")])
    assert (tmp_path / "film.txt").read_text() == "wet"


@pytest.mark.parametrize(
    ("env", "said"),
    [
        (
            "{PYTHONHASHSEED: '1'}",
            "3: variable PYTHONHASHSEED; expected a variable that the harness does not set",
        ),
        ("{PYTHONPATH: /x}", "3: variable PYTHONPATH; expected a variable that the harness does not set"),
        ("{LD_PRELOAD: x.so}", "3: variable LD_PRELOAD; expected a variable that the harness does not set"),
        ("{TMPDIR: /x}", "3: variable TMPDIR; expected a variable that the harness does not set"),
        (
            "{OMP_NUM_THREADS: '4'}",
            r"3: variable OMP_NUM_THREADS; expected a variable that .* \(it sets .* to '1'\); leave it",
        ),
        ("{A-B: x}", "3: 'A-B'; expected a name of letters"),
        ("{ROAD: 1}", "3: 1 for 'env.ROAD'|3: 1 for 'ROAD'"),
        ('{ROAD: "a\\0b"}', r"3: 'a\\x00b'; expected text without NUL"),
    ],
)
def test_invalid_variables_are_refused(toycar: Workspace, env: str, said: str) -> None:
    path = with_env(toycar, env)
    with pytest.raises(MutatorError) as caught:
        toycar.manifest("toycar")
    assert caught.value.where == str(path)
    with pytest.raises(MutatorError, match=said):
        toycar.manifest("toycar")
