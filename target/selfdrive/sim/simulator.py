"""The closed loop of plant, sensors, camera and controller, in steps of 10 ms."""

from dataclasses import dataclass

import numpy as np

from selfdrive.car.honda.interface import CarInterface
from selfdrive.car.honda.radar_interface import RadarInterface
from selfdrive.manager import Manager
from selfdrive.messages import Actuators, CanFrame
from selfdrive.sim.actuators import ActuatorReceiver
from selfdrive.sim.camera_and_detector import build_camera_and_detector
from selfdrive.sim.film.film_recorder import FilmOptions, FilmRecorder
from selfdrive.sim.hazards import HazardMonitor
from selfdrive.sim.lead import LeadVehicle
from selfdrive.sim.picture_options import PictureOptions
from selfdrive.sim.plant import Plant
from selfdrive.sim.radar import RadarSensor
from selfdrive.sim.recorder import TraceRecorder
from selfdrive.sim.reference_plant import ReferencePlant
from selfdrive.sim.road import Road
from selfdrive.sim.scenario import REFERENCE_PLANT, STANDARD_PLANT, Scenario
from selfdrive.sim.sensors import CarSensors
from selfdrive.sim.truth import GroundTruth
from selfdrive.visiond.detector import MirroredDetector
from selfdrive.visiond.visiond import Visiond

RECORD_SCHEMA = "sim-record/1"
STEPS_PER_SECOND = 100
CYCLE = 5  # steps between radar cycles and between pictures
PLANT_CLASSES: dict[str, type[Plant]] = {STANDARD_PLANT: Plant, REFERENCE_PLANT: ReferencePlant}
FREE_ROAD_DISTANCE = 200.0  # m; constant distance that radar and camera report on a free road


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationResult:
    """The result of a run: `record` (data of record.json) and `trace` (arrays by channel)."""

    record: dict
    trace: dict[str, np.ndarray]


class Simulator:
    """Runs one scenario at a time; `reset` starts the next with a clean state."""

    def reset(
        self,
        scenario: Scenario,
        seed: int = 0,
        pictures: PictureOptions | None = None,
        film: FilmOptions | None = None,
    ) -> None:
        """Rebuild car, controller and recorder. `seed` is for the pictures. Without `film`, no film is
        recorded.

        Raises ConfigError if the film cannot be written, or if pictures are unavailable or do not fit the
        scenario's road.
        """
        self.frame = 0
        self._scenario, self._seed = scenario, seed
        lead = scenario.lead
        self._road = Road(scenario.grade, scenario.curvature)
        self._lead = LeadVehicle(lead.gap, lead.times, lead.speeds) if lead else None
        self._radar = RadarSensor(self._road)
        self._vision = build_camera_and_detector(pictures, self._road, seed)
        self._camera, self._takes_pictures = self._vision.camera, pictures is not None
        self._film = FilmRecorder(film, self._vision.model) if film else None
        self._receiver = ActuatorReceiver()
        self._actuators = Actuators()
        car = CarInterface()
        make_plant = PLANT_CLASSES[scenario.plant]
        self._plant = make_plant(car.params, speed=scenario.speed, offset=scenario.lateral_offset)
        self._sensors = CarSensors(self._plant.gearbox_scale)
        detector = self._vision.detector
        if make_plant.has_mirrored_messages:
            detector = MirroredDetector(detector)
        self.manager = Manager(car, RadarInterface(), Visiond(detector))
        self.hazards = HazardMonitor()
        self.recorder = TraceRecorder()

    @property
    def is_finished(self) -> bool:
        return self.frame >= self._scenario.steps

    def step(self) -> None:
        """Advance 10 ms: plant, ground truth, sensors, controller, recorder."""
        t = self.frame / STEPS_PER_SECOND
        self._advance(t)
        truth = self._observe(t)
        self.hazards.update(truth)
        button, brake_pedal = self._scenario.button(self.frame), self._actuators.brake_pedal
        measured = self._sensors.measure(truth, button, self.frame, brake_pedal)
        view = None
        if self.frame % CYCLE == 0:
            shown = self._plant.shown(truth)
            measured += self._radar.measure(shown)
            view = self._camera.look(self._plant.pictured(truth) if self._takes_pictures else shown)
        frames: list[CanFrame] = []
        frames.extend(measured)
        sent = self.manager.step(t, frames, view)
        self.recorder.append(truth, self._actuators, self.manager)
        if self._film and view is not None:
            self._film.take(truth, view, self.manager, self.hazards.first)
        self._actuators = self._receiver.update(sent, t)
        self.frame += 1

    def result(self) -> SimulationResult:
        recorder = self.recorder
        first_alerts: dict[str, float] = {}
        for name, t in recorder.alerts:
            first_alerts.setdefault(name, t)
        record = {
            "schema": RECORD_SCHEMA,
            "scenario": self._scenario.name,
            "scenario_digest": self._scenario.digest,
            "seed": self._seed,
            "no_lead": self._scenario.lead is None,
            "plant": self._scenario.plant,
            "pictures": self._vision.for_record,
            "steps": self.frame,
            "engaged_from": recorder.engaged_from,
            "engaged_to": recorder.engaged_to,
            "hazards": dict(self.hazards.first),
            "alerts": [{"name": name, "t": t} for name, t in first_alerts.items()],
            "alert_events": [{"name": name, "t": t} for name, t in recorder.alerts],
        }
        return SimulationResult(record=record, trace=recorder.trace())

    def _advance(self, t: float) -> None:
        road, plant = self._road, self._plant
        plant.step(self._actuators, road.grade(t), road.curvature(plant.position))
        if self._lead:
            self._lead.step(t)

    def _observe(self, t: float) -> GroundTruth:
        plant, lateral, lead = self._plant, self._plant.lateral, self._lead
        d_rel = plant.distance_to(lead.position) if lead else FREE_ROAD_DISTANCE
        return GroundTruth(
            t,
            d_rel,
            plant.speed,
            lead.speed if lead else plant.speed,
            plant.acceleration,
            lateral.offset,
            lateral.heading,
            lateral.steer_angle,
            lateral.steer_rate,
            plant.position,
            plant.headway(d_rel),
            lead is None,
        )
