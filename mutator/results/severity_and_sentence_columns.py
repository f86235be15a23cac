"""The columns of the results table that say how severe an experiment was, and those that its sentence needs:
times to the hazard, the first change of an actuator, and the car's speed.
"""

from functools import partial

from mutator.outcomes.verdict_rules import (
    manifestation_to_hazard_time,
    missing_severity_reason,
    time_to_hazard,
)
from mutator.results.finished_experiments_and_columns import FinishedExperiment, ResultColumn, rounded_time
from mutator.targets.stored_phrases import (
    FIRST_CHANGE_SHARE,
    GOLDEN_HIGHEST_SPEED,
    GOLDEN_LOWEST_SPEED,
    HIGHEST_SPEED,
    LOWEST_SPEED,
    SPEED_AT_ACTIVATION,
)


def _speed_cell(name: str, finished: FinishedExperiment) -> float | None:
    return dict(finished.record.speeds).get(name)


SEVERITY_COLUMN = ResultColumn(
    "severity",
    "text",
    "",
    "highest severity class of a hazard in the drive; empty without a class",
    lambda f: f.classified.severity if f.classified else None,
)
CLASSIFIED_HAZARD_COLUMNS = (
    ResultColumn(
        "severity_hazard",
        "text",
        "",
        "the hazard that has this class; of several, the first",
        lambda f: f.classified.hazard if f.classified else None,
    ),
    ResultColumn(
        "no_severity",
        "text",
        "",
        "why no hazard has a class; empty with a class, and without a hazard",
        lambda f: missing_severity_reason(f.record, f.severity_scale),
    ),
)
TIME_TO_HAZARD_COLUMNS = (
    ResultColumn(
        "time_to_hazard",
        "number",
        "s",
        "time from the activation to the first hazard, also if the fault had ended by then",
        lambda f: rounded_time(time_to_hazard(f.record)),
    ),
    ResultColumn(
        "manifest_to_hazard",
        "number",
        "s",
        "time from the manifestation to the first hazard; empty if the hazard came first",
        lambda f: rounded_time(manifestation_to_hazard_time(f.record)),
    ),
)
FIRST_CHANGE_COLUMNS = (
    ResultColumn(
        "first_actuator",
        "text",
        "",
        "the actuator output that first differed from golden; of several, the manifest's first",
        lambda f: f.record.first_change[0] if f.record.first_change else None,
    ),
    ResultColumn(
        "first_change",
        "text",
        "",
        "whether it was then `higher` or `lower` than in the golden run, or `no_number` (NaN)",
        lambda f: f.record.first_change[1] if f.record.first_change else None,
    ),
    ResultColumn(
        FIRST_CHANGE_SHARE,
        "number",
        "",
        "how much of its deviation from golden had this direction, from 0 to 1: of the areas between both "
        "runs up to the first hazard, or to the end of the drive",
        lambda f: f.record.first_change_share,
    ),
)
SPEED_COLUMNS = tuple(
    ResultColumn(name, "number", "m/s", about, partial(_speed_cell, name))
    for name, about in (
        (SPEED_AT_ACTIVATION, "the car's speed at the activation"),
        (
            HIGHEST_SPEED,
            "its highest speed from the activation to the first hazard, or to the end of the drive",
        ),
        (LOWEST_SPEED, "its lowest speed in this time"),
        (GOLDEN_HIGHEST_SPEED, "the highest speed of the golden run in this time"),
        (GOLDEN_LOWEST_SPEED, "the lowest speed of the golden run in this time"),
    )
)


def severity_and_time_columns(*, has_classes: bool) -> tuple[ResultColumn, ...]:
    """Return the columns of a target whose hazards can have classes of severity, or have none."""
    severity = (SEVERITY_COLUMN, *CLASSIFIED_HAZARD_COLUMNS) if has_classes else ()
    return (*severity, *TIME_TO_HAZARD_COLUMNS)
