"""What the HTML pages share: their CSS and JavaScript as files of this package, and data carried in a page.

The scripts are plain ones, in the order that a page names them; each declares one constant of its own name.
"""

import base64
import gzip
import json
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def asset(name: str) -> str:
    """The text of a file of this folder; CSS and JavaScript are ready for `<style>` and `<script>`."""
    text = files(__package__).joinpath(name).read_text(encoding="utf-8")
    if not name.endswith(".html") and ("</script" in text or "</style" in text):
        raise ValueError(f"{name} would end the element it is put into")
    return text


def packed(value: Any) -> str:
    """`value` as JSON, compressed, in base64, the same text each time; packed.js reads it."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    # mtime 0: a page is the same each time it is made
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=9, mtime=0)).decode("ascii")


def plainly_embedded(value: Any, name: str) -> str:
    """A script element with the id `name` that carries `value` as JSON, for scripts that need it at once."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def embedded(value: Any, name: str) -> str:
    """A script element with the id `name` that carries `value`; `Packed.read(name)` gives it back."""
    return f'<script type="application/octet-stream+gzip" id="{name}">{packed(value)}</script>'
