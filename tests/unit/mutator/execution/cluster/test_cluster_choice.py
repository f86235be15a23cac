"""The argument `WHERE`: its valid and invalid values, and the connections that it opens."""

import json
import os
import socket
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.execution.cluster import cluster_choice, dask_connections
from mutator.execution.cluster.cluster_choice import (
    ClusterChoice,
    NewLocalCluster,
    RunningScheduler,
    parse_cluster_choice,
)

from .loops import run


async def opened(place: ClusterChoice, insecure: bool = False) -> None:
    async with place.open(insecure=insecure):
        pass


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:8786", "tls://far.example:1", "tls://[::1]:8786"])
def test_tcp_and_tls_addresses_are_accepted(address: str) -> None:
    assert parse_cluster_choice(address) == RunningScheduler(address=address)


def test_local_is_followed_by_the_number_of_workers() -> None:
    assert parse_cluster_choice("local:4") == NewLocalCluster(worker_count=4)


@pytest.mark.parametrize(
    "text",
    [
        *("", "slurm", "local", "local:0", "local:-1", "local:2x", "dask_jobqueue.SLURMCluster", "some.txt"),
        *("http://x:1", "tcp://x", "tcp://x:0", "tcp://x:65536", "tcp://:1", "tls://a b:1", "tcp://u@x:1"),
    ],
)
def test_an_invalid_value_of_where_is_refused(text: str) -> None:
    with pytest.raises(MutatorError) as caught:
        parse_cluster_choice(text)
    assert caught.value.argument == "cluster"
    assert text in caught.value.got
    assert caught.value.expected


def test_parsing_needs_no_dask() -> None:
    code = (
        "import sys; from mutator.execution.cluster.cluster_choice import parse_cluster_choice as parse; "
        "parse('local:2'); print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"dask", "distributed", "tornado"} & set(done.stdout.split())


def test_the_address_is_read_from_a_scheduler_file(tmp_path: Path) -> None:
    """`dask scheduler --scheduler-file` writes the file."""
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"type": "Scheduler", "address": "tcp://10.0.0.1:8786", "workers": {}}))
    found = parse_cluster_choice(str(file))
    assert found == RunningScheduler(address="tcp://10.0.0.1:8786", address_file=file)
    with pytest.raises(MutatorError, match=r"scheduler.json: tcp://10.0.0.1:8786 is neither"):
        run(opened(found))


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"address": 7}', '{"address": "http://x:1"}', "\xff", "[" * 9999]
)
def test_the_error_names_an_invalid_scheduler_file(text: str, tmp_path: Path) -> None:
    file = tmp_path / "scheduler.json"
    with pytest.raises(MutatorError, match=r"scheduler.json: cannot be read"):
        parse_cluster_choice(str(file))
    file.write_text(text, encoding="latin-1")
    with pytest.raises(MutatorError, match=r"scheduler.json: (not a scheduler file|address ')"):
        parse_cluster_choice(str(file))


@pytest.mark.parametrize(
    ("address", "closed"),
    [
        ("tcp://127.0.0.1:1", True),
        ("tcp://127.8.0.1:1", True),
        ("tcp://localhost:1", True),
        ("tcp://[::1]:1", True),
        ("tls://10.0.0.1:1", True),
        ("tcp://10.0.0.1:1", False),
        ("tcp://0.0.0.0:1", False),
        ("tcp://localhost.example.org:1", False),
        ("tcp://127.0.0.1.example.org:1", False),
        ("tcp://[fe80::1]:1", False),
    ],
)
def test_only_loopback_and_tls_addresses_are_private(address: str, closed: bool) -> None:
    assert dask_connections.is_closed_to_others(address) is closed


def test_an_open_network_is_refused_before_connecting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        MutatorError, match=r"neither encrypted nor on the loopback.*tls://.*`insecure_network`"
    ):
        run(opened(parse_cluster_choice("tcp://10.0.0.1:8786")))


def test_a_loopback_address_of_a_scheduler_that_listens_elsewhere_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    @asynccontextmanager
    async def found(*given: Any, **more: Any) -> AsyncIterator[Any]:
        yield SimpleNamespace(scheduler_info=lambda: {"address": "tcp://10.0.0.5:8786"})

    monkeypatch.setattr(cluster_choice, "connected_client", found)
    with pytest.raises(MutatorError, match=r"127.0.0.1:8786 \(a scheduler that listens at tcp://10.0.0.5"):
        run(opened(parse_cluster_choice("tcp://127.0.0.1:8786")))
    run(opened(parse_cluster_choice("tcp://127.0.0.1:8786"), insecure=True))


def test_without_dask_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    for text in ("local:1", "tcp://127.0.0.1:1"):
        with pytest.raises(
            MutatorError, match=r"distributed is not installed; pip install 'mutator-fi\[cluster\]'"
        ):
            run(opened(parse_cluster_choice(text)))


def test_a_scheduler_that_does_not_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_connections, "CONNECT_TIMEOUT_S", 2.0)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))  # bound but not listening
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(MutatorError, match=rf"no Dask scheduler answers at {address} \(.*refused"):
            run(opened(parse_cluster_choice(address)))


def test_missing_certificates_are_an_error_with_a_remedy() -> None:
    import dask

    with pytest.raises(
        MutatorError, match=r"tls:// without certificates; .*DASK_DISTRIBUTED__COMM__TLS__CA_FILE"
    ):
        run(opened(parse_cluster_choice("tls://127.0.0.1:1")))
    files = {"ca-file": "/no/ca.pem", "client.cert": "/no/cert.pem", "client.key": "/no/key.pem"}
    with (
        dask.config.set({f"distributed.comm.tls.{key}": file for key, file in files.items()}),
        pytest.raises(MutatorError, match="unusable TLS certificates"),
    ):
        run(opened(parse_cluster_choice("tls://127.0.0.1:1")))


def test_local_workers_run_and_end() -> None:
    async def used() -> tuple[str, dict[str, int], int, str]:
        async with parse_cluster_choice("local:1").open(insecure=False) as client:
            await client.wait_for_workers(1)
            found = await client.run(lambda dask_worker: (os.getpid(), dask_worker.local_directory))
            [(pid, folder)] = found.values()
            return client.scheduler.address, await client.nthreads(), pid, folder

    address, threads, pid, folder = run(used())
    assert address.startswith("tcp://127.0.0.1:")
    assert list(threads.values()) == [1]
    assert pid != os.getpid() and not Path(f"/proc/{pid}").exists()
    assert "mutator-workers-" in folder and not Path(folder).exists()
