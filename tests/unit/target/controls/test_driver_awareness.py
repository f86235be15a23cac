"""Alerts and slowing down after six minutes without an action by the driver."""

from selfdrive.controls.lib.driver_awareness import DriverAwareness


def run(cycles: int) -> tuple[DriverAwareness, list[str]]:
    awareness = DriverAwareness()
    return awareness, [awareness.count_down() for _ in range(cycles)]


def test_the_first_alert_starts_20_s_before_slowing_down_and_lasts_4_s() -> None:
    _, alerts = run(36100)
    first = [k for k, a in enumerate(alerts) if a == "pre_driver_distracted"]
    second = [k for k, a in enumerate(alerts) if a == "driver_distracted"]
    assert abs(first[0] - 34000) <= 1 and abs(first[-1] - 34400) <= 1
    assert abs(second[0] - 36000) <= 1 and second[-1] == 36099


def test_the_driver_is_absent_after_six_minutes_without_an_action() -> None:
    awareness, _ = run(35990)
    assert not awareness.absent
    for _ in range(20):
        awareness.count_down()
    assert awareness.absent
    awareness.reset()
    assert not awareness.absent and awareness.status == 1.0
