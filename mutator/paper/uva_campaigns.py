"""Campaigns for imported fault files: one for each condition and setting."""

import re
from collections.abc import Container, Sequence

from mutator._common.hashing import digest
from mutator.config.yaml_writing import yaml_text

TARGET, CODED_READING = "openpilot", "as_coded"
_SCENARIO = "S1"  # 60 mph, 100 m behind a lead of 40 mph, as in the authors' test
_CANARY = {"spec": "vision_output/path_model/both", "scenario": _SCENARIO, "hazard": "H3", "at_s": 7.0}
_LIMITS = {"cpu_s": 120, "wall_s": 600, "memory_mb": 4096, "steps": 6000}
_WORDS = {">=": "from", "<=": "to", ">": "after", "<": "before", "-": "minus "}
_MOST_NAME_CHARACTERS = 100
_DIGEST_CHARACTERS = 8


def campaign_name(when: str, setting: Sequence[str], names_in_use: Container[str]) -> str:
    """Return a name that says when: `uva_hwt_from_0_and_hwt_to_2`. It ends in a digest if the plain name is
    in use or too long.
    """
    text = re.sub(r">=|<=|>|<|-", lambda match: _WORDS[match[0]], when or "always")
    name = "uva_" + re.sub(r"[^a-z0-9]+", "_", text) + "_pictures" * ("pictures" in setting)
    if name not in names_in_use and len(name) <= _MOST_NAME_CHARACTERS:
        return name
    suffix = "_" + digest("\n".join((when, *setting)).encode())[:_DIGEST_CHARACTERS]
    return name[: _MOST_NAME_CHARACTERS - len(suffix)].rstrip("_") + suffix


def campaign_text(name: str, when: str, setting: Sequence[str], variants: Sequence[str]) -> str:
    data = {
        "schema": "campaign/1",
        "name": name,
        "about": f"Imported faults that are active {f'while {when}' if when else 'all the time'}.",
        "target": TARGET,
        "scenarios": [_SCENARIO],
        "setting": list(setting),
        "faults": [{"spec": variant} for variant in variants],
        "reading": CODED_READING,
        "methods": ["guided"],
        "triggers": {"list": [{"when": when} if when else "always"], "armed_after_s": 0.0},
        "seed": 1,
        "canary": _CANARY,
        "limits": _LIMITS,
        "chunk": 8,
    }
    return yaml_text({key: value for key, value in data.items() if value != []})
