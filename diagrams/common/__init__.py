"""What every study shares: scenario, run, log, replay, plots, CLI."""
