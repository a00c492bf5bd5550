"""The experiments of the paper's Section V, and those beyond it."""

from fingergait.reproduce.experiment import Experiment
from fingergait.reproduce.experiments.margins import margins
from fingergait.reproduce.experiments.push import push
from fingergait.reproduce.experiments.quality import quality
from fingergait.reproduce.experiments.regrasp import regrasp
from fingergait.reproduce.experiments.rotate import rotate
from fingergait.reproduce.experiments.shapes import shapes
from fingergait.reproduce.experiments.slippery import slippery
from fingergait.reproduce.experiments.step import step


def all_experiments(quick: bool) -> list[Experiment]:
    """Every experiment in the order of the page; `quick` has fewer seeds and shorter runs."""
    return [step(), rotate(quick), push(quick), shapes(), quality(), slippery(quick), margins(quick), regrasp(quick)]
