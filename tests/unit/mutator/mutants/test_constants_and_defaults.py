"""Constants and defaults that faults change during a run."""

import sys
import types
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from mutator.model import Anchor, AnchorKind, FaultLocation, Hold, Trigger
from mutator.mutants import probe_contract as contract
from mutator.targets.observed_values import Observation
from mutator.workspace import Workspace
from tests.unit.mutator.mutants.changed_constants import PLACES, at, mutant


@pytest.fixture
def load(clone: Workspace) -> Iterator[Callable[..., tuple[Any, Any]]]:
    """Load the module with injections at the given locations. Return the module and its probe, whose trigger
    is active from 1 s to 3 s."""
    names = ("_fi", "fixed_values_m")

    def load_mutant(*locations: FaultLocation) -> tuple[Any, Any]:
        nowhere = FaultLocation(path="", function="f", anchor=Anchor(kind=AnchorKind.ENTRY))
        observation = Observation(location=nowhere, time="t", values=(), derived=())
        trigger = Trigger(name="test", condition="t >= 1 and t < 3")
        settings = contract.build_probe_settings(
            "m", trigger, Hold.WHILE, ("a", "b"), observation, 1.0, sets=True
        )
        probe, module = (types.ModuleType(name) for name in names)
        models = clone.fault_models()
        exec(contract.render_probe(models.probe_templates, settings).text, vars(probe))
        sys.modules |= {"_fi": probe, names[1]: module}
        exec(compile(mutant(clone, *locations), "m.py", "exec", dont_inherit=True), vars(module))
        return module, probe

    yield load_mutant
    for name in names:
        sys.modules.pop(name, None)


@pytest.mark.parametrize("place", PLACES)
def test_a_fixed_value_changes_while_the_fault_is_active(
    load: Callable[..., tuple[Any, Any]], place: str
) -> None:
    location, value = PLACES[place]
    module, fi = load(location)
    original, changes = value(module), []
    for t in (0, 1, 2, 3, 4, 0, 1, 2, 0):
        fi.observe(t=float(t))
        changes.append(value(module) - original)
    assert changes == [0, 10, 10, 0, 0, 0, 10, 10, 0]
    fi.observe(t=1.0)
    assert fi.report()["injections"]["a"] == {"first": 1.0, "last": 1.0, "count": 1}


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Hidden.w", "Hiding, the metaclass of Hidden, keeps the value where it cannot be set"),
        ("Frozen.r", "Frozen keeps a copy of r in a mappingproxy, where it cannot be set"),
        ("Paired.s", "Paired keeps a copy of s in a tuple, where it cannot be set"),
        ("Instance.t", "Instance is no class at run time, but of type Instance"),
    ],
)
def test_a_value_that_cannot_be_set_is_reported(
    load: Callable[..., tuple[Any, Any]], name: str, reason: str
) -> None:
    """The fault is never counted as active, no part of it is set, and the report says why."""
    module, fi = load(at(name))
    owner, _, key = name.partition(".")
    original = getattr(getattr(module, owner), key, None)
    fi.observe(t=1.0)
    report = fi.report()
    assert getattr(getattr(module, owner), key, None) == original
    assert report["injections"]["a"]["count"] == 0
    assert report["unset"] == {"a": reason}


def test_tables_of_other_classes_and_other_dicts_stay(load: Callable[..., tuple[Any, Any]]) -> None:
    """Only copies change: not an equal value of another class, nor a dict with other keys than the fields."""
    module, fi = load(at("Listed.n"), at("Apart.u"))
    fi.observe(t=1.0)
    assert (module.Listed.n, module.Apart.u) == (11.0, 11.0)
    assert module.Beside.defaults == module.ALL_DEFAULTS["Beside"] == {"n": 1.0}
    assert module.Below.n == 11.0
    assert module.Apart.MODES == {"u": 1.0, "fast": 2.0}
