"""Errors that the synthesis raises on purpose."""

from fingergait._core import FingergaitError


class SynthesisError(FingergaitError):
    """The synthesis cannot deliver what was asked for: says which step stopped and what was found."""


class SpecError(SynthesisError, ValueError):
    """A synthesis spec is wrong: names the field, what was expected and what was found."""


class InfeasibleSpecError(SynthesisError):
    """The spec has no solution with mu < 1: names the floor that stops it and what to change."""


class LibraryError(SynthesisError):
    """A numerical library failed, or its answer does not hold: names the routine and the failed check."""
