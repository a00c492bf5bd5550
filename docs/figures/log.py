"""The plot of the quality that `fingergait run` leaves beside its log."""

from _drawing import save

import fingergait as fg
from fingergait.run.report.plots import quality_figure

scenario = fg.Scenario.load("lift-and-rotate", {"duration": 15.0})
save(quality_figure(fg.simulate(scenario).log, scenario))
