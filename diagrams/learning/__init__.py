"""Environments for those who learn policies, the extra `learning`.

`gymnasium.make("diagrams.learning:trocar/CrowdCrossing-v0")` registers them.
"""

from gymnasium.envs.registration import register

NAMES = ("GauzeDelivery", "CrowdCrossing", "SnakeReach")

for _name in NAMES:
    register(f"trocar/{_name}-v0", f"{__name__}.environments:{_name}")
