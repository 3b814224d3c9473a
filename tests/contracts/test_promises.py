"""The page of promises names tests that exist, and says so where there is none."""

from tests.contracts.promises import marked_tests, page_rows


def test_page_lists_every_promise_once() -> None:
    assert sorted(page_rows()) == list(range(1, 28))


def test_page_names_only_tests_that_carry_the_number() -> None:
    marked = marked_tests()
    stale = {
        number: sorted(set(tests) - set(marked.get(number, [])))
        for number, (_, tests) in page_rows().items()
    }
    hint = "write the page again: python -m tests.contracts.promises"
    assert not any(stale.values()), f"{stale}; {hint}"


def test_every_number_in_the_tests_is_a_promise() -> None:
    assert marked_tests().keys() <= page_rows().keys()
