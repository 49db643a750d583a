"""A resection live."""

from dataclasses import replace

from diagrams.studies import get_study
from tests.lively import begin, play


def test_it_is_watched(monkeypatch):
    study = get_study("resection")
    unplanned = replace(study, prepare=lambda scenario, show: study.outline(scenario))
    monkeypatch.setattr("diagrams.live.session.get_study", lambda name: unplanned)
    session = begin("resect_paper", "spacing=0.001")
    play(session, 20, {}, {5: "tension not read"})
    assert session.time == 0.4
    assert session.words == "a wire of module 1 is slack"
    figures = [figure.value(session) for figure in session._figures]
    assert figures == [0.0, 0.0, session.speed]
