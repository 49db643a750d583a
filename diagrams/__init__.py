"""What runs: a scenario, its diagram, its replay, plots and figures."""
