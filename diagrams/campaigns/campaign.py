"""A campaign: which scenario, how it varies, what counts as a failure.

scenario: gauze_dynamic
runs: 1000
vary:
  target.tremor_rms: {log_uniform: [1.0e-5, 1.0e-3]}
  wall_motion.rate: {uniform: [0.15, 0.4]}
variants:
  bypass: {}
  field: {behaviour: field}
fail: [contact, not reached]
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from diagrams.campaigns.acts import ACTS, Job
from diagrams.campaigns.distributions import Draw, distribution
from diagrams.campaigns.draws import DRAWS
from diagrams.campaigns.expression import Expression
from diagrams.campaigns.splitting import SplittingParams
from diagrams.campaigns.supervisor import Limits
from diagrams.campaigns.tape import Tape
from diagrams.common.scenario import ScenarioError, nearest, refusals
from diagrams.common.tree import fit, make, read_tree
from systems.common.parameter import check, parameter, part

LIBRARY = Path(__file__).parent / "library"
"""Campaigns that ship with the project: a file's stem is its name."""

SEARCHES = ("random", "splitting")


@dataclass
class StopParams:
    """When a campaign ends before all its runs are done.

    Attributes are looked at as results come in, by intervals that allow for it.
    """

    width: float = parameter(
        0.0, "of the interval of the share that fails; 0: all runs", least=0.0, most=1.0
    )
    least: int = parameter(50, "runs before that is looked at", least=1, most=10**9)


@dataclass
class Campaign:
    """What a campaign does. Keys of `vary` and `variants` are those of the scenario.

    Attributes:
        fixed: Values for all runs.
        vary: Dotted key to a distribution, see `distributions`.
        variants: Named sets of values, each run on the same draws.
    """

    description: str = parameter("", "one line for `trocar campaign`")
    scenario: str = parameter("", "that is varied: a name or a file")
    act: str = parameter("scenario", "what a run does", choices=tuple(ACTS))
    runs: int = parameter(1000, "of each variant", least=1, most=10**9)
    seed: int = parameter(1, "of the draws", least=0, most=2**31 - 1)
    draw: str = parameter("", "draws that depend on one another", choices=tuple(DRAWS))
    fixed: dict[str, Any] = field(default_factory=dict)
    vary: dict[str, Any] = field(default_factory=dict)
    variants: dict[str, dict[str, Any]] = field(default_factory=dict)
    measure: list[str] = parameter([], "figures shown first; all if empty", shape=(-1,))
    fail: list[str] = parameter([], "expressions that hold of a failure", shape=(-1,))
    worst: str = parameter("", "figure that is low in bad runs; high if -figure")
    stop: StopParams = part(StopParams)
    search: str = parameter("random", "how failures are looked for", choices=SEARCHES)
    splitting: SplittingParams = part(SplittingParams)
    # A move of a search by splitting is small if it keeps its noise: let there be few.
    noises: int = parameter(2**31, "that runs choose from", least=1, most=2**31)
    time_limit: float = parameter(600.0, "of a run", "s", above=0.0, most=1e6)
    memory_limit: float = parameter(3e9, "of a run", "bytes", least=1e8, most=1e12)
    tries: int = parameter(3, "of a run that ends its process", least=1, most=10)

    @cached_property
    def expressions(self) -> list[Expression]:
        """Of `fail`, parsed."""
        return [Expression(text) for text in self.fail]

    @cached_property
    def distributions(self) -> dict[str, Draw]:
        """Of `vary`."""
        return {key: distribution(key, told) for key, told in self.vary.items()}

    @property
    def limits(self) -> Limits:
        """Of every run."""
        return Limits(self.time_limit, self.memory_limit, self.tries)

    @property
    def names(self) -> list[str]:
        """Of the variants; one without a name if there are none."""
        return list(self.variants) or [""]

    def drawn(self, tape: Tape) -> dict[str, Any]:
        """The values that a tape stands for, by key."""
        together = DRAWS[self.draw](tape) if self.draw else {}
        return together | {key: draw(tape) for key, draw in self.distributions.items()}

    def job(self, base: Any, run: int, variant: str, tape: Tape) -> Job:
        """One run as plain data; its noise is the tape's, whatever the variant."""
        return {
            "run": run,
            "variant": variant,
            "seed": tape.whole("seed", self.noises),
            "base": base,
            "overrides": self.fixed | self.drawn(tape) | self.variants.get(variant, {}),
        }

    def jobs(self, base: Any, done: set[tuple[int, str]]) -> Iterator[Job]:
        """All that is left to do; the variants of a run one after the other."""
        for run in range(self.runs):
            left = [name for name in self.names if (run, name) not in done]
            for name in left:
                yield self.job(base, run, name, Tape([self.seed, run]))


def campaign_files() -> dict[str, Path]:
    """All campaigns that ship with the project: name to file."""
    return {path.stem: path for path in sorted(LIBRARY.glob("*.yaml"))}


def load_campaign(name: str, planner: str = "", **changes: Any) -> Campaign:
    """Loads a campaign by its name or file, and checks it.

    Args:
        name: Of one that ships, or a file's.
        planner: `module:class` of one's own, a further variant. A file cannot name
            one: what it says is data, and runs no code.
        **changes: Values that replace the campaign's own, if not None.

    Raises:
        ScenarioError: For anything that can be known to be wrong beforehand.
    """
    files, path = campaign_files(), Path(name)
    if name in files:
        path = files[name]
    elif path.suffix not in (".yaml", ".yml"):
        raise ScenarioError(f"no campaign {name!r}: {nearest(name, files)}")
    tree = fit(Campaign, read_tree(path))
    campaign: Campaign = make(Campaign, tree)
    for variant in campaign.variants.values():
        if isinstance(variant, dict) and ":" in str(variant.get("planner", "")):
            raise ScenarioError("planner: one's own is named by --planner alone")
    if planner:
        campaign.variants[planner] = {"planner": planner}
    told = {key: value for key, value in changes.items() if value is not None}
    return checked(replace(campaign, **told))


def checked(campaign: Campaign) -> Campaign:
    """A campaign that can run, as far as can be known before.

    Raises:
        ScenarioError: If it cannot.
    """
    with refusals():
        check(campaign, "")
    if campaign.act == "scenario" and not campaign.scenario:
        raise ScenarioError("scenario='': expected a scenario's name or file")
    if campaign.search == "splitting" and len(campaign.names) > 1:
        raise ScenarioError("variants: expected none with search=splitting")
    for key in campaign.variants.values():
        if not isinstance(key, dict):
            raise ScenarioError(f"variants: {key!r}: expected keys and values")
    assert campaign.expressions is not None and campaign.distributions is not None
    return campaign


def base_of(campaign: Campaign) -> Any:
    """The plain data of the scenario that is varied; the first draw is tried on it.

    Raises:
        ScenarioError: If there is none, or a key of the campaign is not its own.
    """
    if campaign.act != "scenario":
        campaign.drawn(Tape([campaign.seed, 0]))
        return {}
    from diagrams.studies import load_scenario

    return asdict(load_scenario(campaign.scenario))
