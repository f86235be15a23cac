"""Compares runs with reference traces: `python -m selfdrive.sim.replay --references DIR [NAME...]`.

Each CSV in the folder (or each named one) is compared by channel with a run of its scenario on the reference
plant. Exit code 0 within tolerance, 1 otherwise, 2 for invalid input. References are written only with
--update-references.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from selfdrive.common.errors import ConfigError
from selfdrive.sim.compare import comparison_text, finished_runs
from selfdrive.sim.compare.tolerances import load_tolerances
from selfdrive.sim.compare.trace_comparison import compare_trace
from selfdrive.sim.compare.trace_csv import load_reference_trace, save_reference_trace
from selfdrive.sim.run import EXIT_INVALID_INPUT
from selfdrive.sim.scenario import PLANTS, REFERENCE_PLANT, with_plant

EXIT_BEYOND_TOLERANCE = 1

TOLERANCES_PATH = finished_runs.SCENARIOS_FOLDER.parent / "references" / "tolerances.yaml"


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    try:
        if options.update_references:
            return _update_references(options)
        return _compare_with_references(options)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT


def list_reference_names(folder: Path) -> list[str]:
    """The names of the references in a folder. Raises ConfigError if there are none."""
    names = sorted(path.stem for path in folder.glob("*.csv"))
    if not names:
        raise ConfigError(
            "no reference" if folder.is_dir() else "no such folder",
            where=str(folder),
            expected="a folder of CSV traces",
            remedy="choose another --references, or name runs and give --update-references",
        )
    return names


def _compare_with_references(options: argparse.Namespace) -> int:
    tolerances = load_tolerances(options.tolerances)
    names = options.names or list_reference_names(options.references)
    references = [load_reference_trace(options.references / f"{name}.csv") for name in names]
    beyond = []
    for reference, run in zip(references, _load_or_simulate_runs(names, options), strict=True):
        result = compare_trace(reference, run.trace, tolerances, free_road=run.free_road)
        print("\n".join(comparison_text.comparison_lines(result, all_channels=options.long)), flush=True)
        if not result.is_within_tolerance:
            beyond.append(reference.name)
    print(f"{len(references) - len(beyond)} of {len(references)} within tolerance", end="")
    print(f"; beyond it: {', '.join(beyond)}" if beyond else "")
    return EXIT_BEYOND_TOLERANCE if beyond else 0


def _update_references(options: argparse.Namespace) -> int:
    names = options.names or list_reference_names(options.references)
    for run in _load_or_simulate_runs(names, options):
        path = options.references / f"{run.name}.csv"
        save_reference_trace(path, run.trace)
        print(f"written: {path}")
    return 0


def _load_or_simulate_runs(
    names: list[str], options: argparse.Namespace
) -> Iterator[finished_runs.FinishedRun]:
    if options.runs is not None:
        yield from (finished_runs.load_run(options.runs / name, options.plant) for name in names)
        return
    scenarios = [
        with_plant(finished_runs.load_scenario_of_run(name, options.scenarios), options.plant)
        for name in names
    ]
    yield from map(finished_runs.simulate_run, names, scenarios)


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.replay", description="Compare runs with reference traces."
    )
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="a reference, such as S1 or S1_nolead (default: all)")
    add("--references", type=Path, required=True, metavar="DIR", help="the references' CSV files")
    add(
        "--scenarios",
        type=Path,
        default=finished_runs.SCENARIOS_FOLDER,
        metavar="DIR",
        help="the scenario files",
    )
    add("--tolerances", type=Path, default=TOLERANCES_PATH, metavar="FILE", help="the tolerance table")
    add("--plant", choices=PLANTS, default=REFERENCE_PLANT, help="the plant to run on (%(default)s)")
    add("--runs", type=Path, metavar="DIR", help="compare the finished runs DIR/NAME/ instead of running")
    add("--long", action="store_true", help="print all channels, and all crossings of tolerances")
    add("--update-references", action="store_true", help="write the runs as the new references")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
