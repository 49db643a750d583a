"""Planning in the browser: by clicks in a real page, and by the desk behind it."""

import io
import json
from queue import Queue
from threading import Thread
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from PIL import Image as Picture
import pytest

from diagrams.common.replay import start_meshcat
from diagrams.resection.browser import run_browser, serve
from diagrams.resection.console import Console, open_session
from diagrams.resection.desk import Desk
from diagrams.resection.form import Form, form_of
from diagrams.studies import load_scenario
from systems.resection.planning.feasibility_map import feasibility_map, growing_map
from systems.resection.planning.procedure import KINDS

TINY = ["spacing=0.002", "tumour.length=0.024", "reach_effort=0.05"]


def tiny(*more):
    return load_scenario("resect_auto_small", [*TINY, *more])


def by_lines(lines, file):
    console = Console(open_session(tiny(), file), tiny())
    return [console.answer(line) for line in lines]


@pytest.fixture(scope="module")
def meshcat():
    return start_meshcat()


@pytest.fixture
def desk(meshcat, tmp_path):
    return Desk(tiny(), tmp_path / "desk.session", meshcat)


def do(desk, what, told):
    desk.want(what, told)
    desk.turn()
    return desk.show["answer"]


class Clicks:
    """A page that somebody plans on."""

    def __init__(self, page, address):
        self.page = page
        page.goto(address)
        page.wait_for_selector("#slice_axial image[href]")

    def wait(self, expression, argument=None):
        """Until a page's expression is true."""
        self.page.wait_for_function(expression, arg=argument, timeout=60_000)

    def change(self, act):
        """Does something, until the page shows what comes of it."""
        version = self.page.evaluate("document.body.dataset.version")
        act()
        self.wait("v => document.body.dataset.version !== v", version)

    def slide(self, name, value):
        """Moves a slider."""
        self.change(lambda: self.page.locator(f"#{name}").fill(str(value)))

    def press(self, name):
        """Presses a button, until the console has answered."""
        told = self.page.locator("#log b").count()
        self.page.click(f"#{name}")
        self.wait("n => document.querySelectorAll('#log b').length > n", told)

    def scene(self):
        """What is seen of the patient, (n, m, 3)."""
        self.page.wait_for_timeout(500)
        png = self.page.locator("#scene").screenshot()
        return np.asarray(Picture.open(io.BytesIO(png)).convert("RGB")).astype(int)


def greens(picture):
    r, g, b = np.moveaxis(picture, -1, 0)
    return ((g > r + 25) & (g > b + 25)).sum()


def pinks(picture):
    r, g, b = np.moveaxis(picture, -1, 0)
    return ((r > g + 80) & (b > g + 60)).sum()


@pytest.mark.browser
def test_by_clicks_as_by_lines(page, tmp_path):
    """A procedure committed by clicks is that of the console, byte for byte."""
    addresses, desks, file = Queue(), Queue(), tmp_path / "clicks.session"
    thread = Thread(
        target=lambda: desks.put(run_browser(tiny(), file, opened=addresses.put))
    )
    thread.start()
    page.set_viewport_size({"width": 800, "height": 560})
    try:
        clicks = Clicks(page, addresses.get(timeout=120))
        clicks.slide("length", 8)
        clicks.slide("radius", 5.5)
        good = clicks.scene()
        assert "feasible" in page.inner_text("#answer")
        clicks.press("commit")
        assert page.locator("#steps li").count() == 1
        clicks.change(lambda: page.select_option("#kind", "elementary"))
        clicks.slide("z", 7)
        clicks.slide("tilt", 5)
        assert page.get_attribute("#words", "class") == "bad"
        assert "meets the wall of the channel" in page.inner_text("#answer")
        bad = clicks.scene()
        page.evaluate("document.getElementById('scene').remove()")  # it is seen enough
        clicks.press("suggest")
        clicks.press("commit")
        clicks.press("undo")
        page.fill("#line", "volume 0 0 10 0 0 1 6 clipped")
        clicks.change(lambda: page.press("#line", "Enter"))
        clicks.press("commit")
    finally:
        page.click("#quit")
        thread.join(60)
    assert greens(good) > 100 and pinks(good) == 0
    assert pinks(bad) > 20 and greens(bad) < greens(good)
    lines = [
        "entry 8 5.5 clipped",
        "commit",
        "elementary 0 0 7 0.087156 0 0.996195 8 5.5 clipped",
        "suggest",
        "commit",
        "undo",
        "volume 0 0 10 0 0 1 6 clipped",
        "commit",
    ]
    told = by_lines(lines, tmp_path / "lines.session")
    assert desks.get(timeout=10).log == list(zip(lines, told, strict=True))
    assert told[-1].startswith("committed")
    assert file.read_bytes() == (tmp_path / "lines.session").read_bytes()


def test_ctrl_c_keeps_the_session(tmp_path, monkeypatch):
    file, turn = tmp_path / "ended.session", Desk.turn

    def interrupted(desk):
        if desk.console.session.steps:
            raise KeyboardInterrupt
        desk.want("line", "commit")
        turn(desk)

    monkeypatch.setattr(Desk, "turn", interrupted)
    desk = run_browser(tiny(), file)
    assert desk.is_over and "committed" in desk.log[-1][1]
    assert by_lines(["list"], file)[0].startswith("1: entry")


def test_a_preview_changes_nothing(desk):
    file = desk.console.session.file
    before = file.read_bytes()
    do(desk, "move", {"length": 12.0})
    do(desk, "move", {"kind": "volume", "x": 3.0, "radius": 9.0})
    desk.console.session.save(file)
    assert file.read_bytes() == before


def test_the_map_keeps_up_with_the_plan(desk):
    """It grows between previews, is the console's, and begins anew after a commit."""
    do(desk, "move", {"length": 8.0})
    do(desk, "line", "commit")
    do(desk, "line", "map")
    for length in (10.0, 11.0, 12.0):
        desk.turn()
        do(desk, "move", {"length": length})

    def whole():
        while desk._growing is not None:
            desk.turn()
        return desk.console.map

    first, wanted = whole(), feasibility_map(desk.console.session)
    np.testing.assert_array_equal(first.gained, wanted.gained)
    assert first.reasons == wanted.reasons
    do(desk, "line", "commit")
    assert len(whole().points) != len(wanted.points)
    do(desk, "line", "map")
    assert desk.show["map"] is False


def test_a_map_that_is_asked_between_its_points(desk):
    session = desk.console.session
    do(desk, "line", "commit")
    wanted, maps = feasibility_map(session, 20), []
    for found in growing_map(session, 20):
        session.check(Form(length=9.0).procedure())
        maps.append(found)
    np.testing.assert_array_equal(maps[-1].gained, wanted.gained)
    assert [len(found.points) for found in maps] == list(range(21))


def test_nothing_is_proposed_after_what_makes_no_sense(desk):
    """What the sliders do not show is not committed."""
    do(desk, "move", {"radius": 3.0})
    assert desk.show["answer"].startswith("error") and desk.show["good"] is None
    assert "nothing is proposed" in do(desk, "line", "commit")
    assert "error" in do(desk, "line", "save /nowhere/p.json")
    assert desk.console.session.steps == []


def test_stop_ends_long_work(desk):
    file = desk.console.session.file
    do(desk, "line", "commit")
    before, publish = file.read_bytes(), desk._publish

    def stopped():
        publish()
        if "reached" in desk.show["busy"]:
            desk.want("stop", None)

    desk._publish = stopped
    assert "stopped" in do(desk, "line", "finish")
    assert file.read_bytes() == before
    desk._publish = publish
    assert "can be reached" in do(desk, "line", "reach")
    assert desk.console.reach.mask.any() and desk.show["busy"] == ""


def test_a_click_into_a_slice_moves_the_procedure(desk):
    do(desk, "move", {"kind": "volume"})
    before = desk.form
    i, j = desk.show["marks"]["coronal"]["at"]
    do(desk, "point", {"slice": "coronal", "i": i + 20, "j": j})
    moved = desk.slices.in_patient(desk.form.p_W)
    moved = moved - desk.slices.in_patient(before.p_W)
    assert moved == pytest.approx([20 * desk.slices.pixel, 0.0, 0.0], abs=1e-4)


def test_what_makes_no_sense_is_refused(desk):
    server, address = serve(desk, "localhost")
    try:
        assert server.server_address[0] == "127.0.0.1"

        def post(what, body, at=address):
            return urlopen(Request(at + what, body), timeout=10).status

        for what, body in (
            ("move", b'{"x": NaN}'),
            ("move", b'{"x": "1"}'),
            ("move", b'{"clipped": 1}'),
            ("move", b'{"kind": "exit"}'),
            ("move", b'{"y": 1e9}'),
            ("move", b"[1]"),
            ("move", b"{"),
            ("point", b'{"slice": "axial", "i": -1, "j": 3}'),
            ("point", b'{"slice": "none", "i": 1, "j": 3}'),
            ("line", b'"check\\ncommit"'),
            ("nothing", b"1"),
            ("line", b" " * 20_000),
        ):
            with pytest.raises(HTTPError, match="400"):
                post(what, body)
        secret = address.rstrip("/").rpartition("/")[0] + "/"
        for where in (secret, secret + "x" * 22 + "/"):
            with pytest.raises(HTTPError, match="404"):
                post("line", b'"commit"', where)
            with pytest.raises(HTTPError, match="404"):
                urlopen(where + "state", timeout=10)
        assert desk.wanted == []
        assert post("move", b'{"x": 2}') == 200
        shown = json.load(urlopen(address + "state?after=-1", timeout=10))
        assert shown["share"] == 0.0
    finally:
        server.shutdown()
        server.server_close()


numbers = st.floats(-300.0, 300.0).map(lambda v: round(v, 1) + 0.0)
sizes = st.floats(4.0, 40.0).map(lambda v: round(v, 1))


@given(
    st.builds(
        Form,
        kind=st.sampled_from(KINDS),
        x=numbers,
        y=numbers,
        z=numbers,
        tilt=st.floats(1.0, 90.0).map(lambda v: round(v, 1)),
        turn=st.floats(-179.0, 180.0).map(lambda v: round(v, 1) + 0.0),
        length=sizes,
        radius=sizes,
        clipped=st.booleans(),
    )
)
@settings(max_examples=30)
def test_a_procedure_has_its_form(form):
    again = form_of(form.procedure(), form)
    if form.kind == "volume":
        assert again.length == 0.0
        again = again.moved({"length": form.length})
    assert again == form
