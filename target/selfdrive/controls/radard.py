"""radard: selects leads from radar tracks and the camera's lead, at 20 Hz."""

from collections import deque

from selfdrive.common.car import CarParams
from selfdrive.common.interp import interp
from selfdrive.common.realtime import DT_MDL
from selfdrive.controls.lib.pathplanner import ModelFit, PathPlanner
from selfdrive.controls.lib.predicted_path import Curve, distance_to, model_curve, steering_curve
from selfdrive.controls.lib.radar_helpers import Cluster, Track, cluster_tracks
from selfdrive.controls.lib.vehicle_model import VehicleModel
from selfdrive.controls.lib.vision_point import VisionPoint
from selfdrive.messages import ControlsState, LeadData, ModelData, RadarData, RadarPoint, RadarState

RADAR_DELAY = 0.1  # s between measurement and report
SPEED_HISTORY = 20  # cycles


class Radard:
    def __init__(self, params: CarParams, fit: ModelFit) -> None:
        self._radar_offset = params.radar_offset
        self._vehicle = VehicleModel(params)
        self._path = PathPlanner(fit)
        self._vision = VisionPoint()
        self._tracks: dict[int, Track] = {}
        self._model: ModelData | None = None
        self._cycle = 0
        # as in the original, the history starts with zeros, as if the car were at rest
        self._speeds: deque[float] = deque([0.0] * SPEED_HISTORY, maxlen=SPEED_HISTORY)
        self._times: deque[float] = deque([0.0] * SPEED_HISTORY, maxlen=SPEED_HISTORY)

    def update(self, radar: RadarData, model: ModelData | None, controls: ControlsState) -> RadarState:
        now = self._cycle * DT_MDL
        self._speeds.append(controls.v_ego)
        self._times.append(now)
        v_ego_then = interp(now - RADAR_DELAY, self._times, self._speeds)
        self._cycle += 1
        if model is not None:
            self._see(model, controls.v_ego)
        self._track(radar.points, self._likely_path(controls), v_ego_then, controls.steer_override)
        fused = self._vision.best_match(self._tracks.values(), self._path.d_poly)
        if fused is not None:
            fused.fuse()
        one, two = self._leads(cluster_tracks(list(self._tracks.values())), controls.v_ego)
        return RadarState(radar.t, one, two, radar.errors)

    def _see(self, model: ModelData, v_ego: float) -> None:
        if model is not self._model:
            self._model = model
            self._path.update(v_ego, model)
        self._vision.update(model.lead)

    def _likely_path(self, controls: ControlsState) -> Curve:
        if controls.active and not controls.steer_override:
            return model_curve(self._path.d_poly)
        return steering_curve(self._vehicle.curvature(controls.steering_angle, controls.v_ego))

    def _track(self, points: tuple[RadarPoint, ...], path: Curve, v_ego: float, driver_steers: bool) -> None:
        tracks = {}
        for point in points:
            d_rel = point.d_rel + self._radar_offset
            d_path = distance_to(path, d_rel, point.y_rel)
            track = self._tracks.get(point.track_id)
            if track is None:
                track = Track(d_rel, point.y_rel, point.v_rel, d_path, v_ego)
            else:
                track.update(d_rel, point.y_rel, point.v_rel, d_path, v_ego, driver_steers)
            tracks[point.track_id] = track
        self._tracks = tracks

    def _leads(self, clusters: list[Cluster], v_ego: float) -> tuple[LeadData, LeadData]:
        ahead = sorted((c for c in clusters if c.is_lead(v_ego)), key=lambda c: c.d_rel)
        if not ahead:
            return LeadData(), LeadData()
        first = ahead[0]
        second = next((c for c in ahead if c.is_apart(first)), None)
        return (
            first.lead_data(self._radar_offset),
            second.lead_data(self._radar_offset) if second else LeadData(),
        )
