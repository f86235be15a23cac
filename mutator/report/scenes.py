"""The scene of a target, as data for the page: sizes, and formulas as trees over the channels of a series."""

from dataclasses import asdict
from typing import Any

from mutator.targets.manifest import TargetManifest
from mutator.triggers.trees import Tree, tree


def scene_facts(manifest: TargetManifest) -> dict[str, Any] | None:
    """Return the data that web/replay/scene.js draws; None if the target's manifest has no scene."""
    scene = manifest.scene
    if scene is None:
        return None
    channels = {channel.name for channel in manifest.channels}
    derived = {v.name: v.text for v in manifest.observation.derived if v.name not in channels}

    def made(text: str) -> Tree:
        return tree(text, derived)

    actors = [
        asdict(actor) | {key: made(getattr(actor, key)) for key in ("x", "y", "heading", "visible")}
        for actor in scene.actors
    ]
    lines = [asdict(line) | {"y": made(line.y) if line.y else None} for line in scene.lines]
    return {"actors": actors, "lines": lines, "follow": scene.follow, "speed": made(scene.speed)}
