"""Distribute work on this machine, as a pytest session in this process with pytest-xdist workers."""

from mutator.execution.session import Session


class LocalDistributor:
    """The distributor of `mutator run`: `session.workers` processes, or only this process if 0."""

    def run(self, session: Session) -> None:
        # a run that is finished needs no pytest
        from mutator.execution.local_pytest_session import run_in_pytest

        run_in_pytest(session)
