"""Sign the digests of a run, and check who signed them, with the program ssh-keygen.

What is signed is `seal.json` in the run folder: the digests, the plan and the version of `mutator`, as
canonical text. The signature is beside it, in `seal.json.sig`. Neither is in the seal.
"""

import re
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import open_below, write_below
from mutator._common.hashing import canonical_json
from mutator.audit.seal import Seals
from mutator.errors import CheckFailed, MutatorError
from mutator.store.run_folder import RunFolder

SCHEMA = "signed-seal/1"
FILE, SIGNATURE = "seal.json", "seal.json.sig"
NAMESPACE = "mutator-seal"  # signatures for other purposes do not count
_PATIENCE_S = 60.0  # somebody may have to type a passphrase or to touch a key
_MOST = 100_000  # bytes of either file
_SIGN = "`mutator seal RUN --sign KEY` signs the run as it is now"


def statement(folder: RunFolder, seals: Seals) -> bytes:
    """Return what a signature of a run says; MutatorError for a run without a seal."""
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
        "plan": folder.head.plan,
        "mutator": folder.head.provenance.mutator,
    }
    return canonical_json(said).encode() + b"\n"


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
    """Return the identities in `allowed_signers` whose key signed the digests of a run: those of the first
    line with which the signature is valid. A pattern such as `*@example.com` stands for itself.

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
    identity, whys = "", []
    for line in read_bounded(allowed_signers, _MOST).splitlines():
        if line.strip() and not line.lstrip().startswith(b"#"):
            identity, why = _identities(line, said, signature)
            whys += [why] if why else []
        if identity:
            break
    if not identity:
        raise CheckFailed(
            f"signed by nobody in the list ({whys[0] if whys else 'no signer matches'})",
            where=folder.path / SIGNATURE,
            expected=f"the signature of {FILE} by one of {allowed_signers}",
            remedy=f"add the signer's identity and public key, if you trust them; {_SIGN}",
        )
    if said != statement(folder, seals):
        raise CheckFailed(
            f"{identity} signed other digests than those of this folder",
            where=folder.path / FILE,
            expected=statement(folder, seals).decode().strip(),
            remedy=f"do not trust this folder; if you changed it yourself, {_SIGN}",
        )
    return identity


def _identities(line: bytes, said: bytes, signature: bytes) -> tuple[str, str]:
    """Return the identities on a line of allowed signers with which a signature is valid, or else why the
    signature of the line's key is not. ssh-keygen itself names only the first line with the key.
    """
    with (
        NamedTemporaryFile(prefix="mutator-seal-") as copy,
        NamedTemporaryFile(prefix="mutator-seal-") as one,
    ):
        for file, content in ((copy, signature), (one, line + b"\n")):
            file.write(content)
            file.flush()
        of = ["-f", one.name, "-s", copy.name]
        found = _ssh_keygen("find-principals", of)
        names = found.stdout.decode("utf-8", "replace").replace(",", "\n").splitlines()
        names = [name for name in names if name.isprintable() and not name.startswith("!")]
        if found.returncode or not names:
            return "", _about_line(found, one.name)
        tried = {name: _ssh_keygen("verify", [*of, "-I", name, "-n", NAMESPACE], said) for name in names}
    valid = [name for name, done in tried.items() if not done.returncode]
    done = tried[names[0]]
    why = f"not a valid signature of {names[0]}: {_about_line(done, one.name) or _said(done)}"
    return ", ".join(valid), "" if valid else why


def _about_line(done: subprocess.CompletedProcess[bytes], file: str) -> str:
    """Return what ssh-keygen said about the only line of a file, such as that its key has expired."""
    found = re.search(f"^{re.escape(file)}:1: (.*)", done.stderr.decode("utf-8", "replace"), re.MULTILINE)
    return found[1].strip() if found else ""


def _content(folder: RunFolder, name: str) -> bytes:
    with suppress(FileNotFoundError), open_below(folder.path, name) as file:
        if len(data := file.read(_MOST + 1)) <= _MOST:
            return data
    raise CheckFailed("not signed", where=folder.path / name, expected="a signed run", remedy=_SIGN)


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
