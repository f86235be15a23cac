"""A complete run.json of a run that nobody planned, for tests that need only a part of it."""

from typing import Any

from mutator.limits import Limits
from mutator.store.plan_choices import Choices
from mutator.store.run_head import RUN_SCHEMA, Provenance, RunHead

HEAD = RunHead(
    schema=RUN_SCHEMA,
    plan="ab" * 32,
    campaign="made_up",
    campaign_digest="ef" * 32,
    study=None,
    target="openpilot",
    seed=7,
    reading="as_described",
    choices=Choices(),
    experiments=3,
    runs=2,
    limits=Limits(),
    hazards=("H1", "H2", "H3"),
    alerts=("fcw",),
    compared=(),
    metrics=(),
    about_hazards=(),
    severity=None,
    channels=(),
    structure=None,
    golden_files=("trace.npz", "record.json"),
    target_files={},
    goldens=(),
    canary={},
    canary_hazard="H1",
    sources={"target": "cd" * 32},
    provenance=Provenance(mutator="0.2.0"),
    stretches=(),
    chunks=(),
)


def made_head(**changes: object) -> dict[str, Any]:
    """Return the content of run.json with some keys changed."""
    return HEAD.as_json() | changes
