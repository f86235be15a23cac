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

from mutator._common import shared_cache
from mutator._common.bounded_reading import read_bounded
from mutator._common.files import ScratchFolder, json_bytes, write_atomic
from mutator._common.hashing import content_id, digest
from mutator.engines.engine_jobs import Job
from mutator.engines.in_target import picture_probe
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import Fault, FaultLocation, Injection, Limits, Status
from mutator.mutants.mutant_building import build
from mutator.mutants.probe import probe_path
from mutator.mutants.template_rendering import render_snippet
from mutator.review.mutant_groups import Group
from mutator.review.patch_shapes import parameter_values
from mutator.targets.manifest import TargetManifest
from mutator.targets.required_packages import check_requirements
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

MODEL = "image_effect"
LEVELS = ("least", "middle", "most")
MOST = 9  # maximum number of a group's values to draw; three are shown
CLEAR = 0.5  # minimum correlation of amount and change for ranking severity by amount
QUALITY = 85
LIMITS = Limits(cpu_s=60, wall_s=120)
_SCHEMA = "pictures/1"
_drawing = Lock()  # a page requests all images of a group at once: the first request draws them


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """An image after the effect as a JPEG file; `name` is one of LEVELS."""

    name: str
    label: str
    after: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Pictures:
    """A group's images as JPEG files. One distinct value gives only the level `most`; two give `least` and
    `most`.
    """

    before: bytes
    levels: tuple[Level, ...]

    def level(self, name: str) -> Level | None:
        return next((level for level in self.levels if level.name == name), None)


def has_pictures(group: Group) -> bool:
    """Whether a group has images: all its image effects change the same variable in one place."""
    return MODEL in group.models and all(_place(fault) for fault in group.faults)


def of_group(
    workspace: Workspace, manifest: TargetManifest, group: Group, level: str
) -> tuple[bytes, bytes] | None:
    """Return the image before and after the effect at one of LEVELS, as JPEG files."""
    found = of_groups(workspace, manifest, [group]).get(group.id)
    wanted = found.level(level) if found else None
    return (found.before, wanted.after) if found and wanted else None


def of_groups(workspace: Workspace, manifest: TargetManifest, groups: Iterable[Group]) -> dict[str, Pictures]:
    """Return the images of all groups that have any, by group; drawn unless cached.

    Groups of one place are drawn in one process. MutatorError if the target does not reach the place, or if
    an effect fails there.
    """
    models, scenario = workspace.fault_models(), _scenario(workspace)
    wanted = {
        group.id: _Wanted.of(manifest, models, scenario, group) for group in groups if has_pictures(group)
    }
    with _drawing:
        found = {name: _recalled(one.key) for name, one in wanted.items()}
        missing = {name: one for name, one in wanted.items() if found[name] is None}
        if missing:
            found |= _drawn_anew(manifest, models, scenario, missing)
    return {name: pictures for name, pictures in found.items() if pictures}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wanted:
    """The faults of a group to draw, with their injected lines."""

    key: str
    place: tuple[FaultLocation, str]
    faults: tuple[Fault, ...]
    lines: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, manifest: TargetManifest, models: FaultModels, scenario: Path, group: Group) -> "_Wanted":
        faults = _chosen(group.faults)
        lines = tuple(_lines(models, fault) for fault in faults)
        place = _place(faults[0])
        assert place is not None  # the group has images
        entry = manifest.arguments(
            scenario=Path("scenario"), seed=0, out=Path("out"), changes=faults[0].changes
        )
        probe = digest(Path(picture_probe.__file__).read_bytes())
        run = [manifest.entry_module, entry, sorted(manifest.env.items()), digest(read_bounded(scenario))]
        labels = list(map(_label, faults))
        versions = [_SCHEMA, platform.python_version(), probe, manifest.tree.digest]
        key = content_id([*versions, run, content_id(place[0]), place[1], lines, labels])
        return cls(key=key, place=place, faults=faults, lines=lines)


def _scenario(workspace: Workspace) -> Path:
    """Return the library's first scenario: any road will do."""
    found = next(iter(workspace.scenarios.values()), None)
    if found is None:
        raise MutatorError(
            "no scenario to draw images in",
            where=workspace.library / "scenarios",
            remedy="add one (see docs/how-to/add-a-scenario.md)",
        )
    return found


def _effects(fault: Fault) -> tuple[Injection, ...]:
    return tuple(injection for injection in fault.injections if injection.model == MODEL)


def _place(fault: Fault) -> tuple[FaultLocation, str] | None:
    """Return the place of a fault's image effects, and the image variable; None for several places."""
    places = {(one.location, str(dict(one.params)["target"])) for one in _effects(fault)}
    return places.pop() if len(places) == 1 else None


def _lines(models: FaultModels, fault: Fault) -> tuple[str, ...]:
    return tuple(
        line
        for one in _effects(fault)
        for line in render_snippet(models.get(MODEL), dict(one.params), "picture")
    )


def _label(fault: Fault) -> str:
    if fault.value is not None:
        plain = fault.unit in ("", "-", "1")
        return f"amount {fault.value}" if plain else f"{fault.value} {fault.unit}"
    return ", ".join(
        f"{name} {value}" for name, value in parameter_values(fault).items() if name.endswith("amount")
    )


def _amounts(fault: Fault) -> tuple[float, ...]:
    return tuple(float(str(dict(one.params)["amount"])) for one in _effects(fault))


def _chosen(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """At most MOST faults with distinct amounts, evenly spread from least to largest."""
    by_amount: dict[tuple[float, ...], Fault] = {}
    for fault in faults:
        by_amount.setdefault(_amounts(fault), fault)
    sorted_faults = [by_amount[amounts] for amounts in sorted(by_amount)]
    last, count = len(sorted_faults) - 1, min(len(sorted_faults), MOST)
    places = {round(i * last / max(1, count - 1)) for i in range(count)}
    return tuple(sorted_faults[place] for place in sorted(places))


def _drawn_anew(
    manifest: TargetManifest, models: FaultModels, scenario: Path, wanted: Mapping[str, _Wanted]
) -> dict[str, Pictures]:
    """Draw and cache the images of groups. All groups of a place share one run of the target."""
    check_requirements(manifest)
    places: dict[tuple[object, ...], list[str]] = {}
    for name, one in wanted.items():
        places.setdefault((one.place, one.faults[0].changes), []).append(name)
    found = {}
    with ScratchFolder("mutator-pictures-") as scratch:
        (scratch / "work").mkdir()
        engine = ReferenceEngine(manifest, scratch / "work", LIMITS)
        for i, names in enumerate(places.values()):
            groups = [wanted[name] for name in names]
            before, *rest = _run(engine, models, scenario, groups, scratch / "work" / f"pictures-{i}")
            after = iter(rest)
            for name, one in zip(names, groups, strict=True):
                found[name] = _shown(before, one.faults, [next(after) for _ in one.faults])
                _remember(one.key, found[name])
    return found


def _run(
    engine: ReferenceEngine, models: FaultModels, scenario: Path, groups: Sequence[_Wanted], folder: Path
) -> list[np.ndarray]:
    """Return the image before the effect, then the images after each fault of each group."""
    manifest, (location, picture) = engine.manifest, groups[0].place
    first = groups[0].faults[0]
    mutant = build(manifest, models, replace(first, injections=_effects(first)[:1]), always_trigger())
    lines = [one for group in groups for one in group.lines]
    asked = {"file": location.path, "picture": picture, "effects": lines, "mutant": mutant.id}
    stub = Path(picture_probe.__file__).read_text(encoding="utf-8")
    probe = stub.replace('json.loads("{}")', f"json.loads({json.dumps(asked)!r})")
    files = {**mutant.files, probe_path(manifest.package): probe.encode()}
    job = Job(
        name=folder.name, scenario=scenario, seed=0, changes=first.changes, files=files, mutant=mutant.id
    )
    execution = engine.execute(job, folder)
    file = execution.out / picture_probe.FILE
    if not file.is_file():
        ended = execution.status is Status.OK
        raise MutatorError(
            f"no image of {location.path} {location.function}: "
            + ("the run never reached this function" if ended else execution.detail),
            where=scenario,
            expected="a run that reaches the image effect",
            remedy="see `mutator check --drive`",
        )
    with np.load(io.BytesIO(read_bounded(file)), allow_pickle=False) as found:
        return [found["before"], *(found[f"after_{i}"] for i in range(len(lines)))]


def _shown(before: np.ndarray, faults: Sequence[Fault], after: Sequence[np.ndarray]) -> Pictures:
    changes = [float(np.sqrt(np.mean(np.square(one.astype(float) - before)))) for one in after]
    order = _by_severity(changes)
    names = {1: LEVELS[2:], 2: LEVELS[::2]}.get(len(order), LEVELS)
    places = {"least": order[0], "middle": order[(len(order) - 1) // 2], "most": order[-1]}
    levels = [
        Level(name=name, label=_label(faults[places[name]]), after=_jpeg(after[places[name]]))
        for name in names
    ]
    return Pictures(before=_jpeg(before), levels=tuple(levels))


def _by_severity(changes: Sequence[float]) -> list[int]:
    """Return the indices into `changes`, least severe first. The order follows the amounts, in the direction
    in which the image changes more, so that random differences between neighbouring amounts do not matter.
    Amounts on both sides of "no effect" are ordered by change.
    """
    order = list(range(len(changes)))
    trend = correlation(order, changes) if len(set(changes)) > 1 else 1.0
    if abs(trend) < CLEAR:
        return sorted(order, key=changes.__getitem__)
    return order if trend > 0.0 else order[::-1]


def _jpeg(picture: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=QUALITY)
    return buffer.getvalue()


def _recalled(key: str) -> Pictures | None:
    path = shared_cache.pictures_folder() / f"{key}.json"
    try:
        data: dict[str, Any] = json.loads(read_bounded(path))
        before, levels = data["before"], data["levels"]
        if data["sum"] == digest([key, before, levels]):
            os.utime(path)  # mark as recently used
            return Pictures(
                before=base64.b64decode(before),
                levels=tuple(
                    Level(name=name, label=label, after=base64.b64decode(after))
                    for name, label, after in levels
                ),
            )
    except (OSError, MutatorError, ValueError, KeyError, TypeError, AttributeError):
        pass
    return None


def _remember(key: str, pictures: Pictures) -> None:
    path = shared_cache.pictures_folder() / f"{key}.json"
    before = base64.b64encode(pictures.before).decode()
    levels = [[one.name, one.label, base64.b64encode(one.after).decode()] for one in pictures.levels]
    data = {"sum": digest([key, before, levels]), "before": before, "levels": levels}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, json_bytes(data))
    except (OSError, MutatorError):
        return  # an unwritable cache is ignored
