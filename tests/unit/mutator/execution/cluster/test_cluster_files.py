"""Cluster files: their valid content, and the jobs that are submitted to a queueing system."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.execution.cluster.cluster_choice import parse_cluster_choice

from .loops import run

SLURM = """\
schema: cluster/1
kind: slurm
workers: 4
options:
  cores: 2
  memory: 1 GB
  scheduler_options: {host: 127.0.0.1}
"""


async def opened(folder: Path, text: str, insecure: bool = False) -> str:
    """Open the cluster that a file with this text describes, and return the address of its dashboard."""
    file = folder / "some.yaml"
    file.write_text(text)
    async with parse_cluster_choice(str(file)).open(insecure=insecure) as client:
        return str(client.dashboard_link)


def with_slurm(folder: Path, monkeypatch: pytest.MonkeyPatch, sbatch: str) -> None:
    """Replace Slurm's commands: `sbatch` runs the given script, and `scancel` records the cancelled jobs."""
    for name, script in (("sbatch", sbatch), ("scancel", "echo $1 >> cancelled")):
        (folder / name).write_text(f"#!/bin/sh\ncd {folder}\n{script}\n")
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")


@pytest.mark.parametrize(
    ("before", "after", "error"),
    [
        ("kind: slurm", "kind: dask_jobqueue.SLURMCluster", r"some.yaml:2: .*'slurm', 'pbs', 'sge', 'lsf'"),
        ("kind: slurm", "class: slurm", r"some.yaml.*class"),
        ("cluster/1", "cluster/2", r"some.yaml:1: .*newer"),
        ("workers: 4", "workers: 0", r"some.yaml:3: .*workers"),
        ("workers: 4", "workers: many", r"some.yaml:3: .*workers"),
        ("  cores: 2", "  core: 2", r"some.yaml:5: option 'core'; .*SLURMCluster; write `cores`"),
        ("  cores: 2", "  cores: 2\n  job_cls: os.system", r"some.yaml:6: option 'job_cls'"),
        (
            "  cores: 2",
            "  cores: 2\n  security: cert.pem",
            r"some.yaml:6: security: 'cert.pem'; expected true",
        ),
        ("  cores: 2", "  cores: 2\n  processes: 1", r"some.yaml:6: processes: 1, cores: 2"),
        ("{host: 127.0.0.1}", "127.0.0.1\n  security: true", r"some.yaml:4: "),
        ("1 GB", "much", r"some.yaml:4: Could not interpret 'much'"),
        ("  cores: 2\n", "", r"some.yaml:4: .*cores and memory"),
    ],
)
def test_an_invalid_file_is_refused_with_its_line(
    before: str, after: str, error: str, tmp_path: Path
) -> None:
    with pytest.raises(MutatorError, match=error):
        run(opened(tmp_path, SLURM.replace(before, after)))


@pytest.mark.parametrize(
    "text",
    [
        SLURM.replace("host: 127.0.0.1", ""),
        SLURM.replace("127.0.0.1", "0.0.0.0"),
        SLURM.replace("127.0.0.1}", "0.0.0.0}\n  interface: lo"),
        SLURM.replace("kind: slurm", "kind: kubernetes"),
    ],
)
def test_a_scheduler_on_an_unprotected_network_is_not_started(text: str, tmp_path: Path) -> None:
    with pytest.raises(
        MutatorError, match=r"some.yaml:4: the network .* neither encrypted nor on the loopback"
    ):
        run(opened(tmp_path, text))


def test_the_signal_handler_of_dask_jobqueue_is_not_installed() -> None:
    """The handler works only in the main thread."""
    code = (
        "import signal, threading\n"
        "from mutator.execution.cluster.cluster_files import _cluster_class\n"
        "thread = threading.Thread(target=lambda: print(_cluster_class('slurm').__name__))\n"
        "thread.start(); thread.join()\n"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "SLURMCluster\n"


def test_kubernetes_requires_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dask_kubernetes", None)
    monkeypatch.setitem(sys.modules, "dask_kubernetes.operator", None)
    with pytest.raises(MutatorError, match=r"dask_kubernetes.* is not installed.*'mutator-fi\[kubernetes\]'"):
        run(opened(tmp_path, SLURM.replace("kind: slurm", "kind: kubernetes"), insecure=True))


def test_jobs_are_submitted_and_cancelled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four single-threaded workers need two jobs with two cores each."""
    with_slurm(tmp_path, monkeypatch, "cp $1 job$$; echo Submitted batch job $$")
    dashboard = run(opened(tmp_path, SLURM))
    assert dashboard.startswith("http://127.0.0.1:")
    jobs = {job.name.removeprefix("job"): job.read_text() for job in tmp_path.glob("job*")}
    assert len(jobs) == 2
    assert all(f"{sys.executable} -P -m " in job for job in jobs.values()), "a job could import ./json.py"
    assert all(
        "--nthreads 1 " in job and "--nworkers 2" in job and "tcp://127.0.0.1:" in job
        for job in jobs.values()
    )
    assert sorted((tmp_path / "cancelled").read_text().split()) == sorted(jobs)


def test_security_true_creates_certificates_for_the_cluster(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_slurm(tmp_path, monkeypatch, "cp $1 job; echo Submitted batch job 7")
    options = f"  security: true\n  shared_temp_directory: {tmp_path}\n  interface: lo"
    run(opened(tmp_path, SLURM.replace("  scheduler_options: {host: 127.0.0.1}", options)))
    job = (tmp_path / "job").read_text()
    assert "tls://127.0.0.1:" in job and f"--tls-ca-file {tmp_path}" in job
    assert not list(tmp_path.glob(".dask*")), "the key outlives the cluster"


@pytest.mark.parametrize("script", ["echo no such partition >&2; exit 1", "echo this is no answer"])
def test_the_message_of_a_refused_job_is_reported(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: Any
) -> None:
    with_slurm(tmp_path, monkeypatch, script)
    with pytest.raises(MutatorError, match=r"some.yaml:4: .*(no such partition|this is no answer)"):
        run(opened(tmp_path, SLURM))
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


def test_a_missing_queueing_command_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MutatorError, match=r"some.yaml:2: .*sbatch.*; submit from a machine"):
        run(opened(tmp_path, SLURM))
