"""Build a synthetic finished run folder of any size, for other benchmarks to read.

`python benchmarks/made_up_run.py SIZE OUT`. The experiments are those of the paper's campaign without frames,
with as many seeds as needed. Golden runs are simulated. Records, patches, timings and series are a few
hundred real or synthetic ones, repeated under other ids. Checksums and digests match, so the folder opens and
has a seal.
"""

import argparse
import json
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from hashlib import sha256
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

import numpy as np
from growth import record

from mutator._common.hashing import canonical_json, digest
from mutator.audit.run_digests_and_seal import seals_of
from mutator.campaigns import run_environment
from mutator.campaigns.plan import SeedBySeedPlan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.campaigns.run_provenance import append_session_environment
from mutator.execution.single_run import run_golden
from mutator.model import Experiment, Record
from mutator.mutants.mutant_building import build
from mutator.outcomes.series_sampling import SeriesSampler
from mutator.outcomes.trace_and_record_loading import load_trace
from mutator.preflight import equivalence_check
from mutator.preflight.check_run_problems import output_digest_of
from mutator.store import file_digests, plan_file
from mutator.store.checks_file import CHECKS_FILE as CHECKS
from mutator.store.checks_file import CHECKS_SCHEMA
from mutator.store.checksummed_blocks import block_bytes
from mutator.store.file_digests import FileDigest
from mutator.store.golden_runs import GoldenRun
from mutator.store.packed_patches import _PatchPacker
from mutator.store.records import PROOF_FOLDER, RECORDS_SCHEMA, record_as_json
from mutator.store.run_folder import RunFolder
from mutator.store.series_format import encode_series
from mutator.store.series_script import script_name_of, write_script
from mutator.store.session_environments import SessionEnvironment
from mutator.store.time_series_folder import INDEX_NAME, SeriesIndex, save_index
from mutator.store.timings import TIMINGS_SCHEMA
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]
SEED = 11_280  # experiments of a seed
KINDS = 480  # different records, used in turn
PATCHES = 240  # different patches
SERIES, SERIES_MOST = 48, 150_000  # different series; experiments with a series, limited to fit 500 MB
WORKERS, PIECE = 2, 20  # number of files; consecutive experiments per file
_WHOLE_EVERY = 256  # the first of this many patches is stored whole, as in mutator.store.packed_patches
_NO_ID = "0" * 16


def make(size: int, out: Path) -> str:
    """Write the run folder `out` with that many experiments and return its seal."""
    workspace = Workspace.find(root=ROOT)
    folder = planned(workspace, size, out)
    first = tuple(islice(_experiments(folder), SEED))
    goldens(workspace, folder, first)
    ids = list(plan_file.experiment_ids(out))
    patches = patches_of(workspace, first)
    records = made_up_records(workspace, first)
    write_segments(folder, ids, records, patches)
    equivalence_check.mark_check_as_needed(out)
    write_proof(folder, ids, records, patches)
    write_series(workspace, folder, ids, first)
    append_session_environment(
        folder,
        SessionEnvironment(
            python=run_environment.python_version(),
            packages={
                name: version
                for name, version in run_environment.package_versions(
                    run_environment.required_packages()
                ).items()
                if version
            },
            platform="made up",
            records="0001-*",
        ),
    )
    file_digests.add_segments_to_ledger(out, finished=True)
    return seals_of(RunFolder(out)).seal or ""


def campaign(folder: Path, size: int) -> Path:
    """Write the paper's campaign without frames, with as many seeds as needed, into a folder."""
    text = (ROOT / "fault_library" / "campaigns" / "paper.yaml").read_text()
    for old, new in (
        ("[pictures, paper_detector]", "[]"),
        ("[pictures, coded_detector]", "[]"),
        ("name: paper\n", "name: million\n"),
        ("seed: 1\n", f"seeds: {{from: 1, to: {-(-size // SEED)}}}\n"),
    ):
        text = text.replace(old, new)
    path = folder / "million.yaml"
    path.write_text(text)
    return path


def planned(workspace: Workspace, size: int, out: Path) -> RunFolder:
    with TemporaryDirectory() as place:
        return freeze_plan(SeedBySeedPlan(workspace, campaign(Path(place), size)), out, workspace)


def _experiments(folder: RunFolder) -> Iterator[Experiment]:
    faults = plan_file.load_faults(folder.path)
    for chunk in folder.head.chunks:
        yield from plan_file.load_chunk(folder.path, chunk, faults)


def goldens(workspace: Workspace, folder: RunFolder, experiments: Sequence[Experiment]) -> None:
    """Simulate the golden runs of the first seed, copy them for the others, and record the checks as
    passed.
    """
    manifest, run = workspace.manifest(folder.head.target), folder.path
    known, driven = {}, dict[GoldenRun, Path]()
    for one in folder.golden_runs:
        like, place = one._replace(seed=None), folder.golden_folder(*one)
        place.parent.mkdir(exist_ok=True)
        if like in driven:
            shutil.copytree(driven[like], place)
        else:
            drives = (
                e
                for e in filter(None, (*experiments, folder.canary))
                if GoldenRun.for_experiment(e, several_seeds=False) == like
            )
            with TemporaryDirectory(dir=run) as scratch:
                limits = folder.limits
                found = run_golden(workspace, manifest, next(drives), Path(scratch) / "one", limits=limits)
                driven[like] = Path(shutil.move(found, place))
        known[one.key] = output_digest_of(manifest, place)
    checks = {"schema": CHECKS_SCHEMA, "digest": "", "results": [], "goldens": known}
    data = json.dumps(checks | {"packages": [], "run_cpu_s": 1.0}).encode()
    files = [path for path in (run / "golden").rglob("*") if path.is_file()]
    coming = {path.relative_to(run).as_posix(): FileDigest.of_bytes(path.read_bytes()) for path in files}
    with file_digests.announcing_rewrites(run, coming | {CHECKS: FileDigest.of_bytes(data)}):
        (run / CHECKS).write_bytes(data)


def patches_of(workspace: Workspace, experiments: Sequence[Experiment]) -> list[bytes]:
    manifest, models = workspace.manifest("openpilot"), workspace.fault_models()
    some = experiments[:: max(1, len(experiments) // PATCHES)][:PATCHES]
    return [build(manifest, models, one.fault, one.trigger).patch_bytes for one in some]


def made_up_records(workspace: Workspace, experiments: Sequence[Experiment]) -> list[Record]:
    """Return records with all fields, some fields or none."""
    draw = np.random.default_rng(1)
    names = [metric.name for metric in workspace.manifest("openpilot").all_metrics]
    step = max(1, len(experiments) // KINDS)
    found = []
    for number, experiment in enumerate(experiments[::step][:KINDS]):
        metrics = tuple(zip(names, map(float, draw.normal(10.0, 5.0, len(names))), strict=True))
        one = record(experiment, number)
        found.append(replace(one, experiment_id=_NO_ID, metrics=metrics, left=one.left[: 12 * (number % 3)]))
    return found


class Lines:
    """Writes checksummed lines from their bytes, many times faster than LineWriter."""

    def __init__(self, path: Path, head: dict[str, str]) -> None:
        path.parent.mkdir(exist_ok=True)
        self._file: BinaryIO = path.open("wb", buffering=1 << 20)
        self._last = b""
        self.write(canonical_json({**head, "file": f"{path.parent.name}/{path.name}"}).encode()[1:])

    def write(self, body: bytes) -> None:
        self._last = sha256(self._last + body).hexdigest()[:16].encode()
        self._file.write(b'{"sum":"%b",%b\n' % (self._last, body))

    def close(self) -> None:
        self._file.close()


def write_segments(
    folder: RunFolder, ids: Sequence[str], records: Sequence[Record], patches: Sequence[bytes]
) -> None:
    """Write records, timings and patches of all experiments, as two workers would."""
    lines = _bodies(records, patches)
    blocks = _blocks(patches)
    for worker in range(WORKERS):
        name = f"0001-gw{worker}"
        head = {"plan": folder.head.plan}
        record_lines = Lines(folder.path / "records" / f"{name}.jsonl", head | {"schema": RECORDS_SCHEMA})
        timing_lines = Lines(folder.path / "timings" / f"{name}.jsonl", head | {"schema": TIMINGS_SCHEMA})
        (folder.path / "patches").mkdir(exist_ok=True)
        with (folder.path / "patches" / f"{name}.blocks").open("wb", buffering=1 << 20) as packed:
            for count, number in enumerate(n for n in range(len(ids)) if n // PIECE % WORKERS == worker):
                of_patch = _patch_of(count, len(patches))
                kind, content = blocks[of_patch]
                packed.write(block_bytes(kind, ids[number], content))
                record_lines.write(lines[number % len(lines)](ids[number], of_patch))
                timing_lines.write(
                    b'"cpu_s":0.%03d,"engine":"forked","experiment_id":"%b","host":"made-up",'
                    b'"wall_s":0.%03d,"why":"","worker":"%b"}'
                    % (number % 997, ids[number].encode(), number % 991, name.encode())
                )
        record_lines.close()
        timing_lines.close()


def _patch_of(count: int, patches: int) -> int:
    """Return the index of an experiment's patch: 0 where a file stores a whole patch."""
    return count % patches if count % _WHOLE_EVERY else 0


def _blocks(patches: Sequence[bytes]) -> list[tuple[int, bytes]]:
    """Return the first patch whole, and the others as differences from it."""
    packer = _PatchPacker()
    return [packer.next_block(patch) for patch in patches]


def _bodies(records: Sequence[Record], patches: Sequence[bytes]) -> list[Callable[[str, int], bytes]]:
    named = [digest(patch).encode() for patch in patches]

    def body(one: Record) -> Callable[[str, int], bytes]:
        text = canonical_json(record_as_json(replace(one, patch="PATCH"))).encode()[1:]
        before, after = text.split(_NO_ID.encode())
        between, end = after.split(b"PATCH")
        return lambda name, patch: b"".join((before, name.encode(), between, named[patch], end))

    return [body(one) for one in records]


def write_proof(
    folder: RunFolder, ids: Sequence[str], records: Sequence[Record], patches: Sequence[bytes]
) -> None:
    """Write the sample of the equivalence check with the experiments' records."""
    lines = _bodies(records, patches)
    proof = Lines(
        folder.path / PROOF_FOLDER / "0001-gw0.jsonl",
        {"plan": folder.head.plan, "schema": RECORDS_SCHEMA},
    )
    wanted = set(equivalence_check.sample_ids_in_folder(folder))
    counts = [0] * WORKERS
    for number, name in enumerate(ids):
        worker = number // PIECE % WORKERS
        if name in wanted:
            proof.write(lines[number % len(lines)](name, _patch_of(counts[worker], len(patches))))
        counts[worker] += 1
    proof.close()


def write_series(
    workspace: Workspace, folder: RunFolder, ids: Sequence[str], experiments: Sequence[Experiment]
) -> None:
    """Write packed series: a few different ones, shared by the experiments that fit the budget."""
    manifest, place = workspace.manifest("openpilot"), folder.path / "series"
    place.mkdir()
    first = folder.golden_runs[0]
    golden = dict(load_trace(manifest, folder.golden_folder(*first)))
    sampler, draw = SeriesSampler(manifest, golden), np.random.default_rng(1)
    names = [channel.name for channel in manifest.compared_channels]
    made = [sampler.encoded_golden]
    for number in range(SERIES):
        change = {name: golden[name] + draw.normal(size=len(golden[name])).cumsum() / 100 for name in names}
        made.append(
            encode_series(
                sampler.faulty_series(
                    golden | change, record(experiments[number % len(experiments)], number)
                ),
                sampler.golden,
            )
        )
    data = b"".join(made)
    write_script(place / f"{script_name_of(data)}.js", data)
    key, kept = first.key, ids[:SERIES_MOST]
    index = SeriesIndex(
        plan=folder.head.plan,
        chunk_entry_counts=((script_name_of(data), len(made)),),
        entry_sizes=tuple(map(len, made)),
        entry_number_by_golden={key: 0},
        entry_number_by_experiment={name: 1 + number % SERIES for number, name in enumerate(kept)},
        golden_by_experiment=dict.fromkeys(kept, key),
        left_out_count=len(ids) - len(kept),
        budget_mb=500,
    )
    save_index(place / f"{INDEX_NAME}.js", index)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("size", type=int)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    print(make(options.size, options.out))
    return 0


if __name__ == "__main__":
    sys.exit(main())
