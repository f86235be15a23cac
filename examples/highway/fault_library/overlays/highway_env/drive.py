"""The closed loop: a car on a road of highway-env, controlled by IDMVehicle.act."""

import numpy as np
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle, LinearVehicle

from mutator.glue import Run


class Drive(Run):
    def __init__(self, scenario, seed):
        super().__init__(step_s=0.1, duration_s=scenario["duration_s"])
        lanes = RoadNetwork.straight_road_network(scenario["lanes"], speed_limit=30)
        self.road = Road(lanes, np_random=np.random.RandomState(seed))
        self.controller = IDMVehicle.create_random(self.road, speed=scenario["speed_mps"], lane_id=0)
        self.road.vehicles = [self.controller]
        for i in range(scenario["others"]):  # each ahead of the previous ones
            other = LinearVehicle.create_random(self.road, lane_id=i % scenario["lanes"], spacing=1.5)
            self.road.vehicles.append(other)
        self.slows_at_s = scenario["slows_at_s"]

    def step(self):
        car, (ahead, _) = self.controller, self.road.neighbour_vehicles(self.controller)
        gap = car.lane_distance_to(ahead) - car.LENGTH if ahead else 500.0
        if ahead and self.t >= self.slows_at_s:
            ahead.target_speed = 8.0
        met = next((other for other in self.road.vehicles[1:] if other.crashed), ahead)
        closing = car.speed - met.speed if met else 0.0
        self.road.act()
        seen = {"gap": gap, "speed": car.speed, "closing": closing, "crashed": car.crashed}
        seen |= {"place": car.position[0], "across": -car.position[1], "heading": -car.heading}
        ahead_across = -ahead.position[1] if ahead else 0.0
        self.record(**seen, ahead_across=ahead_across, on_road=car.on_road, **car.action)
        self.road.step(self.step_s)


if __name__ == "__main__":
    Drive.main()
