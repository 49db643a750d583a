"""A case: a scenario with all that is done before it runs."""

from dataclasses import dataclass, field
from typing import Any


@dataclass
class Case:
    """A scenario prepared; a study that prepares more has a subclass of its own.

    Attributes:
        scenario: What is to run.
        companions: Runs of other scenarios that figures and plots hold this one
            against, by the names that the study gave them.
    """

    scenario: Any
    companions: dict[str, Any] = field(default_factory=dict)
