"""Random numbers with a state of their own."""

import numpy as np

from systems.resection.planning.draws import below, new_draws, normal, uniform


def test_they_are_numpys():
    draws, numpys = new_draws(7), np.random.RandomState(7)
    for k in range(3000):
        assert uniform(draws) == numpys.random_sample()
        assert normal(draws) == numpys.normal()
        assert below(draws, 1 + k) == numpys.randint(1 + k)


def test_two_of_a_seed_do_not_disturb_each_other():
    one, two = new_draws(3), new_draws(3)
    first = [normal(one) for _ in range(2000)]
    uniform(new_draws(4))
    assert [normal(two) for _ in range(2000)] == first
