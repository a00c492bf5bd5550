"""The paper's experiments, each claim beside what this project measures, and the limits beyond them."""
