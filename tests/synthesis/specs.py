"""Where the shipped specs are."""

from pathlib import Path

SPECS = Path(__file__).parents[2] / "models" / "specs"
CONTACT = SPECS / "contact.toml"
LITERAL = SPECS / "paper-literal.toml"
SCALED = SPECS / "paper-scaled.toml"
