"""`checks.json`: its name and schema, and what it has only if a run needs it."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path

from mutator._common.files import read_json
from mutator.engines.run_limits import LIMITS_THAT_ARE_MEASURED
from mutator.errors import MutatorError
from mutator.limits import MOST_LIMIT_OR_TIME, Limits, MeasuredLimits

CHECKS_SCHEMA = "checks/1"
CHECKS_FILE = "checks.json"
CHECKED_GOLDENS_KEY = "checked"  # of a bench: what each golden run's checks gave, with its CPU time
MEASURED_LIMITS_KEY = "measured_limits"
UNPACKAGED_MODULES_KEY = "modules_without_package"
GOLDEN_HAZARDS_KEY = "golden_hazards"

HazardTimes = tuple[tuple[str, float], ...]  # (hazard, first time in s), by time


def limits_of_run(run: Path, campaign_limits: Limits) -> Limits:
    """Return the limits of the faulty runs in the folder `run`: the campaign's, or those that its checks
    measured.
    """
    path = run / CHECKS_FILE
    measured = read_json(path, CHECKS_SCHEMA).get(MEASURED_LIMITS_KEY) if path.is_file() else None
    if measured is None:
        return campaign_limits
    if (
        not isinstance(measured, dict)
        or measured.keys() != LIMITS_THAT_ARE_MEASURED
        or not all(type(limit) is int and 1 <= limit <= MOST_LIMIT_OR_TIME for limit in measured.values())
    ):
        raise MutatorError(
            f"damaged at '{MEASURED_LIMITS_KEY}' ({measured!r})",
            where=path,
            expected=f"whole numbers of s: {', '.join(sorted(LIMITS_THAT_ARE_MEASURED))}",
            remedy="restore the file from a copy of the run folder",
        )
    return MeasuredLimits(**asdict(campaign_limits) | measured)


def measured_limits_as_json(limits: Limits) -> dict[str, dict[str, int]]:
    """Return what checks.json stores of limits: nothing, if they are the campaign's own."""
    if not isinstance(limits, MeasuredLimits):
        return {}
    return {MEASURED_LIMITS_KEY: {name: getattr(limits, name) for name in sorted(LIMITS_THAT_ARE_MEASURED)}}


def unpackaged_modules_as_json(modules: Iterable[str]) -> dict[str, list[str]]:
    """Return what checks.json stores of modules that golden runs loaded and no package provides: nothing, if
    there are none.
    """
    names = sorted({*modules})
    return {UNPACKAGED_MODULES_KEY: names} if names else {}


def golden_hazards_of_run(run: Path) -> dict[str, HazardTimes]:
    """Return the hazards of each golden run that has some, by its key; none if the checks have not run."""
    path = run / CHECKS_FILE
    stored = read_json(path, CHECKS_SCHEMA).get(GOLDEN_HAZARDS_KEY, {}) if path.is_file() else {}
    try:
        return {
            str(key): tuple((str(name), float(time)) for name, time in hazards)
            for key, hazards in stored.items()
        }
    except (AttributeError, TypeError, ValueError):
        raise MutatorError(
            f"damaged at '{GOLDEN_HAZARDS_KEY}' ({stored!r})",
            where=path,
            expected="hazards and times by golden run",
            remedy="restore the file from a copy of the run folder",
        ) from None


def golden_hazards_as_json(hazards_by_key: Mapping[str, HazardTimes]) -> dict[str, dict[str, HazardTimes]]:
    """Return what checks.json stores of golden runs that have a hazard: nothing, if none has."""
    some = {key: hazards for key, hazards in hazards_by_key.items() if hazards}
    return {GOLDEN_HAZARDS_KEY: some} if some else {}


def describe_golden_hazards(hazards: HazardTimes) -> str:
    """Return the first hazard of a golden run, and how many follow: `NEAR at 12.34 s, and 1 more`."""
    name, time = hazards[0]
    more = f", and {len(hazards) - 1} more" if len(hazards) > 1 else ""
    return f"{name} at {time:.2f} s{more}"
