"""The version of this program, kept apart so that every part may ask for it."""

VERSION = "0.2.0"
