"""The scene of a manifest."""

import math
from collections.abc import Collection

from pydantic import Field

from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.targets.manifest_formulas import manifest_condition, manifest_formula
from mutator.targets.overhead_view import ActorShape, GroundLine, OverheadView, ViewedActor


class _ActorModel(StrictModel, title="An actor"):
    shape: ActorShape = Field("box", description="The shape: `box` or `circle`.")
    length_m: float = Field(
        gt=0.0,
        allow_inf_nan=False,
        description="The length along the heading in m; the diameter of a circle.",
    )
    width_m: float | None = Field(
        None,
        gt=0.0,
        allow_inf_nan=False,
        description="The width across the heading in m. Default: the length.",
    )
    x: str = Field(description="The x of the centre in m: a formula over channels and derived values.")
    y: str = Field("0", description="The y of the centre in m, left positive.")
    heading: str = Field("0", description="The heading in rad, left positive.")
    visible: str = Field("True", description="The condition under which the actor is drawn.")
    believed: bool = Field(
        False,
        description="Whether this is the place that the controller assumes. It is drawn as an outline.",
    )
    about: str = Field("", description="What the actor is.")


class _LineModel(StrictModel, title="A line"):
    points_m: list[list[float]] | None = Field(
        None, min_length=2, description="The points [x, y] that the line joins. Give these or `y`."
    )
    y: str | None = Field(None, description="For a line along x: its y in m, a formula over channels.")
    dashed: bool = Field(False, description="Whether the line is dashed.")


class OverheadViewModel(StrictModel, title="The scene"):
    """How a drive looks from above: SI units, x ahead, y to the left."""

    actors: dict[str, _ActorModel] = Field(min_length=1, description="The things that move, by name.")
    lines: dict[str, _LineModel] = Field(
        default_factory=dict, description="The lines on the ground, by name."
    )
    follow: str | None = Field(None, description="The actor that the view follows.")
    speed: str = Field(
        "0",
        description="The speed of the origin along x in m/s: a formula, for a drive in which poses are "
        "relative to the car. With it, the road moves, and a car that is slower than in the golden "
        "run visibly falls behind.",
    )


def build_overhead_view(model: OverheadViewModel, names: Collection[str], source: YamlSource) -> OverheadView:
    if model.follow is not None and model.follow not in model.actors:
        raise source.error(
            ("scene", "follow"),
            f"'{model.follow}'",
            expected=f"one of {', '.join(model.actors)}",
            remedy="correct the name",
        )
    actors = tuple(_build_actor(name, actor, names, source) for name, actor in model.actors.items())
    lines = tuple(_build_line(name, line, names, source) for name, line in model.lines.items())
    speed = manifest_formula(model.speed, names, source, ("scene", "speed"))
    return OverheadView(actors=actors, lines=lines, follow=model.follow or "", speed=speed)


def _build_actor(name: str, model: _ActorModel, names: Collection[str], source: YamlSource) -> ViewedActor:
    keys: KeyPath = ("scene", "actors", name)
    if model.shape == "circle" and model.width_m is not None:
        raise source.error(
            (*keys, "width_m"), "the width of a circle", expected="`length_m` alone", remedy="remove it"
        )
    return ViewedActor(
        name=name,
        shape=model.shape,
        length=model.length_m,
        width=model.width_m or model.length_m,
        x=manifest_formula(model.x, names, source, (*keys, "x")),
        y=manifest_formula(model.y, names, source, (*keys, "y")),
        heading=manifest_formula(model.heading, names, source, (*keys, "heading")),
        visible=manifest_condition(model.visible, names, source, (*keys, "visible")),
        believed=model.believed,
        about=model.about,
    )


def _build_line(name: str, model: _LineModel, names: Collection[str], source: YamlSource) -> GroundLine:
    keys: KeyPath = ("scene", "lines", name)
    if (model.points_m is None) == (model.y is None):
        raise source.error(
            keys, f"line '{name}'", expected="either `points_m` or `y`", remedy="give exactly one of the two"
        )
    for i, point in enumerate(model.points_m or ()):
        if len(point) != 2 or not all(map(math.isfinite, point)):
            raise source.error(
                (*keys, "points_m", i), f"{point}", expected="[x, y]", remedy="give both numbers, in m"
            )
    return GroundLine(
        name=name,
        points=tuple((x, y) for x, y in model.points_m or ()),
        y=manifest_formula(model.y, names, source, (*keys, "y")),
        dashed=model.dashed,
    )
