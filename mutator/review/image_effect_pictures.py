"""Shows what an image effect does: an image before the effect, and images after it at up to three levels.

Runs the target up to the injected lines and executes these on the target's current image, with the values of
several mutants. This needs no support in the manifest. Results are cached by all their inputs.
"""

import base64
import io
import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import correlation
from threading import Lock
from typing import Any

import numpy as np
from PIL import Image

from mutator._common import cache_layout_and_pruning
from mutator._common.bounded_reading import read_bounded
from mutator._common.files import ScratchFolder, json_bytes, write_atomic
from mutator._common.hashing import content_id, digest
from mutator.engines.engine_jobs import Job
from mutator.engines.in_target import picture_probe
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.limits import Limits
from mutator.model import Fault, FaultLocation, Injection, Status
from mutator.mutants.mutant_building import build
from mutator.mutants.probe_contract import probe_path
from mutator.mutants.template_rendering import render_snippet
from mutator.review.mutant_groups import Group
from mutator.review.patch_shapes import parameter_values
from mutator.targets.manifest import TargetManifest
from mutator.targets.required_packages import check_requirements
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

IMAGE_EFFECT_MODEL = "image_effect"
LEVEL_NAMES = ("least", "middle", "most")  # also in file names, and in addresses of the server
MOST_DRAWN_VALUES = 9  # maximum number of a group's values to draw; three are shown
MIN_CORRELATION = 0.5  # minimum correlation of amount and change for ranking severity by amount
JPEG_QUALITY = 85  # the images of a group then take about 0.15 MB in the cache
PICTURE_RUN_LIMITS = Limits(cpu_s=60, wall_s=120)  # for a run that never reaches the injected lines
_SCHEMA = "pictures/1"  # in the cache's keys, so that files of another format are never read
_drawing_lock = Lock()  # a page requests all images of a group at once: the first request draws them


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureLevel:
    """An image after the effect as a JPEG file; `name` is one of LEVELS."""

    name: str
    label: str
    after_jpeg: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectPictures:
    """A group's images as JPEG files. One distinct value gives only the level `most`; two give `least` and
    `most`.
    """

    before_jpeg: bytes
    levels: tuple[PictureLevel, ...]

    def find_level(self, name: str) -> PictureLevel | None:
        return next((level for level in self.levels if level.name == name), None)


def can_have_pictures(group: Group) -> bool:
    """Whether a group has images: all its image effects change the same variable in one place."""
    return IMAGE_EFFECT_MODEL in group.models and all(
        _effect_location_and_variable(fault) for fault in group.faults
    )


def jpegs_before_and_after(
    workspace: Workspace, manifest: TargetManifest, group: Group, level: str
) -> tuple[bytes, bytes] | None:
    """Return the image before and after the effect at one of LEVELS, as JPEG files."""
    pictures = pictures_of_groups(workspace, manifest, [group]).get(group.id)
    picture = pictures.find_level(level) if pictures else None
    return (pictures.before_jpeg, picture.after_jpeg) if pictures and picture else None


def pictures_of_groups(
    workspace: Workspace, manifest: TargetManifest, groups: Iterable[Group]
) -> dict[str, EffectPictures]:
    """Return the images of all groups that have any, by group; drawn unless cached.

    Groups of one place are drawn in one process. MutatorError if the target does not reach the place, or if
    an effect fails there.
    """
    models, scenario = workspace.fault_models(), _first_scenario(workspace)
    requests = {
        group.id: _DrawRequest.of(manifest, models, scenario, group)
        for group in groups
        if can_have_pictures(group)
    }
    with _drawing_lock:
        pictures_by_group = {name: _load_cached(request.key) for name, request in requests.items()}
        missing = {name: request for name, request in requests.items() if pictures_by_group[name] is None}
        if missing:
            pictures_by_group |= _run_and_cache_pictures(manifest, models, scenario, missing)
    return {name: pictures for name, pictures in pictures_by_group.items() if pictures}


@dataclass(frozen=True, slots=True, kw_only=True)
class _DrawRequest:
    """The faults of a group to draw, with their injected lines."""

    key: str
    location_and_variable: tuple[FaultLocation, str]
    faults: tuple[Fault, ...]
    effect_lines: tuple[tuple[str, ...], ...]

    @classmethod
    def of(
        cls, manifest: TargetManifest, models: FaultModels, scenario: Path, group: Group
    ) -> "_DrawRequest":
        faults = _choose_faults(group.faults)
        lines = tuple(_effect_lines(models, fault) for fault in faults)
        place = _effect_location_and_variable(faults[0])
        assert place is not None  # the group has images
        entry = manifest.run_arguments(
            scenario=Path("scenario"), seed=0, out=Path("out"), changes=faults[0].changes
        )
        probe = digest(Path(picture_probe.__file__).read_bytes())
        run = [manifest.entry_module, entry, sorted(manifest.env.items()), digest(read_bounded(scenario))]
        labels = list(map(_level_label, faults))
        versions = [_SCHEMA, platform.python_version(), probe, manifest.tree.digest]
        key = content_id([*versions, run, content_id(place[0]), place[1], lines, labels])
        return cls(key=key, location_and_variable=place, faults=faults, effect_lines=lines)


def _first_scenario(workspace: Workspace) -> Path:
    """Return the library's first scenario: any road will do."""
    scenario = next(iter(workspace.scenarios.values()), None)
    if scenario is None:
        raise MutatorError(
            "no scenario to draw images in",
            where=workspace.library / "scenarios",
            remedy="add one (see docs/how-to/add-a-scenario.md)",
        )
    return scenario


def _image_effects(fault: Fault) -> tuple[Injection, ...]:
    return tuple(injection for injection in fault.injections if injection.model == IMAGE_EFFECT_MODEL)


def _effect_location_and_variable(fault: Fault) -> tuple[FaultLocation, str] | None:
    """Return the place of a fault's image effects, and the image variable; None for several places."""
    places = {
        (injection.location, str(dict(injection.params)["target"])) for injection in _image_effects(fault)
    }
    return places.pop() if len(places) == 1 else None


def _effect_lines(models: FaultModels, fault: Fault) -> tuple[str, ...]:
    return tuple(
        line
        for injection in _image_effects(fault)
        for line in render_snippet(models.get(IMAGE_EFFECT_MODEL), dict(injection.params), "picture")
    )


def _level_label(fault: Fault) -> str:
    if fault.value is not None:
        plain = fault.unit in ("", "-", "1")
        return f"amount {fault.value}" if plain else f"{fault.value} {fault.unit}"
    return ", ".join(
        f"{name} {value}" for name, value in parameter_values(fault).items() if name.endswith("amount")
    )


def _effect_amounts(fault: Fault) -> tuple[float, ...]:
    return tuple(float(str(dict(injection.params)["amount"])) for injection in _image_effects(fault))


def _choose_faults(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """At most MOST faults with distinct amounts, evenly spread from least to largest."""
    by_amount: dict[tuple[float, ...], Fault] = {}
    for fault in faults:
        by_amount.setdefault(_effect_amounts(fault), fault)
    sorted_faults = [by_amount[amounts] for amounts in sorted(by_amount)]
    last, count = len(sorted_faults) - 1, min(len(sorted_faults), MOST_DRAWN_VALUES)
    places = {round(i * last / max(1, count - 1)) for i in range(count)}
    return tuple(sorted_faults[place] for place in sorted(places))


def _run_and_cache_pictures(
    manifest: TargetManifest, models: FaultModels, scenario: Path, requests: Mapping[str, _DrawRequest]
) -> dict[str, EffectPictures]:
    """Draw and cache the images of groups. All groups of a place share one run of the target."""
    check_requirements(manifest)
    places: dict[tuple[object, ...], list[str]] = {}
    for name, request in requests.items():
        places.setdefault((request.location_and_variable, request.faults[0].changes), []).append(name)
    pictures_by_group = {}
    with ScratchFolder("mutator-pictures-") as scratch:
        (scratch / "work").mkdir()
        engine = ReferenceEngine(manifest, scratch / "work", PICTURE_RUN_LIMITS)
        for i, names in enumerate(places.values()):
            groups = [requests[name] for name in names]
            before, *rest = _images_of_run(
                engine, models, scenario, groups, scratch / "work" / f"pictures-{i}"
            )
            after = iter(rest)
            for name, request in zip(names, groups, strict=True):
                pictures_by_group[name] = _build_pictures(
                    before, request.faults, [next(after) for _ in request.faults]
                )
                _save_cached(request.key, pictures_by_group[name])
    return pictures_by_group


def _images_of_run(
    engine: ReferenceEngine, models: FaultModels, scenario: Path, groups: Sequence[_DrawRequest], folder: Path
) -> list[np.ndarray]:
    """Return the image before the effect, then the images after each fault of each group."""
    manifest, (location, picture) = engine.manifest, groups[0].location_and_variable
    first = groups[0].faults[0]
    mutant = build(manifest, models, replace(first, injections=_image_effects(first)[:1]), always_trigger())
    lines = [effect_lines for group in groups for effect_lines in group.effect_lines]
    probe_request = {"file": location.path, "picture": picture, "effects": lines, "mutant": mutant.id}
    stub = Path(picture_probe.__file__).read_text(encoding="utf-8")
    probe = stub.replace('json.loads("{}")', f"json.loads({json.dumps(probe_request)!r})")
    files = {**mutant.files, probe_path(manifest.probe_package): probe.encode()}
    job = Job(
        name=folder.name,
        scenario=scenario,
        seed=0,
        scenario_changes=first.changes,
        changed_files=files,
        mutant_id=mutant.id,
    )
    execution = engine.execute(job, folder)
    file = execution.out / picture_probe.PICTURES_FILE
    if not file.is_file():
        ended = execution.status is Status.OK
        raise MutatorError(
            f"no image of {location.path} {location.function}: "
            + ("the run never reached this function" if ended else execution.detail),
            where=scenario,
            expected="a run that reaches the image effect",
            remedy="see `mutator check --drive`",
        )
    with np.load(io.BytesIO(read_bounded(file)), allow_pickle=False) as images:
        return [images["before"], *(images[f"after_{i}"] for i in range(len(lines)))]


def _build_pictures(
    before_image: np.ndarray, faults: Sequence[Fault], after_images: Sequence[np.ndarray]
) -> EffectPictures:
    changes = [
        float(np.sqrt(np.mean(np.square(image.astype(float) - before_image)))) for image in after_images
    ]
    order = _indices_by_severity(changes)
    names = {1: LEVEL_NAMES[2:], 2: LEVEL_NAMES[::2]}.get(len(order), LEVEL_NAMES)
    places = {"least": order[0], "middle": order[(len(order) - 1) // 2], "most": order[-1]}
    levels = [
        PictureLevel(
            name=name,
            label=_level_label(faults[places[name]]),
            after_jpeg=_jpeg_bytes(after_images[places[name]]),
        )
        for name in names
    ]
    return EffectPictures(before_jpeg=_jpeg_bytes(before_image), levels=tuple(levels))


def _indices_by_severity(changes: Sequence[float]) -> list[int]:
    """Return the indices into `changes`, least severe first. The order follows the amounts, in the direction
    in which the image changes more, so that random differences between neighbouring amounts do not matter.
    Amounts on both sides of "no effect" are ordered by change.
    """
    order = list(range(len(changes)))
    trend = correlation(order, changes) if len(set(changes)) > 1 else 1.0
    if abs(trend) < MIN_CORRELATION:
        return sorted(order, key=changes.__getitem__)
    return order if trend > 0.0 else order[::-1]


def _jpeg_bytes(picture: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue()


def _load_cached(key: str) -> EffectPictures | None:
    path = cache_layout_and_pruning.cached_image_effects_folder() / f"{key}.json"
    try:
        data: dict[str, Any] = json.loads(read_bounded(path))
        before, levels = data["before"], data["levels"]
        if data["sum"] == digest([key, before, levels]):
            os.utime(path)  # mark as recently used
            return EffectPictures(
                before_jpeg=base64.b64decode(before),
                levels=tuple(
                    PictureLevel(name=name, label=label, after_jpeg=base64.b64decode(after))
                    for name, label, after in levels
                ),
            )
    except (OSError, MutatorError, ValueError, KeyError, TypeError, AttributeError):
        pass
    return None


def _save_cached(key: str, pictures: EffectPictures) -> None:
    path = cache_layout_and_pruning.cached_image_effects_folder() / f"{key}.json"
    before = base64.b64encode(pictures.before_jpeg).decode()
    levels = [
        [level.name, level.label, base64.b64encode(level.after_jpeg).decode()] for level in pictures.levels
    ]
    data = {"sum": digest([key, before, levels]), "before": before, "levels": levels}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, json_bytes(data))
    except (OSError, MutatorError):
        return  # an unwritable cache is ignored
