"""The number of usable cores."""

import os
from pathlib import Path

import pytest

from mutator._common import cpu_cores


@pytest.mark.parametrize(
    ("quota", "usable"),
    [
        ("max 100000\n", 8),
        ("250000 100000\n", 2),
        ("10000 100000\n", 1),
        ("1600000 100000\n", 8),
        ("?", 8),
        (None, 8),
    ],
)
def test_a_containers_quota_limits_the_cores(
    quota: str | None, usable: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(8)))
    monkeypatch.setattr(cpu_cores, "_CPU_QUOTA_PATH", tmp_path / "cpu.max")
    if quota is not None:
        (tmp_path / "cpu.max").write_text(quota)
    assert cpu_cores.usable_cores() == usable
