"""Drawings of the families of the shipped library, for their page: three drives of each, without faults.

`python -m mutator.reference.family_drives` drives and draws them, in a minute.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from mutator._common.confined_files import path_below
from mutator._common.files import ScratchFolder
from mutator._common.shipped_files import check_not_shipped
from mutator.engines.engine_jobs import Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import CheckFailed
from mutator.families.family import Family
from mutator.families.scenario_sampling import sample_scenarios
from mutator.limits import Limits
from mutator.model import ConcreteScenario, Status
from mutator.outcomes.trace_and_record_loading import Trace, load_trace
from mutator.store.planned_scenarios import PlannedScenarios
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

DRAWINGS_FOLDER = Path("docs") / "reference" / "families"
COLOURS = ("#1b6ca8", "#c4531a", "#3f7d20")
COLOUR_NAMES = ("blue", "orange", "green")
_SEED = 0
_MOST_POINTS = 100  # of a curve
_WIDTH, _HEIGHT = 300, 150  # of a panel, in pixels
_AXIS_X, _AXIS_END_X, _AXIS_TOP, _AXIS_BOTTOM = 38, 292, 22, 130  # of the axes in it
_DASHES = ("", ' stroke-dasharray="3 3"')  # of the curves in a panel
_Curve = tuple[str, np.ndarray, np.ndarray]  # SVG attributes, times (s), values


def drawn_scenarios(family: Family) -> Sequence[ConcreteScenario]:
    """Return the scenarios of a family that its drawing shows, one for each of `COLOURS`."""
    return sample_scenarios(family, len(COLOURS), family.sampling, _SEED)


def render_drawings(workspace: Workspace, scratch: Path) -> Iterator[tuple[str, str]]:
    """Drive in the folder `scratch`; yield the name and SVG text of each family's drawing. CheckFailed if a
    drive does not end normally.
    """
    manifest = workspace.manifest(workspace.target_name())
    planned = PlannedScenarios(scratch)
    engine = ReferenceEngine(manifest, scratch, Limits())
    for name in workspace.families:
        traces = []
        for scenario in drawn_scenarios(workspace.family(name)):
            planned.add(scenario)
            traces.append(_drive(engine, manifest, planned.file(scenario.name)))
        yield f"{name}.svg", _drawing_svg(name, manifest, traces)


def _drive(engine: ReferenceEngine, manifest: TargetManifest, scenario: Path) -> Trace:
    job = Job(name=scenario.stem, scenario=scenario, seed=_SEED)
    result = engine.execute(job, path_below(engine.work_folder, job.name))
    if result.status is not Status.OK:
        raise CheckFailed(f"the drive ended as {result.status.value}: {result.detail}", where=scenario)
    return load_trace(manifest, result.out)


def _drawing_svg(name: str, manifest: TargetManifest, traces: Sequence[Trace]) -> str:
    """Return a panel for each unit of the observed values that are recorded, over time."""
    observed = {value.name for value in manifest.observation.values}
    channels_by_unit: dict[str, list[Channel]] = {}
    for channel in manifest.channels:
        if channel.name in observed:
            channels_by_unit.setdefault(channel.unit, []).append(channel)
    width = _WIDTH * len(channels_by_unit)
    panels = [
        line
        for number, (unit, channels) in enumerate(channels_by_unit.items())
        for line in _panel(
            f"{'; dashed: '.join(channel.about for channel in channels)}, {unit}",
            [
                (f'stroke="{colour}"{dashes}', trace[manifest.time_channel], trace[channel.name])
                for colour, trace in zip(COLOURS, traces, strict=True)
                for channel, dashes in zip(channels, _DASHES, strict=False)
            ],
            number * _WIDTH,
        )
    ]
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{_HEIGHT}" '
            f'viewBox="0 0 {width} {_HEIGHT}" role="img" font-family="sans-serif" font-size="10">',
            f"<title>What is observed over time in three drives of {name}</title>",
            f'<rect width="{width}" height="{_HEIGHT}" fill="#fff"/>',
            *panels,
            "</svg>\n",
        )
    )


def _panel(title: str, curves: Sequence[_Curve], x: int) -> Iterator[str]:
    finite = np.concatenate([values[np.isfinite(values)] for _, _, values in curves])
    end_s = max(float(times[-1]) for _, times, _ in curves)
    low, high = min(0.0, float(finite.min())), max(float(finite.max()), 1.0)
    width, height = _AXIS_END_X - _AXIS_X, _AXIS_BOTTOM - _AXIS_TOP
    yield f'<g transform="translate({x + _AXIS_X} {_AXIS_TOP})">'
    yield f'<text x="0" y="-8">{title}</text>'
    yield f'<path d="M0 0V{height}H{width}" fill="none" stroke="#767676"/>'
    for value, y in ((high, 0), (low, height)):
        yield f'<text x="-4" y="{y + 4}" text-anchor="end">{value:.0f}</text>'
    yield f'<text x="{width}" y="{height + 14}" text-anchor="end">{end_s:.0f} s</text>'
    for attributes, times, values in curves:
        path = _path(times / end_s * width, (high - values) / (high - low) * height)
        yield f'<path d="{path}" fill="none" stroke-width="1.5" {attributes}/>'
    yield "</g>"


def _path(x: np.ndarray, y: np.ndarray) -> str:
    """Return the path of a curve, with a gap where it has no value."""
    words, command = [], "M"
    for index in np.linspace(0, len(x) - 1, min(len(x), _MOST_POINTS)).astype(int):
        if np.isfinite(y[index]):
            words.append(f"{command}{x[index]:.1f} {y[index]:.1f}")
        command = "L" if np.isfinite(y[index]) else "M"
    return "".join(words)


def write_drawings(workspace: Workspace) -> Iterator[Path]:
    """Write the drawings into the library's clone; yield the paths. MutatorError if there is no clone."""
    clone = workspace.library.parent
    check_not_shipped(clone)
    (clone / DRAWINGS_FOLDER).mkdir(parents=True, exist_ok=True)
    with ScratchFolder("mutator-drives-") as scratch:
        for name, text in render_drawings(workspace, scratch):
            (clone / DRAWINGS_FOLDER / name).write_text(text, encoding="utf-8")
            yield DRAWINGS_FOLDER / name


if __name__ == "__main__":
    for path in write_drawings(Workspace.find()):
        print(path)
