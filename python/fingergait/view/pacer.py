"""Real time, pause, step and speed: whoever simulates asks when the next control step is due."""

import math
import threading
import time

_AHEAD = 0.008  # s that the simulation may be ahead of the clock: it sleeps a few times a frame and not each step
_BEHIND = 0.5  # s behind which it stops running after the clock
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


class Pacer:
    """The clock of a live run. All methods may be called from any thread."""

    def __init__(self, paused: bool = False) -> None:
        self._changed = threading.Condition()
        self._paused, self._steps = paused, 0
        self._speed = 1.0
        self._ended = self._woken = False
        self._anchor: tuple[float, float] | None = None  # clock, simulated time
        self._mark: tuple[float, float] | None = None
        self._factor = 0.0

    @property
    def paused(self) -> bool:
        """Whether the run stands."""
        return self._paused

    @property
    def speed(self) -> float:
        """Simulated over real time that is asked for."""
        return self._speed

    @property
    def factor(self) -> float:
        """Simulated over real time as it was in the last second; zero while paused."""
        return 0.0 if self._paused else self._factor

    def wait(self, t: float, timeout: float | None = None) -> bool:
        """True when the control step of simulated time t, s, is due; False after `wake`, `end` and `timeout`, s."""
        until = math.inf if timeout is None else time.perf_counter() + timeout
        with self._changed:
            while not self._ended:
                if self._woken:
                    self._woken = False
                    return False
                now = time.perf_counter()
                if now > until:
                    return False
                left = until - now if timeout is not None else None
                if self._paused:
                    self._anchor = self._mark = None
                    if self._steps > 0:
                        self._steps -= 1
                        return True
                    self._changed.wait(left)
                    continue
                if self._anchor is None or t < self._anchor[1]:
                    self._anchor = self._mark = now, t
                if self._mark is None or now - self._mark[0] >= 1.0:
                    if self._mark is not None:
                        self._factor = (t - self._mark[1]) / (now - self._mark[0])
                    self._mark = now, t
                due = self._anchor[0] + (t - self._anchor[1]) / self._speed
                if now > due + _BEHIND:
                    self._anchor = now, t
                if due - now < _AHEAD:
                    return True
                self._changed.wait(min(due - now, until - now))
            return False

    def pause(self, paused: bool) -> None:
        """Lets the run stand, or go on."""
        with self._changed:
            self._paused, self._steps = paused, 0
            self._changed.notify_all()

    def step(self) -> None:
        """One control step; pauses a run that goes."""
        with self._changed:
            self._steps = self._steps + 1 if self._paused else 1
            self._paused = True
            self._changed.notify_all()

    def set_speed(self, speed: float) -> None:
        """Simulated over real time, one of `SPEEDS` or between."""
        with self._changed:
            self._speed = min(max(speed, SPEEDS[0]), SPEEDS[-1])
            self._anchor = self._mark = None
            self._changed.notify_all()

    def restart(self) -> None:
        """Takes the simulated time of the next `wait` as the present: it has jumped."""
        with self._changed:
            self._anchor = self._mark = None
            self._woken = True
            self._changed.notify_all()

    def wake(self) -> None:
        """Lets the present or the next `wait` return although its step isn't due."""
        with self._changed:
            self._woken = True
            self._changed.notify_all()

    def end(self) -> None:
        """Lets every `wait` return at once from now on."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
