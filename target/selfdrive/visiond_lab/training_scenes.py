"""Scenes for training the lane detector: rendered roads of all kinds, seen by all kinds of cameras."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.lead_picture import draw_car
from selfdrive.sim.road_look import LinePaint, RoadLook
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond_lab.random_effects import random_effect, random_moment
from selfdrive.visiond_lab.random_looks import random_camera, random_look
from selfdrive.visiond_lab.real_picture_features import (
    RandomVergesAndBands,
    bend_road_in_images,
    degrade_like_bad_camera,
)

DASH_PERIODS_PER_SCENE = 4  # of 12.2 m, length of a scene's road
VIEWS_PER_SCENE = 6  # pictures of each scene


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingView:
    """A picture (uint8) and the share of lane paint in each pixel (uint8, 255 is all)."""

    model: CameraModel
    picture: np.ndarray
    paint: np.ndarray


def generate_views(
    scenes: int, rng: np.random.Generator, *, with_effects: bool = True
) -> Iterator[TrainingView]:
    for _ in range(scenes):
        look, model, seed = random_look(rng), random_camera(rng), int(rng.integers(2**31))
        road = RoadRenderer(model, look, seed, periods=DASH_PERIODS_PER_SCENE)
        marks = RoadRenderer(model, _only_paint(look), seed, periods=DASH_PERIODS_PER_SCENE)
        hidden = _pixels_behind_cars(look, model)
        ground = RandomVergesAndBands(model, look.lane_width, rng)
        for _ in range(VIEWS_PER_SCENE):
            pose = rng.uniform(0.0, 50.0), rng.normal(0.0, 0.45), rng.normal(0.0, 0.02)
            paint = np.where(hidden, np.uint8(0), marks.render_grey(*pose))
            picture, paint = ground.apply(road.render_grey(*pose), paint, offset=pose[1], heading=pose[2])
            picture, paint = bend_road_in_images(model, (picture, paint), rng)
            picture = degrade_like_bad_camera(picture, rng)
            effect = random_effect(model, rng) if with_effects else None
            if effect:
                picture = np.asarray(effect.apply(picture, random_moment(rng)))
            yield TrainingView(model=model, picture=picture, paint=paint)


def _pixels_behind_cars(look: RoadLook, model: CameraModel) -> np.ndarray:
    picture = np.zeros((model.rows, model.width), np.uint8)
    for car in look.cars:
        draw_car(picture, model, car)
    return picture > 0


def _only_paint(look: RoadLook) -> RoadLook:
    def line(old: LinePaint | None) -> LinePaint | None:
        return old and replace(old, tone=255.0, wear=0.0, fade=0.0)

    return replace(
        look,
        left=line(look.left),
        right=line(look.right),
        far_left=line(look.far_left),
        far_right=line(look.far_right),
        **dict.fromkeys(
            (
                "asphalt_tone",
                "grain",
                "mottle",
                "wheel_track_darkening",
                "shoulder_tone",
                "verge_tone",
                "patches_per_100_m",
            ),
            0.0,
        ),
        **dict.fromkeys(
            ("cracks_per_100_m", "seams_per_100_m", "shadow_share", "sky_tone", "trees_tone"), 0.0
        ),
        kerb_tone=None,
        joint_spacing=None,
        exposure=1.0,
        cars=(),
    )
