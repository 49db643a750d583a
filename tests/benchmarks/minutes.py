"""PWE over minutes: the shaft turns with the breath, the sensor drifts, breaths differ.

Each breath is 5 % longer or shorter, deeper or shallower; after a third of the time the
rate goes from 0.25 to 0.30 Hz. Half an hour takes three minutes of processor a row:
`python -m tests.benchmarks minutes --seed 1 --scenes 1800`.
"""

from diagrams.common.figures import in_words
from diagrams.common.run import simulate
from diagrams.studies import load_scenario

LAGS = {"antiphase": 0.5, "in phase": 0.0}
"""Of the organ behind the wall, in breaths."""
FIGURES = (
    *("rms_lateral_force", "max_lateral_force_3s", "rms_fulcrum_error"),
    *("rms_tool_error", "estimates_refused"),
)


def row(wave: str, lag: float, seed: int, duration: float) -> str:
    """The figures of a run."""
    irregular = {
        **{"jitter": 0.05, "seed": seed + 10, "quicker": 0.2},
        **{"quicker_time": duration / 3.0, "quicker_duration": duration / 6.0},
    }
    told = [f"wall_motion.irregular.{key}={value}" for key, value in irregular.items()]
    told += [f"wall_motion.wave={wave}", f"organ_motion.lag={lag}"]
    run = simulate(load_scenario("keyhole_circle", told, seed, duration))
    said = [f"{key} {in_words(key, run.metrics[key])}" for key in FIGURES]
    return ", ".join(said + ([f"broke off: {run.error}"] if run.error else []))


def report(seed: int, scenes: int) -> str:
    """The table, as text; each row takes `scenes` simulated seconds."""
    lines = []
    for wave in ("ventilator", "sine"):
        for name, lag in LAGS.items():
            said = row(wave, lag, seed, float(scenes))
            lines.append(f"{wave:10} {name:9} {scenes} s: {said}")
    return "\n".join(lines)
