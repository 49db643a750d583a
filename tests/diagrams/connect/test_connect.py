"""OpenIGTLink on loopback, with pyigtl's own server and client on the other side."""

import math
import signal
import socket
import time
from types import SimpleNamespace

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
import pyigtl
import pytest

from diagrams.common.cli import main
from diagrams.common.run import simulate
from diagrams.common.scenario import ScenarioError
from diagrams.connect import messages
from diagrams.connect.address import parse, resolve
from diagrams.connect.messages import (
    HEADER,
    Garbage,
    PositionMessage,
    StatusMessage,
    Unpacker,
)
from diagrams.connect.stream import Stream, pose, text
from diagrams.connect.tracker import Tracker, shaft_of
from diagrams.live.session import Session
from diagrams.studies import load_scenario
from plants.surgeon.tracked_tool import Sighting
from systems.common.signals import RobotTool

TOOLS = ("target", "obstacle")
LAST = Sighting((0.0, 0.0, -0.1), (0.0, 0.0, -1.0), 0.0)


def wait(until, longest=5.0):
    """Waits until something holds."""
    end = time.monotonic() + longest
    while not until():
        assert time.monotonic() < end
        time.sleep(0.005)


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def transform(name, p=(0.0, 0.0, -100.0), turn=None, **told):
    """A TRANSFORM of a tool whose tip points down unless it is turned."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.diag([1.0, -1.0, -1.0]) if turn is None else turn
    matrix[:3, 3] = p
    message = pyigtl.TransformMessage(matrix, device_name=name)
    message.metadata, message.header_version = told, 1 + bool(told)
    return message


@pytest.fixture
def plus():
    """Another program's server; what it changes of the process is put right again."""
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    server = pyigtl.OpenIGTLinkServer(port=free_port(), local_server=True)
    yield server
    server.stop()
    for number, handler in before.items():
        signal.signal(number, handler)


def tracker_of(server, query=""):
    address = parse(f"igtl://localhost:{server.port}{query}", "--tracker", TOOLS)
    return Tracker(address, TOOLS)


def seen(tracker, tool):
    tracker.poll()
    return tracker.sighting(tool, LAST)


# ---- addresses


def test_an_address_and_what_is_agreed_upon():
    told = parse("igtl://or1:7?target=Stylus&frame=10,0,0,0,0,90&axis=-x", "-", TOOLS)
    assert (told.host, told.port, told.devices) == ("or1", 7, {"target": "Stylus"})
    assert told.X_WR.translation() == pytest.approx([0.01, 0.0, 0.0])
    assert told.X_WR.rotation() @ [1, 0, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert told.axis == pytest.approx([-1.0, 0.0, 0.0])
    plain = parse("igtl://:18945", "-", TOOLS)
    assert (plain.host, plain.port) == ("localhost", 18945)
    assert math.isinf(parse("igtl://a?patience=inf", "-").patience)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("localhost:18944", "expected igtl://HOST:PORT"),
        ("http://a:1", "expected igtl://HOST:PORT"),
        ("igtl://a:99999", "a port <= 65535"),
        ("igtl://a:b", "a port"),
        ("igtl://a:1?tarjet=X", "did you mean 'target'"),
        ("igtl://a:1?frame=1,2", "frame=X,Y,Z in mm"),
        ("igtl://a:1?frame=nan,0,0,0,0,0", "frame=X,Y,Z in mm"),
        ("igtl://a:1?frame=-inf,0,0,0,0,0", "frame=X,Y,Z in mm"),
        ("igtl://a:1?frame=0,0,-1e6,0,0,0", "frame=X,Y,Z in mm"),
        ("igtl://a:1?axis=w", "axis one of x, y, z, -x"),
        ("igtl://a:1?patience=0", "patience > 0 s"),
    ],
)
def test_what_is_no_address_is_refused(text, told):
    with pytest.raises(ScenarioError, match=told):
        parse(text, "--tracker", TOOLS)


def test_a_host_that_is_not_there():
    with pytest.raises(ScenarioError, match=r"--tracker igtl://no.such.host.invalid"):
        resolve(parse("igtl://no.such.host.invalid:1", "-"), "--tracker")


# ---- messages


def test_messages_are_put_together_of_any_pieces():
    sent = [transform("A"), text("B", "hello"), StatusMessage(5, "no", device_name="C")]
    image = pyigtl.ImageMessage(np.zeros((2, 3, 4), np.uint8), device_name="I")
    data = image.pack() + b"".join(message.pack() for message in sent)
    unpacker, found = Unpacker(), []
    for first in range(0, len(data), 7):
        found += unpacker.feed(data[first : first + 7])
    assert [message.device_name for message in found] == ["A", "B", "C"]
    assert found[1].string == "hello"
    assert (found[2].code, found[2].text) == (5, "no")


def test_a_position_is_a_transform():
    turn = RotationMatrix(RollPitchYaw(0.3, -0.4, 2.0)).matrix()
    message = PositionMessage(device_name="P")
    message.matrix[:3, :3], message.matrix[:3, 3] = turn, [1.0, 2.0, 3.0]
    whole = message.pack()
    for size, exact in ((28, turn), (24, turn), (12, np.eye(3))):
        # The same body cut short: with w left out, and without a turn.
        body = whole[HEADER : HEADER + size]
        again = PositionMessage()
        again._unpack_content(body)
        assert again.matrix[:3, 3] == pytest.approx([1.0, 2.0, 3.0])
        np.testing.assert_allclose(again.matrix[:3, :3], exact, atol=1e-6)


def test_damaged_messages_are_passed_over_and_garbage_ends_it():
    good, bad = transform("A").pack(), bytearray(transform("B").pack())
    bad[HEADER + 3] ^= 1
    unpacker = Unpacker()
    assert [m.device_name for m in unpacker.feed(bytes(bad) + good)] == ["A"]
    assert unpacker.refused == 1
    short = messages.StatusMessage(device_name="S")
    short._pack_content = lambda: b"\0"
    assert unpacker.feed(short.pack()) == []
    assert unpacker.refused == 2
    rng = np.random.default_rng(3)
    for _ in range(200):
        noise = rng.integers(0, 256, HEADER, dtype=np.uint8).tobytes()
        with pytest.raises(Garbage):
            Unpacker().feed(noise)
    for size, told in ((1 << 62, "a body of"), (1 << 20, "a TRANSFORM of")):
        huge = bytearray(good)
        huge[42:50] = size.to_bytes(8, "big")
        with pytest.raises(Garbage, match=told):
            Unpacker().feed(bytes(huge))


def test_whatever_comes_is_a_message_or_garbage():
    """Bits flipped, bytes put in and cut off in a stream of good messages."""
    sent = [transform("Target", TransformStatus="OK"), StatusMessage(device_name="S")]
    sent += [PositionMessage(device_name="P"), text("T", "words")]
    stream = b"".join(message.pack() for message in sent)
    rng, whole = np.random.default_rng(7), 0
    for _ in range(500):
        data = bytearray(stream)
        for _ in range(rng.integers(1, 4)):
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        first = int(rng.integers(len(data)))
        if rng.random() < 0.3:
            data[first : first + int(rng.integers(9))] = rng.bytes(3)
        tracker = Tracker(parse("igtl://localhost:1", "-", TOOLS), TOOLS)
        try:
            for message in Unpacker().feed(bytes(data)):
                tracker._take(message)
                whole += 1
        except Garbage:
            continue
        for tool in TOOLS:
            tip, u, _ = tracker.sighting(tool, LAST)
            assert np.isfinite([tip, u]).all()
    assert whole > 500


# ---- frames and units


def test_a_shaft_is_in_metres_in_W_and_comes_back():
    address = parse("igtl://a?frame=10,20,30,20,-30,120&axis=-y", "-")
    tip, u = np.array([0.05, -0.02, -0.1]), np.array([0.6, 0.0, -0.8])
    matrix = pose("T", address, tip, u).matrix.astype(float)
    X_WR = RigidTransform(RollPitchYaw(np.deg2rad([20, -30, 120])), [0.01, 0.02, 0.03])
    assert 1e3 * (X_WR.inverse() @ tip) == pytest.approx(matrix[:3, 3], abs=1e-4)
    back, along = shaft_of(matrix, address)
    assert back == pytest.approx(tip, abs=1e-7)
    assert along == pytest.approx(u, abs=1e-6)


@pytest.mark.parametrize("spoil", ["nan", "scaled", "mirrored", "far"])
def test_what_is_no_pose_of_a_tool_was_not_seen(spoil):
    matrix = transform("A").matrix.astype(float)
    assert shaft_of(matrix, parse("igtl://a", "-")) is not None
    if spoil == "nan":
        matrix[0, 3] = np.nan
    elif spoil == "scaled":
        matrix[:3, :3] *= 1.1
    elif spoil == "mirrored":
        matrix[:3, 0] *= -1.0
    else:
        matrix[2, 3] = -1e7
    assert shaft_of(matrix, parse("igtl://a", "-")) is None


# ---- a tracker, with pyigtl's server


def test_a_tracker_is_heard_by_whatever_names(plus):
    tracker = tracker_of(plus)
    tracker.wait()
    plus.send_message(transform("TargetToReference", (1.0, 2.0, -90.0)))
    plus.send_message(transform("OBSTACLE"))
    wait(lambda: seen(tracker, "obstacle").seen)
    tip, u, is_seen = seen(tracker, "target")
    assert is_seen
    assert tip == pytest.approx((0.001, 0.002, -0.09), abs=1e-7)
    assert u == pytest.approx((0.0, 0.0, -1.0))
    assert tracker.told() == "connected"
    # Nothing more comes: what was said last holds for a while only.
    wait(lambda: not seen(tracker, "target").seen)
    tracker.close()


def test_lost_sight_is_told_in_three_ways(plus):
    tracker = tracker_of(plus, "?target=Stylus&obstacle=Needle&patience=inf")
    tracker.wait()
    both = [transform("Stylus"), transform("Needle")]

    def say(*sent, until):
        for message in sent:
            plus.send_message(message)
        wait(until)

    say(*both, until=lambda: seen(tracker, "target").seen)
    wait(lambda: seen(tracker, "obstacle").seen)
    # The frame itself says so, as PLUS does.
    lost = transform("Stylus", TransformStatus="OUT_OF_VIEW")
    say(lost, until=lambda: not seen(tracker, "target").seen)
    assert seen(tracker, "obstacle").seen
    say(*both, until=lambda: seen(tracker, "target").seen)
    # A STATUS of the tool's own, then of the tracker.
    say(
        StatusMessage(16, "unplugged", device_name="Needle"),
        until=lambda: not seen(tracker, "obstacle").seen,
    )
    assert seen(tracker, "target").seen
    assert "Needle: unplugged" in tracker.told()
    say(
        StatusMessage(device_name="Needle"),
        StatusMessage(18, "camera hot", device_name="Camera"),
        until=lambda: not seen(tracker, "target").seen,
    )
    say(StatusMessage(device_name="Camera"), until=lambda: seen(tracker, "target").seen)
    assert seen(tracker, "obstacle").seen
    tracker.close()


def test_a_server_that_is_not_there():
    address = parse(f"igtl://localhost:{free_port()}", "--tracker", TOOLS)
    with pytest.raises(ScenarioError, match="refused; expected a server of OpenIGTLi"):
        Tracker(address, TOOLS).wait(0.1)


# ---- the whole loop


def test_the_robot_stops_with_its_reason_and_goes_on(tmp_path):
    """Tools by a tracker that speaks, goes, comes back, talks garbage, comes back."""
    port = free_port()

    def listen():
        server = socket.create_server(("127.0.0.1", port))
        server.settimeout(5.0)
        return server

    server = listen()
    address = parse(f"igtl://localhost:{port}?patience=0.1", "--tracker", TOOLS)
    tracker = Tracker(address, TOOLS)
    scenario = load_scenario("gauze_static", seed=4, duration=30.0)
    session = Session(scenario, None, tracker)
    tip = np.array(scenario.target.points[0])
    away = np.array(scenario.obstacles[0].points[0])

    def told(client, y=0.0):
        address = tracker.address
        at = {"TargetToReference": (tip, scenario.target.p_WG)}
        at["ObstacleToReference"] = (away + [0, y, 0], scenario.obstacles[0].p_WG)
        for name, (point, fulcrum) in at.items():
            u = (point - fulcrum) / np.linalg.norm(point - fulcrum)
            client.sendall(pose(name, address, point, u).pack())

    def frames(count, client=None):
        for _ in range(count):
            if client:
                told(client)
            session.frame()
            tracker.poll()

    def connected():
        wait(lambda: tracker.poll() or tracker.is_connected)
        return server.accept()[0]

    frames(6)
    assert session.words.startswith("waiting for the tracker's first frame; tracker ")
    client = connected()
    frames(40, client)
    assert session.words == "it moves; tracker connected"
    assert session.speed > 0.01
    # The other program goes.
    client.close()
    server.close()
    wait(lambda: tracker.poll() or not tracker.is_connected)
    frames(60)
    assert "lost by the tracker; tracker " in session.words
    assert session.speed < 1e-3
    # It comes back, and the robot goes on.
    server = listen()
    client = connected()
    frames(60, client)
    assert session.words == "it moves; tracker connected"
    # What is no OpenIGTLink ends the connection; the next one is good again.
    client.sendall(np.random.default_rng(1).bytes(4096))
    wait(lambda: tracker.poll() or tracker.refused)
    frames(60)
    assert "lost by the tracker" in session.words
    client = connected()
    frames(40, client)
    assert session.words == "it moves; tracker connected"
    tracker.close()
    client.close()
    server.close()
    # What was received plays back to the same run.
    played = session.save(tmp_path)
    run = simulate(played)
    assert run.error == ""
    now = session.read("robot.tool", RobotTool).tip
    np.testing.assert_array_equal(run.robot.tool.tip[-1], now)
    assert 0.0 in run.target.estimate.known


# ---- what is sent


def test_slicer_is_told_what_is_where():
    stream = Stream(parse("igtl://127.0.0.1:0?frame=0,0,100,0,0,0", "--stream"))
    slicer = pyigtl.OpenIGTLinkClient("127.0.0.1", stream.port)
    deaf = socket.create_connection(("127.0.0.1", stream.port))
    session = Session(load_scenario("gauze_static", seed=4), None, stream=stream)
    assert session.scenario == load_scenario("gauze_static", seed=4)  # as it is written

    def heard(name):
        end = time.monotonic() + 5.0
        while time.monotonic() < end:
            session.frame()
            if message := slicer.wait_for_message(name, timeout=0):
                return message
        raise AssertionError(name)

    robot = heard("RobotTool")
    expected = np.array(session.scenario.robot.p_WP) - [0.0, 0.0, 0.1]
    assert robot.matrix[:3, 3] == pytest.approx(1e3 * expected, abs=15.0)
    down = robot.matrix[:3, :3] @ [0.0, 0.0, 1.0]
    assert down[2] < -0.5
    assert heard("Obstacle").matrix.shape == (4, 4)
    assert heard("WallForce").string.endswith(" N")
    assert heard("RobotState").string
    assert len(stream.clients) == 2
    # One that takes nothing is not waited for; one that goes is forgotten.
    start = time.process_time()
    for _ in range(3000):
        stream.send([text("RobotState", 300 * "x")])
    assert time.process_time() - start < 3.0
    slicer.stop()
    deaf.close()
    wait(lambda: stream.send([text("RobotState", "x")]) or not stream.clients)
    with pytest.raises(ScenarioError, match="expected a free port"):
        Stream(parse(f"igtl://127.0.0.1:{stream.port}", "--stream"))
    stream.close()


def test_command_line(plus, tmp_path, capsys, monkeypatch):
    ran = []

    def run_scenario(scenario, out, *told):
        ran.append(scenario)
        return SimpleNamespace(metrics={}, error="")

    monkeypatch.setattr("diagrams.live.command.run_scenario", run_scenario)
    tip = load_scenario("gauze_static").target.points[0]
    where = f"igtl://localhost:{plus.port}?target=Stylus&patience=inf"
    plus.send_message(transform("Stylus", 1e3 * np.array(tip)), wait=False)
    words = ["run", "gauze_static", "--duration", "0.3", "--no-replay"]
    words += ["--out", str(tmp_path), "--tracker", where, "--stream", "igtl://:0"]
    assert main(words) == 0
    table = np.loadtxt(tmp_path / "target_recording.csv", delimiter=",", skiprows=1)
    assert np.atleast_2d(table)[-1, -1] == 1.0
    # The tool that the address does not name goes on as it is written.
    assert ran[0].target.tracked == str(tmp_path / "target_recording.csv")
    assert ran[0].obstacles[0].tracked is None
    assert main(["run", "nav_one_static", "--tracker", where]) == 2
    assert "expected a gauze delivery" in capsys.readouterr().err
    assert main(["live", "gauze_static", "--tracker", "igtl:/x"]) == 2
    assert "expected igtl://HOST:PORT" in capsys.readouterr().err
