"""Runs all maneuvers and plots them on one page: `python -m selfdrive.sim.maneuvers --out DIR [NAME...]`.

Writes DIR/index.html, which is self-contained. With --references, the page also shows reference traces, and
which runs are within tolerance. Exit code 2 for invalid input.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from selfdrive.common.errors import ConfigError
from selfdrive.sim.compare import finished_runs
from selfdrive.sim.compare.maneuvers_page import Maneuver, page
from selfdrive.sim.compare.tolerances import Tolerances, load_tolerances
from selfdrive.sim.compare.trace_comparison import compare
from selfdrive.sim.compare.trace_csv import Reference, read_reference
from selfdrive.sim.replay import TOLERANCES, reference_names
from selfdrive.sim.run import EXIT_INPUT
from selfdrive.sim.scenario import PLANTS, STANDARD, Scenario, on_plant


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse(arguments)
    try:
        tolerances = load_tolerances(options.tolerances)
        known = [] if options.references is None else reference_names(options.references)
        scenarios = _scenarios(options, known)
        references = {
            name: read_reference(options.references / f"{name}.csv") for name in scenarios if name in known
        }
        maneuvers = []
        for name, scenario in scenarios.items():
            print(f"{len(maneuvers) + 1}/{len(scenarios)} {name}", flush=True)
            maneuvers.append(_maneuver(finished_runs.drive(name, scenario), references.get(name), tolerances))
        path = _write(options.out, page(maneuvers, options.plant))
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INPUT
    print(f"page: {path}")
    return 0


def _maneuver(run: finished_runs.Run, reference: Reference | None, tolerances: Tolerances) -> Maneuver:
    if reference is None:
        return Maneuver(run=run, reference=None, comparison=None)
    comparison = compare(reference, run.trace, tolerances, free_road=run.free_road)
    return Maneuver(run=run, reference=reference, comparison=comparison)


def _scenarios(options: argparse.Namespace, known: list[str]) -> dict[str, Scenario]:
    names = options.names or _all_names(options.scenarios, known)
    scenarios = {}
    for name in names:
        scenario = finished_runs.find(name, options.scenarios)
        try:
            scenarios[name] = on_plant(scenario, options.plant)
        except ConfigError as error:
            if options.names:
                raise
            print(f"left out: {error}")
    return scenarios


def _all_names(scenarios: Path, known: list[str]) -> list[str]:
    found = {path.stem for path in scenarios.glob("*.yaml")}
    if not found:
        raise ConfigError(
            "no scenario",
            where=str(scenarios),
            expected="a folder of scenario files",
            remedy="choose another --scenarios",
        )
    variants = {name for name in known if name.removesuffix(finished_runs.NO_LEAD) in found}
    return sorted(found | variants, key=lambda name: (not name.startswith("S"), name))


def _write(folder: Path, text: str) -> Path:
    path = folder / "index.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(
            str(error.strerror),
            where=str(folder),
            expected="a writable folder",
            remedy="choose another --out",
        ) from None
    return path


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.maneuvers", description="Run all maneuvers and plot them on one page."
    )
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="a scenario, such as S1 or S1_nolead (default: all)")
    add("--out", type=Path, required=True, metavar="DIR", help="folder for index.html")
    add("--plant", choices=PLANTS, default=STANDARD, help="the plant to run on (%(default)s)")
    add("--references", type=Path, metavar="DIR", help="reference traces as CSV, drawn beneath the runs")
    add("--scenarios", type=Path, default=finished_runs.SCENARIOS, metavar="DIR", help="the scenario files")
    add("--tolerances", type=Path, default=TOLERANCES, metavar="FILE", help="the tolerance table")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
