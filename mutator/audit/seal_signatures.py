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
from mutator.audit.run_digests_and_seal import Seals
from mutator.errors import CheckFailed, MutatorError
from mutator.store.run_folder import RunFolder

SIGNED_SEAL_SCHEMA = "signed-seal/1"
SEAL_FILE, SIGNATURE_FILE = "seal.json", "seal.json.sig"
SIGNATURE_NAMESPACE = "mutator-seal"  # signatures for other purposes do not count
_SSH_KEYGEN_TIMEOUT_S = 60.0  # somebody may have to type a passphrase or to touch a key
_MOST_FILE_BYTES = 100_000  # of either file: a statement has a few hundred, but anybody can write the files
_SIGN_REMEDY = "`mutator seal RUN --sign KEY` signs the run as it is now"


def signed_statement(folder: RunFolder, seals: Seals) -> bytes:
    """Return what a signature of a run says; MutatorError for a run without a seal."""
    if seals.seal is None:
        raise MutatorError(
            "no seal",
            where=folder.path,
            expected="a finished run",
            remedy="finish it with the command that started it",
        )
    facts = {
        "schema": SIGNED_SEAL_SCHEMA,
        "seal": seals.seal,
        "results_digest": seals.results_digest,
        "review_digest": seals.review_digest,
        "plan": folder.head.plan,
        "mutator": folder.head.provenance.mutator,
    }
    return canonical_json(facts).encode() + b"\n"


def sign_seal(folder: RunFolder, seals: Seals, key: Path) -> None:
    """Sign the digests of a run with an SSH key: the file of a private key, or of a public key in ssh-agent.

    MutatorError if the key cannot sign.
    """
    if not key.is_file():
        raise MutatorError("no such file", where=key, argument="sign", expected="the file of an SSH key")
    signed = signed_statement(folder, seals)
    process = _ssh_keygen("sign", ["-f", str(key.resolve()), "-n", SIGNATURE_NAMESPACE], signed)
    if process.returncode or not process.stdout.startswith(b"-----BEGIN SSH SIGNATURE-----"):
        raise MutatorError(
            f"ssh-keygen could not sign ({_last_error_line(process)})",
            where=key,
            argument="sign",
            expected="a private SSH key, or a public one whose private key is in ssh-agent",
        )
    write_below(folder.path, SEAL_FILE, signed)
    write_below(folder.path, SIGNATURE_FILE, process.stdout)


def verified_signer(folder: RunFolder, seals: Seals, allowed_signers: Path) -> str:
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
    signed, signature = (_read_signed_file(folder, name) for name in (SEAL_FILE, SIGNATURE_FILE))
    identity, reasons = "", []
    for line in read_bounded(allowed_signers, _MOST_FILE_BYTES).splitlines():
        if line.strip() and not line.lstrip().startswith(b"#"):
            identity, reason = _valid_identities(line, signed, signature)
            reasons += [reason] if reason else []
        if identity:
            break
    if not identity:
        raise CheckFailed(
            f"signed by nobody in the list ({reasons[0] if reasons else 'no signer matches'})",
            where=folder.path / SIGNATURE_FILE,
            expected=f"the signature of {SEAL_FILE} by one of {allowed_signers}",
            remedy=f"add the signer's identity and public key, if you trust them; {_SIGN_REMEDY}",
        )
    if signed != signed_statement(folder, seals):
        raise CheckFailed(
            f"{identity} signed other digests than those of this folder",
            where=folder.path / SEAL_FILE,
            expected=signed_statement(folder, seals).decode().strip(),
            remedy=f"do not trust this folder; if you changed it yourself, {_SIGN_REMEDY}",
        )
    return identity


def _valid_identities(line: bytes, signed: bytes, signature: bytes) -> tuple[str, str]:
    """Return the identities on a line of allowed signers with which a signature is valid, or else why the
    signature of the line's key is not. ssh-keygen itself names only the first line with the key.
    """
    with (
        NamedTemporaryFile(prefix="mutator-seal-") as signature_file,
        NamedTemporaryFile(prefix="mutator-seal-") as signers_file,
    ):
        for file, content in ((signature_file, signature), (signers_file, line + b"\n")):
            file.write(content)
            file.flush()
        signer_arguments = ["-f", signers_file.name, "-s", signature_file.name]
        principals = _ssh_keygen("find-principals", signer_arguments)
        names = principals.stdout.decode("utf-8", "replace").replace(",", "\n").splitlines()
        names = [name for name in names if name.isprintable() and not name.startswith("!")]
        if principals.returncode or not names:
            return "", _message_on_line(principals, signers_file.name)
        checks = {
            name: _ssh_keygen("verify", [*signer_arguments, "-I", name, "-n", SIGNATURE_NAMESPACE], signed)
            for name in names
        }
    valid = [name for name, process in checks.items() if not process.returncode]
    verification = checks[names[0]]
    message = _message_on_line(verification, signers_file.name) or _last_error_line(verification)
    reason = f"not a valid signature of {names[0]}: {message}"
    return ", ".join(valid), "" if valid else reason


def _message_on_line(process: subprocess.CompletedProcess[bytes], file: str) -> str:
    """Return what ssh-keygen said about the only line of a file, such as that its key has expired."""
    match = re.search(f"^{re.escape(file)}:1: (.*)", process.stderr.decode("utf-8", "replace"), re.MULTILINE)
    return match[1].strip() if match else ""


def _read_signed_file(folder: RunFolder, name: str) -> bytes:
    with suppress(FileNotFoundError), open_below(folder.path, name) as file:
        if len(data := file.read(_MOST_FILE_BYTES + 1)) <= _MOST_FILE_BYTES:
            return data
    raise CheckFailed("not signed", where=folder.path / name, expected="a signed run", remedy=_SIGN_REMEDY)


def _ssh_keygen(verb: str, arguments: Sequence[str], data: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(
            ["ssh-keygen", "-Y", verb, *arguments],
            input=data,
            capture_output=True,
            timeout=_SSH_KEYGEN_TIMEOUT_S,
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
            f"ssh-keygen did not answer within {_SSH_KEYGEN_TIMEOUT_S:g} s",
            expected="a key without a passphrase, or one in ssh-agent",
        ) from None


def _last_error_line(process: subprocess.CompletedProcess[bytes]) -> str:
    lines = [line for line in process.stderr.decode("utf-8", "replace").splitlines() if line.strip()]
    return lines[-1] if lines else f"exit code {process.returncode}"
