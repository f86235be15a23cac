"""What the faults of a group do, in words."""

from collections.abc import Collection, Iterable

from mutator.campaigns.phrase_collection import phrases_of_models, phrases_of_variants
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec
from mutator.model import Fault
from mutator.results.fault_phrases import describe_fault
from mutator.targets.stored_phrases import Phrases


def descriptions_of_faults(
    faults: Collection[Fault], specs: Iterable[FaultSpec], models: FaultModels
) -> tuple[str, ...]:
    """Return what each fault does, once: the phrase of its spec or fault model, or its label."""
    loaded = list(specs)
    model_phrases = phrases_of_models(models, {i.model for fault in faults for i in fault.injections})
    phrases_by_reading = {
        reading: Phrases(
            faults=phrases_of_variants(loaded, {fault.spec for fault in faults}, reading),
            models=model_phrases,
        )
        for reading in {fault.reading for fault in faults}
    }
    return tuple(dict.fromkeys(describe_fault(fault, phrases_by_reading[fault.reading]) for fault in faults))
