"""The page of the papers is what its rows say, and its tests are there."""

from tests import papers


def test_every_item_has_its_test():
    assert papers.missing() == []


def test_the_page_is_up_to_date():
    assert papers.PAGE.read_text() == papers.page(), "run python -m tests.papers"
