"""Events and their kinds."""

from selfdrive.controls.lib.events import NO_ENTRY, SOFT_DISABLE, WARNING, Event, has_kind, names_of_kind

EVENTS = (Event("door_open", (NO_ENTRY, SOFT_DISABLE)), Event("busy", (NO_ENTRY, WARNING)))


def test_has_kind() -> None:
    assert has_kind(EVENTS, WARNING)
    assert not has_kind(EVENTS[:1], WARNING)


def test_names_of_kind_keep_their_order() -> None:
    assert names_of_kind(EVENTS, NO_ENTRY) == ["door_open", "busy"]
    assert names_of_kind(EVENTS, SOFT_DISABLE) == ["door_open"]
