"""The data on a target's scene in a page."""

from collections.abc import Iterator

from mutator.targets.overhead_view_json import scene_as_json
from mutator.triggers.formula_json import JsonTree
from mutator.workspace import Workspace


def names(tree: JsonTree) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, list):
        for part in tree[1:]:
            yield from names(part)


def test_the_shipped_scene_uses_channels_of_the_target() -> None:
    manifest = Workspace.find().manifest("openpilot")
    scene = scene_as_json(manifest)
    assert scene is not None
    trees = [actor[key] for actor in scene["actors"] for key in ("x", "y", "heading", "visible")]
    used = {name for tree in (*trees, scene["speed"]) for name in names(tree)}
    assert {"d_rel", "v_ego", "lateral_offset"} <= used <= {channel.name for channel in manifest.channels}
    [followed] = [actor for actor in scene["actors"] if actor["name"] == scene["follow"]]
    assert followed["visible"] is True
