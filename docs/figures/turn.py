"""The film strip of the main experiment, as `fingergait run` draws it."""

import sys
from pathlib import Path

import fingergait as fg
from fingergait.run.report.render import strip

strip(fg.simulate(fg.Scenario.load("lift-and-rotate", {"duration": 32.0})).log, Path(sys.argv[1]))
