"""What keeps a model from being a hand: collected, so that all of it is said at once."""

from dataclasses import dataclass

from fingergait._core import ConfigError


@dataclass(frozen=True)
class Obstacle:
    """One thing that the importer can't do without: where it is, what was expected and found, and what to do."""

    where: str
    expected: str
    found: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.where}: expected {self.expected}, found {self.found}; {self.remedy}"


class HandError(ConfigError):
    """A model that is no hand yet; `obstacles` has everything that is in the way."""

    def __init__(self, source: str, obstacles: list[Obstacle]) -> None:
        self.obstacles = obstacles
        text = str(obstacles[0])
        if len(obstacles) > 1:
            text = "".join(f"\n  {obstacle}" for obstacle in obstacles)
        super().__init__(f"{source}: {text}")


class Notes:
    """What an import has to say: obstacles, changes to the model, warnings."""

    def __init__(self) -> None:
        self.obstacles: list[Obstacle] = []
        self.changes: list[str] = []
        self.warnings: list[str] = []

    def obstacle(self, where: str, expected: str, found: str, remedy: str) -> None:
        """Adds an obstacle."""
        self.obstacles.append(Obstacle(where, expected, found, remedy))

    def change(self, text: str) -> None:
        """Adds a change, once."""
        if text not in self.changes:
            self.changes.append(text)

    def warn(self, text: str) -> None:
        """Adds a warning, once."""
        if text not in self.warnings:
            self.warnings.append(text)

    def settle(self, source: str) -> None:
        """Raises what is in the way, if anything is."""
        if self.obstacles:
            raise HandError(source, self.obstacles)
