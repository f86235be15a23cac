"""Messages for tests: any topic, and any value in it."""

import copy


class Content:
    """Values by name. A name without a value is another content, empty."""

    def __init__(self, **values):
        self.__dict__.update(values)

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        self.__dict__[name] = Content()
        return self.__dict__[name]

    def init(self, name, count):
        self.__dict__[name] = [Content() for _ in range(count)]
        return self.__dict__[name]

    def as_reader(self):
        return self

    def to_bytes(self):
        return copy.deepcopy(self)


class car:
    class RadarData:
        RadarPoint = Content
