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
from selfdrive.sim.compare.maneuvers_page import ManeuverResult, render_maneuvers_page
from selfdrive.sim.compare.tolerances import Tolerances, load_tolerances
from selfdrive.sim.compare.trace_comparison import compare_trace
from selfdrive.sim.compare.trace_csv import ReferenceTrace, load_reference_trace
from selfdrive.sim.replay import TOLERANCES_PATH, list_reference_names
from selfdrive.sim.run import EXIT_INVALID_INPUT
from selfdrive.sim.scenario import PLANTS, STANDARD_PLANT, Scenario, with_plant


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    try:
        tolerances = load_tolerances(options.tolerances)
        referenced_names = [] if options.references is None else list_reference_names(options.references)
        scenarios = _load_scenarios(options, referenced_names)
        references = {
            name: load_reference_trace(options.references / f"{name}.csv")
            for name in scenarios
            if name in referenced_names
        }
        maneuvers = []
        for name, scenario in scenarios.items():
            print(f"{len(maneuvers) + 1}/{len(scenarios)} {name}", flush=True)
            maneuvers.append(
                _compare_with_reference(
                    finished_runs.simulate_run(name, scenario), references.get(name), tolerances
                )
            )
        path = _write_page(options.out, render_maneuvers_page(maneuvers, options.plant))
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    print(f"page: {path}")
    return 0


def _compare_with_reference(
    run: finished_runs.FinishedRun, reference: ReferenceTrace | None, tolerances: Tolerances
) -> ManeuverResult:
    if reference is None:
        return ManeuverResult(run=run, reference=None, comparison=None)
    comparison = compare_trace(reference, run.trace, tolerances, free_road=run.free_road)
    return ManeuverResult(run=run, reference=reference, comparison=comparison)


def _load_scenarios(options: argparse.Namespace, referenced_names: list[str]) -> dict[str, Scenario]:
    names = options.names or _list_run_names(options.scenarios, referenced_names)
    scenarios = {}
    for name in names:
        scenario = finished_runs.load_scenario_of_run(name, options.scenarios)
        try:
            scenarios[name] = with_plant(scenario, options.plant)
        except ConfigError as error:
            if options.names:
                raise
            print(f"left out: {error}")
    return scenarios


def _list_run_names(scenarios: Path, referenced_names: list[str]) -> list[str]:
    scenario_names = {path.stem for path in scenarios.glob("*.yaml")}
    if not scenario_names:
        raise ConfigError(
            "no scenario",
            where=str(scenarios),
            expected="a folder of scenario files",
            remedy="choose another --scenarios",
        )
    names_without_lead = {
        name for name in referenced_names if name.removesuffix(finished_runs.NO_LEAD_SUFFIX) in scenario_names
    }
    return sorted(scenario_names | names_without_lead, key=lambda name: (not name.startswith("S"), name))


def _write_page(folder: Path, text: str) -> Path:
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


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.maneuvers", description="Run all maneuvers and plot them on one page."
    )
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="a scenario, such as S1 or S1_nolead (default: all)")
    add("--out", type=Path, required=True, metavar="DIR", help="folder for index.html")
    add("--plant", choices=PLANTS, default=STANDARD_PLANT, help="the plant to run on (%(default)s)")
    add("--references", type=Path, metavar="DIR", help="reference traces as CSV, drawn beneath the runs")
    add(
        "--scenarios",
        type=Path,
        default=finished_runs.SCENARIOS_FOLDER,
        metavar="DIR",
        help="the scenario files",
    )
    add("--tolerances", type=Path, default=TOLERANCES_PATH, metavar="FILE", help="the tolerance table")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
