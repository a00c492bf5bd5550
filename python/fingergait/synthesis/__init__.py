"""Robust synthesis: uncertain plants, mu bounds, D-K iteration, and controllers with a certificate."""

from .artefact import Artefact
from .certificate import Certificate
from .contact_plant import ReflectedHand, reflect
from .dk import DKResult, Iteration, dk_iteration
from .errors import InfeasibleSpecError, LibraryError, SpecError, SynthesisError
from .identify import identify_damping
from .mu import mu_bounds
from .rate import at_rate
from .spec import SynthesisSpec
from .statespace import StateSpace
from .synthesize import Controller, hand_tuned, synthesize

__all__ = [
    "Artefact",
    "Certificate",
    "Controller",
    "DKResult",
    "InfeasibleSpecError",
    "Iteration",
    "LibraryError",
    "ReflectedHand",
    "SpecError",
    "StateSpace",
    "SynthesisError",
    "SynthesisSpec",
    "at_rate",
    "dk_iteration",
    "hand_tuned",
    "identify_damping",
    "mu_bounds",
    "reflect",
    "synthesize",
]
