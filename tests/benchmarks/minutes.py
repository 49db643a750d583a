"""PWE over minutes: the shaft turns with the breath, the sensor drifts, breaths differ.

Each breath is 5 % longer or shorter, deeper or shallower; after a third of the time the
rate goes from 0.25 to 0.30 Hz. Half an hour takes three minutes of processor a row:
`python -m tests.benchmarks minutes --seed 1 --scenes 1800`.
"""

from diagrams.common.run import simulate
from diagrams.studies import load_scenario

LAGS = {"antiphase": 0.5, "in phase": 0.0}
"""Of the organ behind the wall, in breaths."""


def row(wave: str, lag: float, seed: int, duration: float) -> str:
    """The figures of a run."""
    irregular = {
        **{"jitter": 0.05, "seed": seed + 10, "quicker": 0.2},
        **{"quicker_time": duration / 3.0, "quicker_duration": duration / 6.0},
    }
    told = [f"wall_motion.irregular.{key}={value}" for key, value in irregular.items()]
    told += [f"wall_motion.wave={wave}", f"organ_motion.lag={lag}"]
    run = simulate(load_scenario("keyhole_circle", told, seed, duration))
    m = run.metrics
    return (
        f"force {m['rms_lateral_force']:.3f} N rms, {m['max_lateral_force_3s']:.2f} "
        f"most; fulcrum {1e3 * m['rms_fulcrum_error']:.3f} mm rms; tool "
        f"{1e3 * m['rms_tool_error']:.3f} mm rms; refused {m['estimates_refused']}"
        f"{'; broke off: ' + run.error if run.error else ''}"
    )


def report(seed: int, scenes: int) -> str:
    """The table, as text; each row takes `scenes` simulated seconds."""
    lines = []
    for wave in ("ventilator", "sine"):
        for name, lag in LAGS.items():
            said = row(wave, lag, seed, float(scenes))
            lines.append(f"{wave:10} {name:9} {scenes} s: {said}")
    return "\n".join(lines)
