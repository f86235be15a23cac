"""A small function with an injection, which runs step by step with the probe."""

import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mutator.model import Anchor, FaultLocation, Hold, Injection, Trigger, Value
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.probe_contract import build_probe_settings, render_probe
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, unsplice
from mutator.triggers.conditions import canonical_condition
from mutator.workspace import Workspace

STEP_S = 0.1
WithFault = Callable[..., "FaultyFunction"]


class FaultyFunction:
    """A function `f` with one injection. `names` are its globals."""

    def __init__(self, clone: Workspace, source: str, anchor: Anchor, model: str, **params: Value) -> None:
        models = clone.fault_models()
        file = parse_file("m.py", source.encode(), Path("root"))
        place = FaultLocation(path="m.py", function="f", anchor=anchor)
        injection = Injection(location=place, model=model, params=tuple(sorted(params.items())))
        data = mutated_bytes(
            apply_edits(file, as_line_edits(file, [injection_edit(file, models, injection, "ab12")]))
        )
        assert unsplice(data) == file.data
        trigger = Trigger(name="test", condition=canonical_condition("rs > 0"))
        observation = clone.manifest("openpilot").observation
        settings = build_probe_settings("m", trigger, Hold.WHILE, ("ab12",), observation, STEP_S)
        self.text = data.decode()
        self.probe: Any = types.ModuleType("_fi")
        exec(render_probe(models.probe_templates, settings).text, vars(self.probe))
        self.names: dict[str, Any] = {"_fi": self.probe}
        exec(self.text, self.names)
        self.steps = 0

    def run(self, marks: str, *arguments: Any) -> list[Any]:
        """Return the result of `f` in each step. The fault is active in steps marked `x`. Each argument is a
        function that returns the value to pass."""
        results = []
        for mark in marks:
            lead = 15.0 if mark == "x" else 20.0
            self.steps += 1
            self.probe.observe(t=self.steps * STEP_S, d_rel=40.0, v_ego=20.0, v_lead=lead)
            results.append(self.names["f"](*(argument() for argument in arguments)))
        return results


def counting() -> Callable[[], int]:
    calls: list[None] = []

    def count() -> int:
        calls.append(None)
        return len(calls)

    return count
