"""Drive a sample of a run with another install, and compare the records with the run's.

    python benchmarks/other_install.py RUN OUT --python 3.14 --limit 340

RUN is a finished run folder of a campaign. The other install is a clone of this one at its commit, with an
environment of its own in the other Python and an empty cache, all below OUT. It plans the campaign of RUN
again, draws a sample in proportion, and drives it. A record has everything that an experiment ended with:
outcome, times, alerts, metrics and the digests of mutant and trace. Exit code 1 if one differs or is missing
from RUN. Needs `uv`; the same command goes on where it stopped.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

from mutator.store.run_folder import RunFolder

ROOT = Path(__file__).resolve().parents[1]


def install(python: str, out: Path) -> Path:
    """Clone and install below `out`, unless it is there; return the program `mutator`."""
    clone = out / "clone"
    program = clone / ".venv" / "bin" / "mutator"
    if not program.exists():
        if not clone.exists():
            subprocess.run(["git", "clone", "-q", "--no-hardlinks", str(ROOT), str(clone)], check=True)
        subprocess.run(["uv", "venv", "-q", "--clear", "--python", python, ".venv"], cwd=clone, check=True)
        packages = ["-c", "constraints.txt", "-e", "."]
        environment = os.environ | {"VIRTUAL_ENV": str(clone / ".venv")}
        subprocess.run(["uv", "pip", "install", "-q", *packages], cwd=clone, env=environment, check=True)
    return program


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--python", default="3.14")
    parser.add_argument("--limit", default="340", help="experiments to drive")
    parser.add_argument("--only", default="", metavar="EXPR", help="draw from the experiments that match")
    parser.add_argument("-n", "--workers", default="1")
    options = parser.parse_args()
    run, out = RunFolder.open(options.run), options.out.resolve()
    program = install(options.python, out)
    sample = out / "runs" / options.run.resolve().name
    command = [str(program), "run", str(run.path / "campaign.yaml"), "--reading", run.head.reading]
    command += ["--out", str(sample), "--limit", options.limit, "--proportional", "-n", options.workers]
    command += ["--no-stills", "--no-reuse", *(["--only", options.only] if options.only else [])]
    environment = os.environ | {"XDG_CACHE_HOME": str(out / "cache")}
    environment.pop("PYTHONPATH", None)
    subprocess.run(command, cwd=out / "clone", env=environment, check=True, stdout=subprocess.DEVNULL)
    folder = RunFolder.open(sample)
    records, others = run.records(), folder.records()
    equal = [name for name, record in others.items() if name in records and records[name] == record]
    pythons = ({each.python for each in of.session_environments} for of in (run, folder))
    here, there = (", ".join(sorted(names)) for names in pythons)
    print(f"{run.path.name}: {len(equal)} of {len(others)} records of {there} equal those of {here}")
    for name in sorted(set(others) - set(equal)):
        print(f"  {name}: {'another record' if name in records else 'not in the run'}")
    return 0 if others and len(equal) == len(others) else 1


if __name__ == "__main__":
    sys.exit(main())
