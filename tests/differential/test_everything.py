"""The engines agree on a campaign with every anchor, every fault model and every operator."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator.execution.campaign_running import run_campaign
from mutator.model import AnchorKind
from mutator.workspace import Workspace

TABLES = ("results.csv", "results.parquet", "propagation.parquet")
SENSE = {"file": "toycar/sensing.py", "function": "Sensor.sense"}
PUBLISH = {"file": "toycar/sensing.py", "function": "Sensor.publish"}
DRIVE = {"file": "toycar/driver.py", "function": "Driver.drive"}
GAP, OFFSET = SENSE | {"after_assign": "gap"}, SENSE | {"assigned_value": "offset"}
WANTED = {"model": "offset", "unit": "1", "params": {"by": 1.5}}

# A fault for each anchor, then one for each model that these do not use.
FAULTS: list[dict[str, Any]] = [
    {"at": GAP, "model": "offset", "unit": "m", "params": {"by_m": 30}},
    {"at": SENSE | {"before_assign": "offset"}, "model": "scale", "params": {"target": "gap", "factor": 1.5}},
    {
        "at": SENSE | {"after_call": "self.publish"},
        "model": "stuck",
        "unit": "m",
        "params": {"target": "gap"},
    },
    {"at": SENSE | {"before_call": "self.publish"}, "model": "omission"},
    {
        "at": DRIVE | {"before_return": ""},
        "model": "offset",
        "unit": "1",
        "params": {"target": "gas", "by": 0.5},
    },
    {
        "at": PUBLISH | {"entry": True},
        "model": "sign_flip",
        "params": {"target": "self.reading"},
    },
    {
        "at": SENSE | {"assigned_value": "closing"},
        "model": "drift",
        "unit": "mps",
        "params": {"per_step_mps": 0.1},
    },
    {"at": DRIVE | {"return_value": ""}, "model": "delay", "params": {"delay_s": 0.5}},
    {"at": DRIVE | {"condition": "speed > 30.0"}, "model": "wrong_branch", "params": {"holds": "never"}},
    {"at": DRIVE | {"argument": "max", "which": 1, "nth": 1}, **WANTED},
    {"at": DRIVE | {"result": "max", "nth": 2}, "model": "stale", "params": {"steps": 7}},
    {"at": DRIVE | {"value": "1.5 * speed"}, **WANTED},
    {"at": {"file": "toycar/driver.py", "constant": "GAIN"}, "model": "scale", "params": {"factor": -1.0}},
    {"at": DRIVE | {"default": "least"}, **WANTED},
    {"at": OFFSET, "model": "bit_flip", "params": {"bit": 62}},
    {"at": OFFSET, "model": "noise", "unit": "m", "params": {"std_m": 0.3}},
    {"at": OFFSET, "model": "clamp", "unit": "m", "params": {"high_m": 0.01}},
    {"at": OFFSET, "model": "quantise", "unit": "m", "params": {"step_m": 0.5}},
    {
        "at": OFFSET,
        "model": "waveform",
        "unit": "m",
        "params": {"by_m": 0.5, "shape": "pulses", "period_s": 0.5, "width_s": 0.1},
    },
    {"at": OFFSET, "model": "nan"},
    {"at": OFFSET, "model": "infinity", "params": {"negative": True}},
    {"at": OFFSET, "model": "none"},
    {"at": OFFSET, "model": "unit_mix_up", "params": {"written_in": "deg", "read_as": "rad"}},
    {"at": OFFSET, "model": "byte_corruption", "params": {"index": 0, "mask": 255}},
    {"at": GAP, "model": "exception", "params": {"error": "ValueError"}},
    {"at": SENSE | {"before_assign": "closing"}, "model": "reordering"},
    {"at": SENSE | {"after_call": "self.publish"}, "model": "repetition"},
    {"at": DRIVE | {"result": "min", "nth": 1}, "model": "slow_call", "params": {"duration_s": 0.4}},
    {
        "at": DRIVE | {"result": "min", "nth": 2},
        "model": "swapped_arguments",
        "params": {"first": 1, "second": 2},
    },
    {
        "at": SENSE | {"after_assign": "closing"},
        "model": "ghost_object",
        "params": {"distance_name": "gap", "speed_name": "closing", "distance_m": 9, "speed_mps": -1},
    },
    {
        "at": GAP,
        "model": "image_effect",
        "unit": "m",
        "params": {"effect": "toycar.haze.Haze", "amount_m": 20, "camera": "self", "scene": "world"},
    },
    {
        "at": GAP,
        "model": "offset",
        "unit": "m",
        "params": {"by_m": 30},
        "where": "world.speed > 18.0",
        "every": 3,
    },
    {"at": GAP, "model": "offset", "unit": "m", "params": {"by_m": 30}, "call": 2},
]


@pytest.fixture
def everything(tmp_path: Path, copy_toycar: Callable[[Path], Workspace]) -> Workspace:
    toy = copy_toycar(tmp_path)
    driver = toy.library.parent / "tree" / "toycar" / "driver.py"
    text = driver.read_text().replace("0.4 *", "GAIN *").replace("reading):", "reading, least=0.0):")
    driver.write_text(
        text.replace("max(wanted / 3.0, 0.0)", "max(wanted / 3.0, least)").replace(
            "\n\n\nclass Driver", "\n\nGAIN = 0.4\n\n\nclass Driver"
        )
    )
    variants = {
        f"v{number}": {
            "aim": "H1",
            "about": "One of every kind.",
            "as_described": {"injections": [fault]},
        }
        for number, fault in enumerate(FAULTS)
    }
    spec = {
        "schema": "fault_spec/1",
        "module": "every",
        "fault_type": "kind",
        "about": "All.",
        "variants": variants,
    }
    folder = toy.library / "faults" / "every"
    folder.mkdir()
    (folder / "kind.yaml").write_text(json.dumps(spec))
    campaign = yaml.safe_load((toy.library / "campaigns" / "toy.yaml").read_text())
    del campaign["sample"]
    operators = {
        "operators": list(OPERATOR_DOOR.shipped_names()),
        "in": ["toycar/sensing.py", "toycar/driver.py"],
        "sample": 40,
    }
    campaign |= {
        "name": "everything",
        "scenarios": ["A"],
        "faults": [{"spec": "every/*"}, operators],
        "methods": ["random"],
    }
    campaign["triggers"] = {
        "list": ["always"],
        "random_until_s": 5.5,
        "hold_s": 1.0,
        "armed_after_s": campaign["triggers"]["armed_after_s"],
    }
    (toy.library / "campaigns" / "everything.yaml").write_text(json.dumps(campaign))
    return Workspace(library=toy.library, templates=toy.templates)


def test_the_campaign_has_every_anchor_and_model(everything: Workspace) -> None:
    anchors = {kind for kind in AnchorKind for fault in FAULTS if kind.value in fault["at"]}
    assert anchors == set(AnchorKind)
    # operators have faults of their own, and the toy has no messages
    others = ("operator_", "message_")
    shipped = {model.name for model in everything.fault_models() if not model.name.startswith(others)}
    own = {path.stem for path in (Path(__file__).parents[1] / "toy" / "templates").glob("*.yaml")}
    assert {fault["model"] for fault in FAULTS} == shipped - own


@pytest.mark.slow
def test_engines_agree_on_everything(everything: Workspace, tmp_path: Path) -> None:
    tables = {}
    for engine in ("reference", "warm", "fork"):
        out = tmp_path / engine
        summary = run_campaign(everything, "everything", out, engine=engine, workers=2)
        assert (summary.exit_code, summary.problem) == (0, ""), engine
        assert summary.done == len(FAULTS) + 2 * 40
        assert summary.proof is None or summary.proof.same == summary.proof.sampled
        tables[engine] = {name: (out / name).read_bytes() for name in TABLES}
    assert tables["reference"] == tables["warm"] == tables["fork"]
