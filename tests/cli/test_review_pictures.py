"""`review show --pictures` writes the frames of an image effect as files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from mutator.workspace import Workspace


def test_written_frames_are_listed(
    cli: Callable[..., Any], root: Path, toy: Workspace, tmp_path: Path, give_eyes: Callable[..., None]
) -> None:
    give_eyes(toy, values="[10, 50]")
    groups = {group["model"]: group["group"] for group in cli("review", "--json").json}
    light, silent = groups["image_effect"], groups["omission"]
    answer = cli("review", "show", light, silent, "--pictures", tmp_path / "out", "--json")
    shown = {group["group"]: group["pictures"] for group in answer.json}
    names = ("before", "least", "most")
    assert shown == {light: {n: str(tmp_path / f"out/{light}-{n}.jpg") for n in names}, silent: {}}
    assert sorted(tmp_path.glob("out/*")) == [Path(shown[light][name]) for name in names]
    assert cli("review", "show", silent, "--pictures", tmp_path / "none").err.endswith(
        f"{silent} has no pictures: it is not an image effect in a single place\n"
    )
    assert not (tmp_path / "none").exists()
