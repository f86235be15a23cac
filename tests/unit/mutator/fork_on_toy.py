"""A fork engine on the toy target, for tests."""

import shutil
from collections.abc import Callable
from pathlib import Path

from mutator.engines.engine_jobs import MOST_WAITING_PROCESSES, Job, JobResult
from mutator.engines.fork_engine import ForkEngine
from mutator.engines.fork_server_processes import ForkServer
from mutator.limits import Limits
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection, Trigger
from mutator.mutants.mutant_building import build
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

Edit = Callable[[str, str, str], None]
LIMITS = Limits(cpu_s=20, wall_s=60, memory_mb=1024, steps=500)


class Fork:
    """A fork engine that is created on first use, so that a test can edit the toy's files first."""

    def __init__(self, toy: Workspace, folder: Path) -> None:
        self.toy = toy
        self.folder = folder
        self.limits = LIMITS
        self.most_waiting_processes = MOST_WAITING_PROCESSES
        self._engine: ForkEngine | None = None

    @property
    def engine(self) -> ForkEngine:
        if self._engine is None:
            self.manifest: TargetManifest = self.toy.manifest("toycar")
            self.models = self.toy.fault_models()
            work = self.folder / "work"
            work.mkdir()
            null = build(self.manifest, self.models, None, always_trigger())
            self._engine = ForkEngine(
                self.manifest,
                work,
                self.limits,
                null_mutant=null,
                most_waiting_processes=self.most_waiting_processes,
            )
            golden = Job(name="golden", scenario=self.toy.scenario("A"), seed=7)
            self.golden = self._engine.reference.execute(golden, self.folder / "golden").out
        return self._engine

    def fault(self, anchor: str = "gap", function: str = "Sensor.sense") -> Fault:
        place = FaultLocation(
            path="toycar/sensing.py",
            function=function,
            anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name=anchor),
        )
        injection = Injection(location=place, model="offset", params=(("by", 20.0), ("target", anchor)))
        return Fault("s", "m", "f", "as_described", None, "", "H1", (injection,))

    def job(self, trigger: Trigger, anchor: str = "gap", function: str = "Sensor.sense") -> Job:
        _ = self.engine
        built = build(self.manifest, self.models, self.fault(anchor, function), trigger)
        scenario = self.toy.scenario("A")
        return Job(
            name="j",
            scenario=scenario,
            seed=7,
            changed_files=built.files,
            mutant_id=built.id,
            probe_source=built.probe_source,
            injection_ids=built.injection_ids,
            golden_folder=self.golden,
        )

    def run(self, job: Job) -> JobResult:
        folder = self.folder / "work" / "job"
        try:
            return self.engine.execute(job, folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    @property
    def pool(self) -> ForkServer:
        pool = self.engine._server
        assert pool is not None
        return pool

    def processes(self) -> list[int]:
        """Return the ids of the processes whose command lines name this engine's folder."""
        return sorted(int(path.name) for path in Path("/proc").glob("[0-9]*") if self._is_ours(path))

    def _is_ours(self, path: Path) -> bool:
        try:
            return str(self.folder).encode() in (path / "cmdline").read_bytes()
        except OSError:
            return False

    def close(self) -> None:
        if self._engine is not None:
            self._engine.close()
