"""Assets of the HTML pages (the CSS and JavaScript files below this package), and data embedded in pages.

Each page has a folder. `shared` and `replay` have what pages share. Scripts are not modules, because pages
are opened from disk. Each script declares one constant, which later scripts use. A page's `order.txt` lists
its files in load order.
"""

import base64
import gzip
import hashlib
import json
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def asset_text(name: str) -> str:
    """Return the text of a file such as `shared/dom.js`, which is safe inside `<style>` and `<script>`."""
    text = files(__package__).joinpath(name).read_text(encoding="utf-8")
    if not name.endswith(".html") and ("</script" in text or "</style" in text):
        raise ValueError(f"{name} would end the element it is put into")
    return text


@cache
def load_order(page: str, suffix: str) -> tuple[str, ...]:
    """Return the names of the scripts (suffix `.js`) or style sheets (`.css`) of a page in load order."""
    return tuple(name for name in asset_text(f"{page}/order.txt").split() if name.endswith(suffix))


@cache
def asset_names(suffix: str) -> tuple[str, ...]:
    """Return the names of all files with a suffix, sorted."""
    folders = [folder for folder in files(__package__).iterdir() if folder.is_dir()]
    names = [f"{folder.name}/{file.name}" for folder in folders for file in folder.iterdir()]
    return tuple(sorted(name for name in names if name.endswith(suffix)))


def csp_hash(text: str) -> str:
    """Return the source expression with which a content security policy allows an inline script or style."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def pack_json(value: Any) -> str:
    """Pack `value` as compressed JSON in base64, which packed.js reads. Equal values give equal text."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=9, mtime=0)).decode("ascii")


def json_script_element(value: Any, name: str) -> str:
    """Return a script element with id `name` that contains `value` as plain JSON, for scripts that need it
    immediately.
    """
    text = json.dumps(value, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def packed_script_element(value: Any, name: str) -> str:
    """Return a script element with id `name` with `value`, compressed. `Packed.read(name)` reads it."""
    return f'<script type="application/octet-stream+gzip" id="{name}">{pack_json(value)}</script>'
