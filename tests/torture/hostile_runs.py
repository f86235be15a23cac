"""What somebody can put into a run folder that he sends: links, names, special files, programs."""

import json
import os
import shutil
import socket
import stat
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.files import json_bytes
from mutator._common.hashing import digest
from mutator.store import file_digests
from mutator.store.file_digests import FileDigest
from mutator.store.time_series_folder import SeriesIndex, save_index
from tests.made_up_results import edit_results

UP = "../../home/mine"  # from a run folder to the user's files


@dataclass(frozen=True, slots=True)
class Sent:
    """A run folder from elsewhere, next to the user's files in `home`, which contains a tree of files."""

    run: Path
    home: Path
    experiment: str

    @property
    def ran(self) -> Path:
        """The file that planted code would write."""
        return self.home / "ran"


Trick = Callable[[Sent], None]

LINKED = (  # what becomes a link to a file or a folder of the user
    *("run.json", "digests.json", "campaign.yaml", "plan.csv", "checks.json", "owner.lock", "results.csv"),
    *("results.parquet", "results.json", "report/REPORT.md", "report/index.html", ".results.csv.4711"),
    *("plan/experiments.jsonl", "records/9999-x.jsonl", "patches/9999-x.blocks", "series/9999-x.blocks"),
    *("series/index.js", "workers/4711", "plots/{id}.svg", "plots/{id}-1.00s.jpg", "exports/junit.xml"),
    *("plan/", "golden/", "golden/A/", "records/", "proof/", "timings/", "patches/", "series/", "report/"),
    *("series/kept/", "report/tables/", "report/figures/", "report/compare-other/", "plots/", "exports/"),
    *("exports/mcap/", "traces/", "traces/{id}/", "traces/{id}/faulty/", "work/", "damaged/", "workers/"),
)
NOT_FILES = ("results.csv", "results.json", "report/index.html", "plots/{id}.svg", "plots/{id}-1.00s.jpg")
NOT_FILES += ("checks.json", "owner.lock", ".results.csv.1", "exports/junit.xml", "records/9999-x.jsonl")
NOT_FILES += ("series/index.js", "patches/9999-x.blocks", "run.json", "campaign.yaml", "reviewed.json")
NOT_FOLDERS = ("report", "work", "series", "traces", "plots", "exports", "workers", "damaged", "records")
NOT_FOLDERS += ("golden", "golden/A", "traces/{id}", "report/tables", "series/kept", "exports/mcap", "proof")
SPECIAL = ("records/9999-x.jsonl", "results.csv", "plots/{id}.svg", "series/9999-x.blocks", "workers/1")
NAMES = (UP, "/{home}/mine", "golden/A/../../../../home/mine", "a\0b", "", ".", "golden/A/", "work/x")
ODD_NAMES = (b"a\nb", b"\xe2\x80\xaegpj.exe", b"\xff\xfe", b"\x1b[2J", b"x" * 255, "الله".encode(), b" ")
PROGRAMS = ("json", "numpy", "sitecustomize", "usercustomize", "conftest", "yaml", "setup", "matplotlib")
LARGE = ("results.csv", "plots/{id}-1.00s.jpg", "records/9999-x.jsonl", "checks.json", "series/index.js")


def tricks() -> Mapping[str, Trick]:
    found: dict[str, Trick] = {}
    for name in LINKED:
        found[f"{name} is a link"] = _linked(name)
    for name in NOT_FILES:
        found[f"{name} is a folder"] = _replaced(name, _folder)
    for name in NOT_FOLDERS:
        found[f"{name} is a file"] = _replaced(name, lambda path, sent: path.write_bytes(b"x"))
    for name in SPECIAL:
        found[f"{name} is a pipe"] = _replaced(name, lambda path, sent: os.mkfifo(path))
        found[f"{name} is a socket"] = _replaced(name, _socket)
        found[f"{name} is a device"] = _replaced(name, _device)
    for name in ("owner.lock", "results.csv", "records/9999-x.jsonl", "digests.json"):
        found[f"{name} is also a file of the user"] = _replaced(name, _shared)
    for name in LARGE:
        found[f"{name} is sparse"] = _replaced(name, lambda path, sent: _sparse(path))
    for name in NAMES:
        found[f"the ledger names {name!a}"] = _in_ledger("files", name)
        found[f"the ledger announces {name!a}"] = _in_ledger("rewriting", name)
    for name in ODD_NAMES:
        found[f"a file is named {name!a}"] = _named(name)
    for key, value in HEADS.items():
        found[f"run.json has {key} {value!a}"] = _in_head(key, value)
    return found | {one.__name__.strip("_").replace("_", " "): one for one in OTHERS}


def _filled(name: str, sent: Sent) -> str:
    return name.replace("{id}", sent.experiment).replace("/{home}", str(sent.home))


def _free(sent: Sent, name: str) -> Path:
    path = sent.run / _filled(name, sent).rstrip("/")
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _linked(name: str) -> Trick:
    def link(sent: Sent) -> None:
        path = _free(sent, name)
        path.symlink_to(sent.home / "tree" if name.endswith("/") else sent.home / "mine")

    return link


def _replaced(name: str, make: Callable[[Path, Sent], object]) -> Trick:
    return lambda sent: (make(_free(sent, name), sent), None)[1]


def _folder(path: Path, sent: Sent) -> None:
    path.mkdir()
    (path / "x").write_bytes(b"x")


def _socket(path: Path, sent: Sent) -> None:
    here = os.open(path.parent, os.O_RDONLY)
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(f"/proc/self/fd/{here}/{path.name}")  # a socket's path is limited in length
    os.close(here)


def _device(path: Path, sent: Sent) -> None:
    """The device without an end, if this user may make one."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 5))
    except OSError:
        os.mkfifo(path)


def _shared(path: Path, sent: Sent) -> None:
    path.hardlink_to(sent.home / "mine")


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 40)


def _named(name: bytes) -> Trick:
    def put(sent: Sent) -> None:
        for folder in ("", "plots", "golden/A", "records"):
            (sent.run / folder).mkdir(exist_ok=True)
            (sent.run / folder / os.fsdecode(name)).write_bytes(b"x")

    return put


def _reseal(run: Path) -> None:
    """Recompute the digests of the files that the ledger has."""
    path = run / file_digests.DIGESTS_FILE
    data = json.loads(path.read_bytes())
    for name, one in data["files"].items():
        content = (run / name).read_bytes() if (run / name).is_file() else None
        if content is not None:
            one |= {"size": len(content), "sha256": digest(content)}
    _write_ledger(path, data)


def _write_ledger(path: Path, data: dict[str, Any]) -> None:
    data.pop("sum", None)
    path.write_bytes(json_bytes({"schema": data["schema"], "sum": digest(data), **data}))


def _in_ledger(key: str, name: str) -> Trick:
    def put(sent: Sent) -> None:
        path = sent.run / file_digests.DIGESTS_FILE
        data = json.loads(path.read_bytes())
        mine = FileDigest.of_bytes((sent.home / "mine").read_bytes())
        data[key][_filled(name, sent)] = {"size": mine.size, "sha256": mine.sha256}
        _write_ledger(path, data)

    return put


HEADS: dict[str, Any] = {
    "target": "/{home}/evil.yaml",
    "goldens": [["../../../home/tree", []], ["/{home}/scenario.yaml", []]],
    "golden_files": [UP, "/{home}/mine"],
    "campaign": UP,
    "study": UP,
    "plan": UP,
    "hazards": [UP],
    "compared": [UP, "\x1b[2J"],
    "choices": {"shard": "1/1", "series_mb": -1, "reading": UP},
    "chunks": [[-1, 1 << 40, 1]],
    "experiments": 10**30,
    "seeds": [0, 10**12],
    "stretches": "records",
    "metrics": [[UP, UP, UP, UP]],
    "channels": [[UP, "s", UP, UP, UP]],
    "structure": {UP: UP},
    "severity": {"name": UP, "about": UP, "source": UP, "classes": [[UP]]},
    "limits": {"cpu_s": -1, "wall_s": 10**30},
    "canary": {"fault": {}},
    "target_files": {UP: UP},
    "schema": "run/2",
}


def _in_head(key: str, value: Any) -> Trick:
    def put(sent: Sent) -> None:
        path = sent.run / "run.json"
        data = json.loads(path.read_bytes())
        if key == "stretches":
            for one in data["stretches"]:
                one["records"] = f"../{UP}*"
        else:
            data[key] = json.loads(_filled(json.dumps(value), sent))
        path.write_bytes(json_bytes(data))
        _reseal(sent.run)

    return put


def _all_names_in_other_case(sent: Sent) -> None:
    for path in list(sent.run.iterdir()):
        place = path.with_name(path.name.swapcase())
        shutil.copytree(path, place) if path.is_dir() else shutil.copy(path, place)


def _programs(sent: Sent) -> None:
    code = f"open({str(sent.ran)!r}, 'a').write(__name__)\n"
    for folder in (sent.run, sent.run / "golden", sent.run / "report", sent.run / "work"):
        folder.mkdir(exist_ok=True)
        for name in PROGRAMS:
            (folder / f"{name}.py").write_text(code)
        (folder / "x.pth").write_text(f"import os; {code}")


def _settings(sent: Sent) -> None:
    config = f"[core]\n\tfsmonitor = touch {sent.ran}\n\thooksPath = hooks\n"
    for name, text in {
        ".git/config": config,
        ".git/HEAD": "ref: refs/heads/main\n",
        ".git/hooks/post-checkout": f"#!/bin/sh\ntouch {sent.ran}\n",
        "pytest.ini": "[pytest]\naddopts = --no-such-option\n",
        "pyproject.toml": "[tool.pytest.ini_options]\naddopts = '--no-such-option'\n",
        "matplotlibrc": "figure.figsize: 1, 1\n",
        ".bashrc": f"touch {sent.ran}\n",
        "fault_library/targets/evil.yaml": "schema: target/9\n",
    }.items():
        (sent.run / name).parent.mkdir(parents=True, exist_ok=True)
        (sent.run / name).write_text(text)
        (sent.run / name).chmod(0o755)


def _deep_folders(sent: Sent) -> None:
    for folder in ("report", "plots", "traces", "work", "golden", "x"):
        (sent.run / folder).mkdir(exist_ok=True)
        here = os.open(sent.run / folder, os.O_RDONLY)
        for _ in range(1200):
            os.mkdir("d", dir_fd=here)
            below = os.open("d", os.O_RDONLY, dir_fd=here)
            os.close(here)
            here = below
        os.close(here)


def _many_files(sent: Sent) -> None:
    for folder in ("plots", "records", "workers"):
        (sent.run / folder).mkdir(exist_ok=True)
        for number in range(3000):
            (sent.run / folder / f"{number}.jsonl").touch()


def _an_index_of_series_with_a_name_outside(sent: Sent) -> None:
    (sent.run / "series").mkdir(exist_ok=True)
    index = SeriesIndex(
        plan=json.loads((sent.run / "run.json").read_bytes())["plan"],
        chunk_entry_counts=((f"../{UP}", 2),),
        entry_sizes=(4, 4),
        entry_number_by_golden={f"../{UP}": 0},
        entry_number_by_experiment={sent.experiment: 1},
        golden_by_experiment={sent.experiment: f"../{UP}"},
        left_out_count=0,
        budget_mb=1,
    )
    save_index(sent.run / "series" / "index.js", index)


def _an_experiment_with_a_name_outside(sent: Sent) -> None:
    for name in ("plan/experiments.jsonl", *_lines_of(sent.run)):
        path = sent.run / name
        path.write_bytes(path.read_bytes().replace(sent.experiment.encode(), f"../{UP}".encode()))
    _reseal(sent.run)


def _results_with_a_name_outside(sent: Sent) -> None:
    """The tables are not in the ledger; their stamp says that they are up to date."""
    edit_results(sent.run, sent.experiment, f"../{UP}")
    stamp = sent.run / "results.json"
    data = json.loads(stamp.read_bytes())
    for name in ("results.csv", "results.parquet"):
        data["tables"][name] = digest((sent.run / name).read_bytes())
    stamp.write_bytes(json_bytes(data))


def _scenarios_that_are_paths(sent: Sent) -> None:
    path = sent.run / "plan" / "experiments.jsonl"
    evil = json.dumps(str(sent.home / "scenario.yaml"))
    path.write_bytes(path.read_bytes().replace(b'"scenario":"A"', f'"scenario":{evil}'.encode()))
    _reseal(sent.run)


def _checks_of_any_shape(sent: Sent) -> None:
    (sent.run / "checks.json").write_bytes(json_bytes({"schema": "checks/1", "goldens": 3, "results": UP}))
    _reseal(sent.run)


def _approvals_of_any_shape(sent: Sent) -> None:
    (sent.run / "reviewed.json").write_bytes(json_bytes({"schema": "reviewed/1", "groups": [UP]}))
    ledger = json.loads((sent.run / file_digests.DIGESTS_FILE).read_bytes())
    ledger["files"]["reviewed.json"] = {"size": 0, "sha256": ""}
    _write_ledger(sent.run / file_digests.DIGESTS_FILE, ledger)
    _reseal(sent.run)


def _a_report_whose_stamp_names_files_outside(sent: Sent) -> None:
    path = sent.run / "report" / "made_from.json"
    path.parent.mkdir(exist_ok=True)
    files = {f"../../{UP}": "", str(sent.home / "mine"): "", f"report/../../{UP}": ""}
    path.write_bytes(json_bytes({"schema": "report/1", "made_from": "", "files": files}))


def _old_patches_outside(sent: Sent) -> None:
    (sent.run / "patches" / "..").mkdir(exist_ok=True)
    for path in (sent.run / "patches").glob("*.blocks"):
        path.unlink()


def _lines_of(run: Path) -> list[str]:
    kinds = ("records", "timings", "proof")
    return [path.relative_to(run).as_posix() for kind in kinds for path in (run / kind).glob("*.jsonl")]


OTHERS: tuple[Trick, ...] = (
    *(_all_names_in_other_case, _programs, _settings, _deep_folders, _many_files),
    *(_an_index_of_series_with_a_name_outside, _an_experiment_with_a_name_outside),
    *(_results_with_a_name_outside, _scenarios_that_are_paths, _checks_of_any_shape),
    *(_approvals_of_any_shape, _a_report_whose_stamp_names_files_outside, _old_patches_outside),
)
TRICKS = tricks()
