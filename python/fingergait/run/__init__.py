"""One run and its verdict: simulate, log, metrics, loss, suite, tables, plots and film."""
