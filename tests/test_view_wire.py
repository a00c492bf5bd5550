"""What reaches the server of the live page when what speaks to it is no page: nothing of it may matter to the run."""

import math
import random
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fingergait.run.stepper import Event
from fingergait.scenario import Disturbance, Input, Scenario
from fingergait.view import server

if server.missing is not None:
    pytest.skip("expected the packages of the live page: pip install 'fingergait[view]'", allow_module_level=True)
import msgspec
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from fingergait.view.inputs import CONTROLS, FORCE
from fingergait.view.page import Page
from fingergait.view.play import bench

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 0.0, 1.0],
    "fov": 0.6,
    "near": 0.01,
    "far": 10.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}
JUNK = [
    math.nan,
    math.inf,
    -math.inf,
    1e308,
    -1e308,
    -1,
    0,
    3,
    0.5,
    2**63,
    "",
    "x",
    "+x",
    "power",
    True,
    None,
    b"x",
    [],
]
JUNK += [[], [1.0], [math.nan] * 3, ["a", "b", "c"], [0.02, -0.9, 1e9], {"a": 1}, [[1.0]], [0.1, 0.2, 0.3, 0.4]]


def speak(page: Page) -> ClientConnection:
    """A connection that the server takes for a page."""
    subprotocol = Subprotocol(f"viser-v{viser.__version__}")
    line = connect(f"ws://127.0.0.1:{page.server.get_port()}", subprotocols=[subprotocol], max_size=None)
    line.send(msgspec.msgpack.encode(CAMERA))
    return line


def nonsense(dice: random.Random, widgets: list[str]) -> bytes:
    """A message of a page with junk in it."""
    value = dice.choice(JUNK)
    kind = dice.random()
    if kind < 0.7:
        message: dict[str, Any] = {
            "type": "GuiUpdateMessage",
            "uuid": dice.choice(widgets),
            "updates": {"value": value},
        }
    elif kind < 0.95:
        place, turn = dice.choice([value, [0.9, -0.9, 0.9]]), dice.choice([dice.choice(JUNK), [2.0, 0.1, 0.0, -0.1]])
        message = {"type": "TransformControlsUpdateMessage", "name": "/goal/gizmo", "position": place, "wxyz": turn}
    else:
        message = CAMERA | {"position": value}
    return msgspec.msgpack.encode(message) if dice.random() < 0.98 else dice.randbytes(20)


@pytest.mark.timeout(600)
@pytest.mark.filterwarnings("ignore:.viser. .* does not match:UserWarning")
def test_nothing_that_is_sent_ends_the_run_or_leaves_its_range(tmp_path: Path) -> None:
    dice = random.Random(1)
    with bench(Scenario.load("lift-and-rotate"), server.HOST, 18400, folder=tmp_path) as (session, page):
        widgets = list(page.server.gui._gui_input_handle_from_uuid)
        assert len(widgets) > 20
        taken: list[Event] = []
        take = session.inputs.take

        def noted(t: float) -> list[Event]:
            events = take(t)
            taken.extend(events)
            return events

        session.inputs.take = noted  # type: ignore[method-assign]
        line, refused = speak(page), 0
        for k in range(400):
            try:
                line.send(nonsense(dice, widgets))
            except ConnectionClosed:  # what is no message at all costs its sender the line
                line, refused = speak(page), refused + 1
            if k % 50 == 0:
                session.pacer.pause(False)
                time.sleep(0.02)
        steps = session.steps
        session.pacer.pause(False)
        session.pacer.set_speed(1.0)
        until = time.perf_counter() + 100.0
        while session.steps < steps + 300 and time.perf_counter() < until:
            time.sleep(0.05)
        assert session.steps >= steps + 300 and refused > 0
        assert session.failure is None and page.failure is None
        lower, upper = session.inputs.bounds
        line.close()
    ranges = {key: (c.lower * f, c.upper * f) for c in CONTROLS.values() for key, f in c.keys.items()}
    assert any(isinstance(event, Input) and event.key == "reference.offset" for event in taken)
    for event in taken:
        if isinstance(event, Disturbance):
            assert FORCE[0] <= max(map(abs, event.force)) <= FORCE[1]
        elif isinstance(event, Input) and event.key == "reference.offset":
            offset = np.array(event.value)
            assert (offset >= lower).all() and (offset <= upper).all()
        elif isinstance(event, Input):
            least, most = ranges[event.key]
            assert least - 1e-12 <= event.number <= most + 1e-12
