"""Fuses the radar's points with the lead that vision reports."""

from cereal import Content, messaging

RADAR_TO_CAMERA = 1.5


class Track:
    def __init__(self, identifier):
        self.identifier = identifier

    def update(self, d_rel, y_rel, v_rel, v_lead, measured):
        self.dRel, self.yRel, self.vRel, self.vLead = d_rel, y_rel, v_rel, v_lead


def match_vision_to_track(v_ego, lead, tracks):
    offset_vision_dist = lead.x[0] - RADAR_TO_CAMERA

    def distance(track):
        return abs(track.dRel - offset_vision_dist) + abs(track.vRel + v_ego - lead.v[0]) + abs(track.yRel)

    def prob(track):
        return 1 / (1 + distance(track)) if lead.v[0] >= 0 else 0.0

    track = max(tracks.values(), key=prob)
    near = abs(track.dRel - offset_vision_dist) < max(offset_vision_dist * 0.25, 5.0)
    return track if near and abs(track.vRel + v_ego - lead.v[0]) < 10 else None


def get_RadarState_from_vision(lead_msg, v_ego):
    speed = lead_msg.v[0]
    return Content(status=True, dRel=lead_msg.x[0] - RADAR_TO_CAMERA, vLead=speed)


class RadarD:
    def __init__(self, delay=0.0):
        self.tracks = {}

    def update(self, sm, rr):
        self.v_ego = sm["carState"].vEgo
        ar_pts = {pt.trackId: [pt.dRel, pt.yRel, pt.vRel, pt.measured] for pt in rr.points}
        self.tracks = {name: self.tracks.get(name) or Track(name) for name in ar_pts}
        for name, point in ar_pts.items():
            self.tracks[name].update(point[0], point[1], point[2], point[2] + self.v_ego, point[3])
        leads = sm["modelV2"].leadsV3
        one = Content(status=False, dRel=0.0, vLead=0.0)
        for lead in leads[:1]:
            lead_prob = lead.prob
            if lead_prob > 0.5:
                track = match_vision_to_track(self.v_ego, lead, self.tracks) if self.tracks else None
                one = get_RadarState_from_vision(lead, self.v_ego)
                if track:
                    one = Content(status=True, dRel=track.dRel, vLead=track.vLead)
        self.radar_state = Content(leadOne=one)
        self.radar_state_valid = sm.all_checks()

    def publish(self, pm):
        radar_msg = messaging.new_message("radarState")
        radar_msg.valid = self.radar_state_valid
        radar_msg.radarState = self.radar_state
        pm.send("radarState", radar_msg)
