"""Damage to files on a disk, as a function of the file, its neighbours and chance."""

import json
import os
import random
import re
import shutil
import socket
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Chance = random.Random
Damage = Callable[[Path, Sequence[Path], Chance], None]  # a file, files of the same kind, chance

STRANGE: tuple[object, ...] = (
    *(None, True, -1, 0, 1.5, 10**400, float("nan"), float("-inf"), "", "x", "../../x", "\0", "é" * 300),
    *([], [None], [[]], {}, {"": None}),
)


def _bytes(change: Callable[[bytes, Chance], bytes]) -> Damage:
    def damage(path: Path, others: Sequence[Path], chance: Chance) -> None:
        path.write_bytes(change(path.read_bytes(), chance))

    return damage


def _lines(change: Callable[[list[bytes], Chance], None]) -> Damage:
    def damage(path: Path, others: Sequence[Path], chance: Chance) -> None:
        lines = path.read_bytes().splitlines(keepends=True)
        if lines:
            change(lines, chance)
            path.write_bytes(b"".join(lines))

    return damage


def flip_a_bit(data: bytes, chance: Chance) -> bytes:
    if not data:
        return b"\1"
    place = chance.randrange(len(data))
    return data[:place] + bytes([data[place] ^ 1 << chance.randrange(8)]) + data[place + 1 :]


def change_a_digit(data: bytes, chance: Chance) -> bytes:
    places = [found.start() for found in re.finditer(rb"\d", data)]
    if not places:
        return flip_a_bit(data, chance)
    place = chance.choice(places)
    digit = (int(data[place : place + 1]) + chance.randint(1, 9)) % 10
    return data[:place] + b"%d" % digit + data[place + 1 :]


def cut_off(data: bytes, chance: Chance) -> bytes:
    return data[: chance.randrange(max(1, len(data)))]


def empty(data: bytes, chance: Chance) -> bytes:
    return b""


def zero_a_page(data: bytes, chance: Chance) -> bytes:
    size = min(len(data), chance.choice([16, 512, 4096]))
    place = chance.randrange(len(data) - size + 1)
    return data[:place] + bytes(size) + data[place + size :]


def append_rubbish(data: bytes, chance: Chance) -> bytes:
    tail = data[-chance.randint(1, 300) :]
    return data + chance.choice([chance.randbytes(chance.randint(1, 300)), b"{}\n", b"\n", b"[" * 5000, tail])


def drop_a_line(lines: list[bytes], chance: Chance) -> None:
    del lines[chance.randrange(len(lines))]


def double_a_line(lines: list[bytes], chance: Chance) -> None:
    lines.insert(chance.randint(0, len(lines)), chance.choice(lines))


def swap_two_lines(lines: list[bytes], chance: Chance) -> None:
    one, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]


def delete(path: Path, others: Sequence[Path], chance: Chance) -> None:
    path.unlink()


def swap_with_another(path: Path, others: Sequence[Path], chance: Chance) -> None:
    other = chance.choice([path, *others])
    data = path.read_bytes()
    path.write_bytes(other.read_bytes())
    other.write_bytes(data)


def copy_another_over_it(path: Path, others: Sequence[Path], chance: Chance) -> None:
    path.write_bytes(chance.choice([path, *others]).read_bytes())


def copy_it_beside(path: Path, others: Sequence[Path], chance: Chance) -> None:
    shutil.copy(path, path.with_name(f"{path.stem}{chance.randrange(10)}{path.suffix}"))


def become_a_folder(path: Path, others: Sequence[Path], chance: Chance) -> None:
    path.unlink()
    path.mkdir()
    if chance.random() < 0.5:
        (path / path.name).write_bytes(b"x")


def become_a_link(path: Path, others: Sequence[Path], chance: Chance) -> None:
    path.unlink()
    path.symlink_to(chance.choice([path.with_name("nowhere"), path, path.parent, *others]))


def become_a_pipe(path: Path, others: Sequence[Path], chance: Chance) -> None:
    """Replace the file by a pipe or a socket, where a reader must not wait for data."""
    path.unlink()
    if chance.random() < 0.7:
        os.mkfifo(path)
        return
    here = os.open(path.parent, os.O_RDONLY)
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(f"/proc/self/fd/{here}/{path.name}")  # a socket's path is limited in length
    os.close(here)


def change_json(path: Path, others: Sequence[Path], chance: Chance) -> None:
    data = path.read_bytes()
    as_lines = path.suffix == ".jsonl"
    texts = data.splitlines() if as_lines else [data]
    place = chance.randrange(max(1, len(texts)))
    try:
        value = json.loads(texts[place])
    except (ValueError, IndexError):
        path.write_bytes(flip_a_bit(data, chance))
        return
    value = changed(value, chance)
    texts[place] = json.dumps(value, indent=None if as_lines else 1).encode()
    path.write_bytes(b"".join(text + b"\n" for text in texts))


def changed(value: Any, chance: Chance, strange: Sequence[object] = STRANGE) -> Any:
    inside = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    if not inside or chance.random() < 0.1:
        return chance.choice(strange)
    place = chance.choice(list(inside))
    what = chance.random()
    if what < 0.15:
        del value[place]
    elif what < 0.25 and isinstance(value, list):
        value.append(value[place])
    elif what < 0.25:
        value[f"{place}x"] = value[place]
    else:
        value[place] = changed(value[place], chance, strange)
    return value


DAMAGES: dict[str, Damage] = {
    **{one.__name__: _bytes(one) for one in (flip_a_bit, change_a_digit, cut_off, empty)},
    **{one.__name__: _bytes(one) for one in (zero_a_page, append_rubbish)},
    **{one.__name__: _lines(one) for one in (drop_a_line, double_a_line, swap_two_lines)},
    **{one.__name__: one for one in (delete, swap_with_another, copy_another_over_it, copy_it_beside)},
    **{one.__name__: one for one in (become_a_folder, become_a_link, become_a_pipe, change_json)},
}


def contents(folder: Path) -> dict[str, bytes | str]:
    return {
        path.relative_to(folder).as_posix(): str(path.readlink()) if path.is_symlink() else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_symlink() or path.is_file()
    }


def damage(
    folder: Path, names: Sequence[str], chance: Chance, damages: Sequence[str]
) -> tuple[str, list[str]]:
    """Damage one of these files in one of these ways until it differs. Return the way and the names of all
    changed files."""
    before = contents(folder)
    while True:
        name, how = chance.choice(names), chance.choice(damages)
        DAMAGES[how](folder / name, [folder / one for one in names if one != name], chance)
        after = contents(folder)
        if touched := sorted(one for one in before | after if before.get(one) != after.get(one)):
            return how, touched
