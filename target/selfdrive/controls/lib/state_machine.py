"""The control state: how events engage and disengage the controller."""

from collections.abc import Sequence

from selfdrive.controls.lib.alertmanager import AlertManager
from selfdrive.controls.lib.events import (
    ENABLE,
    IMMEDIATE_DISABLE,
    NO_ENTRY,
    PRE_ENABLE,
    SOFT_DISABLE,
    USER_DISABLE,
    Event,
    has_kind,
    names_of_kind,
)

DISABLED = "disabled"
PRE_ENABLED = "pre_enabled"
ENABLED = "enabled"
SOFT_DISABLING = "soft_disabling"

SOFT_DISABLE_CYCLES = 300  # 3 s, in which the driver can take over


class StateMachine:
    """The four control states. Only an ENABLE event without a NO_ENTRY engages."""

    def __init__(self) -> None:
        self.state = DISABLED
        self._cycles_left = 0  # of soft disabling

    @property
    def enabled(self) -> bool:
        """Engaged, perhaps still waiting for the driver to release a pedal."""
        return self.state != DISABLED

    @property
    def active(self) -> bool:
        return self.state == ENABLED or self.state == SOFT_DISABLING

    def update(self, events: Sequence[Event], alerts: AlertManager, t: float) -> bool:
        """Advance to `t` (s) and raise the transition's alerts; return whether the driver just engaged."""
        self._cycles_left = max(0, self._cycles_left - 1)
        if not events and self.state in (DISABLED, ENABLED):
            return False  # the usual case
        if self.state == DISABLED:
            return self._try_engage(events, alerts, t)
        if has_kind(events, USER_DISABLE):
            self._disable(("disable",), alerts, t)
        elif has_kind(events, IMMEDIATE_DISABLE):
            self._disable(names_of_kind(events, IMMEDIATE_DISABLE), alerts, t)
        elif self.state == ENABLED:
            self._soften(events, alerts, t)
        elif self.state == SOFT_DISABLING:
            self._harden(events)
        elif has_kind(events, SOFT_DISABLE):  # the usual case
            self._disable(names_of_kind(events, SOFT_DISABLE), alerts, t)
        elif not has_kind(events, PRE_ENABLE):
            self.state = ENABLED
        return False

    def _try_engage(self, events: Sequence[Event], alerts: AlertManager, t: float) -> bool:
        if not has_kind(events, ENABLE):
            return False
        refusals = names_of_kind(events, NO_ENTRY)
        for name in refusals:
            alerts.add(name + "_no_entry", t)
        if refusals:
            return False
        self.state = PRE_ENABLED if has_kind(events, PRE_ENABLE) else ENABLED
        alerts.add("enable", t)
        return True

    def _disable(self, names: Sequence[str], alerts: AlertManager, t: float) -> None:
        self.state = DISABLED
        for name in names:
            alerts.add(name, t)

    def _soften(self, events: Sequence[Event], alerts: AlertManager, t: float) -> None:
        names = names_of_kind(events, SOFT_DISABLE)
        for name in names:
            alerts.add(name, t)
        if names:
            self.state = SOFT_DISABLING
            self._cycles_left = SOFT_DISABLE_CYCLES

    def _harden(self, events: Sequence[Event]) -> None:
        if not has_kind(events, SOFT_DISABLE):
            self.state = ENABLED
        elif self._cycles_left == 0:
            self.state = DISABLED
