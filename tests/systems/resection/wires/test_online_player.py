"""Plans played while they grow: as if all had been known, or from rest to rest."""

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
import pytest

from systems.resection.wires.online_player import OnlinePlayer, Page, Wait
from systems.resection.wires.procedure_chooser import Book, ProcedureChooser
from systems.resection.wires.procedure_player import (
    ProcedurePlayer,
    ProcedurePlayerParams,
    played,
    profile,
)
from tests.systems.resection.wires.test_procedure_player import PARAMS, RATES, wander

ENDS = (9, 23, 24, 40, 59)
WHOLE = profile(wander(3), PARAMS)


def page(x, steps, **told):
    n = ENDS[steps - 1] + 1 if steps else 1
    return Page(x[:n], ENDS[:steps], np.zeros(n), np.full(n, 4e-3), np.zeros(n), **told)


def answer_of(x):
    """Lines: a number of steps that are accepted, then perhaps stop or end."""

    def answer(line, taken, time):
        steps, *words = line.split()
        return page(x, int(steps), is_stopped="stop" in words, is_over="end" in words)

    return answer


def play(x, lines, duration):
    """Postures' targets, why it waits and what was reached, at each instant."""
    builder = DiagramBuilder()
    book = Book(page(x, 0), answer_of(x), lines)
    player = builder.AddSystem(OnlinePlayer(PARAMS, None, book.pages))
    chooser = builder.AddSystem(ProcedureChooser(book, PARAMS.lead))
    builder.Connect(chooser.GetOutputPort("accepted"), player.GetInputPort("accepted"))
    builder.Connect(player.GetOutputPort("taken"), chooser.GetInputPort("taken"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = player.GetMyContextFromRoot(simulator.get_context())
    rows = []
    for n in range(round(duration / PARAMS.lead)):
        simulator.AdvanceTo(n * PARAMS.lead)
        posture = player._posture(context, context.get_time())
        told = (player.GetOutputPort(p).Eval(context) for p in ("waiting", "progress"))
        rows.append((posture, *(float(value[0]) for value in told)))
    return map(np.array, zip(*rows, strict=True))


def assert_smooth(y):
    rate = np.diff(y, axis=0) / PARAMS.lead
    assert (np.abs(rate) <= RATES * (1 + 1e-6)).all()
    change = np.abs(np.diff(rate, axis=0)) / PARAMS.lead
    assert (change <= RATES / PARAMS.turn * (1 + 1e-6)).all()


def test_chosen_ahead_of_need_it_is_the_plan_whole():
    x = wander(3)
    ahead = [
        (max(WHOLE.times[end] - 3.0, 0.0), f"{n + 1}")
        for n, end in enumerate((0, *ENDS[:-1]))
    ]
    y, waiting, reached = play(x, ahead, WHOLE.times[-1] + 0.5)
    player = ProcedurePlayer(PARAMS, None, x)
    instants = np.arange(len(y)) * PARAMS.lead
    for row, time in zip(y, instants, strict=True):
        assert np.array_equal(row, played(x, WHOLE, PARAMS, time)), time
    assert player.times[-1] == WHOLE.times[-1]
    assert (waiting[instants < WHOLE.times[-1] - 1e-6][15:] == Wait.PLAYING).all()
    assert reached[-1] == len(x) - 1


@pytest.mark.parametrize("late", [0.0, 0.31, 5.0])
def test_chosen_late_it_waits_where_the_last_one_ended(late):
    """At any moment: in mid-braking, at the end, long after it."""
    x = wander(3)
    whole = profile(x[: ENDS[1] + 1], PARAMS).times
    for moment in whole[ENDS[0]] + late + np.array([-4, -2, -1, 1]) * PARAMS.lead:
        y, waiting, reached = play(
            x, [(0.0, "1"), (moment, "2")], whole[-1] + late + 1.0
        )
        assert_smooth(y)
        assert reached[-1] == ENDS[1] and np.array_equal(y[-1], x[ENDS[1]])
        assert waiting[-1] == Wait.NOTHING_CHOSEN
        if late:
            standing = waiting[: round(moment / PARAMS.lead)] == Wait.NOTHING_CHOSEN
            at = np.flatnonzero(standing)[-1]
            assert np.array_equal(y[at], x[ENDS[0]])
    assert (np.diff(reached) >= 0).all()


def test_it_stops_after_the_present_one_and_goes_on():
    x = wander(3)
    time = profile(x[: ENDS[0] + 1], PARAMS).times[-1]
    lines = [(0.0, "5"), (time / 2, "5 stop"), (time + 2.0, "5"), (time + 2.0, "5 end")]
    y, waiting, reached = play(x, lines, WHOLE.times[-1] + 4.0)
    instants = np.arange(len(y)) * PARAMS.lead
    told = (instants > time + 0.05) & (instants < time + 1.9)
    assert (waiting[told] == Wait.TOLD).all() and (reached[told] == ENDS[0]).all()
    assert_smooth(y)
    assert waiting[-1] == Wait.OVER and reached[-1] == len(x) - 1


def test_what_it_has_begun_is_not_changed_behind_its_back():
    x, other = wander(3), wander(4)
    player = OnlinePlayer(PARAMS, None, [page(x, 1), page(other, 2)])
    simulator = Simulator(player)
    context = simulator.get_mutable_context()
    port = player.GetInputPort("accepted")
    port.FixValue(context, [0.0])
    simulator.AdvanceTo(0.2)
    port.FixValue(context, [1.0])
    simulator.AdvanceTo(profile(x[: ENDS[0] + 1], PARAMS).times[-1] + 1.0)
    assert player.GetOutputPort("waiting").Eval(context)[0] == Wait.CHANGED
    assert player.GetOutputPort("progress").Eval(context)[0] == ENDS[0]


def test_a_posture_that_there_is_not():
    with pytest.raises(ValueError, match="first=1: expected 0 to 0"):
        OnlinePlayer(ProcedurePlayerParams(), first=1)
