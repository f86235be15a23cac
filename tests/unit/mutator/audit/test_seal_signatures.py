"""Who signed a run, by a list of allowed signers."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.audit.run_digests_and_seal import Seals, seals_of
from mutator.audit.seal_signatures import sign_seal, verified_signer
from mutator.errors import CheckFailed
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

pytestmark = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")


@pytest.fixture(scope="module")
def signed(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_finished: Callable[..., Path],
) -> tuple[RunFolder, Seals, dict[str, str]]:
    """A run signed by Jane, its digests, and the public keys of Jane and Joe."""
    place = tmp_path_factory.mktemp("signed")
    public = {}
    for name in ("jane", "joe"):
        key = place / name
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", key], check=True)
        public[name] = key.with_suffix(".pub").read_text().strip()
    folder = RunFolder.open(write_finished(copy_toycar(place), place / "run"))
    seals = seals_of(folder)
    sign_seal(folder, seals, place / "jane")
    return folder, seals, public


VALID = {
    "a comment first": ("# jane@old {jane}\n\njane@new {jane}", "jane@new"),
    "others first": ("joe@x {joe}\njane@x {jane}", "jane@x"),
    "several names": ("jane@x,doe@x {jane}", "jane@x, doe@x"),
    "a wildcard": ("*@example.com {jane}", "*@example.com"),
    "an exclusion": ("!eve@example.com,*@example.com {jane}", "*@example.com"),
    "a quoted name": ('"jane doe" {jane}', "jane doe"),
    "an expired line first": ('old@x valid-before="20200101" {jane}\nnew@x {jane}', "new@x"),
    "a line for other purposes first": ('git@x namespaces="git" {jane}\nseal@x {jane}', "seal@x"),
    "a line for this purpose": ('jane@x namespaces="git,mutator-seal" {jane}', "jane@x"),
    "a broken line first": ("jane@x no key\njane@x {jane}", "jane@x"),
}


@pytest.mark.parametrize("case", VALID)
def test_every_line_of_the_list_is_tried(
    signed: tuple[RunFolder, Seals, dict[str, str]], tmp_path: Path, case: str
) -> None:
    """And the identity is the one with which the signature is valid."""
    folder, seals, public = signed
    text, identity = VALID[case]
    (tmp_path / "list").write_text(text.format(**public))
    assert verified_signer(folder, seals, tmp_path / "list") == identity


INVALID = {
    "joe@x {joe}": "no signer matches",
    "": "no signer matches",
    'jane@x valid-after="20990101" {jane}': "key is not yet valid",
    'jane@x namespaces="git" {jane}': "not permitted for use in signature namespace",
    "!jane@x {jane}": "no signer matches",
    "jane@x no key": "invalid key",
}


@pytest.mark.parametrize("text", INVALID)
def test_a_line_that_does_not_allow_the_signature_does_not_count(
    signed: tuple[RunFolder, Seals, dict[str, str]], tmp_path: Path, text: str
) -> None:
    folder, seals, public = signed
    (tmp_path / "list").write_text(text.format(**public))
    with pytest.raises(CheckFailed, match=f"signed by nobody in the list .*{INVALID[text]}"):
        verified_signer(folder, seals, tmp_path / "list")
