"""A damaged cache file never changes a result and never causes a refusal."""

import random
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim import detection_memory
from selfdrive.sim.image_library import RENDERED_SPACING
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.sim.run import main

import mutator
from mutator.workspace import Workspace

from .damages import DAMAGES, damage
from .readers import Told, cli
from .tally import Case, End, Tally
from .worlds import LAST, LONGEST_S, judged, limited

pytestmark = pytest.mark.slow

CLONE = Path(__file__).parents[2]
TRIES = {"checks": 75, "pictures": 75}
ELSEWHERE = ("cache", "--json"), ("cache", "--max", "0")
FRAMES = 3
CAMERA = f"""\
schema: camera/1
name: {FRAMES} frames
files: "*.png"
width: 640
rows: 480
fx_px: 309.4
fy_px: 344.2
cx_px: 317.9
cy_px: 256.5
height_m: 2.18
pitch_deg: 14
spacing_m: {RENDERED_SPACING}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cache:
    """A filled cache that stays unchanged, a place for its copy, and a command that uses the copy."""

    home: Path
    at: Path
    use: Callable[[Path], Mapping[str, bytes | str]]

    def cases(self, seed: int) -> Sequence[Case]:
        """Damage a file of the cache, then use the cache twice. The second use finds what the first one
        left."""
        chance = random.Random(seed)
        shutil.copytree(self.home, self.at)
        try:
            files = sorted(path.relative_to(self.at) for path in self.at.rglob("*") if path.is_file())
            kind = chance.choice(sorted({path.suffix for path in files}))
            names = [path.as_posix() for path in files if path.suffix == kind]
            how, touched = damage(self.at, names, chance, sorted(DAMAGES))
            told = []
            for number in ("first", "second")[: chance.randint(1, 2)]:
                with limited(LONGEST_S):
                    told.append(self.use(self.at.with_name(number)))
                shutil.rmtree(self.at.with_name(number))
            code, out, err = cli(*chance.choice(ELSEWHERE))
        finally:
            shutil.rmtree(self.at)
        right = self._right()
        end, why = judged(Told(code=code, said=out + err), Told(code=0, said=""), [""])
        wrong = [one for one in told if one != right]
        if wrong or end is not End.RIGHT:
            end = End.WRONG
        story = f"{how} of {', '.join(touched)}: {why} {wrong} for {right}"[:LAST]
        return [Case(kind=kind, damage=how, reader=f"{len(told)} runs", end=end, story=story)]

    def _right(self) -> Mapping[str, bytes | str]:
        place = self.home.with_name("right")
        if not place.exists():
            shutil.copytree(self.home, self.at)
            self.use(place)
            shutil.rmtree(self.at)
        return contents_of(place)


def contents_of(run: Path) -> dict[str, bytes]:
    names = ("results.csv", "trace.npz", "record.json", "golden", "seal")
    found = [path for name in names for path in (run, *run.glob(name)) if path.name == name]
    files = [path for one in found for path in ([one] if one.is_file() else sorted(one.rglob("*.*")))]
    return {path.relative_to(run).as_posix(): path.read_bytes() for path in files}


def checks(toy: Workspace, folder: Path) -> Cache:
    def use(out: Path, seed: int = 3) -> Mapping[str, bytes]:
        choices = mutator.Choices(limit=2, seed=seed)
        made = mutator.run("small", out, choices=choices, engine="reference", workspace=toy)
        (out / "seal").write_text(str(made.seal))
        return contents_of(out)

    home, at = folder / "home", folder / "cache"
    for seed in (3, 4):
        use(folder / f"seed{seed}", seed)
    shutil.move(at, home)
    return Cache(home=home, at=at, use=use)


def pictures(toy: Workspace, folder: Path) -> Cache:
    frames, home, at = folder / "frames", folder / "home", folder / "cache"
    frames.mkdir()
    (frames / "camera.yaml").write_text(CAMERA)
    renderer = RoadRenderer(CameraModel(), "solid", 0, periods=1)
    for number in range(FRAMES):
        cv2.imwrite(str(frames / f"{number}.png"), renderer.render_grey(number * RENDERED_SPACING))
    words = ["--scenario", str(CLONE / "fault_library" / "scenarios" / "S1.yaml"), "--seed", "0"]
    words += ["--pictures", "--frames", str(frames), "--detector", "robust", "--max-steps", "12"]
    kept = at / "mutator" / "targets" / "openpilot"

    def use(out: Path) -> Mapping[str, bytes]:
        assert main([*words, "--out", str(out), "--cache", str(kept)]) == 0
        return contents_of(out)

    use(folder / "first")
    shutil.move(at, home)
    return Cache(home=home, at=at, use=use)


CACHES = {one.__name__: one for one in (checks, pictures)}


@pytest.mark.parametrize("name", CACHES)
def test_a_damaged_cache_changes_no_result(
    name: str,
    toy: Workspace,
    tmp_path: Path,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(detection_memory, "BUCKET_COUNT", 16)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    cache = CACHES[name](toy, tmp_path)
    tally = Tally(f"damages to caches: {name}")
    tally.drive(seeds(TRIES[name]), cache.cases)
    print_tally(tally)
    assert not tally.wrong
