"""Files that the workers of a session share, in a folder where mutants can write, too."""

import hmac
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import write_atomic

_AUTHENTICATION_CODE_BYTES = 32  # of SHA-256


class AuthenticatedFiles:
    """Files of `folder`, each of which counts only if whoever wrote it had the `secret`."""

    def __init__(self, folder: Path, secret: bytes) -> None:
        self._folder = folder
        self._secret = secret

    def load(self, name: str) -> bytes | None:
        """Return the content of a file; None if no engine with the same secret wrote it."""
        path = self._folder / name
        if not path.is_file():
            return None
        content = read_bounded(path)
        code, data = content[:_AUTHENTICATION_CODE_BYTES], content[_AUTHENTICATION_CODE_BYTES:]
        is_authentic = data and hmac.compare_digest(code, self._authentication_code(name, data))
        return data if is_authentic else None

    def save(self, name: str, data: bytes) -> None:
        write_atomic(self._folder / name, self._authentication_code(name, data) + data)

    def _authentication_code(self, name: str, data: bytes) -> bytes:
        return hmac.digest(self._secret, name.encode() + data, "sha256")
