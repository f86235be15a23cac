"""Cluster files: which kind of cluster to start for a run, how many workers, and the cluster's options.

The kinds are a fixed list of classes, so a file cannot name other code to import.
"""

import difflib
import importlib
import inspect
import signal
import sys
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.execution.cluster.dask_connections import (
    applying_scheduler_settings,
    connected_client,
    is_closed_to_others,
    is_loopback,
    load_tls_certificates,
    open_network_error,
    requiring_extra,
    starting_processes_safely,
)

if TYPE_CHECKING:
    from distributed import Client

CLUSTER_FILE_SCHEMA = "cluster/1"
KUBERNETES = "kubernetes"
_CLUSTER_CLASSES = {
    "slurm": ("dask_jobqueue", "SLURMCluster"),
    "pbs": ("dask_jobqueue", "PBSCluster"),
    "sge": ("dask_jobqueue", "SGECluster"),
    "lsf": ("dask_jobqueue", "LSFCluster"),
    KUBERNETES: ("dask_kubernetes.operator", "KubeCluster"),
}
# Options that a file must not set: those set by this module, and those that name Python objects.
RESERVED_OPTIONS = (
    "asynchronous",
    "config_name",
    "job_cls",
    "loop",
    "n_workers",
    "scheduler_cls",
    "shutdown_on_close",
)
# also parameters of the classes that are no options of a cluster
_FORBIDDEN_OPTIONS = {
    "self",
    "args",
    "kwargs",
    "base_class_kwargs",
    "job_kwargs",
    "scheduler",
    "name",
    *RESERVED_OPTIONS,
}
_JOB_RENEWAL_INTERVAL = "5s"  # how often jobs that reached their time limit are replaced


class ClusterModel(StrictModel, title="A cluster file"):
    """A cluster that a run starts and ends."""

    kind: Literal["slurm", "pbs", "sge", "lsf", "kubernetes"] = Field(
        description="The queueing system that starts the workers as jobs, or Kubernetes with Dask's operator."
    )
    workers: Annotated[int, Field(ge=1, le=100_000)] = Field(
        description="Number of single-threaded worker processes. The run starts when the first one is ready."
    )
    options: dict[str, Any] = Field(
        default={},
        description="Keyword arguments of the class that starts the workers: `SLURMCluster`, `PBSCluster`, "
        "`SGECluster` or `LSFCluster` of dask-jobqueue, `KubeCluster` of dask-kubernetes.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterFile:
    """A checked cluster file. The cluster's class checks the names of the options."""

    model: ClusterModel
    source: YamlSource

    @asynccontextmanager
    async def open(self, *, insecure: bool) -> AsyncIterator["Client"]:
        """Start the cluster. On exit, end it and all its jobs or pods."""
        if not insecure:
            self._check_network_is_closed()
        cluster_class = _cluster_class(self.model.kind)
        self._check_options(cluster_class)
        problems: list[Exception] = []
        with self._converting_errors():
            options = self._cluster_arguments()
        if self.model.kind != KUBERNETES:
            options["job_cls"] = _job_class_noting_errors(cluster_class.job_cls, problems)
        with applying_scheduler_settings():
            with self._converting_errors():
                cluster = cluster_class(asynchronous=True, n_workers=0, **options)
            try:
                with starting_processes_safely():
                    await self._start_cluster(cluster, insecure, problems)
            except BaseException:
                with suppress(Exception):  # the cause is already known
                    await cluster.close()
                _delete_tls_key_files(cluster)
                raise
            try:
                async with connected_client(cluster, where=self.source.path) as client:
                    yield client
            finally:
                await cluster.close()
                _delete_tls_key_files(cluster)

    async def _start_cluster(self, cluster: Any, insecure: bool, problems: list[Exception]) -> None:
        """Start the scheduler and submit the jobs. `problems` collects the errors of failed submissions."""
        with self._converting_errors():
            await cluster
        if not insecure and not is_closed_to_others(cluster.scheduler_address):
            raise open_network_error(cluster.scheduler_address, where=self.source.path)
        workers = self.model.workers
        with self._converting_errors():
            await cluster.scale(workers)
            await cluster
            if problems:
                raise problems[0]
        if self.model.kind != KUBERNETES:  # on Kubernetes, the operator does this
            cluster.adapt(minimum=workers, maximum=workers, interval=_JOB_RENEWAL_INTERVAL)

    def _check_network_is_closed(self) -> None:
        """Raise MutatorError if the options show that others could reach the scheduler."""
        options = self.model.options
        scheduler = options.get("scheduler_options")
        scheduler = scheduler if isinstance(scheduler, Mapping) else {}
        what = "the network of the cluster's pods"
        if self.model.kind != KUBERNETES:
            tls = options.get("security") is True or str(options.get("protocol")).startswith("tls")
            on_loopback = scheduler.get("interface", options.get("interface")) == "lo"
            if tls or (is_loopback(str(scheduler["host"])) if "host" in scheduler else on_loopback):
                return
            what = "the network of the cluster's scheduler"
        raise open_network_error(what, where=self.source.path, line=self.source.line_of(("options",)))

    def _check_options(self, cluster_class: type) -> None:
        allowed = set(_parameter_names(cluster_class)) - _FORBIDDEN_OPTIONS
        for name, value in self.model.options.items():
            if name not in allowed:
                close = difflib.get_close_matches(name, sorted(allowed), n=1)
                raise self._error_at(
                    ("options", name),
                    f"option '{name}'",
                    expected=f"an option of {cluster_class.__name__}",
                    remedy=f"write `{close[0]}`" if close else "remove it",
                )
            if name == "security" and value is not True:
                remedy = "write `security: true`, or `protocol: tls://` for Dask's configured certificates"
                raise self._error_at(
                    ("options", name), f"security: {value!r}", expected="true", remedy=remedy
                )
        processes = self.model.options.get("processes", self.model.options.get("cores"))
        if processes != self.model.options.get("cores"):
            raise self._error_at(
                ("options", "processes"),
                f"processes: {processes}, cores: {self.model.options.get('cores')}",
                expected="one process per core, because a worker has one thread",
                remedy="remove `processes`",
            )

    def _cluster_arguments(self) -> dict[str, Any]:
        """Return the arguments of the class: one thread per worker, and a dashboard only for this machine."""
        options = dict(self.model.options)
        if self.model.kind == KUBERNETES:
            from tornado.ioloop import IOLoop

            defaults = {"worker_command": "dask worker --nthreads 1", "quiet": True}
            return defaults | options | {"shutdown_on_close": True, "loop": IOLoop.current()}
        import dask

        if "cores" in options:
            options["processes"] = options["cores"]
        python = options.get("python") or dask.config.get(f"jobqueue.{self.model.kind}.python", None)
        # a job starts in the command's folder, which can be somebody's library
        options["python"] = f"{python or sys.executable} -P"
        scheduler = options.get("scheduler_options") or {}
        options["scheduler_options"] = {"dashboard_address": "127.0.0.1:0"} | scheduler
        if "security" not in options and str(options.get("protocol")).startswith("tls"):
            options["security"] = load_tls_certificates()
        return options

    @contextmanager
    def _converting_errors(self) -> Iterator[None]:
        """Turn the class's errors about options, and the queueing system's about jobs, into MutatorError."""
        try:
            yield
        except FileNotFoundError as error:
            raise self._error_at(
                ("kind",), str(error), remedy="submit from a machine that has this command"
            ) from None
        except (ImportError, TypeError, ValueError, RuntimeError, OSError) as error:
            remedy = f"correct the options (see the documentation of {_CLUSTER_CLASSES[self.model.kind][1]})"
            if self.model.kind == KUBERNETES:
                remedy += ", and check that kubectl works here"
            raise self._error_at(("options",), " ".join(str(error).split()), remedy=remedy) from None

    def _error_at(self, keys: tuple[str, ...], got: str, **more: str) -> MutatorError:
        return self.source.error(keys, got, **more)


def load_cluster_file(path: Path) -> ClusterFile:
    model, source = load_yaml_model(path, ClusterModel, CLUSTER_FILE_SCHEMA)
    return ClusterFile(model=model, source=source)


def _job_class_noting_errors(job_class: Any, problems: list[Exception]) -> type:
    """Make a job class that adds errors of failed submissions to `problems`; Dask only logs them."""
    from distributed import Status

    class Noting(job_class):  # type: ignore[misc]
        async def start(self) -> None:
            try:
                await super().start()
            except (OSError, RuntimeError, ValueError) as error:
                problems.append(error.with_traceback(None))  # a traceback would keep the job alive
                self.status = Status.running

    return Noting


def _delete_tls_key_files(cluster: Any) -> None:
    """Delete the files of `security: true`. Dask would delete them only on garbage collection."""
    for key in ("ca_file", "cert", "key"):
        if file := getattr(cluster, f"_job_{key}", None):
            file.close()


def _cluster_class(kind: str) -> Any:
    """Return the class that starts clusters of this kind; MutatorError if its extra is not installed."""
    module, name = _CLUSTER_CLASSES[kind]
    original = signal.signal
    try:
        # importing dask_jobqueue sets a Ctrl-C handler, which fails in a thread
        signal.signal = lambda *_: None
        with requiring_extra(KUBERNETES if kind == KUBERNETES else "cluster"):
            return getattr(importlib.import_module(module), name)
    finally:
        signal.signal = original


def _parameter_names(cluster_class: type) -> Iterator[str]:
    for part in (*cluster_class.__mro__, *getattr(cluster_class, "job_cls", object).__mro__):
        if part.__module__.startswith(("dask_jobqueue", "dask_kubernetes")) and "__init__" in vars(part):
            yield from inspect.signature(part).parameters
