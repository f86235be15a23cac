"""The mutant that counts how often statements execute, without changing what the target does.

A statement is counted exactly when a fault there would be active if the fault's trigger always held.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from mutator.faults.fault_models import FaultModel, FaultModels, SnippetKind
from mutator.model import Fault, FaultLocation, Injection
from mutator.mutants.mutant_building import Mutant, build
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger

_COUNTING_MODEL = "count_only"


def build_counting_mutant(
    manifest: TargetManifest, models: FaultModels, locations: Iterable[FaultLocation]
) -> tuple[Mutant, Mapping[str, FaultLocation]]:
    """Return the mutant that counts at all these places, and the location of each injection id."""
    once = list(dict.fromkeys(locations))
    injections = tuple(Injection(location=location, model=_COUNTING_MODEL) for location in once)
    fault = Fault(
        _COUNTING_MODEL, _COUNTING_MODEL, _COUNTING_MODEL, _COUNTING_MODEL, None, "", "", injections
    )
    mutant = build(manifest, _with_counting_model(models), fault, always_trigger())
    return mutant, dict(zip(mutant.injection_ids, once, strict=True))


def _with_counting_model(models: FaultModels) -> FaultModels:
    some = next(iter(models))
    count = FaultModel(
        name=_COUNTING_MODEL,
        kind=SnippetKind.INSERT,
        about="counts",
        params=(),
        examples=(),
        template='_fi.active("{{ fi }}")\n',
        expression_template="{{ original }}",
        source=some.source,
        template_path=some.template_path,
    )
    return replace(models, models={**models.models, _COUNTING_MODEL: count})
