"""Whatever a mutant does to its folders, every engine gives the same result, and the next jobs run."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from mutator.engines.engine_jobs import JobResult
from mutator.model import Status
from mutator.triggers.trigger_kinds import trigger_at_time

from ..fork_on_toy import Edit, Fork

WORK = """
work = os.getcwd()
while os.path.basename(work) != "work":
    work = os.path.dirname(work)
"""
FILED = f"{WORK}shutil.rmtree(work)\nopen(work, 'w').close()"
MOVE = "home = os.environ['TMPDIR']\nos.rename(home, f'{home}-{os.getpid()}')"
EXCHANGE = "atexit.register(lambda: (os.rename('../out', '../out2'), {}))"
CASES = {
    "deletes_all_folders": (Status.HARNESS_ERROR, (), f"{WORK}shutil.rmtree(work)"),
    "renames_all_folders": (Status.HARNESS_ERROR, (), f"{WORK}os.rename(work, f'{{work}}-{{os.getpid()}}')"),
    "makes_all_folders_a_file": (Status.HARNESS_ERROR, (), FILED),
    "links_all_folders": (
        Status.OK,
        ("log.npz", "said.json"),
        f"{WORK}os.rename(work, f'{{work}}-{{os.getpid()}}')\nos.symlink(f'work-{{os.getpid()}}', work)",
    ),
    "deletes_its_folder": (Status.HARNESS_ERROR, (), "shutil.rmtree(os.environ['TMPDIR'])"),
    "renames_its_folder": (Status.HARNESS_ERROR, (), MOVE),
    "a_link_instead_of_its_folder": (
        Status.HARNESS_ERROR,
        (),
        f"{MOVE}\nos.symlink('/', home)",
    ),
    "deletes_its_output": (Status.CRASHED, (), "shutil.rmtree('../out')"),
    "its_output_is_elsewhere": (
        Status.OK,
        ("log.npz", "said.json"),
        EXCHANGE.format("os.symlink('/', '../out')"),
    ),
    "a_pipe": (Status.OK, ("log.npz", "said.json"), EXCHANGE.format("os.mkfifo('../out')")),
    "a_file": (Status.OK, ("log.npz", "said.json"), EXCHANGE.format("open('../out', 'w').close()")),
    "a_link_to_a_device": (
        Status.OK,
        ("log.npz", "said.json"),
        EXCHANGE.format("os.symlink('/dev/zero', '../out')"),
    ),
    "a_locked_folder": (Status.OK, ("log.npz", "said.json"), "atexit.register(os.chmod, os.getcwd(), 0)"),
    "results_behind_a_link": (
        Status.OK,
        ("said.json",),
        "atexit.register(lambda: (os.rename('log.npz', '../x'), os.symlink('../x', 'log.npz')))",
    ),
    "a_socket": (
        Status.OK,
        ("said.json",),
        "atexit.register(lambda: (os.unlink('log.npz'), socket.socket(socket.AF_UNIX).bind('log.npz')))",
    ),
}


QUICK = ("deletes_all_folders", "a_pipe")
BODY = """        if world.frame == 60:
            import atexit, os, shutil, socket
            bodies, home = {bodies!r}, os.path.basename(os.path.dirname(os.getcwd()))
            names = dict(atexit=atexit, os=os, shutil=shutil, socket=socket)
            exec(bodies.get(home.partition("-")[2] or home, ""), names)
"""


def outcome(execution: JobResult) -> tuple[Status, str, tuple[str, ...]]:
    out = execution.out
    names = sorted(path.name for path in out.iterdir()) if out.is_dir() else []
    return execution.status, execution.detail, tuple(names)


@pytest.mark.parametrize(
    "cases", [QUICK, pytest.param([*CASES], marks=pytest.mark.slow)], ids=["quick", "all"]
)
def test_engines_agree_on_what_a_mutant_does_to_its_folders(
    fork: Fork, edit: Edit, cases: Sequence[str]
) -> None:
    """The target misbehaves in runs whose folder has the name of a case."""
    anchor, bodies = "        offset = world.offset\n", {name: body for name, (_, _, body) in CASES.items()}
    edit("tree/toycar/sensing.py", anchor, anchor + BODY.format(bodies=bodies))
    job, wrong = fork.job(trigger_at_time(2.0)), []
    for name in cases:
        found = []
        for engine in (fork.engine, fork.engine.reference):
            [misbehaved] = [outcome(one) for _, one in engine.run([replace(job, name=name)])]
            [after] = [outcome(one) for _, one in engine.run([replace(job, name="ordinary")])]
            assert after == (Status.OK, "", ("log.npz", "said.json")), f"{name}: the next job differs"
            found.append(misbehaved)
        status, names, _ = CASES[name]
        if found[0] != found[1] or (found[0][0], found[0][2]) != (status, names):
            wrong.append((name, found))
    assert not wrong, "\n".join(map(str, wrong))
