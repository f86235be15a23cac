"""Compare the undefended run of a campaign with defences with a run of the campaign that has none.

`python benchmarks/undefended.py [--experiments N] [--defences NAME ...] [-n N]`. The campaign is a sample of
`paper_defended`, with the named sets, without a store. The two runs must have the same records, traces'
digests among them, the same runs of their proofs, tables and golden runs, byte for byte. Exit code 1 if
something differs.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import mutator
from mutator.config.yaml_files import load_yaml
from mutator.config.yaml_writing import yaml_text

ROOT = Path(__file__).resolve().parents[1]
TABLES = ("results.csv", "plan.csv")


def write_campaign(file: Path, changes: dict[str, object]) -> Path:
    """Write `paper_defended` with other sets or without; return the file."""
    shipped = dict(load_yaml(ROOT / "fault_library" / "campaigns" / "paper_defended.yaml").data)
    del shipped["defences"]
    file.write_text(yaml_text(shipped | changes))
    return file


def differing(here: dict[str, bytes], there: dict[str, bytes]) -> list[str]:
    return sorted(name for name in here.keys() | there.keys() if here.get(name) != there.get(name))


def record_lines(run: Path, kind: str) -> dict[str, bytes]:
    """Return the line of each record by experiment, without its checksum, which covers the lines before it.

    The order of lines is that of arrival.
    """
    lines = [line for file in (run / kind).glob("*.jsonl") for line in file.read_bytes().splitlines()]
    parsed = [(json.loads(line), line.partition(b'",')[2]) for line in lines]
    return {data["experiment_id"]: text for data, text in parsed if "experiment_id" in data}


def golden_files(run: Path) -> dict[str, bytes]:
    return {str(path.relative_to(run)): path.read_bytes() for path in (run / "golden").rglob("*.npz")}


READERS: dict[str, Callable[[Path], dict[str, bytes]]] = {
    "records": lambda run: record_lines(run, "records"),
    "records of the proof": lambda run: record_lines(run, "proof"),
    "tables": lambda run: {name: (run / name).read_bytes() for name in TABLES},
    "golden traces": golden_files,
}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--experiments", type=int, default=400)
    parser.add_argument("--defences", nargs="+", default=["aeb_r157_own_sensor"])
    parser.add_argument("-n", "--workers", type=int, default=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        runs = []
        for name, sets in (("with", {"defences": ["none", *options.defences]}), ("without", {})):
            (Path(folder) / name).mkdir()
            campaign = write_campaign(
                Path(folder) / name / "campaign.yaml", {"sample": options.experiments} | sets
            )
            runs.append(Path(folder) / name / "run")
            mutator.run(campaign, runs[-1], workers=options.workers, reuse=False)
        here, there = ({kind: read(run) for kind, read in READERS.items()} for run in runs)
    wrong = 0
    for kind in READERS:
        names = differing(here[kind], there[kind])
        wrong += bool(names) or not here[kind]
        print(f"{kind}: {len(there[kind]) - len(names)} of {len(there[kind])} equal {' '.join(names[:3])}")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
