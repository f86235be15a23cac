"""How the pending work of a session is dealt out to processes: one interface, one module for each way."""

from typing import Protocol

from mutator.execution.session import Session


class Distributor(Protocol):
    """Deals out the pieces of a prepared session until none is left, or the session must stop.

    Workers append records to the run folder themselves. What ends the session early goes to
    `session.problem` and `session.interrupted`; nothing that finished is lost.
    """

    def run(self, session: Session) -> None: ...
