"""Fit thresholds of defences on half of the faults, and print what the fitted ones do on the other half.

`python benchmarks/fitted_defences.py [--limit N] [-n N] [--out DIR]`. The faults of `paper_defended` are
halved by location, radar and camera together being one of their own; a seed draws which. On the first half, N
experiments are driven with each value of each threshold. A value's score is the number of injurious hazards
that it prevents or leaves open, less those that it causes. The value of the highest score is driven on N
experiments of the other half, beside the shipped one.
"""

import argparse
import random
import re
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import mutator  # noqa: E402
from mutator.comparison.defended_pairs import PairOutcome  # noqa: E402
from mutator.comparison.defended_sets import DefendedSet, load_defended_sets  # noqa: E402
from mutator.review.patch_shapes import location_label  # noqa: E402
from mutator.store.run_folder import RunFolder  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

CAMPAIGN = "paper_defended"
SEED = 1  # draws the halves
INJURIOUS = ("S1", "S2", "S3")
# defence -> the threshold that is fitted, and its values; the first is the shipped one
THRESHOLDS = {
    "aeb_r157_own_sensor": ("delay_s", (0.35, 0.7, 1.05, 1.4)),
    "limits_opendbc": ("acceleration_limit", (2.0, 1.5, 1.0, 0.5)),
}


def halves(specs: dict[str, set[str]]) -> tuple[list[str], list[str]]:
    """Halve specs, given with their locations: those at the same location stay together."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for spec, locations in sorted(specs.items()):
        groups.setdefault(tuple(sorted(locations)), []).append(spec)
    drawn = random.Random(SEED).sample(sorted(groups), len(groups))
    first: list[str] = []
    second: list[str] = []
    for place in drawn:
        (first if len(first) <= len(second) else second).extend(groups[place])
    return sorted(first), sorted(second)


def variant_name(defence: str, value: float) -> str:
    return f"{defence}_{value:g}".replace(".", "_")


def write_variant(library: Path, defence: str, value: float) -> None:
    """Write the defence with another threshold beside the shipped one."""
    parameter, (shipped, *_) = THRESHOLDS[defence]
    text = (library / "defences" / f"{defence}.yaml").read_text()
    name = variant_name(defence, value)
    text = text.replace(f"name: {defence}\n", f"name: {name}\n")
    old, new = (f"{parameter}: {{value: {number}," for number in (shipped, value))
    if text.count(old) != 1:
        raise SystemExit(f"{defence}: no {old!r}: correct THRESHOLDS")
    (library / "defences" / f"{name}.yaml").write_text(text.replace(old, new))


def write_campaign(library: Path, name: str, specs: Sequence[str], defences: Sequence[str]) -> None:
    """Write the campaign with these faults and defences only."""
    text = (
        (library / "campaigns" / f"{CAMPAIGN}.yaml").read_text().replace(f"name: {CAMPAIGN}", f"name: {name}")
    )
    faults = "".join(f"  - spec: {spec}\n" for spec in specs)
    sets = "".join(f"  - {defence}\n" for defence in defences)
    text = re.sub(r"^faults:\n(  .*\n)+", f"faults:\n{faults}", text, flags=re.MULTILINE)
    text = re.sub(r"^defences:\n(  .*\n)+", f"defences:\n{sets}", text, flags=re.MULTILINE)
    (library / "campaigns" / f"{name}.yaml").write_text(text)


def score(defended: DefendedSet) -> int:
    avoided = defended.select(PairOutcome.PREVENTED, PairOutcome.OPEN)
    caused = defended.select(PairOutcome.CAUSED)
    return sum(pair.undefended.severity in INJURIOUS for pair in avoided) - sum(
        pair.defended.severity in INJURIOUS for pair in caused
    )


def print_sets(sets: Sequence[DefendedSet]) -> None:
    for defended in sets:
        counts = defended.count_by_outcome
        figures = ", ".join(f"{outcome} {counts[outcome]}" for outcome in PairOutcome if counts[outcome])
        goldens = ", ".join(defended.false_goldens) or "none"
        print(
            f"  {defended.name}: score {score(defended)}; {figures}; acts in golden runs: {goldens}",
            flush=True,
        )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=int, default=200, metavar="N")
    parser.add_argument("-n", type=int, default=0, metavar="N", dest="workers")
    parser.add_argument("--out", type=Path, metavar="DIR", help="a new folder; default: a temporary one")
    options = parser.parse_args()
    out = options.out or Path(tempfile.mkdtemp())
    library = out / "fault_library"
    shutil.copytree(ROOT / "fault_library", library, dirs_exist_ok=True)
    for defence, (_, values) in THRESHOLDS.items():
        for value in values:
            write_variant(library, defence, value)
    workspace = Workspace.find(library=library, templates=ROOT / "templates", target=ROOT / "target")
    specs: dict[str, set[str]] = {}
    for experiment in mutator.plan(CAMPAIGN, workspace=workspace).experiments:
        places = (location_label(injection.location) for injection in experiment.fault.injections)
        specs.setdefault(experiment.fault.spec, set()).update(places)

    def drive(name: str, faults: Sequence[str], defences: Sequence[str]) -> tuple[DefendedSet, ...]:
        write_campaign(library, name, faults, defences)
        choices = mutator.Choices(limit=options.limit, proportional=True)
        mutator.run(name, out / name, choices=choices, workers=options.workers, workspace=workspace)
        sets = load_defended_sets(RunFolder.open(out / name))
        print(f"{name}, {sets[0].undefended.folder.head.experiments} experiments of {', '.join(faults)}:")
        print_sets(sets)
        return sets

    first, second = halves(specs)
    variants = {d: [variant_name(d, value) for value in values] for d, (_, values) in THRESHOLDS.items()}
    fitted = drive("fitted_on", first, [name for names in variants.values() for name in names])
    scores = {defended.name: score(defended) for defended in fitted}
    chosen = {defence: max(names, key=scores.__getitem__) for defence, names in variants.items()}
    print(f"chosen: {', '.join(chosen.values())} (of equal ones, that nearest to the shipped)")
    compared = dict.fromkeys(name for d, names in variants.items() for name in (names[0], chosen[d]))
    drive("tried_on", second, list(compared))
    return 0


if __name__ == "__main__":
    sys.exit(main())
