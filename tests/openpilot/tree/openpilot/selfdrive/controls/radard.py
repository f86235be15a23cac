"""Combines what radar and camera report about the cars ahead: a stand-in."""

from cereal import Content, messaging

RADAR_TO_CAMERA = 1.5
LEAST_PROBABILITY, MOST_M, MOST_SHARE, MOST_MPS = 0.5, 5.0, 0.25, 10.0
COLUMNS = "dRel", "yRel", "vRel", "measured"


class Track:
    def __init__(self, number):
        self.identifier = number

    def update(self, d_rel, y_rel, v_rel, v_lead, measured):
        self.gap, self.aside, self.closing, self.speed = d_rel, y_rel, v_rel, v_lead


def match_vision_to_track(v_ego, lead, tracks):
    offset_vision_dist = -RADAR_TO_CAMERA + lead.x[0]

    def prob(track):
        errors = track.gap - offset_vision_dist, track.aside, track.closing + v_ego - lead.v[0]
        return -sum(map(abs, errors))

    best = sorted(tracks.values(), key=prob)[-1]
    errors = abs(best.gap - offset_vision_dist), abs(best.closing + v_ego - lead.v[0])
    limits = max(MOST_M, MOST_SHARE * offset_vision_dist), MOST_MPS
    return best if all(error < limit for error, limit in zip(errors, limits, strict=True)) else None


def get_RadarState_from_vision(lead_msg, v_ego):
    seen_gap, seen_speed = lead_msg.x[0], lead_msg.v[0]
    return report(seen_gap - RADAR_TO_CAMERA, seen_speed)


def report(gap, speed):
    return Content(status=True, dRel=gap, vLead=speed)


def choose(v_ego, lead, probability, tracks):
    if probability <= LEAST_PROBABILITY:
        return Content(status=False, dRel=0.0, vLead=0.0)
    track = match_vision_to_track(v_ego, lead, tracks) if tracks else None
    return report(track.gap, track.speed) if track else get_RadarState_from_vision(lead, v_ego)


class RadarD:
    def __init__(self, delay=0.0):
        self.tracks = {}

    def update(self, sm, rr):
        state, model = sm["carState"], sm["modelV2"]
        self.v_ego = state.vEgo
        ar_pts = {point.trackId: [getattr(point, name) for name in COLUMNS] for point in rr.points}
        self.tracks = {number: self.tracks.get(number) or Track(number) for number in ar_pts}
        for number, (gap, aside, closing, measured) in ar_pts.items():
            self.tracks[number].update(gap, aside, closing, closing + self.v_ego, measured)
        leads_v3, probabilities = model.leadsV3, {}
        for i, lead in enumerate(leads_v3):
            lead_prob = lead.prob
            probabilities[i] = lead_prob
        self.radar_state = Content(leadOne=choose(self.v_ego, leads_v3[0], probabilities[0], self.tracks))
        self.is_valid = sm.all_checks()

    def publish(self, pm):
        message = messaging.new_message("radarState", valid=self.is_valid)
        message.radarState = self.radar_state
        pm.send(message.topic, message)
