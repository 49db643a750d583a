"""Sessions: what is feasible, why not, commits, undo, and files."""

import numpy as np
import pytest

from plants.snake.parameters import SnakeParams
from plants.tissue.labels import TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.tissue import Tissue
from plants.tissue.tissue_carver import Carving
from systems.common.archive import before
from systems.resection.planning.entry_law import (
    least_clearance,
    least_radius,
    opening_ratio,
)
from systems.resection.planning.feasibility import check_jam
from systems.resection.planning.next_entry import (
    EntriesParams,
    bored_healthy,
    channel_along,
    next_entries,
)
from systems.resection.planning.next_tool import ToolsParams, next_tools
from systems.resection.planning.procedure import (
    Procedure,
    Tool,
    load_procedures,
    save_procedures,
)
from systems.resection.planning.reach import find_reach
from systems.resection.planning.resumed import load_session
from tests.ball import ball_session, ball_tissue

ENTRY = Procedure("entry", length=0.016, radius=0.005, pitch=1e-3, name="entry")


def test_entry_law_has_the_paper_robot_numbers():
    """Worked by hand with h = 3.2, e = 1, r_b = 4 mm (reference page, 1.4)."""
    thin = SnakeParams(tool_offset=6e-3, tool_radius=3e-3)
    assert opening_ratio(thin) == pytest.approx(31.2 / 13.8)
    assert least_clearance(thin) == pytest.approx(0.79e-3, abs=0.01e-3)
    assert least_radius(thin) == pytest.approx(5.7e-3, abs=0.05e-3)
    assert least_clearance(SnakeParams()) == 0.0
    # With what the plan keeps: r_b = 4.1, r = 2.95 mm, and 0.1 mm beyond the body.
    kept = least_clearance(thin, kept=0.1e-3, accuracy=0.05e-3)
    assert kept == pytest.approx(0.1e-3 + 1.15e-3 / (31.2 / 13.8 - 1.0))


def test_jam_counts_what_the_plan_keeps():
    thin = SnakeParams(tool_offset=6e-3, tool_radius=3e-3)
    assert check_jam(ENTRY, 0.85e-3, thin) is None  # bare, it opens out
    answer = check_jam(ENTRY, 0.85e-3, thin, kept=0.075e-3, accuracy=0.025e-3)
    assert answer.reason == "jam"
    assert check_jam(ENTRY, 0.96e-3, thin, kept=0.075e-3, accuracy=0.025e-3) is None


def test_check_changes_nothing_and_commit_does():
    session = ball_session()
    tau = session.volume.tau.copy()
    answer = session.check(ENTRY)
    assert answer.feasible and answer.gained > 0
    np.testing.assert_array_equal(session.volume.tau, tau)
    assert session.commit(ENTRY).gained == pytest.approx(answer.gained)
    gone = (session.volume.tau != SOLID) & (session.volume.labels == TUMOUR)
    assert gone.sum() * session.volume.voxel == pytest.approx(answer.gained)
    assert session.undo().name == "entry"
    np.testing.assert_array_equal(session.volume.tau, tau)
    assert session.tree.size.tolist() == [1, 1, 0]
    with pytest.raises(ValueError, match="no step to undo"):
        session.undo()


def test_arrival_times_replay_the_plan():
    """Stamping the route's postures in their order frees just what was planned."""
    session = ball_session()
    assert session.commit(ENTRY).feasible
    tau = session.volume.tau
    points = session.volume.points(np.ones(tau.shape, bool))
    tips = session.tips
    planned = np.flatnonzero((tau != SOLID) & (tau > 0))
    rng = np.random.default_rng(0)
    for voxel in rng.choice(planned, 100):
        time = tau.reshape(-1)[voxel]
        a, b = tips[time - 1], tips[time]
        share = np.clip(
            (points[voxel] - a) @ (b - a) / max((b - a) @ (b - a), 1e-18), 0, 1
        )
        nearest = np.linalg.norm(points[voxel] - a - share * (b - a))
        assert nearest <= session.params.tool_radius + 1e-5


@pytest.mark.parametrize(
    ("procedure", "reason"),
    [
        (Procedure("entry", length=0.040, radius=0.005, pitch=1e-3), "tool outside"),
        (
            Procedure("elementary", [0, 0, 0.022], [0, 0, 1.0], 0.002, 0.005),
            "never freed",
        ),
        (Procedure("entry", length=0.01, radius=0.03), "limit"),
        (Procedure("entry", length=0.2, radius=0.005), "limit"),
        (Procedure("entry", tool=Tool(0.0025, 0.004)), "jam"),
    ],
)
def test_refusals_name_their_reason(procedure, reason):
    session = ball_session()
    answer = session.check(procedure)
    assert not answer.feasible
    assert answer.reason == reason
    assert answer.text and answer.gap >= 0.0
    assert not session.commit(procedure).feasible
    assert session.steps == [] and session.fraction == 0.0


def test_a_session_survives_being_killed(tmp_path):
    file = tmp_path / "a.session"
    session = ball_session()
    session.file = file
    session.commit(ENTRY)
    wider = Procedure("entry", length=0.012, radius=0.012, clipped=True, name="wider")
    assert session.commit(wider).feasible
    again = load_session(file)
    assert [step.name for step in again.steps] == ["entry", "wider"]
    np.testing.assert_array_equal(again.volume.tau, session.volume.tau)
    np.testing.assert_array_equal(again.postures, session.postures)
    again.undo()
    assert [step.name for step in load_session(file).steps] == ["entry"]


def test_a_damaged_file_is_refused_and_the_one_before_offered(tmp_path):
    file = tmp_path / "a.session"
    session = ball_session()
    session.save(file)
    session.commit(ENTRY)
    session.save(file)
    raw = bytearray(file.read_bytes())
    raw[len(raw) // 2] ^= 255
    file.write_bytes(raw)
    with pytest.raises(ValueError, match=r"damaged; the one before it is whole: .*"):
        load_session(file)
    assert load_session(before(file)).steps == []
    file.write_bytes(b"")
    with pytest.raises(ValueError, match="damaged"):
        load_session(file)
    with pytest.raises(ValueError, match="no session"):
        load_session(tmp_path / "none.session")


def test_procedures_are_saved_and_loaded(tmp_path):
    rows = [ENTRY, Procedure("volume", [0, 0, 0.01], [0, 0, 1], 0.0, tool=Tool())]
    save_procedures(rows, tmp_path / "p.json")
    assert load_procedures(tmp_path / "p.json") == rows
    (tmp_path / "bad.json").write_text("{")
    with pytest.raises(ValueError, match="holds no procedures"):
        load_procedures(tmp_path / "bad.json")


@pytest.mark.parametrize(
    ("procedure", "message"),
    [
        (Procedure("entri"), "kind='entri'"),
        (Procedure("elementary"), "position=None m: expected three"),
        (Procedure("entry", position=[0, 0, 0]), "the channel's"),
        (
            Procedure("elementary", [0, 0, 0], [0, 0, 0]),
            "expected a direction",
        ),
        (Procedure("entry", radius=0.003), "the tool's own"),
        (Procedure("entry", length=-1.0), "length=-1.0"),
        (Procedure("entry", pitch=0.0), "pitch=0.0"),
    ],
)
def test_bad_procedures(procedure, message):
    with pytest.raises(ValueError, match=message):
        ball_session().check(procedure)


def turned_entry(session):
    """A channel through the tumour's middle, turned by 40 deg about y."""
    middle = session.volume.points(session.volume.labels == TUMOUR).mean(axis=0)
    turn = np.radians(40.0)
    n = np.array([np.sin(turn), 0.0, np.cos(turn)])
    X_WE = channel_along(session.volume, middle, n)
    assert X_WE is not None
    return X_WE


def test_a_second_entry_bores_and_can_be_taken_back(tmp_path):
    session = ball_session()
    session.file = tmp_path / "two.session"
    assert session.commit(ENTRY).feasible
    allowed, tau = session.volume.allowed.copy(), session.volume.tau.copy()
    X_WE = turned_entry(session)
    session.enter_anew(X_WE)
    assert [step.kind for step in session.steps] == ["entry", "home", "access"]
    p = session.volume.points(np.ones(tau.shape, bool)) - X_WE[:3, 3]
    q = p @ X_WE[:3, :3]
    tube = (np.hypot(q[:, 0], q[:, 1]) < 4.9e-3) & (q[:, 2] < session.volume.depth)
    assert (session.volume.tau.reshape(-1)[tube] != SOLID).all()
    before = session.fraction
    deeper = Procedure("entry", length=0.008, radius=0.009, clipped=True, name="deeper")
    assert session.commit(deeper).feasible
    assert session.fraction > before
    assert set(session.entries[-5:]) == {1} and set(session.entries[:5]) == {0}
    again = load_session(session.file)
    np.testing.assert_array_equal(again.entries, session.entries)
    np.testing.assert_array_equal(again.volume.allowed, session.volume.allowed)
    start = X_WE[:3, :3] @ [0, 0, 0.012] + X_WE[:3, 3]
    elementary = Procedure(
        "volume", start.tolist(), X_WE[:3, 2].tolist(), 0.0, 0.008, True
    )
    assert again.check(elementary).gained == session.check(elementary).gained
    for session_ in (session, again):
        for _ in range(3):
            session_.undo()
        np.testing.assert_array_equal(session_.volume.tau, tau)
        np.testing.assert_array_equal(session_.volume.allowed, allowed)
        assert session_.commit(
            Procedure("entry", length=0.012, radius=0.012, clipped=True)
        ).feasible


def test_another_tool_is_carried_and_can_be_taken_back(tmp_path):
    session = ball_session()
    session.file = tmp_path / "t.session"
    assert session.commit(ENTRY).feasible
    tau, own = session.volume.tau.copy(), session.params.tool_radius
    asked = Procedure("entry", length=0.012, radius=0.009, clipped=True)
    asked.tool = Tool(own + 5e-4, session.params.tool_offset)
    assert "change it first" in session.commit(asked).text
    step = session.change_tool(own + 5e-4)
    assert step.gained == 0.0 and session.body.radius > own
    (change,) = session.tools
    x = session.postures
    np.testing.assert_array_equal(x[change.time], x[change.time - 1])  # it waits
    assert x[change.time][0] == pytest.approx(x[0][0] - 5e-4)  # all of it is within
    assert session.commit(asked).feasible
    again = load_session(session.file)
    assert again.tools == session.tools and again.params == session.params
    np.testing.assert_array_equal(again.tool_radii, session.tool_radii)
    assert set(session.tool_radii[: change.time]) == {own}
    # What is carved with the tools that it carries is what was planned, and no more.
    carving = Carving(session.volume, session.own)
    for index in range(len(session.postures) - 1):
        told = carving.move(
            index, *session.postures[index : index + 2], 0.2e-3,
            radius=float(session.tool_radii[index]),
        )  # fmt: skip
        assert told[2] == 0
    planned = np.count_nonzero(session.volume.resected)
    assert np.count_nonzero(carving.volume.resected) == pytest.approx(planned, rel=0.05)
    for session_ in (session, again):
        while len(session_.steps) > 1:
            session_.undo()
        assert session_.params.tool_radius == own and not session_.tools
        np.testing.assert_array_equal(session_.volume.tau, tau)
    with pytest.raises(ValueError, match="the channel's"):
        session.change_tool(session.volume.channel)
    with pytest.raises(ValueError, match="tool"):
        session.change_tool(-1e-3)


def test_a_smaller_tool_is_proposed_where_it_adds():
    session = ball_session(2e-3)
    session.commit(ENTRY)
    own = session.params.tool_radius
    params = ToolsParams(radii=[own, own + 5e-4, own - 1e-3], least_gain=0.0)
    found = next_tools(session, params)
    assert {tool.radius for tool in found} <= {own + 5e-4, own - 1e-3}
    gains = [tool.gained for tool in found]
    assert gains == sorted(gains, reverse=True) and all(gain >= 0 for gain in gains)
    assert not session.tools and next_tools(session, ToolsParams(radii=[own])) == []


def test_a_channel_beside_the_tumour_is_none():
    volume = ball_session().volume
    assert (
        channel_along(volume, np.array([0.03, 0.0, 0.0]), np.array([0, 0, 1.0])) is None
    )


def test_further_entries_are_ranked_by_what_they_add():
    session = ball_session(2e-3)
    session.commit(ENTRY)
    seen = []
    params = EntriesParams(directions=4, finalists=2, opening=0.02)
    found = next_entries(session, params, progress=seen.append)
    assert 1 <= len(found) <= 2 and seen == sorted(seen)
    worth = [entry.gained - params.price * entry.bored for entry in found]
    assert worth == sorted(worth, reverse=True)
    before = session.fraction
    session.enter_anew(found[0].X_WE)
    reach = find_reach(session, effort=0.3, explain=False, anew=False)
    added = (reach.fraction - before) * session.volume.tumour_volume
    assert added >= 0.95 * found[0].gained
    assert bored_healthy(session.volume) == found[0].bored > 0.0


def test_an_image_taken_meanwhile_replaces_the_first(tmp_path):
    """The tumour has sunk by 2 mm, and a layer thought to be gone is still there."""
    session = ball_session()
    session.file = tmp_path / "u.session"
    assert session.commit(ENTRY).feasible
    volume, first = session.volume, ball_tissue()
    X_PV = first.X_PV.copy()
    X_PV[0, 3] += 2e-3
    seen = volume.resected & (volume.points(volume.labels >= 0)[:, 0] > 3.5e-3).reshape(
        volume.labels.shape
    )
    assert seen.any()
    gone = volume.resected & ~seen
    session.update(Tissue(first.labels, X_PV, "later", is_mask=True), seen)
    assert (volume.tau[seen] == SOLID).all() and (volume.tau[gone] != SOLID).all()
    assert (volume.labels[gone] == TUMOUR).all()
    left = volume.points((volume.labels == TUMOUR) & (volume.tau == SOLID))
    X_PW = volume.X_PW
    middle = (X_PV @ [*(np.array(first.labels.shape) - 1) / 2, 1.0])[:3]
    away = np.linalg.norm(left @ X_PW[:3, :3].T + X_PW[:3, 3] - middle, axis=1)
    assert away.max() < 16.2e-3
    again = load_session(session.file)
    np.testing.assert_array_equal(again.volume.labels, volume.labels)
    # The way in has to be made again where tissue is in it.
    steps = len(again.steps)
    wider = Procedure("entry", length=0.012, radius=0.009, clipped=True, name="again")
    assert again.commit(wider).feasible
    carving = Carving(again.volume, again.params)
    carving.volume.tau[:] = volume.tau
    carving.volume.refresh()
    carving.space = carving.volume.space()
    x = again.postures
    for index in range(again.steps[steps].first - 1, len(x) - 1):
        assert carving.move(10**6 + index, x[index], x[index + 1], 0.2e-3)[2] == 0
    again.undo()
    with pytest.raises(ValueError, match="what was measured cannot be undone"):
        again.undo()
    X_PV[0, 3] += 0.05
    with pytest.raises(ValueError, match="lie beyond the session's grid"):
        again.update(Tissue(first.labels, X_PV, "other"))
