"""Count how often a value passes from one module of the harness to another.

`python benchmarks/ways.py [--against CLONE] [--pairs]`. Runs three commands on the toy target and watches
every call and return in the harness:

* a fault's value, on its way into the diff of a mutant (`mutator diff --value`)
* the id of an experiment that is shown (`mutator show`)
* the place in which operators choose mutants (`mutator generate --operators --in`)

A hop is a call or a return from one module to another, in which an argument or the result contains the value:
itself, in a text, or in a record or a container. Calls within a module are not counted, nor what
child processes do. CLONE is a checkout of another version.
"""

import argparse
import ast
import dataclasses
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
VALUE, PLACE = "2.4140625", "toycar/sens*.py"  # occur nowhere else
DEEPEST = 6  # records in each other
MOST = 50  # elements of a container that are looked at
Hops = Counter[tuple[str, str]]


class Watch:
    """Counts the hops of `value` while it is the profiler."""

    def __init__(self, value: str) -> None:
        self._text = value
        self._number = ast.literal_eval(value) if value.replace(".", "").isdecimal() else None
        self.hops: Hops = Counter()

    def __call__(self, frame: FrameType, event: str, result: Any) -> None:
        if event not in ("call", "return"):
            return
        here = module_of(frame)
        there = module_of(frame.f_back)
        if not here or not there or here == there:
            return
        if event == "call":
            code = frame.f_code
            names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
            passed = any(self._is_in(frame.f_locals.get(name)) for name in names if name != "self")
            self.hops[there, here] += passed
        else:
            self.hops[here, there] += self._is_in(result)

    def _is_in(self, found: Any, depth: int = 0) -> bool:
        if isinstance(found, str):
            return self._text in found
        if isinstance(found, bytes):
            return self._text.encode() in found
        if isinstance(found, int | float):
            return self._number is not None and found == self._number
        if depth == DEEPEST:
            return False
        if isinstance(found, Mapping):
            inner = [*list(found)[:MOST], *list(found.values())[:MOST]]
        elif isinstance(found, list | tuple | set | frozenset):
            inner = list(found)[:MOST]
        elif dataclasses.is_dataclass(found):
            inner = [getattr(found, field.name, None) for field in dataclasses.fields(found)]
        else:
            return False
        return any(self._is_in(one, depth + 1) for one in inner)


def module_of(frame: FrameType | None) -> str:
    name = frame.f_globals.get("__name__", "") if frame else ""
    return name if name.startswith("mutator.") else ""


def watched(value: str, words: list[str]) -> None:
    """Run a command in this process, and print its hops on the last line."""
    from mutator.cli.app import main

    watch = Watch(value)
    sys.setprofile(watch)
    try:
        code = main(words)
    finally:
        sys.setprofile(None)
    print("\n" + json.dumps([[*pair, count] for pair, count in watch.hops.items() if count]))
    sys.exit(code)


def hops(clone: Path, value: str, words: list[str]) -> Hops:
    output = run(clone, [__file__, "--watch", value, *words])
    return Counter({(one, other): count for one, other, count in json.loads(output.splitlines()[-1])})


def run(clone: Path, words: list[str]) -> str:
    env = os.environ | {"PYTHONPATH": str(clone)}
    command = [sys.executable, "-P", *words]
    done = subprocess.run(command, env=env, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout


def ways(clone: Path) -> dict[str, Hops]:
    """Return the hops of each value, in the version in `clone`."""
    with tempfile.TemporaryDirectory() as place:
        for folder in ("tests/toy", "templates"):
            into = Path(place, "toy", "templates" if folder == "templates" else "")
            shutil.copytree(clone / folder, into, dirs_exist_ok=True)
        toy = ["--root", f"{place}/toy"]
        folder = f"{place}/run"
        run(clone, ["-m", "mutator", "run", "small", *toy, "--out", folder, "--limit", "1", "-n", "0"])
        shown = json.loads(run(clone, ["-m", "mutator", "show", *toy, "--run", folder, "--json"]))
        name = shown["worst"][0]["experiment"]
        place_words = ["--operators", "arithmetic", "--in", PLACE, "--all-lines", "--out", f"{place}/out"]
        return {
            "a fault's value": hops(clone, VALUE, ["diff", "sensor/lane", *toy, "--value", VALUE]),
            "an experiment's id": hops(clone, name, ["show", name, *toy, "--run", folder]),
            "operators' place": hops(clone, PLACE, ["generate", *place_words, *toy]),
        }


def describe(name: str, found: Hops, *, pairs: bool) -> None:
    modules = {module for pair in found for module in pair}
    print(f"{name}: {found.total()} hops between {len(modules)} modules, {len(found)} pairs")
    entered: Counter[str] = Counter()
    for (_, other), count in found.items():
        entered[other] += count
    [(module, count)] = entered.most_common(1)
    print(f"  most often into {module}: {count}")
    for (one, other), count in found.most_common(None if pairs else 0):
        print(f"  {count:5} {one} -> {other}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--against", type=Path, metavar="CLONE", help="also count in another version")
    parser.add_argument("--pairs", action="store_true", help="list every pair of modules")
    parser.add_argument("--watch", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.watch:
        watched(options.watch[0], options.watch[1:])
    versions = {"this version": ROOT} | ({"the other": options.against.resolve()} if options.against else {})
    for version, clone in versions.items():
        print(f"{version}:")
        for name, found in ways(clone).items():
            describe(name, found, pairs=options.pairs)


if __name__ == "__main__":
    main()
