"""`seal` signs the digests of a run, and `verify` checks the signature."""

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    """A folder with the SSH keys `jane` and `joe`, and the list `signers` with Jane's."""
    if shutil.which("ssh-keygen") is None:
        pytest.skip("ssh-keygen is not installed")
    place = tmp_path / "keys"
    place.mkdir()
    for name in ("jane", "joe"):
        words = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(place / name)]
        subprocess.run(words, check=True)
    (place / "signers").write_text(f"jane@example.com {(place / 'jane.pub').read_text()}")
    return place


def test_a_signed_run_passes_and_names_its_signer(cli: Cli, sealed: str, copy: Path, keys: Path) -> None:
    assert f"seal: {sealed}" in cli("seal", copy).out and not (copy / "seal.json").exists()
    done = cli("seal", copy, "--sign", keys / "jane")
    assert done.code == 0 and (copy / "seal.json.sig").is_file()
    found = cli("verify", copy, "--signed-by", keys / "signers")
    assert found.code == 0 and re.search(r"^signed by +jane@example\.com$", found.out, re.MULTILINE)
    assert cli("verify", copy, "--signed-by", keys / "signers", "--json").json["signer"] == "jane@example.com"
    assert "seal.json" in {path.name for path in copy.iterdir()}
    assert cli("clean", copy, "--yes").code == 0 and not copy.exists()


def test_a_run_that_was_not_signed_by_somebody_in_the_list_does_not_pass(
    cli: Cli, copy: Path, keys: Path
) -> None:
    verify = ("verify", copy, "--signed-by", keys / "signers")
    unsigned = cli(*verify)
    assert unsigned.code == 1 and "not signed" in unsigned.out
    cli("seal", copy, "--sign", keys / "joe")
    stranger = cli(*verify)
    assert stranger.code == 1 and "signed by nobody in the list" in stranger.out
    cli("seal", copy, "--sign", keys / "jane")
    text = (copy / "seal.json").read_text()
    (copy / "seal.json").write_text(text.replace('"plan":"', '"plan":"0'))
    edited = cli(*verify)
    assert edited.code == 1 and "not a valid signature of jane@example.com" in edited.out


def test_a_run_that_changed_after_it_was_signed_does_not_pass(
    cli: Cli, copy: Path, keys: Path, reseal: Callable[..., None]
) -> None:
    cli("seal", copy, "--sign", keys / "jane")
    head = copy / "run.json"
    head.write_text(head.read_text().replace('"about": "', '"about": "not '))
    reseal(copy)
    found = cli("verify", copy, "--signed-by", keys / "signers")
    assert found.code == 1 and "signed other digests than those of this folder" in found.out


def test_a_key_or_list_that_cannot_be_used_is_an_error(
    cli: Cli, copy: Path, keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (keys / "broken").write_text("no key")
    for words, told in (
        (("seal", copy, "--sign", keys / "missing"), "missing: no such file"),
        (("seal", copy, "--sign", keys / "broken"), "ssh-keygen could not sign"),
        (("seal", copy, "--sign", keys / "signers"), "ssh-keygen could not sign"),
        (("verify", copy, "--signed-by", keys / "missing"), "missing: no such file"),
    ):
        found = cli(*words)
        assert found.code == 2 and told in found.err and "Traceback" not in found.err, found
    assert not (copy / "seal.json").exists()
    monkeypatch.setenv("PATH", str(keys))
    found = cli("seal", copy, "--sign", keys / "jane")
    assert found.code == 2 and "ssh-keygen is missing" in found.err
