"""The pytest session of `mutator run` in this process, with pytest-xdist workers."""

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata

import pytest

from mutator.execution.session import Session
from mutator.execution.xdist_controller import CampaignController, PreparedRun
from mutator.store.run_head import CAMPAIGN_FILE

_PLUGIN_MODULE = "mutator.execution.pytest_plugin"


def run_in_pytest(session: Session) -> None:
    """Run the pending experiments as pytest items, ignoring the user's pytest configuration."""
    installed = any(entry.name == "mutator" for entry in metadata.entry_points(group="pytest11"))
    folder = session.folder.path
    arguments = [
        *("--disable-plugin-autoload", "-p", "xdist", "-p", "mutator" if installed else _PLUGIN_MODULE),
        *("-p", "no:cacheprovider", "-p", "no:tmpdir", "--noconftest", "--assert=plain"),
        *("-c", os.devnull, "--rootdir", str(folder), "-s", "-n", str(session.workers)),
    ]
    output = _SilentReporter()
    with _without_environment_variables("PYTEST_ADDOPTS", "PYTEST_PLUGINS"):
        sources = {os.path.realpath(folder / CAMPAIGN_FILE): PreparedRun(session)}
        controller = CampaignController(sources, is_alone=True)
        code = pytest.main(arguments, plugins=[controller, output])
    if code in (pytest.ExitCode.INTERNAL_ERROR, pytest.ExitCode.USAGE_ERROR) and not session.problem:
        # the error is at the end of what pytest prints
        session.problem = output.text.getvalue().strip()[-2000:] or f"pytest ended with {code!r}"


@contextmanager
def _without_environment_variables(*names: str) -> Iterator[None]:
    removed = {name: os.environ.pop(name) for name in names if name in os.environ}
    try:
        yield
    finally:
        os.environ.update(removed)


class _SilentReporter:
    """Pytest plugin that buffers the terminal reporter's output, because the caller owns the terminal."""

    def __init__(self) -> None:
        self.text = io.StringIO()

    @pytest.hookimpl(trylast=True)  # after the reporter is made, and before xdist (registered later) uses it
    def pytest_configure(self, config: pytest.Config) -> None:
        manager = config.pluginmanager
        manager.unregister(name="terminalreporter")
        manager.register(pytest.TerminalReporter(config, self.text), "terminalreporter")
