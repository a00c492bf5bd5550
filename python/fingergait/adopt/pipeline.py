"""From a model's file to a bundle that turns objects, by stages: hand, grasps, controller, scenarios, verification.

Each stage writes its part of the bundle and is not repeated while its inputs stand.
"""

import json
import os
import tempfile
import time
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fingergait.adopt.bundle import HAND, write_hand, write_scenario
from fingergait.adopt.choose import LENGTH, candidates, ordered, try_turn
from fingergait.adopt.contact import identified
from fingergait.adopt.control import Base, Fitted, artefact_of, design, fit
from fingergait.adopt.family import FAMILIES, ObjectSpec
from fingergait.adopt.grasp import Grasp
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.page import write_page
from fingergait.adopt.picture import write_map
from fingergait.adopt.progress import bar
from fingergait.adopt.reflected import reflected
from fingergait.adopt.stages import Stages, digest_of
from fingergait.adopt.survey import objects_for, search_grasps
from fingergait.adopt.verify import Trial, run_trial, summary
from fingergait.adopt.view import HandView, view_of
from fingergait.files import make_folder, whole_file, write_text
from fingergait.hand import import_hand
from fingergait.hand.facts import facts_beside
from fingergait.paths import find_hand
from fingergait.scenario import Scenario
from fingergait.stopping import in_processes
from fingergait.synthesis.artefact import Nominal
from fingergait.synthesis.contact_plant import ReflectedHand

CONTROLLER, MAP, GRASPS, REPORT, FILM = "controller.json", "map.png", "grasps.json", "report.json", "turn.png"
_SIZES, _QUICK_SIZES = 6, 4  # objects of each family that the search looks at
_TRIED, _QUICK_TRIED = 8, 4  # objects that are turned to choose among them
_SEEDS, _QUICK_SEEDS = 3, 1  # runs each way, besides the one without errors
_GAIT_S = 0.7  # s that a gait takes: unloading, sliding and loading
_FASTEST = 0.2  # rad/s
_STEP = 0.1  # of the contacts' radius, and rad: the step that step.toml asks for
_SETTLED = 1.0  # s before a turn or a step begins


class Adoption:
    """One adoption: its stages are worked out, or read from the bundle, when they are asked for.

    Attributes
    ----------
    out
        The bundle's folder.
    """

    def __init__(
        self,
        model: str | Path,
        facts: str | Path | None = None,
        out: str | Path | None = None,
        *,
        objects: tuple[str, ...] = FAMILIES,
        mass: float | None = None,
        quick: bool = False,
        workers: int | None = None,
        progress: bool = True,
    ) -> None:
        self.model = find_hand(model, "MODEL")
        self.facts = Path(facts) if facts is not None else facts_beside(self.model)
        self.out = Path(out) if out is not None else Path("runs") / f"adopt-{self.model.stem}"
        self.objects, self.mass, self.quick, self.progress = objects, mass, quick, progress
        self.workers = min(workers or os.cpu_count() or 1, os.cpu_count() or 1)
        make_folder(self.out)
        self.stages = Stages(self.out)

    @cached_property
    def hand(self) -> dict[str, Any]:
        """Stage 1: the hand in the bundle; `files`, `fingers`, `changes` and `warnings` of the import.

        Raises
        ------
        HandError
            With everything that is in the way, each with what to write where.
        """
        imported = import_hand(self.model, self.facts)
        files = write_hand(self.model, self.facts, self.out)
        fingers = [
            {
                "name": finger.name,
                "joints": [str(imported.model.joint(joint).name) for joint in finger.joints],
                "tip_radius_m": finger.sphere.radius,
                "tip_fit_error_m": finger.sphere.error,
                "tau_min": [motor.low for motor in finger.motors],
                "tau_max": [motor.high for motor in finger.motors],
            }
            for finger in imported.fingers
        ]
        lags = [motor.lag for finger in imported.fingers for motor in finger.motors]
        return {
            "source": imported.source,
            "files": files,
            "fingers": fingers,
            "lag": float(np.median(lags)),
            "changes": list(imported.changes),
            "warnings": list(imported.warnings),
        }

    @cached_property
    def view(self) -> HandView:
        """The bundle's hand as the search sees it, under the model's name."""
        name = self.hand["source"]  # which writes the hand, too
        return replace(view_of(import_hand(self.out / HAND)), name=name)

    @cached_property
    def grasps(self) -> dict[str, Any]:
        """Stage 2: what the search found, as `GraspSearch.as_json`; with the map of what is possible."""
        asked = {"objects": list(self.objects), "mass": self.mass, "quick": self.quick}
        return dict(self.stages.get("grasps", [self._hand_digest, asked], self._search, [MAP, GRASPS]))

    def _search(self) -> dict[str, Any]:
        options = SearchOptions().quick() if self.quick else SearchOptions()
        objects = objects_for(self.view, self.objects, self.mass, _QUICK_SIZES if self.quick else _SIZES)
        search = search_grasps(self.view, objects, options, workers=self.workers, progress=self.progress)
        with whole_file(self.out / MAP) as file:
            write_map(search, file)
        values = search.as_json()
        write_text(self.out / GRASPS, _text(values))
        return values

    @cached_property
    def tried(self) -> list[dict[str, Any]]:
        """Stage 3: short turns from the most promising grasps, each with a K fitted by the model; the best one first.

        `grasp`, and `rows` of its runs both ways, see `verify.run_trial`.
        """
        most = _QUICK_TRIED if self.quick else _TRIED
        grasps = [grasp.as_json() for grasp in candidates(self.grasps, most)]
        return list(self.stages.get("choice", [self._hand_digest, grasps], lambda: self._try(grasps)))

    def _try(self, grasps: list[dict[str, Any]]) -> list[dict[str, Any]]:
        base, own = Base.load(), [Grasp.from_json(values) for values in grasps]
        with tempfile.TemporaryDirectory() as name, bar("choice", 2 * len(own), self.progress) as advance:
            folder, calls = Path(name), []
            for number, grasp in enumerate(own):
                fitted, nominal = self._fitted(base, grasp), nominal_of(grasp.object)
                artefact_of(base, nominal, fitted.spec, fitted.axes, {}).write(folder / f"{number}.json")
                turn = self._turn(grasp)
                turn["duration"] = min(LENGTH, turn["duration"])
                values = {**self._start(grasp), **turn, "controller": {"file": f"{number}.json"}}
                write_scenario(folder / f"{number}.toml", values)
                calls += [(try_turn, (folder, f"{number}.toml", sense)) for sense in (1, -1)]
            rows: dict[int, dict[str, Any]] = {}
            for number, row in in_processes(calls, min(self.workers, max(1, len(calls)))):
                rows[number] = row
                advance(str(own[number // 2].object))
        pairs = [[rows[2 * i], rows[2 * i + 1]] for i in range(len(own))]
        return [{"grasp": grasps[i], "rows": pairs[i]} for i in ordered(own, pairs)]

    def _fitted(self, base: Base, grasp: Grasp) -> Fitted:
        """The packaged K fitted to a grasp by the model alone."""
        hand, spec = reflected(self.view, grasp), grasp.object
        return fit(base, nominal_of(spec), spec.radius, hand, self.hand["lag"])

    @cached_property
    def chosen(self) -> list[Grasp]:
        """The grasps to go on with: the one that turned best is the nominal one; then the best of each other family.

        With `quick` the nominal one only.
        """
        chosen: dict[str, Grasp] = {}
        for entry in self.tried:
            grasp = Grasp.from_json(entry["grasp"])
            chosen.setdefault(grasp.object.family, grasp)
        return list(chosen.values())[: 1 if self.quick else None]

    @cached_property
    def controller(self) -> dict[str, Any]:
        """Stage 4: K for the nominal object in this hand; empty where there is no grasp. See `control.design`."""
        if not self.chosen:
            return {}
        nominal = self.chosen[0].as_json()
        return dict(self.stages.get("controller", [self._hand_digest, nominal, self.quick], self._design, [CONTROLLER]))

    def _design(self) -> dict[str, Any]:
        grasp, base = self.chosen[0], Base.load()
        spec, radius, lag = grasp.object, grasp.object.radius, self.hand["lag"]
        nominal = nominal_of(spec)
        weight = spec.mass * float(np.linalg.norm(self.view.gravity))
        with bar("controller", 3, self.progress) as advance:
            model, first = reflected(self.view, grasp), self._fitted(base, grasp)
            trial = {**self._start(grasp), "controller": {"file": str((self.out / CONTROLLER).resolve())}}
            artefact_of(base, nominal, first.spec, first.axes, {}).write(self.out / CONTROLLER)
            advance("pulses in contact")
            damping = identified(trial, first.spec, weight, radius)
            advance("mu")
            felt = ReflectedHand(model.inertia, damping.matrix)
            artefact, figures = design(base, nominal, radius, felt, lag, search=not self.quick)
            artefact.write(self.out / CONTROLLER)
            advance("done")
        variants = {"all fingers": model} | {
            f"{finger.name} away": reflected(self.view, grasp, j) for j, finger in enumerate(self.view.fingers)
        }
        plants = {
            name: {"inertia": np.diag(p.inertia).tolist(), "damping": np.diag(p.damping).tolist()}
            for name, p in variants.items()
        }
        return {**figures, "damping": damping.words, "damping_matrix": damping.matrix.tolist(), "plants": plants}

    @cached_property
    def scenarios(self) -> list[dict[str, Any]]:
        """Stage 5: the scenarios written; `file`, `task` and `object` of each."""
        if not self.chosen:
            return []
        inputs = [self._hand_digest, self.controller, [grasp.as_json() for grasp in self.chosen]]
        return list(
            self.stages.get("scenarios", inputs, self._write_scenarios, ["hold.toml", "step.toml", "turn.toml"])
        )

    def _write_scenarios(self) -> list[dict[str, Any]]:
        written = []
        for number, grasp in enumerate(self.chosen):
            start, spec = {**self._start(grasp), "controller": {"file": CONTROLLER}}, grasp.object
            end = "" if number == 0 else f"-{spec.family}-{1e3 * spec.radius:.0f}mm"
            tasks: dict[str, dict[str, Any]] = {"turn": self._turn(grasp)}
            if number == 0:
                shift = _STEP * spec.radius
                step = [shift, 0.0, shift, 0.0, 0.0, _STEP]
                tasks["hold"] = {"duration": 10.0}
                tasks["step"] = {"duration": 4.0, "reference": {"step": step, "step_at": _SETTLED}}
            for task, values in tasks.items():
                file = f"{task}{end}.toml"
                relative = {**start, "hand": {"file": HAND}}
                write_scenario(self.out / file, {**relative, **values})
                written.append(
                    {"file": file, "task": task, "object": str(spec), "radius": spec.radius, "kind": grasp.kind}
                )
        return written

    def _start(self, grasp: Grasp) -> dict[str, Any]:
        values = grasp.scenario(str((self.out / HAND).resolve()))
        values["description"] = f"{grasp.object}, {1e3 * grasp.object.mass:.0f} g, from a grasp that was searched for."
        values.pop("name")
        return values

    def _turn(self, grasp: Grasp) -> dict[str, Any]:
        """One turn at the rate by rule: each finger in its turn goes back by the stroke while the others follow it.

        A hand that can't spare a finger is asked for its stroke only.
        """
        rate = min(_FASTEST, grasp.stroke / (len(self.view.fingers) * _GAIT_S))
        rate = max(0.01, np.floor(100.0 * rate) / 100.0)
        angle = 2.0 * np.pi if grasp.kind == "gait" else grasp.stroke
        reference = {"yaw_rate": float(rate), "motion_at": _SETTLED}
        return {"duration": round(_SETTLED + 0.25 + angle / rate, 2), "reference": reference}

    @cached_property
    def verified(self) -> list[dict[str, Any]]:
        """Stage 6: figures of the runs of each scenario, see `verify.summary`; `rows` has every run."""
        if not self.scenarios:
            return []
        files = [HAND, *self.hand["files"], CONTROLLER, *(entry["file"] for entry in self.scenarios)]
        seeds = _QUICK_SEEDS if self.quick else _SEEDS
        return list(self.stages.get("verification", [digest_of(self.out, files), self.scenarios, seeds], self._verify))

    def _verify(self) -> list[dict[str, Any]]:
        seeds: list[int | None] = [None, *range(_QUICK_SEEDS if self.quick else _SEEDS)]
        trials = [
            Trial(entry["file"], seed, sense, FILM if (entry["file"], seed, sense) == ("turn.toml", None, 1) else None)
            for entry in self.scenarios
            for seed in (seeds if entry["task"] == "turn" else seeds[:1])
            for sense in ((1, -1) if entry["task"] == "turn" else (1,))
        ]
        rows: dict[int, dict[str, Any]] = {}
        with bar("verification", len(trials), self.progress) as advance:
            calls = [(run_trial, (self.out, trial)) for trial in trials]
            for number, row in in_processes(calls, min(self.workers, len(calls))):
                rows[number] = row
                advance(row["scenario"])
        found = []
        for entry in self.scenarios:
            own = [rows[i] for i, trial in enumerate(trials) if trial.scenario == entry["file"]]
            found.append({**entry, **summary(own), "rows": own})
        return found

    @cached_property
    def report(self) -> dict[str, Any]:
        """The JSON of `fingergait adopt`, from the runs only; `turns`: whether the hand turned its object, always."""
        begin = time.perf_counter()
        verified = self.verified
        turns = [entry for entry in verified if entry["task"] == "turn"]
        good = [entry for entry in turns if entry["kind"] == "gait" and entry["completed"] == entry["runs"]]
        radii = [entry["radius"] for entry in good]
        nominal = turns[0] if turns else None
        values = {
            "bundle": str(self.out),
            "hand": self.hand["source"],
            "fingers": self.hand["fingers"],
            "changes": self.hand["changes"],
            "warnings": self.hand["warnings"],
            "turns": bool(nominal) and nominal in good,
            "reason": self._reason(nominal, good),
            "objects": [min(radii), max(radii)] if radii else None,
            "rate_max": self._rate(nominal) if nominal in good else None,
            "mu_peak": self.controller.get("mu_peak"),
            "controller": self.controller,
            "verified": [{k: v for k, v in entry.items() if k != "rows"} for entry in verified],
            "tried": [_tried(entry) for entry in self.tried],
            "not_possible": [
                {
                    "object": str(ObjectSpec(e["family"], tuple(e["size"]), e["mass"])),
                    "kind": e["kind"],
                    "why": e["reason"],
                }
                for e in self.grasps["objects"]
                if e["reason"]
            ],
            "report": str(self.out / "report.html"),
            "repeated": list(self.stages.repeated),
        }
        values["seconds"] = time.perf_counter() - begin
        write_text(self.out / REPORT, _text(values))
        rows = [row for entry in verified for row in entry["rows"]]
        write_page(values, rows, self.grasps, self.out)
        return values

    def _reason(self, nominal: dict[str, Any] | None, good: list[dict[str, Any]]) -> str:
        """Why the hand does not turn its nominal object without end; empty where it does."""
        if nominal is None:
            return f"no grasp was found: {self.grasps['reason']}"
        if nominal["kind"] != "gait":
            return f"it holds with all fingers only: {self.grasps['reason']}"
        if nominal in good:
            return ""
        return (
            f"{nominal['runs'] - nominal['completed']} of {nominal['runs']} runs of {nominal['file']} did not do what "
            f"was asked; most often {nominal['fails_first']}; for example: {nominal['example']}"
        )

    def _rate(self, nominal: dict[str, Any] | None) -> float | None:
        return None if nominal is None else Scenario.load(self.out / nominal["file"]).reference.yaw_rate

    @cached_property
    def _hand_digest(self) -> str:
        return digest_of(self.out, self.hand["files"])


def adopt(model: str | Path, facts: str | Path | None = None, out: str | Path | None = None, **more: Any) -> Adoption:
    """Adopts a hand: all stages, with the report; see `Adoption` for the arguments and for the stages one by one."""
    adoption = Adoption(model, facts, out, **more)
    adoption.report  # noqa: B018  which asks for all others
    return adoption


def nominal_of(spec: ObjectSpec) -> Nominal:
    """The homogeneous body of an object: mass and principal moments."""
    first, second, third = (float(x) for x in spec.shape.inertia(spec.mass))
    return Nominal(spec.mass, (first, second, third))


def _tried(entry: dict[str, Any]) -> dict[str, Any]:
    """An object that was turned to choose among them, and what came of it, for the report."""
    grasp, (forwards, backwards) = Grasp.from_json(entry["grasp"]), entry["rows"]
    return {
        "object": str(grasp.object),
        "stroke_rad": grasp.stroke,
        "asked_rad": forwards["asked_rad"],
        "turned_forwards_rad": forwards["turned_rad"],
        "turned_backwards_rad": -backwards["turned_rad"],
        "fails": forwards["fails"] or backwards["fails"],
    }


def _text(values: Any) -> str:
    return json.dumps(values, indent=2) + "\n"
