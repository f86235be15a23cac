"""Sign the digests of a run, and check who signed them, with the program ssh-keygen.

What is signed is `seal.json` in the run folder: the digests, the plan and the version of `mutator`, as
canonical text. The signature is beside it, in `seal.json.sig`. Neither is in the seal.
"""

import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile

from mutator._common.below import open_below, write_below
from mutator._common.hashing import canonical
from mutator.errors import CheckFailed, MutatorError
from mutator.store.run_folder import RunFolder
from mutator.verification.seal import Seals

SCHEMA = "signed-seal/1"
FILE, SIGNATURE = "seal.json", "seal.json.sig"
NAMESPACE = "mutator-seal"  # signatures for other purposes do not count
_PATIENCE_S = 60.0  # somebody may have to type a passphrase or to touch a key
_MOST = 100_000  # bytes of either file
_SIGN = "`mutator seal RUN --sign KEY` signs the run as it is now"


def statement(folder: RunFolder, seals: Seals) -> bytes:
    """What a signature of a run says; MutatorError for a run without a seal."""
    if seals.seal is None:
        raise MutatorError(
            "no seal",
            where=folder.path,
            expected="a finished run",
            remedy="finish it with the command that started it",
        )
    said = {
        "schema": SCHEMA,
        "seal": seals.seal,
        "results_digest": seals.results_digest,
        "review_digest": seals.review_digest,
        "plan": folder.head["plan"],
        "mutator": folder.head["provenance"]["mutator"],
    }
    return canonical(said).encode() + b"\n"


def sign(folder: RunFolder, seals: Seals, key: Path) -> None:
    """Sign the digests of a run with an SSH key: the file of a private key, or of a public key in ssh-agent.

    MutatorError if the key cannot sign.
    """
    if not key.is_file():
        raise MutatorError("no such file", where=key, argument="sign", expected="the file of an SSH key")
    said = statement(folder, seals)
    done = _ssh_keygen("sign", ["-f", str(key.resolve()), "-n", NAMESPACE], said)
    if done.returncode or not done.stdout.startswith(b"-----BEGIN SSH SIGNATURE-----"):
        raise MutatorError(
            f"ssh-keygen could not sign ({_said(done)})",
            where=key,
            argument="sign",
            expected="a private SSH key, or a public one whose private key is in ssh-agent",
        )
    write_below(folder.path, FILE, said)
    write_below(folder.path, SIGNATURE, done.stdout)


def signer(folder: RunFolder, seals: Seals, allowed_signers: Path) -> str:
    """Return the identity in `allowed_signers` whose key signed the digests of a run.

    CheckFailed if there is no valid signature of one of them, or if the run has changed since.
    """
    if not allowed_signers.is_file():
        raise MutatorError(
            "no such file",
            where=allowed_signers,
            argument="signed_by",
            expected="a file of allowed signers: lines of an identity and a public SSH key",
        )
    said, signature = (_content(folder, name) for name in (FILE, SIGNATURE))
    with NamedTemporaryFile(prefix="mutator-seal-") as copy:
        copy.write(signature)
        copy.flush()
        of = ["-f", str(allowed_signers.resolve()), "-s", copy.name]
        identity = _identity(folder, _ssh_keygen("find-principals", of), allowed_signers)
        done = _ssh_keygen("verify", [*of, "-I", identity, "-n", NAMESPACE], said)
    if done.returncode:
        raise CheckFailed(
            f"not a valid signature of {identity} ({_said(done)})",
            where=folder.path / SIGNATURE,
            expected=f"the signature of {FILE}",
            remedy=_SIGN,
        )
    if said != statement(folder, seals):
        raise CheckFailed(
            f"{identity} signed other digests than those of this folder",
            where=folder.path / FILE,
            expected=statement(folder, seals).decode().strip(),
            remedy=f"do not trust this folder; if you changed it yourself, {_SIGN}",
        )
    return identity


def _content(folder: RunFolder, name: str) -> bytes:
    with suppress(FileNotFoundError), open_below(folder.path, name) as file:
        if len(data := file.read(_MOST + 1)) <= _MOST:
            return data
    raise CheckFailed("not signed", where=folder.path / name, expected="a signed run", remedy=_SIGN)


def _identity(folder: RunFolder, found: subprocess.CompletedProcess[bytes], allowed_signers: Path) -> str:
    identities = found.stdout.decode("utf-8", "replace").replace(",", "\n").split("\n")
    if found.returncode or not identities[0].isprintable() or not identities[0]:
        raise CheckFailed(
            f"signed by nobody in the list ({_said(found)})",
            where=folder.path / SIGNATURE,
            expected=f"a signature by one of {allowed_signers}",
            remedy="add the signer's identity and public key, if you trust them",
        )
    return identities[0]


def _ssh_keygen(verb: str, words: Sequence[str], data: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(
            ["ssh-keygen", "-Y", verb, *words],
            input=data,
            capture_output=True,
            timeout=_PATIENCE_S,
            cwd="/",
            check=False,
        )
    except FileNotFoundError:
        raise MutatorError(
            "the program ssh-keygen is missing",
            expected="OpenSSH 8.9 or newer",
            remedy="install it (Debian: `apt install openssh-client`)",
        ) from None
    except subprocess.TimeoutExpired:
        raise MutatorError(
            f"ssh-keygen did not answer within {_PATIENCE_S:g} s",
            expected="a key without a passphrase, or one in ssh-agent",
        ) from None


def _said(done: subprocess.CompletedProcess[bytes]) -> str:
    lines = [line for line in done.stderr.decode("utf-8", "replace").splitlines() if line.strip()]
    return lines[-1] if lines else f"exit code {done.returncode}"
