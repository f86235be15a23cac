"""What a run folder says about the defences in its tree."""

from dataclasses import dataclass

from mutator.defences.defence import Defence, Kind, Role

SET_SEPARATOR = "+"  # between the names of defences in the name of a set


@dataclass(frozen=True, slots=True, kw_only=True)
class DefenceFacts:
    """A defence, with the digest of its file and its model."""

    name: str
    role: Role
    kind: Kind
    about: str
    commands: tuple[str, ...]
    digest: str

    @classmethod
    def of_defence(cls, defence: Defence) -> "DefenceFacts":
        return cls(
            name=defence.name,
            role=defence.role,
            kind=defence.kind,
            about=defence.about,
            commands=defence.commands,
            digest=defence.digest,
        )


def set_name(names: tuple[str, ...]) -> str:
    """Return the name of a set of defences: their names, joined by `+`."""
    return SET_SEPARATOR.join(names)
