"""What a bench asks of a distributor whose workers stay between batches."""

from typing import Protocol, runtime_checkable

from mutator.execution.session import Session


@runtime_checkable
class StayingDistributor(Protocol):
    """A distributor whose connection and workers stay open after `stay_open`, from session to session, until
    `close`. After a problem or an interruption, it has closed them, and opens others for the next session.
    """

    def stay_open(self) -> None: ...

    def run(self, session: Session) -> None: ...

    def close(self) -> None: ...
