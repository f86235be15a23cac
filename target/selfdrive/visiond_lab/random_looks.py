"""Roads and cameras for training the lane detector, varied far more than the simulated road."""

from dataclasses import replace

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.road_look import LinePaint, OtherCar, RoadLook

MIN_PAINT_CONTRAST = 14.0  # grey levels between paint and asphalt


def random_camera(rng: np.random.Generator) -> CameraModel:
    if rng.random() < 0.33:
        default = CameraModel()
        return replace(
            default,
            pitch=default.pitch + rng.normal(0.0, 0.01),
            height=default.height * rng.uniform(0.9, 1.1),
        )
    return CameraModel.from_view(
        width=640,
        rows=480,
        horizon=rng.uniform(150.0, 230.0),
        focal=rng.uniform(380.0, 640.0),
        height=rng.uniform(1.1, 2.0),
    )


def random_look(rng: np.random.Generator) -> RoadLook:
    asphalt = _draw_from_either(rng, (45.0, 120.0), (110.0, 185.0))
    paints = [_draw_paint(asphalt, rng) for _ in range(4)]
    return RoadLook(
        lane_width=rng.uniform(3.0, 4.1),
        left=paints[0],
        right=paints[1],
        far_left=paints[2] if rng.random() < 0.7 else None,
        far_right=paints[3] if rng.random() < 0.7 else None,
        asphalt_tone=asphalt,
        grain=rng.uniform(0.5, 9.0),
        mottle=rng.uniform(0.0, 10.0),
        wheel_track_darkening=rng.uniform(-10.0, 14.0),
        shoulder_tone=np.clip(asphalt + rng.normal(0.0, 35.0), 30.0, 210.0),
        shoulder_width=rng.uniform(0.3, 3.5),
        verge_tone=rng.uniform(35.0, 200.0),
        kerb_tone=rng.uniform(40.0, 220.0) if rng.random() < 0.3 else None,
        patches_per_100_m=rng.uniform(0.0, 8.0),
        cracks_per_100_m=rng.uniform(0.0, 16.0),
        seams_per_100_m=_draw_sometimes(rng, 0.4, 0.5, 6.0),
        joint_spacing=rng.uniform(4.0, 12.0) if rng.random() < 0.25 else None,
        joint_tone=_draw_from_either(rng, (-65.0, -10.0), (5.0, 20.0)),
        shadow_share=_draw_sometimes(rng, 0.6, 0.05, 0.6),
        shadow_depth=rng.uniform(0.2, 0.7),
        sky_tone=rng.uniform(150.0, 250.0),
        trees_tone=rng.uniform(30.0, 130.0),
        exposure=rng.uniform(0.65, 1.25),
        cars=tuple(_draw_car(rng) for _ in range(int(rng.integers(0, 4)))),
    )


def _draw_paint(asphalt: float, rng: np.random.Generator) -> LinePaint:
    room = 245.0 - asphalt
    tone = asphalt + room * rng.uniform(0.25, 1.0)
    most = max(0.0, 1.0 - MIN_PAINT_CONTRAST / (tone - asphalt))
    return LinePaint(
        tone=tone,
        width=rng.uniform(0.09, 0.20),
        dashed=rng.random() < 0.45,
        dash=rng.uniform(2.0, 5.0),
        period=rng.uniform(8.0, 13.0),
        phase=rng.uniform(0.0, 12.0),
        double=rng.random() < 0.12,
        wear=_draw_sometimes(rng, 0.6, 0.02, 0.5),
        fade=most * rng.uniform(0.0, 0.9) ** 2,
    )


def _draw_car(rng: np.random.Generator) -> OtherCar:
    lane = rng.choice([-3.7, 0.0, 3.7], p=[0.42, 0.16, 0.42])
    return OtherCar(
        x=rng.uniform(14.0, 60.0) if lane == 0.0 else rng.uniform(5.0, 60.0),
        y=lane + rng.normal(0.0, 0.3),
        tone=rng.uniform(15.0, 225.0),
        width=rng.uniform(1.6, 2.5),
        height=rng.uniform(1.3, 3.2),
    )


def _draw_from_either(
    rng: np.random.Generator, first: tuple[float, float], second: tuple[float, float]
) -> float:
    return rng.uniform(*(first if rng.random() < 0.6 else second))


def _draw_sometimes(rng: np.random.Generator, share: float, least: float, most: float) -> float:
    return rng.uniform(least, most) if rng.random() < share else 0.0
