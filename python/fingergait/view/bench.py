"""The controls of the bench that people play with: gizmo, sliders, pushes, faults, reset and save."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import viser
import viser.transforms as vtf

from fingergait._core import ConfigError
from fingergait.files import make_folder, write_text
from fingergait.view.inputs import CONTROLS, DIRECTIONS, FAULT_TIME, FORCE, Control
from fingergait.view.page import Page
from fingergait.view.pose import Pose
from fingergait.view.session import Session

_ASKED, _TRUE = ("yaw_rate", "swing"), ("friction", "mass", "noise", "delay")


class Bench:
    """Adds the controls of a session to its page.

    Parameters
    ----------
    page, session
        What is shown, and what runs.
    saved
        File that `save` writes; it is overwritten.
    """

    def __init__(self, page: Page, session: Session, saved: Path) -> None:
        self._session, self._saved, self._page = session, saved, page
        self._gui = page.server.gui
        self._runs = session.runs
        self._sliders: dict[str, Any] = {}
        self._size = page.drawing.size
        self._base = page.server.scene.add_frame("/goal", show_axes=False)
        self._add_gizmo()
        with self._gui.add_folder("Asked of the controller"):
            self._gui.add_markdown("Drag the gizmo on the object: it is the desired pose.")
            self._add_sliders(_ASKED)
            self._button("gizmo back", self._centre, viser.Icon.HOME)
        with self._gui.add_folder("True, and unknown to it"):
            self._add_sliders(_TRUE)
        self._add_pushes()
        self._add_faults()
        with self._gui.add_folder("Run"):
            self._button("reset", session.reset, viser.Icon.REFRESH)
            self._button("save as a scenario", self._save, viser.Icon.DEVICE_FLOPPY)
            self._note = self._gui.add_markdown("")
        page.ticks.append(self._tick)
        page.lost = lambda: session.lost

    def _button(self, label: str, do: Callable[[], None], icon: viser.IconName) -> None:
        button = self._gui.add_button(label, icon=icon)
        button.on_click(lambda _: do())

    def _add_gizmo(self) -> None:
        """A gizmo where the offset is zero, in place of the one that is there."""
        lower, upper = self._session.inputs.bounds
        limits = [(float(a), float(b)) for a, b in zip(lower, upper, strict=True)]
        self._gizmo = self._page.server.scene.add_transform_controls(
            "/goal/gizmo",
            scale=0.6 * self._size,
            line_width=3.0,
            translation_limits=(limits[0], limits[1], limits[2]),
            rotation_limits=(limits[3], limits[4], limits[5]),
            depth_test=False,
            opacity=0.7,
        )

        @self._gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:  # async: in the order of the drag
            offset = self._session.inputs.goal(_offset(event.target.position, event.target.wxyz))
            if offset is None:
                self._add_gizmo()  # the page has made nonsense of this one
            elif event.phase == "end":
                self._show_goal(np.array(offset))

    def _show_goal(self, offset: np.ndarray[Any, np.dtype[np.float64]]) -> None:
        self._gizmo.position = offset[:3]
        self._gizmo.wxyz = vtf.SO3.exp(offset[3:]).wxyz

    def _centre(self) -> None:
        self._session.inputs.goal(np.zeros(6))
        self._add_gizmo()

    def _add_sliders(self, names: tuple[str, ...]) -> None:
        for name in names:
            self._sliders[name] = self._slider(name, CONTROLS[name])

    def _slider(self, name: str, control: Control) -> Any:
        unit = f", {control.unit}" if control.unit else ""
        slider = self._gui.add_slider(
            f"{control.label}{unit}",
            min=control.lower,
            max=control.upper,
            step=control.step,
            initial_value=control.value(self._session.scenario),
            hint=control.hint,
        )

        @slider.on_update
        def _(event: Any) -> None:
            if event.client is not None:  # not what `reset` sets
                self._session.inputs.set(name, slider.value)

        return slider

    def _add_pushes(self) -> None:
        with self._gui.add_folder("Push the object"):
            force = self._gui.add_slider("force, N", min=FORCE[0], max=FORCE[1], step=0.5, initial_value=5.0)
            buttons = self._gui.add_button_group("push", tuple(DIRECTIONS))

            @buttons.on_click
            def _(event: Any) -> None:
                self._session.inputs.push(buttons.value, force.value)

    def _add_faults(self) -> None:
        inputs = self._session.inputs
        fingers = tuple(str(j) for j in range(len(self._session.scene.fingers)))
        with self._gui.add_folder("Break something"):
            time = self._gui.add_slider("for, s", min=FAULT_TIME[0], max=FAULT_TIME[1], step=0.5, initial_value=3.0)
            power = self._gui.add_button_group("no power, finger", fingers)
            touch = self._gui.add_button_group("touch dies, finger", fingers)
            self._button("pose goes stale", lambda: _ignore(inputs.fault("stale", None, time.value)), viser.Icon.CLOCK)

            @power.on_click
            def _(event: Any) -> None:
                inputs.fault("power", fingers.index(power.value) if power.value in fingers else None, time.value)

            @touch.on_click
            def _(event: Any) -> None:
                inputs.fault("tactile", fingers.index(touch.value) if touch.value in fingers else None, time.value)

    def _save(self) -> None:
        try:
            make_folder(self._saved.parent, "save")
            write_text(self._saved, tomli_w.dumps(self._session.saved()))
        except ConfigError as error:
            self._note.content = f"not saved: {error}"
            return
        self._note.content = f"saved: `{self._saved}`. It repeats with `fingergait run {self._saved}`"

    def _tick(self, pose: Pose) -> None:
        base = np.round(pose.row.group("desired")[:3] - self._session.offset[:3], 4)
        if not np.array_equal(base, self._base.position):
            self._base.position = base
        if self._runs != self._session.runs:
            self._runs = self._session.runs
            self._add_gizmo()
            self._page.overlays.forget()
            for name, slider in self._sliders.items():
                slider.value = CONTROLS[name].value(self._session.scenario)


def _offset(place: Any, turn: Any) -> list[float] | None:
    """Translation, m, and rotation vector, rad, of a gizmo with this position and wxyz quaternion; None if it is none.

    They come from the page, and may be anything.
    """
    try:
        p, q = np.array(place, dtype=float).reshape(3), np.array(turn, dtype=float).reshape(4)
    except (TypeError, ValueError, OverflowError):
        return None
    if not (np.isfinite(p).all() and np.isfinite(q).all() and q.any()):
        return None
    q /= np.abs(q).max()  # so that its length is finite too
    return [*p.tolist(), *vtf.SO3(q / np.linalg.norm(q)).log().tolist()]


def _ignore(_: object) -> None:
    """A button needs no answer."""
