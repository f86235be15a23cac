"""The scene of a target as JSON, which a page draws."""

from dataclasses import asdict
from typing import Any

from mutator.targets.manifest import TargetManifest
from mutator.triggers.formula_json import JsonTree, formula_as_json


def scene_as_json(manifest: TargetManifest) -> dict[str, Any] | None:
    """Return the data that web/replay/scene.js draws; None if the target's manifest has no scene."""
    scene = manifest.scene
    if scene is None:
        return None
    channels = {channel.name for channel in manifest.channels}
    derived = {v.name: v.text for v in manifest.observation.derived if v.name not in channels}

    def expression_tree(text: str) -> JsonTree:
        return formula_as_json(text, derived)

    actors = [
        asdict(actor)
        | {key: expression_tree(getattr(actor, key)) for key in ("x", "y", "heading", "visible")}
        for actor in scene.actors
    ]
    lines = [asdict(line) | {"y": expression_tree(line.y) if line.y else None} for line in scene.lines]
    return {"actors": actors, "lines": lines, "follow": scene.follow, "speed": expression_tree(scene.speed)}
