"""`run --shard` and `merge` on the command line."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mutator.audit.run_digests_and_seal import Seals

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_a_shard_is_run_and_merged(cli: Cli, root: Path) -> None:
    ran = cli("run", "small", "--out", "part", "-n", "0", "--shard", "1/2", "--limit", 4)
    assert ran.code == 0, ran.err
    assert "2 of 2 experiments done" in ran.err + ran.out
    missing = cli("merge", "part", "--out", "whole")
    assert missing.code == 2
    assert "no folder for shard 2/2" in missing.err
    assert cli("run", "small", "--out", "rest", "-n", "0", "--shard", "2/2", "--limit", 4).code == 0
    merged = cli("merge", "part", "rest", "--out", "whole", "--json")
    assert merged.code == 0, merged.err
    digests = {name: merged.json[name] for name in dataclasses.asdict(Seals())}
    assert merged.json == {"run": "whole", "shards": 2, "experiments": 4, **digests}
    assert [len(digests[name]) for name in ("seal", "results_digest")] == [64, 64]
    again = cli("merge", "part", "rest", "--out", "whole")
    assert again.code == 2
    assert "holds a run" in again.err
