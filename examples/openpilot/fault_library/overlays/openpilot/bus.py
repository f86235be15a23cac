"""The way of openpilot's messages between its parts, without sockets and clocks."""

import cereal.messaging as messaging

# no shared memory: other runs on this machine would share it
messaging.pub_sock = messaging.sub_sock = lambda *_, **__: None


class Bus:
    """Stands in for openpilot's PubMaster. The readers are openpilot's own SubMasters."""

    def __init__(self):
        self.now = 0.0  # s
        self.waiting = {}  # reader -> topic -> newest message; like openpilot's sockets, no queue

    def reader(self, topics, poll):
        reader = messaging.SubMaster(topics, poll=poll)
        self.waiting[reader] = {}
        return reader

    def new(self, topic):
        """Return an empty message and its content, to fill in."""
        message = messaging.new_message(topic, valid=True)
        return message, getattr(message, topic)

    def send(self, topic, message):
        message.logMonoTime = round(self.now * 1e9)
        sent = messaging.log_from_bytes(message.to_bytes())
        for reader, waiting in self.waiting.items():
            if topic in reader.services:
                waiting[topic] = sent

    def read(self, reader):
        messages = list(self.waiting[reader].values())
        self.waiting[reader].clear()
        reader.update_msgs(self.now, messages)
