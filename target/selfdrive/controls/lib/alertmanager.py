"""Tracks active alerts and shows the most urgent."""

from collections.abc import Mapping
from math import inf

from selfdrive.controls.lib.alerts import ALERTS, Alert


class AlertManager:
    """An alert lasts for its duration after it was last raised. The newest alert of the highest priority is
    shown."""

    def __init__(self, table: Mapping[str, Alert] = ALERTS) -> None:
        self._table = table
        self._raised: dict[str, float] = {}  # name: time last raised
        self._next_change = inf  # s, no alert expires earlier
        self.active: tuple[str, ...] = ()
        self.text1 = ""
        self.text2 = ""
        self.visual = "none"
        self.audible = "none"

    def add(self, name: str, t: float) -> None:
        """Raise an alert at time `t` (s). Raises KeyError for an unknown name."""
        if name not in self._table:
            raise KeyError(f"no alert is named {name!r}")
        self._raised[name] = t
        self._next_change = t

    def process(self, t: float) -> None:
        if t < self._next_change:
            return
        self._raised = {n: t0 for n, t0 in self._raised.items() if t0 + self._table[n].duration > t}
        self.active = tuple(
            sorted(self._raised, key=lambda n: (self._table[n].priority, self._raised[n]), reverse=True)
        )
        ends = [t0 + s for n, t0 in self._raised.items() for s in self._table[n].ends if t0 + s > t]
        self._next_change = min(ends, default=inf)
        self._show(t)

    def _show(self, t: float) -> None:
        self.text1 = self.text2 = ""
        self.visual = self.audible = "none"
        if not self.active:
            return
        alert, t0 = self._table[self.active[0]], self._raised[self.active[0]]
        if t0 + alert.text_s > t:
            self.text1, self.text2 = alert.text1, alert.text2
        if t0 + alert.visual_s > t:
            self.visual = alert.visual
        if t0 + alert.sound_s > t:
            self.audible = alert.audible
